"""Iterate the contact geometry of a load step: pair the surfaces, solve, and accelerate, until displacements converge.

With the pairing at displacements u the contact problem has a solution S(u), and the load step requires u = S(u). Newton's
method solves

    v = S(u) - u + S'(u) v

for the change v of the displacements, see `newton_step`. The last term is the response of the solution, with fixed active
set, to the variation of forces and gaps with the geometry along v, see `contact.linearised_geometry`. Its norm is usually at
most a third of that of v, so that a few iterations of GMRES suffice, each at the cost of a back substitution. Slips and
integrals over facets are linearised at the displacements S(u) or between u and S(u), all other terms at u; the difference is
of second order.
"""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.linalg import LinAlgError
from scipy.sparse.linalg import LinearOperator, gmres

from fastcontact._tools.records import record, replace
from fastcontact.analysis.anderson import DEPTH, Anderson
from fastcontact.analysis.convergence_messages import active_set_cycles, geometry_not_converged
from fastcontact.analysis.criteria import HALVINGS, NOTABLE
from fastcontact.analysis.friction_increments import FrictionIncrements
from fastcontact.analysis.inequalities import Iterate, StepContext, initially_active, pair_surfaces, solve_inequalities
from fastcontact.analysis.shared_nodes import SharedNodes
from fastcontact.analysis.solution import Accuracy, Solution
from fastcontact.analysis.tolerances import DECLINE, RESIDUAL, WINDOW, ScatterWindow, Tolerances
from fastcontact.arrays import Array, largest, scattered
from fastcontact.contact.constraints import Constraints, Linearised, StackedConstraints
from fastcontact.errors import ConvergenceError
from fastcontact.round_off import SINGLE_PRECISION

log = logging.getLogger("fastcontact")
# Smallest number of pairings after which edges of facets are rounded, because pairings are assumed to alternate. It matters
# if `max_geometry_updates` is less than twice as large; without rounding, `test_equilibrium_is_found_in_space` fails.
UPDATES_BEFORE_ROUNDING = 25
# Safety factor for the contraction of changes by the next solution, which is estimated from the last Newton step. With 0.03,
# steps are omitted too early: random models 9 and 14 take 4 pairings (2 with 3).
SAFETY = 3.0


@record
class SettledContact:
    """The contact solution of a load step, with converged geometry.

    Attributes
    ----------
    constraints : StackedConstraints
        Constraints of the last pairing.
    solution : Solution
    iterate : Iterate
    last_change : (int, float), optional
        If the number of updates is fixed, this number and the relative change of the displacements in the last update.
    scatter : dict, optional
        Scatter of the last iterates, see `ScatterWindow.add`, if round-off prevents convergence to `Criteria.geometry`.
    nodes : SharedNodes, optional
        Nodes of several pairs, or at both ends of a period, whose constraints are merged.
    paired_at : ndarray (k,), optional
        Displacements at the last pairing, in the components `Problem.contact_dofs` [length].
    """

    constraints: StackedConstraints
    solution: Solution
    iterate: Iterate
    last_change: tuple[int, float] | None = None
    scatter: dict[str, float] | None = None
    nodes: SharedNodes | None = None
    paired_at: Array | None = None

    @cached_property
    def parts(self) -> dict[str, tuple[Constraints, Solution]]:
        """Constraints and solution of each contact pair."""
        parts, rows = self.constraints.parts, self.constraints.rows
        return {name: (part, self.solution.part(rows[name], part)) for name, part in parts.items()}

    @property
    def force(self) -> Array:
        """Nodal contact forces (n_dofs,) [force]."""
        return self.constraints.force(self.solution.multiplier, self.solution.tangential)


