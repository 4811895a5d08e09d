"""Checks of the table ``[study]`` of a case file before a study."""

from __future__ import annotations

import math
from typing import Any

from fastcontact.cases.case import Case, build_case
from fastcontact.errors import CaseError, in_file
from fastcontact.studies.case_parameters import substituted
from fastcontact.studies.job import job_of
from fastcontact.studies.levels import make_mesh
from fastcontact.studies.quantities import check_names
from fastcontact.studies.settings import settings, shape_of


def check_study(case: Case) -> None:
    """Raise FastcontactError if a study of a case could not start.

    Quadrangle meshes are generated if ``[study]`` gives the arguments of level 0. Free triangle meshes are not generated,
    since this takes as long as a short run.
    """
    chosen = settings(case)
    study = chosen.data.get("study", {})
    _check_finite("study", study)
    check_names(case, chosen.quantities)
    linked = study.get("parameters", {})
    with in_file("[study.parameters]"):
        for name in linked:
            substituted(chosen.data, name, 1.0, linked)
    for member in chosen.combinations if study else ():
        with in_file(f"[study], {member}"):
            job = job_of(case, chosen, member, 0, label="", marks={}, size=0.0)
            if chosen.by_shape and shape_of(member.element or "") == "quadrangles":
                make_mesh(job.recipe, None)
            if member.formulation in chosen.options or chosen.load_steps is not None:
                build_case(job.data, name=case.name, folder=case.folder, mesh=case.mesh)


def _check_finite(where: str, value: Any) -> None:
    if isinstance(value, float) and not math.isfinite(value):
        raise CaseError(f"{where} = {value} must be finite")
    for key, entry in value.items() if isinstance(value, dict) else ():
        _check_finite(f"{where}.{key}", entry)
    for number, entry in enumerate(value) if isinstance(value, list) else ():
        _check_finite(f"{where}[{number}]", entry)
