"""Local changes of a symmetric block matrix, and their Galerkin products on coarser levels.

The elimination of m equations sets ``u[pivots] = weights @ u``. Let the rows of E (m, n) be the unit vectors of the pivots,
and ``D = weights - E``. The elimination is then the transformation ``T = I + E.T D``, and ``T.T A T`` differs from a
symmetric matrix A by ``D.T G + G.T D`` with ``G = A[pivots] + A[pivots][:, pivots] D / 2``. Springs with the rows R and the
diagonal stiffness S change the matrix by ``R.T S R``, which has this form with ``D = R`` and ``G = S R / 2``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import bsr_array, csc_array, csr_array

from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Indices
from fastcontact.linear.multigrid.matrix import BlockMatrix, diagonal_blocks
from fastcontact.linear.sparse_rows import entry_rows, scaled
from fastcontact.linear.springs import Springs


@record
class LocalChange:
    """Symmetric change of a block matrix that is restricted to the rows and columns of k nodes.

    Attributes
    ----------
    nodes : ndarray of int (k,)
        Numbers of the nodes, in ascending order.
    blocks : bsr_array (k * size, k * size)
        The change, in canonical format; each node has `size` unknowns.
    """

    nodes: Indices
    blocks: bsr_array

    @property
    def size(self) -> int:
        """Number of unknowns of a node."""
        return int(self.blocks.blocksize[0])

    def diagonal(self) -> AnyArray:
        """Return the diagonal blocks (k * size * size,) of the change."""
        return diagonal_blocks(self.blocks.indptr, self.blocks.indices, self.blocks.data, self.size)

    def rows(self, dtype: DTypeLike) -> tuple[Any, ...]:
        """Return the change as block rows: `nodes`, `indptr`, `indices` and `data` as in `BlockMatrix`.

        `indices` are numbers of nodes of the complete matrix. `dtype` is the data type of `data`, a tuple of one array.
        """
        columns = self.nodes[self.blocks.indices].astype(np.int32)
        return self.nodes, self.blocks.indptr, columns, (self.blocks.data.astype(dtype).ravel(),)

    def galerkin_product(self, P: BlockMatrix) -> LocalChange:
        """Return the Galerkin product ``P.T change P``, the change of the next coarser matrix with the prolongator P."""
        coarse_nodes, P_rows = rows_of_prolongator(P, self.nodes)
        return LocalChange(coarse_nodes, bsr_array(P_rows.T @ self.blocks @ P_rows).sorted_indices())

    def padded(self, nodes: Indices) -> bsr_array:
        """Return `blocks` with zero rows and columns added for `nodes` (l,), an ascending superset of the nodes."""
        index = np.searchsorted(nodes, self.nodes)
        count = np.zeros(len(nodes), np.intp)
        count[index] = np.diff(self.blocks.indptr)
        n = len(nodes) * self.size
        return bsr_array((self.blocks.data, index[self.blocks.indices], np.r_[0, np.cumsum(count)]), shape=(n, n))


def sum_of_changes(change: LocalChange, *others: LocalChange) -> LocalChange:
    """Return the sum of several changes of the same matrix."""
    for other in others:
        nodes = np.union1d(change.nodes, other.nodes)
        change = LocalChange(nodes, bsr_array(change.padded(nodes) + other.padded(nodes)).sorted_indices())
    return change


def rows_of_prolongator(P: BlockMatrix, nodes: Indices) -> tuple[Indices, bsr_array]:
    """Return the coarse nodes (l,) that P connects with `nodes` (k,), and P between them, in double precision."""
    rows, cols = len(P.rows), len(P.cols)
    count = np.diff(P.indptr)[nodes]
    indptr = np.concatenate([[0], np.cumsum(count)])
    blocks = np.repeat(P.indptr[nodes] - indptr[:-1], count) + np.arange(indptr[-1])
    coarse_nodes, columns = np.unique(P.indices[blocks], return_inverse=True)
    data = P.data.reshape(-1, rows, cols)[blocks].astype(float)
    return coarse_nodes, bsr_array((data, columns, indptr), shape=(len(nodes) * rows, len(coarse_nodes) * cols))


@record
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
        keys_of_D, keys_of_G = (self._keys(rows) for rows in (D, G))
        # A diagonal block is a sum over the rows in which both D and G have entries of the node.
        _, in_D, in_G = np.intersect1d(keys_of_D, keys_of_G, return_indices=True)
        half = np.einsum("ka,kb->kab", D.data[in_D, 0], G.data[in_G, 0])
        nodes, slot = np.unique(D.indices, return_inverse=True)
        blocks = np.zeros((len(nodes), self.size, self.size))
        np.add.at(blocks, slot[in_D], half + half.transpose(0, 2, 1))
        n, offsets = len(nodes) * self.size, np.arange(len(nodes) + 1)
        return LocalChange(nodes, bsr_array((blocks, offsets[:-1], offsets), shape=(n, n)))

    @staticmethod
    def _keys(rows: bsr_array) -> Indices:
        """Return keys (k,) of the k stored blocks of `rows` (m, n), which identify their block row and block column."""
        row = entry_rows(rows)
        return np.asarray(row * rows.shape[1] + rows.indices, np.intp)

    def matrix(self) -> csc_array:
        """Return the change as a matrix (n, n)."""
        half = csr_array(self.D.T @ self.G)
        return csc_array(half + half.T)

    def galerkin_product(self, P: BlockMatrix) -> LocalChange:
        """Return the Galerkin product ``P.T (D.T G + G.T D) P`` with the prolongator P."""
        nodes = np.unique(np.concatenate([self.D.indices, self.G.indices]) // self.size)
        coarse_nodes, P_rows = rows_of_prolongator(P, nodes)
        dofs = (nodes[:, None] * self.size + np.arange(self.size)).ravel()
        DP, GP = (rows[:, dofs].tobsr((1, self.size)) @ P_rows for rows in (self.D, self.G))
        half = bsr_array(DP.T @ GP)
        return LocalChange(coarse_nodes, bsr_array(half + half.T).sorted_indices())
