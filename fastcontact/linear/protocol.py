"""Protocols of linear solvers.

A solver handles systems with n unknowns and m linear equations between them. K (n, n) is a stiffness matrix [force /
length], u (n,) are displacements [length], and f (n,) forces [force]. The equations are ``B u + C multiplier = c`` with a
matrix B (m, n) [-], right-hand sides c (m,) [length], Lagrange multipliers (m,) [force] and a compliance C [length /
force]. C is a matrix (m, m), or the diagonal (m,) of a diagonal matrix.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self, runtime_checkable

from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.springs import Springs

# Default relative residual at which iterative solvers stop.
TOLERANCE = 1e-10
# Largest `LinearSolver.contrast` that needs no special treatment.
MILD = 10.0
# Function that returns whether to stop the iteration, given an unconverged solution u (n,), its multipliers (m,) and its
# relative residual.
Monitor = Callable[[Array, Array, float], bool]


class Product(Protocol):
    """Products with the matrix K (n, n) of a solver that has stored it in a different format."""

    def __matmul__(self, u: Array) -> Array:
        """Return ``K @ u`` (n,) [force]."""

    def absolute_product(self, u: Array) -> Array:
        """Return ``abs(K) @ abs(u)`` (n,) [force]."""


@dataclass
class Counters:
    """Work of a solver since `LinearSolver.prepare`.

    Attributes
    ----------
    setups : int
        Number of factorisations, or of multigrid hierarchies.
    iterations : int
        Number of solutions of a direct solver, or of iterations of an iterative one.
    """

    setups: int = 0
    iterations: int = 0


class Loaded(Protocol):
    """A prepared matrix K (n, n) with a right-hand side f (n,)."""

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``K u = f + B.T multiplier`` and ``B u + C multiplier = c``.

        Parameters
        ----------
        B : csr_array (m, n)
            Matrix of the equations; it must have full row rank unless C is positive definite [-].
        c : ndarray (m,)
            Right-hand sides [length].
        C : ndarray (m, m) or (m,) or FieldCompliance, optional
            Compliance, symmetric and positive semidefinite; zero by default [length / force].
        guess : ndarray (n,), optional
            Initial guess of u for iterative solvers [length].
        monitor : callable, optional
            `Monitor` that iterative solvers call regularly. If it returns True, they return the unconverged solution.
        tolerance : float, optional
            Relative residual at which iterative solvers stop, if it is larger than their tolerance [-].
        nodes : ndarray of int (m,), optional
            The node of each equation, whose unknowns are preferred for elimination.

        Returns
        -------
        u : ndarray (n,)
            [length].
        multiplier : ndarray (m,)
            [force].
        """

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """Return ``R K^-1 f`` (m,) [length] and the Delassus operator ``R K^-1 R.T`` (m, m) [length / force] for R (m, n)."""

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """Return ``K^-1 (f + force)`` (n,) [length].

        `u` (n,) is the result of `solve` with the same forces, if available [length].
        """

    def involved_solution(self, force: Array, elsewhere: Array | None) -> Array:
        """Return ``K^-1 (f + force)`` (n,) [length], valid only at the `involved` unknowns of `LinearSolver.prepare`.

        If computing the other unknowns takes additional work, a solver copies them from `elsewhere` (n,), if this is given.
        Likewise, `solve` copies them from its `guess`.
        """
        return self.full_solution(force)

    def condensed(self) -> Loaded:
        """Return the system after static condensation to the `involved` unknowns of `LinearSolver.prepare`.

        The unknowns of the condensed system are the involved ones, in the order of `involved`. A solver that does not
        condense returns the system itself.
        """
        return self


@dataclass(frozen=True, eq=False)
class FrictionTerms:
    """Terms of sliding friction in the equilibrium, see `LoadedNonsymmetric.solve_nonsymmetric`.

    Attributes
    ----------
    rows : csr_array (m, n)
        Matrix whose transpose maps the multipliers to forces on the unknowns, instead of the transpose of B [-].
    springs : Springs, optional
        Springs that are added to K; S is their matrix (n, n) [force / length].
    forces : ndarray (n,), optional
        Additional forces on the unknowns [force].
    """

    rows: csr_array
    springs: Springs | None = None
    forces: Array | None = None


