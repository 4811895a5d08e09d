"""Direct solver by a sparse Cholesky factorisation, which is always available."""

from __future__ import annotations

from scipy.sparse import bsr_array

from fastcontact.arrays import Indices
from fastcontact.linear.cholesky.factorisation import SymbolicFactors
from fastcontact.linear.cholesky.symmetric_factors import SymmetricFactors
from fastcontact.linear.factor_solver import FactorSolver


class Direct(FactorSolver):
    """Direct solver with the Cholesky factorisation of `linear.cholesky`; see `FactorSolver`."""

    name = "direct"
    _symbolic: SymbolicFactors | None = None  # shared by the solvers of all tangents

    def __repr__(self) -> str:
        if not self.n:
            return "Direct(not prepared)"
        return f"Direct(Cholesky, {self.n} unknowns, {self._factors.nnz} entries, {self.nbytes / 1e6:.1f} MB)"

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]."""
        return self._factors.nbytes

    def _factorised(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        if self._symbolic is None or not self._symbolic.serves(K, last):
            self._symbolic = SymbolicFactors(K, last)
        return self._symbolic.factors(K)


SOLVER = Direct
