"""Tables of a mesh-convergence study as rows of text, columns for CSV and dictionaries for JSON, and its conclusions."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from fastcontact.cases.summary import finite
from fastcontact.results.units import labelled
from fastcontact.studies.fit import CONFIDENCE, Limit
from fastcontact.studies.quantities import column, title
from fastcontact.studies.report import Rows, by_columns, number, percent
from fastcontact.studies.series import Series, Split

# Quantities of the sentences, in their order.
MAIN = ("pressure_max", "force")


def sentences(series: Series) -> list[str]:
    """Return sentences about the difference between a combination of element and formulation and theory."""
    if not series.limits:
        return [
            f"{series.combination}: {len(series.levels)} levels were solved, and an extrapolated limit needs three."
        ]
    names = [name for name in series.shown(MAIN) if name in series.limits]
    about = [text for name in names for text in _about_quantity(series, name)]
    return about + _about_equal_force(series)


def _about_quantity(series: Series, quantity: str) -> list[str]:
    split, name = series.split(quantity), title(quantity)
    if split is None:
        off = percent(series.errors(quantity)[-1])
        text = f"{series.combination}: the mesh error of the {name} is {off} on the finest mesh."
        return [text, *_about_settling(series, quantity, name)]
    start = f"{series.combination}: " + ("" if series.exact_theory else f"{series.compared} ") + f"the {name}"
    finest = f"({series.finest.n_dofs} degrees of freedom)"
    bar = f"{100 * split.uncertainty:.2g} %"
    if series.converges_to_theory(quantity) is False:
        texts = [_not_to_theory(series, quantity, start, split)]
    elif split.resolved and not series.exact_theory:
        texts = [
            f"{start} differs from theory by {percent(split.total)}. Of that, "
            f"{percent(split.model, split.uncertainty)} (+- {bar}) is model error, which no mesh removes, and "
            f"{percent(split.mesh)} is mesh error on the finest mesh {finest}, which goes to zero."
        ]
    else:
        texts = [
            f"{start} agrees with theory within the error bar of its limit, {percent(split.model)} +- {bar}; "
            f"{percent(split.mesh)} is mesh error on the finest mesh {finest}."
        ]
    texts += _about_settling(series, quantity, name)
    return texts + _about_cancelling(series, quantity, split) + _about_reference(series, quantity)


def _about_settling(series: Series, quantity: str, name: str) -> list[str]:
    if series.limits[quantity].converging:
        return []
    return [
        f"The {name} does not converge: its changes do not decrease on the finest mesh, and its error bar is meaningless. It "
        "may have no limit, or finer meshes are needed."
    ]


def _not_to_theory(series: Series, quantity: str, start: str, split: Split) -> str:
    """Return the sentence for a formulation that does not converge to a theory that is exact for the model."""
    limit = series.limits[quantity]
    tends = f"tends to {number(limit.value, 6)} +- {number(limit.uncertainty, 2)}"
    return (
        f"{start} {tends} where the theory has {number(split.theory, 6)}. That theory is exact for the bodies of the model, "
        f"so this is not a model error: {series.combination} does not converge to it on these meshes. Compare formulations "
        "(--formulations all), or let the meshes of the two sides match."
    )


def _about_cancelling(series: Series, quantity: str, split: Split) -> list[str]:
    """Return a warning if the mesh error of a level cancels more than half of the model error."""
    off = series.from_theory(quantity)
    best = min(range(len(off)), key=lambda k: abs(off[k]))
    if series.exact_theory or not split.resolved or not abs(off[best]) < 0.5 * abs(split.model):
        return []
    level = series.levels[best]
    return [
        f"Level {level.number} ({level.n_dofs} degrees of freedom) lies only {percent(off[best])} from theory because its "
        f"mesh error of {percent(off[best] - split.model)} cancels model error: the agreement does not prove a good mesh."
    ]


def _about_reference(series: Series, quantity: str) -> list[str]:
    reference, limit = series.reference.get(quantity), series.limits[quantity]
    if reference is None:
        return []
    where = "inside" if limit.contains(reference) else "OUTSIDE"
    return [
        f"The case's mesh-converged solution lies {where} the error bar of the limit ({CONFIDENCE:.0%}), "
        f"{percent(limit.value / reference - 1.0)} from the limit."
    ]


def _about_equal_force(series: Series) -> list[str]:
    same, equal = series.split_equal_force("pressure_max"), series.split("pressure_max")
    if same is None or equal is None:
        return []
    text = (
        f"{series.combination}: at equal force the model error of the largest pressure is {percent(same.model)} (+- "
        f"{100 * same.uncertainty:.2g} %)"
    )
    radius = series.split_equal_force("contact_radius")
    if radius is not None:
        text += f", that of the contact radius {percent(radius.model)} (+- {100 * radius.uncertainty:.2g} %)"
    if abs(same.model) < 0.3 * abs(equal.model) and equal.resolved:
        text += ": most of the difference at equal approach is in the force, not in its distribution"
    return [text + "."]


# Quantities in the tables of levels. The tables of limits contain all quantities.
IN_TABLES = ("force", "pressure_max", "contact_radius", "von_mises_max")
# Columns of limits.
OF_LIMITS = ("limit", "+-", "order", "theory", "model error", "mesh error", "at equal force")
# Mark after the error bar of a limit to which the values do not converge.
UNSETTLED = " (unsettled)"


def level_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return a header and a row for each level with h, DOF and, for each quantity, its value, error and order."""
    columns = [
        ("level", [str(level.number) for level in series.levels]),
        (labelled("h", units, "length"), [number(h, 4) for h in series.h]),
        ("DOF", [str(level.n_dofs) for level in series.levels]),
    ]
    for name in series.shown(IN_TABLES):
        orders = [f"{order:.2f}" if math.isfinite(order) else "-" for order in series.orders(name)]
        columns.append((column(name, name, units), [number(value, 8) for value in series.values(name)]))
        columns += [("error", list(map(percent, series.errors(name)))), ("order", orders)]
    return by_columns(columns)


