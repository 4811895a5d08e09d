"""Direct solver by Intel's Pardiso, from the optional package pypardiso."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_matrix, triu

from fastcontact.linear.cholesky.singular import singular
from fastcontact.linear.factors.factored import FactorSolver

Array = NDArray[np.float64]
# Pardiso's name of symmetric positive definite matrices, of which it takes the upper triangle.
POSITIVE_DEFINITE = 2


class Pardiso(FactorSolver):
    """Pardiso for symmetric positive definite matrices; see `FactorSolver`."""

    name = "pardiso"

    def _factorise(self, K: csc_array) -> None:
        from pypardiso import PyPardisoSolver
        from pypardiso.pardiso_wrapper import PyPardisoError

        self._matrix = csr_matrix(triu(K, format="csr"))
        self._matrix.sort_indices()
        self._pardiso = PyPardisoSolver(mtype=POSITIVE_DEFINITE)
        try:
            self._pardiso.factorize(self._matrix)
        except (PyPardisoError, ValueError) as error:  # ValueError: empty rows
            raise singular() from error

    def _solve(self, F: Array) -> Array:
        return np.ascontiguousarray(self._pardiso.solve(self._matrix, np.asfortranarray(F))).reshape(F.shape)


SOLVER = Pardiso