def settle_geometry(step: StepContext, iterate: Iterate, paired: SettledContact | None = None) -> SettledContact | None:
    """Alternate between pairing the surfaces and solving the contact problem until the displacements converge.

    The result is None without contact pairs.

    Parameters
    ----------
    step : StepContext
    iterate : Iterate
        Initial iterate, or the converged iterate of a less accurate iteration of the same step. It is modified.
    paired : SettledContact, optional
        Contact solution at almost the same displacements in this step, whose last pairing is used as the first.

    Raises
    ------
    ConvergenceError
        If the active set or the geometry does not converge.
    """
    problem, u, bodies = step.problem, iterate.u, step.problem.floating_bodies
    if not problem.pairs:
        return None
    lift = step.load.lift if bodies is None else step.load.lift + bodies.rigid(u[bodies.dofs])
    condensed_unknowns = problem.system.unknowns(u, lift)
    condensed_unknowns[problem.dofs.unknowns] = 0.0
    step = replace(step, loaded=step.loaded.condensed(), condensed_size=largest(condensed_unknowns))
    increments = FrictionIncrements(step)
    try:
        settled = _settle(step, iterate, increments, paired if step.linearises_contact else None)
    except ConvergenceError as error:
        error.history = error.history or iterate.history
        raise
    if settled.nodes is None:
        return settled
    solution = settled.nodes.with_distributed_forces(settled.solution, settled.constraints, iterate.u)
    return replace(settled, solution=solution)


