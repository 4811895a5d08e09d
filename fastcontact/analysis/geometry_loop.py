"""Contact geometry of a load step: detect, constrain, solve, accelerate, until displacements are stationary."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np

from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.analysis.anderson import DEPTH, Anderson
from fastcontact.analysis.convergence_messages import active_set_cycles, geometry_moves, nearest_nodes
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.geometry_newton import newton_step
from fastcontact.analysis.inequalities import StepContext, solve_inequalities
from fastcontact.analysis.iterate import Iterate, initially_active, pair_surfaces
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.shared_nodes import SharedNodes
from fastcontact.analysis.solution import Accuracy, Solution
from fastcontact.analysis.tolerances import Scatter, Tolerances, Watch
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.errors import ConvergenceError

log = logging.getLogger("fastcontact")
# One active-set iteration per pairing is cheapest near the solution but may cycle; after this many, the set converges first.
SEMISMOOTH_UPDATES = 8
# Pairings after which an iteration begins again from elsewhere, or with rounded edges: nodes flip between facets.
PATIENT_UPDATES = 25
# A solution may contract a change of the geometry less than that of the last Newton step by this factor.
SAFETY = 3.0


@dataclass(frozen=True)
class Plan:
    """How the geometry of a load step is updated.

    Attributes
    ----------
    until_settled : bool
        Whether to update until the displacement converges; otherwise a fixed number of times.
    limit : int
        Largest number of updates, or that fixed number.
    semismooth : bool
        Whether to pair again after every active-set iteration at first.
    extrapolate : bool
        Whether to begin with displacements extrapolated along the load, and with inexact solutions.
    newton : bool
        Whether to use Newton's method for the geometry, see `geometry_newton`.
    """

    until_settled: bool
    limit: int
    semismooth: bool
    extrapolate: bool
    newton: bool

    @classmethod
    def of(cls, problem: Problem) -> Plan:
        """Return the plan for the criteria, the formulations and the linear solver of a problem."""
        criteria, iterative = problem.criteria, problem.solver.iterative
        fixed = 0 if criteria.keep_pairing else criteria.geometry_updates
        pairs = problem.pairs.values()
        # Fluid pressure follows the surfaces themselves.
        known = not any(pair.options.source is not None for pair in pairs)
        newton = known and not iterative and problem.floating_bodies is None
        return cls(
            until_settled=fixed is None,
            limit=criteria.max_geometry_updates if fixed is None else fixed,
            semismooth=fixed is None and not newton and any(pair.geometry_in_loop for pair in pairs),
            extrapolate=fixed is None and iterative,
            newton=newton,
        )


@dataclass(frozen=True, eq=False)
class SettledContact:
    """The contact of a load step with converged geometry.

    Attributes
    ----------
    constraints : StackedConstraints
    solution : Solution
    iterate : Iterate
    last_change : (int, float), optional
        The fixed number of updates, and the relative change by the last one.
    scatter : Scatter, optional
        Scatter of the last geometries, where round-off prevented convergence to the criterion.
    """

    constraints: StackedConstraints
    solution: Solution
    iterate: Iterate
    last_change: tuple[int, float] | None = None
    scatter: Scatter | None = None

    @property
    def force(self) -> Array:
        """Nodal contact forces (n_dofs,) [force]."""
        return self.constraints.force(self.solution.multiplier, self.solution.tangential)


def settle_geometry(
    step: StepContext, extrapolation: Extrapolation, expected: float, begun: Iterate | None = None
) -> SettledContact:
    """Alternate between pairing and solving the contact problem until both are stationary.

    Parameters
    ----------
    step : StepContext
    extrapolation : Extrapolation
    expected : float
        Expected displacement in the first step, if only forces act [length].
    begun : Iterate, optional
        Converged iterate of less accurate solutions; by default the step begins at the end of the last one.

    Raises
    ------
    ConvergenceError
        If the active set or the geometry does not converge.
    """
    iterate = begun or Iterate.of(step.state)
    try:
        settled = _settle(step, iterate, extrapolation, expected)
    except ConvergenceError as error:
        error.history = error.history or iterate.history
        raise
    nodes = SharedNodes.of(settled.constraints, step.problem.model.periodic_interfaces)
    if nodes is None:
        return settled
    return replace(settled, solution=nodes.shared(settled.solution, settled.constraints, settled.iterate.u))


def _settle(step: StepContext, iterate: Iterate, extrapolation: Extrapolation, expected: float) -> SettledContact:
    problem, plan = step.problem, Plan.of(step.problem)
    if iterate.history:  # already started: no extrapolation
        plan = replace(plan, extrapolate=False)
    tolerances = Tolerances(problem.solver, problem.criteria, plan.extrapolate, step.state.gap_round_off, expected)
    mixing, watch = _Mixing(Anderson(DEPTH, step.dofs.compared, problem.solver.iterative), plan.newton), Watch()
    if plan.extrapolate:
        iterate.u = extrapolation.displacement(iterate.u)
    for update in range(plan.limit + 1):
        single = plan.semismooth and update < SEMISMOOTH_UPDATES
        constraints = pair_surfaces(problem, step.state, step.load, iterate)
        active = initially_active(constraints, iterate, extrapolation if plan.extrapolate and update == 0 else None)
        accuracy = tolerances.accuracy(step.dofs.scale(iterate.u, step.load.lift), single)
        nodes = SharedNodes.of(constraints, problem.model.periodic_interfaces)
        solution, fraction = _solve_once(step, constraints, nodes, iterate, active, accuracy)
        moved = _move(step, iterate, constraints, solution, fraction)
        if not (solution.settled or single or tolerances.inexact):
            _raise_cycling(problem, constraints, solution, iterate)
        if not plan.until_settled:
            continue
        settled = SettledContact(constraints, solution, iterate)
        if not solution.settled or tolerances.inexact:
            watch.forget()
        elif moved.change <= tolerances.enough(moved.size):
            return settled
        elif scatter := watch.seen(fraction, settled.force, moved.change, moved.size):
            _log_scatter(scatter, problem.criteria.geometry)
            return replace(settled, scatter=scatter)
        mixed, enough = None, tolerances.enough(moved.size)
        if mixing.newton(moved.change, enough) and solution.settled and nodes is None:
            stepped = newton_step(step, constraints, solution, moved.before, fraction, enough / moved.change)
            mixed = None if stepped is None else mixing.stepped(*stepped)
        if mixed is None:
            mixed = mixing.next(moved.before, fraction, solution, tolerances.inexact, constraints)
        iterate.u = iterate.u if mixed is None else step.dofs.put(iterate.u, mixed)
        tolerances.tighten(moved.relative, solution.residual)
        if plan.extrapolate and update == PATIENT_UPDATES:
            # Whether nodes alternate between facets for ever depends on the initial guess.
            iterate.begin_again(step.state)
            mixing.restart()
            watch.forget()
        if update == max(plan.limit // 2, PATIENT_UPDATES) and any(pair.faceted for pair in problem.pairs.values()):
            log.info("nodes flip between facets: from now on the edges of facets are rounded")
            iterate.rounded = True
            mixing.restart()
            watch.forget()
    if plan.until_settled:
        changed = step.dofs.put(np.zeros_like(iterate.u), fraction - moved.before)
        raise ConvergenceError(geometry_moves(problem, iterate.history, changed, plan.limit), iterate.history)
    fixed = plan.limit and not problem.criteria.keep_pairing
    return SettledContact(constraints, solution, iterate, (plan.limit, moved.relative) if fixed else None)


def _solve_once(
    step: StepContext, constraints: StackedConstraints, nodes: SharedNodes | None, iterate: Iterate, active: Mask,
    accuracy: Accuracy,
) -> tuple[Solution, Array]:  # fmt: skip
    """Solve the inequalities of a pairing, with one condition for `nodes` in several pairs or at both ends of a period."""
    if nodes is None:
        return solve_inequalities(step, constraints, iterate, active & constraints.usable, accuracy)
    once = nodes.once(constraints)
    return solve_inequalities(step, once, iterate, nodes.closed(active) & once.usable, accuracy)


@dataclass(frozen=True, eq=False)
class _Moved:
    """Change of the active displacements from those `before`, and the largest displacement (size) [length]."""

    before: Array
    change: float
    size: float

    @property
    def relative(self) -> float:
        return self.change / self.size if self.size else 0.0


def _move(
    step: StepContext, iterate: Iterate, constraints: StackedConstraints, solution: Solution, fraction: Array
) -> _Moved:
    """Update the iterate by the active displacements `fraction` (k,) of a solution."""
    before = step.dofs.of(iterate.u)
    iterate.u = step.dofs.put(iterate.u, fraction)
    # Rigid-body motions of floating bodies are left out.
    size = max(step.dofs.size(solution.u), largest(step.load.lift))
    moved = _Moved(before, largest_difference(fraction, before), size)
    iterate.remember(constraints, solution)
    iterate.history.append(
        {
            "displacement_change": moved.relative,
            "active": int(solution.active.sum()),
            "active_set_iterations": solution.iterations,
            "settled": solution.settled,
            **({"rounded": True} if iterate.rounded else {}),
        }
    )
    return moved


def _log_scatter(scatter: Scatter, criterion: float) -> None:
    log.info(
        "the contact geometry settled as far as round-off allows: displacements scatter by %.1e of the largest one, contact "
        "forces by %.1e (Criteria.geometry = %g)", scatter.displacement, scatter.force, criterion,
    )  # fmt: skip


def _raise_cycling(problem: Problem, constraints: StackedConstraints, solution: Solution, iterate: Iterate) -> NoReturn:
    nodes = nearest_nodes(problem, constraints, np.flatnonzero(solution.active != solution.wanted))
    iterate.history[-1]["nodes"] = nodes
    raise ConvergenceError(active_set_cycles(problem, constraints, solution, nodes), iterate.history)


class _Mixing:
    """Anderson mixing of the geometries with one active set, or Newton's method as long as it converges.

    Parameters
    ----------
    accelerated : Anderson
    newton : bool
        Whether Newton's method is allowed.
    """

    def __init__(self, accelerated: Anderson, newton: bool) -> None:
        self._accelerated = accelerated
        self._known: AnyArray | None = None
        self._newton, self._change, self._contraction = newton, np.inf, np.inf

    def newton(self, change: float, enough: float) -> bool:
        """Return whether to take a step of Newton's method, after a `change` of the displacements [length].

        Where nodes move to and fro between facets, changes increase, and Newton's method does not converge. Where the next
        solution is expected to differ by no more than `enough` [length], it is cheaper.
        """
        self._newton, self._change = self._newton and change <= self._change, change
        return self._newton and SAFETY * self._contraction * change > enough

    def stepped(self, next_pairing: Array, contraction: float) -> Array:
        """Store by how much a solution contracts changes of the geometry, and return the displacements of a Newton step."""
        self._contraction = contraction
        return next_pairing

    def restart(self) -> None:
        """Discard the geometries so far."""
        self._accelerated.restart()

    def next(
        self, before: Array, fraction: Array, solution: Solution, inexact: bool, constraints: StackedConstraints
    ) -> Array | None:
        """Return the active displacements (k,) of the next pairing; None for those of the solution [length]."""
        state = constraints.state(solution.active)
        same = self._known is not None and np.array_equal(self._known, state)
        self._known = state if solution.settled else None
        if inexact or not same:
            self._accelerated.restart()
        # An inexact solution may be stationary before it is accurate.
        return None if inexact else self._accelerated.mixed(before, fraction)
