"""Figures of a mesh-convergence study: errors over mesh size, pressures of all levels and differences from theory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.arrays import Array
from fastcontact.results.units import labelled
from fastcontact.studies.fit import CONFIDENCE
from fastcontact.studies.quantities import title
from fastcontact.studies.render.figure import frame, marker, message
from fastcontact.studies.series import Series
from fastcontact.studies.settings import Named

# Largest number of curves that are drawn with error bars, which would hide more curves.
MOST_CURVES_WITH_BARS = 3


def draw_errors(ax: Any, all_series: Sequence[Series], quantity: str, units: Mapping[str, str]) -> None:
    """Draw the mesh error of a quantity over h in double logarithmic scale, with error bars, fits and slope triangles."""
    known = [(k, series) for k, series in enumerate(all_series) if quantity in series.limits]
    if not known:
        return message(ax, f"no limit of the {title(quantity)}:\nit needs three levels")
    named = isinstance(all_series[0].combination, Named)
    few = len(known) <= MOST_CURVES_WITH_BARS
    for position, (k, series) in enumerate(known):
        limit, h = series.limits[quantity], np.array(series.h)
        error = np.abs(np.array(series.values(quantity)) - limit.value) / abs(limit.value)
        bar = limit.uncertainty / abs(limit.value)
        color, shown = f"C{position}", error > 0
        label = f"{series.combination}: order {limit.order:.1f} $\\pm$ {limit.order_uncertainty:.1f}"
        ax.plot(h[shown], error[shown], f"{marker(k)}-", ms=5, lw=1.0, label=label, color=color)
        if few:
            low, high = np.maximum(error - bar, 0.3 * error), error + bar
            ax.vlines(h[shown], low[shown], high[shown], colors=color, lw=0.7)
        if math.isfinite(limit.order) and shown.sum() >= 2:
            # The fitted power law with the geometric mean of the errors.
            factor = np.exp(np.mean(np.log(error[shown] / h[shown] ** limit.order)))
            ax.plot(h, factor * h**limit.order, ":", lw=1.0, color=color)
    explained = {":": "fit $C\\,h^{order}$"} | ({"|": f"error bar of the limit, {CONFIDENCE:.0%}"} if few else {})
    for style, text in explained.items():
        ax.plot([], [], style, color="0.4", lw=1.0, label=text)
    _slope_triangles(ax, quantity, [series for _, series in known])
    along = labelled("mesh size h" if named else "facet length at the contact h", units, "length")
    labels, size = (along, "|value - limit| / limit"), 8 if few else 6.5
    frame(ax, f"Mesh error of the {title(quantity)}", labels, scales=("plain log", "log"), legend_size=size)
    ax.grid(which="minor", alpha=0.12)
    if few:  # Matplotlib ignores error bars when it places the legend
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** (0.02 * size * (len(known) + len(explained)) / 2.2))


def _slope_triangles(ax: Any, quantity: str, all_series: Sequence[Series]) -> None:
    """Draw slope triangles for the smallest and the largest fitted order, rounded to multiples of one half."""
    orders = [series.limits[quantity].order for series in all_series]
    orders = [order for order in orders if math.isfinite(order)]
    if not orders:
        return
    h = np.concatenate([series.h for series in all_series])
    error = np.abs(np.concatenate([series.errors(quantity) for series in all_series]))
    left = float(np.exp(0.72 * np.log(h.max()) + 0.28 * np.log(h.min())))
    bottom = float(error[error > 0].min())
    for slope in sorted({max(0.5, round(2 * min(orders)) / 2), max(0.5, round(2 * max(orders)) / 2)}):
        right = left * 1.7
        top = bottom * 1.7**slope
        ax.fill([left, right, right], [bottom, bottom, top], facecolor="0.85", edgecolor="0.4", lw=0.8)
        ax.annotate(f"{slope:g}", (right / 1.03, math.sqrt(bottom * top)), fontsize=8, ha="right", va="center")
        ax.annotate("1", (math.sqrt(left * right), bottom / 1.12), fontsize=8, ha="center", va="top")
        left *= 2.1


def draw_pressure(ax: Any, series: Series, theory: Any, units: Mapping[str, str]) -> None:
    """Draw the contact pressure of all levels and of the theory over the distance from the axis or the contact centre."""
    if not series.finest.profile:
        return message(ax, "this case has no contact pair,\nso there is no contact pressure")
    from matplotlib import colormaps

    profiles = [(np.array(level.profile["r"]), np.array(level.profile["pressure"])) for level in series.levels]
    reach = 1.25 * max(np.abs(r[pressure > 0]).max(initial=0.0) for r, pressure in profiles[-2:])
    low = max(-reach, min(float(r.min(initial=0.0)) for r, _ in profiles))
    colors = colormaps["viridis_r"](np.linspace(0.1, 1.0, len(series.levels)))
    for color, level, (r, pressure) in zip(colors, series.levels, profiles, strict=True):
        shown = np.abs(r) <= reach
        style = "o-" if shown.sum() <= 60 else "-"
        label = f"level {level.number}, {level.n_dofs} DOF"
        ax.plot(r[shown], pressure[shown], style, ms=3, lw=1.0, label=label, color=color)
    _draw_theory(ax, theory, series, np.linspace(low, reach, 600))
    labels = (
        labelled("distance from the middle of the contact", units, "length"),
        labelled("contact pressure", units, "pressure"),
    )
    frame(ax, f"Contact pressure, {series.combination}", labels, grid=0.3)
    ax.set_xlim(low, reach or None)
    top = float(ax.dataLim.y1)
    ax.set_ylim(0.0, 1.08 * top if 0.0 < top < np.inf else None)


def _draw_theory(ax: Any, theory: Any, series: Series, x: Array) -> None:
    """Draw the pressure of a theory at equal approach and at equal force, where it is defined."""
    curve_given = pressure_curve(theory)
    if curve_given is None:
        return
    curves = [("theory" if series.exact_theory else f"theory {series.compared}", "k-", curve_given)]
    force = series.limits.get("force")
    if force is not None and force.value > 0 and hasattr(theory, "at_force"):
        same = pressure_curve(theory.at_force(force.value / series.share))
        curves += [("theory at equal force", "k--", same)] if same is not None else []
    for name, style, curve in curves:
        ax.plot(x, curve.pressure(np.abs(x)), style, lw=1.2, label=f"{name} ($p_0$ = {curve.pressure_max:.1f})")


def draw_differences(
    ax: Any, all_series: Sequence[Series], best: Series, quantity: str, units: Mapping[str, str]
) -> None:
    """Draw the difference from theory over h, which tends to the model error as the mesh error vanishes."""
    known = [(k, series) for k, series in enumerate(all_series) if series.split(quantity)]
    if not known:
        return message(ax, f"no theory of the {title(quantity)}, or no limit")
    for k, series in known:
        off = [100 * value for value in series.from_theory(quantity)]
        ax.plot(series.h, off, f"{marker(k)}-", ms=5, lw=1.0, label=str(series.combination))
    best = best if best.split(quantity) else known[-1][1]
    split, same = best.split(quantity), best.split_equal_force(quantity)
    assert split is not None
    model, bar = 100 * split.model, 100 * split.uncertainty
    ax.axhline(model, color="tab:red", lw=1.2, label=f"model error {model:+.3f} % (mesh-independent)")
    ax.axhspan(model - bar, model + bar, color="tab:red", alpha=0.15, lw=0)
    if same is not None and quantity != "force":
        label = f"model error at equal force {100 * same.model:+.3f} %"
        ax.axhline(100 * same.model, color="tab:green", ls="--", lw=1.2, label=label)
    ax.axhline(0.0, color="black", lw=1.0, label="theory")
    labels = (
        labelled("facet length at the contact h", units, "length"),
        "difference from theory [%]" if best.exact_theory else f"difference from theory {best.compared} [%]",
    )
    frame(ax, f"Model and mesh error of the {title(quantity)}", labels, scales=("plain log", "linear"))
