"""Figures and axes of plots, with their labels, legends and colour bars."""

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
from fastcontact.results.units import axis_label

if TYPE_CHECKING:
    from matplotlib.axes import Axes
else:  # Matplotlib is imported only when a plot is drawn
    Axes = Any

Units = str | Mapping[str, str]
UNITS: Mapping[str, str] = {"length": "mm", "force": "N", "pressure": "MPa"}
# Default value of the argument `units`: the units of the model.
MODEL_UNITS: Mapping[str, str] = {}


def units_of(units: Units, result: ContactResult | StepResult) -> Mapping[str, str]:
    """Return the names of `units`, by default those of the model. Raises ModelError if they are invalid."""
    return named_units(units) or result.units


def position_text(point: Array, size: float) -> str:
    """Return a position (dim,) [length] as text. Coordinates below a millionth of the `size` of the body become zero."""
    rounded = np.where(np.abs(point) <= 1e-6 * size, 0.0, point)
    return f"({', '.join(f'{x:.4g}' for x in rounded)})"


def contacts_of(steps: Sequence[StepResult], pair: str) -> list[ContactResult]:
    """Return the result of a contact pair at each step.

    Raises FastcontactError if there are no steps or a step lacks the pair.
    """
    if not len(steps):
        raise FastcontactError("there are no steps to draw")
    for step in steps:
        check_known("contact pair", pair, step.contact, FastcontactError)
    return [step.contact[pair] for step in steps]


def mark(axes: Any, point: Array, label: str) -> None:
    """Mark a position (dim,) in a plot."""
    axes.plot(*([x] for x in point), "o", mfc="none", mec="red", ms=9, mew=1.5, label=label, zorder=10)


def png(figure: Any) -> bytes:
    """Return a figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png")
    return buffer.getvalue()


class Panels(tuple[Any, ...]):
    """The axes of a figure with several panels. Notebooks display them as the figure."""

    __slots__ = ()

    def _repr_png_(self) -> bytes:
        return png(self[0].figure)


def new_axes(ax: Axes | None, size: tuple[float, float], projection: str | None = None) -> Any:
    """Return `ax` or, if it is None, the axes of a new figure of `size` [inch]; ``projection="3d"`` gives 3D axes."""
    if ax is None:
        return new_panels(1, 1, size, subplot_kw={"projection": projection})[0, 0]
    if not (hasattr(ax, "plot") and hasattr(ax, "figure")):
        raise FastcontactError(
            f"pictures are drawn on axes of Matplotlib, not on {ax!r}: omit the argument for new axes"
        )
    return ax


def matplotlib_error(error: Exception) -> FastcontactError:
    """Return the error for a failed import of Matplotlib, which is missing or was given an unknown backend."""
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
        raise matplotlib_error(error) from error
    figure = Figure(figsize=size, layout="constrained", dpi=dpi)
    FigureCanvasAgg(figure)
    panels = figure.subplots(rows, columns, squeeze=False, **options)
    for artist in (figure, *figure.axes):  # notebooks display the figure for each of these objects
        artist._repr_png_ = partial(png, figure)  # type: ignore[attr-defined]
    return panels


def outer_legend(ax: Any, columns: int) -> None:
    """Add a legend below the label of the x axis, where it does not hide data."""
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=columns, fontsize=8)


def lay_out(axes: Any, zoom: float | None = None) -> Any:
    """Enlarge the box of 3D axes by the factor `zoom`, lay out the figure, and return the axes.

    By default the box with its labels fills the axes.
    """
    axes.set_box_aspect(_box_size(axes), zoom=filling_zoom(axes) if zoom is None else zoom)
    axes.figure.draw_without_rendering()
    return axes


def _box_size(axes: Any) -> Array:
    """Return the lengths (3,) of the edges of the box of 3D axes, in the units of the data."""
    return np.ptp([axes.get_xlim(), axes.get_ylim(), axes.get_zlim()], axis=1)


def filling_zoom(axes: Any) -> float:
    """Return the factor [-] by which the box of 3D axes with its labels can be enlarged until it fills the axes."""
    from mpl_toolkits.mplot3d.proj3d import proj_transform

    axes.set_box_aspect(_box_size(axes))
    axes.figure.draw_without_rendering()
    limits = axes.get_xlim(), axes.get_ylim(), axes.get_zlim()
    corners = np.transpose(proj_transform(*map(np.ravel, np.meshgrid(*limits)), axes.get_proj()))[:, :2]
    labels = [axis.get_tightbbox(axes.figure.canvas.get_renderer()) for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    ends = np.concatenate([axes.transData.transform(corners), *(box.get_points() for box in labels)])
    first, last = axes.get_window_extent().get_points()  # corners of the axes, which have the same centre as the box
    return float(((last - first) / 2.0 / np.abs(ends - (first + last) / 2.0).max(axis=0)).min())


# Mean width of a letter of a label [inch].
LETTER_WIDTH = 0.09


def figure_size(points: Array, smallest_height: float = 3.2) -> tuple[float, float]:
    """Return the width and the height of a figure for a body, with space for a colour bar, labels and a title [inch].

    `points` (n, 2) are those of the body [length], and `smallest_height` is a lower bound on the height [inch].
    """
    width, height = np.ptp(points, axis=0) / np.ptp(points, axis=0).max()
    return max(4.2 * float(width) + 1.9, 5.0), max(4.2 * float(height) + 2.0, smallest_height)


def zoom_window(centre: Array, half_width: float, points: Array) -> tuple[Array, Array]:
    """Return two corners of a square around `centre` (2,), clipped to the bounding box of `points` (n, 2) with a margin."""
    low, high = points.min(axis=0) - 0.05 * half_width, points.max(axis=0) + 0.05 * half_width
    return np.maximum(centre - half_width, low), np.minimum(centre + half_width, high)


def label_axes(
    axes: Any, artist: Any, plot_field: Field, heading: str, units: Mapping[str, str], labels: Sequence[str],
    points: Array | None = None, *, alone: bool = True,
) -> Any:  # fmt: skip
    """Add a colour bar, a title, a label for each direction and a legend to axes, and return the axes.

    `artist` has the colour scale of `plot_field`. `points` (n, 2) are those of a plane body [length]; None for 3D axes.
    `alone` states whether the figure has no other axes.
    """
    caption, shrink, legend_y = axis_label(plot_field.caption, units, plot_field.quantity), 0.6, -0.02
    if points is not None:
        width, height = np.ptp(points, axis=0)
        caption = textwrap.fill(caption, int(figure_size(points)[1] / LETTER_WIDTH))
        shrink = float(np.clip(2.0 * height / max(width, 1e-300), 0.45, 0.8))  # shorter for flat bodies
        half_inch_below = -0.5 / max(4.2 * float(height) / max(float(width), float(height)), 0.2)
        legend_y = half_inch_below if alone else -0.09
        axes.set_aspect("equal")
        axes.locator_params(axis="x", nbins=6, steps=[1, 2, 5, 10])  # space for labels such as 0.0025
    axes.figure.colorbar(artist, ax=axes, label=caption, shrink=shrink)
    axes.set_title(heading, fontsize="medium", pad=18 if points is None else None)
    axes.set(**{f"{axis}label": axis_label(label, units, "length") for axis, label in zip("xyz", labels)})
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, legend_y))
    return axes
