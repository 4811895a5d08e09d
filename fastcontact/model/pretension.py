"""Pretension sections: a force or a shortening pulls the two sides of a cut through a bolt together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._tools.argument_types import unit_vector
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.loads import Load, Table, check_number
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint, TemporaryConstraint
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import OPPOSITE, Mesh
from fastcontact.model.relation_rows import matching_nodes, normals_of, relative_to_first, rows_along
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

# Smallest cosine of the angle between the direction of a bolt and the normal of its section [-].
SMALLEST_COSINE = 0.7


@record
class Pretension:
    """A pretension section, whose sides move relative to each other only along its normal, by the same amount at all nodes.

    Attributes
    ----------
    label : str
        Name in results.
    nodes, opposite : ndarray of int (m,)
        Coincident points of the two sides.
    normal : ndarray (dim,)
        Unit vector from the first side to the opposite one, along the bolt [-].
    force : float
        Force that pulls the sides together, at load multiplier 1 [force].
    shortening : float or None
        Relative approach of the sides, at load multiplier 1 [length]; None if the force is given.
    locked_from : float or None
        Load factor from which the shortening is locked [-].
    ramp : tuple, optional
        Ramp of the force or shortening.
    """

    label: str
    nodes: Indices
    opposite: Indices
    normal: Array
    force: float
    shortening: float | None
    locked_from: float | None
    ramp: Table | None

    @property
    def name(self) -> str:
        """Description for messages."""
        return f"pretension '{self.label}'"

    @property
    def constraint_name(self) -> str:
        """Name of the constraint that prescribes the shortening."""
        return f"the shortening of {self.name}"

    def row(self, n_dofs: int) -> csr_array:
        """Return the row (1, n_dofs) whose product with the displacements is the shortening [-]."""
        m = len(self.nodes)
        return csr_array(csr_array(np.full((1, m), 1.0 / m)) @ self._approach(self.normal, n_dofs))

    def _approach(self, direction: Array, n_dofs: int) -> csr_array:
        """Return rows (m, n_dofs) of the approach of each node to the opposite one along a unit vector (dim,) [-]."""
        directions = np.tile(direction, (len(self.nodes), 1))
        return csr_array(rows_along(self.nodes, directions, n_dofs) - rows_along(self.opposite, directions, n_dofs))

    def relations(self, n_dofs: int) -> list[MultiPointConstraint]:
        """Return the constraints.

        The sides do not slide relative to each other, and the shortening is equal at all nodes and, if given, prescribed. A
        locked section keeps its shortening.
        """
        rows = [self._approach(direction, n_dofs) for direction in _tangents(self.normal)]
        approach = self._approach(self.normal, n_dofs)
        if len(self.nodes) > 1:
            rows.append(relative_to_first(approach))
        matrix = csr_array(vstack(rows, format="csr"))
        matrix.eliminate_zeros()
        constraints = [MultiPointConstraint(f"the sides of {self.name}", matrix)]
        if self.shortening is not None:
            constraints.append(MultiPointConstraint(self.constraint_name, self.row(n_dofs), self.shortening, self.ramp))
        if self.locked_from is not None:
            name = f"the locked length of {self.name}"
            constraints.append(TemporaryConstraint(name, self.row(n_dofs), begins=self.locked_from, keeps=True))
        return constraints


@record
class PretensionForce(Load):
    """The force that pulls the sides of a pretension section together."""

    KIND = "the force"
    pretension: Pretension

    @property
    def name(self) -> str:
        """Description for messages."""
        return f"the force of {self.pretension.name}"

    @property
    def group_names(self) -> tuple[str, ...]:
        """No groups, since the force acts between two sides."""
        return ()

    @property
    def components(self) -> Mapping[int, float]:  # type: ignore[override]
        """Components of the force on the first side [force]."""
        return {axis: self.pretension.force * float(n) for axis, n in enumerate(self.pretension.normal) if n}

    @property
    def ramp(self) -> Table | None:  # type: ignore[override]
        """Ramp of the force."""
        return self.pretension.ramp

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        pass

    def _add_to(self, forces: Array, mesh: Mesh, kinematics: str) -> None:
        pretension = self.pretension
        nodal_force = pretension.force / len(pretension.nodes) * pretension.normal
        forces[pretension.nodes] += nodal_force
        forces[pretension.opposite] -= nodal_force


def pretension(
    mesh: Mesh, label: str, section: str, opposite: str | None, normal: Sequence[float] | None,
    prescribed: tuple[float | None, float | None, float | None], ramp: Table | None,
) -> Pretension:  # fmt: skip
    """Return a pretension section after checking it.

    Parameters
    ----------
    mesh : Mesh
    label, section, opposite, normal
        See `Model.add_pretension`.
    prescribed : (float or None, float or None, float or None)
        Force [force], shortening [length], and load factor from which the shortening is locked [-].
    ramp : tuple, optional
        Ramp of the force or shortening.

    Raises
    ------
    MeshError, ModelError
        If the sides do not match, or the prescribed quantities are inconsistent.
    """
    force, shortening, locked_from = prescribed
    name = f"pretension '{label}'"
    if (force is None) == (shortening is None):
        raise ModelError(f"{name} needs either a force or a shortening")
    if shortening is not None and locked_from is not None:
        raise ModelError(f"{name} has a prescribed shortening: locked_from applies to a force only")
    for quantity, value in (("force", force), ("shortening", shortening), ("locked_from", locked_from)):
        if value is not None:
            check_number(f"the {quantity} of {name}", value)
    nodes, opposite_nodes = _sides(mesh, name, section, opposite)
    direction = _outward_direction(mesh, name, section, _normal(mesh, name, nodes, normal))
    return Pretension(label, nodes, opposite_nodes, direction, force or 0.0, shortening, locked_from, ramp)


def _sides(mesh: Mesh, name: str, section: str, opposite: str | None) -> tuple[Indices, Indices]:
    """Return the points (m,) of a section, and the coincident points (m,) of the opposite side."""
    group = section + OPPOSITE if opposite is None else opposite
    nodes = mesh.points_of(section).astype(np.intp)
    if opposite is None and group not in mesh.group_names:
        raise ModelError(
            f"{name}: the mesh is not cut along '{section}', since there is no group '{group}': build the model on "
            f"fc.generate.cut(mesh, '{section}'), or name the opposite side"
        )
    opposite_nodes = mesh.points_of(group).astype(np.intp)
    shared = np.intersect1d(nodes, opposite_nodes)
    if len(shared):
        raise ModelError(f"{name}: '{section}' and '{group}' share point {shared[0]}: the sides need separate nodes")
    match = matching_nodes(mesh, (section, nodes), (group, opposite_nodes), [0.0] * mesh.dim)
    return nodes, opposite_nodes[match]


def _normal(mesh: Mesh, name: str, nodes: Indices, normal: Sequence[float] | None) -> Array:
    """Return the unit vector (dim,) along `normal`, by default the normal of the plane through the nodes."""
    if normal is not None:
        return unit_vector("normal", normal, name, mesh.dim, ModelError)
    arms = mesh.points[nodes] - mesh.points[nodes].mean(axis=0)
    extent, axes = np.linalg.svd(arms, full_matrices=True)[1:]
    if len(nodes) < mesh.dim or (len(extent) >= mesh.dim and extent[-1] > SINGLE_PRECISION * extent[0]):
        raise ModelError(f"the nodes of {name} do not determine a plane: give its normal, along the bolt")
    vector = axes[-1] * np.sign(axes[-1][np.argmax(np.abs(axes[-1]))])
    return np.asarray(np.where(np.abs(vector) < ROUND_OFF, 0.0, vector))


def _outward_direction(mesh: Mesh, name: str, section: str, direction: Array) -> Array:
    """Return `direction` or its opposite (dim,), whichever points out of the body at the section, towards the other side.

    Sections that are not groups of facets keep the direction.
    """
    if section not in mesh.cell_groups or not mesh.cells_of(section, mesh.dim - 1):
        return direction
    mean_normal = normals_of(mesh, section)[1].mean(axis=0)
    cosine = float(direction @ mean_normal / np.linalg.norm(mean_normal))
    if abs(cosine) < SMALLEST_COSINE:
        angle = np.degrees(np.arccos(min(abs(cosine), 1.0)))
        raise ModelError(
            f"the normal of {name} deviates by {angle:.0f} degrees from that of '{section}': omit it, or cut the bolt "
            "perpendicular to its axis"
        )
    return direction if cosine > 0.0 else -direction


def _tangents(normal: Array) -> Array:
    """Return orthonormal vectors (dim - 1, dim) perpendicular to a normal, parallel to the axes if the normal is."""
    axis = int(np.argmax(np.abs(normal)))
    directions = [unit for k, unit in enumerate(np.eye(len(normal))) if k != axis]
    basis = np.linalg.qr(np.column_stack([normal, *directions]))[0][:, 1:].T
    return np.asarray(np.where(np.abs(basis) < ROUND_OFF, 0.0, basis))


def loose_bolts_remark(sections: Sequence[Pretension], modes: Array, force: Array) -> str:
    """Return a remark, to be appended to a message, about unloaded sections that rigid-body motions open.

    `modes` (n_dofs, k) are the displacements in these motions, and `force` (n_points, dim) are the loads [force].
    """
    free = [bolt for bolt in sections if np.abs(bolt.row(len(modes)) @ modes).max(initial=0.0) > SINGLE_PRECISION]
    loose = " and ".join(bolt.name for bolt in free if not force[bolt.nodes].any())
    if not loose:
        return ""
    return f". The force of {loose} is 0: give a loose bolt a small force from the beginning, such as 0.001 of the full force"


def check_locks(sections: Sequence[Pretension], instants: Sequence[float]) -> None:
    """Raise ModelError if a section is locked within a load step, or from the beginning."""
    for bolt in sections:
        locked_from = bolt.locked_from
        if locked_from is None:
            continue
        if locked_from <= 0.0:
            raise ModelError(
                f"{bolt.name} is locked from {locked_from:g}, so that its force never acts: lock it at the end of a load step"
            )
        if instants[0] < locked_from < instants[-1] and locked_from not in instants:
            nearest = min(instants, key=lambda instant: abs(instant - locked_from))
            raise ModelError(
                f"{bolt.name} is locked from {locked_from:g}, but no load step ends there: add this load factor to the ramp, "
                f"or lock it at the end of a step, such as {nearest:g}"
            )


def section_results(
    sections: Sequence[Pretension], displacement: Array, reaction: Array, factors: Sequence[float]
) -> dict[str, dict[str, float]]:
    """Return, by label, the ``force`` in each section, positive in tension [force], and its ``shortening`` [length].

    Parameters
    ----------
    sections : sequence of Pretension
    displacement, reaction : ndarray (n_points, dim)
        Displacements [length] and reactions [force] of a step; reactions include the forces of constraints.
    factors : sequence of float
        Multiplier of the force of each section [-].
    """
    results = {}
    for section, factor in zip(sections, factors, strict=True):
        force = float(reaction[section.nodes].sum(axis=0) @ section.normal) + factor * section.force
        shortening = float((section.row(displacement.size) @ displacement.ravel())[0])
        results[section.label] = {"force": force, "shortening": shortening}
    return results
