"""A study as plain data for JSON, and as a table for CSV."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.cases.summary import versions
from fastcontact.studies.fit import CONFIDENCE
from fastcontact.studies.labels import sentences
from fastcontact.studies.study import Level, Series, Study


def finite(value: Any) -> Any:
    """Return a number that JSON can hold: None for NaN and infinity."""
    return None if isinstance(value, float) and not math.isfinite(value) else value


def as_dict(study: Study) -> dict[str, Any]:
    """Return the study as ``--json`` writes it.

    The top level holds the best combination (`Study.best`), ``combinations`` all of them. Errors are relative to the
    theory, or without one to the limit; ``mesh_error`` is that of the finest mesh, and the two of them sum up to its
    difference from theory. ``uncertainty`` is in the unit of the quantity, at a confidence of 95 %.
    """
    best = study.best
    return {
        "case": study.name,
        "title": study.title,
        "units": dict(study.units),
        "confidence": CONFIDENCE,
        **series_dict(best),
        "combinations": [series_dict(series) for series in study.series],
        "failed_combinations": dict(study.failed),
        "versions": versions(),
    }


def series_dict(series: Series) -> dict[str, Any]:
    """Return one combination of element and formulation."""
    return {
        "element": series.combination.element,
        "formulation": series.combination.formulation,
        "levels": [_level(level) for level in series.levels],
        "failed": [{"level": number, "error": text} for number, text in series.failed.items()],
        "quantities": {name: quantity_dict(series, name) for name in series.quantities},
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


def _level(level: Level) -> dict[str, Any]:
    return {
        "level": level.number,
        "h": level.h,
        "n_dofs": level.n_dofs,
        **{name: finite(value) for name, value in level.values.items()},
        "seconds": level.seconds,
        "warnings": list(level.warnings),
    }


def quantity_dict(series: Series, name: str) -> dict[str, Any]:
    """Return limit, order, theory and errors of a quantity; None where there is no such number."""
    limit, found = series.limits.get(name), series.split(name)
    reference = series.reference.get(name)
    entry: dict[str, Any] = {
        "limit": limit.value if limit else None,
        "uncertainty": limit.uncertainty if limit else None,
        "order": finite(limit.order) if limit else None,
        "order_uncertainty": finite(limit.order_uncertainty) if limit else None,
        "converging": limit.converging if limit else None,
        "theory": series.theory.get(name),
        "model_error": found.model if found else None,
        "model_error_uncertainty": found.uncertainty if found else None,
        "mesh_error": found.mesh if found else finite(series.errors(name)[-1]),
    }
    if reference is not None:
        entry["reference"] = reference
        entry["reference_in_error_bar"] = limit.contains(reference) if limit else None
        entry["reference_deviation"] = limit.value / reference - 1.0 if limit else None
    return entry


def table(study: Study) -> NDArray[Any]:
    """Return a structured array, one row a level of a combination.

    Columns ``element``, ``formulation``, ``level``, ``h`` [length], ``n_dofs``, ``seconds``, and for every quantity its
    value, ``..._error`` (relative to its limit), ``..._order`` (from the level before) and, where a theory knows it,
    ``..._from_theory`` (relative to it).
    """
    names = list(dict.fromkeys(name for series in study.series for name in series.quantities))
    columns: dict[str, list[Any]] = {}

    def add(name: str, values: list[Any]) -> None:
        columns.setdefault(name, []).extend(values)

    for series in study.series:
        count = len(series.levels)
        add("element", [series.combination.element or ""] * count)
        add("formulation", [series.combination.formulation or ""] * count)
        for attribute in ("number", "h", "n_dofs", "seconds"):
            add(
                "level" if attribute == "number" else attribute,
                [getattr(level, attribute) for level in series.levels],
            )
        for name in names:
            values = series.values(name)
            add(name, values)
            add(f"{name}_error", series.errors(name))
            add(f"{name}_order", series.orders(name))
            theory = series.theory.get(name)
            add(f"{name}_from_theory", [value / theory - 1.0 if theory else math.nan for value in values])
    kept = {name: np.array(values) for name, values in columns.items() if not _empty(values)}
    result = np.empty(len(kept["h"]), dtype=[(name, column.dtype) for name, column in kept.items()])
    for name, column in kept.items():
        result[name] = column
    return result


def _empty(values: list[Any]) -> bool:
    return all(isinstance(value, float) and math.isnan(value) for value in values)
