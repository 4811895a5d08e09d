"""Parts that the commands on result files share: the step, the contact pair, the case kept in the file."""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact.errors import CaseError, unknown


def arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments that choose a step and a contact pair."""
    parser.add_argument("file", help="result file (.vtkhdf)")
    parser.add_argument("--step", type=int, default=-1, help="number of the step, from 1; by default the last")
    parser.add_argument("--contact", metavar="NAME", help="contact pair; by default the first")


def chosen_step(results: Any, number: int) -> Any:
    """Return the step with a number from 1, or the last for -1; raises CaseError if there is no such step."""
    if not len(results):
        raise CaseError(f"'{results.path}' holds no finished step yet")
    if number == -1:
        return results[-1]
    if not 1 <= number <= len(results):
        raise CaseError(f"there is no step {number} in '{results.path}': it holds the steps 1 to {len(results)}")
    return results[number - 1]


def chosen_contact(step: Any, name: str | None) -> str:
    """Return the name of a contact pair of a step; raises CaseError if there is none, or none of that name."""
    if not step.contact:
        raise CaseError("this result holds no contact pair")
    if name is not None and name not in step.contact:
        raise CaseError(unknown("contact pair", name, step.contact))
    return name or next(iter(step.contact))


def case_data(results: Any) -> dict[str, Any]:
    """Return title, units, theories and approaches of the case text kept in the file; empty without one."""
    from fastcontact.cases.case import described

    try:
        data = tomllib.loads(results.case_text or "")
    except tomllib.TOMLDecodeError:
        data = {}
    return described(data)


def pressure_curves(theories: Mapping[str, Any], contact: Any) -> dict[str, Any]:
    """Return what to draw over the pressure of a contact, by legend: its theory at equal approach and at equal force.

    There is nothing without a theory whose pressure can be drawn; that of a punch is infinite.
    """
    theory = theories.get("theory")
    if not all(hasattr(theory, name) for name in ("pressure", "pressure_max", "radius")):
        return {}
    return {"Hertz, equal approach": theory, **at_equal_force("Hertz, equal force", theory, contact, theories["share"])}


def at_equal_force(legend: str, theory: Any, contact: Any, share: float) -> dict[str, Any]:
    """Return a theory by its legend at the force of a contact, of which the model holds a `share` [-]; empty without."""
    force = float(np.linalg.norm(contact.force)) / share
    return {legend: theory.at_force(force)} if force > 0 and hasattr(theory, "at_force") else {}


def law(theories: Mapping[str, Any]) -> Any:
    """Return what gives force and radius of a contact by its approach, from none on; None where nothing does."""
    theory = theories.get("theory")
    theory = getattr(theory, "hertz", theory)
    return theory if hasattr(theory, "at_approach") and theories["share"] == 1.0 else None
