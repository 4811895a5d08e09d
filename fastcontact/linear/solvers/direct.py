"""Direct solver that is always available: one sparse factorisation serves the whole analysis."""

from __future__ import annotations

from scipy.sparse import bsr_array, csc_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact.arrays import Array, Indices
from fastcontact.linear.cholesky.factorisation import SymbolicFactors, singular
from fastcontact.linear.cholesky.symmetric_factors import SymmetricFactors
from fastcontact.linear.factors.factor_solver import FactorSolver


class Direct(FactorSolver):
    """Cholesky factorisation with the contact unknowns last; see `FactorSolver`.

    Without contact unknowns, or with too many, SciPy's SuperLU is used: symmetric mode, minimum degree of A + A.T.
    """

    name = "direct"
    _symbolic: SymbolicFactors | None = None  # shared by the solvers of all tangents

    def __repr__(self) -> str:
        if not self.n:
            return "Direct(not prepared)"
        kind, entries = ("Cholesky", self._factors.nnz) if self._factors is not None else ("SuperLU", self._lu.nnz)
        return f"Direct({kind}, {self.n} unknowns, {entries} entries, {self.nbytes / 1e6:.1f} MB)"

    @property
    def nbytes(self) -> int:
        """Memory of the factors [bytes]; SuperLU's own are estimated."""
        return self._factors.nbytes if self._factors is not None else 12 * int(self._lu.nnz)

    def _factorise(self, K: csc_array) -> None:
        options = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
        try:
            self._lu: SuperLU = splu(K, **options)
        except RuntimeError as error:
            raise singular() from error

    def _solve(self, F: Array) -> Array:
        return self._lu.solve(F)

    def _with_last(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        if self._symbolic is None or not self._symbolic.serves(K, last):
            self._symbolic = SymbolicFactors(K, last)
        return self._symbolic.factors(K)


SOLVER = Direct
