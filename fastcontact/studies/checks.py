"""Checks of the table ``[study]`` of a case file, and of the number and the size of the runs, before a study."""

from __future__ import annotations

import logging
import math
import os
from collections.abc import Sequence
from typing import Any

from fastcontact.cases.case import Case, build_case
from fastcontact.errors import CaseError, in_file
from fastcontact.studies.case_parameters import substitute
from fastcontact.studies.job import job_of
from fastcontact.studies.quantities import check_names
from fastcontact.studies.settings import Combination, Settings, make_mesh, recipe, settings, shape_of

log = logging.getLogger("fastcontact")
# Largest number of runs of a study; larger numbers are probably mistakes.
MAX_RUNS = 100_000
# Peak memory per unknown [byte] of a multigrid analysis, measured with `fastcontact bench contact` for linear hexahedra,
# which need the least memory.
BYTES_PER_UNKNOWN = 2500


def check_runs(count: int) -> None:
    """Raise CaseError if a study has more than `MAX_RUNS` runs."""
    if count > MAX_RUNS:
        raise CaseError(f"a study of {count} runs is too large: at most {MAX_RUNS} are possible")
    log.info("%d runs", count)


def check_levels(case: Case, setup: Settings, selected: Sequence[Combination], levels: int) -> None:
    """Raise CaseError if the analysis of the finest mesh of a study needs more memory than this machine has."""
    memory = _memory()
    for combination in selected:
        coarsest = make_mesh(recipe(setup, combination.element, 0), case.mesh if setup.generator is None else None)
        unknowns = [coarsest.n_points * coarsest.dim * 2 ** (coarsest.dim * level) for level in range(levels)]
        n_fitting = sum(BYTES_PER_UNKNOWN * count <= memory for count in unknowns)
        if n_fitting < levels:
            raise CaseError(
                f"level {levels - 1} of {combination} would have about {unknowns[-1]:.2g} unknowns and take "
                f"{BYTES_PER_UNKNOWN * unknowns[-1] / 1e9:.2g} GB of memory, of which this machine has {memory / 1e9:.2g}: "
                f"reduce the number of levels to {max(n_fitting, 1)}"
            )
        log.info("%s: up to about %d unknowns on level %d", combination, unknowns[-1], levels - 1)


def _memory() -> float:
    """Return the physical memory [byte] of this machine, or infinity if it is unknown."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE")) * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):
        return float("inf")


def check_study(case: Case) -> None:
    """Raise FastcontactError if a study of a case could not start.

    If ``[study]`` contains the arguments of quadrangle meshes on level 0, these meshes are generated for the check.
    Unstructured triangle meshes are not generated, because this takes as long as a short run.
    """
    setup = settings(case)
    study = setup.data.get("study", {})
    _check_finite("study", study)
    check_names(case, setup.quantities)
    with in_file("[study.parameters]"):
        for name in study.get("parameters", {}):
            substitute(setup.data, {name: 1.0})
    for combination in setup.combinations if study else ():
        with in_file(f"[study], {combination}"):
            job = job_of(case, setup, combination, 0, label="", marks={})
            if setup.by_shape and shape_of(combination.element or "") == "quadrangles":
                make_mesh(job.recipe, None)
            if combination.formulation in setup.options or setup.load_steps is not None:
                build_case(job.data, name=case.name, folder=case.folder, mesh=case.mesh)


def _check_finite(where: str, value: Any) -> None:
    """Raise CaseError if a number in the table or list `value`, called `where` in the message, is not finite."""
    if isinstance(value, float) and not math.isfinite(value):
        raise CaseError(f"{where} = {value} must be finite")
    for key, entry in value.items() if isinstance(value, dict) else ():
        _check_finite(f"{where}.{key}", entry)
    for index, entry in enumerate(value) if isinstance(value, list) else ():
        _check_finite(f"{where}[{index}]", entry)
