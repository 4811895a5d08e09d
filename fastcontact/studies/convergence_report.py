"""A finished mesh-convergence study and its report: lines, table, dictionary, figure, page."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from itertools import zip_longest
from typing import Any

from fastcontact.arrays import AnyArray
from fastcontact.studies import convergence_tables as tables
from fastcontact.studies.convergence_figures import draw_differences, draw_errors, draw_pressure
from fastcontact.studies.fit import CONFIDENCE
from fastcontact.studies.render import page
from fastcontact.studies.render.figure import message, panels
from fastcontact.studies.render.table import Rows, aligned, structured
from fastcontact.studies.report import Report
from fastcontact.studies.sentences import MAIN, sentences
from fastcontact.studies.series import Series
from fastcontact.studies.settings import Named

# In figures, and in the table of all combinations.
COMPARED = ("force", "pressure_max")
EXPLANATIONS = (
    "The <em>limit</em> is what the values tend to on ever finer meshes, from a fit of value = limit + C "
    f"h<sup>order</sup>; it lies within the error bar with a probability of {CONFIDENCE:.0%}. Orders from one level "
    "to the next are erratic, because the edge of the contact cuts another facet each time: judge by the fitted order.",
    "The <em>mesh error</em> is the finest mesh's difference from the limit; a finer mesh makes it smaller. The "
    "<em>model error</em> is the limit's difference from theory; it stays on every mesh, because theory and model "
    "are about different bodies. Both are relative to the theory and sum up to the whole difference.",
    "<em>Equal approach</em> compares at the same displacement, <em>equal force</em> at the same contact force.",
)


@dataclass(frozen=True, eq=False, repr=False)
class Study(Report):
    """A finished mesh-convergence study; its case and units as in `Report`.

    Attributes
    ----------
    series : list of Series
        One for each combination of element and formulation that could be solved.
    failed : dict of str to str
        Why a whole combination failed, by its name.
    theory : object or None
        The theory at equal approach, of `fastcontact.analytic`.
    """

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

        The top level holds the best combination (`best`), ``combinations`` all of them. Errors are relative to the theory,
        or without one to the limit; ``mesh_error`` is that of the finest mesh, and ``model_error + mesh_error`` its
        difference from theory. ``uncertainty`` is in the unit of the quantity, at a confidence of 95 %.
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

        Fields ``element``, ``formulation``, ``level``, ``h`` [length], ``n_dofs``, ``seconds`` [s], and for every quantity
        its value in its unit, ``..._error`` [-] (relative to its limit), ``..._order`` [-] (from the level before) and, where
        there is a theory of it, ``..._from_theory`` [-] (relative to the theory).
        """
        return structured(tables.csv_columns(self.series))

    def tables(self) -> list[tuple[str, Rows]]:
        """See `Report`."""
        return [(str(series.combination), tables.level_rows(series, self.units)) for series in self.series]

    def lines(self) -> list[str]:
        """Return tables and sentences for a person, as ``fastcontact converge`` prints them."""
        found = [self.title]
        for series in self.series:
            limits = tables.limit_rows(series, self.units)
            none = [f"  no limits: {len(series.levels)} levels were solved, and a limit takes three"]
            found += ["", f"{series.combination}", *aligned(tables.level_rows(series, self.units)), ""]
            found += aligned(limits) if len(limits) > 1 else none
            found += [f"  level {number} failed: {text}" for number, text in series.failed.items()]
        found += [f"  {name} failed: {text}" for name, text in self.failed.items()]
        if len(self.series) > 1:
            names = self.best.shown(COMPARED)
            found += ["", f"all combinations: limits and model errors {self.best.compared}"]
            found += aligned(tables.comparison_rows(self.series, names, self.units))
        return [*found, "", *sentences(self.best)]

    def figure(self) -> Any:
        """Return a matplotlib figure: errors, pressure over the radius, differences from theory."""
        of_case = not isinstance(self.best.combination, Named)
        drawn = [partial(self._draw_errors, quantity=name) for name in self._drawn()]
        if of_case or self.best.finest.profile:
            drawn.append(partial(draw_pressure, series=self.best, theory=self.theory, units=self.units))
        if of_case:
            drawn.append(partial(self._draw_differences, quantity="pressure_max"))
        rows, columns = (len(drawn) + 1) // 2, min(2, len(drawn))
        axes = panels(rows, columns, (6.0 * columns, 4.6 * rows), self.title)
        for ax, draw in zip_longest(axes.flat, drawn, fillvalue=partial(message, text="")):
            draw(ax)
        return axes[0, 0].figure

    def _drawn(self) -> list[str]:
        """Return the quantities whose errors are drawn."""
        known = self.best.shown(COMPARED) or list(self.best.quantities[:2])
        return known if isinstance(self.best.combination, Named) else list(COMPARED)

    def html(self) -> str:
        """Return the study as one self-contained HTML page."""
        parts = [page.paragraph(text) for text in sentences(self.best)]
        if len(self.series) > 1:
            parts += [page.section("All combinations"), page.paragraph("Limits with error bars, held against theory.")]
            for name in (name for name in MAIN if name in self.best.quantities):
                rows = tables.page_comparison_rows(self.series, name)
                parts.append(page.table(rows, tables.caption(name, self.units)))
        if pictures := self._pictures():
            parts += [page.section("Pictures"), *pictures]
        for series in self.series:
            parts += self._series_parts(series)
        parts += [page.failure(f"{name} failed: {text}") for name, text in self.failed.items()]
        parts += [page.section("How to read this"), *(f"<p class='say'>{text}</p>" for text in EXPLANATIONS)]
        return page.page(f"Mesh convergence: {self.title}", parts, self.text)

    def _pictures(self) -> list[str]:
        limits = [name for name in self._drawn() if any(name in series.limits for series in self.series)]
        theories = [name for name in COMPARED if any(series.split(name) for series in self.series)]
        found = []
        for names, draw, about in (
            (limits, self._draw_errors, "mesh errors over the mesh size, doubly logarithmic"),
            (theories, self._draw_differences, "difference from theory over the mesh size: model and mesh error"),
        ):
            if names:
                axes = panels(1, len(names), (5.6 * len(names), 4.8), self.title)[0]
                for ax, name in zip(axes, names, strict=True):
                    draw(ax, name)
                found.append(page.image(axes[0].figure, about))
        if self.best.finest.profile:
            ax = panels(1, 1, (7.4, 5.0))[0, 0]
            draw_pressure(ax, self.best, self.theory, self.units)
            found.append(page.image(ax.figure, "contact pressure of all levels over theory"))
        return found

    def _draw_errors(self, ax: Any, quantity: str) -> None:
        draw_errors(ax, self.series, quantity, self.units)

    def _draw_differences(self, ax: Any, quantity: str) -> None:
        draw_differences(ax, self.series, self.best, quantity, self.units)

    def _series_parts(self, series: Series) -> list[str]:
        parts = [page.section(str(series.combination))]
        names = series.shown(tables.IN_TABLES)
        for first in range(0, len(names), 2):
            parts.append(page.table(tables.level_rows(series, self.units, names[first : first + 2])))
        if series.limits:
            parts.append(page.table(tables.limit_rows(series, self.units, page=True)))
        parts += [page.failure(f"level {number} failed: {text}") for number, text in series.failed.items()]
        warnings = sorted({text for level in series.levels for text in level.warnings})
        return parts + [page.paragraph(f"Warning: {text}") for text in warnings]
