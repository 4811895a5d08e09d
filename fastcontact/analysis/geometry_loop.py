"""Iterate the contact geometry of a load step: pair the surfaces, solve, and accelerate, until displacements converge."""

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
from fastcontact.analysis.solution import Accuracy, FrictionalEquilibrium, Solution
from fastcontact.analysis.tolerances import Scatter, Tolerances, Watch
from fastcontact.analysis.touching import Touching
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.contact.constraints import StackedConstraints
from fastcontact.errors import ConvergenceError

log = logging.getLogger("fastcontact")
# Number of pairings with one active-set iteration each. This is cheapest near the solution, but it may cycle; in later
# pairings the active set therefore converges before the surfaces are paired again.
SEMISMOOTH_UPDATES = 8
# Number of pairings after which nodes are assumed to alternate between facets: the iteration then restarts without
# extrapolation, or with rounded edges.
PATIENT_UPDATES = 25
# Safety factor of the contraction that is expected of the next solution, relative to that of the last Newton step.
SAFETY = 3.0


@dataclass(frozen=True)
class Plan:
    """Options of the iteration of the contact geometry in a load step.

    Attributes
    ----------
    until_settled : bool
        Whether to update the geometry until the displacements converge. Otherwise the number of updates is fixed.
    limit : int
        Largest number of updates, or the fixed number of updates.
    semismooth : bool
        Whether the first pairings take one active-set iteration each, instead of iterating the active set to convergence.
    extrapolate : bool
        Whether to begin with displacements extrapolated along the load, and with inexact linear solutions.
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
        """Return the options that suit the criteria, the formulations and the linear solver of a problem."""
        criteria, iterative = problem.criteria, problem.solver.iterative
        fixed = 0 if criteria.keep_pairing else criteria.geometry_updates
        pairs = problem.pairs.values()
        # Newton's method for the geometry is not available for pairs with fluid pressure.
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
    """The contact solution of a load step, with converged geometry.

    Attributes
    ----------
    constraints : StackedConstraints
        Constraints of the last pairing.
    solution : Solution
    iterate : Iterate
    last_change : (int, float), optional
        The number of updates, if it is fixed, and the relative change of the displacements in the last update.
    scatter : Scatter, optional
        Scatter of the last iterates, if round-off prevents convergence to `Criteria.geometry`.
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
    """Alternate between pairing the surfaces and solving the contact problem until the displacements converge.

    Parameters
    ----------
    step : StepContext
    extrapolation : Extrapolation
    expected : float
        Scale of the displacements in the first step, if only forces act [length].
    begun : Iterate, optional
        Converged iterate of a less accurate iteration of the same step, to continue from. By default the iteration begins
        with the displacements at the end of the previous step.

    Raises
    ------
    ConvergenceError
        If the active set or the geometry does not converge.
    """
    iterate = begun or Iterate.of(step.state)
    touching = Touching(step, Plan.of(step.problem).newton)
    try:
        try:
            settled = _settle(step, iterate, extrapolation, expected, touching)
        except ConvergenceError as error:
            if not touching.done:
                raise
            log.info("friction in increments of the step does not converge: %s", error)
            touching.give_up()
            iterate.begin_again(step.state)
            settled = _settle(step, iterate, extrapolation, expected, touching)
    except ConvergenceError as error:
        error.history = error.history or iterate.history
        raise
    nodes = SharedNodes.of(settled.constraints, step.problem.model.periodic_interfaces)
    if nodes is None:
        return settled
    return replace(settled, solution=nodes.shared(settled.solution, settled.constraints, settled.iterate.u))


