"""A multigrid hierarchy under eliminated equations: local changes of its levels, made and taken back.

The prolongators stay those without equations, except for the rows of the eliminated unknowns, the pivots. Only Galerkin
products near the pivots change. The changes are stored beside the matrices of the levels, which stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array

from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import constrained_hierarchy_kernels as kernels
from fastcontact.linear.multigrid import cycle_kernels, galerkin_kernels
from fastcontact.linear.multigrid.hierarchy import Hierarchy, Level, product
from fastcontact.linear.multigrid.matrix import BlockMatrix

Array = NDArray[np.float64]
Values = NDArray[Any]
Indices = NDArray[np.int32]
Nodes = NDArray[np.intp]
# Sum of the weights with which a pivot may follow others before the spectrum of the finest level is estimated again.
WEIGHT = 4.0


@dataclass(eq=False)
class MatrixChange:
    """A symmetric matrix that is added to the rows `nodes` of a level: blocks size x size, columns of all nodes."""

    nodes: Nodes
    indptr: Indices
    indices: Indices
    data: Values
    size: int

    def subtract(self, x: Values, r: Values) -> None:
        """Subtract the product with `x` (n,) from `r` (n,)."""
        cycle_kernels.subtract_rows(self.nodes, self.indptr, self.indices, self.data, x, r, self.size)


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
        levels = self.hierarchy.levels
        top, W = levels[0], elimination.weights
        kind = top.b.dtype
        rounded = W.astype(kind)
        top.eliminated = replace(elimination, weights=rounded, force_weights=rounded)
        self._change_diagonal(top, elimination)
        if top.P is None:
            self.hierarchy.coarse.set(_coarse_change(self.hierarchy.coarse.matrix, elimination))
            return
        nodes, change = self._first_change(top, elimination)
        for level in levels[1:]:
            size = len(level.A.rows)
            if level.P is None:
                self.hierarchy.coarse.set(_scattered(nodes, change, level.n))
                return
            columns = nodes[change.indices].astype(np.int32)
            level.change = MatrixChange(nodes, change.indptr, columns, change.data.astype(kind), size)
            diagonal = galerkin_kernels.diagonal_blocks(change.indptr, change.indices, change.data, size)
            self._renew(level, nodes, level.diagonal.reshape(-1, size**2)[nodes] + diagonal.reshape(-1, size**2))
            nodes, change = _coarser(nodes, change, level.P)

    def _undo(self) -> None:
        for level, nodes, old in self._kept:
            level.inverse.reshape(-1, old.shape[1])[nodes] = old
        self._kept.clear()
        for level in self.hierarchy.levels:
            level.eliminated = level.change = None

    def _renew(self, level: Level, nodes: Nodes, blocks: Array) -> None:
        """Set the inverses of the diagonal blocks of `nodes`, and remember what they were."""
        size = len(level.A.rows)
        inverse = np.empty(blocks.size, level.inverse.dtype)
        cycle_kernels.invert_blocks(np.ascontiguousarray(blocks, float).ravel(), size, inverse)
        every = level.inverse.reshape(-1, size**2)
        self._kept.append((level, nodes, every[nodes].copy()))
        every[nodes] = inverse.reshape(-1, size**2)

    def _change_diagonal(self, top: Level, elimination: Elimination) -> None:
        size, A, W = len(top.A.rows), self.A, elimination.weights
        nodes = np.unique(np.concatenate([elimination.pivots, W.indices]) // size).astype(np.intp)
        blocks = top.diagonal.reshape(-1, size**2)[nodes].astype(float).ravel()
        kernels.constrain_diagonal(
            elimination.pivots, _numbers(elimination.pivots, top.n), W.indptr, W.indices, W.data, A.indptr, A.indices,
            A.exact, _numbers(nodes, top.n // size), blocks, size,
        )  # fmt: skip
        self._renew(top, nodes, blocks.reshape(-1, size**2))

    def _first_change(self, top: Level, elimination: Elimination) -> tuple[Nodes, BlockMatrix]:
        """Return the nodes of the first coarse level whose rows change, and the change on them."""
        P, A, W, pivots = top.P, self.A, elimination.weights, elimination.pivots
        assert P is not None
        size, n, n_coarse = len(P.rows), len(P.cols), self.hierarchy.levels[1].n // len(P.cols)
        E = kernels.prolongator_change(
            pivots, W.indptr, W.indices, W.data, P.indptr, P.indices, P.data, size, n, n_coarse
        )
        H = kernels.products_at_pivots(
            pivots, _numbers(pivots, top.n), A.indptr, A.indices, A.exact, P.indptr, P.indices, P.data, *E, size, n,
            n_coarse,
        )  # fmt: skip
        nodes = np.unique(np.concatenate([E[1], H[1]])).astype(np.intp)
        indptr, indices, data = kernels.coarse_change(*E, *H, _numbers(nodes, n_coarse), len(nodes), P.cols)
        return nodes, BlockMatrix(indptr, indices, data, P.cols, P.cols)


def _numbers(some: Nodes, n: int) -> Indices:
    """Return the place of each of n among `some` (m,), -1 for the others."""
    number = np.full(n, -1, np.int32)
    number[some] = np.arange(len(some))
    return number


def _coarser(nodes: Nodes, change: BlockMatrix, P: BlockMatrix) -> tuple[Nodes, BlockMatrix]:
    """Return the Galerkin product of a change of rows `nodes`, as nodes and matrix."""
    size, n = len(P.rows), len(P.cols)
    count = np.diff(P.indptr)[nodes]
    indptr = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    blocks = np.repeat(P.indptr[nodes] - indptr[:-1], count) + np.arange(indptr[-1])
    below, columns = np.unique(P.indices[blocks], return_inverse=True)
    data = P.data.reshape(-1, size * n)[blocks].astype(float)
    own = BlockMatrix(indptr, columns.astype(np.int32), data.ravel(), P.rows, P.cols)
    index = galerkin_kernels.transposed(own.indptr, own.indices, len(below))
    return below.astype(np.intp), product(change, own, index)


def _coarse_change(A: csc_array, elimination: Elimination) -> csc_array:
    """Return ``T.T A T - A`` for a small matrix, ``u = T u`` the elimination."""
    n, m = A.shape[0], len(elimination.pivots)
    keep = np.ones(n)
    keep[elimination.pivots] = 0.0
    spread = csr_array((np.ones(m), (elimination.pivots, np.arange(m))), shape=(n, m))
    T = diags_array(keep, format="csr") + spread @ elimination.weights
    return (T.T @ A @ T - A).tocsc()


def _scattered(nodes: Nodes, change: BlockMatrix, n: int) -> csc_array:
    """Return the change on all n unknowns."""
    size = len(change.rows)
    row = np.repeat(nodes, np.diff(change.indptr))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=n // size))])
    return bsr_array((change.data.reshape(-1, size, size), nodes[change.indices], indptr), shape=(n, n)).tocsc()
