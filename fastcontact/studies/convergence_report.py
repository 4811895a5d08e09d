"""A finished mesh-convergence study and its report: lines, table, dictionary, figure, page."""

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
    """A finished mesh-convergence study; its case and units as in `Report`.

    Attributes
    ----------
    series : list of Series
        One for each combination of element and formulation that could be solved.
    failed : dict of str to str
        Reason why a whole combination failed, by its name.
    theory : object or None
        The theory at equal approach, of `fastcontact.analytic`.
    """

    kind = "Mesh convergence"
    picture = "mesh errors over the mesh size, the pressure of all levels over theory, the difference from theory"
    explanations = (
        "The limit is what the values tend to on ever finer meshes, from a fit of value = limit + C h^order; it lies within "
        f"the error bar with a probability of {CONFIDENCE:.0%}. Orders from one level to the next are erratic, because the "
        "edge of the contact cuts another facet each time: judge by the fitted order.",
        "The mesh error is the finest mesh's difference from the limit; a finer mesh makes it smaller. The model error is "
        "the limit's difference from theory; it stays on every mesh, because theory and model are about different bodies. "
        "Both are relative to the theory and sum up to the whole difference.",
        "Equal approach compares at the same displacement, equal force at the same contact force.",
    )

    series: list[Series]
    failed: dict[str, str]
    theory: Any

    @property
    def best(self) -> Series:
        """The combination that is usually the most accurate: quadratic quadrangles with a pressure field."""
        complete = max(len(series.levels) for series in self.series)
        candidates = [series for series in self.series if len(series.levels) == complete]
        return max(candidates, key=lambda series: series.combination.rank)

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, as ``--json`` writes them.

        The top level contains the best combination (`best`), ``combinations`` contains all. Errors are relative to the
        theory, or without one to the limit; ``mesh_error`` is that of the finest mesh, and ``model_error +
        mesh_error`` its difference from theory. ``uncertainty`` is the half-width of the 95 % interval, in the unit of
        the quantity.
        """
        numbers = {
            "confidence": CONFIDENCE,
            **tables.series_dict(self.best),
            "combinations": [tables.series_dict(series) for series in self.series],
            "failed_combinations": dict(self.failed),
        }
        return self.framed(numbers)

    def table(self) -> AnyArray:
        """Return a structured array (n_rows,), one row a level of a combination, as ``--csv`` writes it.

        Fields ``element``, ``formulation``, ``level``, ``h`` [length], ``n_dofs``, ``seconds`` [s], and for every
        quantity its value in its unit, ``..._error`` [-] (relative to its limit), ``..._order`` [-] (from the previous
        level) and, if there is a theory, ``..._from_theory`` [-] (relative to the theory).
        """
        return self.structured_known(tables.csv_columns(self.series))

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`: levels and limits of every combination, and a comparison of all combinations."""
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
        """Return a matplotlib figure: errors, pressure over the radius, differences from theory."""
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
        """Return the quantities for which errors are drawn."""
        known = self.best.shown(COMPARED) or list(self.best.quantities[:2])
        return known if isinstance(self.best.combination, Named) else list(COMPARED)
