"""Parameter sweeps: solve a case for several values of its parameters."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from math import prod
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.cases.case import Case, build_case, described, read_case
from fastcontact.errors import CaseError, FastcontactError
from fastcontact.studies import function_runs as functions
from fastcontact.studies.case_parameters import substituted
from fastcontact.studies.checks import check_runs
from fastcontact.studies.execute import Progress, Result, run_study
from fastcontact.studies.function_runs import Function, FunctionRun, Quantities
from fastcontact.studies.job import Job, fields_of, job_of
from fastcontact.studies.quantities import check_names, of_theory
from fastcontact.studies.report import of_case
from fastcontact.studies.series import Point, TheoryCurve, Value
from fastcontact.studies.settings import data_of, make_mesh, one_combination, recipe, settings
from fastcontact.studies.sweep_report import Sweep, label_of

# Default refinement level of the meshes, on which mesh errors are smaller than the trends of interest.
LEVEL = 2
# Number of points of the curve of a theory.
CURVE = 60


@typed(CaseError)
def parameter_sweep(
    case: Case | str | Path | Function,
    parameters: Mapping[str, Sequence[Value]] | Sequence[Value],
    *,
    quantities: Quantities = (),
    element: str | None = None,
    formulation: str | None = None,
    level: int | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    progress: bool = False,
) -> Sweep:
    """Solve a case or a Python model for all combinations of parameter values.

    Parameters
    ----------
    case : Case, path-like or callable
        A case, the path of a case file, or a function. The function receives the parameters and returns a `Model`, which is
        solved in 20 equal steps, or the result of `solve`.
    parameters : mapping of str to sequence, or sequence
        Values of each parameter, by name. The parameters of a function are its arguments; a sequence alone contains values
        of the first argument. A parameter of a case is the path of a number in the case file, such as
        ``"contact.hertz.friction"``, ``"material[0].E"`` or ``"mesh.size"``, where tables in a list are numbered from 0. It
        can also be a name in ``[study.parameters]``, which sets several linked values.
    quantities : sequence of str, or dict of str to callable
        Further quantities, described for `convergence_study`.
    element, formulation : str, optional
        Element type and contact formulation; by default the last of ``study.combinations`` or, without these, those of the
        case.
    level : int, optional
        Number of refinements of the mesh. By default 2 if ``[study]`` defines the meshes of level 0; otherwise the mesh of
        the case is used.
    executor, workers, store, on_progress, progress
        Described for `convergence_study`.

    Returns
    -------
    Sweep

    Raises
    ------
    CaseError, FastcontactError
        If the case, a parameter or a value is invalid, or the model could not be solved for any combination.

    Examples
    --------
    >>> import fastcontact as fc
    >>> def block(nu):
    ...     model = fc.Model(fc.generate.block(), kinematics="plane_strain")
    ...     model.add_material(fc.LinearElastic(E=1000.0, nu=nu))
    ...     model.fix("LEFT", "x")
    ...     obstacle = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    ...     model.add_obstacle("floor", secondary="BOTTOM", obstacle=obstacle)
    ...     model.prescribe("TOP", y=-0.001)
    ...     return fc.solve(model, 1)
    >>> sweep = fc.parameter_sweep(block, [0.0, 0.3])
    >>> [round(point.values["force"], 6) for point in sweep.points]
    [1.0, 1.098901]
    """
    options: dict[str, Any] = {"executor": executor, "workers": workers, "store": store}
    options |= {"on_progress": on_progress, "progress": progress}
    if callable(case):
        functions.refuse({"element": element, "formulation": formulation, "level": level})
        return _of_function(case, parameters, quantities, options)
    if not isinstance(parameters, Mapping) or isinstance(quantities, Mapping):
        raise CaseError("values without a name and functions as quantities are for Python models; a case takes names")
    case = case if isinstance(case, Case) else read_case(case)
    choices = _choices(parameters)
    names = tuple(dict.fromkeys((*settings(case).quantities, *quantities)))
    check_names(case, names)
    jobs = [_job(case, choice, element, formulation, level) for choice in choices]
    # Building one case in advance finds unknown keys, with which every run would fail.
    build_case(jobs[0].data, name=case.name, folder=case.folder, mesh=case.mesh)
    results = run_study(jobs, "no point of the sweep could be solved", **options)
    return Sweep(
        **of_case(case),
        **_points(parameters, choices, results),
        combination=str(jobs[0].marks["combination"]),
        theories=_theory_curves(case, parameters, jobs[0].pair),
        asked=names,
        compared="at equal approach" if jobs[0].pair in case.approach else "",
    )


def _of_function(
    function: Function,
    parameters: Mapping[str, Sequence[Value]] | Sequence[Value],
    wanted: Quantities,
    options: dict[str, Any],
) -> Sweep:
    """Return the sweep of a function that returns models; `options` are passed to `run_functions`."""
    named = isinstance(parameters, Mapping)
    by_name = parameters if isinstance(parameters, Mapping) else {functions.first_parameter(function): [*parameters]}
    choices, name, measures = _choices(by_name), functions.function_name(function), functions.measures_of(wanted)
    runs = [
        FunctionRun(
            label=label_of(choice), name=name, marks=choice, function=function,
            positional=() if named else tuple(choice.values()), named=choice if named else {}, measures=measures,
        )
        for choice in choices
    ]  # fmt: skip
    results = functions.run_functions(runs, "no point of the sweep could be solved", **options)
    points = _points(by_name, choices, results)
    return Sweep(
        **functions.of_function(function, results), **points, combination=name, asked=tuple(wanted), compared=""
    )


def _choices(parameters: Mapping[str, Sequence[Value]]) -> list[dict[str, Value]]:
    """Return all combinations of the values, in which the last parameter varies fastest.

    CaseError if there are no combinations, or too many.
    """
    if not parameters or not all(len(values) for values in parameters.values()):
        raise CaseError("a sweep needs at least one parameter with at least one value")
    check_runs(prod(len(values) for values in parameters.values()))
    return [dict(zip(parameters, values, strict=True)) for values in itertools.product(*parameters.values())]


def _points(
    parameters: Mapping[str, Sequence[Value]], choices: Sequence[dict[str, Value]], results: Sequence[Result]
) -> dict[str, Any]:
    """Return the fields of a `Sweep` that describe its parameters and points."""
    runs = list(zip(choices, results, strict=True))
    return {
        "parameters": {name: tuple(values) for name, values in parameters.items()},
        "points": [Point(parameters=choice, **fields_of(Point, r)) for choice, r in runs if "error" not in r],
        "failed": [(choice, str(result["error"])) for choice, result in runs if "error" in result],
    }


def _theory_curves(case: Case, parameters: Mapping[str, Sequence[Value]], pair: str | None) -> tuple[TheoryCurve, ...]:
    """Return the theory of a contact pair as a function of the first parameter, for each choice of the other parameters."""
    (first, values), *others = parameters.items()
    numbers = [float(value) for value in values if not isinstance(value, (str, bool))]
    if len(numbers) < len(values) or min(numbers) == max(numbers):
        return ()
    low, high = min(numbers), max(numbers)
    x = np.geomspace(low, high, CURVE) if low > 0 else np.linspace(low, high, CURVE)
    data = data_of(case)
    linked = data.get("study", {}).get("parameters", {})
    curves = []
    for choice in itertools.product(*(values_of_other for _, values_of_other in others)):
        rest = dict(zip((name for name, _ in others), choice, strict=True))
        rows = [_theory_at(data, {first: float(value), **rest}, linked, pair) for value in x]
        known = [name for name in rows[0] if all(name in row for row in rows)]
        columns = {name: np.array([row[name] for row in rows]) for name in known}
        curves.append(TheoryCurve(label_of(rest), x, columns))
    return tuple(curves)


def _theory_at(
    data: dict[str, Any], choice: Mapping[str, Value], linked: Mapping[str, Any], pair: str | None
) -> dict[str, float]:
    """Return the quantities of the theory of a contact pair for a choice of parameters; empty if it is undefined there."""
    for parameter, value in choice.items():
        data = substituted(data, parameter, value, linked)
    try:
        theories = described(data)["theories"].get(pair or "", {})
    except FastcontactError:  # for example because Poisson's ratio is outside the range of the theory
        return {}
    return of_theory(theories.get("theory"), theories.get("share", 1.0))


def _job(case: Case, choice: dict[str, Value], element: str | None, formulation: str | None, level: int | None) -> Job:
    data = data_of(case)
    linked = data.get("study", {}).get("parameters", {})
    for parameter, value in choice.items():
        data = substituted(data, parameter, value, linked)
    chosen = settings(case, data)
    member = one_combination(chosen, element, formulation)
    finer = (LEVEL if chosen.by_shape else 0) if level is None else level
    # The runs with the largest meshes start first. With a generator, the size of a run is the number of points on level 0.
    size = make_mesh(recipe(chosen, member.element, 0), None).n_points if chosen.generator is not None else 0
    marks = {**choice, "combination": f"{member}, level {finer}"}
    return job_of(case, chosen, member, finer, label=label_of(choice), marks=marks, size=size)
