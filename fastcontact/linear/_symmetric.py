"""Factors ``P K P.T = L D L.T`` of a symmetric positive definite matrix, and what contact takes from them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotri
from scipy.sparse import csc_array

from fastcontact.kernels import triangular

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class SymmetricFactors:
    """L and D, row numbers kept once for all columns of a supernode.

    Parameters
    ----------
    L : csc_array (n, n)
        Lower triangular with a unit diagonal, row numbers sorted; they are overwritten.
    d : ndarray (n,)
        Diagonal of D.
    place : ndarray of int (n,)
        Where each unknown stands in the factors.
    last : ndarray of int (m,)
        Unknowns that are eliminated after all others: no column of theirs in L has a row of another one.
    """

    def __init__(self, L: csc_array, d: Array, place: Indices, last: Indices) -> None:
        self.n = len(d)
        self.nnz = L.nnz
        self._d, self._place, self._last = d, place, last
        self._given = np.zeros(self.n, bool)
        self._given[place[last]] = True
        at = np.sort(place[last])
        self._trailing = L[:, at][at].toarray()
        self._start, self._values = L.indptr, L.data
        first, begin = np.empty(self.n + 1, np.int64), np.empty(self.n + 1, np.int64)
        count = triangular.supernodes(L.indptr, L.indices, first, begin)
        self._first, self._begin = first[: count + 1].copy(), begin[: count + 1].copy()
        self._rows = L.indices[: begin[count]].copy()

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]."""
        return sum(array.nbytes for array in (*self._shape(), self._d, self._place, self._trailing, self._given))

    def _shape(self) -> tuple[NDArray[np.int32], Array, NDArray[np.int64], NDArray[np.int64], NDArray[np.int32]]:
        return self._start, self._values, self._first, self._begin, self._rows

    def solve(self, F: Array) -> Array:
        """Return ``K^-1 F`` for right-hand sides (n,) or (n, k)."""
        nothing = np.zeros(self.n, bool)
        X = np.empty((self.n, *F.shape[1:]))
        X[self._place] = F
        columns = np.ascontiguousarray(X.reshape(self.n, -1).T)
        for x in columns:
            triangular.forward(*self._shape(), x)
            x /= self._d
            triangular.backward(*self._shape(), nothing, x)
        return np.ascontiguousarray(columns.T).reshape(X.shape)[self._place]

    def last_inverse(self) -> Array:
        """Return the rows and columns `last` of ``K^-1``, in the order of `last`."""
        at = np.sort(self._place[self._last])
        cholesky = self._trailing * np.sqrt(self._d[at])
        inverse, _ = dpotri(cholesky, lower=True)
        inverse = np.tril(inverse) + np.tril(inverse, -1).T
        order = np.searchsorted(at, self._place[self._last])
        return np.ascontiguousarray(inverse[np.ix_(order, order)])

    def extended(self, u: Array) -> Array:
        """Return the displacement (n,) under forces on the unknowns `last` alone, which move by u (m,)."""
        x = np.zeros(self.n)
        x[self._place[self._last]] = u
        triangular.backward(*self._shape(), self._given, x)
        return x[self._place]
