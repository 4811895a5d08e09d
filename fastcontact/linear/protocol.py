"""What a linear solver is, and the counters it keeps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

Array = NDArray[np.float64]
# Looks at an unfinished solution (u, multiplier, relative residual); True ends it there.
Monitor = Callable[[Array, Array, float], bool]


class Product(Protocol):
    """What a solver that owns a matrix K (n, n) returns in its place."""

    def __matmul__(self, u: Array) -> Array:
        """Return ``K u`` (n,)."""
        ...

    def largest_row_sum(self, u: Array) -> float:
        """Return the largest entry of ``|K| |u|``."""
        ...


@dataclass
class Counters:
    """Work done since `prepare`: factorisations or hierarchies built, and solutions or iterations."""

    setups: int = 0
    iterations: int = 0


class Loaded(Protocol):
    """A prepared matrix with a right-hand side."""

    def solve(
        self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``K u = f + B.T multiplier`` and ``B u + C multiplier = c``.

        B (m, n) has full row rank where C (m, m), symmetric and positive semidefinite, is None or singular. Solvers that
        iterate show the state to `monitor` from time to time and return it, unfinished, where that says True; they stop
        at a relative residual of `tolerance` where that is given and above their own.
        """
        ...

    def flexibility(self, R: csr_array) -> tuple[Array, Array]:
        """Return ``R K^-1 f`` (m,) and the compliance ``R K^-1 R.T`` (m, m) of rows R (m, n)."""
        ...

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        """Return ``K^-1 (f + force)`` (n,) at all unknowns that equations may involve.

        Solvers for which other unknowns cost extra leave those as they are in `elsewhere` (n,), where that is given.
        `solve` does the same with its `guess`.
        """
        ...

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """Return ``K^-1 (f + force)`` (n,); `u` is what `involved_solution` or `solve` found for it."""
        ...

    def condensed(self) -> Loaded | None:
        """Return the same problem for the unknowns that equations may involve alone, where the solver condenses to those.

        They are the unknowns `involved` of `LinearSolver.prepare`, in their order, in all vectors and columns.
        """
        ...


@dataclass(frozen=True, eq=False)
class FrictionTerms:
    """Forces that friction adds to those of equations.

    Attributes
    ----------
    through : csr_array (m, n)
        Rows that multipliers act through in place of those of the equations.
    springs : csr_array (n, n), optional
        S, symmetric and positive semidefinite.
    push : ndarray (n,), optional
        Further forces.
    """

    through: csr_array
    springs: csr_array | None = None
    push: Array | None = None


@runtime_checkable
class LoadedNonsymmetric(Loaded, Protocol):
    """Also solves where multipliers act through other rows than those of the equations."""

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of the matrix."""
        ...

    def solve_nonsymmetric(        self, B: csr_array, c: Array, groups: NDArray[np.intp], guess: Array, tolerance: float,
        drag: FrictionTerms | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``B u = c`` and ``K u + S u = f + push + through.T multiplier``, see `FrictionTerms`.

        Equations of one of the `groups` (m,) may share unknowns. The iteration starts from `guess` (n,) and ends at a
        relative residual of `tolerance`, or of the solver's own where that is larger.

        Raises
        ------
        ConvergenceError
            If equations repeat each other, seen through either rows, or the iteration does not end.
        """
        ...


class LinearSolver(Protocol):
    """Solves ``K u = f`` under linear equations, for one K and many right-hand sides and sets of equations.

    Attributes
    ----------
    tolerance : float
        Relative accuracy of the solutions.
    condenses : bool
        Whether, as prepared, the solver knows the compliance of the unknowns that equations may involve.
    counters : Counters
    error : float
        By how much solutions for nearly the same right-hand side may differ, in units of their largest component, however
        small `tolerance` is.
    gave_up : str
        Why another way of solving took over; empty where none did.
    """

    tolerance: float
    condenses: bool
    counters: Counters
    error: float
    gave_up: str

    @property
    def iterative(self) -> bool:
        """Whether less accurate solutions cost less."""
        ...

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: NDArray[np.intp] | None = None, release: bool = False
    ) -> bsr_array | Product:
        """Take the symmetric positive definite matrix K (n, n) and displacements (n, n_modes) that cost it little.

        `involved` are the unknowns that equations may involve, a hint. A solver that may `release` K may take the room of its
        numbers; K is then no matrix any more, and what is returned takes its place. Otherwise that is K.
        """
        ...

    def load(self, f: Array) -> Loaded:
        """Take the right-hand side f (n,)."""
        ...

    def memory(self) -> dict[str, Any]:
        """Return what the last digits of later solutions owe to earlier ones: plain numbers, strings and arrays."""
        ...

    def remember(self, memory: dict[str, Any]) -> None:
        """Take the `memory` of a solver of the same kind that was prepared for the same matrix."""
        ...
