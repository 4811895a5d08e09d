"""Local update of a symmetric block matrix, and its Galerkin product on the next coarser level."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import DTypeLike
from scipy.sparse import bsr_array, csc_array

from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.linear.multigrid.matrix import BlockMatrix, diagonal_blocks


@dataclass(frozen=True, eq=False)
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

    @classmethod
    def of_diagonal(cls, nodes: Indices, blocks: Array) -> LocalChange:
        """Return the change that consists of the diagonal `blocks` (k, size, size) of `nodes` (k,)."""
        n = blocks.shape[0] * blocks.shape[1]
        return cls(nodes, bsr_array((blocks, np.arange(len(nodes)), np.arange(len(nodes) + 1)), shape=(n, n)))

    @property
    def size(self) -> int:
        """Number of unknowns of a node."""
        return int(self.blocks.blocksize[0])

    def diagonal(self) -> AnyArray:
        """Return the diagonal blocks (k * size * size,) of the change."""
        return diagonal_blocks(self.blocks.indptr, self.blocks.indices, self.blocks.data, self.size)

    def rows(self, kind: DTypeLike) -> tuple[Any, ...]:
        """Return the change as block rows: `nodes`, `indptr`, `indices` and `data` as in `BlockMatrix`.

        `indices` are numbers of nodes of the complete matrix. `kind` is the data type of `data`, which is a tuple of one.
        """
        columns = self.nodes[self.blocks.indices].astype(np.int32)
        return self.nodes, self.blocks.indptr, columns, (self.blocks.data.astype(kind).ravel(),)

    def coarser(self, P: BlockMatrix) -> LocalChange:
        """Return the Galerkin product ``P.T change P``, the change of the next coarser matrix with the prolongator P."""
        coarse_nodes, rows = restriction(P, self.nodes)
        product = bsr_array(rows.T @ self.blocks @ rows)
        product.sort_indices()
        return LocalChange(coarse_nodes, product)

    def scattered(self, n: int) -> csc_array:
        """Return the change as a matrix (n, n) of all unknowns."""
        change, count = self.blocks, np.zeros(n // self.size, np.intp)
        count[self.nodes] = np.diff(change.indptr)
        indptr = np.r_[0, np.cumsum(count)]
        return bsr_array((change.data, self.nodes[change.indices], indptr), shape=(n, n)).tocsc()

    def spread(self, nodes: Indices) -> bsr_array:
        """Return `blocks` with zero rows and columns added for a superset `nodes` (l,), in ascending order."""
        index = np.searchsorted(nodes, self.nodes)
        count = np.zeros(len(nodes), np.intp)
        count[index] = np.diff(self.blocks.indptr)
        n = len(nodes) * self.size
        return bsr_array((self.blocks.data, index[self.blocks.indices], np.r_[0, np.cumsum(count)]), shape=(n, n))


def merged(change: LocalChange, *others: LocalChange) -> LocalChange:
    """Return the sum of several changes of the same matrix."""
    for other in others:
        nodes = np.union1d(change.nodes, other.nodes)
        total = bsr_array(change.spread(nodes) + other.spread(nodes))
        total.sort_indices()
        change = LocalChange(nodes, total)
    return change


def restriction(P: BlockMatrix, nodes: Indices) -> tuple[Indices, bsr_array]:
    """Return the coarse nodes (l,) that P connects with `nodes` (k,), and P between them, in double precision."""
    rows, cols = len(P.rows), len(P.cols)
    count = np.diff(P.indptr)[nodes]
    indptr = np.concatenate([[0], np.cumsum(count)])
    blocks = np.repeat(P.indptr[nodes] - indptr[:-1], count) + np.arange(indptr[-1])
    coarse_nodes, columns = np.unique(P.indices[blocks], return_inverse=True)
    data = P.data.reshape(-1, rows, cols)[blocks].astype(float)
    return coarse_nodes, bsr_array((data, columns, indptr), shape=(len(nodes) * rows, len(coarse_nodes) * cols))
