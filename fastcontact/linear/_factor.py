"""What direct solvers share: constraints through their compliance, from solutions with the factors of K."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array

from fastcontact.errors import ModelError
from fastcontact.linear._compliance import ComplianceCache, multipliers, reduced
from fastcontact.linear._solver import Counters, Monitor

Array = NDArray[np.float64]
SINGULAR = "the stiffness matrix is singular: support the rigid-body motions of every body"


class FactorSolver:
    """A direct solver; sub-classes factorise and solve.

    Parameters
    ----------
    tolerance : float
        Not needed: direct solutions are exact but for round-off.
    """

    name: str
    iterative = False

    def __init__(self, tolerance: float = 1e-14) -> None:
        self.tolerance = 1e-14  # round-off, whatever was asked
        self.counters = Counters()
        self.n = 0

    def __repr__(self) -> str:
        return f"{type(self).__name__}({f'{self.n} unknowns' if self.n else 'not prepared'})"

    def _factorise(self, K: csc_array) -> None:
        """Factorise K (n, n).

        Raises
        ------
        ModelError
            If K is singular.
        """
        raise NotImplementedError

    def _solve(self, F: Array) -> Array:
        """Return ``K^-1 F`` for right-hand sides (n,) or (n, k)."""
        raise NotImplementedError

    def prepare(self, K: bsr_array, rigid_modes: Array, involved: NDArray[np.intp] | None = None) -> None:
        """Factorise K; see `LinearSolver.prepare`.

        Raises
        ------
        ModelError
            If K is singular.
        """
        self.n = K.shape[0]
        self._factorise(K.tocsc())
        self.counters.setups += 1
        self.compliance = ComplianceCache(self.n, self._solve)

    def load(self, f: Array) -> Any:
        """Return the prepared matrix with right-hand side `f`."""
        return LoadedFactor(self, f)

    def back_substitute(self, f: Array) -> Array:
        """Return ``K^-1 f``."""
        self.counters.iterations += 1
        return self._solve(f)


class LoadedFactor:
    """See `linear._solver.Loaded`."""

    def __init__(self, solver: FactorSolver, f: Array) -> None:
        self._solver, self._f = solver, f
        self._free = solver.back_substitute(f)

    def solve(
        self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        if B.shape[0] == 0:
            return self._free, np.empty(0)
        multiplier = multipliers(self._solver.compliance, B, c - B @ self._free, C)
        return self._solver.back_substitute(self._f + B.T @ multiplier), multiplier

    def reduce(self, R: csr_array) -> tuple[Array, Array]:
        return R @ self._free, reduced(self._solver.compliance, R)

    def displacement(self, force: Array) -> Array:
        return self._solver.back_substitute(self._f + force)


def singular() -> ModelError:
    """Return the error for a matrix that cannot be factorised."""
    return ModelError(SINGULAR)
