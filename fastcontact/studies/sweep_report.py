"""A finished parameter sweep and its report: lines, table, dictionary, figure, page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fastcontact.studies.quantities import column, title
from fastcontact.studies.render import page
from fastcontact.studies.render.figure import Curve, Line, Panel, figure, marker
from fastcontact.studies.render.table import Rows, aligned, finite, number, percent, structured
from fastcontact.studies.report import Report

Value = float | int | str | bool
# Quantities in tables and figures.
MAIN = ("force", "pressure_max", "contact_radius")
# What values are compared with, and what the difference is called in JSON and CSV.
DIFFERENCES = {"theory": "from_theory", "equal_force": "from_theory_at_equal_force", "reference": "from_reference"}
# From this ratio of the largest to the smallest value on, an axis is logarithmic.
WIDE = 20.0


@dataclass(frozen=True, eq=False)
class Point:
    """Results for one choice of the parameters.

    Attributes
    ----------
    parameters : dict of str to value
    h : float
        Shortest facet of the secondary surface [length].
    n_dofs : int
    values : dict of str to float
        Quantities of interest, in the case's units.
    theory, reference, equal_force : dict of str to float
        By quantity: the theory at equal approach, the mesh-converged solution if the case names one, and the theory at
        equal force.
    profile : dict
        ``r`` [length] and ``pressure`` [pressure], lists (n_nodes,) over the secondary nodes.
    seconds : float
        Time of the run [s].
    warnings : tuple of str
    """

    parameters: dict[str, Value]
    h: float
    n_dofs: int
    values: dict[str, float]
    theory: dict[str, float]
    reference: dict[str, float]
    equal_force: dict[str, float]
    profile: dict[str, list[float]]
    seconds: float
    warnings: tuple[str, ...]

    def ratio(self, quantity: str, to: str = "theory") -> float:
        """Return value over ``"theory"``, ``"reference"`` or ``"equal_force"`` [-]; NaN where one is not known."""
        other = getattr(self, to).get(quantity)
        return self.values.get(quantity, math.nan) / other if other else math.nan


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Report):
    """A finished sweep; its case and units as in `Report`.

    Attributes
    ----------
    combination : str
        Element and formulation.
    parameters : dict of str to tuple
        Values by parameter.
    points : list of Point
        Those that could be solved; the last parameter changes fastest.
    failed : list of (dict, str)
        Parameters and reason of the others.
    """

    combination: str
    parameters: dict[str, tuple[Value, ...]]
    points: list[Point]
    failed: list[tuple[dict[str, Value], str]]

    @property
    def quantities(self) -> list[str]:
        """Names of all quantities that were measured."""
        return list(dict.fromkeys(name for point in self.points for name in point.values))

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, as ``--json`` writes them; differences are relative."""
        numbers = {
            "combination": self.combination,
            "parameters": {name: list(values) for name, values in self.parameters.items()},
            "points": [_point_dict(point) for point in self.points],
            "failed": [{"parameters": choice, "error": text} for choice, text in self.failed],
        }
        return self.framed(numbers)

    def table(self) -> NDArray[Any]:
        """Return a structured array (n_points,), one row a point, as ``--csv`` writes it.

        Fields: the parameters, ``h`` [length], ``n_dofs``, ``seconds`` [s], and for every quantity its value in its unit
        and where known ``..._from_theory``, ``..._from_theory_at_equal_force`` and ``..._from_reference`` [-].
        """
        columns: dict[str, list[Any]] = {name: [p.parameters[name] for p in self.points] for name in self.parameters}
        for attribute in ("h", "n_dofs", "seconds"):
            columns[attribute] = [getattr(point, attribute) for point in self.points]
        for name in self.quantities:
            columns[name] = [point.values.get(name, math.nan) for point in self.points]
            for other, key in DIFFERENCES.items():
                off = [point.ratio(name, other) - 1.0 for point in self.points]
                if any(map(math.isfinite, off)):
                    columns[f"{name}_{key}"] = off
        return structured(columns)

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`."""
        return [(self.combination, self._rows())]

    def lines(self) -> list[str]:
        """Return a table for a person, as ``fastcontact sweep`` prints it."""
        found = [self.title, "", self.combination, *aligned(self._rows())]
        found += [f"  warning: {text}" for text in sorted({text for point in self.points for text in point.warnings})]
        return found + [f"  {text}" for text in self._failures(" failed")]

    def figure(self) -> Any:
        """Return a matplotlib figure: values over the first parameter, and below their ratio to theory.

        Points that differ in other parameters are curves of their own.
        """
        names = self._main()
        rows = [[self._value_panel(name) for name in names]]
        if any(name in point.theory for point in self.points for name in names):
            rows.append([self._ratio_panel(name) for name in names])
        size = (4.6 * max(1, len(names)), 7.6 if len(rows) > 1 else 4.2)
        return figure(rows, size, f"{self.title}\n{self.combination}", fontsize=11)

    def html(self) -> str:
        """Return the sweep as one self-contained HTML page."""
        what = ", ".join(title(name) for name in MAIN if name in self.quantities) or "all quantities"
        choices = f"{len(self.points)} choices of {' and '.join(self.parameters)}"
        parts = [
            page.paragraph(f"{self.combination}: {what} for {choices}."),
            page.image(self.figure(), "quantities over the parameter, and their ratio to theory"),
            page.table(self._rows()),
            *map(page.failure, self._failures("")),
        ]
        return page.page(f"Sweep: {self.title}", parts, self.text)

    def _main(self) -> list[str]:
        return [name for name in MAIN if name in self.quantities] or self.quantities[:3]

    def _failures(self, verb: str) -> list[str]:
        choices = [(", ".join(f"{k} = {_shown(v)}" for k, v in choice.items()), text) for choice, text in self.failed]
        return [f"{choice}{verb}: {text}" for choice, text in choices]

    def _rows(self) -> Rows:
        """Return header and a row for each point: parameters, DOF, main quantities, differences from theory."""
        header = [*self.parameters, "DOF"]
        rows = [[_shown(p.parameters[name]) for name in self.parameters] + [str(p.n_dofs)] for p in self.points]
        for name in self._main():
            known = any(name in point.theory for point in self.points)
            compared = {"theory": "from theory"} if known else {}
            compared |= {"equal_force": "at equal force"} if known and name != "force" else {}
            header += [column(name, name, self.units), *compared.values()]
            for row, point in zip(rows, self.points, strict=True):
                row.append(number(point.values.get(name, math.nan), 7))
                row += [percent(point.ratio(name, other) - 1.0) for other in compared]
        return [header, *rows]

    def _curves(self) -> list[tuple[str, Sequence[Value], list[Point]]]:
        """Return label, values of the first parameter and points, for each choice of the other parameters."""
        first, *others = self.parameters
        found: dict[str, list[Point]] = {}
        for point in self.points:
            label = ", ".join(f"{name} = {point.parameters[name]}" for name in others)
            found.setdefault(label, []).append(point)
        curves: list[tuple[str, Sequence[Value], list[Point]]] = []
        for label, points in found.items():
            x = [point.parameters[first] for point in points]
            curves.append((label, x if _are_numbers(x) else list(map(str, x)), points))
        return curves

    def _value_panel(self, quantity: str) -> Panel:
        curves = []
        for k, (label, x, points) in enumerate(self._curves()):
            y = [point.values.get(quantity, math.nan) for point in points]
            curves.append(Curve(x, y, f"{marker(k)}-", label or "computed"))
            exact = [point.theory.get(quantity, math.nan) for point in points]
            if np.isfinite(exact).any():
                curves.append(Curve(x, exact, "k--", "theory at equal approach" if k == 0 else None))
        scale = _scale([point.values.get(quantity, math.nan) for point in self.points])
        return self._panel(title(quantity), column(quantity, quantity, self.units), curves, y_scale=scale)

    def _ratio_panel(self, quantity: str) -> Panel:
        styles = {"theory": ("-", "theory at equal approach"), "equal_force": ("--", "theory at equal force")}
        curves = []
        for k, (label, x, points) in enumerate(self._curves()):
            for other, (style, name) in styles.items():
                ratios = [point.ratio(quantity, other) for point in points]
                if np.isfinite(ratios).any() and (other, quantity) != ("equal_force", "force"):
                    name = f"to {name}" + (f", {label}" if label else "")
                    curves.append(Curve(x, ratios, f"{marker(k)}{style}", name))
        heading = f"{title(quantity)}: ratio to theory"
        return self._panel(heading, "computed / theory", curves, lines=[Line(1.0, width=0.8)])

    def _panel(self, heading: str, y_label: str, curves: list[Curve], **more: Any) -> Panel:
        first = next(iter(self.parameters))
        scale = _scale(self.parameters[first])
        return Panel(heading, first, y_label, curves, x_scale=scale, title_size=10, **more)


def _point_dict(point: Point) -> dict[str, Any]:
    entry: dict[str, Any] = {"parameters": dict(point.parameters), "h": point.h, "n_dofs": point.n_dofs, **point.values}
    for other, key in DIFFERENCES.items():
        off = {name: point.ratio(name, other) - 1.0 for name in getattr(point, other)}
        entry[key] = {name: value for name, value in off.items() if finite(value) is not None}
    return {**entry, "seconds": point.seconds, "warnings": list(point.warnings)}


def _shown(value: Value) -> str:
    return number(value) if isinstance(value, float) else str(value)


def _are_numbers(values: Sequence[Value]) -> bool:
    return all(isinstance(value, (int, float)) for value in values)


def _scale(values: Sequence[Any]) -> str:
    """Return the scale of an axis: ``"log"`` for positive numbers that differ by more than a factor of `WIDE`."""
    known = [value for value in values if math.isfinite(value)] if _are_numbers(values) else []
    return "log" if known and min(known) > 0 and max(known) > WIDE * min(known) else "linear"
