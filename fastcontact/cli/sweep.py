"""``fastcontact sweep``: solve a case for many values of its parameters, and compare with theory."""

from __future__ import annotations

import math
from argparse import Namespace
from functools import partial
from typing import Any

import numpy as np

from fastcontact.cli import _study
from fastcontact.errors import CaseError

HELP = "solve a case for many values of its parameters, and compare with theory"
ARGUMENTS = {
    "case": "case file (TOML)",
    "--set NAME=VALUES": (
        {"action": "append", "required": True},
        "a path in the case such as material[0].E, or a name of [study.parameters], and its values: 1,2,5 or "
        "FIRST:LAST:COUNT, with equal ratios if :log is appended; given twice, all combinations are run",
    ),
    "--element NAME": "element (default: the last of study.combinations)",
    "--formulation NAME": "contact formulation (default: that of the last combination)",
    "--level N": (int, "refinement of the mesh, as in converge"),
    **_study.ARGUMENTS,
}


def run(options: Namespace) -> int:
    """Run the sweep, write the requested files and print the table; return 2 if a run failed."""
    from fastcontact.studies.runs import parameter_sweep

    _study.check_targets(options)
    parameters: dict[str, list[Any]] = {}
    for name, parameter_values in map(parse_setting, options.set):
        if name in parameters:
            raise CaseError(f"--set {name} is given twice: give all its values at once, as in {name}=1,2,5")
        parameters[name] = parameter_values
    settings = {"element": options.element, "formulation": options.formulation, "level": options.level}
    sweep = _study.run_interruptibly(options, partial(parameter_sweep, options.case, parameters, **settings))
    return _study.report(options, sweep, "--png FILE writes a picture", [text for _, text in sweep.failed])


def parse_setting(text: str) -> tuple[str, list[Any]]:
    """Return the parameter and the values of a string ``NAME=VALUES``; CaseError for other strings."""
    name, _, entries = text.partition("=")
    if not (name and entries):
        raise CaseError(f"--set '{text}' must be NAME=VALUES, for example approach=0.04,0.4,4")
    if ":" in entries:
        return name.strip(), _range(text, entries.split(":"))
    return name.strip(), [_value(entry.strip()) for entry in entries.split(",") if entry.strip()]


def _range(text: str, fields: list[str]) -> list[float]:
    """Return the values of a range FIRST:LAST:COUNT with or without log, given by its fields; CaseError if invalid."""
    from fastcontact.studies.checks import check_runs

    logarithmic = fields[-1] == "log"
    try:
        first, last, count = float(fields[0]), float(fields[1]), int(fields[2])
        if len(fields) != 3 + logarithmic or count < 1 or not (math.isfinite(first) and math.isfinite(last)):
            raise ValueError
        if logarithmic and first * last <= 0:
            raise ValueError
    except (ValueError, IndexError):
        raise CaseError(
            f"--set '{text}': a range is FIRST:LAST:COUNT or FIRST:LAST:COUNT:log, for example approach=0.004:4:7:log"
        ) from None
    check_runs(count)
    return (np.geomspace if logarithmic else np.linspace)(first, last, count).tolist()


def _value(text: str) -> Any:
    """Return the Boolean, integer or number that a text represents, or the text itself."""
    if text in ("true", "false"):
        return text == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return text
