"""Axes to draw on, and the names of units."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fastcontact.errors import FastcontactError

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Units = Mapping[str, str]
UNITS: Units = {"length": "mm", "force": "N", "pressure": "MPa"}


def new_axes(ax: Axes | None, size: tuple[float, float], projection: str | None = None) -> Any:
    """Return `ax`, or new axes in a figure of their own, ``projection="3d"`` for solids."""
    if ax is not None:
        return ax
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'") from error
    figure = Figure(figsize=size, layout="constrained", dpi=150)
    FigureCanvasAgg(figure)
    return figure.add_subplot(projection=projection)
