"""Direct solver: one sparse factorisation of K serves the whole analysis, constraints through their compliance.

The unknowns that constraints may involve are eliminated last. Their compliance then is the inverse of the trailing
block of the factors, ``(K^-1)_cc = (L_cc U_cc)^-1``, and costs no solution with K at all. SuperLU orders by itself only,
so K is factorised twice: once for a fill-reducing order, once in that order with those unknowns moved to the end.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact.errors import ModelError
from fastcontact.linear._compliance import ComplianceCache
from fastcontact.linear._factor import FactorSolver, singular

Array = NDArray[np.float64]
# Beyond this many unknowns last, their dense block costs more than the solutions it saves.
LAST_UP_TO = 4000


class Direct(FactorSolver):
    """SuperLU in symmetric mode, minimum-degree ordering of A + A.T."""

    name = "direct"

    def __repr__(self) -> str:
        if not hasattr(self, "_lu"):
            return "Direct(SuperLU, not prepared)"
        return f"Direct(SuperLU, {self._lu.shape[0]} unknowns, {self._lu.nnz} entries, {12e-6 * self._lu.nnz:.1f} MB)"

    def prepare(self, K: bsr_array, rigid_modes: Array, involved: NDArray[np.intp] | None = None) -> None:
        """Factorise K; see `LinearSolver.prepare`.

        Raises
        ------
        ModelError
            If K is singular.
        """
        matrix = K.tocsc()
        self.n = K.shape[0]
        self._lu = self._factorised(matrix, "MMD_AT_PLUS_A")
        self._order: NDArray[np.intp] | None = None
        self.compliance = ComplianceCache(K.shape[0], self._solve)
        if involved is not None and 0 < len(involved) <= LAST_UP_TO:
            last = np.zeros(K.shape[0], bool)
            last[involved] = True
            order = np.argsort(self._lu.perm_c)
            self._order = np.concatenate([order[~last[order]], order[last[order]]])
            self._lu = self._factorised(csc_array(matrix[self._order][:, self._order]), "NATURAL")
            self.compliance.give(self._order[-len(involved) :], self._trailing_inverse(len(involved)))

    def _factorised(self, matrix: csc_array, order: str) -> SuperLU:
        try:
            lu = splu(matrix, permc_spec=order, diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        except RuntimeError as error:
            raise singular() from error
        self.counters.setups += 1
        return lu

    def _trailing_inverse(self, count: int) -> Array:
        """Return the inverse of the trailing block: the rows and columns of ``K^-1`` for the last unknowns.

        SuperLU may still reorder independent branches of the elimination, which leaves the block what it is.
        """
        lu = self._lu
        row, column = np.argsort(lu.perm_r), np.argsort(lu.perm_c)
        n = lu.shape[0]
        at = np.flatnonzero(column >= n - count)
        if not np.array_equal(row, column):
            raise ModelError("the stiffness matrix needed pivoting: it is not positive definite")
        L, U = lu.L.tocsr()[at][:, at].toarray(), lu.U.tocsr()[at][:, at].toarray()
        lower = solve_triangular(L, np.eye(count), lower=True, unit_diagonal=True)
        inverse = solve_triangular(U, lower)
        back = np.empty(count, np.intp)
        back[column[at] - (n - count)] = np.arange(count)
        inverse = inverse[np.ix_(back, back)]
        return 0.5 * (inverse + inverse.T)

    def _solve(self, F: Array) -> Array:
        if self._order is None:
            return self._lu.solve(F)
        U = np.empty_like(F)
        U[self._order] = self._lu.solve(np.ascontiguousarray(F[self._order]))
        return U


SOLVER = Direct
