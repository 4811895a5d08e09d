"""Files of commands: results that they read, with the choice of step and contact pair, and outputs, including pictures."""

from __future__ import annotations

import argparse
import json
import os
import warnings
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._tools import toml_text
from fastcontact.analytic.pressure_curve import PressureCurve, pressure_curve
from fastcontact.cli._terminal import say
from fastcontact.errors import CaseError, FastcontactError, FileError, check_known

# Arguments that choose a step and a contact pair.
ARGUMENTS = {
    "file": "result file (.vtkhdf)",
    "--step STEP": (-1, "number of the step, from 1; by default the last"),
    "--contact NAME": "contact pair; by default the first",
}


def chosen_step(results: Any, number: int) -> Any:
    """Return the step with a number counted from 1, or the last step for -1; CaseError if it does not exist."""
    if not len(results):
        raise CaseError(f"'{results.path}' contains no finished step yet")
    if number == -1:
        return results[-1]
    if not 1 <= number <= len(results):
        raise CaseError(f"there is no step {number} in '{results.path}': it contains steps 1 to {len(results)}")
    return results[number - 1]


def chosen_contact(options: argparse.Namespace, step: Any) -> str:
    """Return the name of the contact pair in the options, by default the first pair.

    If the first of several pairs is chosen by default, the names of the others are printed. Raises CaseError if there is no
    contact pair, or none with the name.
    """
    if not step.contact:
        raise CaseError("this result contains no contact pair")
    if options.contact is not None:
        check_known("contact pair", options.contact, step.contact, CaseError)
        return str(options.contact)
    name, *others = step.contact
    if others and not options.quiet:
        listed = ", ".join(f"'{other}'" for other in others)
        text = f"contact '{name}', the first of {len(step.contact)}; others: {listed} (choose with --contact NAME)"
        say(text, error=True)
    return str(name)


def case_data(results: Any) -> dict[str, Any]:
    """Return title, theories, approaches and ramp of the case stored in the file; defaults if there is no case."""
    from fastcontact.cases.case import described

    try:
        data = toml_text.parsed(results.case_text or "")
    except ValueError:
        data = {}
    return described(data)


def load_multiplier(table: Sequence[tuple[float, float]], step: Any) -> float:
    """Return the load multiplier at a step from the table of the ramp."""
    return float(np.interp(step.load_factor, *np.transpose(table)))


def pressure_curves(
    theories: Mapping[str, Any], contact: Any, *, approach: float | None = None, load: float = 1.0
) -> dict[str, Any]:
    """Return theories at equal approach and at equal force, for comparison with the pressure of a contact.

    Parameters
    ----------
    theories : mapping
        Theories of the pair in the form of `Case.theories`.
    contact : ContactResult
        Contact to compare with.
    approach : float, optional
        Approach of the case at load multiplier 1 [length]; None if the theory is given by a force or has no load.
    load : float
        Load multiplier of the step [-].

    Returns
    -------
    dict
        Theories by label of the legend; empty if the pressure of the theory cannot be drawn. For finite half-spheres it
        contains Hertz's theory.
    """
    theory: Any = theories.get("theory")
    theory = theory if pressure_curve(theory) is not None else getattr(theory, "hertz", None)
    curve = pressure_curve(theory)
    if curve is None:
        return {}
    if approach is None and not hasattr(theory, "at_force"):
        return {curve.name: theory}
    return compared(curve.name, theory, contact, theories["share"], approach=approach, load=load)


def drawn(theory: Any) -> PressureCurve:
    """Return the pressure curve of a theory from `pressure_curves`."""
    curve = pressure_curve(theory)
    assert curve is not None
    return curve


def compared(
    name: str, theory: Any, contact: Any, share: float, *, approach: float | None, load: float
) -> dict[str, Any]:
    """Return a theory at the approach and at the force of a contact, where these are known, by label of the legend.

    `share` is the fraction of the contact that the model represents [-]. The `approach` [length] is reached at load
    multiplier 1, and `load` is the multiplier of the step [-].
    """
    curves, force = {}, float(np.linalg.norm(contact.force)) / share
    if approach is not None and load == 1.0:
        curves[f"{name}, equal approach"] = theory
    elif approach is not None and load > 0 and hasattr(theory, "at_approach"):
        curves[f"{name}, equal approach"] = theory.at_approach(approach * load)
    if force > 0 and hasattr(theory, "at_force"):
        curves[f"{name}, equal force"] = theory.at_force(force)
    return curves


