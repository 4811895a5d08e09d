"""Forces distributed over a group, with a prescribed point of application of the resultant."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.loads import Load, Table, Traction, check_number
from fastcontact.errors import MeshError, ModelError, check_known
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import ROUND_OFF, TINY

# Weights as functions of the distance over the radius, from 1 at the centre to 0 at the radius.
WEIGHTINGS: dict[str, Callable[[Array], Array]] = {
    "uniform": np.ones_like,
    "linear": lambda s: 1.0 - s,
    "quadratic": lambda s: 1.0 - s**2,
    "cubic": lambda s: 1.0 - 3.0 * s**2 + 2.0 * s**3,
}


@dataclass(frozen=True)
class Spread:
    """Weighting of a group by the distance from a point.

    Attributes
    ----------
    place : tuple of float (dim,)
        [length]
    weighting : str
        ``"uniform"``, ``"linear"``, ``"quadratic"`` or ``"cubic"``.
    radius : float or None
        Distance beyond which weights are zero [length]; None: that of the farthest node.
    """

    place: tuple[float, ...]
    weighting: str = "uniform"
    radius: float | None = None

    def check(self, name: str, dim: int) -> None:
        """Raise ModelError, with the `name` of the load, if it is not admissible."""
        if len(self.place) != dim:
            raise ModelError(f"{name}: the place {self.place} it is spread about must be {dim} numbers")
        for number in self.place:
            check_number(f"a coordinate of the place of {name}", number)
        check_known("weighting", self.weighting, WEIGHTINGS, ModelError, f"{name}: ")
        if self.radius is not None:
            check_number(f"the radius of {name}", self.radius)
            if not self.radius > 0.0:
                raise ModelError(f"the radius of {name} = {self.radius:g} must be positive")

    def weights(self, places: Array, radius: float) -> Array:
        """Return the weights (n,) [-] at `places` (n, dim) [length], zero beyond the radius."""
        s = np.linalg.norm(places - np.array(self.place), axis=1) / radius
        return np.where(s <= 1.0, WEIGHTINGS[self.weighting](np.minimum(s, 1.0)), 0.0)


def shares_of(mesh: Mesh, kinematics: str, group: str, spread: Spread | None = None) -> tuple[Indices, Array]:
    """Return the points (n,) of a group, and their shares (n,) of a distributed load [-].

    Shares are proportional to area, if the group has facets, times the weights of `spread`. Raises ModelError if nothing lies
    inside its radius.
    """
    points, radius = mesh.points_of(group).astype(np.intp), 0.0
    if spread is not None and len(points):
        away = float(np.linalg.norm(mesh.points[points] - np.array(spread.place), axis=1).max())
        radius = away if spread.radius is None else spread.radius

    def weigh(places: Array) -> Array:
        return np.ones(len(places)) if spread is None or not radius else spread.weights(places, radius)

    if group in mesh.cell_groups and mesh.cells_of(group, dim=mesh.dim - 1):
        shares = Traction(group, {0: weigh}, None).vector(mesh, kinematics)[points, 0]
    else:
        shares = weigh(mesh.points[points])
    total = float(shares.sum())
    if len(points) and not total > 0.0:
        raise ModelError(
            f"no part of '{group}' lies within the radius it is spread over: take a larger radius, or another place"
        )
    return points, shares / total if len(points) else shares


def turned(weight: Array, places: Array, moment: Array) -> Array:
    """Return forces (n, dim) [force] at points with a `moment` (1,) or (3,) and no resultant.

    They are proportional to `weight` (n,) [-] and the arms of `places` (n, dim) [length]; see `mean_rotation`.
    """
    return np.asarray(np.einsum("k,knd->nd", moment, mean_rotation(weight, places - weight @ places)))


def mean_rotation(weight: Array, arms: Array) -> Array:
    """Return the coefficients (n_rotations, n, dim) of the displacements of n points in their mean rotation [1 / length].

    The points have `weight` (n,) [-] and `arms` (n, dim) from their centroid [length]. Products with moments are forces
    at the points with this moment, and no resultant.
    """
    motion = by_rotation(arms)
    inertia = np.einsum("n,ndk,ndl->kl", weight, motion, motion)
    if np.linalg.matrix_rank(inertia, tol=ROUND_OFF * np.abs(inertia).max(initial=TINY)) < len(inertia):
        raise ModelError(
            "the points lie in one line or place, so they have no mean rotation about it: take a wider group"
        )
    return np.einsum("kl,ndl,n->knd", np.linalg.inv(inertia), motion, weight)


def by_rotation(arms: Array) -> Array:
    """Return the displacement (..., dim, n_rotations) of the ends of `arms` (..., dim) by each unit rotation [length]."""
    if arms.shape[-1] == 2:
        return np.asarray(([-1.0, 1.0] * arms[..., ::-1])[..., None])
    return np.cross(arms[..., None, :], np.eye(3))


@dataclass(frozen=True)
class SpreadForce(Load):
    """Components of a force [force], distributed over a group by the distance from its point of application."""

    KIND = "the force"
    CONSTANT = True
    group: str
    components: Mapping[int, float]
    spread: Spread
    ramp: Table | None = None

    def _check_place(self, mesh: Mesh, kinematics: str) -> None:
        if kinematics == "axisymmetric":
            raise ModelError(f"{self.name}: in axisymmetry no force acts through a place: give a traction that varies")
        if not len(mesh.points_of(self.group)):
            raise MeshError(f"{self.name}: the group is empty")
        self.spread.check(self.name, mesh.dim)
        self.vector(mesh, kinematics)

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        force = np.zeros(mesh.dim)
        for axis, value in self.components.items():
            force[axis] = value
        points, weight = shares_of(mesh, kinematics, self.group, self.spread)
        places = mesh.points[points]
        nodal = weight[:, None] * force
        arm = np.array(self.spread.place) - weight @ places
        moment = force @ by_rotation(arm)
        size = float(np.ptp(mesh.points, axis=0).max())
        if np.abs(moment).max() > ROUND_OFF * np.abs(force).max() * size:
            try:
                nodal = nodal + turned(weight, places, moment)
            except ModelError as error:
                raise ModelError(f"{self.name}: {error}") from error
        forces[points] += nodal


def spread_of(name: str, point: Sequence[float] | None, weighting: str, radius: float | None) -> Spread | None:
    """Return the weighting about a point, None without one; ModelError if only weighting or radius are given."""
    if point is None:
        if weighting != "uniform" or radius is not None:
            raise ModelError(
                f"{name} has a weighting or a radius, but no place from which distances count: give at=..."
            )
        return None
    return Spread(tuple(float(v) for v in point), weighting, radius)