def _settle(
    step: StepContext, iterate: Iterate, increments: FrictionIncrements, paired: SettledContact | None = None
) -> SettledContact:
    """Return the result of `settle_geometry` before nodes in several pairs share their forces; `iterate` is modified."""
    problem, criteria, solver = step.problem, step.problem.criteria, step.problem.solver
    limit = criteria.max_geometry_updates if problem.until_settled else criteria.geometry_updates or 0
    # From a converged iterate, the loop continues without extrapolation and with accurate solutions.
    extrapolates = problem.until_settled and solver.iterative and not iterate.history
    residual = solver.tolerance
    if extrapolates:
        residual = max(residual, RESIDUAL * NOTABLE if step.state.extrapolation.ratio else NOTABLE)
        iterate.u = step.state.extrapolation.predicted(iterate.u, degree=1)
    tolerances = Tolerances(solver, criteria, residual, step.state.gap_round_off, step.expected)
    mixing, window, lift_size = _Mixing(step, step.linearises_contact), ScatterWindow(), largest(step.load.lift)
    for update in range(limit + 1):
        if update == 0 and paired is not None and paired.paired_at is not None:
            iterate.u[problem.contact_dofs], constraints = paired.paired_at, paired.constraints
        else:
            constraints = pair_surfaces(problem, step.state, step.load, iterate)
        extrapolation = step.state.extrapolation if extrapolates and update == 0 else None
        active = initially_active(constraints, iterate, extrapolation)
        accuracy = tolerances.accuracy(lift_size + largest(iterate.u))
        # Constraints of several pairs, or of both ends of a period, may be at one node.
        ends = problem.model.periodic_interfaces
        nodes = SharedNodes.of(constraints, ends) if len(problem.pairs) > 1 or ends else None
        merged = constraints if nodes is None else nodes.merged_constraints(constraints)
        closed = active if nodes is None else nodes.summed(active) > 0.0
        step_on_path = increments.with_path(step, constraints, iterate.u, nodes)
        if increments.unfinished:
            accuracy = Accuracy(0.0, residual=solver.tolerance)
        solution, displacement = solve_inequalities(step_on_path, merged, iterate, closed & merged.usable, accuracy)
        if increments.unfinished:
            if not solution.settled:
                raise ConvergenceError("an increment does not converge", iterate.history)
            step = replace(step, path=solution.last_increment)
            mixing, window = _Mixing(step, step.linearises_contact), ScatterWindow()
        before = iterate.u[problem.dofs.active]
        change = largest(displacement - before)
        # The unknowns of the solution do not include rigid-body motions of floating bodies, which may be much larger.
        size = max(step.condensed_size, largest(solution.u), lift_size)
        relative_change = change / size if size and change > step.state.gap_round_off else 0.0
        iterate.u[problem.dofs.active] = displacement
        _store_solution(iterate, constraints, solution, relative_change)
        if not (solution.settled or accuracy.inexact):
            text = active_set_cycles(problem, constraints, solution, iterate.history)
            raise ConvergenceError(text, iterate.history)
        if not problem.until_settled:
            continue
        # A factorisation may have replaced an iterative solver, whose errors are about the tolerance times the contrast of
        # cells. Smaller changes are not significant.
        inexact, contrast = accuracy.inexact and solver.iterative, solver.contrast if solver.iterative else 1.0
        tolerance = max(max(criteria.geometry, solver.tolerance * contrast) * size, step.state.gap_round_off)
        if not inexact:
            increments.update(constraints, solution, change - tolerance, size, iterate.u)
        settled = SettledContact(constraints, solution, iterate, nodes=nodes, paired_at=before[problem.dofs.contact])
        is_exact = solution.settled and not inexact
        if is_exact and change <= tolerance and not (increments.due or increments.unfinished):
            return settled
        if not (is_exact and change <= SINGLE_PRECISION * size):
            window = ScatterWindow()
        elif scatter := window.add(displacement, settled.force, change, size, mixing.contraction):
            log.info(
                "the contact geometry settled as far as round-off allows: displacements scatter by %.1e of the largest one, "
                "contact forces by %.1e (Criteria.geometry = %g)", *scatter.values(), problem.criteria.geometry,
            )  # fmt: skip
            return replace(settled, scatter=scatter)
        iterate.u[problem.dofs.active] = mixing.next(settled, before, displacement, tolerance, inexact)
        tolerances.tighten(relative_change, solution.residual)
        stagnates = constraints.branches is None and _stagnates(iterate.history[-WINDOW:])
        is_slow = not iterate.rounded and (update >= max(limit // 2, UPDATES_BEFORE_ROUNDING) or stagnates)
        if is_slow and any(pair.may_alternate(constraints.parts[name]) for name, pair in problem.pairs.items()):
            log.info("pairings alternate: edges of facets are now rounded, and small overlaps carry no constraint")
            iterate.rounded = True
            mixing.accelerated, window = None, ScatterWindow()
    if problem.until_settled:
        changes = scattered(displacement - before, problem.dofs.active, len(iterate.u))
        raise ConvergenceError(geometry_not_converged(problem, iterate.history, changes, limit), iterate.history)
    increments.update(constraints, solution, 0.0, 0.0, iterate.u)
    if increments.due or increments.unfinished:
        del iterate.history[-limit - 1 :]
        return _settle(step, iterate, increments)
    last_change = (limit, relative_change) if limit and not criteria.keep_pairing else None
    return SettledContact(constraints, solution, iterate, last_change, nodes=nodes)


def _stagnates(history: Sequence[dict[str, Any]]) -> bool:
    """Return whether the changes of the displacements in the last pairings in the `history` are of about the same size."""
    changes = [entry["displacement_change"] for entry in history]
    return len(changes) == WINDOW and min(changes) > DECLINE**2 * max(changes)


def _store_solution(
    iterate: Iterate, constraints: StackedConstraints, solution: Solution, relative_change: float
) -> None:
    """Store the active sets and the pressures of a solution, and append its data to the history.

    `relative_change` is the change of the displacements relative to the largest one, zero if it is round-off [-].
    """
    for name, rows in constraints.rows.items():
        iterate.active[name] = solution.next_active[rows]
        forces = constraints.parts[name].contact_forces(solution.multiplier[rows])
        iterate.pressure[name] = constraints.parts[name].pressure(forces)  # without fluid pressure
    entry = {"displacement_change": relative_change, "active": int(solution.active.sum())}
    entry |= {"active_set_iterations": solution.iterations, "settled": solution.settled}
    iterate.history.append(entry | ({"rounded": True} if iterate.rounded else {}))


@dataclass(eq=False, repr=False)
class _Mixing:
    """Computation of the next iterate: by Newton's method while it converges, otherwise by Anderson acceleration.

    Anderson acceleration uses only iterates with the same active set, between which the geometry varies smoothly, unless
    active sets alternate, because each of them then results from the geometry of the other.

    Attributes
    ----------
    step : StepContext
    uses_newton : bool
        Whether Newton's method is applied.
    accelerated : Anderson, optional
        Anderson acceleration with the earlier iterates that it uses; None to discard them.
    contraction : float
        Factor by which a solution contracts changes of the geometry, from the last Newton step; infinite if unknown [-].
    """

    step: StepContext
    uses_newton: bool
    accelerated: Anderson | None = None
    contraction: float = np.inf
    _last_change: float = np.inf
    # Active set and branches of the last solution, those of all earlier ones, and whether they alternate.
    _last_state: bytes = b""
    _earlier_states: set[bytes] = field(default_factory=set)
    _cycles: bool = False
    # With cohesive layers: start of the last Newton step, the step, the slope at its start, and the fraction taken.
    _line: tuple[Array, Array, float, float] | None = None

    def next(
        self, settled: SettledContact, before: Array, displacement: Array, tolerance: float, inexact: bool
    ) -> Array:
        """Return the displacements (k,) for the next pairing, of the components of `Problem.dofs` [length].

        The last pairing was at the displacements `before` (k,), and its solution has the displacements `displacement` (k,),
        which are returned after an `inexact` solution. The geometry has converged if changes are below `tolerance` [length].
        Newton's method is abandoned once changes increase, because it does not converge if nodes alternate between facets.
        With cohesive layers, its steps are shortened instead. It is also omitted if the next solution alone is expected to
        converge, because a solution without a Newton step is cheaper.
        """
        solution, change = settled.solution, largest(displacement - before)
        if self._line is not None:
            shortened = self._shortened_step(before, displacement, *self._line)
            if shortened is not None:
                return shortened
        branches = settled.constraints.branches
        # While this state is constant, the solution depends smoothly on the geometry.
        state = solution.active.tobytes() + (b"" if branches is None else branches.tobytes())
        same_state = self._last_state == state
        converges = self.uses_newton and change <= self._last_change
        self.uses_newton = converges or (branches is not None and (same_state or self._line is not None))
        if branches is not None and change > SAFETY * self.contraction * self._last_change:
            self.contraction = np.inf  # it was determined with other branches
        self._line, self._last_change = None, change
        if self.uses_newton and solution.settled and SAFETY * self.contraction * change > tolerance:
            newton_result = newton_step(self.step, settled, before, displacement, tolerance / change)
            if newton_result is not None:
                next_pairing, self.contraction = newton_result
                if branches is None:
                    return next_pairing
                self._last_state, step = state, next_pairing - before
                if (slope := float(step @ (displacement - before))) > 0.0:
                    self._line = before, step, slope, 1.0
                    return next_pairing
                self.accelerated = None  # the step would increase the energy, which the solution decreases
                return displacement
        self._cycles |= not (same_state or self.uses_newton) and state in self._earlier_states
        self._last_state = state if solution.settled else b""
        self._earlier_states.add(self._last_state)
        if inexact or not (same_state or self._cycles or settled.iterate.rounded):
            self.accelerated = None
        if inexact:
            return displacement
        if self.accelerated is None:
            problem = self.step.problem
            self.accelerated = Anderson(DEPTH, problem.dofs.contact, problem.solver.iterative)
        return self.accelerated.mixed(before, displacement)

    def _shortened_step(
        self, before: Array, image: Array, start: Array, step: Array, slope: float, fraction: float
    ) -> Array | None:
        """Return the end (k,) of a shorter Newton step if the last one, which ends at `before` (k,), is too long, else None.

        Where cohesive layers soften, a step that is too long increases the energy. The derivative of the energy along the
        step has the opposite sign of the product of the step with the change to the solution, `image` (k,). `start` (k,),
        `slope` and `fraction` describe the last step, see `_line`.
        """
        end_slope = float(step @ (image - before))
        # A minimum along the step lies between its start and its end. The secant of the slopes is limited to between a tenth
        # and a half of the step (Dennis and Schnabel, 1983, section 6.3.2).
        if end_slope >= -0.5 * slope or fraction <= 2.0**-HALVINGS:
            return None
        fraction *= min(max(slope / (slope - end_slope), 0.1), 0.5)
        self._line = start, step, slope, fraction
        return start + fraction * step


def newton_step(
    step: StepContext, settled: SettledContact, before: Array, image: Array, accuracy: float
) -> tuple[Array, float] | None:
    """Return the active displacements (k,) of the next pairing [length] and an estimate of the norm of S' [-].

    The result is None if the solution has no derivatives, or if the step is unreliable.

    Parameters
    ----------
    step : StepContext
    settled : SettledContact
        The last pairing and its solution, where representatives replace the constraints of shared nodes.
    before, image : ndarray (k,)
        Active displacements of the pairing and of the solution [length]. Components without contact or springs are taken from
        `image`.
    accuracy : float
        Sufficient relative accuracy of the change [-].
    """
    constraints, solution, nodes = settled.constraints, settled.solution, settled.nodes
    u, dofs = step.state.u.copy(), step.problem.dofs
    u[dofs.active] = image
    displacement = step.problem.displacement(u)
    if nodes is not None:
        solution = nodes.with_distributed_forces(solution, constraints, u)
    if solution.response is None or not (geometries := linearised_pairs(constraints, solution, displacement)):
        return None
    try:
        respond = solution.response()
    except LinAlgError:
        return None
    contact, gaps = dofs.contact, np.zeros((1 + len(constraints.tangents), len(constraints)))
    motion, force = np.zeros((2, len(u)))
    nodal_motion = step.problem.displacement(motion)  # a view

    def response_along(v: Array) -> Array:
        """Return the active components (k,) of ``S'(u) v`` for changes v of the components on which contact depends."""
        motion[step.problem.contact_dofs], force[:] = v, 0.0
        for name, geometry in geometries.items():
            forces, slips = geometry.derivatives_along(nodal_motion)
            gaps[: len(slips), constraints.rows[name]] = slips
            force[: forces.size] += forces.ravel()
        merged = gaps if nodes is None else nodes.merged_gaps(gaps)
        return np.asarray(dofs.T @ respond(dofs.transpose @ force[dofs.active], merged))

    changes = (image - before)[contact]
    largest_change = largest(changes) or 1.0
    # With the tolerance `accuracy` itself, load steps of plastic bodies take 10 % more pairings.
    system = LinearOperator((len(changes),) * 2, matvec=lambda v: v - response_along(v)[contact], dtype=float)
    v, _ = gmres(system, changes / largest_change, rtol=max(SINGLE_PRECISION, NOTABLE * accuracy), atol=0.0, maxiter=1)
    response_size = largest(largest_change * v - changes)
    # Far from the solution, a step in which the response exceeds the change itself is unreliable, except where layers soften.
    if not response_size <= (largest_change if constraints.branches is None else np.inf):
        return None
    next_pairing, determined = image.copy(), dofs.determined
    if len(determined) > len(contact):  # there are springs of floating bodies
        next_pairing[determined] += largest_change * response_along(v)[determined]
    else:
        next_pairing[contact] = before[contact] + largest_change * v
    return next_pairing, response_size / (largest_change * largest(v) or 1.0)


def linearised_pairs(constraints: StackedConstraints, solution: Solution, displacement: Array) -> dict[str, Linearised]:
    """Return the linearised geometry of each pair in contact, by name; empty if one of them has no derivatives."""
    geometries = dict[str, Linearised]()
    for name, rows in constraints.rows.items():
        part, multiplier = constraints.parts[name], solution.multiplier[rows]
        if (part.tied is not None and part.geometry is None) or not multiplier.any():
            continue
        if part.geometry is None:
            return {}
        tangential = solution.tangential[rows, : len(part.tangents)]
        geometries[name] = part.geometry(multiplier, tangential, displacement)
    return geometries
