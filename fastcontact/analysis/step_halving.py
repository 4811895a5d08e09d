"""Bisection of load steps that do not converge; a failed step leaves the state unchanged."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.errors import ConvergenceError
from fastcontact.results.step import StepResult

log = logging.getLogger("fastcontact")
# Called with the number of a step, and the instants between which it does not converge and is cut in halves.
listeners: list[Callable[[int, float, float], None]] = []


def advance(problem: Problem, state: State, index: int, begin: float, end: float) -> tuple[State, StepResult]:
    """Compute the step `index` from instant `begin` to `end`, in halves of halves where it does not converge.

    Parts of the step are steps of their own: friction slides along their path. The result is that at `end`, with the
    iterations and the dissipation of all parts; ``iterations["substeps"]`` lists the instants of their ends where it was cut.

    Raises
    ------
    ConvergenceError
        If a part that was halved `Criteria.max_halvings` times does not converge, or one that no halving can help.
    """
    state, parts = _parts(problem, state, index, (begin, end), 0)
    return state, _joined(parts)


def _parts(
    problem: Problem, state: State, index: int, span: tuple[float, float], halved: int
) -> tuple[State, list[StepResult]]:
    begin, end = span
    middle = 0.5 * (begin + end)
    try:
        state, result = load_step(problem, state, index, end)
        return state, [result]
    except ConvergenceError as error:
        if halved == problem.criteria.max_halvings or not begin < middle < end or not error.smaller_steps_help:
            where = f"from {begin:.6g} to {end:.6g}"
            often = "once" if halved == 1 else f"{halved} times"
            part = (
                f"step {index} was cut in halves {often}, the part {where} fails" if halved else f"step {index} {where}"
            )
            told = ConvergenceError(f"{error} ({part})", error.history, smaller_steps_help=False)
            # As raised where it was found: the same words twice, in two tracebacks, would tell nothing more.
            raise told.with_traceback(error.__traceback__) from None
        reason = str(error).split(". ")[0]
        for listener in listeners:
            listener(index, begin, end)
        log.warning("step %d from %.6g to %.6g does not converge, cut in halves: %s", index, begin, end, reason)
    state, first = _parts(problem, state, index, (begin, middle), halved + 1)
    state, second = _parts(problem, state, index, (middle, end), halved + 1)
    return state, first + second


def _joined(parts: list[StepResult]) -> StepResult:
    """Return the last part with the sums over all parts."""
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
