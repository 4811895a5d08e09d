"""Pictures that several commands make."""

from __future__ import annotations

from typing import Any

from fastcontact.cli._results import pressure_curves
from fastcontact.errors import FastcontactError, FileError
from fastcontact.results.step import ContactResult, StepResult


def save(axes: Any, path: str) -> None:
    """Write the figure of `axes` to `path`; raises FileError if it cannot be written or its format is unknown."""
    try:
        axes.figure.savefig(path)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot write the picture '{path}': {error}") from error


def profile_picture(case: Any, step: StepResult, path: str) -> None:
    """Plot the pressure of the first contact pair with the theories of its case."""
    if not step.contact:
        raise FastcontactError("there is no contact pair whose pressure could be plotted")
    name, contact = next(iter(step.contact.items()))
    theories = case.theories.get(name, {})
    curves = pressure_curves(theories.get("theory"), contact, theories.get("share", 1.0))
    draw_profile(contact, step, curves, path, case.title, case.units)


def draw_profile(
    contact: ContactResult, step: StepResult, theories: dict[str, Any], path: str, title: str, units: Any
) -> None:
    """Plot the pressure of a contact pair with theories by legend."""
    from fastcontact.results import plot

    flat = contact.normal.shape[1] == 2
    stress = step.stress[contact.points, 1] if flat else normal_stress(contact, step)
    title = f"{title}\nload factor {step.load_factor:g}"
    save(plot.pressure_profile(contact, other_theories=theories, stress=stress, title=title, units=units), path)


def normal_stress(contact: ContactResult, step: StepResult) -> Any:
    """Return the stress (m,) at the contact nodes along the normals that they face [pressure]."""
    xx, yy, zz, xy, yz, xz = step.stress[contact.points].T
    x, y, z = contact.normal.T
    return x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + y * z * yz + x * z * xz)
