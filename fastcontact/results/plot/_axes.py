"""Axes of plots."""

from __future__ import annotations

import io
import os
import textwrap
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._tools.units import named_units
from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError, check_known
from fastcontact.results.plot.fields import Field
from fastcontact.results.step import ContactResult, StepResult
from fastcontact.results.units import labelled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:  # Matplotlib is imported only when a plot is drawn
    Axes = Any

Units = str | Mapping[str, str]
UNITS: Mapping[str, str] = {"length": "mm", "force": "N", "pressure": "MPa"}
UNKNOWN: Mapping[str, str] = {}


def units_of(given: Units, result: ContactResult | StepResult) -> Mapping[str, str]:
    """Return the names of units of the caller, by default those of the model; ModelError if they cannot be read."""
    return named_units(given) or result.units


def placed(points: Array, size: float) -> str:
    """Return a position (dim,) [length] as text; coordinates up to a millionth of the `size` of the body become zero."""
    kept = np.where(np.abs(points) <= 1e-6 * size, 0.0, points)
    return f"({', '.join(f'{x:.4g}' for x in kept)})"


def contacts_of(steps: Sequence[StepResult], pair: str) -> list[ContactResult]:
    """Return a contact pair at each step; FastcontactError if there are no steps or a step lacks the pair."""
    if not len(steps):
        raise FastcontactError("there are no steps to draw")
    for step in steps:
        check_known("contact pair", pair, step.contact, FastcontactError)
    return [step.contact[pair] for step in steps]


def mark(axes: Any, at: Array, label: str) -> None:
    """Mark a position (dim,) in a plot."""
    axes.plot(*([x] for x in at), "o", mfc="none", mec="red", ms=9, mew=1.5, label=label, zorder=10)


def png(figure: Any) -> bytes:
    """Return a figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


class Panels(tuple[Any, ...]):
    """The axes of a figure with several panels, which are displayed as the figure in notebooks."""

    __slots__ = ()

    def _repr_png_(self) -> bytes:
        return png(self[0].figure)


def new_axes(ax: Axes | None, size: tuple[float, float], projection: str | None = None) -> Any:
    """Return `ax` or, if it is None, the axes of a new figure; ``projection="3d"`` gives axes in space."""
    if ax is None:
        return new_panels(1, 1, size, subplot_kw={"projection": projection})[0, 0]
    if not (hasattr(ax, "plot") and hasattr(ax, "figure")):
        raise FastcontactError(
            f"pictures are drawn on axes of matplotlib, not on {ax!r}: leave the argument out for new ones"
        )
    return ax


def without_matplotlib(error: Exception) -> FastcontactError:
    """Return the error for a failed import of Matplotlib, which is missing or does not know the backend."""
    if isinstance(error, ImportError):
        return FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'")
    backend = os.environ.get("MPLBACKEND")
    return FastcontactError(
        f"matplotlib does not know the backend '{backend}' of the environment variable MPLBACKEND: unset it, or set it to Agg"
    )


def new_panels(rows: int, columns: int, size: tuple[float, float], dpi: int = 150, **options: Any) -> Any:
    """Return the axes (rows, columns) of a new figure of `size` [inch]; `options` are passed to ``Figure.subplots``."""
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except (ImportError, ValueError) as error:
        raise without_matplotlib(error) from error
    figure = Figure(figsize=size, layout="constrained", dpi=dpi)
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, squeeze=False, **options)
    for artist in (figure, *figure.axes):  # notebooks show any of them as the figure
        artist._repr_png_ = partial(png, figure)  # type: ignore[attr-defined]
    return panels


def outer_legend(ax: Any, columns: int) -> None:
    """Add a legend below the label of the abscissa, where it does not hide data."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=columns, fontsize=8)


def settled(axes: Any) -> Any:
    """Draw axes in space, so that the size of their labels is known to the layout, and return them."""
    axes.figure.draw_without_rendering()
    return axes


LETTER = 0.09  # mean width of a letter of a label [inch]


def size_around(points: Array, least: float = 3.2) -> tuple[float, float]:
    """Return width and height [inch] of a figure for a body, with space for colour bar, labels and title."""
    width, height = np.ptp(points, axis=0) / np.ptp(points, axis=0).max()
    return max(4.2 * float(width) + 1.9, 5.0), max(4.2 * float(height) + 2.0, least)


def part_shown(middle: Array, half: float, points: Array) -> tuple[Array, Array]:
    """Return the lower and upper corners of a square with a centre (2,) and a half width, clipped to points (n, 2)."""
    low, high = points.min(axis=0) - 0.05 * half, points.max(axis=0) + 0.05 * half
    return np.maximum(middle - half, low), np.minimum(middle + half, high)


def framed(
    axes: Any, drawn: Any, shown: Field, heading: str, units: Mapping[str, str], labels: Sequence[str],
    points: Array | None = None, *, alone: bool = True,
) -> Any:  # fmt: skip
    """Add a colour bar, a title, a label for each direction and a legend to axes, and return the axes.

    `points` (n, 2) [length] are the points of a body in the plane, and None for axes in space. `alone` is whether the figure
    has no other axes.
    """
    caption, length, below = labelled(shown.caption, units, shown.quantity), 0.6, 0.02
    if points is not None:
        width, height = np.ptp(points, axis=0)
        caption = textwrap.fill(caption, int(size_around(points)[1] / LETTER))
        length = float(np.clip(2.0 * height / max(width, 1e-300), 0.45, 0.8))  # shorter for flat bodies
        half_inch = -0.5 / max(4.2 * float(height) / max(float(width), float(height)), 0.2)
        below = half_inch if alone else -0.09
        axes.set_aspect("equal")
    axes.figure.colorbar(drawn, ax=axes, label=caption, shrink=length)
    axes.set_title(heading, fontsize="medium", pad=18 if points is None else None)
    axes.set(**{f"{axis}label": labelled(label, units, "length") for axis, label in zip("xyz", labels)})
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, below))
    return axes
