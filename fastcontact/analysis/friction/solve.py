"""Solve unilateral contact with Coulomb friction for fixed contact geometry.

The unknowns are the normal forces n >= 0 and the tangential forces t of all constraints. The gaps g and the slips s of the
load step are ``(g, s) = free + F (n, t)``, where `free` are their values without contact forces. The Delassus operator is
``F = R K^-1 R.T + C``, where K is the stiffness matrix, R contains the derivatives of gaps and slips with respect to the
displacements, and C is the compliance of the constraints themselves. `dense` solves this problem: the slip of a
sticking constraint is zero, and the force of a sliding constraint lies on the friction cone. The problem is regularised only
if slips are linearly dependent. If the linear solver can eliminate constraints, `eliminated` is tried first. It solves the
same problem without forming F.
"""

from __future__ import annotations

import logging
from functools import partial

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._tools.records import record, replace
from fastcontact.analysis.friction import delassus, dense, eliminated
from fastcontact.analysis.friction.cone_newton import SLIP_COMPLIANCE, Law, aligning_rotation, held_tangents, rotated
from fastcontact.analysis.friction.delassus import Delassus
from fastcontact.analysis.solution import (
    Accuracy,
    FrictionSolution,
    LastIncrement,
    LoadPath,
    Response,
    Solution,
    in_increments,
    response,
)
from fastcontact.arrays import Array, Indices, Mask, largest, numbers_at, scattered
from fastcontact.contact.constraints import Constraints
from fastcontact.errors import ConvergenceError
from fastcontact.linear.delassus import lu_solver
from fastcontact.linear.protocol import Loaded, LoadedNonsymmetric

log = logging.getLogger("fastcontact")


def solve(
    loaded: Loaded, constraints: Constraints, closed: Mask, accuracy: Accuracy, u: Array,
    guess: Solution | None = None, path: LoadPath | None = None,
) -> Solution:  # fmt: skip
    """Return the displacements and the contact forces that satisfy unilateral contact and Coulomb's law.

    Each constraint in F costs columns of the inverse stiffness matrix. The solution therefore starts with the constraints
    `closed`, and others are added if they penetrate. Constraints that are never added are open and free of forces,
    so that the result is that of the complete problem.

    Parameters
    ----------
    loaded : Loaded
        Prepared matrix K (n, n) with a right-hand side.
    constraints : Constraints
        The m constraints in the n unknowns of the solver. `Constraints.slip0` (k, m) is the slip if all unknowns are zero,
        minus the slip at the beginning of the step [length].
    closed : ndarray of bool (m,)
        Constraints that are assumed closed and sticking at the start.
    accuracy : Accuracy
        Tolerances and limits.
    u : ndarray (n,)
        Initial guess of iterative solvers, and values of the unknowns that constraints do not involve, see
        `Loaded.involved_solution` [length].
    guess : Solution, optional
        Solution of a similar problem, from whose forces to start; ignored if its number of constraints is different.
    path : LoadPath, optional
        Data at the beginning of the step, if it is solved in increments along the load path.
    """
    forces = None if guess is None else guess.forces_along(constraints.directions, len(constraints))
    if isinstance(loaded, LoadedNonsymmetric) and not constraints.coupled:
        solution = _eliminated(loaded, constraints, closed, accuracy, u, forces, path)
        if solution is not None:
            return solution
        log.info("friction: the iteration on eliminated constraints did not converge; the compliance is formed instead")
    usable, iterations = constraints.usable, 0
    initial = closed | constraints.equality | (False if path is None else ~path.waiting)
    included = usable & initial
    while True:
        solution = _with_included(np.flatnonzero(included), loaded, constraints, closed, u, forces, path)
        solution.gap[~usable], solution.slip[~usable] = np.inf, 0.0
        iterations += solution.iterations
        missing = usable & ~included & (solution.gap < 0.0)
        if not missing.any():
            return replace(solution, iterations=iterations)
        included = included | missing


