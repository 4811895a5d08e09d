"""Pictures that several commands make."""

from __future__ import annotations

from typing import Any

from fastcontact.cli._results import at_equal_force, curve
from fastcontact.errors import FastcontactError, FileError
from fastcontact.results.step import ContactResult, StepResult


def save(axes: Any, path: str) -> None:
    """Write the figure of `axes` to `path`.

    Raises FileError if the file cannot be written or its format is unknown.
    """
    try:
        axes.figure.savefig(path)
    except (OSError, ValueError) as error:
        raise FileError(f"cannot write the picture '{path}': {error}") from error


def profile_picture(case: Any, step: StepResult, path: str, pair: str | None = None) -> None:
    """Plot the pressure of a contact pair with the theories of its case."""
    from fastcontact.results import plot

    if not step.contact:
        raise FastcontactError("there is no contact pair whose pressure could be plotted")
    name = pair or next(iter(step.contact))
    contact = step.contact[name]
    theories = case.theories.get(name, {})
    theory = theories.get("theory") if curve(theories.get("theory")) else None
    same = at_equal_force(theory, contact, theories.get("share", 1.0))
    axes = plot.pressure_profile(
        contact,
        theory,
        other_theories={} if same is None else {"Hertz, equal force": same},
        stress=step.stress[contact.points, 1] if contact.normal.shape[1] == 2 else normal_stress(contact, step),
        title=f"{case.title}\nload factor {step.load_factor:g}",
        units=case.units,
    )
    save(axes, path)


def normal_stress(contact: ContactResult, step: StepResult) -> Any:
    """Return the stress (m,) at the contact nodes along the normals that they face [pressure]."""
    xx, yy, zz, xy, yz, xz = step.stress[contact.points].T
    x, y, z = contact.normal.T
    return x * x * xx + y * y * yy + z * z * zz + 2.0 * (x * y * xy + y * z * yz + x * z * xz)
