"""Pictures of a study: errors over the mesh size, pressure on all levels over theory, differences from theory."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import FastcontactError
from fastcontact.studies.quantities import title
from fastcontact.studies.study import Series, Study

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
MARKERS = "osD^v<>ph*"
# With more curves than this, error bars only hide them.
BARS_UP_TO = 3


def plain_log_axis(ax: Axes) -> None:
    """Make the x axis logarithmic with plain numbers, few enough not to run into each other."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    ax.set_xscale("log")
    ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure [inches] that needs no display.

    Raises
    ------
    FastcontactError
        If matplotlib is not installed.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError as error:
        raise FastcontactError("pictures need matplotlib: pip install 'fastcontact[plot]'") from error
    figure = Figure(figsize=(width, height), layout="constrained", dpi=130)
    FigureCanvasAgg(figure)
    return figure


def error_figure(study: Study, quantities: Sequence[str] = ("force", "pressure_max")) -> Figure:
    """Return a figure with the mesh errors of some quantities, one panel each."""
    shown = [name for name in quantities if any(name in series.limits for series in study.series)]
    figure = new_figure(5.6 * max(1, len(shown)), 4.8)
    for ax, name in zip(np.atleast_1d(figure.subplots(1, max(1, len(shown)))), shown, strict=False):
        errors(study, name, ax)
    figure.suptitle(study.title)
    return figure


def profile_figure(study: Study) -> Figure:
    """Return a figure with the pressure on all levels of the best combination."""
    figure = new_figure(7.4, 5.0)
    profiles(study, study.best, figure.subplots())
    return figure


def theory_figure(study: Study, quantities: Sequence[str] = ("force", "pressure_max")) -> Figure | None:
    """Return a figure with the differences from theory over the mesh size; None without a theory."""
    shown = [name for name in quantities if any(series.split(name) for series in study.series)]
    if not shown:
        return None
    figure = new_figure(5.6 * len(shown), 4.8)
    for ax, name in zip(np.atleast_1d(figure.subplots(1, len(shown))), shown, strict=True):
        from_theory(study, name, ax)
    figure.suptitle(study.title)
    return figure


def overview(study: Study) -> Figure:
    """Return one figure with everything: errors above, pressure and the difference from theory below."""
    figure = new_figure(12.0, 9.2)
    axes = figure.subplots(2, 2)
    for ax, name in zip(axes[0], ("force", "pressure_max"), strict=True):
        errors(study, name, ax)
    profiles(study, study.best, axes[1, 0])
    from_theory(study, "pressure_max", axes[1, 1])
    figure.suptitle(study.title)
    return figure


def _empty(ax: Axes, text: str) -> None:
    ax.set_axis_off()
    ax.text(0.5, 0.5, text, ha="center", va="center", transform=ax.transAxes, wrap=True)


def _length(study: Study) -> str:
    return study.units["length"]


def errors(study: Study, quantity: str, ax: Axes) -> Axes:
    """Plot the mesh error of a quantity over h, doubly logarithmic, with the error bar of the limit and slopes."""
    known = [(k, series) for k, series in enumerate(study.series) if quantity in series.limits]
    if not known:
        _empty(ax, f"no limit of the {title(quantity)}:\na limit takes three levels")
        return ax
    for k, series in known:
        limit = series.limits[quantity]
        h = np.array([level.h for level in series.levels])
        off = np.abs(np.array(series.values(quantity)) - limit.value) / abs(limit.value)
        bar = limit.uncertainty / abs(limit.value)
        shown = off > 0
        label = f"{series.combination}: order {limit.order:.1f} $\\pm$ {limit.order_uncertainty:.1f}"
        (line,) = ax.plot(h[shown], off[shown], f"{MARKERS[k % len(MARKERS)]}-", ms=5, lw=1.0, label=label)
        if len(known) <= BARS_UP_TO:
            low, high = np.maximum(off[shown] - bar, 0.3 * off[shown]), off[shown] + bar
            ax.vlines(h[shown], low, high, colors=line.get_color(), lw=0.7)
        fitted = _fitted(h, off, limit.order)
        if fitted is not None:
            ax.plot(h, fitted, ":", color=line.get_color(), lw=1.0)
    plain_log_axis(ax)
    ax.set_yscale("log")
    _slope_triangle(ax, quantity, [series for _, series in known])
    ax.set_xlabel(f"facet length at the contact h [{_length(study)}]")
    ax.set_ylabel("|value - limit| / limit")
    ax.set_title(f"Mesh error of the {title(quantity)}")
    ax.grid(which="major", alpha=0.4)
    ax.grid(which="minor", alpha=0.12)
    ax.legend(fontsize=8 if len(known) <= BARS_UP_TO else 6.5)
    return ax


def _fitted(h: Array, off: Array, order: float) -> Array | None:
    """Return the power law of the fitted order through the middle of the errors."""
    positive = off > 0
    if not math.isfinite(order) or positive.sum() < 2:
        return None
    return np.asarray(np.exp(np.mean(np.log(off[positive] / h[positive] ** order))) * h**order)