def _eliminated(
    loaded: LoadedNonsymmetric, constraints: Constraints, closed: Mask, accuracy: Accuracy, u: Array, forces: Array | None,
    path: LoadPath | None,
) -> Solution | None:  # fmt: skip
    """Return the solution by `eliminated`, without the Delassus operator; None if this fails. Parameters as in `solve`."""
    usable, all_rows, last_increment = constraints.usable, np.arange(len(constraints)), None

    def solve_eliminated(constraints: Constraints, closed: Mask, forces: Array | None) -> FrictionSolution:
        nonlocal u
        u, result = eliminated.solve(loaded, constraints, closed & usable, accuracy, u, forces)
        result.gaps[:, ~usable] = 0.0
        return result

    def increment(offset: Array, carrying: Mask, closed: Mask, forces: Array | None) -> FrictionSolution:
        gaps = constraints.gaps_at_rest() + offset
        gaps[0, ~carrying] += distance
        shifted_constraints = replace(constraints, gap0=gaps[0], slip0=gaps[1:], elastic_slip=np.empty(0))
        result = solve_eliminated(shifted_constraints, closed, forces)
        result.gaps[0, ~carrying] -= distance
        return result

    try:
        if path is None:
            result = solve_eliminated(constraints, closed, forces)
        else:
            y, closing = path.along(constraints.directions, all_rows)
            u_end = loaded.full_solution(constraints.force(y[0], y[1:].T))
            at_end = np.stack([R @ u_end for R in (constraints.B, *constraints.tangents)])
            initial_offset = -constraints.gaps_at_rest() - at_end - constraints.softness * y
            initial_offset[0] += path.gap
            initial_offset = np.where(usable, initial_offset, 0.0)
            distance = 4.0 * largest(initial_offset[0])  # further than constraints can close
            result, gaps, before = in_increments(initial_offset, closing, y, path, all_rows, increment)
            result, last_increment = replace(result, gaps=gaps), _last_increment(before, None, all_rows, constraints)
    except ConvergenceError:
        return None
    gap, active = np.where(usable, result.gaps[0], np.inf), result.closed & usable
    return Solution(
        u, result.y[0], gap, active, active, result.settled, result.iterations, result.y[1:].T, result.gaps[1:].T,
        result.sticking, result.residual, constraints.directions, last_increment=last_increment,
    )  # fmt: skip


def _with_included(
    rows: Indices, loaded: Loaded, constraints: Constraints, closed: Mask, u: Array, forces: Array | None,
    path: LoadPath | None,
) -> Solution:  # fmt: skip
    """Return the solution with only the included constraints, numbered `rows` (q,), by the Delassus operator.

    The gaps and slips of the other constraints follow from the displacements. The other parameters are those of `solve`, with
    initial `forces` (1 + k, m) or None [force].
    """
    k, m = len(constraints.tangents), len(constraints)
    frictional = np.stack(constraints.directions)[:, rows].any(axis=(0, 2))
    components = np.flatnonzero(np.vstack([np.ones_like(frictional), *k * [frictional]]))
    all_rows = csr_array(vstack([constraints.B, *constraints.tangents], format="csr"))
    row_numbers = (np.arange(1 + k)[:, None] * m + rows).ravel()[components]
    R = all_rows[row_numbers]
    problem, last_increment = _included_problem(loaded, constraints, rows, R, components), None
    if path is None:
        guess = None if forces is None else rotated(problem.Q, forces[:, rows])
        result = dense.solve(problem.F, problem.free, problem.mu, closed[rows], guess, problem.equality, components)
        gaps_of_included = result.gaps
    else:
        y0, closing = (rotated(problem.Q, values) for values in path.along(constraints.directions, rows))
        result, gaps_of_included, before = problem.in_increments(y0, closing, path, rows)
        last_increment = _last_increment(before, problem.Q, rows, constraints)
    y = rotated(problem.Q, result.y, back=True)
    u = loaded.involved_solution(R.T @ y.ravel()[components], u)
    all_forces, (active, sticking) = np.zeros((1 + k, m)), np.zeros((2, m), bool)
    gaps = constraints.gaps_at_rest() + (all_rows @ u).reshape(1 + k, m)
    all_forces[:, rows] = y
    if constraints.coupled:
        gaps += constraints.coupled_gaps(all_forces)
    gaps[:, rows] = rotated(problem.Q, gaps_of_included, back=True)
    active[rows], sticking[rows] = result.closed, result.sticking
    return Solution(
        u, all_forces[0], gaps[0], active, active, result.settled, result.iterations, all_forces[1:].T, gaps[1:].T,
        sticking, result.residual, constraints.directions, last_increment=last_increment,
        response=partial(problem.response, loaded, R, row_numbers, result),
    )  # fmt: skip


