"""Reference points coupled with groups, and forces and moments distributed over groups.

In a rigid coupling all nodes follow the reference point. In a distributing coupling the reference point follows the mean
motion of the nodes. A reference point belongs to no cell. Its rotation, for small angles, is stored as the displacement of a
second point at the same position [radian]. In 3D the components are the rotations about x, y and z; in 2D the first component
is the rotation about z.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.loads import ComponentLoad, Load, Table, Traction, check_number, check_points
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.errors import ModelError, check_known
from fastcontact.linear.sparse_rows import nodal_rows
from fastcontact.mesh.mesh import ROTATION, Mesh
from fastcontact.round_off import ROUND_OFF, TINY

Term = tuple[int, int, float]  # point, component, coefficient
KINDS = ("rigid", "distributing")
# Weights as functions of the ratio of distance to radius. All but the uniform one decrease from 1 to 0.
WEIGHTINGS: dict[str, Callable[[Array], Array]] = {
    "uniform": np.ones_like,
    "linear": lambda s: 1.0 - s,
    "quadratic": lambda s: 1.0 - s**2,
    "cubic": lambda s: 1.0 - 3.0 * s**2 + 2.0 * s**3,
}


@dataclass(frozen=True)
class Spread:
    """Weighting of the nodes of a group by their distance from a point.

    Attributes
    ----------
    place : tuple of float (dim,)
        Position of the point from which distances are measured [length].
    weighting : str
        ``"uniform"``, ``"linear"``, ``"quadratic"`` or ``"cubic"``.
    radius : float or None
        Distance beyond which weights are zero [length]; None for the distance to the farthest node.
    """

    place: tuple[float, ...]
    weighting: str = "uniform"
    radius: float | None = None

    def check(self, name: str, dim: int) -> None:
        """Raise ModelError, with the `name` of the load, if the weighting is not admissible."""
        if len(self.place) != dim:
            raise ModelError(f"{name}: at = {self.place} needs {dim} coordinates")
        for number in self.place:
            check_number(f"a coordinate of the point of {name}", number)
        check_known("weighting", self.weighting, WEIGHTINGS, ModelError, f"{name}: ")
        if self.radius is not None:
            check_number(f"the radius of {name}", self.radius)
            if not self.radius > 0.0:
                raise ModelError(f"the radius of {name} = {self.radius:g} must be positive")

    def weights(self, positions: Array, radius: float) -> Array:
        """Return the weights (n,) [-] at `positions` (n, dim) [length], zero beyond the radius."""
        s = np.linalg.norm(positions - np.array(self.place), axis=1) / radius
        return np.where(s <= 1.0, WEIGHTINGS[self.weighting](np.minimum(s, 1.0)), 0.0)


def shares_of(mesh: Mesh, kinematics: str, group: str, spread: Spread | None = None) -> tuple[Indices, Array]:
    """Return the points (n,) of a group, and their shares (n,) of a distributed load [-].

    Shares are proportional to the weights of `spread` and, if the group has facets, to the tributary areas of the nodes.
    Raises ModelError if no part of the group lies within the radius of `spread`.
    """
    points, radius = mesh.points_of(group).astype(np.intp), 0.0
    if spread is not None and len(points):
        farthest = float(np.linalg.norm(mesh.points[points] - np.array(spread.place), axis=1).max())
        radius = farthest if spread.radius is None else spread.radius

    def weigh(positions: Array) -> Array:
        return np.ones(len(positions)) if spread is None or not radius else spread.weights(positions, radius)

    if group in mesh.cell_groups and mesh.cells_of(group, dim=mesh.dim - 1):
        shares = Traction(group, {0: weigh}, None).vector(mesh, kinematics)[points, 0]
    else:
        shares = weigh(mesh.points[points])
    total = float(shares.sum())
    if len(points) and not total > 0.0:
        remedy = "use a larger radius, or another point"
        raise ModelError(f"no part of '{group}' lies within the radius of the distribution: {remedy}")
    return points, shares / total if len(points) else shares


def mean_rotation(weight: Array, arms: Array, caption: str = "") -> Array:
    """Return the matrix (n_rotations, n, dim) that maps displacements of n points to their mean rotation [1 / length].

    The points have `weight` (n,) [-] and `arms` (n, dim) from their weighted centroid [length]. The transposed matrix
    times a moment yields forces at the points that have this moment and a zero resultant. Raises ModelError, with a message
    that begins with `caption`, if the points coincide or, in 3D, are collinear.
    """
    motion = rotation_displacement(arms)
    inertia = np.einsum("n,ndk,ndl->kl", weight, motion, motion)
    if np.linalg.matrix_rank(inertia, tol=ROUND_OFF * np.abs(inertia).max(initial=TINY)) < len(inertia):
        raise ModelError(
            f"{caption}the points are collinear or coincide, so that their mean rotation is undetermined: use a group of "
            "larger extent"
        )
    return np.einsum("kl,ndl,n->knd", np.linalg.inv(inertia), motion, weight)


def rotation_displacement(arms: Array) -> Array:
    """Return the displacement (..., dim, n_rotations) of the ends of `arms` (..., dim) due to unit rotations [length]."""
    if arms.shape[-1] == 2:
        return np.asarray((np.array([-1.0, 1.0]) * arms[..., ::-1])[..., None])
    return np.cross(arms[..., None, :], np.eye(3))


def forces_of_moment(weight: Array, positions: Array, moment: Array, caption: str) -> Array:
    """Return nodal forces (n, dim) [force] that have the `moment` (1,) or (3,) [force times length] and a zero resultant.

    They are proportional to `weight` (n,) [-] and to the arms of `positions` (n, dim) [length]; see `mean_rotation`.
    """
    return np.asarray(np.einsum("k,knd->nd", moment, mean_rotation(weight, positions - weight @ positions, caption)))


@dataclass(frozen=True)
class SpreadForce(Load):
    """Components of a force [force] through a point, distributed over a group by the distances of nodes from this point."""

    KIND = "the force"
    CONSTANT = True
    group: str
    components: Mapping[int, float]
    spread: Spread
    ramp: Table | None = None

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        if kinematics == "axisymmetric":
            raise ModelError(f"{self.name}: in axisymmetry a force cannot act at a point: use a varying traction")
        check_points(mesh, self.group, f"{self.name} acts nowhere")
        self.spread.check(self.name, mesh.dim)
        self.vector(mesh, kinematics)

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        force = np.array([self.components.get(axis, 0.0) for axis in range(mesh.dim)])
        points, weight = shares_of(mesh, kinematics, self.group, self.spread)
        positions = mesh.points[points]
        nodal = weight[:, None] * force
        arm = np.array(self.spread.place) - weight @ positions
        moment = force @ rotation_displacement(arm)
        size = float(np.ptp(mesh.points, axis=0).max())
        if np.abs(moment).max() > ROUND_OFF * np.abs(force).max() * size:
            nodal = nodal + forces_of_moment(weight, positions, moment, f"{self.name}: ")
        forces[points] += nodal


class Moment(ComponentLoad):
    """Components of a moment [force times length] about x, y and z, on a reference point or distributed over a group."""

    KIND, CONSTANT = "the moment", True
    components: Mapping[int, float]

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        if kinematics == "axisymmetric":
            raise ModelError(f"{self.name}: a moment cannot act on an axisymmetric model, since its resultant is zero")
        check_points(mesh, self.group, f"{self.name} acts nowhere")

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        moment = np.array([self.components.get(axis, 0.0) for axis in ((2,) if mesh.dim == 2 else range(3))])
        if self.group + ROTATION in mesh.point_groups:
            forces[mesh.point(self.group + ROTATION), : len(moment)] += moment
            return
        points, weight = shares_of(mesh, kinematics, self.group)
        forces[points] += forces_of_moment(weight, mesh.points[points], moment, f"{self.name}: ")


class ReferencePoint(NamedTuple):
    """The numbers of a reference point and of the point that stores its rotation."""

    point: int
    rotation: int


def reference_of(mesh: Mesh, name: str) -> ReferencePoint:
    """Return a reference point by the name of its group. Raises ModelError if there is no such point."""
    if name + ROTATION not in mesh.point_groups:
        raise ModelError(
            f"'{name}' is not a reference point: build the model on "
            f"fc.generate.with_reference_points(mesh, {{'{name}': (...)}})"
        )
    return ReferencePoint(mesh.point(name), mesh.point(name + ROTATION))


def relation(
    name: str, rows: Sequence[Sequence[Term]], shape: tuple[int, int], value: float = 0.0, ramp: Table | None = None
) -> MultiPointConstraint:
    """Return linear equations as a multi-point constraint of a mesh with points of `shape` (n_points, dim).

    Each of the `rows` is the list of terms of an equation, whose sum is `value` times the multiplier of `ramp`.
    """
    n_points, dim = shape
    row = [i for i, terms in enumerate(rows) for _ in terms]
    column = [point * dim + axis for terms in rows for point, axis, _ in terms]
    values = [coefficient for terms in rows for _, _, coefficient in terms]
    matrix = csr_array((values, (row, column)), shape=(len(rows), n_points * dim))
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return MultiPointConstraint(name, matrix, value, ramp)


def rigid_rows(x: Array, reference: ReferencePoint, points: Indices, directions: Array) -> csr_array:
    """Return the rows (n k, n_dofs) of a rigid coupling: points follow the translation and rotation of a reference point.

    Parameters
    ----------
    x : ndarray (n_points, dim)
        Reference coordinates of all points [length].
    reference : ReferencePoint
    points : ndarray of int (n,)
    directions : ndarray (n, k, dim)
        Unit vectors of the components that are coupled at each point [-].
    """
    n, k, dim = directions.shape
    nodes = np.column_stack([points, np.tile(reference, (n, 1))])
    arms = directions @ rotation_displacement(x[points] - x[reference.point])
    arms = np.pad(arms, ((0, 0), (0, 0), (0, dim - arms.shape[2])))
    values = np.stack([directions, -directions, -arms], axis=2)
    return nodal_rows(np.repeat(nodes, k, axis=0), values.reshape(n * k, 3, dim), x.size)


def distributing_rows(
    x: Array, reference: ReferencePoint, points: Indices, weight: Array, directions: Array, caption: str = ""
) -> csr_array:
    """Return the rows (m, n_dofs) of a distributing coupling: a reference point follows the mean motion of points.

    The rotation theta is determined by least squares, ``J theta = sum of w r x u``, where w is the weight of a
    point, u its displacement, r its arm from the weighted centroid of all points and ``J = sum of w (r . r I - r r^T)``.

    Parameters
    ----------
    x : ndarray (n_points, dim)
        Reference coordinates of all points [length].
    reference : ReferencePoint
    points : ndarray of int (n,)
    weight : ndarray (n,)
        Weights of sum 1 [-].
    directions : ndarray (k, dim)
        Unit vectors of the components that are coupled [-].
    caption : str
        Beginning of error messages.

    Raises
    ------
    ModelError
        If the points coincide or, in 3D, are collinear.
    """
    centroid, dim = weight @ x[points], x.shape[1]
    rotation = mean_rotation(weight, x[points] - centroid, caption)
    arms = directions @ rotation_displacement(x[reference.point] - centroid)
    # The coefficients of the translation and of the rotation of the reference point.
    reference_rows = np.zeros((len(rotation) + len(directions), 2, dim))
    reference_rows[: len(rotation), 1] = np.eye(len(rotation), dim)
    reference_rows[len(rotation) :, 0], reference_rows[len(rotation) :, 1, : len(rotation)] = directions, -arms
    means = np.concatenate([rotation, directions[:, None] * weight[:, None]])
    nodes = np.tile([*reference, *points], (len(reference_rows), 1))
    return nodal_rows(nodes, np.concatenate([reference_rows, -means], axis=1), x.size)


def coupling(
    mesh: Mesh, kinematics: str, names: tuple[str, str], kind: str, axes: Sequence[int],
    weighting: tuple[str, float | None] = ("uniform", None),
) -> MultiPointConstraint:  # fmt: skip
    """Return the multi-point constraint of a coupling.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    names : (str, str)
        Names of the reference point and of the coupled group.
    kind : {"rigid", "distributing"}
    axes : sequence of int
        Coupled components; all for a distributing coupling.
    weighting : (str, float or None)
        Weighting and radius of a distributing coupling, by the distance from the reference point; see `Spread`.

    Raises
    ------
    MeshError, ModelError
        If there are no such groups, or they cannot be coupled.
    """
    name = f"the coupling of '{names[0]}' with '{names[1]}'"
    check_known("kind of coupling", kind, KINDS, ModelError)
    if kinematics == "axisymmetric":
        raise ModelError(
            f"{name}: in axisymmetry there are no rotations; use couple('{names[1]}', 'y') to move a group as a whole"
        )
    if kind == "distributing" and len(axes) < mesh.dim:
        raise ModelError(f"{name}: a distributing coupling couples all components of the displacement")
    reference = reference_of(mesh, names[0])
    spread = None
    if weighting != ("uniform", None):
        if kind == "rigid":
            raise ModelError(f"{name}: a rigid coupling has no weighting or radius, since all nodes follow the point")
        spread = Spread(tuple(mesh.points[reference.point].tolist()), *weighting)
        spread.check(name, mesh.dim)
    points, weight = shares_of(mesh, kinematics, names[1], spread)
    if np.isin(points, reference).any() or not len(points):
        raise ModelError(f"{name}: the group must have points and must not contain the reference point")
    directions = np.eye(mesh.dim)[list(axes)]
    if kind == "rigid":
        at_points = np.tile(directions, (len(points), 1, 1))
        return MultiPointConstraint(name, rigid_rows(mesh.points, reference, points, at_points))
    rows = distributing_rows(mesh.points, reference, points, weight, directions, f"{name}: ")
    return MultiPointConstraint(name, rows)
