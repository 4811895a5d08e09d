"""A multigrid hierarchy under tied unknowns: local changes to its levels, made and taken back.

The prolongators stay those of the free body, but for the rows of the tied unknowns, which follow what they are tied to.
Only Galerkin products near the ties change; they are kept beside the matrices of the levels, which stay as they are.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array, diags_array

from fastcontact.linear.elimination import constrained_matrix_kernels
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.multigrid import cycle_kernels, galerkin_kernels
from fastcontact.linear.multigrid.hierarchy import Hierarchy, Level, product
from fastcontact.linear.multigrid.matrix import Matrix

Array = NDArray[np.float64]
Values = NDArray[Any]
Indices = NDArray[np.int32]
# Sum of the weights with which a pivot may follow others before the spectrum of the finest level is looked at again.
WEIGHT = 4.0


@dataclass(eq=False)
class TiedRows:
    """Pivots that follow others, in the precision of the cycle."""

    pivots: NDArray[np.intp]
    indptr: Indices
    indices: Indices
    data: Values

    def complete(self, x: Values) -> None:
        """Set the pivots of `x`."""
        cycle_kernels.complete(self.pivots, self.indptr, self.indices, self.data, x)

    def condense(self, r: Values) -> None:
        """Move the forces at the pivots."""
        cycle_kernels.condense(self.pivots, self.indptr, self.indices, self.data, r)


@dataclass(eq=False)
class Change:
    """A symmetric matrix that is added to some rows of a level: blocks of nodes `nodes`, columns of all nodes."""

    nodes: NDArray[np.intp]
    indptr: Indices
    indices: Indices
    data: Values
    size: int

    def subtract(self, x: Values, r: Values) -> None:
        """Subtract the product with `x` from `r`."""
        cycle_kernels.subtract_rows(self.nodes, self.indptr, self.indices, self.data, x, r, self.size)


class Ties:
    """Ties and unties the levels of a hierarchy.

    Parameters
    ----------
    hierarchy : Hierarchy
    A : Matrix
        Its finest matrix.
    """

    def __init__(self, hierarchy: Hierarchy, A: Matrix) -> None:
        self.hierarchy, self.A = hierarchy, A
        self._kept: list[tuple[Level, NDArray[np.intp], Values]] = []

    def tie(self, elimination: Elimination | None) -> None:
        """Make the hierarchy that of ``T.T K T``; None: that of K."""
        self._untie()
        if elimination is None or not len(elimination.pivots):
            self.hierarchy.coarse.set(None)
            self.hierarchy.set_bounds()
            return
        self._change_levels(elimination)
        # On coarser levels ties often raise the spectrum, on the finest only where pivots follow several times over.
        anew = list(range(1, len(self.hierarchy.levels) - 1))
        weights = np.bincount(
            np.repeat(np.arange(len(elimination.pivots)), np.diff(elimination.tie.indptr)), np.abs(elimination.tie.data)
        )
        if weights.max(initial=0.0) > WEIGHT and len(self.hierarchy.levels) > 1:
            anew.insert(0, 0)
        self.hierarchy.set_bounds(anew)

    def _change_levels(self, elimination: Elimination) -> None:
        levels = self.hierarchy.levels
        top, tie = levels[0], elimination.tie
        kind = top.b.dtype
        top.tie = TiedRows(elimination.pivots, tie.indptr, tie.indices, tie.data.astype(kind))
        self._tie_diagonal(top, elimination)
        if top.P is None:
            self.hierarchy.coarse.set(_tied_change(self.hierarchy.coarse.matrix, elimination))
            return
        nodes, change = self._first_change(top, elimination)
        for level in levels[1:]:
            size = len(level.A.rows)
            if level.P is None:
                self.hierarchy.coarse.set(_scattered(nodes, change, level.n))
                return
            level.change = Change(
                nodes, change.indptr, nodes[change.indices].astype(np.int32), change.data.astype(kind), size
            )
            diagonal = galerkin_kernels.diagonal_blocks(change.indptr, change.indices, change.data, size)
            self._renew(level, nodes, level.diagonal.reshape(-1, size**2)[nodes] + diagonal.reshape(-1, size**2))
            nodes, change = _coarser(nodes, change, level.P)

    def _untie(self) -> None:
        for level, nodes, old in self._kept:
            level.inverse.reshape(-1, old.shape[1])[nodes] = old
        self._kept.clear()
        for level in self.hierarchy.levels:
            level.tie = level.change = None

    def _renew(self, level: Level, nodes: NDArray[np.intp], blocks: Array) -> None:
        """Set the inverses of the diagonal blocks of `nodes`, and remember what they were."""
        size = len(level.A.rows)
        inverse = np.empty(blocks.size, level.inverse.dtype)
        cycle_kernels.invert_blocks(np.ascontiguousarray(blocks, float).ravel(), size, inverse)
        every = level.inverse.reshape(-1, size**2)
        self._kept.append((level, nodes, every[nodes].copy()))
        every[nodes] = inverse.reshape(-1, size**2)

    def _number(self, elimination: Elimination) -> Indices:
        number = np.full(self.hierarchy.n, -1, np.int32)
        number[elimination.pivots] = np.arange(len(elimination.pivots))
        return number

    def _tie_diagonal(self, top: Level, elimination: Elimination) -> None:
        size, A, tie = len(top.A.rows), self.A, elimination.tie
        nodes = np.unique(np.concatenate([elimination.pivots, tie.indices]) // size).astype(np.intp)
        local = np.full(top.n // size, -1, np.int32)
        local[nodes] = np.arange(len(nodes))
        blocks = top.diagonal.reshape(-1, size**2)[nodes].astype(float).ravel()
        constrained_matrix_kernels.tied_diagonal(
            elimination.pivots, self._number(elimination), tie.indptr, tie.indices, tie.data, A.indptr, A.indices,
            A.exact, local, blocks, size,
        )  # fmt: skip
        self._renew(top, nodes, blocks.reshape(-1, size**2))

    def _first_change(self, top: Level, elimination: Elimination) -> tuple[NDArray[np.intp], Matrix]:
        """Return the nodes of the first coarse level whose rows change, and the change on them."""
        P, A, tie = top.P, self.A, elimination.tie
        assert P is not None
        size, n, n_coarse = len(P.rows), len(P.cols), self.hierarchy.levels[1].n // len(P.cols)
        E = constrained_matrix_kernels.tied_prolongator(
            elimination.pivots, tie.indptr, tie.indices, tie.data, P.indptr, P.indices, P.data, size, n, n_coarse
        )
        H = constrained_matrix_kernels.tied_products(
            elimination.pivots, self._number(elimination), A.indptr, A.indices, A.exact,
            P.indptr, P.indices, P.data, *E, size, n, n_coarse,
        )  # fmt: skip
        nodes = np.unique(np.concatenate([E[1], H[1]])).astype(np.intp)
        local = np.full(n_coarse, -1, np.int64)
        local[nodes] = np.arange(len(nodes))
        indptr, indices, data = constrained_matrix_kernels.coarse_change(*E, *H, local, len(nodes), P.cols)
        return nodes, Matrix(indptr, indices, data, P.cols, P.cols)


def _coarser(nodes: NDArray[np.intp], change: Matrix, P: Matrix) -> tuple[NDArray[np.intp], Matrix]:
    """Return the Galerkin product of a change of rows `nodes`, as nodes and matrix."""
    size, n = len(P.rows), len(P.cols)
    count = np.diff(P.indptr)[nodes]
    indptr = np.concatenate([[0], np.cumsum(count)]).astype(np.int32)
    blocks = np.repeat(P.indptr[nodes] - indptr[:-1], count) + np.arange(indptr[-1])
    below, columns = np.unique(P.indices[blocks], return_inverse=True)
    data = P.data.reshape(-1, size * n)[blocks].astype(float)
    own = Matrix(indptr, columns.astype(np.int32), data.ravel(), P.rows, P.cols)
    index = galerkin_kernels.transposed(own.indptr, own.indices, len(below))
    return below.astype(np.intp), product(change, own, index)


def _tied_change(A: Any, elimination: Elimination) -> Any:
    """Return ``T.T A T - A`` for a small matrix."""
    n, m = A.shape[0], len(elimination.pivots)
    keep = np.ones(n)
    keep[elimination.pivots] = 0.0
    spread = csr_array((np.ones(m), (elimination.pivots, np.arange(m))), shape=(n, m))
    T = diags_array(keep, format="csr") + spread @ elimination.tie
    return (T.T @ A @ T - A).tocsc()


def _scattered(nodes: NDArray[np.intp], change: Matrix, n: int) -> Any:
    """Return the change on all unknowns as SciPy's compressed columns."""
    size = len(change.rows)
    data = change.data.reshape(-1, size, size)
    row = np.repeat(nodes, np.diff(change.indptr))
    order = np.arange(len(data))
    indptr = np.concatenate([[0], np.cumsum(np.bincount(row, minlength=n // size))])
    return bsr_array((data[order], nodes[change.indices], indptr), shape=(n, n)).tocsc()
