"""Direct solver by SuperLU, always there: one sparse factorisation serves the whole analysis."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact.errors import ModelError
from fastcontact.linear._factor import FactorSolver, singular
from fastcontact.linear._order import fill_reducing, reordered
from fastcontact.linear._symmetric import SymmetricFactors

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Direct(FactorSolver):
    """SuperLU in symmetric mode, minimum-degree ordering of A + A.T; see `FactorSolver`."""

    name = "direct"

    def __repr__(self) -> str:
        if not self.n:
            return "Direct(SuperLU, not prepared)"
        entries = self._symmetric.nnz if self._symmetric is not None else self._lu.nnz
        return f"Direct(SuperLU, {self.n} unknowns, {entries} entries, {self.nbytes / 1e6:.1f} MB)"

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]; SuperLU's own are estimated."""
        return self._symmetric.nbytes if self._symmetric is not None else 12 * int(self._lu.nnz)

    def _factorise(self, K: csc_array) -> None:
        self._lu = _factorised(K, "MMD_AT_PLUS_A")

    def _solve(self, F: Array) -> Array:
        return self._lu.solve(F)

    def _with_last(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        order = fill_reducing(K, last)
        lu = _factorised(reordered(K, order), "NATURAL")
        if not np.array_equal(lu.perm_r, lu.perm_c):
            raise ModelError("the stiffness matrix needed pivoting: it is not positive definite")
        # SuperLU may reorder independent branches of the elimination, which leaves what depends on what as it is.
        place = np.empty(len(order), np.intp)
        place[order] = lu.perm_c
        return SymmetricFactors(lu.L, _diagonal(lu.U), place, last)


def _diagonal(U: csc_array) -> Array:
    """Return the diagonal (n,) of SuperLU's upper factor, whose columns end with it."""
    assert np.array_equal(U.indices[U.indptr[1:] - 1], np.arange(U.shape[0]))
    return U.data[U.indptr[1:] - 1]


def _factorised(matrix: csc_array, order: str) -> SuperLU:
    try:
        return splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    except RuntimeError as error:
        raise singular() from error


SOLVER = Direct
