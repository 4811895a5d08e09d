"""A sweep as plain data for JSON, as a table for CSV, as text for a terminal, and as one HTML page."""

from __future__ import annotations

import html
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.cases.summary import versions
from fastcontact.studies.labels import percent
from fastcontact.studies.output import finite
from fastcontact.studies.quantities import title, unit
from fastcontact.studies.report import image, page, table_html
from fastcontact.studies.sweep import Point, Sweep
from fastcontact.studies.text import aligned, number

SHOWN = ("force", "pressure_max", "contact_radius")
AGAINST = {"theory": "from_theory", "equal_force": "from_theory_at_equal_force", "reference": "from_reference"}


def as_dict(sweep: Sweep) -> dict[str, Any]:
    """Return the sweep as ``--json`` writes it; differences are relative."""
    return {
        "case": sweep.name,
        "title": sweep.title,
        "units": dict(sweep.units),
        "combination": sweep.combination,
        "parameters": {name: list(values) for name, values in sweep.parameters.items()},
        "points": [_point(point) for point in sweep.points],
        "failed": [{"parameters": choice, "error": text} for choice, text in sweep.failed],
        "versions": versions(),
    }


def _point(point: Point) -> dict[str, Any]:
    entry: dict[str, Any] = {"parameters": dict(point.parameters), "h": point.h, "n_dofs": point.n_dofs, **point.values}
    for against, key in AGAINST.items():
        known = {name: point.ratio(name, against) - 1.0 for name in getattr(point, against)}
        entry[key] = {name: value for name, value in known.items() if finite(value) is not None}
    return {**entry, "seconds": point.seconds, "warnings": list(point.warnings)}


def table(sweep: Sweep) -> NDArray[Any]:
    """Return a structured array, one row a point.

    Columns: the parameters, ``h`` [length], ``n_dofs``, ``seconds``, and for every quantity its value and where known
    ``..._from_theory``, ``..._from_theory_at_equal_force`` and ``..._from_reference`` (relative).
    """
    columns: dict[str, list[Any]] = {name: [p.parameters[name] for p in sweep.points] for name in sweep.parameters}
    for attribute in ("h", "n_dofs", "seconds"):
        columns[attribute] = [getattr(point, attribute) for point in sweep.points]
    for name in sweep.quantities:
        columns[name] = [point.values.get(name, math.nan) for point in sweep.points]
        for against, key in AGAINST.items():
            ratios = [point.ratio(name, against) - 1.0 for point in sweep.points]
            if any(math.isfinite(ratio) for ratio in ratios):
                columns[f"{name}_{key}"] = ratios
    arrays = {name: np.array(values) for name, values in columns.items()}
    result = np.empty(len(sweep.points), dtype=[(name, column.dtype) for name, column in arrays.items()])
    for name, column in arrays.items():
        result[name] = column
    return result


def rows(sweep: Sweep) -> list[list[str]]:
    """Return header and one row a point: parameters, DOF, main quantities, differences from theory."""
    names = [name for name in SHOWN if name in sweep.quantities] or sweep.quantities[:3]
    known = [name for name in names if any(name in point.theory for point in sweep.points)]
    header = [*sweep.parameters, "DOF"]
    for name in names:
        header.append(f"{name} [{unit(name, sweep.units) or '1'}]")
        header += ["from theory"] if name in known else []
        header += ["at equal force"] if name in known and name != "force" else []
    found = [header]
    for point in sweep.points:
        row = [_shown(point.parameters[name]) for name in sweep.parameters] + [str(point.n_dofs)]
        for name in names:
            row.append(number(point.values.get(name, math.nan), 7))
            row += [_off(point, name, "theory")] if name in known else []
            row += [_off(point, name, "equal_force")] if name in known and name != "force" else []
        found.append(row)
    return found


def _shown(value: Any) -> str:
    return number(value) if isinstance(value, float) else str(value)


def _off(point: Point, name: str, against: str) -> str:
    ratio = point.ratio(name, against)
    return percent(ratio - 1.0) if math.isfinite(ratio) else "-"


def lines(sweep: Sweep) -> list[str]:
    """Return the lines that ``fastcontact sweep`` prints."""
    found = [sweep.title, "", sweep.combination, *aligned(rows(sweep))]
    warned = sorted({text for point in sweep.points for text in point.warnings})
    found += [f"  warning: {text}" for text in warned]
    return found + [f"  {_named(choice)} failed: {text}" for choice, text in sweep.failed]


def _named(choice: dict[str, Any]) -> str:
    return ", ".join(f"{name} = {_shown(value)}" for name, value in choice.items())


def html_report(sweep: Sweep) -> str:
    """Return the page."""
    what = ", ".join(title(name) for name in SHOWN if name in sweep.quantities)
    parts = [
        f"<p class='say'>{html.escape(sweep.combination)}: {html.escape(what or 'all quantities')} for "
        f"{len(sweep.points)} choices of {html.escape(' and '.join(sweep.parameters))}.</p>",
        image(sweep.figure(), "quantities over the parameter, and their ratio to theory"),
        table_html(rows(sweep)),
    ]
    parts += [
        f"<p class='failed'>{html.escape(_named(choice))}: {html.escape(text)}</p>" for choice, text in sweep.failed
    ]
    if sweep.text:
        parts += ["<h2>The case</h2>", f"<pre>{html.escape(sweep.text)}</pre>"]
    made = ", ".join(f"{name} {version}" for name, version in versions().items())
    parts.append(f"<footer>Made with {html.escape(made)}.</footer>")
    return page(f"Sweep: {sweep.title}", parts)
