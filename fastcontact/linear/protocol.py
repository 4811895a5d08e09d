"""Protocols of linear solvers.

A solver handles systems with n unknowns that are subject to m linear equations. K (n, n) is a stiffness matrix [force /
length], u (n,) are displacements [length], and f (n,) are forces [force]. The equations are ``B u + C multiplier = c`` with a
matrix B (m, n) [-], right-hand sides c (m,) [length], Lagrange multipliers (m,) [force] and a compliance C [length /
force]. C is given as a matrix (m, m), or as the diagonal (m,) of a diagonal matrix.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, Self, TypeAlias, runtime_checkable

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices
from fastcontact.linear.delassus import solve_multipliers
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.springs import Springs

# Default relative residual at which iterative solvers stop.
TOLERANCE = 1e-10
# Largest `LinearSolver.contrast` that requires no special treatment. With 1000, "nu 0.499" with friction takes 711
# iterations (134 with 10; `fastcontact bench robustness`, 3 000 unknowns).
MILD_CONTRAST = 10.0
# Function that returns whether to stop the iteration, given an unconverged solution u (n,), its multipliers (m,) and its
# relative residual.
Monitor = Callable[[Array, Array, float], bool]


class Product(Protocol):
    """Matrix K (n, n), as stored by a solver in a different format, for products with vectors."""

    def __matmul__(self, u: Array) -> Array:
        """Return ``K @ u`` (n,) [force]."""

    def absolute_product(self, u: Array) -> Array:
        """Return ``abs(K) @ abs(u)`` (n,) [force]."""


# A matrix that is stored in blocks, or the object that replaces it in products, see `LinearSolver.prepare`.
Matrix: TypeAlias = bsr_array | Product


@dataclass
class Counters:
    """Work of a solver since `LinearSolver.prepare` was called.

    Attributes
    ----------
    setups : int
        Number of factorisations, or of multigrid hierarchies that were built.
    iterations : int
        Number of right-hand sides for which a direct solver was used, or number of iterations of an iterative solver.
    """

    setups: int = 0
    iterations: int = 0


class Loaded(Protocol):
    """A prepared matrix K (n, n) with a right-hand side f (n,)."""

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return u and the multipliers such that ``K u = f + B.T multiplier`` and ``B u + C multiplier = c``.

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
            Relative residual at which iterative solvers stop. Values below their own tolerance have no effect [-].
        nodes : ndarray of int (m,), optional
            Node of each equation. The unknowns of this node are preferred for elimination.

        Returns
        -------
        u : ndarray (n,)
            Displacements [length].
        multiplier : ndarray (m,)
            Lagrange multipliers [force].
        """
        if B.shape[0] == 0:
            return self.full_solution(np.zeros(B.shape[1])), np.empty(0)
        free, F = self.delassus(B)
        multiplier = solve_multipliers(F + self.rigid_compliance(B), c - free, C)
        return self.involved_solution(B.T @ multiplier, guess), multiplier

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """Return ``R K^-1 f`` (m,) [length] and the Delassus operator ``R K^-1 R.T`` (m, m) [length / force] for R (m, n)."""

    def rigid_compliance(self, R: csr_array) -> Array | float:
        """Return the part (m, m) of the Delassus operator that `delassus` omits, due to motions of rigid bodies."""
        return 0.0

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """Return ``K^-1 (f + force)`` (n,) [length].

        `u` (n,) is the result of `solve` with the same forces, if available [length].
        """

    def involved_solution(self, force: Array, estimate: Array | None) -> Array:
        """Return ``K^-1 (f + force)`` (n,) [length], valid only at the `involved` unknowns of `LinearSolver.prepare`.

        If an `estimate` (n,) of the solution is given, a solver for which the other unknowns require additional work copies
        them from `estimate`. Likewise, `solve` copies them from its `guess`.
        """
        return self.full_solution(force)

    def condensed(self) -> Loaded:
        """Return the system after static condensation to the `involved` unknowns of `LinearSolver.prepare`.

        The unknowns of the condensed system are the involved ones, in the order of `involved`. A solver that does not
        condense returns the system itself.
        """
        return self


