"""Figures of studies: panels of axes with scales, labels, grid and legend."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from fastcontact.results.plot._axes import new_panels

MARKERS = "osD^v<>ph*"


def marker(number: int) -> str:
    """Return the marker of a curve, counted from 0."""
    return MARKERS[number % len(MARKERS)]


def panels(
    rows: int,
    columns: int,
    size: tuple[float, float],
    title: str = "",
    widths: Sequence[float] | None = None,
    **style: Any,
) -> Any:
    """Return the axes (rows, columns) of a new figure of `size` [inch]; `style` are options of its title.

    `widths` are the relative widths of the columns [-]; by default all columns have the same width.
    """
    made = new_panels(rows, columns, size, 130, width_ratios=widths)
    if title:
        made[0, 0].figure.suptitle(title, **style)
    return made


def message(ax: Any, text: str) -> None:
    """Replace axes without data by a message."""
    ax.set_axis_off()
    ax.text(0.5, 0.5, text, ha="center", va="center", transform=ax.transAxes, wrap=True)


def frame(
    ax: Any,
    title: str,
    labels: tuple[str, str],
    *,
    scales: tuple[str, str] = ("linear", "linear"),
    grid: float = 0.4,
    title_size: float | str = "large",
    legend_size: float = 8,
) -> None:
    """Set the scales, the title, the labels, the grid and, if curves have labels, the legend of axes.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes with curves.
    title : str
        Title of the axes.
    labels : (str, str)
        Labels of the x axis and the y axis.
    scales : (str, str)
        Scales of the x axis and the y axis: ``"linear"``, ``"log"`` or ``"plain log"``, a logarithmic scale with decimal
        numbers instead of powers of ten.
    grid : float
        Opacity of the grid at major ticks [-]; there is no grid if it is 0.
    title_size, legend_size : float or str
        Font sizes, as defined by Matplotlib [point].
    """
    for axis, scale, setter in zip((ax.xaxis, ax.yaxis), scales, (ax.set_xscale, ax.set_yscale), strict=True):
        if scale != "linear":
            setter("log")
        if scale == "plain log":
            _plain(axis)
    ax.set(xlabel=labels[0], ylabel=labels[1])
    ax.set_title(title, fontsize=title_size)
    if scales[1] == "linear":
        ax.ticklabel_format(axis="y", useOffset=False, scilimits=(-4, 7))
        low, high = ax.dataLim.intervaly
        if 0.0 <= high - low < 1e-6 * max(abs(low), abs(high)):  # round-off is not a trend
            ax.set_ylim(sorted((0.9 * low, 1.1 * low)))
    if grid:
        ax.grid(which="major", alpha=grid)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=legend_size)


def _plain(axis: Any) -> None:
    """Label a logarithmic axis with a few decimal numbers instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_data_interval()
    many = low > 0 and high > 30.0 * low
    axis.set_major_locator(LogLocator(subs=(1.0,) if many else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.10g}"))
    axis.set_minor_formatter(NullFormatter())
