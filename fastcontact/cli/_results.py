"""Common functions of commands that read result files: selection of step and contact pair, and the stored case."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact._tools import toml_text
from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.cli._terminal import say
from fastcontact.errors import CaseError, check_known

# Arguments that select a step and a contact pair.
ARGUMENTS = {
    "file": "result file (.vtkhdf)",
    "--step STEP": (-1, "number of the step, from 1; by default the last"),
    "--contact NAME": "contact pair; by default the first",
}


def select_step(results: Any, number: int) -> Any:
    """Return the step with a number from 1, or the last step for -1. Raises CaseError if it does not exist."""
    if not len(results):
        raise CaseError(f"'{results.path}' contains no finished step yet")
    if number == -1:
        return results[-1]
    if not 1 <= number <= len(results):
        raise CaseError(f"there is no step {number} in '{results.path}': it contains steps 1 to {len(results)}")
    return results[number - 1]


def select_contact(options: Namespace, step: Any) -> str:
    """Return the name of the contact pair that the options select, by default the first pair.

    If the first of several pairs is selected by default, the names of the others are printed. Raises CaseError if there is no
    contact pair, or none with the name.
    """
    if not step.contact:
        raise CaseError("this result contains no contact pair")
    if options.contact is not None:
        check_known("contact pair", options.contact, step.contact, CaseError)
        return str(options.contact)
    name, *other_names = step.contact
    if other_names and not options.quiet:
        quoted = ", ".join(f"'{other_name}'" for other_name in other_names)
        text = f"contact '{name}', the first of {len(step.contact)}; others: {quoted} (choose with --contact NAME)"
        say(text, error=True)
    return str(name)


def case_data(results: Any) -> dict[str, Any]:
    """Return title, theories, approaches and ramp of the case that a result file stores; defaults if it stores none."""
    from fastcontact.cases.case import stored_description

    try:
        data = toml_text.parse(results.case_text or "")
    except ValueError:
        data = {}
    return stored_description(data)


def load_multiplier(table: Sequence[tuple[float, float]], step: Any) -> float:
    """Return the load multiplier [-] at a step, which is interpolated in the table of the ramp."""
    return float(np.interp(step.load_factor, *np.transpose(table)))


def pressure_curves(
    theories: Mapping[str, Any], contact: Any, *, approach: float | None = None, load: float = 1.0
) -> dict[str, Any]:
    """Return a theory at the same approach and at the same force as a contact, for comparison of the pressures.

    Parameters
    ----------
    theories : mapping
        Theories of the pair in the form of `Case.theories`.
    contact : ContactResult
        Contact to compare with.
    approach : float, optional
        Approach [length] of the case at load multiplier 1; None if the theory is given by a force or has no load.
    load : float
        Load multiplier of the step [-].

    Returns
    -------
    dict
        Theories by label in the legend; empty if the theory has no pressure curve. For finite half-spheres, the solutions are
        those of Hertz's theory.
    """
    theory: Any = theories.get("theory")
    theory = theory if pressure_curve(theory) is not None else getattr(theory, "hertz", None)
    curve = pressure_curve(theory)
    if curve is None:
        return {}
    if approach is None and not hasattr(theory, "at_force"):
        return {curve.name: theory}
    return theories_at_equal_load(curve.name, theory, contact, theories["share"], approach=approach, load=load)


def theories_at_equal_load(
    name: str, theory: Any, contact: Any, share: float, *, approach: float | None, load: float
) -> dict[str, Any]:
    """Return a theory at the approach and at the force of a contact, if these are known, by label in the legend.

    `share` [-] is the fraction of the contact that the model represents. The `approach` [length] is reached at load
    multiplier 1, and `load` [-] is the multiplier of the step.
    """
    curves, force = {}, contact.force_against_theory(share) / share
    if approach is not None and load == 1.0:
        curves[f"{name}, equal approach"] = theory
    elif approach is not None and load > 0 and hasattr(theory, "at_approach"):
        curves[f"{name}, equal approach"] = theory.at_approach(approach * load)
    if force > 0 and hasattr(theory, "at_force"):
        curves[f"{name}, equal force"] = theory.at_force(force)
    return curves


def approach_law(theories: Mapping[str, Any]) -> Any:
    """Return the theory of a pair if its force and radius are functions of the approach; otherwise None."""
    theory = theories.get("theory")
    theory = getattr(theory, "hertz", theory)
    return theory if hasattr(theory, "at_approach") else None
