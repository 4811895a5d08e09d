"""One run of a study: plain data in, plain data out, so that any process on any machine can execute it."""

from __future__ import annotations

import contextlib
import copy
import dataclasses
import hashlib
import json
import math
import time
import traceback
import warnings
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._jit import decorators as _jit
from fastcontact._version import __version__
from fastcontact.analysis.run import solve_steps
from fastcontact.cases.case import Case, build_case
from fastcontact.cases.input_files import digest, files_named
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.errors import CaseError, FastcontactError, FastcontactWarning
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.fingerprint import digest_of_mesh
from fastcontact.model.pair_options import SHARED_OPTIONS
from fastcontact.results.step import StepResult
from fastcontact.studies import quantities
from fastcontact.studies.levels import Recipe, make_mesh, recipe
from fastcontact.studies.settings import Combination, Settings

# Keys of contact pairs and obstacles that are independent of the formulation.
KEYS = {
    *("secondary", "primary", "formulation", "friction", "shape", "motion", "force", "rotation", "ramp"),
    *("file", "group", "flip", "crease"),
}
# Version number, raised when the measured numbers or their form in a store change.
SCHEMA = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class Run:
    """One run of a study."""

    label: str  # for messages
    name: str  # name of the case or of the model function
    marks: dict[str, Any]  # distinguish this run from the others of its study, e.g. its level
    size: float = 0.0  # amount of work, in any unit that the runs of a study share

    def solved(self) -> tuple[Case | None, Sequence[StepResult]]:
        """Return the case of this run, if known, and its steps, or only the last of them."""
        raise NotImplementedError

    def measured(self) -> dict[str, Any]:
        """Return the result of `run`; raises where the mesh, the model or the solution fails."""
        started = time.perf_counter()
        with recorded() as texts:
            case, steps = self.solved()
        last = steps[-1]
        pair = self.pair_of(last)
        values = quantities.of_contacts(last) if case is None else quantities.measure(case, last, pair)
        values = {name: value for name, value in values.items() if np.isfinite(value)} | self.further(steps)
        return {
            "h": math.nan if case is None else quantities.mesh_size(case, pair),
            "n_dofs": last.displacement.size,
            "values": values,
            **quantities.by_theory(case, pair, values.get("force", 0.0)),
            "profile": profile(last, pair),
            "iterations": {k: int(v) for k, v in last.iterations.items() if isinstance(v, int)},
            "seconds": time.perf_counter() - started,
            "warnings": texts,
            "units": dict(last.units),
        }

    def pair_of(self, last: StepResult) -> str | None:
        """Return the contact pair to measure, by default the first one."""
        return next(iter(last.contact), None)

    def further(self, steps: Sequence[StepResult]) -> dict[str, float]:
        """Return further quantities of the steps."""
        return {}

    @property
    def key(self) -> str:
        """Name of the run in a store: a hash of all inputs of its numbers; raises CaseError if these are unknown."""
        raise CaseError(
            "a store keeps runs of case files, whose text tells what they do: of a function leave 'store' out"
        )


@dataclass(frozen=True, eq=False, kw_only=True)
class Job(Run):
    """Data of the run of a case."""

    data: dict[str, Any]  # the parsed case file with all values of this run
    pair: str | None  # contact pair to measure
    recipe: Recipe  # recipe of the mesh
    base: Mesh | None  # the mesh of the case, if read from a file
    folder: Path = Path()  # folder of the files that the case names

    @cached_property  # files are hashed as they are at the start of a study
    def key(self) -> str:
        """Hash of all inputs of the numbers: the case, its mesh, the contents of the files it names, the version."""
        data = {key: value for key, value in self.data.items() if key not in ("title", "units", "check")}
        inputs = {"version": __version__, "schema": SCHEMA, "data": data, "pair": self.pair, "recipe": self.recipe}
        inputs["files"] = digest(files_named({key: data[key] for key in data if key != "mesh"}, self.folder))
        inputs["mesh"] = None if self.base is None else digest_of_mesh(self.base)
        return hashlib.sha256(json.dumps(inputs, sort_keys=True, default=str).encode()).hexdigest()[:32]

    def solved(self) -> tuple[Case, list[StepResult]]:
        """See `Run`."""
        case = build_case(self.data, name=self.name, folder=self.folder, mesh=make_mesh(self.recipe, self.base))
        return case, [last_step(case)]

    def pair_of(self, last: StepResult) -> str | None:
        """See `Run`."""
        return self.pair


