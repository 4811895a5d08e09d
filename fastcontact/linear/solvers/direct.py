"""Direct solver that is always there: one sparse factorisation serves the whole analysis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact.linear.cholesky.factorisation import factors
from fastcontact.linear.cholesky.singular import singular
from fastcontact.linear.cholesky.symmetric import SymmetricFactors
from fastcontact.linear.factors.factored import FactorSolver

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Direct(FactorSolver):
    """Cholesky factors with the contact unknowns last; see `FactorSolver`.

    Where so many may be in contact that many right-hand sides have to be solved for, SuperLU in symmetric mode,
    minimum-degree ordering of A + A.T.
    """

    name = "direct"

    def __repr__(self) -> str:
        if not self.n:
            return "Direct(not prepared)"
        kind, entries = ("Cholesky", self._symmetric.nnz) if self._symmetric is not None else ("SuperLU", self._lu.nnz)
        return f"Direct({kind}, {self.n} unknowns, {entries} entries, {self.nbytes / 1e6:.1f} MB)"

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]; SuperLU's own are estimated."""
        return self._symmetric.nbytes if self._symmetric is not None else 12 * int(self._lu.nnz)

    def _factorise(self, K: csc_array) -> None:
        self._lu = _factorised(K)

    def _solve(self, F: Array) -> Array:
        return self._lu.solve(F)

    def _with_last(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        return factors(K, last)


def _factorised(matrix: csc_array) -> SuperLU:
    try:
        return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise singular() from error


SOLVER = Direct
