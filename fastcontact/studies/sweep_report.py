"""Result of a parameter sweep, and its report in the form of tables, a dictionary and a figure."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from fastcontact._tools.grouping import grouped
from fastcontact.analysis.criteria import NOTABLE
from fastcontact.arrays import AnyArray
from fastcontact.studies.quantities import BOLT_FORCE, LABELS, column, title
from fastcontact.studies.report import Report, Rows, format_axes, marker, number, panels, percent, show_message, to_rows
from fastcontact.studies.series import Point, TheoryCurve, Value

if TYPE_CHECKING:
    import pandas

# Smallest ratio of the largest to the smallest value of a parameter for which its axis is logarithmic.
MIN_LOGARITHMIC_RATIO = 9.0
# Title and kind of unit (empty for ratios) of parameters, by the last word of their paths.
MEANINGS = {
    "E": ("Young's modulus", "pressure"),
    "nu": ("Poisson's ratio", ""),
    "friction": ("friction coefficient", ""),
    "approach": ("approach", "length"),
    "clearance": ("clearance", "length"),
    "interference": ("interference", "length"),
    "R": ("radius", "length"),
    "radius": ("radius", "length"),
    "size": ("element size", "length"),
    "contact_size": ("element size at the contact", "length"),
}
_TABLE = re.compile(r"(?P<table>\w+)(?:\[(?P<number>\d+)\]|\.(?P<name>[\w-]+))\.")


def parameter_label(parameter: str, units: Mapping[str, str]) -> str:
    """Return the label of a parameter with its unit; unknown paths are returned unchanged.

    Examples
    --------
    >>> parameter_label("material[0].E", {"pressure": "MPa"})
    "Young's modulus of material 1 [MPa]"
    >>> parameter_label("contact.hertz.friction", {})
    "friction coefficient of contact 'hertz' [-]"
    """
    key = parameter.rsplit(".", 1)[-1]
    if key not in MEANINGS:
        return parameter
    label, kind = MEANINGS[key]
    match = _TABLE.match(parameter)
    if match is not None:
        label += f" of {match['table']} " + (f"'{match['name']}'" if match["name"] else str(int(match["number"]) + 1))
    elif "." in parameter:
        label += f" of the {parameter.split('.', 1)[0]}"
    unit = units.get(kind, "") if kind else "-"
    return f"{label} [{unit}]" if unit else label


def abscissa_of(parameters: Mapping[str, Sequence[Value]]) -> tuple[str, list[str]]:
    """Return the parameter on the x axis of a sweep, and the other parameters with several values, which distinguish curves.

    The parameter on the x axis is the first one with several numbers. If there is none, it is the first one with several
    values, and otherwise the first one.
    """
    several = [name for name, values in parameters.items() if len(set(values)) > 1]
    numeric = [name for name in several if not any(isinstance(value, (str, bool)) for value in parameters[name])]
    first = (numeric or several or list(parameters))[0]
    return first, [name for name in several if name != first]


class Drawing:
    """Plots of a sweep over one parameter, the `abscissa`, with a curve for each combination of `curve_parameters`.

    `abscissa_of` defines both. `scale` is that of the x axis, as in `format_axes`.
    """

    def __init__(self, sweep: Sweep) -> None:
        self.abscissa, self.curve_parameters = abscissa_of(sweep.parameters)
        self.sweep, self.theory_label = sweep, f"theory {sweep.compared}".strip()
        values = sweep.parameters[self.abscissa]
        numbers = [float(v) for v in values if not isinstance(v, (str, bool))]
        wide = len(numbers) == len(values) and min(numbers) > 0 and max(numbers) >= MIN_LOGARITHMIC_RATIO * min(numbers)
        self.scale = "plain log" if wide else "linear"
        # Points of each curve, by its label.
        self.points_of = grouped((label_of(point.parameters, self.curve_parameters), point) for point in sweep.points)

    def draw_values(self, ax: Any, quantity: str) -> None:
        """Draw a quantity and its theory against the parameter.

        If all values of the quantity are positive, the y axis has the scale of the x axis; otherwise it is linear.
        """
        distinct = not set(self.curve_parameters) <= self.sweep.constant_in(quantity).keys()
        for k, (label, points) in enumerate(self.points_of.items()):
            y = [point.values.get(quantity, math.nan) for point in points]
            ax.plot(self._x(points), y, marker(k), ms=5, label=label or "computed", color=f"C{k}")
            if k and not distinct:  # all curves have the same theory
                continue
            name = (self.theory_label + self._constant_note(quantity)) if k == 0 else None
            style = {"label": name, "color": f"C{k}" if distinct else "black"}
            curves = (curve for curve in self.sweep.theories if curve.label == label and quantity in curve.values)
            exact = [point.theory.get(quantity, math.nan) for point in points]
            if (curve := next(curves, None)) is not None:
                ax.plot(curve.x, curve.values[quantity], "--", lw=1.1, **style)
            elif np.isfinite(exact).any():
                ax.plot(self._x(points), exact, "_", ms=9, **style)
        positive = all(point.values.get(quantity, 1.0) > 0 for point in self.sweep.points)
        scale = self.scale if positive else "linear"
        label = column(title(quantity), quantity, self.sweep.units)
        self._format(ax, self.sweep.with_pair(title(quantity), quantity), label, scale)

    def _x(self, points: Sequence[Point]) -> list[Any]:
        """Return the values of the parameter on the x axis, as strings if one of them is a string."""
        x = [point.parameters[self.abscissa] for point in points]
        return list(map(str, x)) if any(isinstance(value, str) for value in x) else x

    def _constant_note(self, quantity: str) -> str:
        """Return a note on parameters on which the theory of a quantity does not depend, or an empty string."""
        names = self.sweep.constant_in(quantity)
        return f"\n(the same for every {' and '.join(names)})" if names else ""

    def draw_ratios(self, ax: Any, quantity: str) -> None:
        """Draw the ratios of a quantity to theory, at equal approach and at equal force, against the parameter."""
        styles = {"theory": ("-", self.theory_label), "equal_force": ("--", "theory at equal force")}
        n_lines = 0
        for k, (label, points) in enumerate(self.points_of.items()):
            for comparison, (style, name) in styles.items():
                ratios = [point.ratio(quantity, comparison) for point in points]
                if np.isfinite(ratios).any() and (comparison, quantity) != ("equal_force", "force"):
                    name = f"to {name}" + (f"\n{label}" if label else "")
                    color = f"C{k if self.curve_parameters else n_lines}"
                    ax.plot(self._x(points), ratios, f"{marker(k)}{style}", ms=4, lw=1.0, label=name, color=color)
                    n_lines += 1
        if not n_lines:
            return show_message(ax, f"no theoretical value of the {title(quantity)}")
        ax.axhline(1.0, color="black", lw=0.8)
        heading = f"{self.sweep.with_pair(title(quantity), quantity)}: ratio to theory{self._constant_note(quantity)}"
        self._format(ax, heading, "computed / theory [-]")

    def _format(self, ax: Any, heading: str, y_label: str, y_scale: str = "linear") -> None:
        """Set scales, title, labels and legend; the legend is beside the axes if there are several curves."""
        labels = parameter_label(self.abscissa, self.sweep.units), y_label
        format_axes(ax, heading, labels, scales=(self.scale, y_scale), title_size=10)
        if self.curve_parameters:
            ax.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.0, 1.0))


def label_of(parameters: Mapping[str, Value], names: Sequence[str] | None = None) -> str:
    """Return a label with the values of the parameters in `names`, by default of all parameters."""
    values = ((name, parameters[name]) for name in (parameters if names is None else names))
    return ", ".join(f"{name} = {f'{value:.6g}' if isinstance(value, float) else value}" for name, value in values)


# Standard quantities in tables and figures.
STANDARD = ("force", "pressure_max", "contact_radius")
# Names of the relative differences in JSON and CSV files, by the attribute of `Point` with which results are
# compared.
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
        Theoretical values against the first parameter with several numbers, one curve for each combination of the others;
        empty without a theory.
    compared : str
        Condition under which results are compared with theory: ``"at equal approach"``, or empty if the case prescribes
        another load.
    asked : tuple of str
        Additional quantities of ``[study]`` in tables and figures.
    pairs : tuple of str
        Contact pairs; standard quantities such as ``force`` are those of the first.
    """

    kind = "Sweep"
    picture = "quantities against the parameter, and their ratio to theory"

    combination: str
    parameters: dict[str, tuple[Value, ...]]
    points: list[Point]
    failed: list[tuple[dict[str, Value], str]]
    theories: tuple[TheoryCurve, ...] = ()
    compared: str = "at equal approach"
    asked: tuple[str, ...] = ()
    pairs: tuple[str, ...] = ()

    @property
    def quantities(self) -> list[str]:
        """Names of all evaluated quantities."""
        return list(dict.fromkeys(name for point in self.points for name in point.values))

    def as_dict(self) -> dict[str, Any]:
        """Return the sweep as numbers, strings, lists and dictionaries, as ``--json`` writes it; differences are relative."""
        return self.with_metadata({
            "combination": self.combination,
            "parameters": {name: list(values) for name, values in self.parameters.items()},
            "contact": self.pairs[0] if self.pairs else None,
            "theory_independent_of": self.theory_independent_of,
            "points": [_point_dict(point) for point in self.points],
            "failed": [{"parameters": choice, "error": text} for choice, text in self.failed],
        })  # fmt: skip

    def table(self) -> AnyArray:
        """Return a structured array (n_points,) with a row for each point, as ``--csv`` writes it.

        The fields are the parameters, ``h`` [length] if known, ``n_dofs``, ``seconds`` [s] and, for each quantity, its value
        [unit of the quantity] and, if known, the relative differences ``..._from_theory``, ``..._from_theory_at_equal_force``
        and ``..._from_reference`` [-]. A result that has the name of a parameter, such as ``force``, is in the field
        ``computed_force``. The field ``theory_independent_of`` contains the parameters that change results but not the theory
        of the case, if there are any.

        If points could not be solved, their results are NaN, and the last field, ``failed``, is the reason; it is empty for
        other points.
        """
        solved = {tuple(point.parameters.values()): point for point in self.points}
        reasons = {tuple(choice.values()): text for choice, text in self.failed}
        choices = [choice for choice in itertools.product(*self.parameters.values()) if choice in {**solved, **reasons}]
        rows = [self._row(solved[choice]) if choice in solved else {} for choice in choices]
        names = dict.fromkeys(name for row in rows for name in row)
        columns: dict[str, Sequence[Any]] = {name: [row.get(name, math.nan) for row in rows] for name in names}
        if names_without_theory := ", ".join(self.theory_independent_of):
            columns["theory_independent_of"] = [names_without_theory] * len(choices)
        if reasons:
            columns["failed"] = [reasons.get(choice, "") for choice in choices]
        results = {f"computed_{name}" if name in self.parameters else name: values for name, values in columns.items()}
        return self.structured_known(dict(zip(self.parameters, zip(*choices, strict=True), strict=True)) | results)

    def to_pandas(self) -> pandas.DataFrame:
        """Return `table` as a ``pandas.DataFrame``, see `Report`; the reason is missing at points that were solved."""
        frame = super().to_pandas()
        if self.failed:
            frame["failed"] = frame["failed"].replace("", None)
        return frame

    def _row(self, point: Point) -> dict[str, Any]:
        """Return the results of a point, by the names of the fields of `table`."""
        row: dict[str, Any] = {name: getattr(point, name) for name in ("h", "n_dofs", "seconds")}
        for name in self.quantities:
            row[name] = point.values.get(name, math.nan)
            row |= {f"{name}_{key}": point.ratio(name, comparison) - 1.0 for comparison, key in DIFFERENCES.items()}
        return row

    def remarks(self) -> list[str]:
        """See `Report`."""
        remarks = self.warnings_of((label_of(point.parameters), point.warnings) for point in self.points)
        remarks += [f"{label_of(choice)} failed: {text}" for choice, text in self.failed]
        return remarks + [self._constant_theory_remark(name) for name in self.theory_independent_of]

    def constant_in(self, quantity: str) -> dict[str, bool]:
        """Return the parameters on which the theory of a quantity does not depend.

        The values are whether the parameter changes the quantity by more than one per cent; prescribed forces do not change.
        """
        found = {}
        for name in self.parameters:
            others = [other for other in self.parameters if other != name]
            # Points that differ in this parameter only.
            groups = grouped((label_of(point.parameters, others), point) for point in self.points)
            several = [points for points in groups.values() if len(points) > 1]
            theories = [{point.theory.get(quantity) for point in points} for points in several]
            if several and all(len(exact) == 1 and None not in exact for exact in theories):
                values = [[point.values.get(quantity, math.nan) for point in points] for points in several]
                found[name] = any(np.ptp(row) > NOTABLE * np.max(np.abs(row)) for row in values)
        return found

    @property
    def theory_independent_of(self) -> list[str]:
        """Parameters that change a main quantity by more than one per cent, but not its theory."""
        constant = [self.constant_in(quantity) for quantity in self._main_quantities()]
        return [name for name in self.parameters if any(found.get(name) for found in constant)]

    def _constant_theory_remark(self, parameter: str) -> str:
        """Return the remark that the theory does not depend on a parameter, and how it can be made to."""
        numeric = not any(isinstance(value, (str, bool)) for value in self.parameters[parameter])
        remedy = f": if it should, let a name in [study.parameters] also set keys of [theory.{self.pairs[0]}]"
        return f"the theory does not depend on {parameter}{remedy if numeric else ''}"

    def with_pair(self, label: str, quantity: str) -> str:
        """Return a label of a quantity, with the name of its contact pair if there are several pairs."""
        several = len(self.pairs) > 1 and "study.contact" not in self.parameters
        return f"{label} of '{self.pairs[0]}'" if several and quantity in {*LABELS} - {"von_mises_max"} else label

    def figure(self) -> Any:
        """Return a Matplotlib figure with the values against a parameter and their ratios to theory.

        The parameter is the first with several numbers. There is a curve for each combination of values of the others; the
        title states parameters with a single value.
        """
        names, drawing = self._main_quantities(), Drawing(self)
        with_theory = any(name in point.theory for point in self.points for name in names)
        legend_width = 1.7 * (1 + with_theory) * bool(drawing.curve_parameters)  # [inch]
        size = ((8.8 if with_theory else 5.2) + legend_width, 0.5 + 3.1 * len(names))
        varied = (drawing.abscissa, *drawing.curve_parameters)
        fixed = {name: values[0] for name, values in self.parameters.items() if name not in varied}
        heading = "\n".join(dict.fromkeys((self.title, self.combination)))  # equal for some studies of functions
        heading += f"\n{label_of(fixed)}" if fixed else ""
        axes = panels((len(names), 1 + with_theory), size, heading, fontsize=11)
        for row, name in zip(axes, names, strict=True):
            drawing.draw_values(row[0], name)
            if with_theory:
                drawing.draw_ratios(row[1], name)
        return axes[0, 0].figure

    def _main_quantities(self) -> list[str]:
        """Return the names of the main quantities that were evaluated, or of the first three others.

        The main quantities are the standard and the requested ones, and forces of pretension sections.
        """
        bolts = [name for name in self.quantities if name.endswith(f".{BOLT_FORCE}")]
        names = dict.fromkeys((*STANDARD, *bolts, *self.asked))
        return [name for name in names if name in self.quantities] or self.quantities[:3]

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`; each point has a row with parameters, DOF, main quantities and differences from theory."""
        columns = []
        for name in self.parameters:
            choices = [point.parameters[name] for point in self.points]
            columns.append((name, [number(v) if isinstance(v, float) else str(v) for v in choices]))
        columns.append(("DOF", [str(point.n_dofs) for point in self.points]))
        for name in self._main_quantities():
            differences = {}
            if any(name in point.theory for point in self.points):
                differences = {"theory": "from theory"} | ({"equal_force": "at equal force"} if name != "force" else {})
            values = [number(point.values.get(name, math.nan), 7) for point in self.points]
            columns.append((column(self.with_pair(name, name), name, self.units), values))
            for comparison, label in differences.items():
                columns.append((label, [percent(point.ratio(name, comparison) - 1.0) for point in self.points]))
        return [(self.combination if self.combination != self.title else "", to_rows(columns))]


def _point_dict(point: Point) -> dict[str, Any]:
    """Return the results of a point for JSON."""
    entry: dict[str, Any] = {"parameters": dict(point.parameters), **point.as_dict()}
    for comparison, key in DIFFERENCES.items():
        differences = {name: point.ratio(name, comparison) - 1.0 for name in getattr(point, comparison)}
        entry[key] = {name: value for name, value in differences.items() if math.isfinite(value)}
    return entry
