"""Rigid-body motions that supports and relations leave free, and whether contact and loads can stop them.

A body in contact stays in equilibrium if no motion that opens gaps, or leaves them, is driven by the loads: the loads
then lie inside the cone of the contact forces (Fichera, 1964; Lions and Stampacchia, 1967).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag
from scipy.sparse import csr_array, vstack

from fastcontact.contact.constraints import Constraints
from fastcontact.elasticity.stiffness import rigid_modes
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
MODE_NAMES = {
    "axisymmetric": ("translation along y (the axis)",),
    "plane_strain": ("translation along x", "translation along y", "rotation"),
    "plane_stress": ("translation along x", "translation along y", "rotation"),
    "3d": tuple(f"{kind} {axis}" for kind in ("translation along", "rotation about") for axis in "xyz"),
}
# Relative to the motions, whose largest displacement is about 1.
ZERO = 1e-8
# A motion that contact does not stop within so many times the size of the model is not stopped at all.
FAR = 1e3


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """Independent motions without deformation that supports and relations allow.

    The `displacement` (n_dofs, k) of all points has about 1 as largest entry of a column; `parts` (p, k) are the same motions
    as combinations of elementary ones, and `labels` body and name of each of those.
    """

    displacement: Array
    parts: Array
    labels: list[tuple[str, str]]

    def __len__(self) -> int:
        return self.displacement.shape[1]

    def combined(self, coefficients: Array) -> FreeMotions:
        """Return the motions ``displacement @ coefficients``, coefficients (k, j)."""
        return FreeMotions(self.displacement @ coefficients, self.parts @ coefficients, self.labels)

    def names(self) -> list[str]:
        """Return a description of each motion: bodies and elementary motions that it mixes."""
        return ["; ".join(f"{body}: {motion}" for body, motion in self._mixed(column)) for column in self.parts.T]

    def by_body(self) -> dict[str, list[str]]:
        """Return the names of the motions of each body, each once: joint motions may hold alike ones of one body."""
        found: dict[str, list[str]] = {}
        for column in self.parts.T:
            for body, motion in self._mixed(column):
                found.setdefault(body, []).append(motion)
        return {body: list(dict.fromkeys(motions)) for body, motions in found.items()}

    def _mixed(self, column: Array) -> list[tuple[str, str]]:
        mixed: dict[str, list[str]] = {}
        for i in np.flatnonzero(np.abs(column) > 1e-6 * np.abs(column).max()):
            body, motion = self.labels[i]
            mixed.setdefault(body, []).append(motion)
        return [(body, " with ".join(motions)) for body, motions in mixed.items()]


def body_name(mesh: Mesh, body: NDArray[np.int32], number: int) -> str:
    """Return a name for a body: a cell group whose solid cells are all of it, or its number."""
    members = np.flatnonzero(body == number)
    for group in mesh.cell_groups:
        blocks = mesh.cells_of(group, dim=mesh.dim)
        if blocks:
            nodes = np.unique(np.concatenate([block.ravel() for block in blocks.values()]))
            if np.array_equal(nodes, members):
                return f"'{group}'"
    return f"number {number + 1} (around {mesh.points[members].mean(axis=0)})"


def free_motions(mesh: Mesh, kinematics: str, fixed: Mask, relations: csr_array | None = None) -> FreeMotions:
    """Return the motions without deformation that the supports `fixed` (n_points, dim) and the relations allow.

    `relations` (m, n_dofs) are rows R with ``R u = 0``; points of no body move freely where relations name them.
    """
    dofs = mesh.n_points * mesh.dim
    columns, parts, labels = [], [], []
    count, body = bodies(mesh)
    for number in range(count):
        members = np.flatnonzero(body == number)
        modes = rigid_modes(mesh.points[members], kinematics)
        modes = modes / np.abs(modes).max(axis=0)
        free = _null_space(modes[fixed[members].ravel()])  # combinations of the body's modes that no support stops
        if free.shape[1]:
            own = np.zeros((mesh.n_points, mesh.dim, free.shape[1]))
            own[members] = (modes @ free).reshape(len(members), mesh.dim, -1)
            columns.append(own.reshape(dofs, -1))
            parts.append(free)
            labels += [(f"body {body_name(mesh, body, number)}", name) for name in MODE_NAMES[kinematics]]
    if relations is not None:
        for dof in np.unique(relations.indices[(body[relations.indices // mesh.dim] < 0)]):
            if not fixed.ravel()[dof]:
                columns.append(np.eye(dofs, 1, -int(dof)))
                parts.append(np.ones((1, 1)))
                labels.append((f"point {dof // mesh.dim}", f"translation along {'xyz'[dof % mesh.dim]}"))
    if not columns:
        return FreeMotions(np.empty((dofs, 0)), np.empty((0, 0)), [])
    motions = FreeMotions(np.hstack(columns), block_diag(*parts), labels)
    if relations is None or not relations.shape[0]:
        return motions
    return motions.combined(_null_space(relations @ motions.displacement))


def _null_space(A: Array) -> Array:
    """Return an orthonormal basis (k, j) of the vectors that A (m, k) maps to zero."""
    k = A.shape[1]
    _, values, right = np.linalg.svd(np.vstack([A, np.zeros((k, k))]), full_matrices=False)
    return np.asarray(right[values < ZERO * max(values.max(initial=0.0), 1.0)].T)


def resisting(constraints: Constraints) -> tuple[csr_array, Array]:
    """Return rows and gaps at u = 0 that must stay >= 0 if nothing slides: gaps, and edges of the friction cone.

    A contact force lies in the cone of the rows: normal, and with friction ``n + mu t`` and ``n - mu t`` for each
    tangent t. Equations resist both ways.
    """
    rows, gap0 = _edges(constraints)
    if constraints.equality is None:
        return rows, gap0
    backwards = np.flatnonzero(np.tile(constraints.equality, len(gap0) // len(constraints.equality)))
    both = csr_array(vstack([rows, -rows[backwards]], format="csr"))
    return both, np.concatenate([gap0, -gap0[backwards]])


def _edges(constraints: Constraints) -> tuple[csr_array, Array]:
    """Return the rows and gaps of contact that may open."""
    if not constraints.tangents or constraints.friction is None:
        return constraints.B, constraints.gap0
    edges = [
        csr_array(constraints.B + tangent.multiply(sign * constraints.friction[:, None]))
        for tangent in constraints.tangents
        for sign in (1.0, -1.0)
    ]
    return csr_array(vstack(edges, format="csr")), np.tile(constraints.gap0, len(edges))


def generalised(motions: FreeMotions, force: Array) -> Array:
    """Return the work (k,) that nodal forces (n_dofs,) do on each motion; round-off counts as zero [force]."""
    work = motions.displacement.T @ force
    work[np.abs(work) <= 1e-10 * (np.abs(motions.displacement).T @ np.abs(force))] = 0.0
    return work


def unstopped(gaps: Array, works: Array) -> Array:
    """Return motions (k, j) that neither contact nor contact and loads together can stop.

    From the change of the `gaps` (m, k) and the `works` (l, k) of the loads under each motion, whose largest displacement is
    about 1. A motion is stopped if it changes some gap, and closes one or is driven by some load. Whether the load drives it
    against the contact, or away from it, shows in the solution.
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


