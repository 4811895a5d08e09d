"""Check that the runs of a sweep read the keys that it varies, and messages that name what replaces the other keys."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fastcontact.errors import CaseError
from fastcontact.studies.job import Job
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
        is_fixed = len({_text(choice[name]) for choice in choices}) == 1
        groups: dict[str, dict[str, Job]] = {}  # distinct jobs that differ in this parameter only
        for choice, job in zip(choices, jobs, strict=True):
            others = {key: value for key, value in choice.items() if key != name}
            compared = [job]
            if is_fixed and choice[name] != _element(job):  # compare with the value of the case
                compared.append(job_of_choice(others))
            group = groups.setdefault(_text(others), {})
            group.update({_text([choice[name], job.substituted]): job for job in compared})
        for group in groups.values():
            if len({_text(job.inputs) for job in group.values()}) < len(group):
                raise CaseError(_message(name, next(iter(group.values())), data.get("study", {})))
    kinematics = dict.fromkeys(str(kind) for kind in (data["kinematics"], *(job.data["kinematics"] for job in jobs)))
    if len({kind.startswith("plane") for kind in kinematics}) > 1:
        raise CaseError(
            f"kinematics = {' and '.join(kinematics)}: forces are per unit thickness in plane models only, so write a case "
            "file for each"
        )


def _text(value: Any) -> str:
    return json.dumps(value, sort_keys=True, default=str)


def _element(job: Job) -> str | None:
    """Return the element of the mesh of a job, or None if the mesh keeps the cells of the case."""
    return job.recipe.get("arguments", job.recipe).get("element")


def _message(name: str, job: Job, study: Mapping[str, Any]) -> str:
    """Return the message that the runs do not read a parameter, with what replaces it, which is to be set instead."""
    path = next(iter(study.get("parameters", {}).get(name, ())), name)
    key = path.rpartition(".")[2]
    options = [f"study.options.{name}.{key}" for name, given in study.get("options", {}).items() if key in given]
    instead = "leave it out, because it does not change the solution or another parameter replaces it"
    if key in ("element", "formulation"):
        instead = f"set the option '{key}' (--{key}) or study.combinations, which replaces it, or use 'converge'"
    elif path.startswith("mesh.") and job.base is not None:
        instead = "write a case file for each mesh, or sweep a Python function"
    elif path.startswith(("mesh.", *(f"study.{known}." for known in SHAPES))):
        instead = f"set study.generator or keys of [study.{shape_of(str(_element(job)))}], which replace it"
    elif path.startswith("ramp.") and "load_steps" in study:
        instead = "set study.load_steps, which replaces it, or leave study.load_steps out"
    elif options and not path.startswith("study."):
        instead = f"set {' or '.join(options)}, which replaces it"
    return f"the runs of the sweep ({job.marks['combination']}, contact '{job.pair}') do not read '{name}': {instead}"
