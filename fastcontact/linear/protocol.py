"""Protocols of linear solvers.

Shapes: n unknowns, m equations among them. ``K`` is a stiffness [force / length], ``u`` a displacement [length], ``f`` a
force [force]. Equations ``B u + C multiplier = c`` have rows B (m, n) [-] and right-hand sides c (m,) [length]; their
multipliers (m,) are forces [force], their compliance C is a length per force: a matrix (m, m), or its diagonal (m,) where it
has no more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.springs import Springs

# Relative accuracy of the solutions unless another is asked for.
TOLERANCE = 1e-10
# Contrasts of materials up to this, see `LinearSolver`, are taken for none.
MILD = 10.0
# Called with an unfinished solution (u, multiplier, relative residual); where it returns True, the solver stops there.
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
    """Work done since `prepare`: factorisations or hierarchies built, and solutions or iterations."""

    setups: int = 0
    iterations: int = 0


class Loaded(Protocol):
    """A prepared matrix with a right-hand side f (n,)."""

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``K u = f + B.T multiplier`` and ``B u + C multiplier = c``.

        B has full row rank where C, symmetric and positive semidefinite, is None or singular. Solvers that iterate start
        from `guess` (n,), call `monitor` from time to time and return the unfinished solution where that returns True;
        they stop at a relative residual of `tolerance` where that is given and above their own. `nodes` (m,) are the nodes
        that the equations belong to, a hint which unknowns to eliminate.
        """
        ...

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """Return ``R K^-1 f``, shape (m,) [length], and ``R K^-1 R.T``, shape (m, m) [length / force], of rows R (m, n)."""
        ...

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        """Return ``K^-1 (f + force)``, shape (n,), right at the `involved` unknowns of `LinearSolver.prepare`.

        Solvers for which the other unknowns cost extra leave those as they are in `elsewhere` (n,), where that is given.
        `solve` does the same with its `guess`.
        """
        ...

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """Return ``K^-1 (f + force)``, shape (n,); `u` (n,) is what `involved_solution` or `solve` returned for it."""
        ...

    def condensed(self) -> Loaded | None:
        """Return the problem of the `involved` unknowns alone, K condensed to them; None from solvers that do not condense.

        All its vectors and columns are those unknowns, in their order.
        """
        ...


@dataclass(frozen=True, eq=False)
class FrictionTerms:
    """Forces that sliding friction adds to those of equations.

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
    """Also solves where multipliers act through other rows than those of the equations: sliding friction."""

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
        ends at a relative residual of `tolerance`, or of the solver's own where that is larger.

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
        The tolerance that was asked for, where `improve` has lowered it [-].
    counters : Counters
    gave_up : str
        Why another way of solving replaced this one; empty where none did.
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
        """Whether, as prepared, the solver has K condensed to the `involved` unknowns."""
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
            Displacements that cost little energy [length].
        involved : ndarray of int (k,), optional
            The unknowns that equations may involve, a hint.
        release : bool
            Whether a solver that stores K's numbers in its own way may take over their memory and leave K empty. What is
            returned then multiplies in the place of K.

        Returns
        -------
        bsr_array or Product
            K, or what takes its place.
        """
        ...

    def load(self, f: Array) -> Loaded:
        """Take the right-hand side f (n,) [force]."""
        ...

    def snapshot(self) -> dict[str, Any]:
        """Return all that later solutions owe to earlier ones: plain numbers, strings and arrays.

        It is the part of the state of an analysis that the solver has, and is saved with it: arrays are replaced, never
        written into.
        """
        ...

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """Continue from a `snapshot` of this solver, or of one of the same kind that was prepared for the same matrix."""
        ...

    def improve(self, excess: float) -> bool:
        """Make later solutions more accurate, since the residual exceeds its bound by `excess`; False if impossible."""
        return False
