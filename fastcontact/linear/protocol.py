"""Protocols of linear solvers.

Shapes: n unknowns, m equations among them. ``K`` is a stiffness [force / length], ``u`` a displacement [length], ``f`` a
force [force]. Equations ``B u + C multiplier = c`` have rows B (m, n) [-] and right-hand sides c (m,) [length]; their
multipliers (m,) are forces [force], their compliance C is a length per force: a matrix (m, m), or the diagonal (m,) of a
diagonal one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.springs import Springs

# Default relative accuracy of the solutions.
TOLERANCE = 1e-10
# Contrasts of materials up to this, see `LinearSolver`, are ignored.
MILD = 10.0
# Called with an unfinished solution (u, multiplier, relative residual); the solver stops if it returns True.
Monitor = Callable[[Array, Array, float], bool]


class Product(Protocol):
    """Matrix-vector products of a solver that stores K (n, n) in its own format."""

    def __matmul__(self, u: Array) -> Array:
        """Return ``K u``, shape (n,) [force]."""
        ...

    def row_sums(self, u: Array) -> Array:
        """Return ``|K| |u|``, shape (n,) [force]."""
        ...


@dataclass
class Counters:
    """Work done since `prepare`: factorisations or hierarchies, and solutions or iterations."""

    setups: int = 0
    iterations: int = 0


class Loaded(Protocol):
    """A prepared matrix with a right-hand side f (n,)."""

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``K u = f + B.T multiplier`` and ``B u + C multiplier = c``.

        B has full row rank where C, symmetric and positive semidefinite, is None or singular. Iterative solvers start from
        `guess` (n,), call `monitor` regularly and return the unfinished solution if it returns True; they stop at a relative
        residual of `tolerance` if that is given and larger than their own. `nodes` (m,) are the nodes of the equations, whose
        unknowns are preferred for elimination.
        """
        ...

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """Return ``R K^-1 f``, shape (m,) [length], and ``R K^-1 R.T``, shape (m, m) [length / force], of rows R (m, n)."""
        ...

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        """Return ``K^-1 (f + force)``, shape (n,), valid at the `involved` unknowns of `LinearSolver.prepare`.

        Solvers for which the other unknowns are an extra cost copy them from `elsewhere` (n,), if given. `solve` does
        the same with its `guess`.
        """
        ...

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """Return ``K^-1 (f + force)``, shape (n,); `u` (n,) is the result of `involved_solution` or `solve` for it."""
        ...

    def condensed(self) -> Loaded | None:
        """Return the problem condensed to the `involved` unknowns; None for solvers that do not condense.

        Its vectors and columns have these unknowns, in their order.
        """
        ...


@dataclass(frozen=True, eq=False)
class FrictionTerms:
    """Forces of sliding friction in addition to those of equations.

    Attributes
    ----------
    rows : csr_array (m, n)
        Rows that multipliers act through in place of those of the equations [-].
    springs : Springs, optional
        S is their matrix [force / length].
    forces : ndarray (n,), optional
        Further forces [force].
    """

    rows: csr_array
    springs: Springs | None = None
    forces: Array | None = None


@runtime_checkable
class LoadedNonsymmetric(Loaded, Protocol):
    """Solver of systems whose multipliers act through other rows than those of the equations, as in sliding friction."""

    @property
    def contrast(self) -> float:
        """See `LinearSolver`."""
        ...

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of K [force / length]."""
        ...

    def solve_nonsymmetric(
        self, B: csr_array, c: Array, nodes: Indices, guess: Array, tolerance: float,
        friction: FrictionTerms | None = None, C: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``B u + C multiplier = c`` and ``K u + S u = f + forces + rows.T multiplier``.

        C (m,) is a diagonal compliance, None stands for zero. S, forces and rows are those of `friction`; without it they
        are zero and B. Equations of one of the `nodes` (m,) may share unknowns. The iteration starts from `guess` (n,) and
        ends at a relative residual of `tolerance`, or at the solver's own if that is larger.

        Raises
        ------
        ConvergenceError
            If exact constraints are linearly dependent, in B or in rows, or the iteration does not converge.
        """
        ...


class LinearSolver(Protocol):
    """Solves ``K u = f`` under linear equations, for one K and many right-hand sides and sets of equations.

    Attributes
    ----------
    tolerance : float
        Relative accuracy of the solutions [-]; `improve` may lower it.
    asked : float, optional
        The original tolerance, if `improve` has lowered it [-].
    counters : Counters
    gave_up : str
        Reason why another method replaced this one; empty if none did.
    contrast : float
        By how much some deformations of a cell are stiffer than others: errors of displacements may exceed residuals by so
        much, and iterations that need not end with exact solutions go on by so much further [-].
    """

    tolerance: float
    counters: Counters
    asked: float | None = None
    gave_up: str = ""
    contrast: float = 1.0

    @property
    def iterative(self) -> bool:
        """Whether less accurate solutions cost less."""
        ...

    @property
    def condenses(self) -> bool:
        """Whether the prepared solver has K condensed to the `involved` unknowns."""
        return False

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None, release: bool = False
    ) -> bsr_array | Product:
        """Factorise the matrix, or build a multigrid hierarchy.

        Parameters
        ----------
        K : bsr_array (n, n)
            Symmetric and positive definite [force / length].
        rigid_modes : ndarray (n, n_modes)
            Near null space of K, the rigid-body modes [length].
        involved : ndarray of int (k,), optional
            Unknowns that equations may involve; a hint.
        release : bool
            Whether a solver with its own storage of K may reuse the memory of K and leave it empty. The returned object then
            replaces K in products.

        Returns
        -------
        bsr_array or Product
            K, or its replacement.
        """
        ...

    def load(self, f: Array) -> Loaded:
        """Return the prepared matrix with the right-hand side f (n,) [force]."""
        ...

    def snapshot(self) -> dict[str, Any]:
        """Return everything on which later solutions depend, as plain numbers, strings and arrays.

        It is the solver's part of the state of an analysis, and is saved with it: arrays are replaced, never written into.
        """
        ...

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """Continue from a `snapshot` of this solver, or of one of the same kind that was prepared for the same matrix."""
        ...

    def improve(self, excess: float) -> bool:
        """Make later solutions more accurate, since the residual exceeds its bound by `excess`; False if impossible."""
        return False
