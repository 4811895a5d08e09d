"""Symmetric low-rank update ``D.T G + G.T D`` of a matrix, and its Galerkin product.

Equations say ``u = u + D u`` at their pivots, with rows D of weights less one. They turn A into ``T.T A T``, which changes
it by ``D.T G + G.T D`` with ``G = A[pivots] + A[pivots][:, pivots] D / 2``. Springs along rows R change it by ``R.T S R``,
which has the same form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csc_array, csr_array

from fastcontact.arrays import Indices
from fastcontact.linear.multigrid.local_change import LocalChange, block_rows
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.sparse_rows import scaled
from fastcontact.linear.springs import Springs


@dataclass(frozen=True, eq=False)
class SymmetricChange:
    """The change ``D.T G + G.T D`` of a matrix (n, n).

    Attributes
    ----------
    D, G : csr_array (m, n)
    size : int
        Unknowns of a node.
    """

    D: csr_array
    G: csr_array
    size: int

    @classmethod
    def of_equations(cls, A: BlockMatrix, pivots: Indices, weights: csr_array) -> SymmetricChange:
        """Return ``T.T A T - A`` for a symmetric A (n, n), where ``u = T u`` says ``u[pivots] = weights u``."""
        m = len(pivots)
        D = csr_array(weights + csr_array((np.full(m, -1.0), pivots, np.arange(m + 1)), shape=weights.shape))
        rows = A.rows_of(pivots)
        return cls(D, csr_array(rows + 0.5 * (rows[:, pivots] @ D)), len(A.rows))

    @classmethod
    def of_springs(cls, springs: Springs, size: int) -> SymmetricChange:
        """Return the matrix of springs."""
        return cls(springs.rows, scaled(springs.rows, 0.5 * springs.stiffness), size)

    def diagonal(self) -> LocalChange:
        """Return its diagonal blocks."""
        nodes, size = np.unique(self.D.indices // self.size), self.size
        unknowns = (nodes[:, None] * size + np.arange(size)).ravel()
        D, G = self.D[:, unknowns], self.G[:, unknowns]
        half = [[D[:, a::size].multiply(G[:, b::size]).sum(axis=0) for b in range(size)] for a in range(size)]
        blocks = np.array(half).reshape(size, size, -1)
        return LocalChange.of_diagonal(nodes, (blocks + blocks.transpose(1, 0, 2)).transpose(2, 0, 1))

    def on_finest(self) -> csc_array:
        """Return the change itself (n, n)."""
        half = csr_array(self.D.T @ self.G)
        return csc_array(half + half.T)

    def on_coarse(self, P: BlockMatrix) -> LocalChange:
        """Return its Galerkin product ``P.T (D.T G + G.T D) P``."""
        size, width = self.size, len(P.cols)
        nodes = np.unique(np.concatenate([self.D.indices, self.G.indices]) // size)
        P_own = csr_array(block_rows(P, nodes, (int(P.indices.max()) + 1) * width))
        E, H = (csr_array(_among(rows, nodes, size) @ P_own) for rows in (self.D, self.G))
        below = np.unique(np.concatenate([E.indices, H.indices]) // width)
        half = csr_array(_among(E, below, width).T @ _among(H, below, width))
        blocks = csr_array(half + half.T).tobsr((width, width))
        blocks.sort_indices()
        return LocalChange(below, blocks)


def _among(rows: csr_array, nodes: Indices, size: int) -> csr_array:
    """Return rows (m, k size) with the columns of k nodes alone, ascending, which are all that they have."""
    columns = np.searchsorted(nodes, rows.indices // size) * size + rows.indices % size
    pattern = columns.astype(np.int32), rows.indptr.astype(np.int32)
    return csr_array((rows.data, *pattern), shape=(rows.shape[0], len(nodes) * size))
