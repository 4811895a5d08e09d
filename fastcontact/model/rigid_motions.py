"""Rigid-body modes left free by supports and multi-point constraints, and whether contact can stop them.

A body in contact is in equilibrium if the loads do no positive work on motions that open gaps or leave them unchanged. The
loads then lie inside the cone of the contact forces (Fichera, 1964; Lions and Stampacchia, 1967).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array, vstack

from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.stiffness import rigid_modes
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import RigidParts, bodies, rigid_parts

MODE_NAMES = {
    "axisymmetric": ("translation along y (the axis)",),
    "plane_strain": ("translation along x", "translation along y", "rotation"),
    "plane_stress": ("translation along x", "translation along y", "rotation"),
    "3d": tuple(f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"),
}
# Tolerance relative to the motions, whose largest displacement is about 1.
ZERO = 1e-8
# A motion that contact does not stop within this multiple of the size of the model is unbounded.
FAR = 1e3
# Number of edges of the pyramid that approximates Coulomb's cone in three dimensions: forces up to 8 % outside the cone are
# accepted here.
EDGES = 8
# Largest factor on the coefficient of friction that is considered to hold a body.
MOST_FRICTION = 100.0
# Largest number of motions of parts between hinges; a mesh with more is defective.
MANY = 1500


class Label(NamedTuple):
    """Name of an elementary motion; for a rotation of a body also its `centre` (dim,) and largest arm [length]."""

    body: str
    motion: str
    centre: Array | None = None
    arm: float = 1.0


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """Independent rigid-body motions that supports and constraints allow.

    The largest entry of each column of the `displacement` (n_dofs, k) of all points is about 1. `parts` (p, k) are the same
    motions as combinations of elementary ones, and `labels` are the names of the elementary motions. `hinges` (m,) are nodes
    that connect parts of bodies, single or collinear.
    """

    displacement: Array
    parts: Array
    labels: list[Label]
    hinges: Indices = field(default_factory=lambda: np.empty(0, np.intp))

    def __len__(self) -> int:
        return self.displacement.shape[1]

    def combined(self, coefficients: Array) -> FreeMotions:
        """Return the motions ``displacement @ coefficients``, coefficients (k, j)."""
        return replace(self, displacement=self.displacement @ coefficients, parts=self.parts @ coefficients)

    def names(self) -> list[str]:
        """Return a description of each motion: the bodies and elementary motions that it combines."""
        return ["; ".join(f"{body}: {motion}" for body, motion in self._mixed(column)) for column in self.parts.T]

    def by_body(self) -> dict[str, list[str]]:
        """Return the names of the motions of each body, each once, even if joint motions contain it repeatedly."""
        by_body: dict[str, list[str]] = {}
        for column in _reduced(self.parts).T:
            for body, motion in self._mixed(column):
                by_body.setdefault(body, []).append(motion)
        return {body: list(dict.fromkeys(motions)) for body, motions in by_body.items()}

    def _mixed(self, column: Array) -> list[tuple[str, str]]:
        mixed: dict[str, list[int]] = {}
        for i in np.flatnonzero(np.abs(column) > 1e-6 * np.abs(column).max()):
            mixed.setdefault(self.labels[i].body, []).append(int(i))
        return [(body, self._described(column, rows)) for body, rows in mixed.items()]

    def _described(self, column: Array, rows: list[int]) -> str:
        """Return the name of the motion of a body: a rotation about a point or line, if it is one, or all its parts."""
        labels = [self.labels[i] for i in rows]
        apart, turn = np.zeros((2, 3))
        for i, label in zip(rows, labels, strict=True):
            axis = "xyz".find(label.motion[-1])  # "rotation" in the plane: about z
            (apart if label.centre is None else turn)[axis] += column[i] / label.arm
        centre, square = next((label.centre for label in labels if label.centre is not None), None), turn @ turn
        if centre is None or abs(apart @ turn) > 1e-6 * square * max(label.arm for label in labels):
            return " with ".join(label.motion for label in labels)
        if len(centre) == 3 and not apart.any() and len(rows) == 1:
            return labels[0].motion
        size = max(label.arm for label in labels)
        at = centre + (np.cross(turn, apart) / square)[: len(centre)]
        place = _listed(np.where(np.abs(at) > 1e-5 * size, at, 0.0))
        along = turn / turn[np.argmax(np.abs(turn))]
        line = f" along {_listed(np.where(np.abs(along) > 1e-6, along, 0.0))}"
        return f"rotation about {place}" if len(centre) == 2 else f"rotation about the line through {place}{line}"


def grouped(names: Iterable[str]) -> str:
    """Return the names of motions, as `FreeMotions.names` returns them, in one string that names each body once."""
    by_body: dict[str, list[str]] = {}
    for body, _, motion in (name.rpartition(": ") for name in names):
        by_body.setdefault(body, []).append(motion)
    return "; ".join(f"{body}: {', '.join(motions)}" for body, motions in by_body.items())


def _reduced(A: Array) -> Array:
    """Return the reduced column echelon form (p, k) of a matrix A (p, k) of full column rank."""
    A, done = A.copy(), 0
    for row in A:  # a view, which follows the elimination
        if done == A.shape[1]:
            break
        pivot = done + int(np.argmax(np.abs(row[done:])))
        if abs(row[pivot]) <= ZERO * np.abs(A).max():
            continue
        A[:, [done, pivot]] = A[:, [pivot, done]]
        A[:, done] /= row[done]
        others = np.arange(A.shape[1]) != done
        A[:, others] -= A[:, [done]] * row[others]
        done += 1
    return A


def _listed(values: Array) -> str:
    return f"({', '.join(f'{value:.4g}' for value in values)})"


def body_name(mesh: Mesh, body: AnyArray, number: int) -> str:
    """Return a name for a body, given the `body` of each point: the cell group of exactly its solid cells, or its number."""
    members = np.flatnonzero(body == number)
    return _group_of(mesh, members) or f"number {number + 1} (around {mesh.points[members].mean(axis=0)})"


def _group_of(mesh: Mesh, members: Indices) -> str:
    """Return the name of the cell group whose solid cells have exactly the nodes `members`, empty if there is none."""
    for group in mesh.cell_groups:
        blocks = mesh.cells_of(group, dim=mesh.dim)
        if blocks and np.array_equal(np.unique(np.concatenate([block.ravel() for block in blocks.values()])), members):
            return f"'{group}'"
    return ""


def free_motions(mesh: Mesh, kinematics: str, fixed: Mask, relations: csr_array | None = None) -> FreeMotions:
    """Return the rigid-body motions that the supports `fixed` (n_points, dim) and the constraints allow.

    Bodies move as a whole; parts of a body that are connected at single nodes rotate about these. `relations` (m, n_dofs) are
    rows R with ``R u = 0``; points without a body move freely if constraints contain them.
    """
    dofs = mesh.n_points * mesh.dim
    motions = _of_bodies(mesh, kinematics, fixed)
    columns, matrices, labels = [motions.displacement], [motions.parts], list(motions.labels)
    if relations is not None:
        reference = bodies(mesh)[1][relations.indices // mesh.dim] < 0
        for dof in np.unique(relations.indices[reference & ~fixed.ravel()[relations.indices]]):
            columns.append(np.eye(dofs, 1, -int(dof)))
            matrices.append(np.ones((1, 1)))
            labels.append(Label(f"point {dof // mesh.dim}", f"translation along {'xyz'[dof % mesh.dim]}"))
    motions = FreeMotions(np.hstack(columns), np.asarray(block_diag(*matrices), float), labels, motions.hinges)
    if relations is None or not relations.shape[0] or not len(motions):
        return motions
    return motions.combined(_null_space(relations @ motions.displacement))


def _of_bodies(mesh: Mesh, kinematics: str, fixed: Mask) -> FreeMotions:
    """Return the motions of bodies, and of their parts at hinges, that the supports `fixed` (n_points, dim) leave free."""
    rigid = _parts_of(mesh, kinematics)
    moving: list[tuple[Indices, Array]] = []  # nodes (m,) of a part, and its motions (m, dim, k) there
    matrices, labels = [np.empty((0, 0))], []
    for number in range(rigid.count):
        members = rigid.nodes_of(number)
        modes = rigid_modes(mesh.points[members], kinematics)
        arms = np.abs(modes).max(axis=0)
        modes = modes / arms
        free = _null_space(modes[fixed[members].ravel()])  # combinations of the part's modes without support
        moving.append((members, (modes @ free).reshape(len(members), mesh.dim, -1)))
        if free.shape[1]:
            matrices.append(free)
            name, centre = _part_name(mesh, rigid, number), mesh.points[members].mean(axis=0)
            labels += [
                Label(name, motion, centre if motion.startswith("rotation") else None, float(arm))
                for motion, arm in zip(MODE_NAMES[kinematics], arms, strict=True)
            ]
    kept = _turning_about(mesh, rigid, moving)
    spans = np.split(kept, np.cumsum([motion.shape[2] for _, motion in moving]))
    displacement = np.zeros((mesh.n_points, mesh.dim, kept.shape[1]))
    for number, ((members, motion), span) in enumerate(zip(moving, spans[:-1], strict=True)):
        members_of_body = rigid.part[members] == number
        displacement[members[members_of_body]] = motion[members_of_body] @ span
    return FreeMotions(
        displacement.reshape(mesh.points.size, kept.shape[1]), np.asarray(block_diag(*matrices), float) @ kept, labels,
        np.unique(rigid.hinge_node),
    )  # fmt: skip


def _parts_of(mesh: Mesh, kinematics: str) -> RigidParts:
    """Return the rigid parts: bodies, or parts of them between hinges."""
    if kinematics != "axisymmetric":
        return rigid_parts(mesh)
    # Rings move only along the axis, and a single common node transmits this motion.
    count, body = bodies(mesh)
    return RigidParts(count, body.astype(np.intp), np.empty(0, np.intp), np.empty(0, np.intp))


def _turning_about(mesh: Mesh, rigid: RigidParts, moving: list[tuple[Indices, Array]]) -> Array:
    """Return the combinations (k, j) of the motions of all parts for which nodes at hinges stay together."""
    width = sum(motion.shape[2] for _, motion in moving)
    if not len(rigid.hinge_node):
        return np.eye(width)
    if width > MANY:
        raise ModelError(
            f"the mesh consists of {rigid.count} parts that are connected only at single nodes or along lines (first: "
            f"{node_at(mesh, rigid.hinge_node[0])}): let cells share whole facets"
        )
    ends = np.cumsum([0] + [motion.shape[2] for _, motion in moving])
    at_hinges = np.zeros((len(rigid.hinge_node), mesh.dim, width))
    for row, (node, number) in enumerate(zip(rigid.hinge_node, rigid.hinge_part, strict=True)):
        members, motion = moving[number]
        at_hinges[row, :, ends[number] : ends[number + 1]] = motion[np.searchsorted(members, node)]
    same = rigid.hinge_node[1:] == rigid.hinge_node[:-1]
    return _null_space((at_hinges[1:] - at_hinges[:-1])[same].reshape(int(same.sum()) * mesh.dim, width))


def node_at(mesh: Mesh, node: int) -> str:
    """Return the number and the position of a node for messages."""
    return f"point {node} at ({', '.join(f'{x:.6g}' for x in mesh.points[node])})"


def _part_name(mesh: Mesh, rigid: RigidParts, number: int) -> str:
    """Return the name of a body, or of a part of one and the first node at which it is attached to others."""
    _, body = bodies(mesh)
    members, hinges = rigid.nodes_of(number), rigid.hinges_of(number)
    name = f"body {body_name(mesh, body, int(body[members[0]]))}"
    if not len(hinges):
        return name
    place = _group_of(mesh, members) or f"around {mesh.points[members].mean(axis=0)}"
    return f"{name}, the part {place} that hangs at {node_at(mesh, hinges[0])}"


def _null_space(A: Array) -> Array:
    """Return an orthonormal basis (k, j) of the vectors that A (m, k) maps to zero."""
    k = A.shape[1]
    _, values, right = np.linalg.svd(np.vstack([A, np.zeros((k, k))]), full_matrices=False)
    return np.asarray(right[values < ZERO * max(values.max(initial=0.0), 1.0)].T)


def resisting(constraints: Constraints, factor: float = 1.0) -> tuple[csr_array, Array]:
    """Return rows and gaps at u = 0 that must stay >= 0 without slip: gaps, and edges of the friction cone.

    A contact force lies in the cone of the rows: normal, with friction in the plane ``n + mu t`` and ``n - mu t``, in 3D
    the pyramid with EDGES circumscribed to Coulomb's cone. Equations act in both directions. `factor` multiplies the
    coefficients of friction.
    """
    rows, gap0 = _edges(constraints, factor)
    backwards = np.flatnonzero(np.resize(constraints.equality, len(gap0)))
    both = csr_array(vstack([rows, -rows[backwards]], format="csr"))
    return both, np.concatenate([gap0, -gap0[backwards]])


def _edges(constraints: Constraints, factor: float) -> tuple[csr_array, Array]:
    """Return the rows and gaps of contact that may open."""
    if not constraints.tangents:
        return constraints.B, constraints.gap0
    if len(constraints.tangents) == 1:
        around = np.array([[1.0], [-1.0]])
    else:
        angle = 2.0 * np.pi * np.arange(EDGES) / EDGES
        around = np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / EDGES)
    shear = [T.multiply(factor * constraints.friction[:, None]) for T in constraints.tangents]
    edges = [constraints.B + sum(weight * T for T, weight in zip(shear, parts)) for parts in around]
    return csr_array(vstack(edges, format="csr")), np.tile(constraints.gap0, len(edges))


def generalised(motions: FreeMotions, force: Array, largest: float = 0.0) -> Array:
    """Return the work (k,) that nodal forces (n_dofs,) do on each motion; round-off counts as zero [force].

    Round-off is estimated from these forces, and from the `largest` earlier works, of which they may be the remainder.
    """
    work = motions.displacement.T @ force
    scale = np.maximum(np.abs(motions.displacement).T @ np.abs(force), largest)
    work[np.abs(work) <= 1e-10 * scale] = 0.0
    return work


def unstopped(gaps: Array, works: Array) -> Array:
    """Return motions (k, j) that neither contact nor contact and loads together can stop.

    `gaps` (m, k) are the changes of the gaps and `works` (l, k) the works of the loads for each motion, whose largest
    displacement is about 1. A motion is stopped if it changes a gap, and closes a gap or is driven by a load. The solution
    decides whether the load drives it towards the contact or away from it.
    """
    k = gaps.shape[1]
    gaps = np.where(np.abs(gaps) > ZERO, gaps, 0.0)
    indifferent = _null_space(gaps)
    if indifferent.shape[1]:
        return indifferent
    scale = np.abs(works).max(axis=1, initial=0.0)
    driven = works[scale > 0] / scale[scale > 0, None]
    for axis in range(k):
        for sign in (1.0, -1.0):
            away = _extreme(sign * np.eye(k)[axis], gaps, np.zeros(len(gaps)), driven, 1.0)
            if np.abs(away).max(initial=0.0) > 1e-6:
                return away[:, None]
    return np.empty((k, 0))


def least_held(motions: FreeMotions, gaps: Array) -> tuple[list[str], float]:
    """Return the name of the motion that changes the gaps least, and by how much relative to the other motions.

    `gaps` (m, k) are the changes of m gaps for each of the k motions.
    """
    _, values, right = np.linalg.svd(gaps, full_matrices=False)
    return motions.combined(right[-1:].T).names(), float(values[-1] / values[0]) if values[0] else 1.0


def stopped_at(gaps: Array, gap: Array, work: Array, size: float) -> Array | None:
    """Return the amplitudes (k,) at which rigid bodies under the loads come to rest in contact, None if they never do.

    `gaps` (m, k) are the changes of the gaps for each motion, `gap` (m,) the current gaps, where penetration counts as
    closed [length], `work` (k,) the work of the loads on each motion, and `size` the size of the model [length].
    """
    if not work.any():
        return np.zeros(len(work))
    rows = np.abs(gaps).max(axis=1, initial=0.0) > ZERO
    open_by = np.maximum(gap[rows], 0.0) / size
    stop = _extreme(work / np.abs(work).max(), gaps[rows], open_by, np.empty((0, len(work))), FAR)
    return None if np.abs(stop).max() > 0.99 * FAR else stop * size


def needed_friction(constraints: Constraints, motions: Array, u: Array, work: Array, size: float) -> float | None:
    """Return the factor on the coefficients of friction that would stop rigid bodies [-].

    None if the coefficients stop them in every direction of the pyramid inside Coulomb's cone, or if none would.

    `motions` (n_dofs, k) are the rigid-body motions, `u` (n_dofs,) displacements [length]; `work` and `size` are as in
    `stopped_at`.
    """
    if not constraints.friction.any():
        return None
    inside = 1.0 if len(constraints.tangents) == 1 else np.cos(np.pi / EDGES)
    low, high = inside, MOST_FRICTION

    def stops(factor: float) -> bool:
        rows, gap0 = resisting(constraints, factor)
        return stopped_at(rows @ motions, gap0 + rows @ u, work, size) is not None

    if stops(low) or not stops(high):
        return None
    while high > 1.001 * low:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if stops(middle) else (middle, high)
    return high / inside


def _extreme(along: Array, gaps: Array, gap: Array, held: Array, bound: float) -> Array:
    """Return the y with the largest ``along @ y``, ``gap + gaps @ y >= 0``, ``held @ y = 0``, ``|y| <= bound``."""
    from scipy.optimize import linprog

    optimum = linprog(
        -along, A_ub=-gaps, b_ub=gap, A_eq=held if len(held) else None, b_eq=np.zeros(len(held)) if len(held) else None,
        bounds=(-bound, bound), method="highs",
    )  # fmt: skip
    return np.zeros(len(along)) if optimum.x is None else np.asarray(optimum.x)
