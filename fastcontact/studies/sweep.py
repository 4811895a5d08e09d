"""Parameter sweep: the same case with other numbers in it, held against theory where there is one."""

from __future__ import annotations

import itertools
import tomllib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from fastcontact import errors
from fastcontact.cases.case import Case, build_case, read_case
from fastcontact.errors import CaseError
from fastcontact.studies.case_parameters import substituted
from fastcontact.studies.execute import Progress, run_all
from fastcontact.studies.job import Job, case_data
from fastcontact.studies.levels import make_mesh, recipe
from fastcontact.studies.settings import Combination, Settings, one_combination, settings
from fastcontact.studies.store import Store

Value = float | int | str | bool
# The level of the study's meshes where nothing is said: fine enough to tell a trend from mesh error.
LEVEL = 2


@dataclass(frozen=True, eq=False)
class Point:
    """What one choice of the parameters gave.

    Attributes
    ----------
    parameters : dict of str to value
    h : float
        Shortest facet of the secondary surface [length].
    n_dofs : int
    values : dict of str to float
        Quantities of interest.
    theory, reference, equal_force : dict of str to float
        What the theory at equal approach, the mesh-converged solution if the case names one, and the theory at equal
        force say of a quantity.
    profile : dict
        ``r`` [length] and ``pressure`` [pressure] of the secondary nodes.
    seconds : float
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
        """Return value over ``"theory"``, ``"reference"`` or ``"equal_force"``; NaN where one is not known."""
        other = getattr(self, to).get(quantity)
        return self.values.get(quantity, float("nan")) / other if other else float("nan")


@dataclass(frozen=True, eq=False)
class Sweep:
    """A finished sweep.

    Attributes
    ----------
    name, title, text : str
        Of the case.
    units : dict of str to str
    combination : str
        Element and formulation.
    parameters : dict of str to tuple
        Values by parameter.
    points : list of Point
        Those that could be solved; the last parameter changes fastest.
    failed : list of (dict, str)
        Parameters and reason of the others.
    """

    name: str
    title: str
    text: str
    units: dict[str, str]
    combination: str
    parameters: dict[str, tuple[Value, ...]]
    points: list[Point]
    failed: list[tuple[dict[str, Value], str]]

    @property
    def quantities(self) -> list[str]:
        """Names of all quantities that were measured."""
        return list(dict.fromkeys(name for point in self.points for name in point.values))

    def as_dict(self) -> dict[str, Any]:
        """Return plain numbers, texts, lists and dictionaries, as ``--json`` writes them."""
        from fastcontact.studies.sweep_output import as_dict

        return as_dict(self)

    def table(self) -> NDArray[Any]:
        """Return a structured array, one row a point, as ``--csv`` writes it."""
        from fastcontact.studies.sweep_output import table

        return table(self)

    def lines(self) -> list[str]:
        """Return a table for a person."""
        from fastcontact.studies.sweep_output import lines

        return lines(self)

    def figure(self) -> Any:
        """Return a matplotlib figure: values over the parameter, and their ratio to theory."""
        from fastcontact.studies.sweep_pictures import overview

        return overview(self)

    def html(self) -> str:
        """Return the sweep as one self-contained HTML page."""
        from fastcontact.studies.sweep_output import html_report

        return html_report(self)


def parameter_sweep(
    case: Case | str | Path,
    parameters: Mapping[str, Sequence[Value]],
    *,
    element: str | None = None,
    formulation: str | None = None,
    level: int | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Sweep:
    """Solve a case for all combinations of some parameters' values.

    Parameters
    ----------
    case : Case or path-like
    parameters : mapping of str to sequence
        Values by parameter. A parameter is the path of a number in the case file, e.g. ``"contact.hertz.friction"``,
        ``"material[0].E"`` or ``"mesh.size"`` (tables in a list count from 0), or a name of ``[study.parameters]``,
        which stands for several paths that change together.
    element, formulation : str, optional
        By default the last of ``study.combinations``, or the case's own.
    level : int, optional
        Refinement, as in `convergence_study`; by default 2 where ``[study]`` gives the meshes of level 0, otherwise the
        mesh of the case.
    executor, workers, store, on_progress
        As in `convergence_study`.

    Returns
    -------
    Sweep

    Raises
    ------
    CaseError, FastcontactError
        If the case, a parameter or a value is wrong, or no point could be solved.
    """
    case = case if isinstance(case, Case) else read_case(case)
    if not parameters or not all(len(values) for values in parameters.values()):
        raise CaseError("a sweep needs at least one parameter with at least one value")
    choices = [dict(zip(parameters, values, strict=True)) for values in itertools.product(*parameters.values())]
    jobs = [_job(case, choice, element, formulation, level) for choice in choices]
    # A key that the case does not know would fail in every run.
    build_case(jobs[0].data, name=case.name, mesh=case.mesh)
    kept = Store(store) if store is not None else None
    results = run_all(jobs, executor=executor, workers=workers, store=kept, on_progress=on_progress)
    points = [_point(c, r) for c, r in zip(choices, results, strict=True) if "error" not in r]
    failed = [(c, str(r["error"])) for c, r in zip(choices, results, strict=True) if "error" in r]
    if not points:
        kind = getattr(errors, str(results[0].get("kind")), CaseError)
        raise kind(f"no point of the sweep could be solved; {jobs[0].label}: {failed[0][1]}")
    values = {name: tuple(given) for name, given in parameters.items()}
    used = str(jobs[0].marks["combination"])
    return Sweep(case.name, case.title, case.text, case.units, used, values, points, failed)


def _job(case: Case, choice: dict[str, Value], element: str | None, formulation: str | None, level: int | None) -> Job:
    data = tomllib.loads(case.text)
    linked = data.get("study", {}).get("parameters", {})
    for parameter, value in choice.items():
        data = substituted(data, parameter, value, linked)
    chosen = settings(case, data)
    member = one_combination(chosen, element, formulation)
    by_shape = chosen.generator is not None and "" not in chosen.arguments
    finer = (LEVEL if by_shape else 0) if level is None else level
    return Job(
        label=", ".join(f"{name} = {value}" for name, value in choice.items()),
        name=case.name,
        data=case_data(chosen, member),
        pair=chosen.pair,
        recipe=recipe(chosen, member.element, finer),
        base=case.mesh if chosen.generator is None else None,
        size=_points(chosen, member),
        marks={**choice, "combination": f"{member}, level {finer}"},
    )


def _points(chosen: Settings, member: Combination) -> float:
    """Return the points of the coarsest mesh, which tell which of the runs is the largest."""
    return make_mesh(recipe(chosen, member.element, 0), None).n_points if chosen.generator is not None else 0


def _point(choice: dict[str, Value], result: dict[str, Any]) -> Point:
    return Point(
        choice,
        result["h"],
        result["n_dofs"],
        result["values"],
        result["theory"],
        result["reference"],
        result["equal_force"],
        result["profile"],
        result["seconds"],
        tuple(result["warnings"]),
    )
