"""Tables of a mesh-convergence study: rows for terminal and page, columns for CSV, dictionaries for JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from fastcontact.studies.labels import column, title
from fastcontact.studies.render.table import Rows, finite, number, percent, with_error_bar
from fastcontact.studies.sentences import sentences
from fastcontact.studies.series import Series

# Quantities with columns in the tables of levels; the limits are given for all quantities.
IN_TABLES = ("force", "pressure_max", "contact_radius", "von_mises_max")


def level_rows(series: Series, units: Mapping[str, str], quantities: Sequence[str] = IN_TABLES) -> Rows:
    """Return header and rows of h, DOF, and of each quantity value, error against the limit, order from level to level."""
    names = [name for name in quantities if name in series.quantities]
    header = ["level", f"h [{units['length']}]", "DOF"]
    rows = [[str(level.number), number(level.h, 4), str(level.n_dofs)] for level in series.levels]
    for name in names:
        header += [column(name, name, units), "error", "order"]
        columns = zip(series.values(name), series.errors(name), series.orders(name), strict=True)
        for row, (value, error, order) in zip(rows, columns, strict=True):
            row += [number(value, 8), percent(error), _order(order)]
    return [header, *rows]


def limit_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return header and rows for a terminal: limit, order, theory and errors of every quantity with a limit."""
    rows = [["quantity", "limit", "+-", "order", "theory", "model error", "mesh error", "at equal force"]]
    for name, limit in series.limits.items():
        order, mesh, model, equal_force = _errors(series, name)
        theory = number(series.theory.get(name, math.nan), 8)
        bar = number(limit.uncertainty, 2)
        label = column(title(name), name, units)
        rows.append([label, number(limit.value, 8), bar, order, theory, model, mesh, equal_force])
    return rows


def page_limit_rows(series: Series, units: Mapping[str, str]) -> Rows:
    """Return the same for a page: every limit is rounded to its error bar."""
    rows = [["quantity", "theory", "limit", "order", "mesh error", "model error", "at equal force"]]
    for name in series.limits:
        theory = number(series.theory.get(name, math.nan), 8)
        rows.append([caption(name, units), theory, *_limit_cells(series, name)])
    return rows


def comparison_rows(all_series: Sequence[Series], quantities: Sequence[str], units: Mapping[str, str]) -> Rows:
    """Return header and a row for each combination: limits of the quantities, and their mesh and model errors."""
    header = ["combination", "levels", "finest DOF"]
    for name in quantities:
        header += [column(name, name, units), "+-", "order", "mesh error", "model error"]
    header += ["p at equal force"] if "pressure_max" in quantities else []
    rows = [header]
    for series in all_series:
        row = _start(series)
        for name in quantities:
            limit = series.limits.get(name)
            if limit is None:
                row += ["-"] * 5
                continue
            _, mesh, model, _ = _errors(series, name)
            row += [number(limit.value, 8), number(limit.uncertainty, 2), f"{limit.order:.2f}", mesh, model]
        row += [_errors(series, "pressure_max")[3]] if "pressure_max" in quantities else []
        rows.append(row)
    return rows


def page_comparison_rows(all_series: Sequence[Series], quantity: str) -> Rows:
    """Return the same for a page: one quantity, every limit rounded to its error bar."""
    header = ["combination", "levels", "finest DOF", "limit", "order", "mesh error", "model error", "at equal force"]
    return [header, *([*_start(series), *_limit_cells(series, quantity)] for series in all_series)]


def caption(quantity: str, units: Mapping[str, str]) -> str:
    """Return a quantity in words with its unit, without brackets for ratios."""
    return column(title(quantity), quantity, units).removesuffix(" [1]")


def _start(series: Series) -> list[str]:
    return [str(series.combination), str(len(series.levels)), str(series.finest.n_dofs)]


def _limit_cells(series: Series, quantity: str) -> list[str]:
    """Return limit, order, mesh error, and model error at equal approach and at equal force of a quantity."""
    limit = series.limits.get(quantity)
    if limit is None:
        return ["-"] * 5
    order, mesh, model, equal_force = _errors(series, quantity)
    return [with_error_bar(limit.value, limit.uncertainty), order, mesh, model, equal_force]


def _errors(series: Series, quantity: str) -> tuple[str, str, str, str]:
    """Return order, mesh error, and model error at equal approach and at equal force, as texts."""
    limit, found = series.limits.get(quantity), series.split(quantity)
    same = series.split_equal_force(quantity) if quantity != "force" else None
    known = limit is not None and math.isfinite(limit.order)
    order = f"{limit.order:.2f} +- {limit.order_uncertainty:.2f}" if limit is not None and known else "-"
    model, equal_force = (percent(entry.model if entry else None) for entry in (found, same))
    return order, percent(series.mesh_error(quantity)), model, equal_force


def _order(value: float) -> str:
    return f"{value:.2f}" if math.isfinite(value) else "-"


def csv_columns(all_series: Sequence[Series]) -> dict[str, list[Any]]:
    """Return the columns of all levels by name, each (n_rows,), without those that hold no number; see `Study.table`."""
    quantities = dict.fromkeys(name for series in all_series for name in series.quantities)
    columns: dict[str, list[Any]] = {}
    for series in all_series:
        count = len(series.levels)
        found: dict[str, list[Any]] = {
            "element": [series.combination.element or ""] * count,
            "formulation": [series.combination.formulation or ""] * count,
            "level": [level.number for level in series.levels],
            "h": series.h,
            "n_dofs": [level.n_dofs for level in series.levels],
            "seconds": [level.seconds for level in series.levels],
        }
        for name in quantities:
            found |= {
                name: series.values(name),
                f"{name}_error": series.errors(name),
                f"{name}_order": series.orders(name),
                f"{name}_from_theory": series.from_theory(name),
            }
        for name, values in found.items():
            columns.setdefault(name, []).extend(values)
    return {name: values for name, values in columns.items() if not all(value != value for value in values)}


def series_dict(series: Series) -> dict[str, Any]:
    """Return one combination of element and formulation for JSON."""
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
                "theory": found.theory,
                "model_error": found.model,
                "mesh_error": found.mesh,
                "uncertainty": found.uncertainty,
            }
            for name in series.quantities
            if name != "force" and (found := series.split_equal_force(name)) is not None
        },
        "sentences": sentences(series),
    }


def _quantity_dict(series: Series, name: str) -> dict[str, Any]:
    """Return limit, order, theory and errors of a quantity; None where there is no such number."""
    limit, found, reference = series.limits.get(name), series.split(name), series.reference.get(name)
    entry: dict[str, Any] = {
        "limit": limit.value if limit else None,
        "uncertainty": limit.uncertainty if limit else None,
        "order": finite(limit.order) if limit else None,
        "order_uncertainty": finite(limit.order_uncertainty) if limit else None,
        "converging": limit.converging if limit else None,
        "theory": series.theory.get(name),
        "model_error": found.model if found else None,
        "model_error_uncertainty": found.uncertainty if found else None,
        "mesh_error": finite(series.mesh_error(name)),
    }
    if reference is not None:
        entry["reference"] = reference
        entry["reference_in_error_bar"] = limit.contains(reference) if limit else None
        entry["reference_deviation"] = limit.value / reference - 1.0 if limit else None
    return entry
