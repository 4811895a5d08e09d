"""What the next load step owes to the steps before it, as plain data: taken when a step ends, put back to go on from it.

`step_control` knows what a step changes in an analysis. Of that, a step result holds the displacements; the rest that a
step does not set anew as it begins is here. What later iterates owe to earlier ones in their last digits is here too
(where active sets, extrapolations and linear solvers start from), so that an analysis that goes on repeats an
uninterrupted one bit for bit.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.analysis.analysis import Analysis
from fastcontact.analysis.criteria import Criteria
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.errors import ModelError
from fastcontact.model.fingerprint import different, fingerprint
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, table_value
from fastcontact.results.step import StepResult

Array = NDArray[np.float64]
FORMAT = 1
# Criteria that an answer depends on; others are limits and tolerances.
ANSWER = ("geometry_updates", "keep_pairing")
# Instants that differ by less than this part of their size are one.
SAME_INSTANT = 1e-12
# Numbers of an analysis that grow from step to step.
NUMBERS = ("largest_force", "largest_work", "round_off")


def identity(model: Model, ramp: Ramp, criteria: Criteria) -> dict[str, Any]:
    """Return what tells a case from another one: digests of its parts, and its load history."""
    options = {name: getattr(criteria, name) for name in ANSWER}
    return {"parts": fingerprint(model, options), "table": [list(row) for row in ramp.table]}


def check(step: StepResult, case: dict[str, Any]) -> None:
    """Raise ModelError if nothing can go on after `step`, or not the `case` of `identity`; the message says why."""
    state = step.restart
    if state is None or state.get("format") != FORMAT:
        raise ModelError(
            f"step {step.index} does not hold what it takes to go on from it: resume from the last step that solve "
            "returned, or from a result file of this version of fastcontact; or start anew"
        )
    then, end = state["case"], step.load_factor
    parts = different(then["parts"], case["parts"])
    if _history(then["table"], end, case["table"]) != _history(case["table"], end, then["table"]):
        parts.append(f"the load history up to {end:g}")
    if parts:
        raise ModelError(
            f"the steps so far belong to another case; changed since: {', '.join(parts)}. Go on with what they "
            "were computed for, or start anew without resuming"
        )


def taken(analysis: Analysis, case: dict[str, Any]) -> dict[str, Any]:
    """Return the state after a step; `case` from `identity`."""
    solver, n = analysis.solver, analysis.model.n_dofs
    state: dict[str, Any] = {
        "format": FORMAT,
        "case": case,
        "numbers": {name: float(getattr(analysis, name)) for name in NUMBERS},
        "obstacles": analysis.u[n:].copy(),
        "active": dict(analysis.active),
        "pressure": dict(analysis.pressure),
        "pairs": {name: _of_pair(pair) for name, pair in analysis.pairs.items()},
        "solver": {"kind": _kind(solver), "memory": solver.memory()},
    }
    if solver.iterative:  # only then do steps start from extrapolated ones
        state["extrapolation"] = _of_extrapolation(analysis.extrapolation)
    return state


@on_one_blas_thread
def put_back(analysis: Analysis, step: StepResult) -> None:
    """Let a fresh analysis go on after `step`, which `check` has found to fit."""
    state = step.restart
    assert state is not None
    analysis.u = np.concatenate([step.displacement.ravel(), state["obstacles"]])
    for name, value in state["numbers"].items():
        setattr(analysis, name, value)
    analysis.active, analysis.pressure = dict(state["active"]), dict(state["pressure"])
    for name, kept in state["pairs"].items():
        _to_pair(analysis.pairs[name], kept)
    if state["solver"]["kind"] == _kind(analysis.solver):
        analysis.solver.remember(state["solver"]["memory"])
    if analysis.solver.iterative and "extrapolation" in state:
        _to_extrapolation(analysis.extrapolation, state["extrapolation"], analysis.u)


def remaining(ramp: Ramp, last: StepResult | None) -> list[float]:
    """Return the instants of a ramp after the last step so far, all of them where there is none."""
    if last is None:
        return list(ramp.instants)
    end = last.load_factor
    return [t for t in ramp.instants if t > end and abs(t - end) > SAME_INSTANT * max(abs(t), abs(end))]


def _history(table: Sequence[Sequence[float]], end: float, other: Sequence[Sequence[float]]) -> list[float]:
    """Return multipliers of the loads where one of two tables bends before `end`, and there."""
    rows = tuple((float(t), float(value)) for t, value in table)
    instants = sorted({*(t for t, _ in (*rows, *other) if t < end), end})
    return [float(f"{table_value(rows, t):.12g}") for t in instants]


def _kind(solver: Any) -> list[Any]:
    """Return what solvers that take each other's memory share."""
    return [getattr(solver, "name", type(solver).__name__), solver.tolerance]


def _of_pair(pair: Any) -> dict[str, Any]:
    kept: dict[str, Any] = {"closed": None, "now": None, "first_contact": None}
    if pair._closed is not None:
        kept["closed"] = list(pair._closed)
    if isinstance(pair.primary, RigidSide):
        kept["now"] = pair.primary.now.copy()
    if "first_contact" in vars(pair):  # found in the first step, from where its obstacle stood then
        kept["first_contact"] = list(pair.first_contact)
    return kept


def _to_pair(pair: Any, kept: dict[str, Any]) -> None:
    if kept["closed"] is not None:
        at, closed = kept["closed"]
        pair._closed = at, closed
    if kept["now"] is not None:
        pair.primary.now = kept["now"].copy()
    if kept["first_contact"] is not None:
        vars(pair)["first_contact"] = tuple(kept["first_contact"])


def _of_extrapolation(extrapolation: Any) -> dict[str, Any]:
    """Return the last two loads, sparse as they are, and solutions, but for the last displacements."""
    states = extrapolation._states
    return {
        "loads": [_sparse(load) for load in extrapolation._loads[-2:]],
        "before": states[0][0] if len(states) == 2 else None,
        "contact": [{name: list(both) for name, both in contact.items()} for _, contact in states],
    }


def _to_extrapolation(extrapolation: Any, kept: dict[str, Any], u: Array) -> None:
    displacements = [u] if kept["before"] is None else [kept["before"], u]
    contacts = [{name: tuple(both) for name, both in contact.items()} for contact in kept["contact"]]
    extrapolation._loads = [_dense(load) for load in kept["loads"]]
    extrapolation._states = list(zip(displacements, contacts)) if contacts else []


def _sparse(values: Array) -> dict[str, Any]:
    places = np.flatnonzero(values)
    return {"size": len(values), "places": places, "values": values[places]}


def _dense(kept: dict[str, Any]) -> Array:
    values = np.zeros(kept["size"])
    values[kept["places"]] = kept["values"]
    return values