def limit_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return a header and a row for each quantity with a limit: limit, order, theory and errors."""
    cells = [[column(title(name), name, units), *_cells(series, name, OF_LIMITS)] for name in series.limits]
    shown = [any(row[index] != "-" for row in cells) for index in range(len(OF_LIMITS) + 1)]
    return [list(itertools.compress(row, shown)) for row in (["quantity", *OF_LIMITS], *cells)]


def comparison_rows(all_series: Sequence[Series], quantities: Sequence[str], units: Mapping[str, str]) -> Rows:
    """Return a header and a row for each combination with the limits, mesh errors and model errors of the quantities."""
    header, shown = ["combination", "levels", "finest DOF"], []
    for name in quantities:
        header += [column(name, name, units), "+-", "order", "mesh error", "model error"]
        shown += [(name, cell) for cell in ("limit", "+-", "order alone", "mesh error", "model error")]
    if "pressure_max" in quantities:
        header.append("p at equal force")
        shown.append(("pressure_max", "at equal force"))
    rows = [[str(series.combination), str(len(series.levels)), str(series.finest.n_dofs)] for series in all_series]
    for row, series in zip(rows, all_series, strict=True):
        row += [cell for name, kind in shown for cell in _cells(series, name, (kind,))]
    return [header, *rows]


def _cells(series: Series, quantity: str, columns: Sequence[str]) -> list[str]:
    """Return the entries of some columns of limits for a quantity; dashes if it has no limit."""
    limit, split = series.limits.get(quantity), series.split(quantity)
    if limit is None:
        return ["-"] * len(columns)
    same = series.split_equal_force(quantity) if quantity != "force" else None
    order = f"{limit.order:.2f}"
    texts = {
        "limit": number(limit.value, 8),
        "+-": number(limit.uncertainty, 2) + ("" if limit.converging else UNSETTLED),
        "order": f"{order} +- {limit.order_uncertainty:.2f}" if math.isfinite(limit.order) else "-",
        "order alone": order,
        "theory": number(series.theory.get(quantity, math.nan), 8),
        "model error": percent(split.model if split else None),
        "mesh error": percent(series.mesh_error(quantity)),
        "at equal force": percent(same.model if same else None),
    }
    return [texts[name] for name in columns]


def csv_columns(all_series: Sequence[Series]) -> dict[str, list[Any]]:
    """Return the columns (n_rows,) of `Study.table` by name."""
    quantities = dict.fromkeys(name for series in all_series for name in series.quantities)
    columns: dict[str, list[Any]] = {}
    for series in all_series:
        count = len(series.levels)
        of_series: dict[str, list[Any]] = {
            "element": [series.combination.element or ""] * count,
            "formulation": [series.combination.formulation or ""] * count,
            "level": [level.number for level in series.levels],
            "h": series.h,
            "n_dofs": [level.n_dofs for level in series.levels],
            "seconds": [level.seconds for level in series.levels],
        }
        for name in quantities:
            of_series |= {
                name: series.values(name),
                f"{name}_error": series.errors(name),
                f"{name}_order": series.orders(name),
                f"{name}_from_theory": series.from_theory(name),
            }
        for name, values in of_series.items():
            columns.setdefault(name, []).extend(values)
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
    """Return fields of `values` by key; a field is None if it is NaN, and all fields are None if `values` is None."""
    fields = {key: getattr(values, name, None) for key, name in names.items()}
    return {key: finite(value) if isinstance(value, float) else value for key, value in fields.items()}


def _quantity_dict(series: Series, name: str) -> dict[str, Any]:
    """Return limit, order, theory and errors of a quantity, with None for missing numbers."""
    limit, split, reference = series.limits.get(name), series.split(name), series.reference.get(name)
    entry: dict[str, Any] = {
        **_fields(
            limit, limit="value", **{key: key for key in ("uncertainty", "order", "order_uncertainty", "converging")}
        ),
        "converges_to_theory": series.converges_to_theory(name),
        "theory": series.theory.get(name),
        **_fields(split, model_error="model", model_error_uncertainty="uncertainty"),
        "mesh_error": finite(series.mesh_error(name)),
    }
    if reference is not None:
        entry["reference"] = reference
        entry["reference_in_error_bar"] = limit.contains(reference) if limit else None
        entry["reference_deviation"] = limit.value / reference - 1.0 if limit else None
    return entry
