"""Reference solver: conjugate gradients of SciPy, preconditioned by the smoothed aggregation multigrid of pyamg.

This solver is simple and slow. Except for the choice of pivots, it consists only of calls to pyamg and SciPy, so that the
solver "amg" can be verified against it. Constraints are eliminated by the transformation ``u = T v + t``, and each set of
constraints requires a new hierarchy for the matrix ``T.T K T``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, bsr_matrix, diags_array, eye_array
from scipy.sparse.linalg import cg

from fastcontact.arrays import Array, Indices, mask_at, scattered
from fastcontact.errors import ConvergenceError
from fastcontact.linear.delassus import InverseColumns, inverse_entries
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.elimination.loaded import LoadedIterative, restore_tolerance, tighten
from fastcontact.linear.multigrid.solver import MAX_ITERATIONS
from fastcontact.linear.protocol import TOLERANCE, Counters, LinearSolver, Monitor
from fastcontact.linear.sparse_rows import substituted

# As in "amg", all connections are treated as strong. The near-nullspace candidates are not improved, because rigid-body modes
# need no improvement. The smoother is the one with the shortest solution time.
SMOOTHER = ("chebyshev", {"degree": 2, "iterations": 1})
OPTIONS: dict[str, Any] = {
    "strength": ("symmetric", {"theta": 0.0}), "max_coarse": 200, "improve_candidates": None,
    "presmoother": SMOOTHER, "postsmoother": SMOOTHER,
}  # fmt: skip


class Pyamg(LinearSolver):
    """See `linear.protocol.LinearSolver`.

    Parameters
    ----------
    tolerance : float
        Tolerance of the 2-norm of the residual, relative to the 2-norm of the right-hand side [-].
    """

    name = "pyamg"
    iterative = True

    def __init__(self, tolerance: float = TOLERANCE) -> None:
        self.tolerance, self.counters = tolerance, Counters()
        self._hierarchy: Any = None

    def __repr__(self) -> str:
        if self._hierarchy is None:
            return "Pyamg(not prepared)"
        sizes = " -> ".join(str(level.A.shape[0]) for level in self._hierarchy.levels)
        complexity = self._hierarchy.operator_complexity()
        return f"Pyamg({len(self._hierarchy.levels)} levels, unknowns {sizes}, operator complexity {complexity:.2f})"

    def prepare(
        self, K: bsr_array, rigid_modes: Array, involved: Indices | None = None, release: bool = False
    ) -> bsr_array:
        """Build the hierarchy of K without modifying K; see `LinearSolver.prepare`."""
        self.K, self._modes = K, rigid_modes
        self._constrain(None)
        self.columns = InverseColumns(K.shape[0], self._inverse_entries)
        return K

    def _constrain(self, elimination: Elimination | None) -> None:
        """Build the hierarchy of ``T.T K T``, with the diagonal of K at the eliminated unknowns."""
        from pyamg import smoothed_aggregation_solver

        n = self.K.shape[0]
        self._elimination, self._T, A, modes = elimination, eye_array(n, format="csr"), self.K, self._modes
        if elimination is not None:
            free = 1.0 - mask_at(elimination.pivots, n)
            self._T = substituted(self._T, elimination.pivots, elimination.full_weights())
            A = self._T.T @ self.K @ self._T + diags_array((1.0 - free) * self.K.diagonal())
            modes = free[:, None] * modes
        self._A = bsr_matrix(A.tobsr(self.K.blocksize))
        self._hierarchy = smoothed_aggregation_solver(self._A, B=modes, **OPTIONS)
        self.counters.setups += 1

    def _inverse_entries(self, rows: Indices, columns: Indices) -> Array:
        return inverse_entries(self.K.shape[0], lambda f: self.solution(f, None, None), rows, columns)

    def solution(
        self, f: Array, elimination: Elimination | None, guess: Array | None, monitor: Monitor | None = None,
        tolerance: float | None = None,
    ) -> Array:  # fmt: skip
        """Solve ``K u = f`` subject to the equations of `elimination`; parameters as in `Multigrid.solution`.

        Raises
        ------
        ConvergenceError
            If the residual does not fall below the tolerance.
        """
        if elimination is not self._elimination:
            self._constrain(elimination)
        t = np.zeros(len(f)) if elimination is None else scattered(elimination.offset, elimination.pivots, len(f))
        rhs = self._T.T @ (f - self.K @ t)
        v0 = None if guess is None else guess - t
        if v0 is not None and elimination is not None:
            v0[elimination.pivots] = 0.0
        v, info = cg(
            self._A, rhs, v0, rtol=max(self.tolerance, tolerance or 0.0), maxiter=MAX_ITERATIONS,
            M=self._hierarchy.aspreconditioner(), callback=self._count,
        )  # fmt: skip
        if info:
            raise ConvergenceError(
                f"conjugate gradients with pyamg do not reach the tolerance {self.tolerance:.1e}: use amg or direct"
            )
        return np.asarray(self._T @ v + t)

    def _count(self, _: Array) -> None:
        self.counters.iterations += 1

    def multiplier(self, elimination: Elimination | None, u: Array, f: Array) -> Array:
        """Return the multipliers (m,) of the equations at `u` (n,) [force]."""
        return np.empty(0) if elimination is None else elimination.multiplier((self.K @ u - f)[elimination.pivots])

    def load(self, f: Array) -> LoadedIterative:
        """Return the prepared matrix with right-hand side `f` (n,)."""
        return LoadedIterative(self, f)

    def improve(self, excess: float) -> bool:
        """See `LinearSolver.improve`."""
        return tighten(self, excess)

    def snapshot(self) -> dict[str, Any]:
        """Return the requested columns of ``K^-1`` and the tolerance; see `LinearSolver.snapshot`."""
        return {"asked": list(self.columns.requests), "tolerance": self.tolerance}

    def put_back(self, snapshot: Mapping[str, Any]) -> None:
        """See `LinearSolver.put_back`."""
        restore_tolerance(self, snapshot)
        self.columns.put_back(snapshot["asked"])


SOLVER = Pyamg
