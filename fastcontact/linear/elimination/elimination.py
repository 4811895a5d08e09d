"""Elimination of linear equations ``B u = c``: one unknown of each is a weighted sum of others plus an offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.linear.elimination import elimination_kernels, pivot_order

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Elimination:
    """``u[pivots] = weights @ u + offset``.

    Attributes
    ----------
    pivots : ndarray of int (m,)
        The eliminated unknown of each equation.
    weights : csr_array (m, n)
        Weights of the other unknowns; those of pivots are zero.
    offset : ndarray (m,)
    force_weights : csr_array (m, n)
        Shares of the force at each pivot that go to the other unknowns: `weights`, unless multipliers act through other
        rows than B.
    inverse : csr_array (m, m)
        Inverse of the pivots' columns of the rows that multipliers act through.
    """

    pivots: Indices
    weights: csr_array
    offset: Array
    force_weights: csr_array
    inverse: csr_array

    def multiplier(self, forces: Array) -> Array:
        """Return the multiplier (m,) with ``B.T multiplier = forces`` at the pivots; forces = (K u - f)[pivots]."""
        return np.asarray(self.inverse.T @ forces)

    def complete(self, x: Array, offset: Array | None = None) -> None:
        """Set the pivots of `x` (n,) to their weighted sums, plus `offset` (m,)."""
        elimination_kernels.complete(self.pivots, self.weights.indptr, self.weights.indices, self.weights.data, x)
        if offset is not None:
            x[self.pivots] += offset

    def move_forces(self, r: Array) -> None:
        """Move the forces `r` (n,) at the pivots to the other unknowns."""
        W = self.force_weights
        elimination_kernels.move_forces(self.pivots, W.indptr, W.indices, W.data, r)

    def restore_forces(self, r: Array, forces: Array) -> None:
        """Undo `move_forces`, given the `forces` (m,) that were at the pivots."""
        W = self.force_weights
        elimination_kernels.restore_forces(self.pivots, W.indptr, W.indices, W.data, forces, r)


def eliminate(
    B: csr_array, c: Array, force_rows: csr_array | None = None, groups: Indices | None = None
) -> Elimination:
    """Choose the unknowns to eliminate from ``B u = c`` and express them by the others; see `pivot_order`.

    Parameters
    ----------
    B : csr_array (m, n)
    c : ndarray (m,)
    force_rows : csr_array (m, n), optional
        Rows that multipliers act through, ``K u = f + force_rows.T multiplier``; B by default.
    groups : ndarray of int (m,), optional
        Number of the group of each equation, such as a node: those of a group may share unknowns of their own.

    Raises
    ------
    RepeatedError
        If equations repeat each other, so that there is no unknown to eliminate for each.
    """
    B = csr_array(B, copy=True)
    if not B.has_canonical_format:
        B.sum_duplicates()
    B.eliminate_zeros()
    pivots, inverse = pivot_order.chosen(B, groups)
    weights, offset = _weights(B, pivots, inverse), np.asarray(inverse @ c, float)
    if force_rows is None:
        return Elimination(pivots, weights, offset, weights, inverse)
    inverse = pivot_order.block_inverse(csr_array(force_rows[:, pivots]))
    return Elimination(pivots, weights, offset, _weights(force_rows, pivots, inverse), inverse)


def _weights(B: csr_array, pivots: Indices, inverse: csr_array) -> csr_array:
    """Return the weights (m, n) of the other unknowns, given the `inverse` (m, m) of the pivots' columns."""
    is_pivot = np.zeros(B.shape[1], bool)
    is_pivot[pivots] = True
    rest = csr_array((np.where(is_pivot[B.indices], 0.0, -B.data), B.indices, B.indptr), shape=B.shape, copy=True)
    rest.eliminate_zeros()
    weights = csr_array(inverse @ rest)
    weights.sort_indices()
    return weights
