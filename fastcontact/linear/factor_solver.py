"""Base class of direct solvers, which solve systems with the factors of K and constraints with the Schur complement.

If a right-hand side is a linear combination of earlier ones, its solution is computed as the same combination of the earlier
solutions (`KnownLoads`).
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices, scattered
from fastcontact.linear.cholesky.symmetric_factors import SymmetricFactors
from fastcontact.linear.delassus import InverseColumns, check_rows, solve_multipliers, symmetric_part
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.protocol import Counters, LinearSolver, Loaded, Monitor
from fastcontact.round_off import ROUND_OFF, SUM_ROUND_OFF

log = logging.getLogger("fastcontact")
# Largest number of unknowns that are eliminated last. If there are more, computing the dense block of K^-1 costs more time
# than it saves.
MAX_LAST_UNKNOWNS = 4000
# Largest number of unknowns for which a factorisation is affordable, by dimension.
MAX_FACTORISED_DOFS = {1: 3_000_000, 2: 3_000_000, 3: 150_000}
# Relative residual that direct solutions attain.
ATTAINABLE_RESIDUAL = ROUND_OFF / 100
# Number of right-hand sides that are stored. Loads and supports seldom have more independent ramps.
# `test_only_a_few_loads_are_kept`.
STORED_LOADS = 4


class KnownLoads:
    """The last right-hand sides and their solutions, from which those of linear combinations are computed."""

    def __init__(self, n: int) -> None:
        self._loads = self._solutions = np.empty((0, n))

    def solution(self, f: Array, solve: Callable[[Array], Array]) -> Array:
        """Return the solution (n,) for the right-hand side f (n,).

        If f is not a linear combination of the stored right-hand sides up to round-off, the function `solve` is called.
        """
        norm = float(np.linalg.norm(f))
        if norm == 0.0:
            return np.zeros_like(f)
        if len(self._loads):  # the least-squares approximation of f
            weights, error = np.zeros(len(self._loads)), f
            for _ in range(2):  # The second pass removes the error of the normal equations.
                gram, right_side = self._loads @ self._loads.T, self._loads @ error
                weights = weights + np.linalg.lstsq(gram, right_side, rcond=None)[0]
                error = f - weights @ self._loads
            if np.linalg.norm(error) <= SUM_ROUND_OFF * norm:
                return np.asarray(weights @ self._solutions)
        f = f / norm
        u = solve(f)
        self._loads = np.vstack([self._loads[1 - STORED_LOADS :], f])
        self._solutions = np.vstack([self._solutions[1 - STORED_LOADS :], u])
        return norm * u

    def snapshot(self) -> list[dict[str, Any]]:
        """Return the stored right-hand sides: the indices ``places`` and the ``values`` of their nonzero entries."""
        return [{"places": np.flatnonzero(f), "values": f[f != 0.0]} for f in self._loads]

    def put_back(self, snapshot: Sequence[Mapping[str, Any]], solve: Callable[[Array], Array]) -> None:
        """Restore the right-hand sides of a `snapshot` for the same matrix (n, n); `solve` computes missing solutions."""
        n = self._loads.shape[1]
        loads = np.array([scattered(entry["values"], entry["places"], n) for entry in snapshot]).reshape(-1, n)
        if np.array_equal(loads, self._loads):
            return
        solutions = np.empty_like(loads)
        for f, u in zip(loads, solutions, strict=True):
            stored = np.flatnonzero((self._loads == f).all(axis=1))
            u[:] = self._solutions[stored[0]] if len(stored) else solve(f)
        self._loads, self._solutions = loads, solutions


class FactorSolver(LinearSolver):
    """Base class of direct solvers; subclasses implement the factorisation.

    Unknowns that may occur in constraint equations, denoted by c, are eliminated last. With the factors ``K = L D L.T``,
    their block of the inverse is ``(K^-1)_cc = (L_cc D_c L_cc.T)^-1``, which is computed without solving systems with K.
    Under contact forces, the other displacements follow from those of the unknowns c by back substitution alone.

    Parameters
    ----------
    tolerance : float
        Not used, because the solutions are exact up to round-off.

    Attributes
    ----------
    n : int
        Number of unknowns.
    last : ndarray of int (m,) or None
        The unknowns that are eliminated last; None if there are none.
    factors : SymmetricFactors
    """

    name: str
    iterative = False

    def __init__(self, tolerance: float = ATTAINABLE_RESIDUAL) -> None:
        self.tolerance = ATTAINABLE_RESIDUAL
        self.counters = Counters()
        self.n = 0
        self.factors: SymmetricFactors
        self.last: Indices | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({f'{self.n} unknowns' if self.n else 'not prepared'})"

    def _factorise(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        """Return the factors of K (n, n), with the unknowns `last` (m,) eliminated last; ModelError if K is singular."""
        raise NotImplementedError

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None, release: bool = False
    ) -> bsr_array:
        """Factorise K without modifying it; see `LinearSolver.prepare`.

        Raises
        ------
        ModelError
            If K is singular.
        """
        self.n, self._K, self.refines = K.shape[0], K, False
        last = np.empty(0, np.intp) if involved is None or len(involved) > MAX_LAST_UNKNOWNS else involved
        self.factors = self._factorise(K, last)
        self.counters.setups += 1
        self.columns, self.known_loads = InverseColumns(self.n, self.factors.inverse_entries), KnownLoads(self.n)
        self.last = last if len(last) else None
        if self.last is not None:
            self.inverse = self.factors.last_inverse()
            self.columns.store(self.last, self.inverse)
        return K

    @property
    def condenses(self) -> bool:
        """See `LinearSolver`."""
        return self.last is not None

    def load(self, f: Array) -> Any:
        """Return the prepared matrix with the right-hand side `f` (n,) [force]."""
        return LoadedFactor(self, f, self.known_loads.solution(f, self.back_substitute))

    def snapshot(self) -> dict[str, Any]:
        """Return the requested columns of ``K^-1`` and the stored right-hand sides; see `LinearSolver.snapshot`."""
        state = {"asked": list(self.columns.requests), "loads": self.known_loads.snapshot()}
        return {**state, "refines": True} if self.refines else state

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """See `LinearSolver.put_back`."""
        self.refines = snapshot.get("refines", False)
        self.columns.put_back(snapshot["asked"])
        self.known_loads.put_back(snapshot["loads"], self.factors.solve)

    def improve(self, excess: float) -> bool:
        """Apply one step of iterative refinement from now on; see `LinearSolver.improve`."""
        if self.refines:
            return False
        log.info("linear solver: out-of-balance forces are %.1e times the bound; solutions will be refined", excess)
        self.refines = True
        return True

    def refined_solution(self, f: Array) -> Array:
        """Return ``K^-1 f`` (n,), with one step of iterative refinement."""
        u = self.back_substitute(f)
        return u + self.back_substitute(f - self._K @ u)

    def back_substitute(self, f: Array) -> Array:
        """Return ``K^-1 f`` (n,)."""
        self.counters.iterations += 1
        return self.factors.solve(f)


class LoadedFactor(Loaded):
    """The factors of a `FactorSolver` with a right-hand side f (n,); see `linear.protocol.Loaded`.

    `unconstrained` (n,) is the solution without constraints [length].
    """

    def __init__(self, solver: FactorSolver, f: Array, unconstrained: Array) -> None:
        self._solver, self._f, self._unconstrained = solver, f, unconstrained

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """See `Loaded`."""
        return R @ self._unconstrained, self._solver.columns.delassus(R)

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """See `Loaded`."""
        if self._solver.refines:
            return self._solver.refined_solution(self._f + force)
        if not force.any():
            return self._unconstrained.copy()
        last = self._solver.last
        if last is None or np.count_nonzero(force) != np.count_nonzero(force[last]):
            return self._solver.back_substitute(self._f + force)
        self._solver.counters.iterations += 1
        return self._unconstrained + self._solver.factors.harmonic_extension(self._solver.inverse @ force[last])

    def involved_solution(self, force: Array, estimate: Array | None) -> Array:
        """See `Loaded`."""
        last = self._solver.last
        if estimate is None or last is None or np.count_nonzero(force) != np.count_nonzero(force[last]):
            return self.full_solution(force)
        u = estimate.copy()
        u[last] = self._unconstrained[last] + self._solver.inverse @ force[last]
        return u

    def condensed(self) -> Loaded:
        """See `Loaded`."""
        last = self._solver.last
        return self if last is None else CondensedProblem(self._solver.inverse, self._unconstrained[last])


class CondensedProblem(Loaded):
    """The system after static condensation to the k unknowns that may occur in constraint equations.

    All vectors have the length k; see `linear.protocol.Loaded`.

    Parameters
    ----------
    inverse : ndarray (k, k)
        Block of ``K^-1`` for these unknowns, the inverse of the condensed matrix [length / force].
    unconstrained : ndarray (k,)
        Solution without constraints [length].
    """

    def __init__(self, inverse: Array, unconstrained: Array) -> None:
        self._inverse, self._unconstrained = inverse, unconstrained

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """See `Loaded`."""
        if B.shape[0] == 0:
            return self._unconstrained, np.empty(0)
        check_rows(B.shape[0])
        B_inverse = B @ self._inverse
        multiplier = solve_multipliers(symmetric_part(B @ B_inverse.T), c - B @ self._unconstrained, C)
        return self._unconstrained + multiplier @ B_inverse, multiplier

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """See `Loaded`."""
        return R @ self._unconstrained, symmetric_part(R @ (R @ self._inverse).T)

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """See `Loaded`."""
        return np.asarray(self._unconstrained + self._inverse @ force)
