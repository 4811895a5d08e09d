"""Bisection of load steps that do not converge, or whose nodes slide too far while they touch.

A step that is halved leaves the state unchanged.

Parts of steps of nonlinear bodies keep the size of the last one, and double after one that took few iterations.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fastcontact.analysis.convergence_messages import limit_load
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.errors import ConvergenceError
from fastcontact.results.step import StepResult

log = logging.getLogger("fastcontact")
# Called with the number of a step, and the instants between which it does not converge and is halved.
listeners: list[Callable[[int, float, float], None]] = []
# Number of Newton iterations up to which the next substep is twice as large.
FEW = 6


def advance(problem: Problem, state: State, index: int, begin: float, end: float) -> tuple[State, StepResult]:
    """Compute the step `index` from instant `begin` to `end`, recursively halved where necessary.

    Substeps are complete load steps: friction slides along their path. The result is that at `end`, with the iterations
    and the dissipation of all substeps; if there are several, ``iterations["substeps"]`` lists the instants of their ends.

    Raises
    ------
    ConvergenceError
        If a substep does not converge after `Criteria.max_halvings` halvings, or halving cannot help.
    """
    state, parts = _parts(problem, state, index, (begin, end), 0)
    return state, _joined(parts)


def _parts(
    problem: Problem, state: State, index: int, span: tuple[float, float], halved: int
) -> tuple[State, list[StepResult]]:
    begin, end = span
    middle = 0.5 * (begin + end)
    if halved < state.halved and begin < middle < end:
        return _both(problem, state, index, (begin, middle, end), halved)
    most = problem.criteria.max_halvings * (1 if problem.bodies is None else 2)
    try:
        after, result = load_step(problem, state, index, end)
        if halved == most or not begin < middle < end or not _slides_while_touching(problem, state, after):
            return _sized(problem, after, result, halved), [result]
    except ConvergenceError as error:
        if halved >= most or not begin < middle < end or not error.smaller_steps_help:
            where = f"from {begin:.6g} to {end:.6g}"
            often = "once" if halved == 1 else f"{halved} times"
            part = (
                f"step {index} was cut in halves {often}, the part {where} fails" if halved else f"step {index} {where}"
            )
            limit = limit_load(problem, state)
            final = ConvergenceError(f"{error} ({part}{limit})", error.history, smaller_steps_help=False)
            # As raised where it was found: the same words twice, in two tracebacks, would tell nothing more.
            raise final.with_traceback(error.__traceback__) from None
        reason = str(error).split(". ")[0]
        for listener in listeners:
            listener(index, begin, end)
        log.warning("step %d from %.6g to %.6g does not converge, cut in halves: %s", index, begin, end, reason)
    return _both(problem, state, index, (begin, middle, end), halved)


def _both(
    problem: Problem, state: State, index: int, span: tuple[float, float, float], halved: int
) -> tuple[State, list[StepResult]]:
    """Compute both halves of a span."""
    begin, middle, end = span
    state, first = _parts(problem, state, index, (begin, middle), halved + 1)
    state, second = _parts(problem, state, index, (middle, end), halved + 1)
    return state, first + second


def _slides_while_touching(problem: Problem, state: State, after: State) -> bool:
    """Return whether nodes of nonlinear bodies that close in a step do too large a part of the frictional work."""
    allowed = problem.criteria.friction_while_touching
    if allowed is None or problem.bodies is None or state.work is None or after.work is None:
        return False
    return after.work.touching - state.work.touching > allowed * after.work.friction


def _sized(problem: Problem, state: State, result: StepResult, halved: int) -> State:
    """Return the state with the minimum number of halvings of the next step."""
    if problem.bodies is None:
        return state
    few = len(result.iterations["history"]) <= FEW
    return replace(state, halved=max(halved - few, 0))


def _joined(parts: list[StepResult]) -> StepResult:
    """Return the last substep with the sums over all substeps."""
    end = parts[-1]
    if len(parts) == 1:
        return end
    logs = [part.iterations for part in parts]
    history = [entry for log in logs for entry in log["history"]]
    iterations = {**end.iterations, "substeps": [part.load_factor for part in parts], "history": history}
    for name in ("geometry_updates", "active_set_iterations", "linear_iterations"):
        iterations[name] = sum(log[name] for log in logs)
    contact = {
        name: replace(
            result,
            dissipation=sum(part.contact[name].dissipation for part in parts),
            slip=np.sum([part.contact[name].slip for part in parts], axis=0),
        )
        for name, result in end.contact.items()
    }
    return replace(end, contact=contact, iterations=iterations)
