"""Conjugate gradients preconditioned by smoothed aggregation (pyamg), with the rigid-body modes as near-nullspace.

The aggregates and prolongators are those of K and serve the whole analysis. Equations ``B u = c`` are eliminated;
for the eliminated matrix the rows of the finest prolongator that belong to eliminated unknowns are dropped and the
Galerkin products renewed. Equations with a compliance of their own cannot be eliminated: they go through the
compliance of their degrees of freedom, one solution each, kept for the whole analysis.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, bsr_matrix, csr_array, csr_matrix, diags_array
from scipy.sparse.linalg import cg

from fastcontact.errors import ConvergenceError
from fastcontact.linear._compliance import ComplianceCache, multipliers, reduced
from fastcontact.linear._elimination import eliminate
from fastcontact.linear._solver import Counters

Array = NDArray[np.float64]
SMOOTHER = ("block_gauss_seidel", {"sweep": "symmetric"})
MAX_ITERATIONS = 1000


class Amg:
    """Smoothed-aggregation multigrid as preconditioner of conjugate gradients.

    Parameters
    ----------
    tolerance : float
        The residual is reduced below this fraction of the right-hand side (2-norms).
    """

    name = "amg"

    def __init__(self, tolerance: float = 1e-10) -> None:
        self.tolerance = tolerance
        self.counters = Counters()

    def __repr__(self) -> str:
        if not hasattr(self, "_hierarchy"):
            return "Amg(not prepared)"
        sizes = " -> ".join(str(level.A.shape[0]) for level in self._hierarchy.levels)
        complexity = self._hierarchy.operator_complexity()
        return f"Amg({len(self._hierarchy.levels)} levels, unknowns {sizes}, operator complexity {complexity:.2f})"

    def prepare(self, K: bsr_array, rigid_modes: Array, involved: NDArray[np.intp] | None = None) -> None:
        """Build the hierarchy of K; see `LinearSolver.prepare`."""
        import pyamg

        self.K = K
        self._block = K.blocksize
        self._hierarchy = pyamg.smoothed_aggregation_solver(
            bsr_matrix(K), B=rigid_modes, strength=("symmetric", {"theta": 0.0}), smooth="energy",
            max_coarse=50, coarse_solver="splu", presmoother=SMOOTHER, postsmoother=SMOOTHER,
        )  # fmt: skip
        self.counters.setups += 1
        self.compliance = ComplianceCache(K.shape[0], self._solve_many)

    def _solve_many(self, F: Array) -> Array:
        K = bsr_matrix(self.K)
        return np.column_stack([self.conjugate_gradients(K, f, self._hierarchy, None) for f in F.T])

    def load(self, f: Array) -> _Loaded:
        """Return the prepared matrix with right-hand side `f`."""
        return _Loaded(self, f)

    def conjugate_gradients(self, A: Any, f: Array, hierarchy: Any, guess: Array | None) -> Array:
        """Solve ``A u = f`` to the solver's tolerance.

        Raises
        ------
        ConvergenceError
            If the residual does not fall below the tolerance.
        """
        scale = np.linalg.norm(f)
        if scale == 0.0:
            return np.zeros(len(f))

        def count(_: Array) -> None:
            self.counters.iterations += 1

        u, failed = cg(
            A,
            f,
            x0=guess,
            rtol=self.tolerance,
            maxiter=MAX_ITERATIONS,
            M=hierarchy.aspreconditioner(),
            callback=count,
        )
        if failed:
            left = np.linalg.norm(f - A @ u) / scale
            raise ConvergenceError(
                f"conjugate gradients stand at a relative residual of {left:.1e} after {MAX_ITERATIONS} iterations, "
                f"above {self.tolerance:.1e}: use the direct solver, or look for near-incompressible or thin parts"
            )
        return u

    def eliminated_hierarchy(self, A: bsr_array, pivots: NDArray[np.intp]) -> Any:
        """Return the hierarchy of the eliminated matrix `A` with the prolongators of K."""
        from pyamg.multilevel import MultilevelSolver
        from pyamg.relaxation.smoothing import change_smoothers

        keep = np.ones(A.shape[0])
        keep[pivots] = 0.0
        levels = []
        operator: Any = bsr_matrix(A)
        for number, old in enumerate(self._hierarchy.levels):
            level = MultilevelSolver.Level()
            level.A = operator
            levels.append(level)
            if not hasattr(old, "P"):
                break
            P = csr_matrix(diags_array(keep) @ csr_matrix(old.P)).tobsr(old.P.blocksize) if number == 0 else old.P
            level.P, level.R = P, P.T.tobsr(P.blocksize[::-1])
            operator = bsr_matrix(level.R @ operator @ P).tobsr((P.blocksize[1], P.blocksize[1]))
        solver = MultilevelSolver(levels, coarse_solver="splu")
        change_smoothers(solver, SMOOTHER, SMOOTHER)
        return solver


class _Loaded:
    """See `linear._solver.Loaded`."""

    def __init__(self, solver: Amg, f: Array) -> None:
        self._solver, self._f = solver, f
        self._free: Array | None = None

    def solve(self, B: csr_array, c: Array, C: Array | None = None, guess: Array | None = None) -> tuple[Array, Array]:
        if B.shape[0] == 0:
            return self._unconstrained(self._f, guess), np.empty(0)
        if C is None:
            return self._eliminated(B, c, guess)
        multiplier = multipliers(self._solver.compliance, B, c - B @ self._unloaded(), C)
        return self._unconstrained(self._f + B.T @ multiplier, guess), multiplier

    def reduce(self, R: csr_array) -> tuple[Array, Array]:
        return R @ self._unloaded(), reduced(self._solver.compliance, R)

    def displacement(self, force: Array) -> Array:
        return self._unconstrained(self._f + force, None)

    def _unloaded(self) -> Array:
        """Return the displacement without contact forces."""
        if self._free is None:
            self._free = self._unconstrained(self._f, None)
        return self._free

    def _unconstrained(self, f: Array, guess: Array | None) -> Array:
        solver = self._solver
        return solver.conjugate_gradients(bsr_matrix(solver.K), f, solver._hierarchy, guess)

    def _eliminated(self, B: csr_array, c: Array, guess: Array | None) -> tuple[Array, Array]:
        solver = self._solver
        K = csr_array(solver.K)
        tie = eliminate(B, c)
        diagonal = np.zeros(K.shape[0])
        diagonal[tie.pivots] = K.diagonal()[tie.pivots]
        A = bsr_array((tie.T.T @ K @ tie.T + diags_array(diagonal)).tobsr(solver._block))
        right = tie.T.T @ (self._f - K @ tie.t)
        start = None
        if guess is not None:
            start = guess.copy()
            start[tie.pivots] = 0.0
        v = solver.conjugate_gradients(
            bsr_matrix(A), right, solver.eliminated_hierarchy(A, tie.pivots), start
        )  # fmt: skip
        u = tie.T @ v + tie.t
        return u, tie.multiplier(K @ u - self._f)


SOLVER = Amg
