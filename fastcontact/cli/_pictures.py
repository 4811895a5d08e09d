"""Pictures that several commands make."""

from __future__ import annotations

from typing import Any

import numpy as np

from fastcontact.errors import FastcontactError, FileError
from fastcontact.results import StepResult


def save(axes: Any, path: str) -> None:
    """Write the figure of `axes` to `path`.

    Raises
    ------
    FileError
        If the file cannot be written or its format is unknown.
    """
    try:
        axes.figure.savefig(path)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot write the picture '{path}': {error}") from error


def profile_picture(case: Any, step: StepResult, path: str, pair: str | None = None) -> None:
    """Plot the pressure of a contact pair with the theories of its case."""
    from fastcontact import plot

    if not step.contact:
        raise FastcontactError("there is no contact pair whose pressure could be plotted")
    name = pair or next(iter(step.contact))
    contact = step.contact[name]
    theories = case.theories.get(name, {})
    theory, others = theories.get("theory"), {}
    force = float(np.linalg.norm(contact.force))
    if theory is not None and force > 0:
        others["Hertz, equal force"] = theory.at_force(force)
    axes = plot.pressure_profile(
        contact,
        theory,
        other_theories=others,
        stress=step.stress[contact.points, 1],
        title=f"{case.title}\nload factor {step.load_factor:g}",
        units=case.units,
    )
    save(axes, path)
