"""Runs of a study, which can be sent to processes on any machine and return their results as plain data."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import hashlib
import inspect
import json
import math
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._jit import decorators as _jit
from fastcontact._version import __version__
from fastcontact.analysis.run import solve, solve_steps
from fastcontact.cases.case import Case, build_case, digest, referenced_files, stored_description
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.errors import CaseError, FastcontactError, FastcontactWarning, warn
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.fingerprint import digest_of_mesh
from fastcontact.model.model import Model
from fastcontact.model.pair_options import SHARED_OPTIONS
from fastcontact.model.ramp import linear_ramp
from fastcontact.results.step import StepResult
from fastcontact.results.units import known_units
from fastcontact.studies import quantities
from fastcontact.studies.settings import Combination, Recipe, Settings, make_mesh, recipe

# Keys of contact pairs and obstacles that are valid for all formulations, in addition to `SHARED_OPTIONS`.
COMMON_KEYS = {
    *("secondary", "primary", "formulation", "friction", "shape", "motion", "force", "rotation", "ramp"),
    *("file", "group", "flip", "crease"),
}
# Version of the results in a store, incremented when the quantities or their form change.
SCHEMA = 7
# A function of the last step, or of the list of all steps if its argument has the name `STEPS_ARGUMENT`.
Measure = Callable[..., float]
# Names of quantities, or functions by the name of their quantity.
Quantities = Sequence[str] | Mapping[str, Measure]
STEPS_ARGUMENT = "steps"
Function = Callable[..., Any]


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """One run of a study."""

    label: str  # for messages
    name: str  # name of the case or of the model function
    marks: dict[str, Any]  # values that distinguish the run from other runs of the study, for example the level
    size: float = 0.0  # measure of the work; larger runs start first
    pair: str | None = None  # contact pair to evaluate; None for the first one
    measures: Mapping[str, Measure] = field(default_factory=dict)  # functions of additional quantities, by name

    def solve_run(self) -> tuple[Case | None, Sequence[StepResult]]:
        """Solve the run. Returns its case, or None if it is unknown, and all steps of the solution or only the last one."""
        raise NotImplementedError

    def evaluate(self) -> dict[str, Any]:
        """Solve the run and return its result, see `execute_run`. Errors of mesh, model and solution are raised."""
        started = time.perf_counter()
        with record_warnings() as texts:
            case, steps = self.solve_run()
        last = steps[-1]
        pair = self.pair or next(iter(last.contact), None)
        values = quantities.quantities_of_contacts(last) if case is None else quantities.measure(case, last, pair)
        values = {name: value for name, value in values.items() if np.isfinite(value)}
        spacings = quantities.node_spacings(last, pair, values, None if case is None else case.mesh)
        values |= {name: _measured_value(name, measure, steps) for name, measure in self.measures.items()}
        return {
            "h": math.nan if case is None else quantities.mesh_size(case, pair),
            "n_dofs": last.displacement.size,
            "values": values,
            "spacings": spacings,
            **quantities.comparison_values(case, pair, values.get("force", 0.0)),
            "profile": profile(last, pair),
            "iterations": {k: int(v) for k, v in last.iterations.items() if isinstance(v, int)},
            "seconds": time.perf_counter() - started,
            "warnings": texts,
            "units": dict(last.units),
            "pairs": list(dict.fromkeys((*filter(None, [pair]), *last.contact))),
        }

    @property
    def key(self) -> str:
        """Name of the run in a store, a hash of all its inputs. Raises CaseError if the inputs are unknown."""
        raise CaseError("a store is for case files, since the inputs of a function are not known: leave out 'store'")


@dataclass(frozen=True, eq=False, kw_only=True)
class Job(Run):
    """A run of a case."""

    data: dict[str, Any]  # parsed case file with the values of this run
    recipe: Recipe  # recipe of the mesh
    base: Mesh | None  # mesh of the case, if it is read from a file
    folder: Path = Path()  # folder to which file names in the case are relative
    substituted: dict[str, Any] = field(default_factory=dict)  # case before the settings of the study were applied

    @cached_property  # the contents of the files are hashed once, at the start of a study
    def key(self) -> str:
        """Hash of all inputs of the run: the case, its mesh, the contents of the files in the case, and the version."""
        inputs = {"version": __version__, "schema": SCHEMA, **self.inputs}
        inputs["files"] = digest(referenced_files(self.inputs["data"], self.folder))
        inputs["mesh"] = None if self.base is None else digest_of_mesh(self.base)
        return hashlib.sha256(json.dumps(inputs, sort_keys=True, default=str).encode()).hexdigest()[:32]

    @property
    def inputs(self) -> dict[str, Any]:
        """All inputs of the run, except for the mesh `base` and the contents of files."""
        unread = ("mesh", "title", "units", "check", "sensitivity", "modes")
        data = {key: value for key, value in self.data.items() if key not in unread}
        data["theory"] = {pair: theory for pair, theory in data.get("theory", {}).items() if pair == self.pair}
        return {"data": data, "pair": self.pair, "recipe": self.recipe}

    def solve_run(self) -> tuple[Case, list[StepResult]]:
        """See `Run`. If the theory is not defined for the values of this run, the case is solved without it."""
        data = self.data
        try:
            stored_description(data)
        except FastcontactError as error:
            warn(f"there is no theory here: {error}")
            data = {key: value for key, value in data.items() if key not in ("theory", "check")}
        case = build_case(data, name=self.name, folder=self.folder, mesh=make_mesh(self.recipe, self.base))
        return case, [last_step(case)]


@dataclass(frozen=True, eq=False, kw_only=True)
class FunctionRun(Run):
    """A run that calls a function, which returns a model or the steps of its solution."""

    function: partial[Any]  # the function with its arguments

    def solve_run(self) -> tuple[Case | None, Sequence[StepResult]]:
        """See `Run`."""
        result = self._call()
        if isinstance(result, Model):
            case = Case(self.name, self.name, "", result.mesh, result, linear_ramp(), units=known_units(result.units))
            return case, solve(result, case.ramp)
        if isinstance(result, StepResult):
            return None, [result]
        if isinstance(result, Sequence) and len(result) and isinstance(result[-1], StepResult):
            return None, result
        raise CaseError(
            f"the function {self.name} must return a Model, or what fc.solve returns, not {type(result).__name__}: end it "
            "with 'return'"
        )

    def _call(self) -> Any:
        """Return the result of the function; CaseError, with the line of the error, if it fails."""
        try:
            return self.function()
        except FastcontactError:
            raise
        except Exception as error:
            lines = [entry.lineno for entry in traceback.extract_tb(error.__traceback__)][1:2]
            where = f" at line {lines[0]}" if lines else ""
            raise CaseError(f"the function {self.name} failed{where}: {type(error).__name__}: {error}") from error


class QuantityError(CaseError):
    """A function of a quantity has failed."""


def _measured_value(name: str, measure: Measure, steps: Sequence[StepResult]) -> float:
    """Return the value of a quantity that a function of the caller evaluates; QuantityError if the function fails."""
    try:
        return float(measure(steps if first_parameter(measure) == STEPS_ARGUMENT else steps[-1]))
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise QuantityError(
            f"the quantity '{name}' is a function that failed ({reason}): it must return a number for the last "
            f"StepResult, or for the list of all steps if its argument is called '{STEPS_ARGUMENT}'"
        ) from error


def first_parameter(function: Function) -> str:
    """Return the name of the first argument of a function, or ``"value"`` if it is unknown."""
    try:
        return next(iter(inspect.signature(function).parameters), "value")
    except (TypeError, ValueError):  # compiled functions have no signature
        return "value"


@contextlib.contextmanager
def record_warnings() -> Iterator[list[str]]:
    """Yield a list to which, at the end of a ``with`` block, the warnings of the package in this block are added."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FastcontactWarning)
        yield texts
    texts += [str(entry.message) for entry in caught if issubclass(entry.category, FastcontactWarning)]


