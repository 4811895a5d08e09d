"""Mesh-convergence study: the same case on finer and finer meshes, fitted and held against theory."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from fastcontact.cases.case import Case, read_case
from fastcontact.errors import CaseError, unknown
from fastcontact.studies.execute import Progress, run_all
from fastcontact.studies.fit import Limit, fit_limit, step_orders
from fastcontact.studies.job import Job, case_data
from fastcontact.studies.levels import recipe
from fastcontact.studies.model_error import Split, split
from fastcontact.studies.quantities import of_theory
from fastcontact.studies.settings import Combination, Settings, combinations, settings
from fastcontact.studies.store import Store

STANDARD = (
    "force",
    "pressure_max",
    "pressure_pole",
    "contact_radius",
    "von_mises_max",
    "von_mises_depth",
    "pressure_error",
    "pressure_error_equal_force",
)


@dataclass(frozen=True, eq=False)
class Level:
    """What one mesh gave.

    Attributes
    ----------
    number : int
        0 is the coarsest.
    h : float
        Shortest facet of the secondary surface; without contact the shortest edge [length].
    n_dofs : int
    values : dict of str to float
        Quantities of interest.
    profile : dict
        ``r`` [length] and ``pressure`` [pressure] of the secondary nodes.
    seconds : float
        Time the run took where it ran.
    warnings : tuple of str
    """

    number: int
    h: float
    n_dofs: int
    values: dict[str, float]
    profile: dict[str, list[float]]
    seconds: float
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Series:
    """One element and formulation on all levels.

    Attributes
    ----------
    combination : Combination
    levels : list of Level
        Those that could be solved, coarsest first.
    failed : dict of int to str
        Why a level failed, by its number.
    theory, reference : dict of str to float
        What the theory at equal approach, and the mesh-converged solution if the case names one, say of a quantity.
    equal_force, equal_force_spread : dict of str to float
        What the theory says at the limit of the force, and how much the force's error bar changes that.
    quantities : tuple of str
        Those that were fitted, or would have been with more levels.
    limits : dict of str to Limit
        By quantity; empty with fewer than three levels.
    """

    combination: Combination
    levels: list[Level]
    failed: dict[int, str]
    theory: dict[str, float]
    reference: dict[str, float]
    equal_force: dict[str, float]
    equal_force_spread: dict[str, float]
    quantities: tuple[str, ...]
    limits: dict[str, Limit]

    @property
    def finest(self) -> Level:
        """The last level that could be solved."""
        return self.levels[-1]

    def values(self, quantity: str) -> list[float]:
        """Return a quantity on every level; NaN where it is not known."""
        return [level.values.get(quantity, float("nan")) for level in self.levels]

    def errors(self, quantity: str) -> list[float]:
        """Return (value - limit) / limit on every level; NaN without a limit."""
        limit = self.limits.get(quantity)
        return [v / limit.value - 1.0 if limit and limit.value else float("nan") for v in self.values(quantity)]

    def orders(self, quantity: str) -> list[float]:
        """Return the order from level to level, the first NaN."""
        limit = self.limits.get(quantity)
        if limit is None:
            return [float("nan")] * len(self.levels)
        return step_orders([level.h for level in self.levels], self.values(quantity), limit.value)

    def split(self, quantity: str) -> Split | None:
        """Return model and mesh error at equal approach, where there are a limit and a theory."""
        limit, theory = self.limits.get(quantity), self.theory.get(quantity)
        return split(self.values(quantity)[-1], limit, theory) if limit and theory else None

    def split_equal_force(self, quantity: str) -> Split | None:
        """Return model and mesh error against the theory at the limit of the force."""
        limit, theory = self.limits.get(quantity), self.equal_force.get(quantity)
        if not (limit and theory):
            return None
        # The theory's value is as uncertain as the force at which it is taken.
        error_bar = math.hypot(limit.uncertainty, self.equal_force_spread.get(quantity, 0.0))
        return split(self.values(quantity)[-1], dataclasses.replace(limit, uncertainty=error_bar), theory)


@dataclass(frozen=True, eq=False)
class Study:
    """A finished mesh-convergence study; `report`, `pictures` and `output` show it.

    Attributes
    ----------
    name, title, text : str
        Of the case.
    units : dict of str to str
    series : list of Series
        One for each combination of element and formulation that could be solved.
    failed : dict of str to str
        Why a whole combination failed, by its name.
    theory : object or None
        The theory at equal approach, of `fastcontact.analytic`.
    """

    name: str
    title: str
    text: str
    units: dict[str, str]
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
        """Return plain numbers, texts, lists and dictionaries, as ``--json`` writes them."""
        from fastcontact.studies.output import as_dict

        return as_dict(self)

    def table(self) -> NDArray[Any]:
        """Return a structured array, one row a level of a combination, as ``--csv`` writes it."""
        from fastcontact.studies.output import table

        return table(self)

    def lines(self) -> list[str]:
        """Return tables and sentences for a person."""
        from fastcontact.studies.text import lines

        return lines(self)

    def figure(self) -> Any:
        """Return a matplotlib figure: errors, pressure over the radius, differences from theory."""
        from fastcontact.studies.pictures import overview

        return overview(self)

    def html(self) -> str:
        """Return the study as one self-contained HTML page."""
        from fastcontact.studies.report import html_report

        return html_report(self)


def convergence_study(
    case: Case | str | Path,
    levels: int = 5,
    elements: Sequence[str] | None = None,
    formulations: Sequence[str] | None = None,
    *,
    quantities: Sequence[str] = (),
    executor: Executor | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Study:
    """Solve a case on finer and finer meshes; fit order and limit; tell model error from mesh error.

    Meshes come from the generator that the case names, its sizes halved on every level, or from uniform refinement of
    its mesh file, arcs kept round; the table ``[study]`` of the case says more, see `fastcontact.convergence.settings`.

    Parameters
    ----------
    case : Case or path-like
    levels : int
        Number of meshes; a limit takes three, a trustworthy one five.
    elements, formulations : sequence of str, optional
        Compared in all combinations; ``["all"]`` for all; by default what ``[study]`` names, or the case's own.
    quantities : sequence of str
        Further ones to fit, such as ``"C1.stress.yy"``, ``"C1.displacement.y"``, ``"C1.pressure"``.
    executor : concurrent.futures.Executor, optional
        Where to run, see `fastcontact.convergence.execute.run_all`; by default processes of this machine.
    workers : int, optional
        Number of these processes; 1 runs everything in this one.
    store : path-like, optional
        Folder of finished runs: what is there is not run again.
    on_progress : callable, optional
        Called with a `Progress` after every run.

    Returns
    -------
    Study

    Raises
    ------
    CaseError, FastcontactError
        If the case, a name or a number is wrong, or no level of any combination could be solved.
    """
    case = case if isinstance(case, Case) else read_case(case)
    if levels < 1:
        raise CaseError(f"levels = {levels} must be at least 1; a limit takes 3")
    chosen = settings(case)
    members = combinations(chosen, elements, formulations)
    jobs = [_job(case, chosen, member, level) for level in range(levels) for member in members]
    results = run_all(
        jobs,
        executor=executor,
        workers=workers,
        store=Store(store) if store is not None else None,
        on_progress=on_progress,
    )
    return _gathered(case, chosen, members, jobs, results, quantities)


def _job(case: Case, chosen: Settings, combination: Combination, level: int) -> Job:
    return Job(
        label=f"{combination} level {level}",
        name=case.name,
        data=case_data(chosen, combination),
        pair=chosen.pair,
        recipe=recipe(chosen, combination.element, level),
        base=case.mesh if chosen.generator is None else None,
        size=level,
        marks={"level": level, "element": combination.element, "formulation": combination.formulation},
    )


def _gathered(
    case: Case,
    chosen: Settings,
    members: Sequence[Combination],
    jobs: Sequence[Job],
    results: Sequence[dict[str, Any]],
    wanted: Sequence[str],
) -> Study:
    series, failed = [], {}
    for member in members:
        mine = [
            (job.marks["level"], result)
            for job, result in zip(jobs, results, strict=True)
            if (job.marks["element"], job.marks["formulation"]) == (member.element, member.formulation)
        ]
        if all("error" in result for _, result in mine):
            failed[str(member)] = str(mine[0][1]["error"])
        else:
            series.append(_series(member, mine, [*chosen.quantities, *wanted], case))
    if not series:
        from fastcontact import errors

        first = results[0]
        kind = getattr(errors, str(first.get("kind")), CaseError)
        raise kind(f"no level could be solved; {jobs[0].label}: {first['error']}")
    return Study(case.name, case.title, case.text, case.units, series, failed, _theory(case))


def _series(
    member: Combination, results: list[tuple[int, dict[str, Any]]], wanted: Sequence[str], case: Case
) -> Series:
    solved = [(number, result) for number, result in results if "error" not in result]
    levels = [
        Level(
            number,
            result["h"],
            result["n_dofs"],
            result["values"],
            result["profile"],
            result["seconds"],
            tuple(result["warnings"]),
        )
        for number, result in solved
    ]
    known = levels[-1].values
    for name in wanted:
        if name not in known:
            raise CaseError(unknown("quantity", name, known))
    checked = [check.quantity for check in case.checks]
    names = tuple(dict.fromkeys(name for name in (*STANDARD, *checked, *wanted) if name in known))
    limits = {name: found for name in names if (found := _limit(levels, name)) is not None}
    failed = {number: str(result["error"]) for number, result in results if "error" in result}
    last = solved[-1][1]
    at_force, spread = _at_force(_theory(case), limits.get("force"))
    return Series(member, levels, failed, last["theory"], last["reference"], at_force, spread, names, limits)


def _theory(case: Case) -> Any:
    return case.theories.get(settings(case).pair or "", {}).get("theory")


def _at_force(theory: Any, force: Limit | None) -> tuple[dict[str, float], dict[str, float]]:
    """Return what a theory says at the limit of the force, and by how much that changes within its error bar."""
    if force is None or not force.value > force.uncertainty or not hasattr(theory, "at_force"):
        return {}, {}
    middle = of_theory(theory.at_force(force.value))
    upper = of_theory(theory.at_force(force.value + force.uncertainty))
    return middle, {name: abs(upper[name] - value) for name, value in middle.items()}


def _limit(levels: Sequence[Level], quantity: str) -> Limit | None:
    known = [level for level in levels if quantity in level.values]
    if len({level.h for level in known}) < max(3, len(known)):
        return None
    return fit_limit([level.h for level in known], [level.values[quantity] for level in known])