@record
class _IncludedProblem:
    """Contact problem of q constraints with friction, in terms of their Delassus operator, with rotated tangents.

    Attributes
    ----------
    F : Delassus (n, n)
        Delassus operator, including the compliance of the constraints. It has no rows for the slips of constraints whose
        pair has no friction; the slips along held tangents are decoupled from all other components.
    free : ndarray (1 + k, q)
        Gaps and slips without contact forces [length].
    mu : ndarray (q,)
        Coefficients of friction [-].
    equality : ndarray of bool (q,)
        Constraints that are equations.
    components : ndarray of int (n,)
        Positions, in arrays (1 + k, q), of the components that belong to F.
    held_slips : ndarray of bool (k, q)
        Tangents along which supports prevent slip.
    Q : csr_array, optional
        Rotation of the tangents, see `aligning_rotation`.
    """

    F: Delassus
    free: Array
    mu: Array
    equality: Mask
    components: Indices
    held_slips: Mask
    Q: csr_array | None

    def _gap_changes(self, y: Array) -> Array:
        """Return the changes of the gaps and slips (1 + k, q) due to forces y (1 + k, q)."""
        return scattered(self.F @ y.ravel()[self.components], self.components, y.shape)

    def in_increments(
        self, y0: Array, closing: Array, path: LoadPath, rows: Indices
    ) -> tuple[FrictionSolution, Array, tuple[Array, Array, Array]]:
        """Return the solution along the load path, see `solution.in_increments`.

        `y0` and `closing` (1 + k, q) are those of `LoadPath.along`, rotated by Q.
        """
        y0[1:][self.held_slips], closing[1:][self.held_slips] = 0.0, 0.0
        initial_offset = -self.free - self._gap_changes(y0)
        initial_offset[0] += closing[0]
        return in_increments(initial_offset, closing, y0, path, rows, self._increment)

    def _increment(self, offset: Array, carrying: Mask, closed: Mask, start: Array | None) -> FrictionSolution:
        """See `solution.IncrementSolver`."""
        gaps, rows = self.free + offset, np.flatnonzero(carrying)
        number = numbers_at(self.components, gaps.shape)[:, rows]
        components = np.flatnonzero(number >= 0)
        F, start = self.F.submatrix(number.ravel()[components]), None if start is None else start[:, rows]
        result = dense.solve(F, gaps[:, rows], self.mu[rows], closed[rows], start, self.equality[rows], components)
        y, (closed, sticking) = np.zeros_like(gaps), np.zeros((2, len(carrying)), bool)
        y[:, rows], closed[rows], sticking[rows] = result.y, result.closed, result.sticking
        return replace(result, y=y, gaps=gaps + self._gap_changes(y), closed=closed, sticking=sticking)

    def response(self, loaded: Loaded, R: csr_array, row_numbers: Indices, result: FrictionSolution) -> Response:
        """Return the `Response` of the solution `result`; for R (n, n_unknowns) and `row_numbers` see `solution.response`."""
        if not result.closed.any():
            return response(loaded, R, row_numbers, np.zeros_like)
        # Constraints that are equations have no friction.
        law, sticking = Law(np.where(self.equality, 0.0, self.mu), self.equality), result.sticking & ~self.equality
        unit, components = dense.units_of_force(self.F, len(self.mu)), self.components
        F, y, gaps = self.F.scaled(unit[components % len(unit)]), result.y / unit, result.gaps * unit
        equations = dense.linearised_equations(law, F, y, gaps, result.closed, sticking, components)
        solve_dense = lu_solver(equations.A)
        Q = None if self.Q is None else csr_array(self.Q[components][:, components])

        def forces_of(gaps: Array) -> Array:
            values = scattered(gaps if Q is None else Q @ gaps, components, result.y.shape) * unit
            values[1:][self.held_slips] = 0.0  # slips along held tangents do not vary
            change = (equations.forces(values, solve_dense) * unit).ravel()[components]
            return change if Q is None else np.asarray(Q.T @ change)

        return response(loaded, R, row_numbers, forces_of)


