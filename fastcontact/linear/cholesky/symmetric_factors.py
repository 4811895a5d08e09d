"""Factors ``P K P.T = L D L.T`` of a symmetric positive definite matrix: solution, and condensation to the last unknowns."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotri

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.linear.cholesky import triangular_kernels


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

    def solve(self, F: Array) -> Array:
        """Return ``K^-1 F`` for right-hand sides (n,) or (n, k) [force]."""
        none_given = np.zeros(self.n, bool)
        X = np.empty((self.n, *F.shape[1:]))
        X[self._place] = F
        columns = np.ascontiguousarray(X.reshape(self.n, -1).T)
        for x in columns:
            triangular_kernels.forward(*self._L, x)
            x /= self._d
            triangular_kernels.backward(*self._L, none_given, x)
        return np.ascontiguousarray(columns.T).reshape(X.shape)[self._place]

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
