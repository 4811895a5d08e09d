"""Write animations of the deformed shape over the load steps."""

from __future__ import annotations

import base64
import contextlib
import os
import subprocess
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.paths import checked_target, replacing
from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.results.plot._axes import UNKNOWN, Units, field_of, new_axes, settled, size_around
from fastcontact.results.plot.shape import deformed_shape, scale_of, scaled
from fastcontact.results.plot.solid import show_box
from fastcontact.results.step import StepResult

# Suffixes of animation files; all formats except the first require the program ffmpeg.
SUFFIXES = (".gif", ".mp4", ".mkv", ".webm")
# Resolution of a frame [dots per inch], which is low because an animation contains many frames.
RESOLUTION = 90


@dataclass(frozen=True)
class MovingPicture:
    """An animation in a file, which notebooks display.

    Attributes
    ----------
    path : pathlib.Path
        Path of the file.
    """

    path: Path

    def _repr_html_(self) -> str:
        """Return the animation embedded in HTML."""
        inside = base64.b64encode(self.path.read_bytes()).decode()
        kind = self.path.suffix[1:].lower()
        if kind == "gif":
            return f"<img src='data:image/gif;base64,{inside}'>"
        return f"<video controls loop src='data:video/{kind};base64,{inside}'></video>"


@typed(FastcontactError)
def animate(
    mesh: Mesh,
    steps: Sequence[StepResult],
    path: str | os.PathLike[str],
    *,
    field: str = "von_mises",
    scale: float | None = None,
    mirrored: bool = False,
    pictures_per_second: int = 5,
    title: str = "",
    units: Units = UNKNOWN,
    view: tuple[float, float] = (25.0, -60.0),
) -> MovingPicture:
    """Write an animation of the deformed shape over all load steps, with fixed axes and a fixed colour scale.

    Parameters
    ----------
    mesh : Mesh
        The mesh of the steps.
    steps : sequence of StepResult
        Steps of an analysis, one for each frame.
    path : str or path
        File to write, with the suffix ``.gif`` or, if the program ffmpeg is installed, ``.mp4``, ``.mkv`` or ``.webm``.
    field, scale, mirrored, units, view
        Described for `deformed_shape`.
    pictures_per_second : int
        Frame rate [1/s].
    title : str
        Title of every frame, followed by the load factor.

    Returns
    -------
    MovingPicture
        The animation, which a notebook displays if it is the last value of a cell.

    Raises
    ------
    FastcontactError
        If there are no steps, the suffix is unknown, or ffmpeg is missing or fails.
    FileError
        If the file cannot be written.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.block_on_block()
    >>> model = fc.Model(mesh, kinematics="plane_strain")
    >>> model.add_material(fc.LinearElastic(E=1000.0, nu=0.0))
    >>> model.fix("LOWER_BOTTOM", "xy")
    >>> model.fix("UPPER_LEFT", "x")
    >>> model.add_pressure("UPPER_TOP", 2.0)
    >>> model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    >>> steps = fc.solve(model, 2)
    >>> picture = fc.plot.animate(mesh, steps, "joint.gif", scale=10.0)
    """
    if not len(steps):
        raise FastcontactError("there are no steps to animate")
    if pictures_per_second < 1:
        raise FastcontactError(f"pictures_per_second = {pictures_per_second}: one or more a second can be shown")
    target, scale = checked_target(path), scale_of(scale, mesh, steps)
    doubled = [2.0 if mirrored else 1.0, 1.0]
    size, projection = (size_around(mesh.points * doubled, 3.8), None) if mesh.dim == 2 else ((6.4, 6.0), "3d")
    figure = new_axes(None, size, projection).figure
    writer = writer_of(target, pictures_per_second)
    colours, box = _over_all(mesh, steps, field, scale, mirrored)
    with _failure_of_writer(target), replacing(target) as temporary, writer.saving(figure, temporary, RESOLUTION):
        for step in steps:
            figure.clear()
            axes = figure.add_subplot(projection=projection)
            heading = f"{title}\n{step.instant}, displacements x {scale:g}".strip()
            deformed_shape(
                mesh, step, field=field, scale=scale, mirrored=mirrored, limits=colours, title=heading, units=units,
                view=view, ax=axes,
            )  # fmt: skip
            _show(axes, box, view)
            writer.grab_frame()
    return MovingPicture(target)


def _show(axes: Any, box: tuple[Array, Array], view: tuple[float, float]) -> None:
    """Set the limits of the axes to the common limits of all frames."""
    if len(box[0]) == 3:
        show_box(axes, *box, view)
        settled(axes)
    else:
        axes.set(**{f"{axis}lim": ends for axis, *ends in zip("xy", *box, strict=True)})


def writer_of(path: Path, pictures_per_second: int) -> Any:
    """Return the writer of an animation; FastcontactError if the suffix is unknown or ffmpeg is missing."""
    from matplotlib.animation import FFMpegWriter, PillowWriter

    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise FastcontactError(f"'{path}' does not have a suffix of animations: use {', '.join(SUFFIXES)}")
    if suffix == ".gif":
        return PillowWriter(fps=pictures_per_second)
    if not FFMpegWriter.isAvailable():
        raise FastcontactError(f"'{path}' needs the program ffmpeg, which is not installed: write a .gif instead")
    # Most codecs require an even number of dots in both directions.
    return FFMpegWriter(
        fps=pictures_per_second, extra_args=["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2", "-pix_fmt", "yuv420p"]
    )


@contextlib.contextmanager
def _failure_of_writer(path: Path) -> Iterator[None]:
    """Convert failures of ffmpeg to a FastcontactError with its last message.

    Errors before the first frame are raised unchanged.
    """
    try:
        yield
    except subprocess.CalledProcessError as error:
        lines = str(error.stderr or "").strip().splitlines()
        reason = f"{error.returncode} ({lines[-1][:200]})" if lines else str(error.returncode)
        raise FastcontactError(
            f"'{path}' was not written, ffmpeg ended with code {reason}: write a .gif instead"
        ) from error
    except IndexError as error:  # matplotlib cannot finish a .gif without frames
        raise error.__context__ or error from None


def _over_all(
    mesh: Mesh, steps: Sequence[StepResult], field: str, scale: float, mirrored: bool
) -> tuple[tuple[float, float], tuple[Array, Array]]:
    """Return the limits of the colour scale and the corners of the bounding box of the bodies over all steps."""
    low, high = np.full(mesh.dim, np.inf), np.full(mesh.dim, -np.inf)
    colours = (np.inf, -np.inf)
    for step in steps:
        smallest, largest = field_of(mesh, step, field).range
        colours = min(colours[0], smallest), max(colours[1], largest)
        points = scaled(mesh.points, scale, step.displacement)
        low, high = np.minimum(low, points.min(axis=0)), np.maximum(high, points.max(axis=0))
    if mirrored and mesh.dim == 2:
        low[0], high[0] = min(low[0], -high[0]), max(high[0], -low[0])
    margin = 0.03 * float((high - low).max())
    return colours, (low - margin, high + margin)