def _settle(
    step: StepContext, iterate: Iterate, extrapolation: Extrapolation, expected: float, touching: Touching
) -> SettledContact:  # fmt: skip
    """Return the result of `settle_geometry` before nodes in several pairs share their forces; `iterate` is modified."""
    problem, plan = step.problem, Plan.of(step.problem)
    if iterate.history:  # The iterate is converged already, so that extrapolation would move it away.
        plan = replace(plan, extrapolate=False)
    tolerances = Tolerances(problem.solver, problem.criteria, plan.extrapolate, step.state.gap_round_off, expected)
    accelerated, watch = Anderson(DEPTH, step.dofs.compared, problem.solver.iterative), Watch()
    mixing = _Mixing(accelerated, plan.newton)
    if plan.extrapolate:
        iterate.u = extrapolation.displacement(iterate.u)
    for update in range(plan.limit + 1):
        single = plan.semismooth and update < SEMISMOOTH_UPDATES
        constraints = pair_surfaces(problem, step.state, step.load, iterate)
        active = initially_active(constraints, iterate, extrapolation if plan.extrapolate and update == 0 else None)
        accuracy = tolerances.accuracy(step.dofs.scale(iterate.u, step.load.lift), single)
        nodes = SharedNodes.of(constraints, problem.model.periodic_interfaces)
        solving = touching.step(step, constraints, iterate, nodes)
        if touching.unfinished:
            accuracy = Accuracy(0.0, residual=problem.solver.tolerance)
        solution, displacement = _solve_once(solving, constraints, nodes, iterate, active, accuracy)
        if touching.unfinished:
            assert isinstance(solution, FrictionalEquilibrium)
            if not solution.settled:
                raise ConvergenceError("an increment does not converge", iterate.history)
            step, mixing = replace(step, path=solution.slid), _Mixing(accelerated, plan.newton)
            mixing.restart()
            watch.forget()
        moved = _move(step, iterate, constraints, solution, displacement)
        if not (solution.settled or single or tolerances.inexact):
            _raise_cycling(problem, constraints, solution, iterate)
        if not plan.until_settled:
            continue
        if not tolerances.inexact:
            touching.check(step, constraints, solution, moved.change - tolerances.enough(moved.size), moved.size)
        settled = SettledContact(constraints, solution, iterate)
        if not solution.settled or tolerances.inexact:
            watch.forget()
        elif moved.change <= tolerances.enough(moved.size) and not (touching.due or touching.unfinished):
            return settled
        elif scatter := watch.seen(displacement, settled.force, moved.change, moved.size):
            _log_scatter(scatter, problem.criteria.geometry)
            return replace(settled, scatter=scatter)
        mixed, enough = None, tolerances.enough(moved.size)
        if mixing.newton(moved.change, enough) and solution.settled:
            stepped = newton_step(step, constraints, solution, moved.before, displacement, enough / moved.change, nodes)
            mixed = None if stepped is None else mixing.stepped(*stepped)
        if mixed is None:
            mixed = mixing.next(moved.before, displacement, solution, tolerances.inexact, constraints)
        iterate.u = iterate.u if mixed is None else step.dofs.put(iterate.u, mixed)
        tolerances.tighten(moved.relative, solution.residual)
        if plan.extrapolate and update == PATIENT_UPDATES:
            # Whether nodes alternate between facets without end depends on the initial guess: try a different one.
            iterate.begin_again(step.state)
            mixing.restart()
            watch.forget()
        if update == max(plan.limit // 2, PATIENT_UPDATES) and any(pair.faceted for pair in problem.pairs.values()):
            log.info("nodes flip between facets: from now on the edges of facets are rounded")
            iterate.rounded = True
            mixing.restart()
            watch.forget()
    if plan.until_settled:
        changed = step.dofs.put(np.zeros_like(iterate.u), displacement - moved.before)
        raise ConvergenceError(geometry_moves(problem, iterate.history, changed, plan.limit), iterate.history)
    touching.check(step, constraints, solution, 0.0, 0.0)
    if touching.due or touching.unfinished:
        del iterate.history[-plan.limit - 1 :]
        return _settle(step, iterate, extrapolation, expected, touching)
    fixed = plan.limit and not problem.criteria.keep_pairing
    return SettledContact(constraints, solution, iterate, (plan.limit, moved.relative) if fixed else None)


def _solve_once(
    step: StepContext, constraints: StackedConstraints, nodes: SharedNodes | None, iterate: Iterate, active: Mask,
    accuracy: Accuracy,
) -> tuple[Solution, Array]:  # fmt: skip
    """Solve the inequalities of one pairing; see `solve_inequalities` for the values returned.

    `nodes` are the nodes that belong to several pairs, or to both ends of a period: their constraints are merged. None
    means that there are none.
    """
    if nodes is None:
        return solve_inequalities(step, constraints, iterate, active & constraints.usable, accuracy)
    once = nodes.once(constraints)
    return solve_inequalities(step, once, iterate, nodes.closed(active) & once.usable, accuracy)


@dataclass(frozen=True, eq=False)
class _Moved:
    """Change of the displacements in one geometry update, in the components of `StepContext.dofs`.

    Attributes
    ----------
    before : ndarray (k,)
        Displacements before the update [length].
    change : float
        Largest change of a component [length].
    size : float
        Largest displacement, to which the change is compared [length].
    """

    before: Array
    change: float
    size: float

    @property
    def relative(self) -> float:
        return self.change / self.size if self.size else 0.0


def _move(
    step: StepContext, iterate: Iterate, constraints: StackedConstraints, solution: Solution, displacement: Array
) -> _Moved:
    """Store a solution, and its displacements (k,) of the components of `step.dofs` [length], in the iterate."""
    before = step.dofs.of(iterate.u)
    iterate.u = step.dofs.put(iterate.u, displacement)
    # The unknowns of the solution do not include rigid-body motions of floating bodies, which may be much larger.
    size = max(step.dofs.size(solution.u), largest(step.load.lift))
    moved = _Moved(before, largest_difference(displacement, before), size)
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
    """Choice of the next iterate: by Newton's method while it converges, and by Anderson acceleration otherwise.

    Anderson acceleration uses only iterates with the same active set, between which the geometry varies smoothly.

    Parameters
    ----------
    accelerated : Anderson
    newton : bool
        Whether to use Newton's method for the geometry.
    """

    def __init__(self, accelerated: Anderson, newton: bool) -> None:
        self._accelerated = accelerated
        self._known: AnyArray | None = None
        self._newton, self._change, self._contraction = newton, np.inf, np.inf

    def newton(self, change: float, enough: float) -> bool:
        """Return whether to take a step of Newton's method, after a `change` of the displacements [length].

        Newton's method is given up once changes increase, because it does not converge if nodes alternate between facets. It
        is also not used if the next solution alone is expected to change displacements by no more than `enough` [length],
        because a solution without a Newton step costs less.
        """
        self._newton, self._change = self._newton and change <= self._change, change
        return self._newton and SAFETY * self._contraction * change > enough

    def stepped(self, next_pairing: Array, contraction: float) -> Array:
        """Store the factor by which a solution contracts changes of the geometry, and return `next_pairing` (k,)."""
        self._contraction = contraction
        return next_pairing

    def restart(self) -> None:
        """Discard the earlier iterates."""
        self._accelerated.restart()

    def next(
        self, before: Array, displacement: Array, solution: Solution, inexact: bool, constraints: StackedConstraints
    ) -> Array | None:
        """Return the displacements for the next pairing by Anderson acceleration.

        Parameters
        ----------
        before, displacement : ndarray (k,)
            Displacements of the components of `StepContext.dofs`, at which the surfaces were paired, and of the solution
            [length].
        solution : Solution
        inexact : bool
            Whether the linear solution was inexact.
        constraints : StackedConstraints

        Returns
        -------
        ndarray (k,) or None
            Displacements [length]; None means that the next pairing uses the displacements of the solution.
        """
        state = constraints.state(solution.active)
        same = self._known is not None and np.array_equal(self._known, state)
        self._known = state if solution.settled else None
        if inexact or not same:
            self._accelerated.restart()
        # An inexact solution may hardly change although it is not accurate yet.
        return None if inexact else self._accelerated.mixed(before, displacement)
