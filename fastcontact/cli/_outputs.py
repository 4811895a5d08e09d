"""Checks of the output files of a command before its computation, and functions that write them, including pictures."""

from __future__ import annotations

import json
import os
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fastcontact._tools.paths import PathLike, checked_target, is_stream, replacing
from fastcontact.cli._terminal import say
from fastcontact.errors import FastcontactError, FileError

if TYPE_CHECKING:
    from fastcontact.results.step import ContactResult, StepResult


def check_outputs(
    input_files: Iterable[PathLike | None], files: Iterable[PathLike | None], pictures: Iterable[PathLike | None] = ()
) -> None:
    """Check that output files can be written, and that they replace neither an input file nor another output.

    Each command that writes files calls this function before it opens any file. Entries of None are ignored. Files are
    identified by device and inode, so that links to a file are recognised as the same file.

    Raises FileError if a folder is missing or write-protected, if a path is a folder, an input file or another output, or
    if the format of a picture is unknown; FastcontactError if Matplotlib is missing.
    """
    picture_paths = [str(path) for path in pictures if path]
    input_ids = {_identity(Path(os.path.realpath(path))) for path in input_files if path}
    output_ids: set[object] = set()
    for path in [*(str(path) for path in files if path), *picture_paths]:
        if is_stream(path):
            continue
        identity = _identity(checked_target(path))
        if identity in input_ids:
            raise FileError(f"'{path}' is an input of this command: name another output file")
        if identity in output_ids:
            raise FileError(f"two outputs are to be written to '{path}': name another file for one of them")
        output_ids.add(identity)
    if picture_paths:
        _check_formats(picture_paths)


def _identity(path: Path) -> object:
    """Return the device and the inode of a file or, for a new file, the identity of its folder and its name."""
    try:
        status = path.stat()
    except OSError:
        return path if path.parent == path else (_identity(path.parent), path.name)
    return status.st_dev, status.st_ino


def _check_formats(paths: list[str]) -> None:
    """Raise FileError if Matplotlib does not know the format of a picture, and FastcontactError without Matplotlib."""
    try:
        from matplotlib.backend_bases import FigureCanvasBase
    except (ImportError, ValueError) as error:
        from fastcontact.results.plot._axes import matplotlib_error

        raise matplotlib_error(error) from error
    formats = FigureCanvasBase.get_supported_filetypes()
    for path in paths:
        if Path(path).suffix[1:].lower() not in formats:
            raise FileError(f"'{path}' has a suffix that is not an image format: use .png, .svg or .pdf")


def write_text(path: str, content: str) -> None:
    """Write a string to a stream or atomically to a file; FileError if it cannot be written."""
    with replacing(path) as target:
        target.write_text(content, encoding="utf-8")


def say_written(options: Any, *paths: object) -> None:
    """Print the names of the files written, unless ``--quiet`` is set; paths of None are ignored."""
    if not options.quiet:
        say(f"wrote {', '.join(str(path) for path in paths if path)}")


def write_json(path: str, data: Any, indent: int = 2) -> None:
    """Write a JSON file; errors as for `write_text`."""
    write_text(path, json.dumps(data, indent=indent) + "\n")


def save(axes: Any, path: str) -> None:
    """Write the figure of `axes` to `path`; FileError if it cannot be written or its format is unknown.

    Each warning of Matplotlib, for example about a character that is missing in a font, is printed in one line.
    """
    try:
        with warnings.catch_warnings(record=True) as caught_warnings, replacing(path) as target:
            warnings.simplefilter("always", UserWarning)
            axes.figure.savefig(target)
        for text in dict.fromkeys(str(warning.message) for warning in caught_warnings):
            say(f"warning: {path}: {' '.join(text.split())}", error=True)
    except ValueError as error:
        raise FileError(f"cannot write the picture '{path}': {error}") from error


def profile_picture(case: Any, step: StepResult, path: str) -> None:
    """Write a picture of the pressure of the first contact pair and its theories.

    Raises FastcontactError if there is no contact pair.
    """
    from fastcontact.cli._results import load_multiplier, pressure_curves

    if not step.contact:
        raise FastcontactError("there is no contact pair whose pressure could be plotted")
    name, contact = next(iter(step.contact.items()))
    options = {"approach": case.approach.get(name), "load": load_multiplier(case.ramp.table, step)}
    curves = pressure_curves(case.theories.get(name, {}), contact, **options)
    draw_profile(contact, step, curves, path, case.title)


def draw_profile(contact: ContactResult, step: StepResult, theories: dict[str, Any], path: str, title: str) -> None:
    """Write a picture of the pressure of a contact pair and of theories by label in the legend."""
    from fastcontact.results import plot
    from fastcontact.results.tables import normal_stress

    stress = normal_stress(contact, step)
    title = f"{title}\nload factor {step.load_factor:g}"
    save(plot.pressure_profile(contact, other_theories=theories, stress=stress, title=title), path)
