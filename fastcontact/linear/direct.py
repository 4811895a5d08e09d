"""Direct solver: one sparse factorisation of K for the whole analysis, constraints through their compliance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array
from scipy.sparse.linalg import SuperLU, splu

from fastcontact.errors import ModelError
from fastcontact.linear._compliance import ComplianceCache, multipliers
from fastcontact.linear._solver import Counters

Array = NDArray[np.float64]


class Direct:
    """SuperLU in symmetric mode, minimum-degree ordering of A + A.T."""

    name = "direct"

    def __init__(self, tolerance: float = 1e-14) -> None:
        self.tolerance = 1e-14  # round-off, whatever was asked
        self.counters = Counters()

    def __repr__(self) -> str:
        if not hasattr(self, "_lu"):
            return "Direct(SuperLU, not prepared)"
        megabytes = 12e-6 * (self._lu.L.nnz + self._lu.U.nnz)
        return f"Direct(SuperLU, {self._lu.shape[0]} unknowns, factors {megabytes:.1f} MB)"

    def prepare(self, K: bsr_array, rigid_modes: Array) -> None:
        """Factorise K; see `LinearSolver.prepare`.

        Raises
        ------
        ModelError
            If K is singular.
        """
        options = {"SymmetricMode": True}
        try:
            lu = splu(K.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)
        except RuntimeError as error:
            raise ModelError(
                "the stiffness matrix is singular: support the rigid-body motions of every body"
            ) from error
        self._lu: SuperLU = lu
        self.counters.setups += 1
        self.compliance = ComplianceCache(K.shape[0], lu.solve)

    def load(self, f: Array) -> _Loaded:
        """Return the prepared matrix with right-hand side `f`."""
        return _Loaded(self, f)

    def back_substitute(self, f: Array) -> Array:
        """Return ``K^-1 f``."""
        self.counters.iterations += 1
        return self._lu.solve(f)


class _Loaded:
    """See `linear._solver.Loaded`."""

    def __init__(self, solver: Direct, f: Array) -> None:
        self._solver, self._f = solver, f
        self._free = solver.back_substitute(f)

    def solve(self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None) -> tuple[Array, Array]:
        if B.shape[0] == 0:
            return self._free, np.empty(0)
        multiplier = multipliers(self._solver.compliance, B, c - B @ self._free, C)
        return self._solver.back_substitute(self._f + B.T @ multiplier), multiplier


SOLVER = Direct
