"""Basis transformation on quadratic facets: constraints at corners eliminated along facet-wise linear functions.

Gaps weighted with such functions, those of standard mortar multipliers, have very small diagonal entries at corners: the
integral of a corner's quadratic function is zero on triangles, and negative on quadrangles. With nodal pivots the matrix to
invert is therefore nearly singular, and its inverse full. If instead a corner moves together with the mid nodes of its edges,
along its linear function D (n,), the entries are those of a mass matrix of linear facets: ``u + D s`` with
``s = (B D)^-1 (c - B u)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.linear.elimination import elimination_kernels, pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledPivots, SparseInverse
from fastcontact.linear.elimination.elimination import Elimination, eliminate
from fastcontact.linear.sparse_rows import scaled


@dataclass(frozen=True, eq=False)
class BasisTransformation(Elimination):
    """``u[pivots] += moves (B moves)^-1 (c - B u)``.

    The `pivots` (q,) are all unknowns that move, the `weights` (m, n) are -B, the `force_weights` minus the rows that
    multipliers act through.

    Attributes
    ----------
    moves : csr_array (q, m)
        D: displacement of the pivots for a unit displacement of the corner of an equation.
    corners : ndarray of int (m,)
        The unknown at the corner of each equation.
    """

    moves: csr_array = None  # type: ignore[assignment]
    corners: Indices = None  # type: ignore[assignment]

    def multiplier(self, forces: Array) -> Array:
        """See `Elimination.multiplier`; forces (q,)."""
        return super().multiplier(self.moves.T @ forces)

    def complete(self, x: Array, offset: Array | None = None) -> None:
        """See `Elimination.complete`; offset (q,)."""
        x[self.pivots] += self.moves @ self.shifted(self.weights @ x)
        if offset is not None:
            x[self.pivots] += offset

    def move_forces(self, r: Array) -> None:
        """See `Elimination.move_forces`: the remaining forces do no work along the corner functions."""
        W = self.force_weights
        elimination_kernels.add_rows(W.indptr, W.indices, W.data, self.multiplier(r[self.pivots]), r)

    def full_weights(self) -> csr_array:
        """See `Elimination.full_weights`."""
        inverse = self.own.matrix if isinstance(self.own, SparseInverse) else self.own.solve(np.eye(len(self.corners)))
        return self._following(csr_array(inverse), self.weights)

    def with_sparse_weights(self) -> Elimination:
        """See `Elimination.with_sparse_weights`."""
        rows = self.weights
        if isinstance(self.own, CoupledPivots):
            # Equations with the lumped matrix instead of the exact one: the projected motion satisfies them exactly.
            m, n = rows.shape
            E = csr_array((np.ones(m), self.corners, np.arange(m + 1)), shape=(m, n))
            rows = csr_array(rows + self.own.beyond_lumped @ E)
        W = self._following(self.own.sparse.matrix, rows)
        return Elimination(self.pivots, W, np.zeros(len(self.pivots)), W, self.own.sparse)

    def _following(self, inverse: csr_array, rows: csr_array) -> csr_array:
        """Return the weights (q, n) of all unknowns in the pivots."""
        q = len(self.pivots)
        identity = csr_array((np.ones(q), self.pivots, np.arange(q + 1)), shape=(q, rows.shape[1]))
        W = csr_array(identity + self.moves @ csr_array(inverse @ rows))
        W.sort_indices()
        return W


def eliminated(
    B: csr_array, c: Array, force_rows: csr_array | None, nodes: Indices | None, size: int, functions: csr_array | None
) -> Elimination:
    """Eliminate equations along the corner `functions` where they are of that kind, by nodal unknowns elsewhere.

    See `eliminate_transformed` and `elimination.eliminate`.
    """
    elimination = None
    if functions is not None and nodes is not None:
        elimination = eliminate_transformed(B, c, force_rows, nodes, size, functions)
    return eliminate(B, c, force_rows, nodes, size) if elimination is None else elimination


def eliminate_transformed(
    B: csr_array, c: Array, force_rows: csr_array | None, nodes: Indices, size: int, functions: csr_array
) -> BasisTransformation | None:
    """Return the elimination of equations along the corner functions, None where they are not of that kind.

    Parameters
    ----------
    B : csr_array (m, n)
        Equations.
    c : ndarray (m,)
    force_rows : csr_array (m, n), optional
        See `elimination.eliminate`, like `nodes` (m,) and `size`.
    functions : csr_array (n, n)
        Rows of mid nodes: their displacements for unit displacements of the corners.

    Raises
    ------
    RepeatedError
        If constraints are linearly dependent.
    """
    B, n = csr_array(B, copy=True), B.shape[1]
    B.eliminate_zeros()
    movable = np.bincount(B.indices, minlength=n) > 0  # supported unknowns have no entries
    beside = scaled(functions, movable.astype(float))
    beside.eliminate_zeros()
    with_mid_nodes = csr_array(B @ beside)
    if not with_mid_nodes.nnz:
        return None
    in_functions = csr_array(B + with_mid_nodes)
    in_functions.eliminate_zeros()
    corners = pivot_order.of_nodes(in_functions, nodes, size)
    if corners is None or np.diff(beside.indptr)[corners].any():
        return None
    inverse = pivot_order.inverse_of(in_functions, corners, size)
    m = len(corners)
    D = csr_array(beside[:, corners] + csr_array((np.ones(m), (corners, np.arange(m))), shape=(n, m)))
    pivots = np.flatnonzero(np.diff(D.indptr))
    moves, weights = csr_array(D[pivots]), csr_array(-B)
    force_weights, of_forces = weights, inverse
    if force_rows is not None:
        force_weights = csr_array(-force_rows)
        of_forces = pivot_order.inverse_of(csr_array(force_rows + force_rows @ beside), corners, size)
    offset = moves @ inverse.solve(c)
    return BasisTransformation(pivots, weights, offset, force_weights, of_forces, inverse, moves=moves, corners=corners)
