"""Rigid shapes: half-space, sphere, cylinder, flat punch, and surfaces given by their height."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fastcontact._tools.argument_types import finite_vector, typed
from fastcontact.arrays import Array
from fastcontact.contact.obstacles._obstacle import Obstacle
from fastcontact.errors import ContactError
from fastcontact.round_off import ROUND_OFF


def _check_positive(**values: float) -> None:
    """Raise ContactError if one of the named values is not positive."""
    for name, value in values.items():
        if not (math.isfinite(value) and value > 0):
            raise ContactError(f"{name} = {value} of a rigid obstacle must be a positive number")


def _vector(name: str, values: ArrayLike, dim: int) -> Array:
    """Return the parameter `name` as a vector (dim,); ContactError if it is not one."""
    vector = finite_vector(values, dim)
    if vector is None:
        raise ContactError(f"{name} = {values!r} of a rigid obstacle must be {dim} finite numbers, one per coordinate")
    return vector


def _outward_sign(side: str) -> float:
    """Return the sign of the outward normal along the last coordinate for an obstacle below or above the body."""
    if side not in ("below", "above"):
        raise ContactError(f"side = '{side}' of a rigid obstacle must be 'below' or 'above' the body")
    return 1.0 if side == "below" else -1.0


@typed(ContactError)
@dataclass(frozen=True)
class HalfSpace:
    """A half-space bounded by a plane.

    Parameters
    ----------
    point : sequence of float (dim,)
        A point of the plane [length].
    normal : sequence of float (dim,)
        Outward direction, of any length [-].

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> floor = obstacles.HalfSpace(point=(0.0, 0.0), normal=(0.0, 1.0))
    >>> gaps, normals = floor.distance(np.array([[3.0, 0.5]]))
    >>> gaps
    array([0.5])
    """

    point: tuple[float, ...]
    normal: tuple[float, ...]

    def distance(self, points: Array) -> tuple[Array, Array]:
        """See `Obstacle.distance`."""
        dim = points.shape[1]
        normal = _vector("normal", self.normal, dim)
        length = np.linalg.norm(normal)
        if length == 0:
            raise ContactError("the normal of a rigid half-space must not be zero")
        normal = normal / length
        return (points - _vector("point", self.point, dim)) @ normal, np.broadcast_to(normal, points.shape).copy()


@typed(ContactError)
@dataclass(frozen=True)
class Sphere:
    """A ball, or a spherical cavity if `hollow`.

    In plane models it represents a circular cylinder. In axisymmetry it is a torus if the centre is not on the axis.

    Parameters
    ----------
    centre : sequence of float (dim,)
        Centre [length].
    R : float
        Radius [length].
    hollow : bool
        Whether the deformable body lies inside.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> ball = obstacles.Sphere(centre=(0.0, 10.0), R=10.0)
    >>> gaps, normals = ball.distance(np.array([[0.0, -1.0]]))
    >>> gaps
    array([1.])
    """

    centre: tuple[float, ...]
    R: float
    hollow: bool = False

    def __post_init__(self) -> None:
        _check_positive(R=self.R)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """See `Obstacle.distance`."""
        offset = points - _vector("centre", self.centre, points.shape[1])
        length = np.linalg.norm(offset, axis=1)
        away = np.zeros_like(offset)
        away[:, -1] = 1.0  # at the centre itself every direction is outward
        np.divide(offset, length[:, None], out=away, where=length[:, None] > 0)
        return (self.R - length, -away) if self.hollow else (length - self.R, away)


@typed(ContactError)
@dataclass(frozen=True)
class Cylinder:
    """A circular cylinder of any direction in three dimensions, or a cylindrical cavity if `hollow`.

    Parameters
    ----------
    point, axis : sequence of float (3,)
        A point of the axis [length], and its direction, of any length [-].
    R : float
        Radius [length].
    hollow : bool
        Whether the body lies inside.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> hole = obstacles.Cylinder(point=(0.0, 0.0, 0.0), axis=(0.0, 0.0, 1.0), R=10.0, hollow=True)
    >>> gaps, normals = hole.distance(np.array([[9.0, 0.0, 5.0]]))
    >>> gaps
    array([1.])
    """

    point: tuple[float, float, float]
    axis: tuple[float, float, float]
    R: float
    hollow: bool = False

    def __post_init__(self) -> None:
        _check_positive(R=self.R, length=float(np.linalg.norm(self.axis)))

    def distance(self, points: Array) -> tuple[Array, Array]:
        """See `Obstacle.distance`."""
        if points.shape[1] != 3:
            raise ContactError("a rigid cylinder needs a three-dimensional model; in two dimensions use a sphere")
        axis = np.asarray(self.axis) / np.linalg.norm(self.axis)
        offset = points - np.asarray(self.point)
        offset -= np.outer(offset @ axis, axis)
        return Sphere((0.0, 0.0, 0.0), self.R, self.hollow).distance(offset)


@typed(ContactError)
@dataclass(frozen=True)
class Height:
    """The region below or above a surface whose height is a function of the other coordinates.

    Parameters
    ----------
    function : callable
        Height [length] for positions (n, dim - 1), and its slopes: ``f(x) -> (h (n,), slope (n, dim - 1))``.
    side : str
        Position of the obstacle: ``"below"`` or ``"above"`` the body.

    Examples
    --------
    A wavy floor in 2D:

    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> def waves(x):
    ...     return 0.1 * np.cos(x[:, 0]), -0.1 * np.sin(x)
    >>> gaps, normals = obstacles.Height(waves).distance(np.array([[0.0, 1.0]]))
    >>> gaps
    array([0.9])
    """

    function: Callable[[Array], tuple[Array, Array]]
    side: str = "below"

    def __post_init__(self) -> None:
        _outward_sign(self.side)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """See `Obstacle.distance`."""
        sign = _outward_sign(self.side)
        height, slope = self.function(points[:, :-1])
        normal = np.column_stack([-slope, np.ones(len(points))])
        length = np.linalg.norm(normal, axis=1)
        return sign * (points[:, -1] - height) / length, sign * normal / length[:, None]


@typed(ContactError)
def paraboloid(R: float, tip: float = 0.0, side: str = "above") -> Height:
    """Return a paraboloid of revolution, a parabola in two dimensions.

    Parameters
    ----------
    R : float
        Radius of curvature at the tip [length].
    tip : float
        Height of the tip above the origin [length].
    side : str
        Position of the obstacle: ``"above"`` or ``"below"`` the body.

    Returns
    -------
    Height

    Raises
    ------
    ContactError
        If `R` is not positive, or `side` is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> gaps, normals = obstacles.paraboloid(R=10.0, tip=1.0).distance(np.array([[0.0, 0.0]]))
    >>> gaps
    array([1.])
    """
    _check_positive(R=R)
    sign, tip_height = -_outward_sign(side), float(np.asarray(tip))

    def height(x: Array) -> tuple[Array, Array]:
        return tip_height + sign * (x * x).sum(axis=1) / (2 * R), sign * x / R

    return Height(height, side)


@typed(ContactError)
def cone(slope: float, tip: float = 0.0, side: str = "above") -> Height:
    """Return a cone, a wedge in two dimensions; at its tip the normal is parallel to the axis.

    Parameters
    ----------
    slope : float
        Tangent of the angle between the side of the cone and the plane normal to its axis [-].
    tip : float
        Height of the tip above the origin [length].
    side : str
        Position of the obstacle: ``"above"`` or ``"below"`` the body.

    Returns
    -------
    Height

    Raises
    ------
    ContactError
        If `slope` is not positive, or `side` is unknown.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> gaps, normals = obstacles.cone(slope=0.1, tip=1.0).distance(np.array([[0.0, 0.0]]))
    >>> gaps
    array([1.])
    """
    _check_positive(slope=slope)
    sign = -_outward_sign(side)

    def height(x: Array) -> tuple[Array, Array]:
        r = np.linalg.norm(x, axis=1)
        beyond_tip = r > ROUND_OFF * r.max(initial=0.0)  # in a rotated model, round-off moves a point off the tip
        away = np.divide(x, r[:, None], out=np.zeros_like(x), where=beyond_tip[:, None])
        return tip + sign * slope * r, sign * slope * away

    return Height(height, side)


@typed(ContactError)
@dataclass(frozen=True)
class FlatPunch:
    """A flat punch of a given radius (half-width in plane models) without flanks.

    Parameters
    ----------
    radius : float
        Radius or half-width [length].
    height : float
        Height of the face above the origin [length].
    side : str
        Position of the punch: ``"above"`` or ``"below"`` the body.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import obstacles
    >>> gaps, normals = obstacles.FlatPunch(radius=1.0, height=2.0).distance(np.array([[0.5, 1.0], [3.0, 1.0]]))
    >>> gaps
    array([ 1., inf])
    """

    radius: float
    height: float = 0.0
    side: str = "above"

    def __post_init__(self) -> None:
        _check_positive(radius=self.radius)
        _outward_sign(self.side)

    def distance(self, points: Array) -> tuple[Array, Array]:
        """See `Obstacle.distance`; infinite beyond the edge."""
        sign = _outward_sign(self.side)
        normal = np.zeros_like(points)
        normal[:, -1] = sign
        gap = sign * (points[:, -1] - self.height)
        beyond_edge = np.linalg.norm(points[:, :-1], axis=1) > self.radius * (1 + ROUND_OFF)
        return np.where(beyond_edge, np.inf, gap), normal


# Shapes by name in case files.
SHAPES: dict[str, Callable[..., Obstacle]] = {
    "half_space": HalfSpace,
    "sphere": Sphere,
    "cylinder": Cylinder,
    "paraboloid": paraboloid,
    "cone": cone,
    "flat_punch": FlatPunch,
}
