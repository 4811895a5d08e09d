"""Symmetric low-rank change ``D.T G + G.T D`` of a matrix, and its Galerkin product.

The elimination of m equations sets ``u[pivots] = weights @ u``. Let the rows of E (m, n) be the unit vectors of the pivots,
and ``D = weights - E``. The elimination is then the transformation ``T = I + E.T D``, and ``T.T A T`` differs from a
symmetric matrix A by ``D.T G + G.T D`` with ``G = A[pivots] + A[pivots][:, pivots] D / 2``. Springs with the rows R and the
diagonal stiffness S change the matrix by ``R.T S R``, which has this form with ``D = R`` and ``G = S R / 2``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from fastcontact.arrays import Indices
from fastcontact.linear.multigrid.local_change import LocalChange, restriction
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.sparse_rows import scaled
from fastcontact.linear.springs import Springs


@dataclass(frozen=True, eq=False)
class SymmetricChange:
    """The change ``D.T G + G.T D`` of a matrix (n, n).

    Attributes
    ----------
    D, G : csr_array (m, n)
        Factors of the change, for m equations or springs.
    size : int
        Number of unknowns per node.
    """

    D: csr_array
    G: csr_array
    size: int

    @classmethod
    def of_equations(cls, A: BlockMatrix, pivots: Indices, weights: csr_array) -> SymmetricChange:
        """Return ``T.T A T - A`` for a symmetric matrix A (n, n), where T sets ``u[pivots] = weights @ u``."""
        m = len(pivots)
        D = csr_array(weights + csr_array((np.full(m, -1.0), pivots, np.arange(m + 1)), shape=weights.shape))
        rows = A.rows_of(pivots)
        return cls(D, csr_array(rows + 0.5 * (rows[:, pivots] @ D)), len(A.rows))

    @classmethod
    def of_springs(cls, springs: Springs, size: int) -> SymmetricChange:
        """Return the change of a matrix by springs; each node has `size` unknowns."""
        return cls(springs.rows, scaled(springs.rows, 0.5 * springs.stiffness), size)

    def diagonal(self) -> LocalChange:
        """Return the diagonal blocks of the change."""
        D, G = (rows.tobsr((1, self.size)) for rows in (self.D, self.G))
        keys_of_D, keys_of_G = (self._numbers(rows) for rows in (D, G))
        # A diagonal block is a sum over the rows in which both D and G have entries of the node.
        _, in_D, in_G = np.intersect1d(keys_of_D, keys_of_G, return_indices=True)
        half = np.einsum("ka,kb->kab", D.data[in_D, 0], G.data[in_G, 0])
        nodes, slot = np.unique(D.indices, return_inverse=True)
        blocks = np.zeros((len(nodes), self.size, self.size))
        np.add.at(blocks, slot[in_D], half + half.transpose(0, 2, 1))
        return LocalChange.of_diagonal(nodes, blocks)

    @staticmethod
    def _numbers(rows: bsr_array) -> Indices:
        """Return keys (k,) of the k stored blocks of `rows` (m, n), which identify their block row and block column."""
        row = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
        return np.asarray(row * rows.shape[1] + rows.indices, np.intp)

    def on_finest(self) -> csc_array:
        """Return the change as a matrix (n, n)."""
        half = csr_array(self.D.T @ self.G)
        return csc_array(half + half.T)

    def on_coarse(self, P: BlockMatrix) -> LocalChange:
        """Return the Galerkin product ``P.T (D.T G + G.T D) P`` with the prolongator P."""
        nodes = np.unique(np.concatenate([self.D.indices, self.G.indices]) // self.size)
        coarse_nodes, R = restriction(P, nodes)
        dofs = (nodes[:, None] * self.size + np.arange(self.size)).ravel()
        DP, GP = (rows[:, dofs].tobsr((1, self.size)) @ R for rows in (self.D, self.G))
        half = bsr_array(DP.T @ GP)
        total = bsr_array(half + half.T)
        total.sort_indices()
        return LocalChange(coarse_nodes, total)
