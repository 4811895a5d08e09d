"""Solve one load step: evaluate loads, iterate to equilibrium with contact, compute results. Start reading the code here.

First the loads and the prescribed displacements at the end of the step are evaluated. Newton's method (`newton`) then solves
the equilibrium. Each of its iterations pairs the contact surfaces on the deformed configuration, solves the inequalities of
contact, and repeats both until the displacements converge (`geometry_loop`). The remaining displacements, the force balance
and the stresses follow from the contact forces.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from fastcontact._jit import parallel
from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis.contact_result import contact_results
from fastcontact.analysis.newton import Beginning, newton
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.state import State
from fastcontact.analysis.step_equilibrium import StepEquilibrium, with_loads
from fastcontact.analysis.step_history import keep_path, save_contact_history
from fastcontact.analysis.step_result import recover
from fastcontact.analysis.thermal_coupling import (
    Heated,
    expanded,
    expansion_as_force,
    first_rise,
    settle_heat,
)
from fastcontact.model.rigid_motions import generalised
from fastcontact.results.step import ContactResult, StepResult


@parallel.on_one_blas_thread
def load_step(problem: Problem, state: State, index: int, instant: float) -> tuple[State, StepResult]:
    """Return the state and the result at the end of a load step.

    Parameters
    ----------
    problem : Problem
    state : State
        State at the end of the previous step; it is not modified.
    index : int
        Number of the step; the first step has the number 1.
    instant : float
        Pseudo-time at the end of the step, at which the load multipliers are evaluated [-].

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
    begin = prepare_start(problem, state, index, load)
    heated, solution = None, newton(problem, begin, load)
    if rise is not None:
        solve = partial(newton, problem, begin)
        heated, solution = settle_heat(problem, begin.state, cold, instant, rise, solution, solve)
    iterations = solution.counts(problem.solver.counters.iterations - solved_before)
    return _ended(problem, begin.state, load, solution, iterations, (index, instant), heated)


def _ended(
    problem: Problem, start: State, load: StepLoad, solution: StepEquilibrium, iterations: dict[str, Any],
    instant: tuple[int, float], heated: Heated | None,
) -> tuple[State, StepResult]:  # fmt: skip
    """Return the state and the result at the end of a load step.

    Parameters
    ----------
    problem : Problem
    start : State
        State in which the step began, see `prepare_start`.
    load : StepLoad
    solution : StepEquilibrium
        The converged equilibrium.
    iterations : dict
        Numbers of iterations, for `StepResult.iterations`; it is modified.
    instant : (int, float)
        Number of the step, and pseudo-time at its end.
    heated : Heated, optional
        The converged temperatures, in models with conduction of heat.
    """
    settled, u, balanced = solution.settled, solution.u, solution.balance
    end = replace(
        start, u=u, largest_force=balanced.largest, obstacles=problem.obstacles_at(load, u), angles=load.angles,
        instant=instant[1], rise=None if heated is None else heated.rise,
    )  # fmt: skip
    end = solution.terms.commit(u, end)
    contact: dict[str, ContactResult] = {}
    if settled is not None:
        end = save_contact_history(problem, start, load, settled, end)
        contact = contact_results(problem, start, load, settled, end)
        end, contact = keep_path(problem, start, load, settled, end, contact, balanced.energy)
        end = end.after_touching(name for name, pair in contact.items() if pair.active.any())
    else:
        end = replace(end, extrapolation=start.extrapolation.converged(u, {}, problem.bodies is not None))
    if settled is None and start.work is not None:
        end = replace(end, work=start.work.after(balanced.energy, 0.0, (0.0, 0.0, 0.0)))
    if end.work is not None:
        iterations["work"] = end.work.as_dict()
    if problem.floating_bodies is not None and end.rigid is not None:
        iterations["regularised"] = problem.floating_bodies.report(end.rigid, end.largest_rigid_force)
    end = replace(end, solver=problem.solver.snapshot())
    result = recover(problem, end, contact, balanced.reaction, iterations, instant, solution.bodies)
    return end, result if heated is None else heated.completed(problem, result)


def prepare_start(problem: Problem, state: State, index: int, load: StepLoad) -> Beginning:
    """Return the beginning of a load step.

    Its state is the `state` at the end of the previous step, with the bounds of round-off and of forces for the new `load`.
    If only forces act in the first step, no displacement is known. The solution without contact then provides the scale of
    the displacements, `Beginning.expected`.
    """
    pushing = expansion_as_force(problem, load)
    loaded = with_loads(problem, pushing)
    round_off, rigid_force, expected = state.gap_round_off, state.largest_rigid_force, 0.0
    zero = np.zeros(len(load.lift))
    if problem.pairs and pushing.force.any() and not (state.u.any() or load.lift.any()):
        expected = largest(loaded.full_solution(zero))
    if problem.pairs and problem.model.springs:
        # Springs of the model may be weak: without contact, bodies on them have large displacements, and gaps are
        # differences of such displacements, each with an error of a few units in the last place.
        from_zero = largest(loaded.full_solution(zero))
        round_off = max(round_off, 16 * np.finfo(float).eps * from_zero)
    if problem.floating_bodies is not None:
        forces = generalised(problem.floating_bodies.motions, pushing.force)
        rigid_force = max(rigid_force, float(np.abs(forces).max()))
    # Displacements of nonlinear bodies are extrapolated along the motions of rigid obstacles as well as along the loads, from
    # the state at rest on.
    parts = [load.lift, pushing.force, *(() if problem.bodies is None else load.obstacles.values())]
    extrapolation = state.extrapolation
    if problem.bodies is not None and not (extrapolation.loads or state.u.any()):
        extrapolation = extrapolation.to(*map(np.zeros_like, parts)).converged(state.u, {})
    start = replace(
        state, gap_round_off=round_off, largest_rigid_force=rigid_force, rigid=None, last_change=None,
        largest_force=max(state.largest_force, largest(pushing.force)),
        extrapolation=extrapolation.to(*parts),
    )  # fmt: skip
    return Beginning(start, index, load, loaded, expected)