@contextlib.contextmanager
def recorded() -> Iterator[list[str]]:
    """Yield a list that holds, after the block, the texts of the package's warnings raised in it."""
    texts: list[str] = []
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FastcontactWarning)
        yield texts
    texts += [str(entry.message) for entry in caught if issubclass(entry.category, FastcontactWarning)]


def job_of(
    case: Case, chosen: Settings, member: Combination, level: int, *, label: str, marks: dict[str, Any], size: float
) -> Job:
    """Return the job of a case with an element and a formulation on the mesh of a level."""
    data, mesh = case_data(chosen, member), recipe(chosen, member.element, level)
    base = case.mesh if chosen.generator is None else None
    return Job(
        label=label, name=case.name, marks=marks, size=size,
        data=data, pair=chosen.pair, recipe=mesh, base=base, folder=case.folder,
    )  # fmt: skip


def case_data(settings: Settings, combination: Combination) -> dict[str, Any]:
    """Return the case data with another formulation, and with the options and number of load steps of the study.

    Options that another formulation does not have are dropped.
    """
    data = copy.deepcopy({key: value for key, value in settings.data.items() if key != "study"})
    formulation, pairs = combination.formulation, data.get("contact", {})
    if formulation:
        if pairs == "auto" or "contacts" in data:
            _exchange(data.setdefault("contacts", {}), formulation, settings, settings.own.formulation or "")
        for name, entry in {**(pairs if isinstance(pairs, dict) else {}), **data.get("obstacle", {})}.items():
            _exchange(entry, formulation, settings, settings.formulations[name])
    if settings.load_steps is not None:
        data["ramp"] = ramp_of(data.get("ramp", {}), settings.load_steps)
    return data


def _exchange(entry: dict[str, Any], formulation: str, settings: Settings, name: str) -> None:
    """Replace the formulation in the table of a contact pair or obstacle `name`."""
    if formulation != name:
        known = {f.name for f in dataclasses.fields(FORMULATIONS[formulation])} | KEYS | set(SHARED_OPTIONS)
        for key in [key for key in entry if key not in known]:
            del entry[key]
        entry["formulation"] = formulation
    entry.update(settings.options.get(formulation, {}))


def ramp_of(ramp: dict[str, Any], steps: int) -> dict[str, Any]:
    """Return a ramp of equal steps with the same end."""
    if "instants" not in ramp:
        return {**ramp, "steps": steps}
    last = ramp["instants"][-1]
    return {**ramp, "instants": [last * (k + 1) / steps for k in range(steps)]}


def run(job: Run, threads: int | None = None) -> dict[str, Any]:
    """Solve a case and measure its quantities; an error is not raised but returned under the key ``"error"``.

    `threads` is the number of threads of the parallel kernels in this process. The result holds ``h`` [length], ``n_dofs``,
    ``seconds`` [s], ``iterations``, ``warnings``, ``profile``, and by quantity ``values``, ``theory``, ``reference`` and
    ``equal_force``; or ``error`` and ``kind`` (name of the exception).
    """
    try:
        if threads is not None:
            _jit.set_threads(threads)
        return job.measured()
    except FastcontactError as error:
        return {"error": str(error), "kind": type(error).__name__}
    except Exception as error:
        # A failed run must not end the whole study.
        where = traceback.extract_tb(error.__traceback__)[-1]
        return {"error": f"{error} ({where.name}, line {where.lineno})", "kind": type(error).__name__}


def fields_of(kind: type, result: dict[str, Any]) -> dict[str, Any]:
    """Return the entries of a result that are fields of a dataclass."""
    fields = {field.name: result[field.name] for field in dataclasses.fields(kind) if field.name in result}
    return {**fields, "warnings": tuple(fields["warnings"])}


def last_step(case: Case) -> StepResult:
    """Solve a case and return its last step; no earlier one is kept in memory."""
    return deque(solve_steps(case.model, case.ramp, **case.solution), maxlen=1).pop()


def profile(last: StepResult, pair: str | None) -> dict[str, list[float]]:
    """Return ``r`` and ``pressure`` along the contact of a plane or axisymmetric model; empty without contact."""
    if pair is None or last.displacement.shape[1] != 2:
        return {}
    contact = last.contact[pair]
    order = np.argsort(contact.place, kind="stable")
    return {"r": contact.place[order].tolist(), "pressure": contact.pressure[order].tolist()}
