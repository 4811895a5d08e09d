"""Factors ``P K P.T = L D L.T`` of a symmetric positive definite matrix: substitution, and static condensation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotri

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.arrays import Array, Indices, Numbers, mask_at, numbers_at, scattered
from fastcontact.linear.cholesky import triangular_kernels

# Largest number of right-hand sides for which systems are solved simultaneously. With 48, columns of K^-1 take 1.35 times as
# long (12 288 unknowns in 3D), and with more no less.
BATCH = 128


class LowerTriangle(NamedTuple):
    """Matrix L (n, n), stored by columns, with common row indices in each supernode; see `triangular_kernels`."""

    start: NDArray[np.int64]
    values: Array
    first: NDArray[np.int64]
    row_start: NDArray[np.int64]
    rows: Numbers


class SymmetricFactors:
    """Factors L and D of a permuted symmetric positive definite matrix, ``P K P.T = L D L.T``.

    Parameters
    ----------
    L : LowerTriangle
        Lower triangular (n, n) with a unit diagonal.
    d : ndarray (n,)
        Diagonal of D.
    position : ndarray of int (n,)
        Position of each unknown in the factors.
    last : ndarray of int (m,)
        Unknowns that are eliminated after all others.
    """

    def __init__(self, L: LowerTriangle, d: Array, position: Indices, last: Indices) -> None:
        self.n = len(d)
        self.nnz = len(L.values)
        self._L, self._d, self._position, self._last = L, d, position, last
        self._is_last = mask_at(position[last], self.n)  # positions of the unknowns `last`

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]."""
        return sum(array.nbytes for array in (*self._L, self._d, self._position, self._is_last))

    def solve(self, f: Array) -> Array:
        """Return ``K^-1 f`` (n,) for a right-hand side (n,) [force]."""
        x = np.empty(self.n)
        x[self._position] = f
        triangular_kernels.forward(*self._L, x)
        x /= self._d
        triangular_kernels.backward(*self._L, np.zeros(self.n, bool), x)
        return x[self._position]

    @on_one_blas_thread
    def inverse_entries(self, rows: Indices, columns: Indices) -> Array:
        """Return the entries (m, k) of ``K^-1`` in `rows` (m,) and `columns` (k,) [length / force]."""
        row_positions, column_positions = self._position[rows], self._position[columns]
        # In this order, the columns of a batch share most ancestors in the elimination tree, so that few supernodes are
        # affected.
        entries, order = np.empty((len(rows), len(columns))), np.argsort(column_positions)
        size = min(BATCH, max(1, self.nnz // self.n))  # the right-hand sides take no more memory than the factors
        for batch in (order[begin : begin + size] for begin in range(0, len(order), size)):
            X, loaded, required = np.zeros((self.n, len(batch))), np.zeros(self.n, bool), np.zeros(self.n, bool)
            X[column_positions[batch], np.arange(len(batch))] = 1.0
            loaded[column_positions[batch]], required[row_positions] = True, True
            triangular_kernels.solve_together(*self._L, self._d, loaded, required, X)
            entries[:, batch] = X[row_positions]
        return entries

    @on_one_blas_thread
    def last_inverse(self) -> Array:
        """Return the block (m, m) of ``K^-1`` for the unknowns `last` (m,), in this order [length / force]."""
        positions = np.sort(self._position[self._last])
        trailing = np.zeros((len(positions), len(positions)))
        triangular_kernels.copy_block(*self._L, numbers_at(positions, self.n), trailing)
        # The last block of L D^1/2 is the Cholesky factor of the Schur complement, whose inverse is the block of K^-1.
        inverse, _ = dpotri(trailing * np.sqrt(self._d[positions]), lower=True)
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        order = np.searchsorted(positions, self._position[self._last])
        return np.ascontiguousarray(inverse[np.ix_(order, order)])

    def harmonic_extension(self, u: Array) -> Array:
        """Return displacements (n,) equal to u (m,) at the unknowns `last`, without forces on the other unknowns [length]."""
        x = scattered(u, self._position[self._last], self.n)
        triangular_kernels.backward(*self._L, self._is_last, x)
        return x[self._position]
