"""Runs of studies of Python models: a function makes the model of a size or of parameters, others measure its last step."""

from __future__ import annotations

import inspect
import sys
import time
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.reduction import ForkingPickler
from typing import Any

import numpy as np

from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.run import solve
from fastcontact.cases.case import Case
from fastcontact.errors import CaseError, FastcontactError, unknown
from fastcontact.linear.protocol import TOLERANCE
from fastcontact.model.model import Model
from fastcontact.model.ramp import linear_ramp
from fastcontact.results.step import StepResult
from fastcontact.results.units import known_units
from fastcontact.studies import quantities
from fastcontact.studies.execute import Progress, raise_first, run_all
from fastcontact.studies.job import Run, profile, recorded
from fastcontact.studies.progress import told

# Of the last step; with an argument of the name `STEPS`, of the list of all steps.
Measure = Callable[..., float]
# Names of quantities, or functions by name.
Quantities = Sequence[str] | Mapping[str, Measure]
STEPS = "steps"
Function = Callable[..., Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class FunctionRun(Run):
    """A call of a function that makes a model, or solves one."""

    function: Function
    positional: tuple[Any, ...]  # arguments
    named: Mapping[str, Any]
    measures: Mapping[str, Measure]  # further quantities

    def measured(self) -> dict[str, Any]:
        """See `Run`."""
        started = time.perf_counter()
        with recorded() as texts:
            case, steps = _solved(self._made(), self.name)
        last = steps[-1]
        pair = next(iter(last.contact), None)
        values = quantities.measure(case, last, pair) if case else quantities.of_contacts(last)
        values = {name: value for name, value in values.items() if np.isfinite(value)}
        return {
            "h": quantities.mesh_size(case, pair) if case else float("nan"),
            "n_dofs": last.displacement.size,
            "values": values | {name: _number(name, measure, steps) for name, measure in self.measures.items()},
            "theory": {},
            "reference": {},
            "equal_force": {},
            "profile": profile(last, pair),
            "seconds": time.perf_counter() - started,
            "warnings": texts,
            "units": dict(last.units),
        }

    def _made(self) -> Any:
        """Return what the function returns; CaseError with the line of it that failed."""
        try:
            return self.function(*self.positional, **self.named)
        except FastcontactError:
            raise
        except Exception as error:
            lines = [entry.lineno for entry in traceback.extract_tb(error.__traceback__)][1:2]
            where = f" at line {lines[0]}" if lines else ""
            raise CaseError(f"the function {self.name} failed{where}: {type(error).__name__}: {error}") from error


def _solved(made: Any, name: str) -> tuple[Case | None, Sequence[StepResult]]:
    """Return the steps of what a function has made; of a model, solved here, also the case that it is."""
    if isinstance(made, Model):
        case = Case(
            name=name, title=name, text="", mesh=made.mesh, model=made, ramp=linear_ramp(), criteria=Criteria(),
            linear_solver="auto", linear_tolerance=TOLERANCE, probes={}, units=known_units(made.units),
        )  # fmt: skip
        return case, solve(made, case.ramp)
    if isinstance(made, StepResult):
        return None, [made]
    if isinstance(made, Sequence) and len(made) and isinstance(made[-1], StepResult):
        return None, made
    raise CaseError(
        f"the function {name} must return a Model, or what fc.solve returns, not {type(made).__name__}: end it with 'return'"
    )


def _number(name: str, measure: Measure, steps: Sequence[StepResult]) -> float:
    """Return a quantity of the caller's."""
    try:
        return float(measure(steps if first_parameter(measure) == STEPS else steps[-1]))
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise CaseError(
            f"the quantity '{name}' is a function that failed ({reason}): it must return a number of the last StepResult, "
            f"or of the list of all if its argument is called '{STEPS}'"
        ) from error


def function_name(function: Function) -> str:
    """Return the name of a function for tables and messages."""
    return str(getattr(function, "__name__", type(function).__name__))


def first_parameter(function: Function) -> str:
    """Return the name of the first argument of a function."""
    try:
        return next(iter(inspect.signature(function).parameters), "value")
    except (TypeError, ValueError):  # of one that is compiled
        return "value"


def of_function(function: Function, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the fields of a `Report` that are those of a function; its text is its source where Python has it.

    Units are those of the models in the `results`.
    """
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        text = ""
    name, units = function_name(function), next((result["units"] for result in results if result.get("units")), None)
    title = (inspect.getdoc(function) or name).partition("\n")[0]
    return {"name": name, "title": title, "text": text, "units": known_units(units or {})}


def measures_of(wanted: Quantities) -> dict[str, Measure]:
    """Return the functions among the quantities; CaseError for a name that no run of a function can have."""
    if isinstance(wanted, Mapping):
        return dict(wanted)
    for name in wanted:
        if name not in quantities.LABELS:
            raise CaseError(
                unknown("quantity", name, quantities.LABELS)
                + "; others are given as functions of the last step, such as quantities={'top': lambda step: ...}"
            )
    return {}


def refuse(of_cases: Mapping[str, Any]) -> None:
    """Raise CaseError for a given option that only studies of case files have."""
    for name, value in of_cases.items():
        if value is not None:
            raise CaseError(
                f"'{name}' is for case files: a function makes the mesh and the contact itself, leave it out"
            )


def run_functions(
    runs: Sequence[FunctionRun],
    name: str,
    *,
    executor: Executor | None,
    workers: int | None,
    store: Any,
    on_progress: Callable[[Progress], None] | None,
    progress: bool,
) -> list[dict[str, Any]]:
    """Return the results of the runs, by default one after the other in this process; `name` begins the error if all fail."""
    if (executor is not None or (workers or 1) > 1) and not isinstance(executor, ThreadPoolExecutor):
        _check_sendable(runs[0])
    with told(on_progress, progress) as told_to:
        results = run_all(runs, executor=executor, workers=workers or 1, store=store, on_progress=told_to)
    raise_first(name, runs, results)
    return results


def _check_sendable(run: FunctionRun) -> None:
    """Raise CaseError for a function that cannot be sent to another process, or that it would not find there."""
    try:
        if any(function.__module__ == "__main__" for function in (run.function, *run.measures.values())):
            inspect.getfile(sys.modules["__main__"])  # TypeError without one, as in notebooks
        ForkingPickler.dumps(run)
    except Exception as error:
        raise CaseError(
            f"{run.name} or a quantity cannot be sent to other processes ({error}): define functions with names at the top "
            "of a module, or use workers=1"
        ) from error