def stopped_at(gaps: Array, gap: Array, work: Array, size: float) -> Array | None:
    """Return the amplitudes (k,) at which rigid bodies under the loads come to rest in contact, None if they never do.

    From the change of the `gaps` (m, k) under each motion, every `gap` (m,) now, of which penetration counts as closed
    [length], the `work` (k,) of the loads on each motion, and the `size` of the model [length].
    """
    if not work.any():
        return np.zeros(len(work))
    rows = np.abs(gaps).max(axis=1, initial=0.0) > ZERO
    open_by = np.maximum(gap[rows], 0.0) / size
    found = _extreme(work / np.abs(work).max(), gaps[rows], open_by, np.empty((0, len(work))), FAR)
    return None if np.abs(found).max() > 0.99 * FAR else found * size


def _extreme(along: Array, gaps: Array, gap: Array, held: Array, bound: float) -> Array:
    """Return the y with the largest ``along @ y``, ``gap + gaps @ y >= 0``, ``held @ y = 0``, ``|y| <= bound``."""
    from scipy.optimize import linprog

    found = linprog(
        -along, A_ub=-gaps, b_ub=gap, A_eq=held if len(held) else None, b_eq=np.zeros(len(held)) if len(held) else None,
        bounds=(-bound, bound), method="highs",
    )  # fmt: skip
    return np.zeros(len(along)) if found.x is None else np.asarray(found.x)
