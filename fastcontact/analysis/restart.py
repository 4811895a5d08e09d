"""Restart data, as plain numbers, strings and arrays.

The data consist of the state at the end of a step, of a snapshot of the linear solver, and of the identity of the case.
Displacements are not included, since the result of the step contains them. The state includes everything on which the last
digits of later iterates depend, so that the results of a continued and of an uninterrupted analysis are bitwise identical.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from fastcontact._jit.parallel import on_one_blas_thread
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array
from fastcontact.errors import ModelError
from fastcontact.model.fingerprint import differing_parts, fingerprint, formulation_of_digest
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, table_value
from fastcontact.results.step import StepResult
from fastcontact.round_off import ROUND_OFF

# Version of the restart data; those of other versions are rejected.
FORMAT = 1
# Criteria on which the solution depends; the others are limits and tolerances.
SOLUTION_CRITERIA = ("geometry_updates", "keep_pairing")


def identity(model: Model, ramp: Ramp, criteria: Criteria) -> dict[str, Any]:
    """Return the identity of a case: digests of its parts, and its load history."""
    options = {name: getattr(criteria, name) for name in SOLUTION_CRITERIA}
    return {"parts": fingerprint(model, options), "table": [list(row) for row in ramp.table]}


def check(step: StepResult, case: dict[str, Any], model: Model) -> None:
    """Raise a ModelError with the reason if `step` has no restart data, or belongs to a case other than `case`."""
    state = step.restart
    if state is None or state.get("format") != FORMAT:
        raise ModelError(
            f"step {step.index} does not contain restart data: use the last step that solve returned, or the last one of a "
            "result file of this version of fastcontact, or start anew"
        )
    with _damage_reported(step):
        saved, end = state["case"], step.load_factor
        changed = differing_parts(saved["parts"], case["parts"])
        if _history(saved["table"], end, case["table"]) != _history(case["table"], end, saved["table"]):
            changed.append(f"the load history up to {end:g}")
    if changed:
        raise ModelError(
            f"the steps so far belong to another case; changed since: {', '.join(changed)}. Continue with the model for "
            f"which they were computed, or start anew without resuming{_formulations(saved['parts'], case['parts'], model)}"
        )


def _formulations(saved: dict[str, str], current: dict[str, str], model: Model) -> str:
    """Return the end of a message, which names the saved formulations of the pairs that differ only in the formulation."""
    changed = [pair.name for pair in model.contact if saved.get(key := f"contact '{pair.name}'") != current[key]]
    formulations = {name: formulation_of_digest(model, name, saved.get(f"contact '{name}'")) for name in changed}
    named = [f"contact '{name}' had {text}" for name, text in formulations.items() if text]
    return f" ({'; '.join(named)}: specify this formulation)" if named else ""


def restart_data(problem: Problem, state: State, case: dict[str, Any]) -> dict[str, Any]:
    """Return the restart data after a step; `case` is the value of `identity`."""
    data = state.to_dict(problem.model.n_dofs)
    extrapolation, memory = data.pop("extrapolation"), data.pop("solver")
    data = {"format": FORMAT, "case": case, **data, "solver": {"kind": _kind(problem.solver), "memory": memory}}
    if problem.extrapolates:
        data["extrapolation"] = extrapolation
    return data


@on_one_blas_thread
def put_back(problem: Problem, step: StepResult, touched: frozenset[str]) -> State:
    """Return the state after `step`, which `check` has accepted; the linear solver continues from its snapshot.

    `touched` contains the contact pairs that were closed at the end of at least one step.
    """
    data = step.restart
    assert data is not None
    with _damage_reported(step):
        if data["solver"]["kind"] == _kind(problem.solver):
            problem.solver.put_back(data["solver"]["memory"])
        state = State.from_dict(data, step.displacement, touched)
        state = replace(state, elastic_slip={**state.elastic_slip, **_slips_from_tractions(problem, data["pairs"])})
    if not problem.extrapolates:
        state = replace(state, extrapolation=Extrapolation())
    return replace(state, solver=problem.solver.snapshot())


def _slips_from_tractions(problem: Problem, pairs: Mapping[str, Any]) -> dict[str, tuple[Array, Array]]:
    """Return the elastic slips [length] of pairs with a penalty, for files that store tangential tractions instead."""
    slips = {}
    for name in [name for name, data in pairs.items() if data.get("traction")]:
        (positions, traction), stiffness = pairs[name]["traction"], problem.pairs[name].options.tangential_penalty
        if stiffness is None:
            raise ValueError(f"tractions of contact '{name}', which has no tangential penalty")
        slips[name] = positions, traction / stiffness(positions)[:, None]
    return slips


@contextmanager
def _damage_reported(step: StepResult) -> Iterator[None]:
    """Convert errors of incomplete or mistyped restart data into one message."""
    try:
        yield
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(
            f"the restart data of step {step.index} are damaged ({type(error).__name__}: {error}): resume from another file, "
            "or start anew without resuming"
        ) from error


def remaining(ramp: Ramp, last: StepResult | None) -> list[float]:
    """Return the instants of a ramp after the last step, all of them if there is none."""
    if last is None:
        return list(ramp.instants)
    end = last.load_factor
    return [t for t in ramp.instants if t > end and abs(t - end) > ROUND_OFF * max(abs(t), abs(end))]


def _history(table: Sequence[Sequence[float]], end: float, other_table: Sequence[Sequence[float]]) -> list[float]:
    """Return the multipliers of a load at `end` and at earlier breakpoints of either of two tables."""
    rows = tuple((float(t), float(value)) for t, value in table)
    instants = sorted({*(t for t, _ in (*rows, *other_table) if t < end), end})
    return [float(f"{table_value(rows, t):.12g}") for t in instants]


def _kind(solver: Any) -> list[Any]:
    """Return the kind of a solver. Solvers of the same kind can continue from each other's snapshots."""
    return [getattr(solver, "name", type(solver).__name__), solver.original_tolerance or solver.tolerance]
