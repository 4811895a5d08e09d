"""One load step: predict, solve the contact problem, check equilibrium, recover. Start reading the code here.

First the loads and the prescribed displacements at the end of the step are evaluated. Then the contact geometry is settled:
the surfaces are paired on the deformed configuration, the inequalities of contact are solved, and both are repeated until
the displacement stands still. The contact forces are then known, and all displacements, the balance of forces and the
stresses follow from them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from fastcontact._jit import parallel
from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis.balance import balance
from fastcontact.analysis.displacements import solve_displacements, with_loads
from fastcontact.analysis.geometry_loop import SettledContact, settle_geometry
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.newton import newton
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.state import State
from fastcontact.analysis.step_equilibrium import StepEquilibrium
from fastcontact.analysis.step_history import keep_path, save_contact_history
from fastcontact.analysis.step_result import contact_results, counted, recover
from fastcontact.analysis.thermal_coupling import (
    Heated,
    expanded,
    expansion_as_force,
    first_rise,
    settle_heat,
)
from fastcontact.arrays import Array
from fastcontact.linear.protocol import Loaded
from fastcontact.model.rigid_motions import generalised
from fastcontact.results.step import ContactResult, StepResult


@parallel.on_one_blas_thread
def load_step(problem: Problem, state: State, index: int, instant: float) -> tuple[State, StepResult]:
    """Return the state and the result at the end of a load step.

    Parameters
    ----------
    problem : Problem
    state : State
        At the end of the step before; it is not modified.
    index : int
        Number of the step, 1 for the first one.
    instant : float
        Pseudo-time of its end.

    Raises
    ------
    ConvergenceError
        If the step does not converge.
    """
    cold = problem.load_at(instant)
    rise = first_rise(problem, state, instant)
    load = expanded(problem, cold, rise)
    problem.solver.put_back(state.solver)
    solved_before = problem.solver.counters.iterations
    pushing = expansion_as_force(problem, load)
    loaded = with_loads(problem, pushing)
    start, expected = prepare_start(problem, state, pushing, loaded)

    def solve(under: StepLoad, before: StepEquilibrium | None) -> StepEquilibrium:
        if problem.bodies is not None:
            return newton(problem, start, under, expected, before)
        right = loaded if under is load else with_loads(problem, under)
        return _balanced(problem, start, under, right, expected, index, before)

    heated, solution = None, solve(load, None)
    if rise is not None:
        heated, solution = settle_heat(problem, start, cold, instant, rise, solution, solve)
    iterations = counted(solution.settled, problem.solver.counters.iterations - solved_before)
    return _ended(problem, start, load, solution, {**iterations, **solution.counts}, (index, instant), heated)


def _balanced(
    problem: Problem, start: State, load: StepLoad, loaded: Loaded, expected: float, index: int,
    before: StepEquilibrium | None,
) -> StepEquilibrium:  # fmt: skip
    """Return `equilibrium`, whose balance of forces is within the criterion."""
    solution = equilibrium(problem, start, load, loaded, expected, before)
    # An iterative solver was too inaccurate: it is asked for more, and goes on from the same contact.
    while solution.balance.excess > 1.0 and problem.solver.improve(solution.balance.wanting):
        solution = equilibrium(problem, start, load, with_loads(problem, load), expected, solution)
    solution.balance.check(index, problem, solution.history)
    return solution


def _ended(
    problem: Problem, start: State, load: StepLoad, solution: StepEquilibrium, iterations: dict[str, Any],
    instant: tuple[int, float], heated: Heated | None,
) -> tuple[State, StepResult]:  # fmt: skip
    """Return state and result of a load step, from its equilibrium."""
    settled, u, balanced, bodies = solution.settled, solution.u, solution.balance, solution.bodies
    end = replace(
        start, u=u, largest_force=balanced.largest, obstacles=problem.obstacles_at(load, u), angles=load.angles,
        history=start.history if bodies is None else bodies.history, instant=instant[1],
        rise=None if heated is None else heated.rise,
    )  # fmt: skip
    contact: dict[str, ContactResult] = {}
    if settled is not None:
        end, contact = after_contact(problem, start, load, settled, end, balanced.energy)
    else:
        end = replace(end, extrapolation=start.extrapolation.converged(u, {}))
    if settled is None and start.work is not None:
        end = replace(end, work=start.work.after(balanced.energy, 0.0, (0.0, 0.0, 0.0)))
    if end.work is not None:
        iterations["work"] = end.work.told()
    if problem.floating_bodies is not None and end.rigid is not None:
        iterations["regularised"] = problem.floating_bodies.report(end.rigid, end.largest_rigid_force)
    end = replace(end, solver=problem.solver.snapshot())
    result = recover(problem, end, contact, balanced.reaction, iterations, instant, bodies)
    return end, result if heated is None else heated.told(problem, result)


def prepare_start(problem: Problem, state: State, load: StepLoad, loaded: Loaded) -> tuple[State, float]:
    """Return the state from which the step starts, and the displacement to expect [length].

    The latter matters in the first step if forces alone act: nothing else tells how large displacements will be.
    """
    round_off, rigid_force, expected = state.gap_round_off, state.largest_rigid_force, 0.0
    zero = np.zeros(len(load.lift))
    if problem.pairs and load.force.any() and not (state.u.any() or load.lift.any()):
        expected = largest(loaded.full_solution(zero))
    if problem.pairs and problem.model.springs:
        # Springs of the model may be weak: without contact, bodies on them move far, and gaps are differences of such
        # displacements, of which each has an error of some units in its last place.
        alone = largest(loaded.full_solution(zero))
        round_off = max(round_off, 16 * np.finfo(float).eps * alone)
    if problem.floating_bodies is not None:
        forces = generalised(problem.floating_bodies.motions, load.force)
        rigid_force = max(rigid_force, float(np.abs(forces).max()))
    start = replace(
        state, gap_round_off=round_off, largest_rigid_force=rigid_force, rigid=None, last_change=None,
        largest_force=max(state.largest_force, largest(load.force)),
        extrapolation=state.extrapolation.to(load.lift, load.force, *_motions(problem, load)),
    )  # fmt: skip
    return start, expected


def _motions(problem: Problem, load: StepLoad) -> list[Array]:
    """Return motions of obstacles that nonlinear bodies are extrapolated along."""
    return [] if problem.bodies is None else [*load.obstacles.values()]


def equilibrium(
    problem: Problem, start: State, load: StepLoad, loaded: Loaded, expected: float,
    previous_try: StepEquilibrium | None = None,
) -> StepEquilibrium:  # fmt: skip
    """Return the settled contact, all displacements and the balance of forces.

    It begins where a `previous_try` at the same step has settled with less accurate solutions.
    """
    settled = None
    if problem.pairs:
        dofs = problem.dofs.for_step(start.u, load.lift)
        step = StepContext(problem, start, load, dofs.loaded(loaded), dofs)
        tried = None if previous_try is None else previous_try.settled
        settled = settle_geometry(step, start.extrapolation, expected, tried.iterate if tried else None)
        if problem.criteria.friction_while_touching is not None:
            from fastcontact.analysis.touching import along_path

            settled = along_path(step, settled, expected)
    u, contact_force = solve_displacements(problem, load, loaded, settled, start.u)
    balanced = balance(problem, u, contact_force, load.force, start.largest_force)
    if settled is not None:
        settled.iterate.history[-1]["residual"] = balanced.relative
    return StepEquilibrium(settled, u, balanced)


def after_contact(
    problem: Problem, start: State, load: StepLoad, settled: SettledContact, end: State, energy: tuple[float, float]
) -> tuple[State, dict[str, ContactResult]]:
    """Return the state at the end of the step with its contact history, and the results of all contact pairs."""
    end = save_contact_history(problem, start, load, settled, end)
    results = contact_results(problem, start, load, settled, end)
    end, results = keep_path(problem, start, load, settled, end, results, energy)
    return end.after_touching(name for name, pair in results.items() if pair.active.any()), results
