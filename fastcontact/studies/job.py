"""One run of a study or a sweep: plain data in, plain data out, so that any process anywhere can do it."""

from __future__ import annotations

import copy
import dataclasses
import hashlib
import json
import time
import traceback
import warnings
from collections import deque
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastcontact._version import __version__
from fastcontact.analysis.run import solve_steps
from fastcontact.cases.case import Case, build_case
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.errors import FastcontactError, FastcontactWarning
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.pair_options import SHARED_OPTIONS
from fastcontact.studies import quantities
from fastcontact.studies.levels import Recipe, make_mesh
from fastcontact.studies.settings import Combination, Settings

# Changes when the measured numbers or the stored form change.
SCHEMA = 1


@dataclass(frozen=True, eq=False)
class Job:
    """A case to solve.

    Attributes
    ----------
    label : str
        For people: what is being run.
    name : str
        Name of the case.
    data : dict
        Parsed case file with everything set for this run.
    pair : str or None
        Contact pair to measure.
    recipe : dict or None
        What makes the mesh; None: `base` as it is, or the mesh that the data name.
    base : Mesh or None
        The case's mesh, where it was read from a file.
    marks : dict
        What tells this run from its fellows, e.g. ``level``; goes into the results.
    size : float
        How much work it is, to compare with its fellows.
    """

    label: str
    name: str
    data: dict[str, Any]
    pair: str | None
    recipe: Recipe | None
    base: Mesh | None
    marks: dict[str, Any]
    size: float = 0.0

    @property
    def key(self) -> str:
        """Hash of all that the numbers depend on: the case, its mesh, the version."""
        title = {"title", "units", "check"}
        text = json.dumps(
            {
                "version": __version__,
                "schema": SCHEMA,
                "data": {key: value for key, value in self.data.items() if key not in title},
                "pair": self.pair,
                "recipe": self.recipe,
            },
            sort_keys=True,
            default=str,
        )
        found = hashlib.sha256(text.encode())
        if self.base is not None:
            found.update(_fingerprint(self.base))
        return found.hexdigest()[:32]


def _fingerprint(mesh: Mesh) -> bytes:
    found = hashlib.sha256(np.ascontiguousarray(mesh.points).tobytes())
    for block in (mesh.cells, mesh.cell_groups, mesh.point_groups):
        for name, numbers in block.items():
            found.update(name.encode() + np.ascontiguousarray(numbers).tobytes())
    return found.digest()


def case_data(settings: Settings, combination: Combination) -> dict[str, Any]:
    """Return the data of the case with another formulation, the study's options, and its number of load steps.

    Options that another formulation does not have are dropped.
    """
    data = copy.deepcopy({key: value for key, value in settings.data.items() if key != "study"})
    for entry in data.get("contact", {}).values():
        if combination.formulation is None:
            break
        own = entry.get("formulation")
        entry["formulation"] = combination.formulation
        if combination.formulation != own:
            known = {f.name for f in dataclasses.fields(FORMULATIONS[combination.formulation])}
            known |= {"secondary", "primary", "formulation", "friction", *SHARED_OPTIONS}
            for key in [key for key in entry if key not in known]:
                del entry[key]
        entry.update(settings.options.get(combination.formulation, {}))
    if settings.load_steps is not None:
        data["ramp"] = _fewer(data.get("ramp", {}), settings.load_steps)
    return data


def _fewer(ramp: dict[str, Any], steps: int) -> dict[str, Any]:
    """Return a ramp of equal steps to the same end."""
    if "instants" not in ramp:
        return {**ramp, "steps": steps}
    last = ramp["instants"][-1]
    return {**ramp, "instants": [last * (k + 1) / steps for k in range(steps)]}


def run(job: Job, threads: int | None = None) -> dict[str, Any]:
    """Solve and measure; never raises: a failure is a result with the key ``"error"``.

    Parameters
    ----------
    job : Job
    threads : int, optional
        Threads of the parallel kernels in this process.

    Returns
    -------
    dict
        ``h``, ``n_dofs``, ``values`` (quantity by name), ``theory``, ``reference``, ``profile``, ``seconds``,
        ``iterations``, ``warnings``; or ``error`` and ``kind`` (name of the exception).
    """
    try:
        if threads is not None:
            from fastcontact._jit import decorators as _jit

            _jit.set_threads(threads)
        return _solved(job)
    except FastcontactError as error:
        return {"error": str(error), "kind": type(error).__name__}
    except Exception as error:
        # One bad run must not end a study of many; what went wrong stays readable.
        where = traceback.extract_tb(error.__traceback__)[-1]
        return {"error": f"{error} ({where.name}, line {where.lineno})", "kind": type(error).__name__}


def _solved(job: Job) -> dict[str, Any]:
    started = time.perf_counter()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", FastcontactWarning)
        mesh = job.base if job.recipe is None else make_mesh(job.recipe, job.base)
        case = build_case(job.data, name=job.name, mesh=mesh)
        steps = solve_steps(
            case.model,
            case.ramp,
            linear_solver=case.linear_solver,
            linear_tolerance=case.linear_tolerance,
            criteria=case.criteria,
        )
        last = deque(steps, maxlen=1).pop()  # none of the others is kept
    texts = [str(entry.message) for entry in caught if issubclass(entry.category, FastcontactWarning)]
    values = quantities.measure(case, last, job.pair)
    theories = case.theories.get(job.pair or "", {})
    return {
        "h": quantities.mesh_size(case, job.pair),
        "n_dofs": case.model.n_dofs,
        "values": {name: value for name, value in values.items() if np.isfinite(value)},
        "theory": quantities.of_theory(theories["theory"]) if "theory" in theories else {},
        "reference": quantities.of_theory(theories["mesh_converged"]) if "mesh_converged" in theories else {},
        "equal_force": _equal_force(theories.get("theory"), values.get("force", 0.0)),
        "profile": _profile(case, last, job.pair),
        "iterations": {k: int(v) for k, v in last.iterations.items() if isinstance(v, int)},
        "seconds": time.perf_counter() - started,
        "warnings": texts,
    }


def _equal_force(theory: Any, force: float) -> dict[str, float]:
    return quantities.of_theory(theory.at_force(force)) if force > 0 and hasattr(theory, "at_force") else {}


def _profile(case: Case, last: Any, pair: str | None) -> dict[str, list[float]]:
    if pair is None or case.mesh.dim != 2:
        return {}
    contact = last.contact[pair]
    return {
        "r": np.abs(contact.coordinates[:, 0]).tolist(),
        "pressure": contact.pressure.tolist(),
    }
