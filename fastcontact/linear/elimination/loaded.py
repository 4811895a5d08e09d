"""Common part of iterative solvers: elimination of linear equations where this is possible, and tolerances."""

from __future__ import annotations

import functools
import logging
from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.linear.delassus import solve_multipliers
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.elimination.pivot_order import DependenceError
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.protocol import LinearSolver, Loaded, Monitor
from fastcontact.round_off import SUM_ROUND_OFF

log = logging.getLogger("fastcontact")
# Ratio of the reduced tolerance to the tolerance at which the residual is expected to reach its bound. With 0.003,
# tolerances reach round-off, and `test_what_loose_criteria_leave_is_told_with_its_number` fails.
REDUCTION = 0.3


class LoadedIterative(Loaded):
    """A prepared matrix of an iterative solver with a right-hand side; see `linear.protocol.Loaded`.

    Parameters
    ----------
    solver : object
        The solver. It must have an attribute ``columns``, the `InverseColumns` of K, and two methods, whose argument
        ``elimination`` is an `Elimination` or None: ``solution(f, elimination, guess, monitor, tolerance)`` returns u (n,)
        [length], and ``multiplier(elimination, u, f)`` returns the multipliers (m,) of the constraints [force].
    f : ndarray (n,)
        Right-hand side [force].
    """

    def __init__(self, solver: Any, f: Array) -> None:
        self._solver, self._f = solver, np.ascontiguousarray(f, float)

    @functools.cached_property
    def _unconstrained(self) -> Array:
        """Solution (n,) without constraints [length]."""
        return np.asarray(self._solver.solution(self._f, None, None))

    def solve(
        self, B: csr_array, c: Array, C: Array | FieldCompliance | None = None, guess: Array | None = None,
        monitor: Monitor | None = None, tolerance: float | None = None, nodes: Indices | None = None,
    ) -> tuple[Array, Array]:  # fmt: skip
        """Return the displacements and the multipliers, see `Loaded.solve`.

        Constraints that are linearly dependent or have a compliance are not eliminated. Instead, the Delassus operator is
        formed from columns of K^-1.
        """
        solver = self._solver
        if C is None or not B.shape[0]:
            try:
                elimination = eliminate(B, c, None, nodes, solver.K.blocksize[0]) if B.shape[0] else None
            except DependenceError as error:
                log.info("%s (the Delassus operator is formed instead)", error)
            else:
                u = solver.solution(self._f, elimination, guess, monitor, tolerance)
                return u, solver.multiplier(elimination, u, self._f)
        multiplier = solve_multipliers(solver.columns.delassus(B), c - B @ self._unconstrained, C)
        return solver.solution(self._f + B.T @ multiplier, None, guess), multiplier

    def delassus(self, R: csr_array) -> tuple[Array, Array]:
        """See `Loaded`."""
        return R @ self._unconstrained, self._solver.columns.delassus(R)

    def full_solution(self, force: Array, u: Array | None = None) -> Array:
        """See `Loaded`."""
        if u is not None:
            return u
        return np.asarray(self._solver.solution(self._f + force, None, None)) if force.any() else self._unconstrained


def tighten(solver: LinearSolver, excess: float) -> bool:
    """Reduce the tolerance of `solver`, whose residual exceeds its bound by the factor `excess`.

    Return False, without any change, if the tolerance is already as small as round-off permits.
    """
    tolerance = max(solver.tolerance * REDUCTION / excess, SUM_ROUND_OFF)
    if not tolerance < solver.tolerance:
        return False
    log.info(
        "linear solver: out-of-balance forces are %.1e times the bound; the tolerance is reduced from %.1e to %.1e",
        excess, solver.tolerance, tolerance,
    )  # fmt: skip
    solver.original_tolerance = solver.original_tolerance or solver.tolerance
    solver.tolerance = tolerance
    return True


def restore_tolerance(solver: LinearSolver, snapshot: Mapping[str, Any]) -> None:
    """Restore the tolerance that `solver` had at the time of a `snapshot`, see `linear.protocol.LinearSolver`."""
    requested = solver.original_tolerance or solver.tolerance
    solver.tolerance = snapshot.get("tolerance", requested)
    solver.original_tolerance = None if solver.tolerance == requested else requested
