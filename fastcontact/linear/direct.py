"""Direct solver: one sparse factorisation of K serves the whole analysis, constraints through their compliance.

The unknowns that constraints may involve are eliminated last. Their compliance then is the inverse of the trailing
block of the factors, ``(K^-1)_cc = (L_cc D_c L_cc.T)^-1``, and costs no solution with K at all; what the other unknowns
do under contact forces follows from theirs by half a solution.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact.errors import ModelError
from fastcontact.linear._factor import FactorSolver, singular
from fastcontact.linear._order import fill_reducing
from fastcontact.linear._symmetric import SymmetricFactors

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# Beyond this many unknowns last, their dense block costs more than the solutions it saves.
LAST_UP_TO = 4000


class Direct(FactorSolver):
    """SuperLU in symmetric mode, minimum-degree ordering of A + A.T."""

    name = "direct"

    def __repr__(self) -> str:
        if not hasattr(self, "_factors"):
            return "Direct(SuperLU, not prepared)"
        return f"Direct(SuperLU, {self.n} unknowns, {self._factors.nnz} entries, {self.nbytes / 1e6:.1f} MB)"

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]; SuperLU's own are estimated."""
        return self._factors.nbytes if isinstance(self._factors, SymmetricFactors) else 12 * self._factors.nnz

    def prepare(self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None) -> None:
        """Factorise K; see `LinearSolver.prepare`.

        Raises
        ------
        ModelError
            If K is singular.
        """
        self.n = K.shape[0]
        self._factors: SymmetricFactors | SuperLU
        if involved is not None and 0 < len(involved) <= LAST_UP_TO:
            self._factors = self._with_last(K, involved)
            self._begin(involved, self._factors.last_inverse())
        else:
            self._factors = self._factorised(K.tocsc(), "MMD_AT_PLUS_A")
            self._begin()

    def _with_last(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        order = fill_reducing(K, last)
        lu = self._factorised(csc_array(K.tocsc()[order][:, order]), "NATURAL")
        if not np.array_equal(lu.perm_r, lu.perm_c):
            raise ModelError("the stiffness matrix needed pivoting: it is not positive definite")
        # SuperLU may reorder independent branches of the elimination, which leaves what depends on what as it is.
        place = np.empty(self.n, np.intp)
        place[order] = lu.perm_c
        return SymmetricFactors(lu.L, lu.U.diagonal(), place, last)

    def _factorised(self, matrix: csc_array, order: str) -> SuperLU:
        try:
            lu = splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise singular() from error
        self.counters.setups += 1
        return lu

    def _solve(self, F: Array) -> Array:
        return self._factors.solve(F)

    def _extended(self, u: Array) -> Array:
        assert isinstance(self._factors, SymmetricFactors)
        return self._factors.extended(u)


SOLVER = Direct
