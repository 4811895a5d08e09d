"""Direct solver by CHOLMOD's supernodal Cholesky factorisation, from the optional package kvxopt."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, tril

from fastcontact.linear._factor import FactorSolver, singular

Array = NDArray[np.float64]


class Cholmod(FactorSolver):
    """CHOLMOD with its own fill-reducing order; see `FactorSolver`."""

    name = "cholmod"

    def _factorise(self, K: csc_array) -> None:
        from kvxopt import cholmod, matrix, spmatrix

        lower = tril(K, format="coo")
        rows, columns = (matrix(index.astype(np.int64)) for index in (lower.row, lower.col))
        A = spmatrix(matrix(lower.data), rows, columns, K.shape)
        self._factor = cholmod.symbolic(A)
        try:
            cholmod.numeric(A, self._factor)
            self._solve(np.ones(self.n))  # small matrices are factorised past a zero pivot
        except ArithmeticError as error:
            raise singular() from error

    def _solve(self, F: Array) -> Array:
        from kvxopt import cholmod, matrix

        X = matrix(np.asfortranarray(F.reshape(self.n, -1)))
        cholmod.solve(self._factor, X)
        return np.array(X, order="C").reshape(F.shape)


SOLVER = Cholmod
