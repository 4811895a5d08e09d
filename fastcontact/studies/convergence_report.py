"""Result of a mesh-convergence study, and its report in the form of sentences, tables, a dictionary and a figure."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from fastcontact.analytic.pressure_curve import pressure_curve
from fastcontact.arrays import AnyArray, Array
from fastcontact.cases.summary import finite_or_none
from fastcontact.results.units import axis_label
from fastcontact.studies.fit import CONFIDENCE, Limit
from fastcontact.studies.quantities import RATIOS, column, title
from fastcontact.studies.report import Report, Rows, format_axes, marker, number, panels, percent, show_message, to_rows
from fastcontact.studies.series import Series, Split

# Quantities that the report discusses in sentences, in this order.
MAIN = ("pressure_max", "force")


def sentences(series: Series) -> list[str]:
    """Return sentences on the mesh errors and the differences from theory of a combination of element and formulation."""
    if not series.limits:
        return [f"{series.combination}: {_missing_limits(series)}."]
    names = [name for name in series.shown(MAIN) if name in series.limits]
    return [*(text for name in names for text in _quantity_sentences(series, name)), *_equal_force_sentences(series)]


def _missing_limits(series: Series) -> str:
    n = len(series.levels)
    return f"{n} level{'s were' if n != 1 else ' was'} solved, but an extrapolated limit needs three"


def _quantity_sentences(series: Series, quantity: str) -> Iterator[str]:
    """Yield the sentences on a quantity with a limit."""
    limit, split, reference = series.limits[quantity], series.split(quantity), series.reference.get(quantity)
    if split is None:
        error = _errors(series, quantity)[-1]
        yield f"{series.combination}: the mesh error of the {title(quantity)} is {error} on the finest mesh."
    else:
        yield f"{series.combination}: {_comparison_with_theory(series, quantity, split)}"
    if not limit.converging:
        yield (
            f"The {title(quantity)} does not converge: its changes between levels do not decrease towards the finest mesh, "
            "and its error bar is meaningless. It may have no limit, or finer meshes are needed."
        )
    if series.known_at_nodes(quantity):
        yield f"The {title(quantity)} is only known at nodes: its error bar is half the distance between them."
    if split is None:
        return
    differences = series.from_theory(quantity)
    closest = int(np.nanargmin(np.abs(differences)))
    difference, level = differences[closest], series.levels[closest]
    has_notable_error = split.resolved and not series.exact_theory and series.has_model_error(quantity)
    if has_notable_error and abs(difference) < 0.5 * abs(split.model):
        yield (
            f"Level {level.number} ({level.n_dofs} degrees of freedom) lies only {percent(difference)} from theory because "
            f"its mesh error of {percent(difference - split.model)} cancels the model error: the agreement does not prove "
            "that the mesh is fine enough."
        )
    if reference is not None:
        yield (
            f"The case's mesh-converged solution lies {'inside' if limit.contains(reference) else 'OUTSIDE'} the error bar "
            f"of the limit ({CONFIDENCE:.0%}). The limit deviates from it by {percent(limit.value / reference - 1.0)}."
        )


def _comparison_with_theory(series: Series, quantity: str, split: Split) -> str:
    """Return a sentence on the difference of a quantity from theory, which consists of model error and mesh error."""
    limit = series.limits[quantity]
    start = ("" if series.exact_theory else f"{series.compared} ") + f"the {title(quantity)}"
    bar, dofs = f"+- {100 * split.uncertainty:.2g} %", f"({series.finest.n_dofs} degrees of freedom)"
    mesh_error = f"{percent(split.mesh)} is mesh error on the finest mesh {dofs}"
    if series.converges_to_theory(quantity) is False:
        return (
            f"{start} tends to {number(limit.value, 6)} +- {number(limit.uncertainty, 2)}, and the theory gives "
            f"{number(split.theory, 6)}. That theory is exact for the bodies of the model, so this is not a model error: "
            f"{series.combination} does not converge to it on these meshes. Compare formulations (--formulations all), or "
            "use matching meshes on the two sides."
        )
    if not series.has_model_error(quantity):
        orders = ", ".join(f"{order:.2g}" for order in series.orders(quantity)[1:])
        reason = "change monotonically with the mesh size" if limit.converging else "converge"
        return (
            f"{start} differs from theory by {percent(split.total)} on the finest mesh {dofs}. Its values do not {reason} "
            f"(observed orders {orders}): they do not support an extrapolation, and no model error is stated. Compute more "
            "levels."
        )
    if split.resolved and not series.exact_theory:
        return (
            f"{start} differs from theory by {percent(split.total)}. Of that, {percent(split.model, split.uncertainty)} "
            f"({bar}) is model error, which no mesh removes, and {mesh_error}, which goes to zero."
        )
    return f"{start} agrees with theory within the error bar of its limit, {percent(split.model)} {bar}; {mesh_error}."


def _errors(series: Series, quantity: str) -> list[str]:
    """Return the errors of all levels as text: percentages of the limit, or numbers in the unit of the quantity.

    The latter are for quantities that are relative errors themselves, and for limits that are zero within their error bar.
    """
    limit = series.limits.get(quantity)
    if limit is None or not (quantity in RATIOS or limit.contains(0.0)):
        return list(map(percent, series.errors(quantity)))
    differences = (value - limit.value for value in series.values(quantity))
    return [f"{difference:+.3g}" if math.isfinite(difference) else "-" for difference in differences]


def _equal_force_sentences(series: Series) -> Iterator[str]:
    """Yield a sentence on the model errors at equal force, if they are known."""
    at_force, at_approach = series.split_equal_force("pressure_max"), series.split("pressure_max")
    if at_force is None or at_approach is None:
        return
    splits = {
        "of the largest pressure is": at_force,
        ", and that of the contact radius is": series.split_equal_force("contact_radius"),
    }
    errors = [f"{name} {percent(s.model)} (+- {100 * s.uncertainty:.2g} %)" for name, s in splits.items() if s]
    text = f"{series.combination}: at equal force the model error {''.join(errors)}"
    if abs(at_force.model) < 0.3 * abs(at_approach.model) and at_approach.resolved:
        text += ": most of the difference at equal approach is in the force, not in its distribution"
    yield text + "."


# Standard quantities in the tables of levels. The tables of limits contain all quantities.
TABLE_QUANTITIES = ("force", "pressure_max", "contact_radius", "von_mises_max")
# Columns of the tables of limits.
LIMIT_COLUMNS = ("limit", "+-", "order", "theory", "model error", "mesh error", "at equal force")
# Marks after the error bar of a limit if the values do not converge, and if it is half the distance between nodes.
NOT_CONVERGED, NODE_SPACING = " (unsettled)", " (node spacing)"


def level_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return a header and a row for each level with h, DOF and, for each quantity, its value, error and order."""
    columns = [
        ("level", [str(level.number) for level in series.levels]),
        (axis_label("h", units, "length"), [number(h, 4) for h in series.h]),
        ("DOF", [str(level.n_dofs) for level in series.levels]),
    ]
    for name in series.shown(TABLE_QUANTITIES):
        orders = [f"{order:.2f}" if math.isfinite(order) else "-" for order in series.orders(name)]
        columns.append((column(name, name, units), [number(value, 8) for value in series.values(name)]))
        columns += [("error", _errors(series, name)), ("order", orders)]
    return to_rows(columns)


