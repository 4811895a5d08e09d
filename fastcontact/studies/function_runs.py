"""Runs of studies of Python functions, which return a model or its steps, with functions that evaluate quantities."""

from __future__ import annotations

import inspect
import sys
import traceback
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from multiprocessing.reduction import ForkingPickler
from typing import Any

from fastcontact.analysis.run import solve
from fastcontact.cases.case import Case
from fastcontact.errors import CaseError, FastcontactError, unknown
from fastcontact.model.model import Model
from fastcontact.model.ramp import linear_ramp
from fastcontact.results.step import StepResult
from fastcontact.results.units import known_units
from fastcontact.studies import quantities
from fastcontact.studies.execute import run_study
from fastcontact.studies.job import Run

# A function of the last step, or of the list of all steps if its argument is named `STEPS`.
Measure = Callable[..., float]
# Names of quantities, or functions by the name of their quantity.
Quantities = Sequence[str] | Mapping[str, Measure]
STEPS = "steps"
Function = Callable[..., Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class FunctionRun(Run):
    """A run that calls a function which returns a model or the steps of its solution."""

    function: Function
    positional: tuple[Any, ...]  # positional arguments
    named: Mapping[str, Any]  # keyword arguments
    measures: Mapping[str, Measure]  # functions of additional quantities, by name

    def solved(self) -> tuple[Case | None, Sequence[StepResult]]:
        """See `Run`."""
        made = self._result()
        if isinstance(made, Model):
            case = Case(self.name, self.name, "", made.mesh, made, linear_ramp(), units=known_units(made.units))
            return case, solve(made, case.ramp)
        if isinstance(made, StepResult):
            return None, [made]
        if isinstance(made, Sequence) and len(made) and isinstance(made[-1], StepResult):
            return None, made
        raise CaseError(
            f"the function {self.name} must return a Model, or what fc.solve returns, not {type(made).__name__}: end it with "
            "'return'"
        )

    def further(self, steps: Sequence[StepResult]) -> dict[str, float]:
        """See `Run`."""
        return {name: _number(name, measure, steps) for name, measure in self.measures.items()}

    def _result(self) -> Any:
        """Return the result of the function; CaseError with the line of the error if it fails."""
        try:
            return self.function(*self.positional, **self.named)
        except FastcontactError:
            raise
        except Exception as error:
            lines = [entry.lineno for entry in traceback.extract_tb(error.__traceback__)][1:2]
            where = f" at line {lines[0]}" if lines else ""
            raise CaseError(f"the function {self.name} failed{where}: {type(error).__name__}: {error}") from error


def _number(name: str, measure: Measure, steps: Sequence[StepResult]) -> float:
    """Return the value of a quantity that a function of the caller evaluates; CaseError if the function fails."""
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
    """Return the name of the first argument of a function, or ``"value"`` if it is unknown."""
    try:
        return next(iter(inspect.signature(function).parameters), "value")
    except (TypeError, ValueError):  # compiled functions have no signature
        return "value"


def of_function(function: Function, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the fields of a `Report` on a function.

    The text is the source of the function if Python knows it, and the units are those of the models in the `results`.
    """
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        text = ""
    name, units = function_name(function), next((result["units"] for result in results if result.get("units")), None)
    title = (inspect.getdoc(function) or name).partition("\n")[0]
    return {"name": name, "title": title, "text": text, "units": known_units(units or {})}


def measures_of(wanted: Quantities) -> dict[str, Measure]:
    """Return the quantities that are given as functions; CaseError for the name of a quantity that is not known."""
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
    """Raise CaseError if an option that only studies of case files have is given."""
    for name, value in of_cases.items():
        if value is not None:
            raise CaseError(
                f"'{name}' is for case files: a function makes the mesh and the contact itself, leave it out"
            )


def run_functions(
    runs: Sequence[FunctionRun], name: str, *, executor: Executor | None, workers: int | None, **options: Any
) -> list[dict[str, Any]]:
    """Return the results of `run_study`; by default the runs are sequential in this process."""
    if (executor is not None or (workers or 1) > 1) and not isinstance(executor, ThreadPoolExecutor):
        _check_sendable(runs[0])
    return run_study(runs, name, executor=executor, workers=workers or 1, **options)


def _check_sendable(run: FunctionRun) -> None:
    """Raise CaseError if a function cannot be sent to another process or cannot be imported there."""
    try:
        if any(function.__module__ == "__main__" for function in (run.function, *run.measures.values())):
            inspect.getfile(sys.modules["__main__"])  # TypeError without a file, as in notebooks
        ForkingPickler.dumps(run)
    except Exception as error:
        raise CaseError(
            f"{run.name} or a quantity cannot be sent to other processes ({error}): define functions with names at the top "
            "of a module, or use workers=1"
        ) from error