def job_of(case: Case, setup: Settings, combination: Combination, level: int, **fields: Any) -> Job:
    """Return the job of a case with the element and the formulation of `combination` on the mesh of a level.

    `fields` are the other fields of a `Run`: its label, its marks and its size.
    """
    data, mesh = case_data(setup, combination), recipe(setup, combination.element, level)
    base = case.mesh if setup.generator is None else None
    return Job(
        name=case.name, data=data, pair=setup.pair, recipe=mesh, base=base, substituted=setup.data,
        folder=case.folder, **fields,
    )  # fmt: skip


def case_data(settings: Settings, combination: Combination) -> dict[str, Any]:
    """Return the data of the case with the formulation of a combination and with the options and load steps of the study.

    Options that the formulation does not have are removed.
    """
    data = copy.deepcopy({key: value for key, value in settings.data.items() if key != "study"})
    formulation, pairs = combination.formulation, data.get("contact", {})
    if formulation:
        if pairs == "auto" or "contacts" in data:
            original = settings.case_combination.formulation or ""
            _set_formulation(data.setdefault("contacts", {}), formulation, settings, original)
        for name, entry in {**(pairs if isinstance(pairs, dict) else {}), **data.get("obstacle", {})}.items():
            _set_formulation(entry, formulation, settings, settings.formulations[name])
    if settings.load_steps is not None:
        ramp, steps = data.setdefault("ramp", {}), settings.load_steps
        if "instants" in ramp:
            ramp["instants"] = [ramp["instants"][-1] * (k + 1) / steps for k in range(steps)]
        else:
            ramp["steps"] = steps
    return data


