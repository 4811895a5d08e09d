"""Axes of plots."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.errors import FastcontactError, check_known
from fastcontact.results.step import ContactResult, StepResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:  # Matplotlib is imported only when a plot is drawn
    Axes = Any

Units = Mapping[str, str]
UNITS: Units = {"length": "mm", "force": "N", "pressure": "MPa"}
UNKNOWN: Units = {}


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
        artist._repr_png_ = partial(png, figure)
    return panels


def outer_legend(ax: Any, columns: int) -> None:
    """Add a legend below the label of the abscissa, where it does not hide data."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=columns, fontsize=8)


def settled(axes: Any) -> Any:
    """Draw axes in space, so that the size of their labels is known to the layout, and return them."""
    axes.figure.draw_without_rendering()
    return axes
