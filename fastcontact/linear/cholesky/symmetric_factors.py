"""Factors ``P K P.T = L D L.T`` of a symmetric positive definite matrix: solution, and condensation to the last unknowns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotri

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.linear.cholesky import triangular_kernels

# Largest number of right-hand sides that are solved for together.
TOGETHER = 128


class LowerTriangle(NamedTuple):
    """L (n, n), stored by columns, with common row indices for the columns of a supernode; see `triangular_kernels`."""

    start: NDArray[np.int64]
    values: Array
    first: NDArray[np.int64]
    begin: NDArray[np.int64]
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
        Unknowns that are eliminated after all others; their columns of L have entries only in rows of these unknowns.
    """

    def __init__(self, L: LowerTriangle, d: Array, position: Indices, last: Indices) -> None:
        self.n = len(d)
        self.nnz = len(L.values)
        self._L, self._d, self._place, self._last = L, d, position, last
        self._given = np.zeros(self.n, bool)
        self._given[position[last]] = True

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]."""
        return sum(array.nbytes for array in (*self._L, self._d, self._place, self._given))

    def solve(self, f: Array) -> Array:
        """Return ``K^-1 f`` (n,) for a right-hand side (n,) [force]."""
        x = np.empty(self.n)
        x[self._place] = f
        triangular_kernels.forward(*self._L, x)
        x /= self._d
        triangular_kernels.backward(*self._L, np.zeros(self.n, bool), x)
        return x[self._place]

    @on_one_blas_thread
    def inverse_entries(self, rows: Indices, columns: Indices) -> Array:
        """Return the entries of ``K^-1`` in some `rows` (m,) and `columns` (k,), shape (m, k) [length / force]."""
        at, place = self._place[rows], self._place[columns]
        entries, order = np.empty((len(rows), len(columns))), np.argsort(place)  # neighbours have common ancestors
        size = min(TOGETHER, max(1, self.nnz // self.n))  # for no more memory than that of the factors
        for part in (order[begin : begin + size] for begin in range(0, len(order), size)):
            X, loaded, wanted = np.zeros((self.n, len(part))), np.zeros(self.n, bool), np.zeros(self.n, bool)
            X[place[part], np.arange(len(part))] = 1.0
            loaded[place[part]], wanted[at] = True, True
            triangular_kernels.solve_together(*self._L, self._d, loaded, wanted, X)
            entries[:, part] = X[at]
        return entries

    @on_one_blas_thread
    def last_inverse(self) -> Array:
        """Return the rows and columns `last` of ``K^-1``, shape (m, m) [length / force], in the order of `last`."""
        at = np.sort(self._place[self._last])
        wanted, trailing = np.full(self.n, -1), np.zeros((len(at), len(at)))
        wanted[at] = np.arange(len(at))
        triangular_kernels.block(*self._L, wanted, trailing)
        # The last block of L D^1/2 is the Cholesky factor of the Schur complement, whose inverse is that block of K^-1.
        inverse, _ = dpotri(trailing * np.sqrt(self._d[at]), lower=True)
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        order = np.searchsorted(at, self._place[self._last])
        return np.ascontiguousarray(inverse[np.ix_(order, order)])

    def extended(self, u: Array) -> Array:
        """Return the displacement (n,) [length] under forces on the unknowns `last` alone, whose displacement is u (m,)."""
        x = np.zeros(self.n)
        x[self._place[self._last]] = u
        triangular_kernels.backward(*self._L, self._given, x)
        return x[self._place]
