"""Load steps that do not converge are cut in halves; what fails leaves the analysis as it was before."""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

from fastcontact.analysis.analysis import Analysis
from fastcontact.errors import ConvergenceError
from fastcontact.results.step import StepResult

log = logging.getLogger("fastcontact")
# What a step changes: of the analysis, of each of its pairs, of the primary side of a pair, of the extrapolation, of
# the right-hand sides that a direct solver knows.
# Arrays among it are replaced, never written into; dictionaries and lists are copied.
_ANALYSIS = (
    "u", "before", "external", "expected", "active", "pressure", "parts", "largest_force", "largest_work", "round_off",
    "settled", "rubbing", "touched", "unsettled",
)  # fmt: skip
_PAIR = ("before", "_closed")
_SIDE = ("now", "before")
_EXTRAPOLATION = ("ratio", "_loads", "_states")
_LOADS = ("_loads", "_solutions")

State = list[tuple[Any, dict[str, Any]]]


def snapshot(analysis: Analysis) -> State:
    """Return all that a load step changes in `analysis`, for `restore`."""
    found = [_kept(analysis, _ANALYSIS), _kept(analysis.extrapolation, _EXTRAPOLATION)]
    if hasattr(analysis.solver, "known_loads"):
        found.append(_kept(analysis.solver.known_loads, _LOADS))
    for pair in analysis.pairs.values():
        found += [_kept(pair, _PAIR), _kept(pair.terms, ("factor",)), _kept(pair.primary, _SIDE)]
    return found


def restore(state: State) -> None:
    """Put back what `snapshot` returned; a state may be restored several times."""
    for owner, values in state:
        for name, value in values.items():
            setattr(owner, name, _copied(value))


def _kept(owner: Any, names: tuple[str, ...]) -> tuple[Any, dict[str, Any]]:
    return owner, {name: _copied(getattr(owner, name)) for name in names if hasattr(owner, name)}


def _copied(value: Any) -> Any:
    return value.copy() if isinstance(value, (dict, list)) else value


def advance(analysis: Analysis, index: int, begin: float, end: float, max_halvings: int = 0) -> StepResult:
    """Solve the step `index` from instant `begin` to `end`, in halves of halves where it does not converge.

    Parts of the step are steps of their own: friction slides along their path. The result is that at `end`, with the
    iterations and the dissipation of all parts; ``iterations["substeps"]`` lists the instants of their ends where it was cut.

    Raises
    ------
    ConvergenceError
        If a part that was halved `max_halvings` times does not converge, or one that no halving can help; the analysis is
        then as it was at `begin`.
    """
    state = snapshot(analysis)
    try:
        return _joined(_parts(analysis, index, begin, end, max_halvings, 0))
    except ConvergenceError:
        restore(state)
        raise


def _parts(analysis: Analysis, index: int, begin: float, end: float, limit: int, halved: int) -> list[StepResult]:
    middle = 0.5 * (begin + end)
    state = snapshot(analysis)
    try:
        return [analysis.step(index, end)]
    except ConvergenceError as error:
        if halved == limit or not begin < middle < end or not error.smaller_steps_help:
            where = f"from {begin:.6g} to {end:.6g}"
            often = "once" if halved == 1 else f"{halved} times"
            part = (
                f"step {index} was cut in halves {often}, the part {where} fails" if halved else f"step {index} {where}"
            )
            raise ConvergenceError(f"{error} ({part})", error.history, smaller_steps_help=False) from error
        reason = str(error).split(". ")[0]
        log.warning("step %d from %.6g to %.6g does not converge, cut in halves: %s", index, begin, end, reason)
    restore(state)
    first = _parts(analysis, index, begin, middle, limit, halved + 1)
    return first + _parts(analysis, index, middle, end, limit, halved + 1)


def _joined(parts: list[StepResult]) -> StepResult:
    """Return the last part with what adds up over all of them."""
    end = parts[-1]
    if len(parts) == 1:
        return end
    logs = [part.iterations for part in parts]
    history = [entry for log in logs for entry in log["history"]]
    iterations = {**end.iterations, "substeps": [part.load_factor for part in parts], "history": history}
    for name in ("geometry_updates", "active_set_iterations", "linear_iterations"):
        iterations[name] = sum(log[name] for log in logs)
    contact = {
        name: replace(result, dissipation=sum(part.contact[name].dissipation for part in parts))
        for name, result in end.contact.items()
    }
    return replace(end, contact=contact, iterations=iterations)