@record
class FrictionTerms:
    """Terms of sliding friction in the equations of equilibrium, see `LoadedNonsymmetric.solve_nonsymmetric`.

    Attributes
    ----------
    rows : csr_array (m, n)
        Matrix whose transpose maps the multipliers to forces on the unknowns. It takes the place of B in the equilibrium [-].
    springs : Springs, optional
        Springs that are added to K. Their stiffness matrix (n, n) is denoted by S [force / length].
    forces : ndarray (n,), optional
        Additional forces on the unknowns [force].
    """

    rows: csr_array
    springs: Springs | None = None
    forces: Array | None = None


@runtime_checkable
class LoadedNonsymmetric(Loaded, Protocol):
    """A `Loaded` that also solves the nonsymmetric systems of sliding friction.

    In these systems, the multipliers exert the forces ``rows.T @ multiplier``, where `rows` differs from B.
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
        """Return u and multipliers with ``B u + C multiplier = c`` and ``K u + S u = f + forces + rows.T multiplier``.

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
            Relative residual at which the iteration stops. Values below the tolerance of the solver have no effect [-].
        friction : FrictionTerms, optional
            S, `forces` and `rows`. By default, S and `forces` are zero, and `rows` is B.
        C : ndarray (m,), optional
            Diagonal compliance; zero by default [length / force].

        Returns
        -------
        u : ndarray (n,)
            Displacements [length].
        multiplier : ndarray (m,)
            Lagrange multipliers [force].

        Raises
        ------
        ConvergenceError
            If equations without compliance are linearly dependent, in B or in `rows`, or if the iteration does not converge.
        """


class LinearSolver(Protocol):
    """Solver of ``K u = f`` subject to linear equations, for one matrix K and many right-hand sides and sets of equations.

    Attributes
    ----------
    tolerance : float
        Relative residual of the solutions. The method `improve` may reduce it [-].
    original_tolerance : float, optional
        The original tolerance, if `improve` has reduced it [-].
    counters : Counters
    replacement_reason : str
        The reason for which another method has replaced this one; empty if this has not happened.
    contrast : float
        Largest ratio of the stiffnesses of a cell in different modes of deformation, such as dilatation and shear of a nearly
        incompressible material. Relative errors of displacements may exceed relative residuals by this factor. The
        tolerances of inexact solutions are therefore divided by it [-].
    """

    tolerance: float
    counters: Counters
    original_tolerance: float | None = None
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
    ) -> Matrix:
        """Factorise the matrix, or build a multigrid hierarchy.

        Parameters
        ----------
        K : bsr_array (n, n)
            Symmetric positive definite matrix [force / length].
        rigid_modes : ndarray (n, n_modes)
            Rigid-body modes, which span the near null space of K [length].
        involved : ndarray of int (k,), optional
            Unknowns that may occur in equations, which solvers may use to save work. By default, all unknowns may occur.
        release : bool
            Whether a solver that stores K in a different format may release the memory of K, which is empty afterwards. The
            returned object then replaces K in products.

        Returns
        -------
        bsr_array or Product
            K, or the object that replaces it in products.
        """

    def copy_for_similar_matrix(self) -> Self:
        """Return a copy of the solver, to be prepared for a similar matrix with the same pattern, such as a tangent."""
        return copy.copy(self)

    def load(self, f: Array) -> Loaded:
        """Return the prepared matrix with the right-hand side f (n,) [force]."""

    def snapshot(self) -> dict[str, Any]:
        """Return all data on which later solutions depend, as numbers, strings and arrays.

        The snapshot is part of the state of an analysis and is saved for restarts. Its arrays must not be modified.
        """

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """Restore the data of a `snapshot` of this solver, or of a solver of the same class for the same matrix."""

    def improve(self, excess: float) -> bool:
        """Reduce `tolerance` because a residual is `excess` times its bound; return False if this is impossible."""
        return False
