"""Material axes: fixed vectors, cylindrical axes, or a function of position."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import check_type, values_at
from fastcontact.arrays import Array
from fastcontact.errors import ModelError
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION

Axes = Sequence[Sequence[float]] | Callable[[Array], Array] | None
# Indices (i, j) of the components xx, yy, zz, xy, yz, xz of stress and strain.
TENSOR_INDICES = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (0, 2))


@dataclass(frozen=True)
class CylindricalAxes:
    """Cylindrical axes about a line: axis 1 is radial, axis 2 circumferential, and axis 3 parallel to the line.

    In plane models, the default direction is normal to the plane. In axisymmetry, the line must be the axis of symmetry, with
    ``direction=(0, 1, 0)``.

    Parameters
    ----------
    origin : (float, float, float)
        A point on the line [length].
    direction : (float, float, float)
        Vector of any length along the line [-].

    Raises
    ------
    ModelError
        If a vector does not have three finite components, or the direction is zero.

    Examples
    --------
    Axes of wood with growth rings about a line parallel to z, and of a coil in an axisymmetric model:

    >>> import fastcontact as fc
    >>> around_z = fc.CylindricalAxes(origin=(10.0, 0.0, 0.0))
    >>> around_y = fc.CylindricalAxes(direction=(0, 1, 0))
    """

    origin: tuple[float, float, float] = (0.0, 0.0, 0.0)
    direction: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def __post_init__(self) -> None:
        for name in ("origin", "direction"):
            check_type(f"{name} of CylindricalAxes", getattr(self, name), Any, ModelError)
            vector = _vectors(getattr(self, name), f"the {name} of cylindrical axes")
            if vector.shape != (3,):
                raise ModelError(f"the {name} of cylindrical axes needs three components, not {getattr(self, name)}")
            object.__setattr__(self, name, tuple(vector.tolist()))
        if not any(self.direction):
            raise ModelError("the direction of cylindrical axes has no length")

    @property
    def around_y(self) -> bool:
        """Whether the line is the y axis."""
        return not any((self.origin[0], self.origin[2], self.direction[0], self.direction[2]))

    def __call__(self, points: Array) -> Array:
        """Return the axes at `points` (n, dim) [length] as unit vectors in rows (n, 3, 3) [-].

        Raises ModelError for points on the line.
        """
        x = np.zeros((len(points), 3))
        x[:, : points.shape[1]] = points
        axis = np.array(self.direction) / np.linalg.norm(self.direction)
        offset = x - self.origin
        radial = offset - (offset @ axis)[:, None] * axis
        radius = np.linalg.norm(radial, axis=1)
        on_line = np.flatnonzero(radius <= LENGTH_ROUND_OFF * np.abs(offset).max(initial=0.0))
        if len(on_line):
            raise ModelError(
                f"a point of a cell at {x[on_line[0]]} lies on the line of the cylindrical axes, where no direction is "
                "radial: give the cells there a material with other axes, or move a node"
            )
        radial /= radius[:, None]
        return np.stack([radial, np.cross(axis, radial), np.broadcast_to(axis, radial.shape)], axis=1)


def checked_axes(axes: Any) -> Axes:
    """Return axes given by vectors as three orthonormal vectors; return functions and None unchanged.

    Raises ModelError unless the axes are one vector with two components, or two or three orthogonal vectors with three
    components that form a right-handed frame.
    """
    if axes is None or callable(axes):
        return axes  # type: ignore[no-any-return]
    vectors = _vectors(axes, "the axes of a material")
    if vectors.shape == (2,):
        vectors = np.array([[*vectors, 0.0], [-vectors[1], vectors[0], 0.0]])
    if vectors.shape not in ((2, 3), (3, 3)):
        raise ModelError(
            f"the axes of a material must be one vector (x, y) for the plane, two or three vectors (x, y, z), or a function; "
            f"not numbers of shape {vectors.shape}"
        )
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    if not lengths.min() > 0.0:
        raise ModelError(f"the axes of a material {vectors.tolist()} contain a zero vector")
    vectors = vectors / lengths
    caption = f"the axes of a material {vectors.tolist()}"
    cosines = np.tril(vectors @ vectors.T, -1)
    i, j = np.unravel_index(np.abs(cosines).argmax(), cosines.shape)
    if abs(cosines[i, j]) > SINGLE_PRECISION:
        angle = np.degrees(np.arccos(np.clip(cosines[i, j], -1.0, 1.0)))
        raise ModelError(
            f"{caption} are not at right angles: the angle between vectors {j + 1} and {i + 1} is {angle:.8g} degrees"
        )
    first, second = vectors[0], vectors[1] - (vectors[1] @ vectors[0]) * vectors[0]
    second /= np.linalg.norm(second)
    third = np.cross(first, second)
    if len(vectors) == 3 and vectors[2] @ third < 0.0:
        raise ModelError(f"{caption} are left-handed: change the sign of the third, or leave it out")
    return tuple(tuple(row) for row in np.array([first, second, third]).tolist())


def frames(axes: Axes, points: Array, kinematics: str) -> Array:
    """Return axes from `checked_axes` at `points` (n, dim) [length] as unit vectors in rows (n, 3, 3) [-].

    Raises ModelError if a function returns an array of a different shape or vectors that are not orthonormal, or if the line
    of cylindrical axes is not the axis of symmetry of an axisymmetric model.
    """
    if not callable(axes):
        return np.broadcast_to(np.eye(3) if axes is None else np.array(axes), (len(points), 3, 3))
    if kinematics == "axisymmetric" and isinstance(axes, CylindricalAxes) and not axes.around_y:
        raise ModelError(
            f"{axes} are not about the axis of symmetry: in axisymmetry their origin is (0, 0, 0) and their direction "
            "(0, 1, 0)"
        )
    values = values_at(axes, points, "the axes of a material", ModelError)
    caption = "the function of a material's axes returned"
    try:
        frame = np.asarray(values, complex if np.iscomplexobj(values) else float)
    except (TypeError, ValueError):
        raise ModelError(f"{caption} {values!r:.80}, not numbers") from None
    if frame.shape != (len(points), 3, 3):
        raise ModelError(
            f"{caption} numbers of shape {frame.shape} for {len(points)} points: it must return three vectors in rows for "
            f"each, shape ({len(points)}, 3, 3)"
        )
    difference = np.abs(frame @ frame.transpose(0, 2, 1) - np.eye(3)).max(axis=(1, 2), initial=0.0)
    wrong = np.flatnonzero(~(difference <= SINGLE_PRECISION) | np.iscomplexobj(frame))
    if len(wrong):
        vectors = f"{frame[wrong[0]].tolist()} at {points[wrong[0]]}"
        raise ModelError(f"{caption} {vectors}: these are not unit vectors at right angles")
    return frame


def rotations(frame: Array) -> Array:
    """Return the matrices (n, 6, 6) [-] that transform stresses from the axes `frame` (n, 3, 3) [-] to the global axes.

    The components are xx, yy, zz, xy, yz, xz.
    """
    rotation = np.empty((len(frame), 6, 6))
    for row, (i, j) in enumerate(TENSOR_INDICES):
        for column, (a, b) in enumerate(TENSOR_INDICES):
            rotation[:, row, column] = frame[:, a, i] * frame[:, b, j]
            if a != b:
                rotation[:, row, column] += frame[:, b, i] * frame[:, a, j]
    return rotation


def rotated_stress(stress: Array, rotation: Array) -> Array:
    """Return stresses (n, 4 or 6) of a body rotated by a rotation matrix (dim, dim) [pressure]."""
    Q, size = np.eye(3), stress.shape[1]
    Q[: len(rotation), : len(rotation)] = rotation
    return np.asarray(stress @ rotations(Q.T[None])[0, :size, :size].T)


def _vectors(values: Any, name: str) -> Array:
    """Return `values` as an array; raise a ModelError that contains `name` if they are not finite numbers."""
    try:
        vectors = np.asarray(values)
    except ValueError:  # the rows have different lengths
        vectors = np.empty(0, object)
    if vectors.dtype.kind not in "iuf" or not np.isfinite(vectors).all():
        raise ModelError(f"{name} = {values!r} must be finite numbers")
    return vectors.astype(float)