def limit_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return a header and a row for each quantity with a limit: limit, order, theory and errors."""
    cells = [[column(title(name), name, units), *_limit_entries(series, name, LIMIT_COLUMNS)] for name in series.limits]
    nonempty = [any(row[index] != "-" for row in cells) for index in range(len(LIMIT_COLUMNS) + 1)]
    return [list(itertools.compress(row, nonempty)) for row in (["quantity", *LIMIT_COLUMNS], *cells)]


def comparison_rows(all_series: Sequence[Series], quantities: Sequence[str], units: Mapping[str, str]) -> Rows:
    """Return a header and a row for each combination with the limits, mesh errors and model errors of the quantities."""
    columns = ("limit", "+-", "order alone", "mesh error", "model error")
    header = ["combination", "levels", "finest DOF"]
    for name in quantities:
        header += [column(name, name, units), "+-", "order", "mesh error", "model error"]
    at_force = ["p at equal force"] if "pressure_max" in quantities else []
    rows = []
    for series in all_series:
        rows.append([str(series.combination), str(len(series.levels)), str(series.finest.n_dofs)])
        rows[-1] += [text for name in quantities for text in _limit_entries(series, name, columns)]
        rows[-1] += _limit_entries(series, "pressure_max", ["at equal force"] * len(at_force))
    return [header + at_force, *rows]


def _limit_entries(series: Series, quantity: str, columns: Sequence[str]) -> list[str]:
    """Return the entries of a quantity in given columns of a table of limits, or dashes if it has no limit."""
    limit, split = series.limits.get(quantity), series.split(quantity)
    if limit is None:
        return ["-"] * len(columns)
    at_force = series.split_equal_force(quantity) if quantity != "force" else None
    order, at_nodes = f"{limit.order:.2f}", series.known_at_nodes(quantity)
    mark = NODE_SPACING if at_nodes else "" if limit.converging else NOT_CONVERGED
    mesh_error = percent(split.mesh) if split else _errors(series, quantity)[-1]
    texts = {
        "limit": number(limit.value, 8),
        "+-": number(limit.uncertainty, 2) + mark,
        "order": f"{order} +- {limit.order_uncertainty:.2f}" if math.isfinite(limit.order) else "-",
        "order alone": order,
        "theory": number(series.theory.get(quantity, math.nan), 8),
        "model error": percent(split.model if split and series.has_model_error(quantity) else None),
        "mesh error": "-" if at_nodes else mesh_error,
        "at equal force": percent(at_force.model if at_force else None),
    }
    return [texts[name] for name in columns]


def csv_columns(all_series: Sequence[Series]) -> dict[str, list[Any]]:
    """Return the columns (n_rows,) of `Study.table` by name."""
    levels = [(series.combination, level) for series in all_series for level in series.levels]
    columns: dict[str, list[Any]] = {
        "element": [combination.element or "" for combination, _ in levels],
        "formulation": [combination.formulation or "" for combination, _ in levels],
        "level": [level.number for _, level in levels],
        **{name: [getattr(level, name) for _, level in levels] for name in ("h", "n_dofs", "seconds")},
    }
    kinds = {"": Series.values, "_error": Series.errors, "_order": Series.orders, "_from_theory": Series.from_theory}
    for name in dict.fromkeys(name for series in all_series for name in series.quantities):
        for ending, values in kinds.items():
            columns[name + ending] = [value for series in all_series for value in values(series, name)]
    return columns


def series_dict(series: Series) -> dict[str, Any]:
    """Return the results of a combination of element and formulation for JSON."""
    return {
        "element": series.combination.element,
        "formulation": series.combination.formulation,
        "levels": [{"level": level.number, **level.as_dict()} for level in series.levels],
        "failed": [{"level": number, "error": text} for number, text in series.failed.items()],
        "quantities": {name: _quantity_dict(series, name) for name in series.quantities},
        "equal_force": {
            name: _fields(split, theory="theory", model_error="model", mesh_error="mesh", uncertainty="uncertainty")
            for name in series.quantities
            if name != "force" and (split := series.split_equal_force(name)) is not None
        },
        "sentences": sentences(series),
    }


def _fields(values: Limit | Split | None, **names: str) -> dict[str, Any]:
    """Return a dictionary from the keys of `names` to the fields of `values` of these names.

    NaN is replaced by None. If `values` is None, all entries are None.
    """
    fields = {key: getattr(values, name, None) for key, name in names.items()}
    return {key: finite_or_none(value) if isinstance(value, float) else value for key, value in fields.items()}


def _quantity_dict(series: Series, name: str) -> dict[str, Any]:
    """Return limit, order, theory and errors of a quantity, with None for missing numbers."""
    limit, split, reference = series.limits.get(name), series.split(name), series.reference.get(name)
    own_names = {key: key for key in ("uncertainty", "order", "order_uncertainty", "converging")}
    entry: dict[str, Any] = {
        **_fields(limit, limit="value", **own_names),
        "converges_to_theory": series.converges_to_theory(name),
        "theory": series.theory.get(name),
        **_fields(
            split if series.has_model_error(name) else None, model_error="model", model_error_uncertainty="uncertainty"
        ),
        "mesh_error": finite_or_none(series.mesh_error(name)),
    }
    if reference is not None:
        entry["reference"] = reference
        entry["reference_in_error_bar"] = limit.contains(reference) if limit else None
        entry["reference_deviation"] = limit.value / reference - 1.0 if limit else None
    return entry


# Largest number of curves that are drawn with error bars. The bars of more curves would hide each other.
MOST_CURVES_WITH_BARS = 3


def draw_errors(ax: Any, all_series: Sequence[Series], quantity: str, units: Mapping[str, str]) -> None:
    """Draw the mesh error of a quantity against h with logarithmic axes, error bars, fits and slope triangles."""
    fitted = [(k, series) for k, series in enumerate(all_series) if quantity in series.limits]
    if not fitted:
        return show_message(ax, f"no limit of the {title(quantity)}:\nit needs three levels")
    has_bars = len(fitted) <= MOST_CURVES_WITH_BARS
    for position, (k, series) in enumerate(fitted):
        limit, h = series.limits[quantity], np.array(series.h)
        error = np.abs(np.array(series.values(quantity)) - limit.value) / abs(limit.value)
        bar = limit.uncertainty / abs(limit.value)
        color, positive = f"C{position}", error > 0
        label = f"{series.combination}: order {limit.order:.1f} $\\pm$ {limit.order_uncertainty:.1f}"
        ax.plot(h[positive], error[positive], f"{marker(k)}-", ms=5, lw=1.0, label=label, color=color)
        if has_bars:
            low, high = np.maximum(error - bar, 0.3 * error), error + bar
            ax.vlines(h[positive], low[positive], high[positive], colors=color, lw=0.7)
        if math.isfinite(limit.order) and positive.sum() >= 2:
            # The power law of the fitted order through the geometric mean of the errors.
            factor = np.exp(np.mean(np.log(error[positive] / h[positive] ** limit.order)))
            ax.plot(h, factor * h**limit.order, ":", lw=1.0, color=color)
    entries = {":": "fit $C\\,h^{order}$"} | ({"|": f"error bar of the limit, {CONFIDENCE:.0%}"} if has_bars else {})
    for style, text in entries.items():
        ax.plot([], [], style, color="0.4", lw=1.0, label=text)
    _slope_triangles(ax, quantity, [series for _, series in fitted])
    mesh_size = "mesh size h" if all_series[0].combination.function else "facet length at the contact h"
    labels, size = (axis_label(mesh_size, units, "length"), "|value - limit| / limit"), 8 if has_bars else 6.5
    format_axes(ax, f"Mesh error of the {title(quantity)}", labels, scales=("plain log", "log"), legend_size=size)
    ax.grid(which="minor", alpha=0.12)
    if has_bars:  # Matplotlib ignores error bars when it places the legend
        low, high = ax.get_ylim()
        ax.set_ylim(low, high * (high / low) ** (0.02 * size * (len(fitted) + len(entries)) / 2.2))


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
    """Draw the contact pressure of all levels and of the theory against the distance from the middle of the contact."""
    if not series.finest.profile:
        return show_message(ax, "this case has no contact pair,\nso there is no contact pressure")
    from matplotlib import colormaps

    profiles = [(np.array(level.profile["r"]), np.array(level.profile["pressure"])) for level in series.levels]
    reach = 1.25 * max(np.abs(r[pressure > 0]).max(initial=0.0) for r, pressure in profiles[-2:])
    low = max(-reach, min(float(r.min(initial=0.0)) for r, _ in profiles))
    colors = colormaps["viridis_r"](np.linspace(0.1, 1.0, len(series.levels)))
    for color, level, (r, pressure) in zip(colors, series.levels, profiles, strict=True):
        visible = np.abs(r) <= reach
        style = "o-" if visible.sum() <= 60 else "-"
        label = f"level {level.number}, {level.n_dofs} DOF"
        ax.plot(r[visible], pressure[visible], style, ms=3, lw=1.0, label=label, color=color)
    _draw_theory(ax, theory, series, np.linspace(low, reach, 600))
    x_label = axis_label("distance from the middle of the contact", units, "length")
    labels = x_label, axis_label("contact pressure", units, "pressure")
    format_axes(ax, f"Contact pressure, {series.combination}", labels, grid=0.3)
    ax.set_xlim(low, reach or None)
    top = float(ax.dataLim.y1)
    ax.set_ylim(0.0, 1.08 * top if 0.0 < top < np.inf else None)


def _draw_theory(ax: Any, theory: Any, series: Series, x: Array) -> None:
    """Draw the pressure of a theory at equal approach and at equal force, where it is defined."""
    at_approach = pressure_curve(theory)
    if at_approach is None:
        return
    curves = [("theory" if series.exact_theory else f"theory {series.compared}", "k-", at_approach)]
    force = series.limits.get("force")
    if force is not None and force.value > 0 and hasattr(theory, "at_force"):
        at_force = pressure_curve(theory.at_force(force.value / series.share))
        curves += [("theory at equal force", "k--", at_force)] if at_force is not None else []
    for name, style, curve in curves:
        ax.plot(x, curve.pressure(np.abs(x)), style, lw=1.2, label=f"{name} ($p_0$ = {curve.pressure_max:.1f})")


def draw_differences(ax: Any, all_series: Sequence[Series], best: Series, units: Mapping[str, str]) -> None:
    """Draw the difference of the largest pressure from theory against h, which tends to the model error."""
    quantity = "pressure_max"
    compared = [(k, series) for k, series in enumerate(all_series) if series.split(quantity)]
    if not compared:
        return show_message(ax, f"no theory of the {title(quantity)}, or no limit")
    for k, series in compared:
        differences = [100 * value for value in series.from_theory(quantity)]
        ax.plot(series.h, differences, f"{marker(k)}-", ms=5, lw=1.0, label=str(series.combination))
    best = best if best.split(quantity) else compared[-1][1]
    split, at_force = best.split(quantity), best.split_equal_force(quantity)
    assert split is not None
    model, bar = 100 * split.model, 100 * split.uncertainty
    ax.axhline(model, color="tab:red", lw=1.2, label=f"model error {model:+.3f} % (mesh-independent)")
    ax.axhspan(model - bar, model + bar, color="tab:red", alpha=0.15, lw=0)
    if at_force is not None:
        label = f"model error at equal force {100 * at_force.model:+.3f} %"
        ax.axhline(100 * at_force.model, color="tab:green", ls="--", lw=1.2, label=label)
    ax.axhline(0.0, color="black", lw=1.0, label="theory")
    y_label = "difference from theory [%]" if best.exact_theory else f"difference from theory {best.compared} [%]"
    labels = axis_label("facet length at the contact h", units, "length"), y_label
    format_axes(ax, f"Model and mesh error of the {title(quantity)}", labels, scales=("plain log", "linear"))


# Standard quantities in figures and in the table of all combinations.
COMPARED = ("force", "pressure_max")


@dataclass(frozen=True, eq=False, repr=False)
class Study(Report):
    """The result of a mesh-convergence study, with the attributes of `Report` and the following.

    Attributes
    ----------
    series : list of Series
        Results of each combination of element and contact formulation that was solved.
    failed : dict of str to str
        Reason for the failure of each combination that could not be solved. The keys are the names of the combinations.
    theory : object or None
        Theory at equal approach, an object of `fastcontact.analytic`; None if the case has none.
    """

    kind = "Mesh convergence"
    picture = "mesh errors over the mesh size, the pressure of all levels and of the theory, the difference from theory"
    explanations = (
        "The limit is the value to which the results tend with mesh refinement, from a fit of value = limit + C h^order. It "
        f"lies within the error bar with a probability of {CONFIDENCE:.0%}. Orders between two levels are erratic, because "
        "the edge of the contact lies at another position within a facet on each mesh; the fitted order is more reliable.",
        "The mesh error is the difference between the finest mesh and the limit and decreases with mesh refinement. The "
        "model error is the difference between the limit and the theory; it does not depend on the mesh, because theory and "
        "model describe different bodies. Both are relative to the theory, and their sum is the difference from theory.",
        "A comparison at equal approach has the same displacement, and one at equal force the same contact force.",
    )

    series: list[Series]
    failed: dict[str, str]
    theory: Any

    @property
    def best(self) -> Series:
        """Results of the combination of highest expected accuracy among those that were solved on the most levels."""
        n_levels = max(len(series.levels) for series in self.series)
        candidates = [series for series in self.series if len(series.levels) == n_levels]
        return max(candidates, key=lambda series: series.combination.rank)

    def as_dict(self) -> dict[str, Any]:
        """Return the study as numbers, strings, lists and dictionaries, as ``--json`` writes it.

        The top level contains the results of the combination `best`, and ``combinations`` contains all combinations. Errors
        are relative to the theory, or to the limit if there is no theory [-]. ``mesh_error`` is the error of the finest mesh,
        and ``model_error + mesh_error`` is its difference from theory. ``uncertainty`` is the half-width of the 95 % interval
        of the limit [unit of the quantity].
        """
        combinations = [series_dict(series) for series in self.series]
        numbers = {"confidence": CONFIDENCE, **series_dict(self.best), "combinations": combinations}
        return self.framed({**numbers, "failed_combinations": dict(self.failed)})

    def table(self) -> AnyArray:
        """Return a structured array (n_rows,) with a row for each level of each combination, as ``--csv`` writes it.

        The fields are ``element``, ``formulation``, ``level``, ``h`` [length], ``n_dofs``, ``seconds`` [s] and, for each
        quantity, its value [unit of the quantity], ``..._error``, which is relative to the limit, ``..._order`` between the
        previous level and this one, and ``..._from_theory``, the relative difference from a theory, if there is one [-].
        """
        return self.structured_known(csv_columns(self.series))

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`; the tables contain levels and limits of each combination, and a comparison of all combinations."""
        captioned = []
        for series in self.series:
            captioned.append((str(series.combination), level_rows(series, self.units)))
            if series.limits:
                captioned.append((f"{series.combination}: limits", limit_rows(series, self.units)))
        rows = comparison_rows(self.series, self.best.shown(COMPARED), self.units)
        comparison = [(f"all combinations: limits and model errors {self.best.compared}", rows)]
        return captioned + (comparison if len(self.series) > 1 else [])

    def sentences(self) -> list[str]:
        """See `Report`."""
        return sentences(self.best)

    def remarks(self) -> list[str]:
        """See `Report`."""
        remarks = []
        for series in self.series:
            remarks += self.warnings_of((f"level {level.number}", level.warnings) for level in series.levels)
            remarks += [] if series.limits else [f"no limits: {_missing_limits(series)}"]
            remarks += [f"level {number} failed: {text}" for number, text in series.failed.items()]
        return remarks + [f"{name} failed: {text}" for name, text in self.failed.items()]

    def figure(self) -> Any:
        """Return a Matplotlib figure with the mesh errors, the contact pressure, and the differences from theory."""
        of_case = not self.best.combination.function
        names = COMPARED if of_case else self.best.shown(COMPARED) or self.best.quantities[:2]
        options: dict[str, Any] = {"all_series": self.series, "units": self.units}
        plots: list[Callable[[Any], None]] = [partial(draw_errors, quantity=name, **options) for name in names]
        if of_case or self.best.finest.profile:
            plots.append(partial(draw_pressure, series=self.best, theory=self.theory, units=self.units))
        if of_case:
            plots.append(partial(draw_differences, best=self.best, **options))
        rows, columns = (len(plots) + 1) // 2, min(2, len(plots))
        axes = panels((rows, columns), (6.0 * columns, 4.6 * rows), self.title)
        for ax, draw in itertools.zip_longest(axes.flat, plots, fillvalue=partial(show_message, text="")):
            draw(ax)
        return axes[0, 0].figure
