"""Direct solver by a sparse Cholesky factorisation, which is always available."""

from __future__ import annotations

from typing import Self

from scipy.sparse import bsr_array

from fastcontact.arrays import Indices
from fastcontact.linear.cholesky.factorisation import SymbolicFactors
from fastcontact.linear.cholesky.symmetric_factors import SymmetricFactors
from fastcontact.linear.factor_solver import ATTAINABLE_RESIDUAL, FactorSolver


class Direct(FactorSolver):
    """Direct solver with the Cholesky factorisation of `linear.cholesky`; see `FactorSolver`."""

    name = "direct"
    _of_tangents = False

    def __init__(self, tolerance: float = ATTAINABLE_RESIDUAL) -> None:
        super().__init__(tolerance)
        # Symbolic factorisation of tangents (True), which is shared by the solvers of all tangents, and that of other
        # matrices (False).
        self._symbolic: dict[bool, SymbolicFactors] = {}

    def __repr__(self) -> str:
        if not self.n:
            return "Direct(not prepared)"
        return f"Direct(Cholesky, {self.n} unknowns, {self.factors.nnz} entries, {self.factors.nbytes / 1e6:.1f} MB)"

    def _factorise(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        symbolic = self._symbolic.get(self._of_tangents)
        if symbolic is None or not symbolic.matches(K, last):
            symbolic = self._symbolic[self._of_tangents] = SymbolicFactors(K, last, self._of_tangents)
        return symbolic.factors(K)

    def copy_for_similar_matrix(self) -> Self:
        """See `LinearSolver.copy_for_similar_matrix`."""
        copied = super().copy_for_similar_matrix()
        copied._of_tangents = True
        return copied


SOLVER = Direct
