"""Elimination of linear constraints ``B u = c``: each pivot is a weighted sum of other unknowns plus an offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.linear.elimination import elimination_kernels, pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledPivots, Inverse, SparseInverse

NONE = SparseInverse(csr_array((0, 0)))


@dataclass(frozen=True, eq=False)
class Elimination:
    """``u[pivots] = weights @ u + offset``, or ``u[pivots] = P^-1 (weights @ u) + offset`` where pivots are coupled.

    Attributes
    ----------
    pivots : ndarray of int (m,)
        The eliminated unknown of each equation.
    weights : csr_array (m, n)
        Weights of the other unknowns; those of pivots are zero.
    offset : ndarray (m,)
    force_weights : csr_array (m, n)
        Fractions of the force at each pivot that are moved to the other unknowns: `weights`, unless multipliers act through
        other rows than B.
    inverse : SparseInverse or CoupledPivots
        Inverse of the pivots' columns of the rows that multipliers act through.
    own : SparseInverse or CoupledPivots
        Inverse of the pivots' columns of the equations. Where these are coupled, the weights do not include it.
    compliance : ndarray (m,), optional
        Compliance of the equations: ``B u + compliance * multiplier = c`` [length / force].
    """

    pivots: Indices
    weights: csr_array
    offset: Array
    force_weights: csr_array
    inverse: Inverse = NONE
    own: Inverse = NONE
    compliance: Array | None = None

    @property
    def coupled(self) -> bool:
        """Whether equations of many nodes share pivots."""
        return isinstance(self.own, CoupledPivots)

    def shifted(self, c: Array) -> Array:
        """Return the change of the pivots (m,) for a change c (m,) of the right-hand sides."""
        return self.own.solve(c)

    def multiplier(self, forces: Array) -> Array:
        """Return the multiplier (m,) with ``B.T multiplier = forces`` at the pivots; forces = (K u - f)[pivots]."""
        return self.inverse.solve_transposed(forces)

    def complete(self, x: Array, offset: Array | None = None) -> None:
        """Set the pivots of `x` (n,) to their weighted sums, plus `offset` (m,)."""
        elimination_kernels.complete(self.pivots, self.weights.indptr, self.weights.indices, self.weights.data, x)
        if self.coupled:
            x[self.pivots] = self.own.solve(x[self.pivots])
        if offset is not None:
            x[self.pivots] += offset

    def move_forces(self, r: Array) -> None:
        """Move the forces `r` (n,) at the pivots to the other unknowns."""
        W = self.force_weights
        if isinstance(self.inverse, CoupledPivots):
            r[self.pivots] = self.inverse.solve_transposed(r[self.pivots])
        elimination_kernels.move_forces(self.pivots, W.indptr, W.indices, W.data, r)

    def full_weights(self) -> csr_array:
        """Return the weights (m, n) of the other unknowns, a full matrix where pivots are coupled."""
        if not self.coupled:
            return self.weights
        columns = np.unique(self.weights.indices)
        full = csr_array(self.own.solve(self.weights[:, columns].toarray()))
        return csr_array((full.data, columns[full.indices], full.indptr), shape=self.weights.shape)

    def with_sparse_weights(self) -> Elimination:
        """Return this elimination or, where pivots are coupled, an approximation with sparse weights for a preconditioner."""
        if not self.coupled:
            return self
        weights = _weighted(self.own.sparse, self.weights)
        return Elimination(self.pivots, weights, np.zeros(len(self.pivots)), weights, self.own.sparse)


def eliminate(
    B: csr_array, c: Array, force_rows: csr_array | None = None, nodes: Indices | None = None, size: int = 1
) -> Elimination:
    """Choose the unknowns to eliminate from ``B u = c`` and express them in terms of the others; see `pivot_order`.

    Parameters
    ----------
    B : csr_array (m, n)
    c : ndarray (m,)
    force_rows : csr_array (m, n), optional
        Rows that multipliers act through, ``K u = f + force_rows.T multiplier``; B by default.
    nodes : ndarray of int (m,), optional
        The node of each equation; equations of one node may share unknowns.
    size : int
        Unknowns of a node.

    Raises
    ------
    RepeatedError
        If constraints are linearly dependent, so that there is no pivot for each.
    """
    B = csr_array(B, copy=True)
    if not B.has_canonical_format:
        B.sum_duplicates()
    B.eliminate_zeros()
    pivots, inverse = pivot_order.chosen(B, nodes, size)
    weights, offset = _weights(B, pivots, inverse), inverse.solve(c)
    if force_rows is None:
        return Elimination(pivots, weights, offset, weights, inverse, inverse)
    of_forces = pivot_order.inverse_of(force_rows, pivots, size)
    return Elimination(pivots, weights, offset, _weights(force_rows, pivots, of_forces), of_forces, inverse)


def _weights(B: csr_array, pivots: Indices, inverse: Inverse) -> csr_array:
    """Return the weights (m, n) of the other unknowns, given the inverse of the pivots' columns."""
    is_pivot = np.zeros(B.shape[1], bool)
    is_pivot[pivots] = True
    rest = csr_array((np.where(is_pivot[B.indices], 0.0, -B.data), B.indices, B.indptr), shape=B.shape, copy=True)
    rest.eliminate_zeros()
    return rest if isinstance(inverse, CoupledPivots) else _weighted(inverse, rest)


def _weighted(inverse: SparseInverse, rest: csr_array) -> csr_array:
    weights = csr_array(inverse.matrix @ rest)
    weights.sort_indices()
    return weights
