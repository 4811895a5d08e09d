"""Check that the runs of a sweep read the keys that it varies, and messages that name what replaces the other keys."""

from __future__ import annotations

import inspect
import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastcontact.errors import CaseError
from fastcontact.mesh.generate import GENERATORS
from fastcontact.results.units import units_of_results
from fastcontact.studies.job import UNREAD_TABLES, Job
from fastcontact.studies.series import Value
from fastcontact.studies.settings import SHAPES, shape_of

Choice = Mapping[str, Value]


def check_swept_keys(
    choices: Sequence[Choice], jobs: Sequence[Job], job_of_choice: Callable[[Choice], Job], data: Mapping[str, Any]
) -> None:
    """Raise CaseError if values of a parameter do not change the inputs of its runs, or change the units of results.

    The table ``[study]`` and the arguments of the sweep may replace keys of the case. Points of the sweep would then differ
    in their labels only.

    Parameters
    ----------
    choices : sequence of dict
        Values of the parameters, by point.
    jobs : sequence of Job
        Job of each point.
    job_of_choice : callable
        Function that returns the job of other values of the parameters.
    data : dict
        Parsed case file.
    """
    for name in choices[0]:
        points: dict[str, dict[str, Job]] = {}  # jobs by the values of the other parameters and by their own value
        for choice, job in zip(choices, jobs, strict=True):
            others = {key: value for key, value in choice.items() if key != name}
            points.setdefault(_text(others), {})[_text(choice[name])] = job
            if len({str(c[name]) for c in choices}) == 1:  # compare with the value of the case
                original = job_of_choice(others)
                selected = name == "mesh.element" and job.recipe.get("arguments", {}).get("element") == choice[name]
                if original.substituted != job.substituted and not selected:
                    points[_text(others)]["case"] = original
        for by_value in points.values():
            if len({_text(job.inputs) for job in by_value.values()}) < len(by_value):
                raise CaseError(_message(name, next(iter(by_value.values())), data))
    units = {"length": "L", "force": "F", "pressure": "P"}
    kinematics = {units_of_results(units, str(k))["force"]: k for k in (data["kinematics"], *_kinematics(jobs))}
    if len(kinematics) > 1:
        raise CaseError(
            f"kinematics = {' and '.join(map(str, kinematics.values()))} differ in the unit of forces, which are per unit "
            "thickness in plane models: write a case file for each"
        )


def _kinematics(jobs: Sequence[Job]) -> list[str]:
    """Return the known kinematics of jobs; unknown ones are errors of their runs."""
    names = dict.fromkeys(job.data["kinematics"] for job in jobs)
    return [name for name in names if name in ("axisymmetric", "plane_strain", "plane_stress", "3d")]


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)


def _message(name: str, job: Job, data: Mapping[str, Any]) -> str:
    """Return the message that the runs do not read a parameter, with what replaces it and what to set instead."""
    linked = data.get("study", {}).get("parameters", {}).get(name)
    path = next(iter(linked), name) if linked else name
    return f"the runs of the sweep do not read '{name}': " + _reason(path, job, data.get("study", {}))


def _reason(path: str, job: Job, study: Mapping[str, Any]) -> str:
    """Return what replaces the value at a path of the case, and what to set instead."""
    table, _, key = path.partition(".")
    element = job.recipe.get("arguments", job.recipe).get("element")
    shape, formulation = shape_of(str(element)), str(job.formulation)
    for name, selected in (("element", element), ("formulation", formulation)):
        if path == f"mesh.{name}" or (name == "formulation" and key.endswith(name)):
            text = f"'study.combinations' or the option '{name}' selects {selected}: set '{name}' (--{name})"
            return f"{text}, one sweep for each, or 'fastcontact converge' compares them"
    if table == "mesh" and job.base is not None:
        return "they refine the mesh that the case was read with: write a case file for each mesh, or sweep a Python function"
    if table == "mesh":
        known = inspect.signature(GENERATORS[job.recipe["generator"]]).parameters
        argument = f"study.{shape}.{key}" if key.partition("[")[0] in known else f"keys of [study.{shape}]"
        instead = "study.generator" if key == "generator" else argument
        return f"[study] defines the meshes of studies by 'generator' and [study.{shape}]: set {instead}"
    if table == "ramp" and "load_steps" in study:
        return f"'study.load_steps' = {study['load_steps']} replaces it: set study.load_steps, or leave study.load_steps out"
    if table == "study" and key.split(".")[0] in SHAPES:
        return f"their cells are {element}: set keys of [study.{shape}], or another 'element' (--element)"
    option = key.rpartition(".")[2]
    if option in study.get("options", {}).get(formulation, {}):
        return f"[study.options.{formulation}] replaces it: set study.options.{formulation}.{option}"
    if table == "study":
        return f"it does not apply to {element} with the formulation '{formulation}', which the sweep selects"
    if table == "theory":
        return f"they are compared with the theory of the contact '{job.pair}': select another by study.contact"
    if table.partition("[")[0] in UNREAD_TABLES:
        return "it does not change the solution: set a key of the model"
    return f"another parameter, or the option formulation = '{formulation}', replaces it: leave out one of them"