def law(theories: Mapping[str, Any]) -> Any:
    """Return the theory if it provides force and radius as functions of the approach; otherwise None."""
    theory = theories.get("theory")
    theory = getattr(theory, "hertz", theory)
    return theory if hasattr(theory, "at_approach") else None


if TYPE_CHECKING:
    from fastcontact.results.step import ContactResult, StepResult


def check_outputs(
    read: Iterable[str | os.PathLike[str] | None],
    files: Iterable[str | os.PathLike[str] | None],
    pictures: Iterable[str | os.PathLike[str] | None] = (),
) -> None:
    """Check that output files can be written and replace neither an input file nor another output.

    Each command that writes files calls this function before it opens any file. `read` are the input files, and None stands
    for no file. Files are identified by device and inode, so that links to a file are recognised as the same file.

    Raises FileError if a folder is missing or write-protected, if a path is a folder, an input file or another output, or
    if the format of a picture is unknown; FastcontactError if Matplotlib is missing.
    """
    from fastcontact._tools.paths import checked_target, is_stream

    drawn = [str(path) for path in pictures if path]
    sources = {_identity(Path(os.path.realpath(path))) for path in read if path}
    seen: set[object] = set()
    for path in [*(str(path) for path in files if path), *drawn]:
        if is_stream(path):
            continue
        identity = _identity(checked_target(path))
        if identity in sources:
            raise FileError(f"'{path}' is what this command reads: name another file to write")
        if identity in seen:
            raise FileError(f"two outputs are to be written to '{path}': name another file for one of them")
        seen.add(identity)
    if drawn:
        _check_formats(drawn)


def _identity(path: Path) -> object:
    """Return device and inode of a file; for a new file, the identity of its folder and its name."""
    try:
        status = path.stat()
    except OSError:
        return path if path.parent == path else (_identity(path.parent), path.name)
    return status.st_dev, status.st_ino


def _check_formats(paths: list[str]) -> None:
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except (ImportError, ValueError) as error:
        from fastcontact.results.plot._axes import without_matplotlib

        raise without_matplotlib(error) from error
    known = FigureCanvasBase.get_supported_filetypes()
    for path in paths:
        if Path(path).suffix[1:].lower() not in known:
            raise FileError(f"'{path}' has a suffix that no kind of picture has: use .png, .svg or .pdf")


def write_text(path: str, content: str) -> None:
    """Write a string to a stream, or to a file completely or not at all; FileError if it cannot be written."""
    from fastcontact._tools.paths import replacing

    with replacing(path) as target:
        target.write_text(content, encoding="utf-8")


def say_written(options: Any, *paths: object) -> None:
    """Print the names of the files written, unless ``--quiet`` is set; None means no file."""
    if not options.quiet:
        say(f"wrote {', '.join(str(path) for path in paths if path)}")


def write_json(path: str, numbers: Any, indent: int = 2) -> None:
    """Write a JSON file; errors as for `write_text`."""
    write_text(path, json.dumps(numbers, indent=indent) + "\n")


def save(axes: Any, path: str) -> None:
    """Write the figure of `axes` to `path`; FileError if it cannot be written or its format is unknown.

    Warnings of Matplotlib, for example about characters missing in a font, are printed in one line each.
    """
    from fastcontact._tools.paths import replacing

    try:
        with warnings.catch_warnings(record=True) as caught, replacing(path) as target:
            warnings.simplefilter("always", UserWarning)
            axes.figure.savefig(target)
        for text in dict.fromkeys(str(warning.message) for warning in caught):
            say(f"warning: {path}: {' '.join(text.split())}", error=True)
    except ValueError as error:
        raise FileError(f"cannot write the picture '{path}': {error}") from error


def profile_picture(case: Any, step: StepResult, path: str) -> None:
    """Plot the pressure of the first contact pair and its theories; FastcontactError if there is no contact pair."""
    if not step.contact:
        raise FastcontactError("there is no contact pair whose pressure could be plotted")
    name, contact = next(iter(step.contact.items()))
    options = {"approach": case.approach.get(name), "load": load_multiplier(case.ramp.table, step)}
    curves = pressure_curves(case.theories.get(name, {}), contact, **options)
    draw_profile(contact, step, curves, path, case.title)


def draw_profile(contact: ContactResult, step: StepResult, theories: dict[str, Any], path: str, title: str) -> None:
    """Plot the pressure of a contact pair and theories, which are given by label of the legend."""
    from fastcontact.results import plot
    from fastcontact.results.tables import normal_stress

    stress = normal_stress(contact, step)
    title = f"{title}\nload factor {step.load_factor:g}"
    save(plot.pressure_profile(contact, other_theories=theories, stress=stress, title=title), path)
