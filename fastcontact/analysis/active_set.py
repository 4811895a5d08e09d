"""Primal-dual active set method for frictionless contact.

With the stiffness matrix K, displacements u, external forces f, and the matrix B of the constraints, the problem is
``K u = f + B.T multiplier`` with ``multiplier >= 0``, ``gap >= 0`` and ``multiplier * gap = 0`` for each constraint. The
gap is ``gap0 + B u + C multiplier``. C is the compliance of the constraints themselves, symmetric and positive
semidefinite; it is zero in most formulations.

The primal-dual active set method (Hintermueller, Ito and Kunisch, 2003) changes the status of all constraints with wrong
signs at once. It usually converges after a few linear solutions, but active sets may recur. If the constraints are linearly
independent, ``B K^-1 B.T + C`` is symmetric positive definite, and the linear complementarity problem has a P-matrix.
When a set recurs, the method therefore continues with the least-index rule: it changes only the constraint with the lowest
number among those with wrong signs. No set is then repeated, and the method terminates (Murty, 1974).

An iterative linear solver need not converge for a set that will change anyway. The solver is therefore monitored, and
stopped as soon as gaps or multipliers with wrong signs exceed the error that is estimated from its residual. The method still
terminates, because each constraint changes in this way at most once: a second change would contradict the first, which
shows that the error is larger than estimated. A set is accepted as final only if the linear solution has converged.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.sparse import csr_array

from fastcontact.analysis.solution import Accuracy, Response, Solution, response
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.linear.delassus import lu_solver
from fastcontact.linear.protocol import Loaded


def solve(
    loaded: Loaded, constraints: Constraints, active: Mask, accuracy: Accuracy, guess: Array | None = None
) -> Solution:
    """Return the displacements and the contact forces that satisfy all inequalities.

    Parameters
    ----------
    loaded : Loaded
        Prepared matrix K (n, n) [force / length] with the right-hand side f (n,) [force].
    constraints : Constraints
        The m constraints in the n unknowns of the solver. A constraint whose row of B is empty cannot become active.
    active : ndarray of bool (m,)
        Initial active set.
    accuracy : Accuracy
        Tolerances of gaps and multipliers, and the largest number of iterations.
    guess : ndarray (n,), optional
        Initial guess of the unknowns, for iterative solvers [length].

    Returns
    -------
    Solution
        The solution; not `settled` if the active set still changes after ``accuracy.max_iterations`` iterations.
    """
    equations = constraints.usable & constraints.equality
    active = (active & constraints.usable) | equations
    earlier_sets: set[bytes] = set()
    changed = np.zeros(len(active), bool)  # constraints that a monitored, unconverged solution has changed
    least_index, iteration, next_active = False, 1, None

    def monitor(u: Array, forces: Array, error: float) -> bool:
        """Return whether the unconverged solution, of relative `error`, shows that another active set is needed.

        A set that would undo an earlier change of one of the constraints `changed` is ignored.
        """
        nonlocal next_active
        estimate = _with_next_set(constraints, accuracy, equations, u, forces, active, error)
        changes_again = (estimate.next_active != active) & changed
        next_active = None if estimate.settled or changes_again.any() else estimate.next_active
        return next_active is not None

    while True:
        rows, next_active = np.flatnonzero(active), None
        C = constraints.normal_compliance_operator(rows)
        nodes = None if constraints.nodes is None else constraints.nodes[rows]
        B, values = constraints.B[rows], -constraints.gap0[rows]
        u, forces = loaded.solve(B, values, C, guess, monitor, accuracy.residual, nodes)
        guess = u
        if next_active is not None:
            changed |= active != next_active
            active = next_active
            continue
        solution = _with_next_set(constraints, accuracy, equations, u, forces, active)
        if solution.settled or iteration == accuracy.max_iterations:
            return replace(solution, iterations=iteration, response=partial(_response, loaded, B, rows, constraints))
        earlier_sets.add(active.tobytes())
        least_index = least_index or solution.next_active.tobytes() in earlier_sets
        if least_index:
            lowest = np.flatnonzero(active != solution.next_active)[0]
            solution.next_active[:lowest], solution.next_active[lowest + 1 :] = active[:lowest], active[lowest + 1 :]
        active = solution.next_active
        iteration += 1


def _response(loaded: Loaded, B: csr_array, rows: Indices, constraints: Constraints) -> Response:
    """Return the linear response to additional forces and gaps, while the constraints `rows` (q,) stay active.

    `B` (q, n) contains the rows of these constraints.
    """
    F, C = loaded.delassus(B)[1], constraints.normal_compliance(rows)
    if C is not None:
        F = F + (np.diag(C) if C.ndim == 1 else C)
    solve_dense = lu_solver(F) if len(rows) else np.zeros_like
    return response(loaded, B, rows, lambda gaps: -solve_dense(gaps))


def _with_next_set(
    constraints: Constraints, accuracy: Accuracy, equations: Mask, u: Array, forces: Array, active: Mask, error: float = 0.0
) -> Solution:  # fmt: skip
    """Return the solution with the next active set, which follows from the signs of gaps and multipliers.

    Parameters
    ----------
    constraints : Constraints
    accuracy : Accuracy
    equations : ndarray of bool (m,)
        Constraints that are equations, which are always active.
    u : ndarray (n,)
        Unknowns [length].
    forces : ndarray (q,)
        Multipliers of the q active constraints [force].
    active : ndarray of bool (m,)
        Active set of the solution.
    error : float
        Relative error of an unconverged solution; signs of values within this error are ignored [-].
    """
    multiplier = np.zeros(len(active))
    multiplier[active] = forces
    gap = constraints.gap0 + constraints.B @ u + constraints.elastic_gaps(multiplier)
    tension_bound = max(accuracy.multiplier, error) * np.abs(forces).max(initial=0.0)
    gap_bound = max(accuracy.gap, error * np.abs(u).max(initial=0.0)) if error else accuracy.gap
    next_active = np.where(active, multiplier > -tension_bound, gap < -gap_bound) & constraints.usable | equations
    return Solution.frictionless(u, multiplier, gap, active, next_active)
