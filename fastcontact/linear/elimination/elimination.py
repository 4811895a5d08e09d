"""Elimination of linear equations ``B u = c``.

One unknown per equation, its pivot, is expressed as a weighted sum of the other unknowns plus an offset. With the columns P
of B that belong to the pivots, and the remaining columns R, this is ``u[pivots] = P^-1 (c - R u[others])``.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, mask_at
from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledPivots, Inverse, SparseInverse
from fastcontact.linear.sparse_rows import entry_rows, without_zeros

NO_INVERSE = SparseInverse(csr_array((0, 0)))


@record
class Elimination:
    """Elimination of m unknowns by m equations among n unknowns.

    The eliminated unknowns are ``u[pivots] = weights @ u + offset``. If the pivots are coupled, so that P^-1 is a full
    matrix, they are ``u[pivots] = P^-1 (weights @ u) + offset`` instead. The multipliers of the equations exert the forces
    ``F.T @ multiplier`` on the unknowns. F equals B unless `eliminate` is called with `force_rows`.

    Attributes
    ----------
    pivots : ndarray of int (m,)
        The eliminated unknown of each equation.
    weights : csr_array (m, n)
        Weights of the other unknowns, without entries in the columns of the pivots [-].
    offset : ndarray (m,)
        Values of the pivots if all other unknowns are zero [length].
    force_weights : csr_array (m, n)
        Fractions of the force at each pivot that act on the other unknowns after the elimination; equal to `weights` if F
        equals B [-].
    inverse : SparseInverse or CoupledPivots
        Inverse of the columns of F that belong to the pivots.
    pivot_inverse : SparseInverse or CoupledPivots
        P^-1, the inverse of the columns of B that belong to the pivots; equal to `inverse` if F equals B.
    compliance : ndarray (m,), optional
        Compliance of the equations, ``B u + compliance * multiplier = c`` [length / force].
    """

    pivots: Indices
    weights: csr_array
    offset: Array
    force_weights: csr_array
    inverse: Inverse = NO_INVERSE
    pivot_inverse: Inverse = NO_INVERSE
    compliance: Array | None = None

    @property
    def coupled(self) -> bool:
        """Whether the pivots are coupled, that is, whether the equations of many nodes involve each other's pivots."""
        return isinstance(self.pivot_inverse, CoupledPivots)

    @cached_property
    def _entry_equations(self) -> tuple[Indices, Indices]:
        """Equations of the entries of `weights` (k,) and of `force_weights` (l,)."""
        rows = entry_rows(self.weights)
        return rows, rows if self.force_weights is self.weights else entry_rows(self.force_weights)

    def multiplier(self, forces: Array) -> Array:
        """Return the multipliers (m,) [force], given the `forces` (m,) ``(K u - f)[pivots]`` that they exert [force]."""
        return self.inverse.solve_transposed(forces)

    def complete(self, x: Array, offset: Array | None = None) -> None:
        """Set the pivots of `x` (n,), in place, to the weighted sums of the other unknowns, plus `offset` (m,)."""
        W, m = self.weights, len(self.pivots)
        x[self.pivots] = np.bincount(self._entry_equations[0], W.data * x[W.indices], m)  # sums in double precision
        if self.coupled:
            x[self.pivots] = self.pivot_inverse.solve(x[self.pivots])
        if offset is not None:
            x[self.pivots] += offset

    def move_forces(self, r: Array) -> None:
        """Move the forces `r` (n,) from the pivots, where they become zero, to the other unknowns, in place."""
        W = self.force_weights
        if isinstance(self.inverse, CoupledPivots):
            r[self.pivots] = self.inverse.solve_transposed(r[self.pivots])
        forces, r[self.pivots] = r[self.pivots], 0.0
        np.add.at(r, W.indices, W.data * forces[self._entry_equations[1]])

    def full_weights(self) -> csr_array:
        """Return the matrix W (m, n) with ``u[pivots] = W @ u + offset``, which has many entries if pivots are coupled."""
        if not self.coupled:
            return self.weights
        columns = np.unique(self.weights.indices)
        full = csr_array(self.pivot_inverse.solve(self.weights[:, columns].toarray()))
        return csr_array((full.data, columns[full.indices], full.indptr), shape=self.weights.shape)

    def with_sparse_weights(self) -> Elimination:
        """Return an elimination with sparse weights for a preconditioner, which are approximate if pivots are coupled."""
        if not self.coupled:
            return self
        weights = _sparse_weights(self.pivot_inverse.sparse, self.weights)
        return Elimination(self.pivots, weights, np.zeros(len(self.pivots)), weights, self.pivot_inverse.sparse)


def eliminate(
    B: csr_array, c: Array, force_rows: csr_array | None = None, nodes: Indices | None = None, size: int = 1
) -> Elimination:
    """Choose the pivots of the equations ``B u = c``, see `pivot_order`, and express them in terms of the other unknowns.

    Parameters
    ----------
    B : csr_array (m, n)
        Matrix of the equations [-].
    c : ndarray (m,)
        Right-hand sides [length].
    force_rows : csr_array (m, n), optional
        Matrix F in the equations of equilibrium, ``K u = f + F.T multiplier``; B by default [-].
    nodes : ndarray of int (m,), optional
        Node of each equation. Equations of the same node may involve the same unknowns.
    size : int
        Number of unknowns of a node.

    Raises
    ------
    DependenceError
        If the equations are linearly dependent.
    """
    B = csr_array(B, copy=True)
    if not B.has_canonical_format:
        B.sum_duplicates()
    B.eliminate_zeros()
    pivots, inverse = pivot_order.choose_pivots(B, nodes, size)
    weights, offset = _weights(B, pivots, inverse), inverse.solve(c)
    if force_rows is None:
        return Elimination(pivots, weights, offset, weights, inverse, inverse)
    force_inverse = pivot_order.column_inverse(force_rows, pivots, size)
    return Elimination(pivots, weights, offset, _weights(force_rows, pivots, force_inverse), force_inverse, inverse)


def _weights(B: csr_array, pivots: Indices, inverse: Inverse) -> csr_array:
    """Return `Elimination.weights` (m, n), given the inverse of the columns of B that belong to the pivots."""
    values = np.where(mask_at(pivots, B.shape[1])[B.indices], 0.0, -B.data)
    remainder = without_zeros(csr_array((values, B.indices, B.indptr), shape=B.shape, copy=True))
    return remainder if isinstance(inverse, CoupledPivots) else _sparse_weights(inverse, remainder)


def _sparse_weights(inverse: SparseInverse, remainder: csr_array) -> csr_array:
    """Return the product (m, n) of the inverse of the pivot columns and the negative remaining columns `remainder` (m, n)."""
    return csr_array(inverse.matrix @ remainder).sorted_indices()
