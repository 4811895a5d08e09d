"""Symmetric low-rank change ``D.T G + G.T D`` of a matrix, and its Galerkin product.

Eliminated equations set ``u[pivots] = weights @ u``. With the matrix D (m, n) of the weights minus the unit rows of the
pivots, this is the transformation ``T u = u + E.T D u``, where the columns of E.T are the unit vectors of the pivots. The
matrix ``T.T A T`` differs from A by ``D.T G + G.T D`` with ``G = A[pivots] + A[pivots][:, pivots] D / 2``. Springs with the
rows R and the diagonal stiffness S change the matrix by ``R.T S R``, which has the same form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import bsr_array, csc_array, csr_array

from fastcontact._jit.parallel import spread
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.linear.multigrid import symmetric_change_kernels
from fastcontact.linear.multigrid.local_change import LocalChange
from fastcontact.linear.multigrid.matrix import WORK_OF_ROW, BlockMatrix, pointers
from fastcontact.linear.sparse_rows import scaled
from fastcontact.linear.springs import Springs


@dataclass(frozen=True, eq=False)
class SymmetricChange:
    """The change ``D.T G + G.T D`` of a matrix (n, n).

    Attributes
    ----------
    D, G : csr_array (m, n)
    size : int
        Number of unknowns of a node.
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
        G = csr_array(rows + 0.5 * (rows[:, pivots] @ D))
        pattern = G.indices.astype(np.int32), G.indptr.astype(np.int32)
        return cls(D, csr_array((G.data, *pattern), shape=G.shape), len(A.rows))

    @classmethod
    def of_springs(cls, springs: Springs, size: int) -> SymmetricChange:
        """Return the change of a matrix by springs; each node has `size` unknowns."""
        return cls(springs.rows, scaled(springs.rows, 0.5 * springs.stiffness), size)

    def diagonal(self) -> LocalChange:
        """Return the diagonal blocks of the change."""
        D, G, size = self.D, self.G, self.size
        nodes = np.unique(D.indices // size)
        row_of_node = np.full(D.shape[1] // size, -1, np.int32)
        row_of_node[nodes] = np.arange(len(nodes))
        blocks = np.zeros(len(nodes) * size * size)
        symmetric_change_kernels.diagonal(
            D.indptr, D.indices, D.data, G.indptr, G.indices, G.data, row_of_node, size, blocks
        )
        return LocalChange.of_diagonal(nodes, blocks.reshape(-1, size, size))

    def on_finest(self) -> csc_array:
        """Return the change as a matrix (n, n)."""
        half = csr_array(self.D.T @ self.G)
        return csc_array(half + half.T)

    def on_coarse(self, P: BlockMatrix) -> LocalChange:
        """Return the Galerkin product ``P.T (D.T G + G.T D) P`` with the prolongator P."""
        E, H = _restricted(self.D, P), _restricted(self.G, P)
        return _symmetric_product(E, H, P.cols)


@dataclass(frozen=True, eq=False)
class _Restricted:
    """Sparse rows whose entries come in blocks of the unknowns of coarse nodes.

    Attributes
    ----------
    indptr : ndarray of int (m + 1,)
        Offsets of the rows.
    nodes : ndarray of int (n_blocks,)
        Coarse node of each block.
    numbers : ndarray (n_blocks * size,)
        Entries of the blocks, for `size` unknowns per coarse node.
    """

    indptr: Numbers
    nodes: Numbers
    numbers: Array


def _restricted(rows: csr_array, P: BlockMatrix) -> _Restricted:
    """Return the product ``rows @ P`` of rows (m, n) and the prolongator."""
    size, n_coarse, count = len(P.rows), int(P.indices.max()) + 1, np.empty(rows.shape[0], np.int32)
    through = P.indptr, P.indices
    spread(
        symmetric_change_kernels.count_restricted, len(count), WORK_OF_ROW, rows.indptr, rows.indices, *through, size,
        n_coarse, count,
    )  # fmt: skip
    into = pointers(count)
    nodes, numbers = np.empty(into[-1], np.int32), np.zeros(int(into[-1]) * len(P.cols))
    spread(
        symmetric_change_kernels.restrict, len(count), WORK_OF_ROW, rows.indptr, rows.indices, rows.data, *through, P.data,
        size, n_coarse, into, nodes, numbers, P.cols,
    )  # fmt: skip
    return _Restricted(into, nodes, numbers)


def _symmetric_product(E: _Restricted, H: _Restricted, cols: tuple[int, ...]) -> LocalChange:
    """Return ``E.T H + H.T E`` as a change of the coarse matrix; `cols` is a tuple of the number of unknowns per node."""
    nodes = np.unique(np.concatenate([E.nodes, H.nodes]))
    row_of_node = np.empty(nodes[-1] + 1, np.int32)
    row_of_node[nodes] = np.arange(len(nodes))
    k, size, slots = len(nodes), len(cols), np.arange(len(E.nodes), dtype=np.int32)
    by_column = csr_array((slots, row_of_node[E.nodes], E.indptr), shape=(len(E.indptr) - 1, k)).tocsc()
    rows, pattern = (by_column.indptr, by_column.indices), (H.indptr, row_of_node[H.nodes])
    count = np.empty(k, np.int32)
    spread(symmetric_change_kernels.count_products, k, WORK_OF_ROW, *rows, *pattern, k, count)
    into = pointers(count)
    columns, blocks = np.empty(into[-1], np.int32), np.zeros(int(into[-1]) * size * size)
    spread(
        symmetric_change_kernels.products, k, WORK_OF_ROW, *rows, by_column.data, E.numbers, *pattern, H.numbers, k, into,
        columns, blocks, cols,
    )  # fmt: skip
    half = bsr_array((blocks.reshape(-1, size, size), columns, into), shape=(k * size, k * size))
    total = bsr_array(half + half.T)
    total.sort_indices()
    return LocalChange(nodes, total)
