"""A multigrid hierarchy under eliminated equations: local changes of its levels, made and taken back.

The prolongators stay those without equations, except for the rows of the eliminated unknowns, the pivots. Only Galerkin
products near the pivots change. The changes are stored beside the matrices of the levels, which stay as they are. On the
finest level only diagonal blocks are formed: products with the matrix move displacements and forces at the pivots instead.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array

from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import constrained_kernels, cycle_kernels
from fastcontact.linear.multigrid.hierarchy import Hierarchy, Level
from fastcontact.linear.multigrid.matrix import BlockMatrix, diagonal_blocks

Array = NDArray[np.float64]
Values = NDArray[Any]
Nodes = NDArray[np.intp]
# Sum of the weights with which a pivot may follow others before the spectrum of the finest level is estimated again.
WEIGHT = 4.0


class ConstrainedHierarchy:
    """Changes the levels of a hierarchy to those under equations, and back.

    Parameters
    ----------
    hierarchy : Hierarchy
    A : BlockMatrix
        Its finest matrix, all digits.
    """

    def __init__(self, hierarchy: Hierarchy, A: BlockMatrix) -> None:
        self.hierarchy, self.A = hierarchy, A
        self._kept: list[tuple[Level, Nodes, Values]] = []

    def constrain(self, elimination: Elimination | None) -> None:
        """Make the hierarchy that of the matrix under the equations eliminated; None: without equations."""
        self._undo()
        if elimination is None or not len(elimination.pivots):
            self.hierarchy.coarse.set(None)
            self.hierarchy.set_bounds()
            return
        self._change_levels(elimination)
        # On coarser levels equations often raise the spectrum, on the finest only where pivots follow several times over.
        anew = list(range(1, len(self.hierarchy.levels) - 1))
        W = elimination.weights
        sums = np.bincount(np.repeat(np.arange(len(elimination.pivots)), np.diff(W.indptr)), np.abs(W.data))
        if sums.max(initial=0.0) > WEIGHT and len(self.hierarchy.levels) > 1:
            anew.insert(0, 0)
        self.hierarchy.set_bounds(anew)

    def _change_levels(self, elimination: Elimination) -> None:
        top = self.hierarchy.levels[0]
        kind = top.b.dtype
        rounded = elimination.weights.astype(kind)
        top.eliminated = replace(elimination, weights=rounded, force_weights=rounded)
        first = CoarseChange(self.A, elimination)
        if top.P is None:
            self.hierarchy.coarse.set(first.on_finest())
            return
        self._change_top_diagonal(elimination)
        nodes, change = first.on_coarse(top.P)
        for level in self.hierarchy.levels[1:]:
            if level.P is None:
                self.hierarchy.coarse.set(_scattered(nodes, change, level.n))
                return
            size = len(level.A.rows)
            self._change_diagonal(level, nodes, diagonal_blocks(change.indptr, change.indices, change.data, size))
            columns = nodes[change.indices].astype(np.int32)
            level.change = nodes, change.indptr, columns, change.data.astype(kind).ravel()
            nodes, change = _coarser(nodes, change, level.P)

    def _undo(self) -> None:
        for level, nodes, old in self._kept:
            level.inverse.reshape(-1, old.shape[1])[nodes] = old
        self._kept.clear()
        for level in self.hierarchy.levels:
            level.eliminated = level.change = None

    def _change_top_diagonal(self, elimination: Elimination) -> None:
        """Change the diagonal blocks of the finest level to those under the equations."""
        A, W, pivots = self.A, elimination.weights, elimination.pivots
        size, n_nodes = len(A.rows), len(A.indptr) - 1
        nodes = np.unique(np.concatenate([pivots, W.indices]) // size)
        number, place = np.full(n_nodes * size, -1, np.int32), np.full(n_nodes, -1, np.int32)
        number[pivots], place[nodes] = np.arange(len(pivots)), np.arange(len(nodes))
        change = np.zeros(len(nodes) * size * size)
        constrained_kernels.diagonal_change(
            pivots, number, W.indptr, W.indices, W.data, A.indptr, A.indices, A.exact, place, size, change
        )
        self._change_diagonal(self.hierarchy.levels[0], nodes, change)

    def _change_diagonal(self, level: Level, nodes: Nodes, change: Array) -> None:
        """Add `change` (k * size * size,) to the diagonal blocks of k `nodes`, and remember what the inverses were."""
        size = len(level.A.rows)
        blocks = level.diagonal.reshape(-1, size**2)[nodes].astype(float).ravel() + change
        inverse = np.empty(blocks.size, level.inverse.dtype)
        cycle_kernels.invert_blocks(blocks, size, inverse)
        every = level.inverse.reshape(-1, size**2)
        self._kept.append((level, nodes, every[nodes].copy()))
        every[nodes] = inverse.reshape(-1, size**2)


class CoarseChange:
    """What equations change in the Galerkin product of the finest level, ``P.T (T.T A T - A) P``; they say ``u = T u``.

    With D the rows ``weights - 1`` that pivots change by, and K the rows of A at the pivots, it is ``E.T H + H.T E``,
    ``E = D P``, ``H = K P + K[:, pivots] E / 2``.

    Parameters
    ----------
    A : BlockMatrix
    elimination : Elimination
    """

    def __init__(self, A: BlockMatrix, elimination: Elimination) -> None:
        self._size, pivots, m = len(A.rows), elimination.pivots, len(elimination.pivots)
        size, shape = self._size, elimination.weights.shape
        D = csr_array(elimination.weights + csr_array((np.full(m, -1.0), pivots, np.arange(m + 1)), shape=shape))
        own, place = np.unique(pivots // size, return_inverse=True)
        K = csr_array(block_rows(A, own, shape[1]).tocsr()[place * size + pivots % size])
        K.eliminate_zeros()
        self._nodes = np.unique(np.concatenate([D.indices, K.indices]) // size)
        self._D, self._K = (_renumbered(M, self._nodes, size) for M in (D, K))
        self._among = self._K[:, _places(pivots, self._nodes, size)]
        self._n = shape[1]

    def on_finest(self) -> csc_array:
        """Return ``T.T A T - A``, on all unknowns."""
        half = self._D.T @ (self._K + 0.5 * (self._among @ self._D))
        return _scattered(self._nodes, bsr_array((half + half.T).tobsr(2 * (self._size,))), self._n)

    def on_coarse(self, P: BlockMatrix) -> tuple[Nodes, bsr_array]:
        """Return the nodes of the next coarser level whose rows change, and the change on them."""
        size, rows = len(P.cols), block_rows(P, self._nodes, (int(P.indices.max()) + 1) * len(P.cols)).tocsr()
        E = csr_array(self._D @ rows)
        H = csr_array(self._K @ rows + 0.5 * (self._among @ E))
        nodes = np.unique(np.concatenate([E.indices, H.indices]) // size)
        half = _renumbered(E, nodes, size).T @ _renumbered(H, nodes, size)
        change = bsr_array((half + half.T).tobsr((size, size)))
        change.sort_indices()
        return nodes, change


def _places(columns: Any, nodes: Nodes, size: int) -> Any:
    """Return the numbers of `columns` where only those of `nodes`, ascending, are counted."""
    return np.searchsorted(nodes, columns // size) * size + columns % size


def _renumbered(M: csr_array, nodes: Nodes, size: int) -> csr_array:
    """Return a matrix with columns of `nodes` alone."""
    return csr_array((M.data, _places(M.indices, nodes, size), M.indptr), shape=(M.shape[0], len(nodes) * size))


def block_rows(A: BlockMatrix, nodes: Nodes, n: int) -> bsr_array:
    """Return the block rows `nodes` of a matrix with n columns, in double precision."""
    rows, cols = len(A.rows), len(A.cols)
    count = np.diff(A.indptr)[nodes]
    indptr = np.concatenate([[0], np.cumsum(count)])
    blocks = np.repeat(A.indptr[nodes] - indptr[:-1], count) + np.arange(indptr[-1])
    data = sum(part.reshape(-1, rows, cols)[blocks].astype(float) for part in A.exact)
    return bsr_array((data, A.indices[blocks], indptr), shape=(len(nodes) * rows, n))


def _coarser(nodes: Nodes, change: bsr_array, P: BlockMatrix) -> tuple[Nodes, bsr_array]:
    """Return the Galerkin product of a change of rows `nodes`, in the same form."""
    own = block_rows(P, nodes, (int(P.indices.max()) + 1) * len(P.cols))
    below, columns = np.unique(own.indices, return_inverse=True)
    own = bsr_array((own.data, columns, own.indptr), shape=(own.shape[0], len(below) * len(P.cols)))
    product = bsr_array(own.T @ change @ own)
    product.sort_indices()
    return below, product


def _scattered(nodes: Nodes, change: bsr_array, n: int) -> csc_array:
    """Return the change on all n unknowns."""
    size = change.blocksize[0]
    count = np.zeros(n // size, np.intp)
    count[nodes] = np.diff(change.indptr)
    return bsr_array((change.data, nodes[change.indices], np.r_[0, np.cumsum(count)]), shape=(n, n)).tocsc()
