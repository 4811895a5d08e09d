"""Tables of a mesh-convergence study: rows of text, columns for CSV, dictionaries for JSON."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping, Sequence
from typing import Any

from fastcontact.cases.summary import finite
from fastcontact.results.units import labelled
from fastcontact.studies.quantities import column, title
from fastcontact.studies.render.table import Rows, number, percent
from fastcontact.studies.sentences import sentences
from fastcontact.studies.series import Series

# Quantities with columns in the tables of levels; the limits are given for all quantities.
IN_TABLES = ("force", "pressure_max", "contact_radius", "von_mises_max")
# Columns of limits, and the first columns of the table of all combinations.
OF_LIMITS = ("limit", "+-", "order", "theory", "model error", "mesh error", "at equal force")
# Mark after the error bar of a limit whose values do not settle.
UNSETTLED = " (unsettled)"
COMBINATION = ("combination", "levels", "finest DOF")


def level_rows(series: Series, units: Mapping[str, str], quantities: Sequence[str] | None = None) -> Rows:
    """Return header and rows: h, DOF, and for each quantity its value, error against the limit and order between levels."""
    names = series.shown(IN_TABLES) if quantities is None else quantities
    header = ["level", labelled("h", units, "length"), "DOF"]
    rows = [[str(level.number), number(level.h, 4), str(level.n_dofs)] for level in series.levels]
    for name in names:
        header += [column(name, name, units), "error", "order"]
        columns = zip(series.values(name), series.errors(name), series.orders(name), strict=True)
        for row, (value, error, order) in zip(rows, columns, strict=True):
            row += [number(value, 8), percent(error), f"{order:.2f}" if math.isfinite(order) else "-"]
    return [header, *rows]


def limit_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return header and rows: limit, order, theory and errors of every quantity with a limit."""
    cells = [[column(title(name), name, units), *_cells(series, name, OF_LIMITS)] for name in series.limits]
    shown = [any(row[index] != "-" for row in cells) for index in range(len(OF_LIMITS) + 1)]
    return [list(itertools.compress(row, shown)) for row in (["quantity", *OF_LIMITS], *cells)]


def comparison_rows(all_series: Sequence[Series], quantities: Sequence[str], units: Mapping[str, str]) -> Rows:
    """Return header and a row for each combination: limits of the quantities, and their mesh and model errors."""
    header, rows = [*COMBINATION], [_start(series) for series in all_series]
    for name in quantities:
        header += [column(name, name, units), "+-", "order", "mesh error", "model error"]
        for row, series in zip(rows, all_series, strict=True):
            row += _cells(series, name, ("limit", "+-", "order alone", "mesh error", "model error"))
    if "pressure_max" in quantities:
        header.append("p at equal force")
        for row, series in zip(rows, all_series, strict=True):
            row += _cells(series, "pressure_max", ("at equal force",))
    return [header, *rows]


def _start(series: Series) -> list[str]:
    return [str(series.combination), str(len(series.levels)), str(series.finest.n_dofs)]


def _cells(series: Series, quantity: str, columns: Sequence[str]) -> list[str]:
    """Return columns on the limit of a quantity as text; dashes if there is no limit."""
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
    """Return the columns (n_rows,) of all levels by name, without those that contain no number; see `Study.table`."""
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
    return {name: values for name, values in columns.items() if not all(value != value for value in values)}


def series_dict(series: Series) -> dict[str, Any]:
    """Return the data of one combination of element and formulation for JSON."""
    return {
        "element": series.combination.element,
        "formulation": series.combination.formulation,
        "levels": [
            {
                "level": level.number,
                "h": level.h,
                "n_dofs": level.n_dofs,
                **{name: finite(value) for name, value in level.values.items()},
                "seconds": level.seconds,
                "warnings": list(level.warnings),
            }
            for level in series.levels
        ],
        "failed": [{"level": number, "error": text} for number, text in series.failed.items()],
        "quantities": {name: _quantity_dict(series, name) for name in series.quantities},
        "equal_force": {
            name: {
                "theory": split.theory,
                "model_error": split.model,
                "mesh_error": split.mesh,
                "uncertainty": split.uncertainty,
            }
            for name in series.quantities
            if name != "force" and (split := series.split_equal_force(name)) is not None
        },
        "sentences": sentences(series),
    }


def _quantity_dict(series: Series, name: str) -> dict[str, Any]:
    """Return limit, order, theory and errors of a quantity; None for missing numbers."""
    limit, split, reference = series.limits.get(name), series.split(name), series.reference.get(name)
    entry: dict[str, Any] = {
        "limit": limit.value if limit else None,
        "uncertainty": limit.uncertainty if limit else None,
        "order": finite(limit.order) if limit else None,
        "order_uncertainty": finite(limit.order_uncertainty) if limit else None,
        "converging": limit.converging if limit else None,
        "converges_to_theory": series.converges_to_theory(name),
        "theory": series.theory.get(name),
        "model_error": split.model if split else None,
        "model_error_uncertainty": split.uncertainty if split else None,
        "mesh_error": finite(series.mesh_error(name)),
    }
    if reference is not None:
        entry["reference"] = reference
        entry["reference_in_error_bar"] = limit.contains(reference) if limit else None
        entry["reference_deviation"] = limit.value / reference - 1.0 if limit else None
    return entry