@runtime_checkable
class LoadedNonsymmetric(Loaded, Protocol):
    """A `Loaded` that also solves the nonsymmetric systems of sliding friction.

    In these systems the forces of the multipliers are ``rows.T @ multiplier`` with a matrix other than B.
    """

    @property
    def contrast(self) -> float:
        """See `LinearSolver`."""

    def diagonal(self) -> Array:
        """Return the diagonal (n,) of K [force / length]."""

    def solve_nonsymmetric(
        self, B: csr_array, c: Array, nodes: Indices, guess: Array, tolerance: float,
        friction: FrictionTerms | None = None, C: Array | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return (u, multiplier) with ``B u + C multiplier = c`` and ``K u + S u = f + forces + rows.T multiplier``.

        Parameters
        ----------
        B : csr_array (m, n)
            Matrix of the equations [-].
        c : ndarray (m,)
            Right-hand sides [length].
        nodes : ndarray of int (m,)
            Node of each equation. Equations of the same node may involve the same unknowns.
        guess : ndarray (n,)
            Initial guess of u [length].
        tolerance : float
            Relative residual at which the iteration stops, if it is larger than the tolerance of the solver [-].
        friction : FrictionTerms, optional
            S, `forces` and `rows`. By default S and `forces` are zero, and `rows` is B.
        C : ndarray (m,), optional
            Diagonal compliance; zero by default [length / force].

        Returns
        -------
        u : ndarray (n,)
            [length].
        multiplier : ndarray (m,)
            [force].

        Raises
        ------
        ConvergenceError
            If equations without compliance are linearly dependent, in B or in `rows`, or if the iteration does not converge.
        """


class LinearSolver(Protocol):
    """Solver of ``K u = f`` under linear equations, for one matrix K and many right-hand sides and sets of equations.

    Attributes
    ----------
    tolerance : float
        Relative residual of the solutions, which `improve` may reduce [-].
    asked : float, optional
        The original tolerance, if `improve` has reduced it [-].
    counters : Counters
    replacement_reason : str
        Reason why a different method has replaced this one; empty if none has.
    contrast : float
        Largest ratio of the stiffnesses of a cell in different deformations, such as dilatation and shear of a nearly
        incompressible material. Relative errors of displacements may exceed relative residuals by this factor, and the
        tolerances of inexact solutions are divided by it [-].
    """

    tolerance: float
    counters: Counters
    asked: float | None = None
    replacement_reason: str = ""
    contrast: float = 1.0

    @property
    def iterative(self) -> bool:
        """Whether a solution with a larger tolerance costs less."""

    @property
    def condenses(self) -> bool:
        """Whether `prepare` has condensed K statically to the `involved` unknowns."""
        return False

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None, release: bool = False
    ) -> bsr_array | Product:
        """Factorise the matrix, or build a multigrid hierarchy.

        Parameters
        ----------
        K : bsr_array (n, n)
            Symmetric positive definite matrix [force / length].
        rigid_modes : ndarray (n, n_modes)
            Rigid-body modes, which span the near null space of K [length].
        involved : ndarray of int (k,), optional
            Unknowns that equations may involve; solvers may use them to save work. By default all unknowns.
        release : bool
            Whether a solver that stores K in a different format may release the memory of K and leave it empty. The returned
            object then replaces K in products.

        Returns
        -------
        bsr_array or Product
            K, or the object that replaces it in products.
        """

    def near(self) -> Self:
        """Return a copy of the solver that is to be prepared for a similar matrix of the same pattern, such as a tangent."""
        return copy.copy(self)

    def load(self, f: Array) -> Loaded:
        """Return the prepared matrix with the right-hand side f (n,) [force]."""

    def snapshot(self) -> dict[str, Any]:
        """Return all data on which later solutions depend, as numbers, strings and arrays.

        The state of an analysis includes the snapshot, and a restart saves it. Its arrays must not be modified later.
        """

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """Restore the data of a `snapshot` of this solver, or of a solver of the same class for the same matrix."""

    def improve(self, excess: float) -> bool:
        """Reduce `tolerance`, as required by a residual that is `excess` times its bound; return whether this is possible."""
        return False
