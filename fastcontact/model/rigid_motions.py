"""Rigid-body motions that supports and multi-point constraints allow, and whether contact can stop them.

A body in contact is in equilibrium if the loads do no positive work on motions that open gaps or leave them unchanged. The
loads then lie inside the cone of the contact forces (Fichera, 1964; Lions and Stampacchia, 1967).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csr_array, vstack

from fastcontact._tools.grouping import grouped
from fastcontact._tools.records import field, record, replace
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.stiffness import rigid_modes
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh, node_at, vector_text
from fastcontact.mesh.topology import RigidParts, bodies, rigid_parts
from fastcontact.round_off import SINGLE_PRECISION, TINY

MODE_NAMES = {
    "axisymmetric": ("translation along y (the axis)",),
    "plane_strain": ("translation along x", "translation along y", "rotation"),
    "plane_stress": ("translation along x", "translation along y", "rotation"),
    "3d": tuple(f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"),
}
# Words between the name of a body and the centre of one of its parts, in the name of the part.
PART = ", the part around "
# Gap changes and singular values are regarded as zero below this, for motions whose largest displacement is about 1.
ZERO = 1e-8
# A motion that contact does not stop within this multiple of the size of the model is unbounded.
FAR = 1e3
# Difference of amplitudes relative to the size of the model that may be due to the accuracy of a linear programme.
SMALL_MOTION = 1e-3
# Largest coefficient of a motion that is attributed to the tolerance of the linear programme [-].
NO_MOTION = 1e-6
# Number of edges of the pyramid that is circumscribed to Coulomb's cone in three dimensions. Tangential forces at its edges
# exceed those of the cone by 8 %.
EDGES = 8
# Fraction of the frictional capacity above which floating bodies are reported as about to slide.
NEARLY_SLIDING = 0.9
# Largest factor by which the coefficients of friction are multiplied to test whether friction can hold a body.
LARGEST_FRICTION_FACTOR = 100.0
# Coefficient of friction with which bodies that slide are told from bodies that tip over; real coefficients are smaller.
LARGEST_COEFFICIENT = 10.0
# Relative accuracy of the factor by which the coefficients of friction would have to be multiplied.
FACTOR_ACCURACY = 1e-3
# Change of the gaps of closed constraints below which a motion along curved or inclined facets is regarded as sliding [-].
NEARLY_TANGENTIAL = 1e-2
# Largest number of least-squares problems for the motion in which bodies begin to slide.
REWEIGHTINGS = 200
# Largest number of motions of parts between hinges. A mesh with more motions is defective.
MAX_MOTIONS = 1500


class Label(NamedTuple):
    """Name of an elementary motion, with a point on its axis and the largest arm [length] if it is a rotation of a body."""

    body: str
    motion: str
    centre: Array | None = None
    arm: float = 1.0


@record
class FreeMotions:
    """Independent rigid-body motions that supports and constraints allow.

    Column j of `displacement` (n_dofs, k) contains the displacements of all points in motion j; its largest entry is about 1.
    `weights` (p, k) are the coefficients of the motions as combinations of p elementary motions, which `labels` names.
    `hinges` (m,) are single or collinear nodes that connect parts of bodies.
    """

    displacement: Array
    weights: Array
    labels: list[Label]
    hinges: Indices = field(default_factory=lambda: np.empty(0, np.intp))

    def __len__(self) -> int:
        return self.displacement.shape[1]

    def combined(self, coefficients: Array) -> FreeMotions:
        """Return the motions ``displacement @ coefficients``, coefficients (k, j)."""
        return replace(self, displacement=self.displacement @ coefficients, weights=self.weights @ coefficients)

    def with_translations(self, dofs: Indices, names: Sequence[str], shape: tuple[int, ...]) -> FreeMotions:
        """Return these motions, and a unit displacement along each of the components `dofs` (j,) of `shape` (n_nodes, dim).

        `names` are those of the points or obstacles that move.
        """
        k, j = len(self), len(dofs)
        axes = ("xyz"[dof % shape[1]] for dof in dofs)
        labels = [Label(name, f"translation along {axis}") for name, axis in zip(names, axes, strict=True)]
        displacement = np.zeros((shape[0] * shape[1], k + j))
        displacement[: len(self.displacement), :k] = self.displacement
        displacement[dofs, k + np.arange(j)] = 1.0
        weights = np.asarray(block_diag(self.weights, np.eye(j)), float)
        return FreeMotions(displacement, weights, [*self.labels, *labels], self.hinges)

    @property
    def simple(self) -> Array:
        """Coefficients (k, k) of equivalent motions that combine as few elementary motions as possible."""
        simple = np.linalg.lstsq(self.weights, _column_echelon_form(self.weights))[0]
        return np.asarray(simple / np.abs(simple).max(axis=0))

    def names(self) -> list[str]:
        """Return the motions of all bodies, each with the name of its body; see `by_body`."""
        return [f"{body}: {motion}" for body, motions in self.by_body().items() for motion in motions]

    def by_body(self) -> dict[str, list[str]]:
        """Return the names of the motions of each body, without repetition.

        The motions are combined such that each contains as few elementary motions as possible.
        """
        by_body: dict[str, list[str]] = {}
        for column in _column_echelon_form(self.weights).T:
            moving_rows = np.flatnonzero(np.abs(column) > 1e-6 * np.abs(column).max()).tolist()
            rows_of_body = grouped((self.labels[i].body, i) for i in moving_rows)
            together: dict[tuple[str, bytes], list[str]] = {}  # bodies, or parts of a body that move as one
            for body, rows in rows_of_body.items():
                motion = np.round(self._at_origin(column, rows), 6) + 0.0  # no negative zeros
                together.setdefault((body.partition(PART)[0], motion.tobytes()), []).append(body)
            for (whole, _), moving in together.items():
                name = self._motion_of_body(column, rows_of_body[moving[0]])
                by_body.setdefault(whole if len(moving) > 1 else moving[0], []).append(name)
        return {body: list(dict.fromkeys(motions)) for body, motions in by_body.items()}

    def _at_origin(self, column: Array, rows: list[int]) -> Array:
        """Return the translation at the origin and the rotation (2, 3) of the body with the elementary motions `rows`.

        `column` (p,) are the coefficients of all elementary motions.
        """
        translation, rotation, centre = self._translation_and_rotation(column, rows)
        arm = np.zeros(3) if centre is None else np.pad(centre, (0, 3 - len(centre)))
        return np.stack([translation - np.cross(rotation, arm), rotation])

    def _translation_and_rotation(self, column: Array, rows: list[int]) -> tuple[Array, Array, Array | None]:
        """Return the translation (3,) and rotation (3,) of a body, and a point on its axis of rotation, see `_at_origin`."""
        translation, rotation = np.zeros((2, 3))
        labels = [self.labels[i] for i in rows]
        for i, label in zip(rows, labels, strict=True):
            axis = "xyz".find(label.motion[-1])  # in the plane it is -1, and the "rotation" is about z
            (translation if label.centre is None else rotation)[axis] += column[i] / label.arm
        return translation, rotation, next((label.centre for label in labels if label.centre is not None), None)

    def _motion_of_body(self, column: Array, rows: list[int]) -> str:
        """Return the name of the motion of a body, see `_at_origin`: one rotation if possible, else elementary motions."""
        labels = [self.labels[i] for i in rows]
        translation, rotation, centre = self._translation_and_rotation(column, rows)
        square = rotation @ rotation
        size = max(label.arm for label in labels)
        if centre is None or abs(translation @ rotation) > 1e-6 * square * size:
            return " with ".join(label.motion for label in labels)
        if len(centre) == 3 and not translation.any() and len(rows) == 1:
            return labels[0].motion
        point = centre + (np.cross(rotation, translation) / square)[: len(centre)]
        position = vector_text(np.where(np.abs(point) > 1e-5 * size, point, 0.0), 4)
        direction = rotation / rotation[np.argmax(np.abs(rotation))]
        line = f" along {vector_text(np.where(np.abs(direction) > 1e-6, direction, 0.0), 4)}"
        return f"rotation about {position}" if len(centre) == 2 else f"rotation about the line through {position}{line}"


def grouped_by_body(names: Iterable[str]) -> str:
    """Return the `names` of motions, see `FreeMotions.names`, in one string that names each body once.

    The motions of parts of a body, such as the halves of a cut bolt, follow those of the complete body.
    """
    by_body: dict[str, dict[str, list[str]]] = {}
    for name, _, motion in (name.rpartition(": ") for name in names):
        body, separator, centre = name.partition(PART)
        part = separator.removeprefix(", ") + centre
        by_body.setdefault(body, {}).setdefault(part, []).append(motion)
    texts = []
    for body, motions in by_body.items():
        whole = f": {', '.join(motions.pop(''))}; " if "" in motions else ", "
        parts = (f"{part}: {', '.join(listed)}" for part, listed in motions.items())
        texts.append(f"{body}{whole}{'; '.join(parts)}".removesuffix("; "))
    return "; ".join(texts)


def _column_echelon_form(A: Array) -> Array:
    """Return the reduced column echelon form (p, k) of a matrix A (p, k) of full column rank."""
    A, column = A.copy(), 0
    for row in A:  # a view, which follows the elimination
        if column == A.shape[1]:
            break
        pivot = column + int(np.argmax(np.abs(row[column:])))
        if abs(row[pivot]) <= ZERO * np.abs(A).max():
            continue
        A[:, [column, pivot]] = A[:, [pivot, column]]
        A[:, column] /= row[column]
        is_other = np.arange(A.shape[1]) != column
        A[:, is_other] -= A[:, [column]] * row[is_other]
        column += 1
    return A


def body_name(mesh: Mesh, body: AnyArray, number: int) -> str:
    """Return the name of body `number` for messages, from the `body` (n_points,) of each point.

    This is the name of a cell group with exactly the nodes of the body. If there is no such group, it is the centre of the
    body, preceded by the name of the smallest group that contains this body but not all bodies (for example both halves of
    a cut bolt) or else by the number of the body.
    """
    members = np.flatnonzero(body == number)
    group, size = _group_of(mesh, members)
    if size == len(members):
        return group
    centre = mesh.points[members].mean(axis=0)
    return f"{group}{PART}{vector_text(centre, 4)}" if group else f"number {number + 1} (around {centre})"


def _group_of(mesh: Mesh, members: Indices) -> tuple[str, int]:
    """Return the quoted name of the smallest cell group with all nodes `members`, and the number of nodes of its solid cells.

    A group that has other nodes as well must not contain all bodies. Without such a group, the results are empty and zero.
    """
    containing, all_solid = dict[str, int](), np.count_nonzero(bodies(mesh)[1] >= 0)
    for group in mesh.cell_groups:
        blocks = mesh.cells_of(group, dim=mesh.dim)
        nodes = np.unique(np.concatenate([block.ravel() for block in blocks.values()])) if blocks else np.empty(0)
        if np.isin(members, nodes).all() and (len(nodes) == len(members) or len(nodes) < all_solid):
            containing[f"'{group}'"] = len(nodes)
    return min(containing.items(), key=lambda item: item[1], default=("", 0))


def free_motions(mesh: Mesh, kinematics: str, fixed: Mask, relations: csr_array | None = None) -> FreeMotions:
    """Return the rigid-body motions that the supports `fixed` (n_points, dim) and the constraints allow.

    Parts of a body that are connected only at single or collinear nodes can rotate about these nodes. `relations` (m, n_dofs)
    are the rows R of constraints ``R u = 0``. Points that belong to no body are included if constraints contain them.
    """
    motions = _body_motions(mesh, kinematics, fixed)
    if relations is None:
        return motions
    without_body = bodies(mesh)[1][relations.indices // mesh.dim] < 0
    points = np.unique(relations.indices[without_body & ~fixed.ravel()[relations.indices]])
    names = {int(members[0]): f"'{name}'" for name, members in mesh.point_groups.items() if len(members) == 1}
    texts = [f"point {names.get(int(dof) // mesh.dim, dof // mesh.dim)}" for dof in points]
    motions = motions.with_translations(points, texts, mesh.points.shape)
    if not relations.shape[0] or not len(motions):
        return motions
    return motions.combined(_null_space(relations @ motions.displacement))


def _body_motions(mesh: Mesh, kinematics: str, fixed: Mask) -> FreeMotions:
    """Return the motions of bodies, and of their parts between hinges, that the supports `fixed` (n_points, dim) allow."""
    body_parts = _parts_of(mesh, kinematics)
    part_motions: list[tuple[Indices, Array]] = []  # nodes (m,) of a part, and its motions (m, dim, k) there
    matrices, labels = [np.empty((0, 0))], []
    for number in range(body_parts.count):
        members = body_parts.nodes_of(number)
        modes = rigid_modes(mesh.points[members], kinematics)
        arms = np.abs(modes).max(axis=0)
        modes = modes / arms
        free = _null_space(modes[fixed[members].ravel()])  # combinations of the modes without displacement at supports
        part_motions.append((members, (modes @ free).reshape(len(members), mesh.dim, -1)))
        if free.shape[1]:
            matrices.append(free)
            name, centre = _part_name(mesh, body_parts, number), mesh.points[members].mean(axis=0)
            modes_and_arms = zip(MODE_NAMES[kinematics], arms.tolist(), strict=True)
            labels += [Label(name, m, centre if m.startswith("rotation") else None, arm) for m, arm in modes_and_arms]
    combinations = _joint_motions(mesh, body_parts, part_motions)
    coefficients = np.split(combinations, np.cumsum([motion.shape[2] for _, motion in part_motions]))
    displacement = np.zeros((mesh.n_points, mesh.dim, combinations.shape[1]))
    for number, ((members, motion), weights) in enumerate(zip(part_motions, coefficients[:-1], strict=True)):
        in_part = body_parts.part[members] == number  # a node at a hinge belongs to several parts
        displacement[members[in_part]] = motion[in_part] @ weights
    return FreeMotions(
        displacement.reshape(mesh.points.size, combinations.shape[1]),
        np.asarray(block_diag(*matrices), float) @ combinations, labels, np.unique(body_parts.hinge_node),
    )  # fmt: skip


def _parts_of(mesh: Mesh, kinematics: str) -> RigidParts:
    """Return the rigid parts: bodies, or parts of them between hinges."""
    if kinematics != "axisymmetric":
        return rigid_parts(mesh)
    # Axisymmetric bodies move only along the axis, and a single common node transmits this motion.
    count, body = bodies(mesh)
    return RigidParts(count, body.astype(np.intp), np.empty(0, np.intp), np.empty(0, np.intp))


def _joint_motions(mesh: Mesh, body_parts: RigidParts, part_motions: list[tuple[Indices, Array]]) -> Array:
    """Return the combinations (k, j) of the motions of all parts for which the parts remain connected at hinges."""
    width = sum(motion.shape[2] for _, motion in part_motions)
    if not len(body_parts.hinge_node):
        return np.eye(width)
    if width > MAX_MOTIONS:
        raise ModelError(
            f"the mesh consists of {body_parts.count} parts that are connected only at single nodes or along lines (first: "
            f"{node_at(mesh, body_parts.hinge_node[0])}): let cells share whole facets"
        )
    ends = np.cumsum([0] + [motion.shape[2] for _, motion in part_motions])
    at_hinges = np.zeros((len(body_parts.hinge_node), mesh.dim, width))
    for row, (node, number) in enumerate(zip(body_parts.hinge_node, body_parts.hinge_part, strict=True)):
        members, motion = part_motions[number]
        at_hinges[row, :, ends[number] : ends[number + 1]] = motion[np.searchsorted(members, node)]
    same_node = body_parts.hinge_node[1:] == body_parts.hinge_node[:-1]
    return _null_space((at_hinges[1:] - at_hinges[:-1])[same_node].reshape(int(same_node.sum()) * mesh.dim, width))


def _part_name(mesh: Mesh, body_parts: RigidParts, number: int) -> str:
    """Return the name of a body, or of a part of a body with the first node at which it is connected to other parts."""
    _, body = bodies(mesh)
    members, hinges = body_parts.nodes_of(number), body_parts.hinges_of(number)
    name = f"body {body_name(mesh, body, int(body[members[0]]))}"
    if not len(hinges):
        return name
    group, size = _group_of(mesh, members)
    part = group if size == len(members) else f"around {mesh.points[members].mean(axis=0)}"
    return f"{name}, the part {part} that is connected at {node_at(mesh, hinges[0])}"


def _null_space(A: Array) -> Array:
    """Return an orthonormal basis (k, j) of the null space of A (m, k), with the tolerance ZERO for singular values."""
    k = A.shape[1]
    _, values, right = np.linalg.svd(np.vstack([A, np.zeros((k, k))]), full_matrices=False)
    return np.asarray(right[values < ZERO * max(values.max(initial=0.0), 1.0)].T)


def cone_rows(
    constraints: Constraints, factor: float = 1.0, added: Sequence[Array] | None = None
) -> tuple[csr_array, Array]:
    """Return the rows that span the cone of admissible contact forces, and the gaps of these rows at u = 0 [length].

    Without friction these are the rows of the gaps. With friction they are ``n + mu t`` and ``n - mu t`` in the plane, and in
    3D the EDGES edges of the pyramid circumscribed to Coulomb's cone. Rows of equality constraints appear with both signs.
    `factor` multiplies the coefficients of friction. If a list of `added` edges is given, even an empty one, the pyramid is
    inscribed in the cone. Each edge is a direction (2, m) along the tangents [-].
    """
    rows, gap0 = _edges(constraints, factor, added)
    bilateral = np.flatnonzero(np.resize(constraints.equality, len(gap0)))
    rows = csr_array(vstack([rows, -rows[bilateral]], format="csr"))
    return rows, np.concatenate([gap0, -gap0[bilateral]])


def _edges(constraints: Constraints, factor: float, added: Sequence[Array] | None) -> tuple[csr_array, Array]:
    """Return the rows and gaps of `cone_rows` with positive sign."""
    if not constraints.tangents:
        return constraints.B, constraints.gap0
    if len(constraints.tangents) == 1:
        weights = [np.array([1.0]), np.array([-1.0])]
    else:
        angle = 2.0 * np.pi * np.arange(EDGES) / EDGES
        ratio = np.cos(np.pi / EDGES) if added is None else 1.0
        weights = [*(np.column_stack([np.cos(angle), np.sin(angle)]) / ratio), *(added or ())]
    shear = [T.multiply(factor * constraints.friction[:, None]) for T in constraints.tangents]
    edges = [constraints.B + sum(T.multiply(np.reshape(w, (-1, 1))) for T, w in zip(shear, edge)) for edge in weights]
    return csr_array(vstack(edges, format="csr")), np.tile(constraints.gap0, len(edges))


def generalised_forces(motions: FreeMotions, force: Array, largest: float = 0.0) -> Array:
    """Return the generalised forces (k,) of nodal forces (n_dofs,) on each motion, with round-off set to zero [force].

    Round-off is estimated from these forces and from the `largest` earlier generalised forces (k,), since the forces may be
    the difference of such larger ones.
    """
    work = motions.displacement.T @ force
    scale = np.maximum(np.abs(motions.displacement).T @ np.abs(force), largest)
    work[np.abs(work) <= 1e-10 * scale] = 0.0
    return work


def mechanisms(gaps: Array, forces: Array, simple: Array) -> Array:
    """Return the coefficients (k, j) of motions that neither contact nor contact and loads together can stop.

    `gaps` (m, k) are the changes of the gaps and `forces` (l, k) the generalised forces of the loads for each motion. The
    largest displacement of a motion is about 1. Motions with coefficients `simple` (k, k) are preferred. A motion is regarded
    as stopped if it closes a gap, or if it opens one and a load acts on it. The solution decides whether the load presses the
    body against the contact or pulls it away.
    """
    k = gaps.shape[1]
    gaps = np.where(np.abs(gaps) > ZERO, gaps, 0.0)
    without_gap_change = _null_space(gaps)
    if without_gap_change.shape[1]:
        return without_gap_change
    scale = np.abs(forces).max(axis=1, initial=0.0)
    scaled_forces = forces[scale > 0] / scale[scale > 0, None]
    changes, loaded = gaps @ simple, (np.abs(scaled_forces @ simple) > ZERO).any(axis=0)
    free = ((changes >= -ZERO).all(axis=0) | (changes <= ZERO).all(axis=0)) & ~loaded
    if free.any():
        return simple[:, free]
    closed = np.zeros(len(gaps))
    # Each motion changes a gap, so one that closes none exists if and only if the sum of the changes can be positive.
    if np.abs(_maximiser(gaps.sum(axis=0), gaps, closed, scaled_forces, 1.0)).max() <= NO_MOTION:
        return np.empty((k, 0))
    for objective in np.kron(np.eye(k), [[1.0], [-1.0]]):  # motions with few components, for messages
        motion = _maximiser(objective, gaps, closed, scaled_forces, 1.0)
        if np.abs(motion).max() > NO_MOTION:
            return motion[:, None]
    return np.empty((k, 0))


def tipping(motions: FreeMotions, gaps: Array, work: Array) -> str:
    """Return the names of bodies that tip over, with their motions, or an empty string.

    Bodies tip over if the loads press them against contact, but do work in a rotation that opens gaps. Among the motions that
    close no gap, that with the largest work divided by the sum of the gap changes is named; it keeps an edge closed. `gaps`
    (m, k) are the changes of the gaps and `work` (k,) the generalised forces of the loads for each of the k motions.
    """
    gaps = np.where(np.abs(gaps) > ZERO, gaps, 0.0)
    total, scale = gaps.sum(axis=0), np.abs(work).max()
    if not scale or not total.any() or _null_space(gaps).shape[1]:
        return ""
    rows, limits = np.vstack([gaps, -total / np.abs(total).max()]), np.r_[np.zeros(len(gaps)), 1.0]
    no_equality = np.empty((0, len(work)))
    opening, lifting = (_maximiser(sign * work / scale, rows, limits, no_equality, FAR) for sign in (1.0, -1.0))
    if min(work @ opening, -work @ lifting) <= NO_MOTION * scale:
        return ""
    names = motions.combined(opening[:, None] / np.abs(opening).max()).names()
    return grouped_by_body(names) if any("rotation" in name for name in names) else ""


def least_restrained(motions: FreeMotions, gaps: Array) -> tuple[str, float]:
    """Return the name of the motion that changes the gaps least, and the ratio of its change to the largest one [-].

    `gaps` (m, k) are the changes of m gaps for each of the k motions.
    """
    _, values, right = np.linalg.svd(gaps, full_matrices=False)
    return "; ".join(motions.combined(right[-1:].T).names()), float(values[-1] / values[0]) if values[0] else 1.0


def stopped_at(gaps: Array, gap: Array, work: Array, size: float) -> Array | None:
    """Return the amplitudes (k,) of the motions at which contact stops rigid bodies under the loads; None if they do not.

    Parameters
    ----------
    gaps : ndarray (m, k)
        Changes of the gaps for each motion [-].
    gap : ndarray (m,)
        Current gaps; negative gaps are regarded as closed [length].
    work : ndarray (k,)
        Generalised force of the loads on each motion [force].
    size : float
        Size of the model [length].
    """
    stop = _relative_amplitudes(gaps, gap, work, size)
    return None if np.abs(stop).max() > 0.99 * FAR else _smallest(stop, gaps, np.maximum(gap, 0.0) / size, work) * size


def _smallest(stop: Array, gaps: Array, gap: Array, work: Array) -> Array:
    """Return the smallest amplitudes (k,) with the work of `stop`, so that bodies without loads stay in place [-].

    The amplitudes minimise the 1-norm. `stop` is returned if motions without work are small, or if the result hardly differs
    from it. `gap` (m,) is relative to the size of the model [-]; for the other parameters see `stopped_at`.
    """
    if np.abs(stop[work == 0.0]).max(initial=0.0) <= SMALL_MOTION:
        return stop
    from scipy.optimize import linprog

    k, objective = len(stop), work / np.abs(work).max()
    # The variables are the amplitudes and bounds of their absolute values.
    rows = np.block(
        [[-gaps, np.zeros_like(gaps)], [np.eye(k), -np.eye(k)], [-np.eye(k), -np.eye(k)], [-objective, np.zeros(k)]]
    )
    limits = np.concatenate([gap, np.zeros(2 * k), [-objective @ stop]])
    optimum = linprog(np.repeat([0.0, 1.0], k), A_ub=rows, b_ub=limits, bounds=(None, None), method="highs").x
    return stop if optimum is None or np.abs(optimum[:k] - stop).max() <= SMALL_MOTION else np.asarray(optimum[:k])


def _relative_amplitudes(gaps: Array, gap: Array, work: Array, size: float) -> Array:
    """Return the amplitudes of `stopped_at` relative to `size`, which are at most FAR [-]."""
    if not work.any():
        return np.zeros(len(work))
    rows = np.abs(gaps).max(axis=1, initial=0.0) > ZERO
    relative_gap = np.maximum(gap[rows], 0.0) / size
    return _maximiser(work / np.abs(work).max(), gaps[rows], relative_gap, np.empty((0, len(work))), FAR)


def needed_friction(
    constraints: Constraints, motions: FreeMotions, u: Array, work: Array, size: float
) -> tuple[float, list[str]] | None:
    """Return the smallest multiplier of the coefficients of friction for which rigid bodies stop [-], and the sliding bodies.

    Returns None if a factor of NEARLY_SLIDING suffices, or if no factor up to LARGEST_FRICTION_FACTOR does. In 3D, edges are
    added to pyramids inscribed in Coulomb's cones, in the directions of motions that the cones would stop, since pyramids
    alone underestimate friction by up to 8 %. `u` (n_dofs,) are the displacements [length]; for `work` and `size` see
    `stopped_at`.
    """
    if not constraints.friction.any():
        return None
    low, high, edges = NEARLY_SLIDING, LARGEST_FRICTION_FACTOR, list[Array]()

    def slide(factor: float) -> Array:
        for _ in range(EDGES):
            rows, gap0 = cone_rows(constraints, factor, edges)
            stop = _relative_amplitudes(rows @ motions.displacement, gap0 + rows @ u, work, size)
            # Unbounded motions are of the order of FAR, and those that a gap stops of the order of 1.
            stop = np.where(np.abs(stop) > np.sqrt(FAR), stop, 0.0) * (np.abs(stop).max() > 0.99 * FAR)
            motion = motions.displacement @ stop
            slip = np.stack([T @ motion for T in constraints.tangents])
            length = np.linalg.norm(slip, axis=0)
            resistance = factor * constraints.friction * length
            resists = resistance - constraints.B @ motion > FACTOR_ACCURACY * resistance.max(initial=0.0)
            if len(slip) == 1 or not resists.any():
                break
            edges.append(-slip / np.maximum(length, TINY))
        return stop

    sliding = slide(low)
    if not sliding.any() or slide(high).any():
        return None
    while high > (1.0 + FACTOR_ACCURACY) * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if slide(middle).any() else (low, middle)
    return high, list(motions.combined(sliding[:, None]).by_body())


def sliding_friction(
    constraints: Constraints, motions: FreeMotions, normal_forces: Array, work: Array
) -> tuple[float, list[str]] | None:
    """Return the multiplier of the coefficients of friction at which rigid bodies begin to slide [-], and the sliding bodies.

    The normal forces (m,) of the constraints are given [force], unlike in `needed_friction`, and only motions that keep the
    gaps of closed constraints are considered. By the kinematic theorem of limit analysis, the multiplier is the largest ratio
    of the power of the loads to that of friction, ``f @ y`` to ``sum(mu n |T y|)``. It is found by iteratively reweighted
    least squares, which increase the ratio. `work` (k,) are the generalised forces of the loads [force]. The result is None
    if the loads do no work on these motions, or if friction does none.
    """
    closed = normal_forces > SINGLE_PRECISION * normal_forces.max(initial=0.0)
    gaps = (constraints.B @ motions.displacement)[closed | constraints.equality]
    _, values, right = np.linalg.svd(np.vstack([gaps, np.zeros((len(motions), len(motions)))]), full_matrices=False)
    tangential = right[values <= NEARLY_TANGENTIAL * np.sqrt(len(gaps))].T
    loads = (work + motions.displacement.T @ (constraints.B.T @ normal_forces)) @ tangential
    slips = np.stack([T @ (motions.displacement @ tangential) for T in constraints.tangents])
    capacity, y, factor = constraints.friction * normal_forces, np.zeros(len(loads)), 0.0
    slips, capacity = slips[:, capacity > 0.0], capacity[capacity > 0.0]
    if not capacity.size or np.abs(loads).max(initial=0.0) <= SMALL_MOTION * capacity.sum():
        return None
    weights = capacity
    for _ in range(REWEIGHTINGS):
        metric = np.einsum("dmi,m,dmj->ij", slips, weights, slips)
        y = np.linalg.lstsq(metric, loads)[0]
        length = np.linalg.norm(slips @ y, axis=0)
        before, factor = factor, float(loads @ y / max(capacity @ length, TINY))
        if factor <= (1.0 + 0.01 * FACTOR_ACCURACY) * before:
            break
        weights = capacity / np.maximum(length, SINGLE_PRECISION * length.max())
    sliding = motions.combined((tangential @ y)[:, None])
    weights = np.where(np.abs(sliding.weights) > SMALL_MOTION * np.abs(sliding.weights).max(), sliding.weights, 0.0)
    return factor, list(replace(sliding, weights=weights).by_body())


def _maximiser(objective: Array, gaps: Array, gap: Array, E: Array, bound: float) -> Array:
    """Return y (k,) that maximises ``objective @ y`` for ``gap + gaps @ y >= 0``, ``E @ y = 0`` and ``|y| <= bound``.

    Returns zeros if the linear programme has no solution.
    """
    from scipy.optimize import linprog

    equalities = {"A_eq": E, "b_eq": np.zeros(len(E))} if len(E) else {}
    optimum = linprog(-objective, A_ub=-gaps, b_ub=gap, bounds=(-bound, bound), method="highs", **equalities)
    return np.zeros(len(objective)) if optimum.x is None else np.asarray(optimum.x)