def _set_formulation(entry: dict[str, Any], formulation: str, settings: Settings, original: str) -> None:
    """Set the formulation and its options in the table of a contact pair or an obstacle, instead of the `original` one."""
    if formulation != original:
        valid = {f.name for f in dataclasses.fields(FORMULATIONS[formulation])} | COMMON_KEYS | set(SHARED_OPTIONS)
        for key in [key for key in entry if key not in valid]:
            del entry[key]
        entry["formulation"] = formulation
    entry.update(settings.options.get(formulation, {}))


def execute_run(run: Run, threads: int | None = None) -> dict[str, Any]:
    """Execute a run and return its result; errors are not raised but returned under the key ``"error"``.

    `threads` is the number of threads of the parallel kernels in this process. The result contains ``h`` [length],
    ``n_dofs``, ``seconds`` [s], ``iterations``, ``warnings``, ``profile``, ``units`` and, by quantity, ``values``,
    ``theory``, ``reference`` and ``equal_force``. After an error it contains ``error`` and ``kind``, the name of the
    exception.
    """
    try:
        if threads is not None:
            _jit.set_threads(threads)
        return run.evaluate()
    except FastcontactError as error:
        return {"error": str(error), "kind": type(error).__name__}
    except Exception as error:
        # An unexpected failure of one run must not end the study.
        frame = traceback.extract_tb(error.__traceback__)[-1]
        return {"error": f"{error} ({frame.name}, line {frame.lineno})", "kind": type(error).__name__}


def fields_of(kind: type, result: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of a result that are fields of the dataclass `kind`."""
    fields = {field.name: result[field.name] for field in dataclasses.fields(kind) if field.name in result}
    return {**fields, "warnings": tuple(fields["warnings"])}


def last_step(case: Case) -> StepResult:
    """Solve a case and return its last step, without keeping earlier steps in memory."""
    return deque(solve_steps(case.model, case.ramp, **case.solve_arguments), maxlen=1).pop()


def profile(last: StepResult, pair: str | None) -> dict[str, list[float]]:
    """Return the lists ``r`` [length] and ``pressure`` [pressure] along the contact of a 2D model; empty for other models."""
    if pair is None or last.displacement.shape[1] != 2:
        return {}
    contact = last.contact[pair]
    order = np.argsort(contact.place, kind="stable")
    return {"r": contact.place[order].tolist(), "pressure": contact.pressure[order].tolist()}
