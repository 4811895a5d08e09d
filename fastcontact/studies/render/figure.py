"""Figures: panels of curves and horizontal lines, drawn with matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from fastcontact.errors import FastcontactError
from fastcontact.results.plot._axes import displayed

MARKERS = "osD^v<>ph*"


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of a panel, joined: `x` and `y` (n_points,), in the units of its axes."""

    x: Any
    y: Any
    style: str = "-"  # marker and line, as matplotlib writes them
    label: str | None = None  # in the legend; None leaves it out
    color: Any = None  # None: the next one of matplotlib's cycle
    width: float = 1.0  # of the line [point]
    size: float = 4  # of the markers [point]
    bars: tuple[Any, Any] | None = None  # lower and upper ends of error bars, each (n_points,), in the unit of y


@dataclass(frozen=True)
class Line:
    """A horizontal line at `value`, with a band of `half_width` on both sides; both in the unit of the y axis."""

    value: float
    color: str = "black"
    style: str = "-"
    width: float = 1.0
    label: str | None = None
    half_width: float = 0.0


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes and what is drawn on it."""

    title: str = ""
    x_label: str = ""
    y_label: str = ""
    curves: Sequence[Curve] = ()
    lines: Sequence[Line] = ()
    x_scale: str = "linear"  # or "log", or "plain log": few plain numbers instead of powers of ten
    y_scale: str = "linear"  # or "log", or "plain log"
    x_end: float | None = None  # end of the x axis, in its unit; the y axis starts from zero then
    x_start: float = 0.0  # where the x axis then begins
    grid: float = 0.4  # opacity at major ticks; 0: no grid
    minor_grid: float = 0.0  # opacity at minor ticks
    title_size: float | None = None  # [point]
    legend_size: float = 8  # [point]
    draw: Callable[[Any], None] | None = None  # draws on the axes what is more than curves and lines
    instead: str = ""  # shown in place of everything else, where there is nothing to draw


def marker(number: int) -> str:
    """Return the marker of a curve, counted from 0."""
    return MARKERS[number % len(MARKERS)]


def figure(
    panels: Sequence[Sequence[Panel]],
    size: tuple[float, float],
    title: str = "",
    widths: Sequence[float] | None = None,
    **style: Any,
) -> Any:
    """Return a figure of rows of panels, of a `size` [inch], for which matplotlib is needed; `style` is of its title.

    `widths` are those of the columns, in any unit; all are alike by default.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'") from error
    made = Figure(figsize=size, layout="constrained", dpi=130)
    FigureCanvasAgg(made)
    axes = made.subplots(len(panels), max(map(len, panels)), squeeze=False, width_ratios=widths)
    for ax, panel in zip(axes.flat, (panel for row in panels for panel in row), strict=True):
        _draw(panel, ax)
    if title:
        made.suptitle(title, **style)
    displayed(made)
    return made


def _draw(panel: Panel, ax: Any) -> None:
    if panel.instead:
        ax.set_axis_off()
        ax.text(0.5, 0.5, panel.instead, ha="center", va="center", transform=ax.transAxes, wrap=True)
        return
    for curve in panel.curves:
        color = {} if curve.color is None else {"color": curve.color}
        (drawn,) = ax.plot(curve.x, curve.y, curve.style, ms=curve.size, lw=curve.width, label=curve.label, **color)
        if curve.bars is not None:
            ax.vlines(curve.x, *curve.bars, colors=drawn.get_color(), lw=0.7)
    for line in panel.lines:
        ax.axhline(line.value, color=line.color, ls=line.style, lw=line.width, label=line.label)
        if line.half_width:
            ax.axhspan(line.value - line.half_width, line.value + line.half_width, color=line.color, alpha=0.15, lw=0)
    _scale(panel, ax)
    if panel.draw is not None:
        panel.draw(ax)
    ax.set_xlabel(panel.x_label)
    ax.set_ylabel(panel.y_label)
    ax.set_title(panel.title, fontsize=panel.title_size or "large")
    if panel.y_scale == "linear":
        ax.ticklabel_format(axis="y", useOffset=False, scilimits=(-4, 7))
        low, high = ax.dataLim.intervaly
        if 0.0 <= high - low < 1e-6 * max(abs(low), abs(high)):  # round-off is no trend
            ax.set_ylim(sorted((0.9 * low, 1.1 * low)))
    if panel.x_end is not None:
        ax.set_xlim(panel.x_start, panel.x_end or None)
        top = float(ax.dataLim.y1)
        ax.set_ylim(0.0, 1.08 * top if 0.0 < top < float("inf") else None)
    if panel.grid:
        ax.grid(which="major", alpha=panel.grid)
    if panel.minor_grid:
        ax.grid(which="minor", alpha=panel.minor_grid)
    entries = len(ax.get_legend_handles_labels()[0])
    if entries and any(curve.bars is not None for curve in panel.curves):  # matplotlib does not see them in the way
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** (0.02 * panel.legend_size * entries / 2.2))
    if entries:
        ax.legend(fontsize=panel.legend_size)


def _scale(panel: Panel, ax: Any) -> None:
    for axis, scale, setter in ((ax.xaxis, panel.x_scale, ax.set_xscale), (ax.yaxis, panel.y_scale, ax.set_yscale)):
        if scale == "plain log":
            setter("log")
            _plain(axis)
        elif scale != "linear":
            setter(scale)


def _plain(axis: Any) -> None:
    """Label a logarithmic axis with few plain numbers instead of powers of ten."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_data_interval()
    many = low > 0 and high > 30.0 * low
    axis.set_major_locator(LogLocator(subs=(1.0,) if many else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:.10g}"))
    axis.set_minor_formatter(NullFormatter())
