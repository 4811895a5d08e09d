"""Picture of a sweep: quantities over the parameter, and their ratio to theory."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact.studies.pictures import MARKERS, new_figure
from fastcontact.studies.quantities import title, unit
from fastcontact.studies.sweep import Point, Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHOWN = ("force", "pressure_max", "contact_radius")
# From this ratio of the largest to the smallest value on, an axis is logarithmic.
WIDE = 20.0


def overview(sweep: Sweep) -> Figure:
    """Return a figure: main quantities over the first parameter above, their ratio to theory below.

    Points that differ in other parameters are curves of their own.
    """
    names = [name for name in SHOWN if name in sweep.quantities] or sweep.quantities[:3]
    against = any(name in point.theory for point in sweep.points for name in names)
    figure = new_figure(4.6 * max(1, len(names)), 7.6 if against else 4.2)
    axes = figure.subplots(1 + against, max(1, len(names)), squeeze=False)
    for column, name in enumerate(names):
        _values(sweep, name, axes[0, column])
        if against:
            _ratios(sweep, name, axes[1, column])
    figure.suptitle(f"{sweep.title}\n{sweep.combination}", fontsize=11)
    return figure


def _curves(sweep: Sweep) -> list[tuple[str, list[Point]]]:
    """Return the points by the values of all parameters but the first, with a label."""
    others = list(sweep.parameters)[1:]
    found: dict[str, list[Point]] = {}
    for point in sweep.points:
        label = ", ".join(f"{name} = {point.parameters[name]}" for name in others)
        found.setdefault(label, []).append(point)
    return list(found.items())


def _x(sweep: Sweep, points: list[Point]) -> list[Any]:
    first = next(iter(sweep.parameters))
    values = [point.parameters[first] for point in points]
    return values if all(isinstance(v, (int, float)) for v in values) else [str(value) for value in values]


def _finish(sweep: Sweep, ax: Axes, quantity: str, heading: str) -> None:
    first = next(iter(sweep.parameters))
    values = sweep.parameters[first]
    numbers = [float(value) for value in values if isinstance(value, (int, float))]
    if len(numbers) == len(values) and min(numbers) > 0 and max(numbers) > WIDE * min(numbers):
        ax.set_xscale("log")
    ax.set_xlabel(first)
    ax.set_title(heading, fontsize=10)
    ax.grid(which="major", alpha=0.4)
    handles, labels = ax.get_legend_handles_labels()
    if handles:
        ax.legend(handles, labels, fontsize=8)


def _values(sweep: Sweep, quantity: str, ax: Axes) -> None:
    top, bottom = 0.0, math.inf
    for k, (label, points) in enumerate(_curves(sweep)):
        y = np.array([point.values.get(quantity, math.nan) for point in points])
        ax.plot(_x(sweep, points), y, f"{MARKERS[k % len(MARKERS)]}-", ms=4, lw=1.0, label=label or "computed")
        top, bottom = max(top, np.nanmax(y)), min(bottom, np.nanmin(y))
        exact = [point.theory.get(quantity, math.nan) for point in points]
        if np.isfinite(exact).any():
            ax.plot(_x(sweep, points), exact, "k--", lw=1.0, label="theory at equal approach" if k == 0 else None)
    if bottom > 0 and top > WIDE * bottom:
        ax.set_yscale("log")
    ax.set_ylabel(f"{quantity} [{unit(quantity, sweep.units) or '1'}]")
    _finish(sweep, ax, quantity, title(quantity))


def _ratios(sweep: Sweep, quantity: str, ax: Axes) -> None:
    styles = {"theory": ("-", "theory at equal approach"), "equal_force": ("--", "theory at equal force")}
    for k, (label, points) in enumerate(_curves(sweep)):
        for against, (style, words) in styles.items():
            ratios = [point.ratio(quantity, against) for point in points]
            if not np.isfinite(ratios).any() or (against == "equal_force" and quantity == "force"):
                continue
            name = f"to {words}" + (f", {label}" if label else "")
            ax.plot(_x(sweep, points), ratios, f"{MARKERS[k % len(MARKERS)]}{style}", ms=4, lw=1.0, label=name)
    ax.axhline(1.0, color="black", lw=0.8)
    ax.set_ylabel("computed / theory")
    _finish(sweep, ax, quantity, f"{title(quantity)}: ratio to theory")
