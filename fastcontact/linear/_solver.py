"""What a linear solver is, and the counters it keeps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

Array = NDArray[np.float64]


@dataclass
class Counters:
    """Work done since `prepare`: factorisations or hierarchies built, and solutions or iterations."""

    setups: int = 0
    iterations: int = 0


class Loaded(Protocol):
    """A prepared matrix with a right-hand side."""

    def solve(self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None) -> tuple[Array, Array]:
        """Return (u, multiplier) with ``K u = f + B.T multiplier`` and ``B u + C multiplier = c``.

        B (m, n) has full row rank where C (m, m), symmetric and positive semidefinite, is None or singular.
        """
        ...

    def reduce(self, R: csr_array) -> tuple[Array, Array]:
        """Return ``R K^-1 f`` (m,) and the compliance ``R K^-1 R.T`` (m, m) of rows R (m, n)."""
        ...

    def displacement(self, force: Array) -> Array:
        """Return ``K^-1 (f + force)`` (n,)."""
        ...


class LinearSolver(Protocol):
    """Solves ``K u = f`` under linear equations, for one K and many right-hand sides and sets of equations.

    Attributes
    ----------
    tolerance : float
        Relative accuracy of the solutions.
    counters : Counters
    """

    tolerance: float
    counters: Counters

    def prepare(self, K: bsr_array, rigid_modes: Array, involved: NDArray[np.intp] | None = None) -> None:
        """Take the symmetric positive definite matrix K (n, n) and displacements (n, n_modes) that cost it little.

        `involved` are the unknowns that equations may involve, a hint.
        """
        ...

    def load(self, f: Array) -> Loaded:
        """Take the right-hand side f (n,)."""
        ...
