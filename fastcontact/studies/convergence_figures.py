"""Panels of a mesh-convergence study: errors over the mesh size, pressures of all levels, differences from theory."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.results.units import labelled
from fastcontact.studies.quantities import title
from fastcontact.studies.render.figure import Curve, Line, Panel, marker
from fastcontact.studies.series import Series
from fastcontact.studies.settings import Named

Array = NDArray[np.float64]
# With more curves than this, error bars would hide them.
MOST_CURVES_WITH_BARS = 3


def error_panel(all_series: Sequence[Series], quantity: str, units: Mapping[str, str]) -> Panel:
    """Return the mesh error of a quantity over h, doubly logarithmic, with error bars of the limit, fits and slopes."""
    known = [(k, series) for k, series in enumerate(all_series) if quantity in series.limits]
    if not known:
        return Panel(instead=f"no limit of the {title(quantity)}:\na limit takes three levels")
    named = isinstance(all_series[0].combination, Named)
    few = len(known) <= MOST_CURVES_WITH_BARS
    curves = []
    for position, (k, series) in enumerate(known):
        limit, h = series.limits[quantity], np.array(series.h)
        error = np.abs(np.array(series.values(quantity)) - limit.value) / abs(limit.value)
        bar = limit.uncertainty / abs(limit.value)
        color, shown = f"C{position}", error > 0
        label = f"{series.combination}: order {limit.order:.1f} $\\pm$ {limit.order_uncertainty:.1f}"
        bars = (np.maximum(error[shown] - bar, 0.3 * error[shown]), error[shown] + bar) if few else None
        curves.append(Curve(h[shown], error[shown], f"{marker(k)}-", label, color, size=5, bars=bars))
        if math.isfinite(limit.order) and shown.sum() >= 2:
            # The fitted power law, through the middle of the errors.
            factor = np.exp(np.mean(np.log(error[shown] / h[shown] ** limit.order)))
            curves.append(Curve(h, factor * h**limit.order, ":", color=color))
    return Panel(
        f"Mesh error of the {title(quantity)}",
        labelled("mesh size h" if named else "facet length at the contact h", units, "length"),
        "|value - limit| / limit",
        curves,
        x_scale="plain log",
        y_scale="log",
        minor_grid=0.12,
        legend_size=8 if few else 6.5,
        draw=lambda ax: _slope_triangles(ax, quantity, [series for _, series in known]),
    )


def _slope_triangles(ax: Any, quantity: str, all_series: Sequence[Series]) -> None:
    """Draw triangles whose slopes are the least and the greatest fitted order, rounded to halves."""
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


def pressure_panel(series: Series, theory: Any, units: Mapping[str, str]) -> Panel:
    """Return the contact pressure of all levels over the distance from the axis, and the theory's."""
    if not series.finest.profile:
        return Panel(instead="this case has no contact pair,\nso there is no contact pressure")
    from matplotlib import colormaps

    profiles = [(np.array(level.profile["r"]), np.array(level.profile["pressure"])) for level in series.levels]
    reach = 1.25 * max(np.abs(r[pressure > 0]).max(initial=0.0) for r, pressure in profiles[-2:])
    low = max(-reach, min(float(r.min(initial=0.0)) for r, _ in profiles))
    colors = colormaps["viridis_r"](np.linspace(0.1, 1.0, len(series.levels)))
    curves = []
    for color, level, (r, pressure) in zip(colors, series.levels, profiles, strict=True):
        shown = np.abs(r) <= reach
        style = "o-" if shown.sum() <= 60 else "-"
        label = f"level {level.number}, {level.n_dofs} DOF"
        curves.append(Curve(r[shown], pressure[shown], style, label, color, size=3))
    return Panel(
        f"Contact pressure, {series.combination}",
        labelled("distance from the middle of the contact", units, "length"),
        labelled("contact pressure", units, "pressure"),
        [*curves, *_theory_curves(theory, series, low, reach)],
        x_end=reach,
        x_start=low,
        grid=0.3,
    )


def _theory_curves(theory: Any, series: Series, low: float, reach: float) -> list[Curve]:
    own = pressure_curve(theory)
    if own is None:
        return []
    curves = [("theory" if series.exact_theory else f"theory {series.compared}", "k-", own)]
    force = series.limits.get("force")
    if force is not None and force.value > 0 and hasattr(theory, "at_force"):
        same = pressure_curve(theory.at_force(force.value / series.share))
        curves += [("theory at equal force", "k--", same)] if same is not None else []
    x = np.linspace(low, reach, 600)
    label = "{} ($p_0$ = {:.1f})"
    return [
        Curve(x, t.pressure(np.abs(x)), style, label.format(name, t.pressure_max), width=1.2)
        for name, style, t in curves
    ]


def theory_panel(all_series: Sequence[Series], best: Series, quantity: str, units: Mapping[str, str]) -> Panel:
    """Return the difference from theory over h: it tends to the model error, and the rest is mesh error."""
    known = [(k, series) for k, series in enumerate(all_series) if series.split(quantity)]
    if not known:
        return Panel(instead=f"no theory of the {title(quantity)}, or no limit")
    curves = []
    for k, series in known:
        off = [100 * value for value in series.from_theory(quantity)]
        curves.append(Curve(series.h, off, f"{marker(k)}-", str(series.combination), size=5))
    best = best if best.split(quantity) else known[-1][1]
    found, same = best.split(quantity), best.split_equal_force(quantity)
    assert found is not None
    model = f"model error {100 * found.model:+.3f} % (stays)"
    lines = [Line(100 * found.model, "tab:red", "-", 1.2, model, half_width=100 * found.uncertainty)]
    if same is not None and quantity != "force":
        label = f"model error at equal force {100 * same.model:+.3f} %"
        lines.append(Line(100 * same.model, "tab:green", "--", 1.2, label))
    return Panel(
        f"Model and mesh error of the {title(quantity)}",
        labelled("facet length at the contact h", units, "length"),
        "difference from theory [%]" if best.exact_theory else f"difference from theory {best.compared} [%]",
        curves,
        [*lines, Line(0.0, label="theory")],
        x_scale="plain log",
    )