def _slope_triangle(ax: Axes, quantity: str, series: Sequence[Series]) -> None:
    """Draw triangles whose slopes are the least and the greatest fitted order, rounded to halves."""
    orders = [s.limits[quantity].order for s in series if math.isfinite(s.limits[quantity].order)]
    if not orders:
        return
    h = np.array([level.h for s in series for level in s.levels])
    off = np.abs(np.concatenate([s.errors(quantity) for s in series]))
    off = off[off > 0]
    left = float(np.exp(0.72 * np.log(h.max()) + 0.28 * np.log(h.min())))
    bottom = float(off.min())
    for slope in sorted({max(0.5, round(2 * min(orders)) / 2), max(0.5, round(2 * max(orders)) / 2)}):
        right = left * 1.7
        top = bottom * 1.7**slope
        ax.fill([left, right, right], [bottom, bottom, top], facecolor="0.85", edgecolor="0.4", lw=0.8)
        ax.annotate(f"{slope:g}", (right * 1.05, math.sqrt(bottom * top)), fontsize=8, va="center")
        ax.annotate("1", (math.sqrt(left * right), bottom / 1.12), fontsize=8, ha="center", va="top")
        left *= 2.1


def profiles(study: Study, series: Series, ax: Axes) -> Axes:
    """Plot the contact pressure of all levels over the distance from the axis, with theory beside it."""
    if not series.finest.profile:
        _empty(ax, "this case has no contact pair,\nso there is no contact pressure")
        return ax
    from matplotlib import colormaps

    reach = 1.25 * max(max(_closed(level.profile), default=0.0) for level in series.levels[-2:])
    colours = colormaps["viridis_r"](np.linspace(0.1, 1.0, len(series.levels)))
    for colour, level in zip(colours, series.levels, strict=True):
        r, p = (np.array(level.profile[key]) for key in ("r", "pressure"))
        shown = r <= reach
        dots = int(shown.sum()) <= 60
        label = f"level {level.number}, {level.n_dofs} DOF"
        ax.plot(r[shown], p[shown], "o-" if dots else "-", ms=3, lw=1.0, color=colour, label=label)
    _theory_curves(study.theory, series, ax, reach)
    ax.set_xlabel(f"distance from the axis [{_length(study)}]")
    ax.set_ylabel(f"contact pressure [{study.units['pressure']}]")
    ax.set_title(f"Contact pressure, {series.combination}")
    ax.set_xlim(0.0, reach or None)
    ax.set_ylim(bottom=0.0)
    ax.grid(alpha=0.3)
    ax.legend(fontsize=8)
    return ax


def _closed(profile: dict[str, list[float]]) -> list[float]:
    return [r for r, p in zip(profile["r"], profile["pressure"], strict=True) if p > 0]


def _theory_curves(theory: Any, series: Series, ax: Axes, reach: float) -> None:
    if not hasattr(theory, "pressure"):
        return
    curves = {"theory, equal approach": (theory, "k-")}
    force = series.limits.get("force")
    if force is not None and force.value > 0 and hasattr(theory, "at_force"):
        curves["theory, equal force"] = (theory.at_force(force.value), "k--")
    for label, (curve, style) in curves.items():
        x = np.linspace(0.0, reach, 600)
        ax.plot(x, curve.pressure(x), style, lw=1.2, label=f"{label} ($p_0$ = {curve.pressure_max:.1f})")


def from_theory(study: Study, quantity: str, ax: Axes) -> Axes:
    """Plot the difference from theory over h: it tends to the model error, what is above that is mesh error."""
    known = [(k, series) for k, series in enumerate(study.series) if series.split(quantity)]
    if not known:
        _empty(ax, f"no theory of the {title(quantity)}, or no limit")
        return ax
    for k, series in known:
        theory = series.theory[quantity]
        h = [level.h for level in series.levels]
        off = [100 * (value / theory - 1.0) for value in series.values(quantity)]
        ax.plot(h, off, f"{MARKERS[k % len(MARKERS)]}-", ms=5, lw=1.0, label=str(series.combination))
    best = study.best if study.best.split(quantity) else known[-1][1]
    found = best.split(quantity)
    assert found is not None
    ax.axhline(100 * found.model, color="tab:red", lw=1.2, label=f"model error {100 * found.model:+.3f} % (stays)")
    bar = 100 * found.uncertainty
    ax.axhspan(100 * found.model - bar, 100 * found.model + bar, color="tab:red", alpha=0.15, lw=0)
    same = best.split_equal_force(quantity) if quantity != "force" else None
    if same is not None:
        label = f"model error at equal force {100 * same.model:+.3f} %"
        ax.axhline(100 * same.model, color="tab:green", lw=1.2, ls="--", label=label)
    ax.axhline(0.0, color="black", lw=1.0, label="theory")
    plain_log_axis(ax)
    ax.set_xlabel(f"facet length at the contact h [{_length(study)}]")
    ax.set_ylabel("difference from theory at equal approach [%]")
    ax.set_title(f"Model and mesh error of the {title(quantity)}")
    ax.grid(which="major", alpha=0.4)
    ax.legend(fontsize=8)
    return ax
