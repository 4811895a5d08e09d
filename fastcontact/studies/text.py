"""A study as text for a terminal: tables of levels and limits, and the sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence

from fastcontact.studies.labels import percent, sentences
from fastcontact.studies.quantities import title, unit
from fastcontact.studies.study import Series, Study

# The columns of the tables of levels; the limits are given for all quantities.
SHOWN = ("force", "pressure_max", "contact_radius", "von_mises_max")


def lines(study: Study) -> list[str]:
    """Return the lines that ``fastcontact converge`` prints."""
    found = [study.title]
    for series in study.series:
        found += ["", f"{series.combination}", *_levels(series, study.units), "", *_limits(series, study.units)]
        found += [f"  level {number} failed: {text}" for number, text in series.failed.items()]
    found += [f"  {name} failed: {text}" for name, text in study.failed.items()]
    if len(study.series) > 1:
        found += ["", "all combinations: limits and model errors at equal approach", *comparison(study)]
    found += ["", *sentences(study.best)]
    return found


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines, columns right-aligned, the first row a header."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    return ["  " + "  ".join(text.rjust(width) for text, width in zip(row, widths, strict=True)) for row in rows]


def number(value: float, digits: int = 6) -> str:
    """Return a number, or a dash where there is none."""
    return f"{value:.{digits}g}" if math.isfinite(value) else "-"


def level_rows(series: Series, units: dict[str, str], shown: Sequence[str] = SHOWN) -> list[list[str]]:
    """Return header and rows of h, DOF, value, error against the limit and order from the level before."""
    names = [name for name in shown if name in series.quantities]
    header = ["level", f"h [{units['length']}]", "DOF"]
    for name in names:
        header += [f"{name} [{unit(name, units) or '1'}]", "error", "order"]
    rows = [header]
    columns = {name: (series.values(name), series.errors(name), series.orders(name)) for name in names}
    for i, level in enumerate(series.levels):
        row = [str(level.number), number(level.h, 4), str(level.n_dofs)]
        for values, errors, orders in columns.values():
            off = percent(errors[i]) if math.isfinite(errors[i]) else "-"
            row += [number(values[i], 8), off, f"{orders[i]:.2f}" if math.isfinite(orders[i]) else "-"]
        rows.append(row)
    return rows


def _levels(series: Series, units: dict[str, str]) -> list[str]:
    return aligned(level_rows(series, units))


def limit_rows(series: Series, units: dict[str, str]) -> list[list[str]]:
    """Return header and rows of limit, order, theory, model error and mesh error of every quantity."""
    rows = [["quantity", "limit", "+-", "order", "theory", "model error", "mesh error", "at equal force"]]
    for name in series.quantities:
        limit, found, same = series.limits.get(name), series.split(name), series.split_equal_force(name)
        if limit is None:
            continue
        mesh = found.mesh if found else series.errors(name)[-1]
        rows.append(
            [
                f"{title(name)} [{unit(name, units) or '1'}]",
                number(limit.value, 8),
                number(limit.uncertainty, 2),
                f"{limit.order:.2f} +- {limit.order_uncertainty:.2f}" if math.isfinite(limit.order) else "-",
                number(series.theory.get(name, math.nan), 8),
                percent(found.model) if found else "-",
                percent(mesh) if math.isfinite(mesh) else "-",
                percent(same.model) if same and name != "force" else "-",
            ]
        )
    return rows


def _limits(series: Series, units: dict[str, str]) -> list[str]:
    rows = limit_rows(series, units)
    if len(rows) == 1:
        return [f"  no limits: {len(series.levels)} levels were solved, and a limit takes three"]
    return aligned(rows)


def comparison_rows(study: Study) -> list[list[str]]:
    """Return header and one row for each combination: limits of force and largest pressure, and their model errors."""
    rows = [["combination", "levels", "finest DOF"]]
    names = [name for name in ("force", "pressure_max") if name in study.best.quantities]
    for name in names:
        rows[0] += [f"{name} [{unit(name, study.units)}]", "+-", "order", "mesh error", "model error"]
    rows[0] += ["p at equal force"] if "pressure_max" in names else []
    for series in study.series:
        row = [str(series.combination), str(len(series.levels)), str(series.finest.n_dofs)]
        for name in names:
            limit, found = series.limits.get(name), series.split(name)
            if limit is None:
                row += ["-"] * 5
                continue
            mesh = found.mesh if found else series.errors(name)[-1]
            row += [number(limit.value, 8), number(limit.uncertainty, 2), f"{limit.order:.2f}", percent(mesh)]
            row += [percent(found.model) if found else "-"]
        same = series.split_equal_force("pressure_max")
        row += [percent(same.model) if same else "-"] if "pressure_max" in names else []
        rows.append(row)
    return rows


def comparison(study: Study) -> list[str]:
    """Return `comparison_rows` as lines."""
    return aligned(comparison_rows(study))
