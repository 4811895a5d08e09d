"""The result of a parameter sweep and its report as lines, table, dictionary, figure and page."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from fastcontact.arrays import AnyArray
from fastcontact.studies.quantities import column
from fastcontact.studies.render.figure import panels
from fastcontact.studies.render.table import Rows, by_columns, number, percent
from fastcontact.studies.report import Report
from fastcontact.studies.sweep_figures import Drawing
from fastcontact.studies.sweep_point import Point, TheoryCurve, Value

# Quantities shown in tables and figures.
MAIN = ("force", "pressure_max", "contact_radius")
# Attributes of points with values for comparison, and the names of the relative differences in JSON and CSV.
DIFFERENCES = {"theory": "from_theory", "equal_force": "from_theory_at_equal_force", "reference": "from_reference"}


@dataclass(frozen=True, eq=False, repr=False)
class Sweep(Report):
    """The result of a parameter sweep, with the attributes of `Report` and the following.

    Attributes
    ----------
    combination : str
        Element and contact formulation.
    parameters : dict of str to tuple
        Values by parameter.
    points : list of Point
        Points that were solved; the last parameter varies fastest.
    failed : list of (dict, str)
        Parameters of each point that could not be solved, and the reason.
    theories : tuple of TheoryCurve
        Theory over the first parameter for each choice of the other parameters; empty if the first parameter is not a
        number.
    compared : str
        Condition of the comparison with theory: ``"at equal approach"``, or empty if the case prescribes another load.
    asked : tuple of str
        Additional quantities of ``[study]`` in tables and figures.
    """

    kind = "Sweep"
    picture = "quantities over the parameter, and their ratio to theory"

    combination: str
    parameters: dict[str, tuple[Value, ...]]
    points: list[Point]
    failed: list[tuple[dict[str, Value], str]]
    theories: tuple[TheoryCurve, ...] = ()
    compared: str = "at equal approach"
    asked: tuple[str, ...] = ()

    @property
    def quantities(self) -> list[str]:
        """Names of all evaluated quantities."""
        return list(dict.fromkeys(name for point in self.points for name in point.values))

    def as_dict(self) -> dict[str, Any]:
        """Return the sweep as numbers, strings, lists and dictionaries, as ``--json`` writes it; differences are relative."""
        numbers = {
            "combination": self.combination,
            "parameters": {name: list(values) for name, values in self.parameters.items()},
            "points": [_point_dict(point) for point in self.points],
            "failed": [{"parameters": choice, "error": text} for choice, text in self.failed],
        }
        return self.framed(numbers)

    def table(self) -> AnyArray:
        """Return a structured array (n_points,) with a row for each point, as ``--csv`` writes it.

        The fields are the parameters, ``h`` [length] if known, ``n_dofs``, ``seconds`` [s] and, for each quantity, its value
        [unit of the quantity] and, if known, the relative differences ``..._from_theory``, ``..._from_theory_at_equal_force``
        and ``..._from_reference`` [-].
        """
        columns: dict[str, list[Any]] = {name: [p.parameters[name] for p in self.points] for name in self.parameters}
        for attribute in ("h", "n_dofs", "seconds"):
            columns[attribute] = [getattr(point, attribute) for point in self.points]
        for name in self.quantities:
            columns[name] = [point.values.get(name, math.nan) for point in self.points]
            for other, key in DIFFERENCES.items():
                columns[f"{name}_{key}"] = [point.ratio(name, other) - 1.0 for point in self.points]
        return self.structured_known(columns)

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`."""
        return [(self.combination if self.combination != self.title else "", self._rows())]

    def remarks(self) -> list[str]:
        """See `Report`."""
        warnings = sorted({text for point in self.points for text in point.warnings})
        choices = [(", ".join(f"{k} = {_shown(v)}" for k, v in choice.items()), text) for choice, text in self.failed]
        return [
            *(f"warning: {text}" for text in warnings), *(f"{choice} failed: {text}" for choice, text in choices),
            *self._same_theory(),
        ]  # fmt: skip

    def _same_theory(self) -> list[str]:
        """Return a remark if no parameter changes the theory, although values change."""
        kept = [
            name for name in self._main()
            if len({point.theory.get(name) for point in self.points} - {None}) == 1
            and len({point.values.get(name) for point in self.points}) > 1
        ]  # fmt: skip
        if not kept or len(self.points) < 2:
            return []
        return ["the theory is the same for all points: a parameter in [study.parameters] can change its keys, too"]

    def figure(self) -> Any:
        """Return a Matplotlib figure with the values over the first parameter and their ratios to theory.

        There is a curve for each choice of the other parameters.
        """
        names, drawing = self._main(), Drawing(self.parameters, self.points, self.theories, self.units, self.compared)
        known = any(name in point.theory for point in self.points for name in names)
        legend_width = 1.7 * (1 + known) * (len(self.parameters) > 1)  # legends
        size = ((8.8 if known else 5.2) + legend_width, 0.5 + 3.1 * len(names))
        heading = "\n".join(dict.fromkeys((self.title, self.combination)))  # title and name are equal for a function
        axes = panels(len(names), 1 + known, size, heading, fontsize=11)
        for row, name in zip(axes, names, strict=True):
            drawing.draw_values(row[0], name)
            if known:
                drawing.draw_ratios(row[1], name)
        return axes[0, 0].figure

    def _main(self) -> list[str]:
        shown = dict.fromkeys((*MAIN, *self.asked))
        return [name for name in shown if name in self.quantities] or self.quantities[:3]

    def _rows(self) -> Rows:
        """Return a header and a row for each point with parameters, DOF, main quantities and differences from theory."""
        columns = [(name, [_shown(point.parameters[name]) for point in self.points]) for name in self.parameters]
        columns.append(("DOF", [str(point.n_dofs) for point in self.points]))
        for name in self._main():
            known = any(name in point.theory for point in self.points)
            compared = {"theory": "from theory"} if known else {}
            compared |= {"equal_force": "at equal force"} if known and name != "force" else {}
            values = [number(point.values.get(name, math.nan), 7) for point in self.points]
            columns.append((column(name, name, self.units), values))
            for other, label in compared.items():
                columns.append((label, [percent(point.ratio(name, other) - 1.0) for point in self.points]))
        return by_columns(columns)


def _point_dict(point: Point) -> dict[str, Any]:
    entry: dict[str, Any] = {"parameters": dict(point.parameters), **point.as_dict()}
    for other, key in DIFFERENCES.items():
        off = {name: point.ratio(name, other) - 1.0 for name in getattr(point, other)}
        entry[key] = {name: value for name, value in off.items() if math.isfinite(value)}
    return entry


def _shown(value: Value) -> str:
    return number(value) if isinstance(value, float) else str(value)
