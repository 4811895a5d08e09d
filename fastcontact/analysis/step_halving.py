"""Bisection of load steps that do not converge, or in which nodes that close do too much of the frictional work.

A load step that fails leaves the state unchanged, so that it can be divided into two substeps. With nonlinear bodies, later
substeps have the size of the last one, which doubles after a substep that took few iterations.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace

import numpy as np

from fastcontact.analysis.convergence_messages import fluid_note, friction_note, limit_load_note
from fastcontact.analysis.criteria import NOTABLE
from fastcontact.analysis.load_step import load_step, prepare_start
from fastcontact.analysis.newton import newton
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.analysis.wear_iteration import newton_with_wear
from fastcontact.arrays import largest
from fastcontact.errors import ConvergenceError
from fastcontact.results.step import StepResult

log = logging.getLogger("fastcontact")
# Functions that are called when a step is halved, with its number and the instants of its beginning and end.
listeners: list[Callable[[int, float, float], None]] = []
# Number of Newton iterations up to which the next substep is twice as large. Without growth, or with growth in any case,
# `test_sizes_are_kept_and_grow` fails.
FEW_ITERATIONS = 6


def advance(problem: Problem, state: State, index: int, begin: float, end: float) -> tuple[State, StepResult]:
    """Solve the load step `index` from the instant `begin` to `end`, and halve it recursively if necessary.

    Substeps are complete load steps, so that friction follows their path. The result is that at the instant `end`, with the
    numbers of iterations, the slip and the dissipation of all substeps. If there are several, ``iterations["substeps"]``
    lists the instants of their ends.

    With friction, loads that already act at the beginning of the first step are first applied in a substep of zero duration,
    unless there is no equilibrium under them.

    Raises
    ------
    ConvergenceError
        If a substep does not converge after `Criteria.max_halvings` halvings, or halving cannot help.
    """
    initial: list[StepResult] = []
    if index == 1 and _begins_loaded(problem, begin, end):
        with suppress(ConvergenceError):
            state, initial = _substeps(problem, state, index, (begin, begin), 0)
    state, substeps = _substeps(problem, state, index, (begin, end), 0)
    return state, _with_sums(initial + substeps)


def _begins_loaded(problem: Problem, begin: float, end: float) -> bool:
    """Return whether loads act at the beginning of the first step that change in it, and friction depends on their order."""
    if not any(pair.friction and pair.options.kind != "tied" for pair in problem.pairs.values()):
        return False
    values = []  # of all loads, some of them displacements and some forces
    for load in map(problem.load_at, (begin, end)):
        others = [*load.obstacles.values(), [*load.angles.values()], [*load.fluids.values()], load.following]
        values.append(np.concatenate([load.lift, load.force, *others, [] if load.rise is None else load.rise]))
    return bool(values[0].any()) and not np.array_equal(values[0], values[1])


def _substeps(
    problem: Problem, state: State, index: int, span: tuple[float, float], halved: int
) -> tuple[State, list[StepResult]]:
    """Return the state at the end of a span of pseudo-time, and the results of its substeps.

    `span` is (begin, end), and `halved` the number of halvings of the load step that lead to this span.
    """
    begin, end = span
    middle = 0.5 * (begin + end)
    max_halvings = problem.criteria.max_halvings * (1 if problem.bodies is None else 2)
    is_last = halved >= max_halvings or not begin < middle < end
    if halved >= state.halved or not begin < middle < end:
        try:
            after, result = load_step(problem, state, index, end)
            ambiguous = not is_last and _has_two_equilibria(problem, state, after, index)
            if ambiguous:
                log.info("step %d from %.6g to %.6g has two equilibria with friction, halved", index, begin, end)
            if is_last or not (ambiguous or _slides_while_touching(problem, state, after)):
                if problem.bodies is not None:  # how many times the next step is halved before its first attempt
                    converged_fast = len(result.iterations["history"]) <= FEW_ITERATIONS
                    after = replace(after, halved=max(halved - converged_fast, 0))
                return after, [result]
        except ConvergenceError as error:
            if is_last or not error.smaller_steps_help:
                where = f"from {begin:.6g} to {end:.6g}"
                times = "once" if halved == 1 else f"{halved} times"
                if halved:
                    location = f"step {index} was halved {times}, the part {where} fails"
                else:  # only a step that has not been halved may converge in smaller ones
                    more = "; more load steps may help" if error.smaller_steps_help else ""
                    location = f"step {index} {where}{more}"
                cause = limit_load_note(problem, state) or friction_note(problem, state) or fluid_note(problem, end)
                final = ConvergenceError(f"{error} ({location}{cause})", error.history, smaller_steps_help=False)
                # Keep the traceback of the original error, but do not chain it: its message is part of the new one.
                raise final.with_traceback(error.__traceback__) from None
            reason = str(error).split(". ")[0]
            for listener in listeners:
                listener(index, begin, end)
            log.warning("step %d from %.6g to %.6g does not converge, halved: %s", index, begin, end, reason)
    state, first = _substeps(problem, state, index, (begin, middle), halved + 1)
    state, second = _substeps(problem, state, index, (middle, end), halved + 1)
    return state, first + second


def _slides_while_touching(problem: Problem, state: State, after: State) -> bool:
    """Return whether nodes that close in the step do more of the frictional work than the criterion allows.

    See `Criteria.friction_while_touching`; the result is False for linear bodies.
    """
    limit = problem.criteria.friction_while_touching
    if limit is None or problem.bodies is None or state.work is None or after.work is None:
        return False
    return after.work.touching - state.work.touching > limit * after.work.friction


def _has_two_equilibria(problem: Problem, state: State, after: State, index: int) -> bool:
    """Return whether the step has another equilibrium, in which bodies pass each other or slide instead of sticking.

    The search starts from the equilibrium without friction. If there are two equilibria, smaller steps show to which one the
    load path leads. The equilibrium is assumed to be unique in steps that begin with contact, in which contact surfaces move
    by less than the smallest facet, with heat conduction, and with a fixed number of geometry updates.
    """
    pairs = {name: pair for name, pair in problem.pairs.items() if pair.friction and pair.options.kind != "tied"}
    closed = [any(s.active[name].any() for name in pairs if name in s.active) for s in (state, after)]
    if not pairs or closed != [False, True] or problem.heat is not None or not problem.until_settled:
        return False
    zero = np.zeros(problem.model.mesh.dim)
    positions = [np.stack([s.obstacles.get(name, zero) for name in pairs]) for s in (state, after)]
    turns = {name: abs(angle - state.angles.get(name, 0.0)) for name, angle in after.angles.items() if name in pairs}
    arcs = [turn * float(np.linalg.norm(np.ptp(pairs[name].points, axis=0))) for name, turn in turns.items()]
    motion = max(largest((after.u - state.u)[problem.contact_dofs]), largest(positions[1] - positions[0]), *arcs)
    if motion < min(float(pair.secondary.largest_diameters(pair.points).min()) for pair in pairs.values()):
        return False
    load = problem.load_at(after.instant)
    problem.solver.put_back(state.solver)
    begin, frictionless = prepare_start(problem, state, index, load), dict.fromkeys(pairs, 0.0)
    frictionless_load = replace(load, friction_factors={**load.friction_factors, **frictionless})
    try:
        frictionless_solution = newton(replace(begin, load=frictionless_load))
        u = newton_with_wear(begin, frictionless_solution).u
    except ConvergenceError:
        return False
    return largest(u - after.u) > NOTABLE * largest(after.u - state.u)


def _with_sums(substeps: list[StepResult]) -> StepResult:
    """Return the result of the last substep, with iterations, slips and dissipation summed over all substeps."""
    end = substeps[-1]
    if len(substeps) == 1:
        return end
    logs = [substep.iterations for substep in substeps]
    history = [entry for log in logs for entry in log["history"]]
    iterations = {**end.iterations, "substeps": [substep.load_factor for substep in substeps], "history": history}
    for name in ("geometry_updates", "active_set_iterations", "linear_iterations"):
        iterations[name] = sum(log[name] for log in logs)
    contact = {}
    for name, result in end.contact.items():
        parts = [substep.contact[name] for substep in substeps]
        loads = [part.sliding_load for part in parts if part.sliding_load is not None]
        sums = {"sliding_load": np.sum(loads, axis=0)} if loads else {}
        slip = np.sum([part.slip for part in parts], axis=0)
        contact[name] = replace(result, dissipation=sum(part.dissipation for part in parts), slip=slip, **sums)
    return replace(end, contact=contact, iterations=iterations)
