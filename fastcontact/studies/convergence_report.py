"""The result of a mesh-convergence study and its report as lines, table, dictionary, figure and page."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from typing import Any

from fastcontact.arrays import AnyArray
from fastcontact.studies import convergence_tables as tables
from fastcontact.studies.convergence_figures import draw_differences, draw_errors, draw_pressure
from fastcontact.studies.fit import CONFIDENCE
from fastcontact.studies.render.figure import message, panels
from fastcontact.studies.render.table import Rows
from fastcontact.studies.report import Report
from fastcontact.studies.sentences import sentences
from fastcontact.studies.series import Series
from fastcontact.studies.settings import Named

# Quantities in figures and in the table of all combinations.
COMPARED = ("force", "pressure_max")


@dataclass(frozen=True, eq=False, repr=False)
class Study(Report):
    """The result of a mesh-convergence study, with the attributes of `Report` and the following.

    Attributes
    ----------
    series : list of Series
        Results of each combination of element and contact formulation that was solved.
    failed : dict of str to str
        Reason of the failure of each combination that could not be solved, by its name.
    theory : object or None
        Theory at equal approach, an object of `fastcontact.analytic`; None if the case has none.
    """

    kind = "Mesh convergence"
    picture = "mesh errors over the mesh size, the pressure of all levels over theory, the difference from theory"
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
        """Results of the combination with the highest rank among those that were solved on the most levels."""
        complete = max(len(series.levels) for series in self.series)
        candidates = [series for series in self.series if len(series.levels) == complete]
        return max(candidates, key=lambda series: series.combination.rank)

    def as_dict(self) -> dict[str, Any]:
        """Return the study as numbers, strings, lists and dictionaries, as ``--json`` writes it.

        The top level contains the results of the combination `best`, and ``combinations`` contains all combinations. Errors
        are relative to the theory, or to the limit if there is no theory [-]. ``mesh_error`` is the error of the finest mesh,
        and ``model_error + mesh_error`` is its difference from theory. ``uncertainty`` is the half-width of the 95 % interval
        of the limit [unit of the quantity].
        """
        numbers = {
            "confidence": CONFIDENCE,
            **tables.series_dict(self.best),
            "combinations": [tables.series_dict(series) for series in self.series],
            "failed_combinations": dict(self.failed),
        }
        return self.framed(numbers)

    def table(self) -> AnyArray:
        """Return a structured array (n_rows,) with a row for each level of each combination, as ``--csv`` writes it.

        The fields are ``element``, ``formulation``, ``level``, ``h`` [length], ``n_dofs``, ``seconds`` [s] and, for each
        quantity, its value [unit of the quantity], ``..._error``, which is relative to the limit, ``..._order`` between the
        previous level and this one, and ``..._from_theory``, the relative difference from a theory, if there is one [-].
        """
        return self.structured_known(tables.csv_columns(self.series))

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`; the tables contain levels and limits of each combination, and a comparison of all combinations."""
        captioned = []
        for series in self.series:
            captioned.append((str(series.combination), tables.level_rows(series, self.units)))
            if series.limits:
                captioned.append((f"{series.combination}: limits", tables.limit_rows(series, self.units)))
        if len(self.series) > 1:
            rows = tables.comparison_rows(self.series, self.best.shown(COMPARED), self.units)
            captioned.append((f"all combinations: limits and model errors {self.best.compared}", rows))
        return captioned

    def sentences(self) -> list[str]:
        """See `Report`."""
        return sentences(self.best)

    def remarks(self) -> list[str]:
        """See `Report`."""
        remarks = []
        for series in self.series:
            remarks += [
                f"warning: {text}" for text in sorted({text for level in series.levels for text in level.warnings})
            ]
            if not series.limits:
                remarks.append(
                    f"no limits: {len(series.levels)} levels were solved, and an extrapolated limit needs three"
                )
            remarks += [f"level {number} failed: {text}" for number, text in series.failed.items()]
        return remarks + [f"{name} failed: {text}" for name, text in self.failed.items()]

    def figure(self) -> Any:
        """Return a Matplotlib figure with errors, the pressure over the radius, and differences from theory."""
        of_case = not isinstance(self.best.combination, Named)
        of_all: dict[str, Any] = {"all_series": self.series, "units": self.units}
        drawn: list[Callable[[Any], None]] = [partial(draw_errors, quantity=name, **of_all) for name in self._drawn()]
        if of_case or self.best.finest.profile:
            drawn.append(partial(draw_pressure, series=self.best, theory=self.theory, units=self.units))
        if of_case:
            drawn.append(partial(draw_differences, best=self.best, quantity="pressure_max", **of_all))
        rows, columns = (len(drawn) + 1) // 2, min(2, len(drawn))
        axes = panels(rows, columns, (6.0 * columns, 4.6 * rows), self.title)
        for ax, draw in zip_longest(axes.flat, drawn, fillvalue=partial(message, text="")):
            draw(ax)
        return axes[0, 0].figure

    def _drawn(self) -> list[str]:
        """Return the quantities whose errors are drawn."""
        known = self.best.shown(COMPARED) or list(self.best.quantities[:2])
        return known if isinstance(self.best.combination, Named) else list(COMPARED)