def _included_problem(
    loaded: Loaded, constraints: Constraints, rows: Indices, R: csr_array, components: Indices
) -> _IncludedProblem:
    """Return the problem of the constraints `rows` (q,), where R (n, n_unknowns) are the derivatives of the `components`."""
    k, q = len(constraints.tangents), len(rows)
    rigid_compliance = loaded.rigid_compliance(R)
    # The compliance of soft springs is so large that the factored form would not be accurate.
    factored = k == 2 and constraints.compliance is not None and not np.any(rigid_compliance)
    free, F = delassus.of_rows(loaded, R, factored)
    number = numbers_at(components, (1 + k, q))
    # This compliance is added before held tangents are detected, since compliant tangents are not held.
    F = replace(F, d=F.d + np.append(np.zeros(q), constraints.softness[1:, rows])[components])
    Q = aligning_rotation(F.diagonal_blocks(number)) if k == 2 else None
    Q_F = None if Q is None else csr_array(Q[components][:, components])
    C = F.rotated(Q_F).diagonal_blocks(number)
    C[0, 0] += np.where(constraints.prescribed, constraints.softness[0], 0.0)[rows]
    held_slips = held_tangents(C) & (number[1:] >= 0)
    F = delassus.with_compliance(F, constraints, rows, components)
    if not factored:
        F = replace(F, S=F.S + rigid_compliance)
    F = F.rotated(Q_F)
    free = rotated(Q, scattered(free, components, number.shape) + constraints.gaps_at_rest()[:, rows])
    if held_slips.any():
        prescribed = held_slips & constraints.imposes_slip(rows, Q)
        values = np.where(prescribed, SLIP_COMPLIANCE * C[0, 0], F.diagonal().max())[held_slips]
        F = F.decoupled(number[1:][held_slips], values)
        free[1:][held_slips & ~prescribed] = 0.0
    return _IncludedProblem(F, free, constraints.friction[rows], constraints.equality[rows], components, held_slips, Q)


def _last_increment(
    before: tuple[Array, Array, Array], Q: csr_array | None, rows: Indices, constraints: Constraints
) -> LastIncrement:
    """Return the data at the beginning of the last increment, for all constraints.

    Parameters
    ----------
    before : tuple
        The data that `in_increments` returns, of q constraints.
    Q : csr_array, optional
        Rotation of the tangents, which is undone.
    rows : ndarray of int (q,)
        Numbers of these constraints.
    constraints : Constraints
        All m constraints.
    """
    components, work, normal = before
    no_gaps = np.zeros((1, len(rows)))
    along_tangents = np.stack([rotated(Q, np.vstack([no_gaps, along]), back=True)[1:] for along in components])
    m, dim = constraints.positions.shape
    vectors = np.zeros((4, m, dim))
    vectors[:, rows] = np.einsum("pkm,kmd->pmd", along_tangents, np.stack(constraints.directions)[:, rows])
    slip, slip_before_closing, traction, missing = vectors
    of_constraints = (scattered(values, rows, m) for values in (work, normal))
    return LastIncrement(slip, slip_before_closing, traction, missing, *of_constraints)
