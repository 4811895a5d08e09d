"""Linear springs at nodes: ``1/2 k (r u)^2`` each, with r the row that gives its elongation from the displacements.

They add the positive semidefinite ``R.T diag(k) R`` to the stiffness. Springs along a line keep its reference direction.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array, vstack

from fastcontact.errors import ModelError

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Springs:
    """Springs defined together.

    Attributes
    ----------
    name, grounded
        Name for messages, and whether they connect nodes to the ground rather than two nodes.
    rows : csr_array (m, n_dofs)
        Elongation of each spring from the displacements [-].
    stiffness : ndarray (m,)
        [force / length]; in axisymmetry over the full circle.
    """

    name: str
    rows: csr_array
    stiffness: Array
    grounded: bool

    def tension(self, displacement: Array) -> Array:
        """Return the force (m,) [force] in each spring, positive in tension, for `displacement` (n_points, dim) [length]."""
        return self.stiffness * (self.rows @ displacement.ravel())


def grounded(name: str, nodes: NDArray[np.integer], stiffness: Mapping[int, float], n_dofs: int, dim: int) -> Springs:
    """Return a spring from each of the `nodes` (n,) to the ground along every axis of `stiffness` [force / length]."""
    dofs = np.concatenate([nodes.astype(np.intp) * dim + axis for axis in stiffness])
    values = np.repeat(np.array(list(stiffness.values()), float), len(nodes))
    rows = csr_array((np.ones(len(dofs)), dofs, np.arange(len(dofs) + 1)), shape=(len(dofs), n_dofs))
    return Springs(name, rows, values, True)


def between(
    name: str, points: Array, first: int, second: int, stiffness: Mapping[int, float], axial: float | None
) -> Springs:
    """Return springs between two of the `points` (n_points, dim) [length].

    Along every axis of `stiffness` [force / length], and along their line with the stiffness `axial` [force / length].
    ModelError if the two are one, or are at one place and have no line between them.
    """
    if first == second:
        raise ModelError(f"{name}: both ends are point {first}; without a second node a spring hangs on the ground")
    dim = points.shape[1]
    directions = [np.eye(dim)[axis] for axis in stiffness]
    values = list(stiffness.values())
    if axial is not None:
        line = points[second] - points[first]
        length = float(np.linalg.norm(line))
        if length <= 1e-12 * np.abs(points).max():
            raise ModelError(
                f"{name}: points {first} and {second} are at the same place and have no line between them: give x, y or "
                "z instead of axial"
            )
        directions.append(line / length)
        values.append(axial)
    along = np.array(directions)
    dofs = np.array([first, second])[:, None] * dim + np.arange(dim)
    entries = np.concatenate([-along, along], axis=1)
    m = len(along)
    rows = csr_array((entries.ravel(), np.tile(dofs.ravel(), m), 2 * dim * np.arange(m + 1)), shape=(m, points.size))
    rows.eliminate_zeros()
    rows.sort_indices()
    return Springs(name, rows, np.array(values, float), False)


def stacked(springs: Sequence[Springs], n_dofs: int) -> csr_array:
    """Return the rows of all springs as one matrix (m, n_dofs) [-]."""
    empty = csr_array((0, n_dofs))
    return csr_array(vstack([empty, *(spring.rows for spring in springs)], format="csr"))


def stiffened(K: bsr_array, springs: Sequence[Springs]) -> bsr_array:
    """Return the stiffness matrix `K` (n, n) [force / length] with the springs added, (n, n) [force / length]."""
    if not springs:
        return K
    R = stacked(springs, K.shape[0])
    k = np.concatenate([spring.stiffness for spring in springs])
    total = bsr_array(K + csr_array(R.T @ diags_array(k) @ R).tobsr(K.blocksize))
    total.sort_indices()
    return total


def ground_force(springs: Sequence[Springs], u: Array) -> Array:
    """Return the forces (n_dofs,) [force] of the ground on the nodes through springs, for `u` (n_dofs,) [length]."""
    total = np.zeros(len(u))
    for spring in springs:
        if spring.grounded:
            total -= spring.rows.T @ spring.tension(u)
    return total
