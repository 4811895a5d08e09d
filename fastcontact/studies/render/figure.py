"""Figures: panels of curves and horizontal lines, drawn with matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from fastcontact.errors import FastcontactError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MARKERS = "osD^v<>ph*"


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of a panel, joined.

    Attributes
    ----------
    x, y : array_like (n,)
        In the units of the panel's axes.
    style : str
        Marker and line, as matplotlib writes them, e.g. ``"o-"``.
    label : str or None
        In the legend; None leaves it out.
    color : matplotlib colour, optional
        By default the next one of matplotlib's cycle.
    width, size : float
        Of line and markers [point].
    bars : tuple of ndarray (n,), optional
        Lower and upper ends of the error bars, in the unit of `y`.
    """

    x: Any
    y: Any
    style: str = "-"
    label: str | None = None
    color: Any = None
    width: float = 1.0
    size: float = 4
    bars: tuple[Any, Any] | None = None


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
    """What one pair of axes shows.

    Attributes
    ----------
    title, x_label, y_label : str
    curves : sequence of Curve
    lines : sequence of Line
    x_scale, y_scale : str
        ``"linear"`` or ``"log"``, for x also ``"plain log"``: few plain numbers instead of powers of ten.
    x_end : float or None
        Where the x axis ends, in its unit; both axes start from zero then.
    grid, minor_grid : float
        Opacity of the grid at major and at minor ticks; 0: none.
    title_size, legend_size : float or None
        Sizes of the text [point].
    draw : callable, optional
        Called with the axes after the curves: draws what is more than curves and lines.
    instead : str
        Shown in place of everything else, where there is nothing to draw.
    """

    title: str = ""
    x_label: str = ""
    y_label: str = ""
    curves: Sequence[Curve] = ()
    lines: Sequence[Line] = ()
    x_scale: str = "linear"
    y_scale: str = "linear"
    x_end: float | None = None
    grid: float = 0.4
    minor_grid: float = 0.0
    title_size: float | None = None
    legend_size: float = 8
    draw: Callable[[Axes], None] | None = None
    instead: str = ""


def marker(number: int) -> str:
    """Return the marker of a curve, counted from 0."""
    return MARKERS[number % len(MARKERS)]


def figure(panels: Sequence[Sequence[Panel]], size: tuple[float, float], title: str = "", **style: Any) -> Figure:
    """Return a figure of rows of panels, of a `size` [inch]; it needs no display. `style` is that of its title.

    Raises FastcontactError if matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'") from error
    made = Figure(figsize=size, layout="constrained", dpi=130)
    FigureCanvasAgg(made)
    axes = made.subplots(len(panels), max(map(len, panels)), squeeze=False)
    for ax, panel in zip(axes.flat, (panel for row in panels for panel in row), strict=True):
        _draw(panel, ax)
    if title:
        made.suptitle(title, **style)
    return made


def _draw(panel: Panel, ax: Axes) -> None:
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
    if panel.x_end is not None:
        ax.set_xlim(0.0, panel.x_end or None)
        ax.set_ylim(bottom=0.0)
    if panel.grid:
        ax.grid(which="major", alpha=panel.grid)
    if panel.minor_grid:
        ax.grid(which="minor", alpha=panel.minor_grid)
    if ax.get_legend_handles_labels()[0]:
        ax.legend(fontsize=panel.legend_size)


def _scale(panel: Panel, ax: Axes) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    if panel.x_scale != "linear":
        ax.set_xscale("log")
    if panel.x_scale == "plain log":
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    if panel.y_scale != "linear":
        ax.set_yscale(panel.y_scale)
