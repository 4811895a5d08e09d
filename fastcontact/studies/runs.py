"""Studies with many runs: mesh convergence with extrapolated limits, and sweeps over values of parameters."""

from __future__ import annotations

import inspect
import itertools
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import replace
from functools import partial
from itertools import pairwise
from math import prod
from multiprocessing.reduction import ForkingPickler
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact import analytic
from fastcontact._tools.argument_types import typed
from fastcontact.cases.case import Case, build_case, read_case, stored_description
from fastcontact.errors import CaseError, FastcontactError, check_known, unknown, warn
from fastcontact.results.units import known_units
from fastcontact.studies.case_parameters import substitute
from fastcontact.studies.checks import check_levels, check_runs
from fastcontact.studies.convergence_report import Study
from fastcontact.studies.execute import Progress, Result, run_study
from fastcontact.studies.fit import Limit, fit_limit
from fastcontact.studies.job import Function, FunctionRun, Job, Measure, Quantities, fields_of, first_parameter, job_of
from fastcontact.studies.quantities import LABELS, check_names, theory_quantities
from fastcontact.studies.report import report_fields
from fastcontact.studies.series import Level, Point, Series, TheoryCurve, Value
from fastcontact.studies.settings import (
    Combination,
    Settings,
    combinations,
    data_of,
    make_mesh,
    matching_combination,
    recipe,
    settings,
)
from fastcontact.studies.sweep_report import Sweep, abscissa_of, label_of
from fastcontact.studies.swept_keys import Choice, check_swept_keys


@typed(CaseError)
def convergence_study(
    case: Case | str | Path | Function,
    levels: int | Sequence[float] = 5,
    elements: Sequence[str] | None = None,
    formulations: Sequence[str] | None = None,
    *,
    quantities: Quantities = (),
    theory: Mapping[str, float] | None = None,
    executor: Executor | None = None,
    workers: int | None = None,
    store: str | Path | None = None,
    on_progress: Callable[[Progress], None] | None = None,
    progress: bool = False,
) -> Study:
    """Solve a case or a Python model on successively finer meshes, and fit limits and orders of convergence.

    The limits give the mesh error of every quantity and, if a theory is known, the model error. The meshes of a case are
    generated with sizes that are halved from level to level, or result from uniform refinement of its mesh file, in which new
    nodes on circular boundaries are placed on the circle. The table ``[study]`` of a case file contains the settings. A
    function generates its meshes itself.

    Parameters
    ----------
    case : Case, path-like or callable
        A case, the path of a case file, or a function. The function receives the mesh size and returns a `Model`, which is
        solved in 20 equal steps, or the result of `solve`.
    levels : int or sequence of float
        For a case, the number of meshes: at least three for a limit, and five for a reliable error bar. For a function, the
        mesh sizes [length], which are passed to it in descending order and may be any lengths proportional to the edges.
    elements, formulations : sequence of str, optional
        Element types and contact formulations of a case, which are compared in all combinations; ``["all"]`` selects every
        supported one. By default those of ``[study]`` or, without this table, those of the case.
    quantities : sequence of str, or dict of str to callable
        Further quantities, in addition to the standard ones. For a case, their names, such as ``"C1.stress.yy"``,
        ``"C1.displacement.y"`` and ``"C1.pressure"`` at the point group C1. For a function, names of standard quantities,
        or a mapping of names to functions. Such a function receives the last `StepResult`, or the list of all steps if its
        argument is called ``steps``, and returns a number.
    theory : dict of str to float, optional
        Theoretical values of quantities of a function, by their names. A case has its theory in the table ``[theory.PAIR]``.
    executor : concurrent.futures.Executor, optional
        Executor of the runs, for example ``Client.get_executor()`` of Dask or an ``MPIPoolExecutor`` of mpi4py; it is not
        shut down. By default the runs of a case are executed in processes on this machine, those of a function in the
        calling process.
    workers : int, optional
        Number of processes; by default one for each processor, and 1 for a function. With 1 all runs are executed in the
        calling process. Each of several processes imports the calling script, which must therefore call this function under
        ``if __name__ == "__main__":``.
    store : path-like, optional
        Folder with the results of finished runs of a case. Stored results are reused, and new ones are added.
    on_progress : callable, optional
        Function that is called with a `Progress` after every run.
    progress : bool
        If true, show the progress on standard error, in terminals and notebooks.

    Returns
    -------
    Study

    Raises
    ------
    CaseError, FastcontactError
        If the case, a name or a number is invalid, or if no mesh of any combination could be solved.

    Warns
    -----
    FastcontactWarning
        If the meshes of a function do not become finer with decreasing mesh size.

    Examples
    --------
    >>> import fastcontact as fc
    >>> def squeezed(size):
    ...     n = round(1 / size)
    ...     model = fc.Model(fc.generate.block(divisions=(n, n)), kinematics="plane_strain")
    ...     model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    ...     model.fix("BOTTOM", "xy")
    ...     model.prescribe("TOP", y=-0.01)
    ...     return fc.solve(model, 1)
    >>> bulge = {"bulge": lambda step: step.displacement[:, 0].max()}
    >>> study = fc.convergence_study(squeezed, [0.5, 0.25, 0.125], quantities=bulge)  # doctest: +SKIP
    >>> study.best.limits["bulge"].value, study.best.limits["bulge"].uncertainty  # doctest: +SKIP
    """
    options: dict[str, Any] = {"executor": executor, "workers": workers, "store": store}
    options |= {"on_progress": on_progress, "progress": progress}
    if callable(case):
        refuse_case_options({"elements": elements, "formulations": formulations})
        return _study_of_function(case, levels, quantities, theory or {}, options)
    if not isinstance(levels, int | np.integer) or isinstance(quantities, Mapping) or theory is not None:
        raise CaseError(
            "mesh sizes, functions as quantities and 'theory' are only for Python models: give a case its number of levels, "
            "and its theory in the table [theory.PAIR]"
        )
    case = case if isinstance(case, Case) else read_case(case)
    if levels < 1:
        raise CaseError(f"levels = {levels} must be at least 1; an extrapolated limit needs 3")
    setup = settings(case)
    check_names(case, [*setup.quantities, *quantities])
    selected = combinations(setup, elements, formulations)
    check_runs(levels * len(selected))
    check_levels(case, setup, selected, levels)
    jobs = [level_job(case, setup, combination, level) for level in range(levels) for combination in selected]
    results = run_study(jobs, "no level could be solved", **options)
    return study_of_runs(case, jobs, results, [*setup.quantities, *quantities])


def _study_of_function(
    function: Function, sizes: int | Sequence[float], quantities: Quantities, theory: Mapping[str, float], options: Any
) -> Study:
    """Return the convergence study of a function that returns models; `options` are passed to `run_functions`."""
    for quantity, value in theory.items():
        check_known("quantity", quantity, [*LABELS, *quantities], CaseError, "theory: ")
        if not np.isfinite(value):
            raise CaseError(f"theory: the value {value} of '{quantity}' is not a finite number: leave it out")
    if isinstance(sizes, int | np.integer):
        raise CaseError(f"a study of a function needs its mesh sizes, such as [4.0, 2.0, 1.0], not {sizes} levels")
    descending = sorted(map(float, sizes), reverse=True)
    if not descending or len({*descending}) < len(descending) or not (descending[-1] > 0 and descending[0] < np.inf):
        raise CaseError(f"the mesh sizes must be positive and all different, not {[*sizes]}")
    name, measures, parameter = function_name(function), measures_of(quantities), first_parameter(function)
    runs = [
        FunctionRun(
            label=f"{parameter} = {size:g}", name=name, marks={"level": level}, size=level, measures=measures,
            function=partial(function, size),
        )
        for level, size in enumerate(descending)
    ]  # fmt: skip
    results = run_functions(runs, "no size could be solved", **options)
    solved = [(level, {**result, "h": descending[level], "theory": {**theory}}) for level, result in enumerate(results)]
    no_theory = None, 1.0, "under the given load"
    series = _series(Combination(None, None, name), solved, [*quantities], (), no_theory, asked=tuple(quantities))
    for coarse, fine in pairwise(series.levels):
        if fine.n_dofs <= coarse.n_dofs:
            warn(
                f"the mesh of size {fine.h:g} has {fine.n_dofs} degrees of freedom, that of size {coarse.h:g} has "
                f"{coarse.n_dofs}: sizes must decrease as meshes become finer, "
                "otherwise limits and orders of convergence are meaningless"
            )
            break
    return Study(**function_fields(function, results), series=[series], failed={}, theory=None)


def level_job(case: Case, setup: Settings, combination: Combination, level: int) -> Job:
    """Return the job that solves a case with one element type and formulation on the mesh of one level."""
    marks = {"level": level, "element": combination.element, "formulation": combination.formulation}
    return job_of(case, setup, combination, level, label=f"{combination} level {level}", marks=marks, size=level)


def study_of_runs(case: Case, jobs: Sequence[Job], results: Sequence[Result], requested: Sequence[str]) -> Study:
    """Return the study of finished runs.

    The quantities in `requested` are fitted in addition to the standard quantities and to those of the checks of probes.
    """
    by_combination: dict[Combination, list[tuple[int, Result]]] = {}
    for job, result in zip(jobs, results, strict=True):
        combination = Combination(job.marks["element"], job.marks["formulation"])
        by_combination.setdefault(combination, []).append((job.marks["level"], result))
    checked = [name for check in case.checks if (name := check.quantity).partition(".")[0] in case.probes]
    theories = case.theories.get(settings(case).pair or "", {})
    theory, share = theories.get("theory"), theories.get("share", 1.0)
    compared = "at equal approach" if settings(case).pair in case.approach else "under the given load"
    series, failed = [], {}
    for combination, runs in by_combination.items():
        if all("error" in result for _, result in runs):
            failed[str(combination)] = str(runs[0][1]["error"])
        else:
            series.append(_series(combination, runs, requested, checked, (theory, share, compared)))
    return Study(**report_fields(case), series=series, failed=failed, theory=theory)


def _series(
    combination: Combination, results: list[tuple[int, Result]], requested: Sequence[str], checked: Sequence[str],
    theory: tuple[Any, float, str], asked: tuple[str, ...] = (),
) -> Series:  # fmt: skip
    """Return the series of one element type and formulation with its limits.

    The quantities in `requested` must be in the results; those in `checked` are fitted if they are. The attribute
    `Series.asked` is `asked`. `theory` consists of the theory of the contact pair, the fraction of the contact that the model
    represents, and the condition under which both are compared (see `Series.compared`).
    """
    solved = [(number, result) for number, result in results if "error" not in result]
    levels = [Level(number=number, **fields_of(Level, result)) for number, result in solved]
    finest = levels[-1].values
    for name in requested:
        check_known("quantity", name, finest, CaseError)
    names = tuple(dict.fromkeys(name for name in (*LABELS, *checked, *requested) if name in finest))
    limits = {name: limit for name in names if (limit := _limit(levels, name)) is not None}
    failed = {number: str(result["error"]) for number, result in results if "error" in result}
    at_force, spread = _theory_at_force(*theory[:2], limits.get("force"))
    last = {key: solved[-1][1][key] for key in ("theory", "reference")}
    # These theories are exact for the bodies of the model, unlike those of half-spaces or beams.
    exact = isinstance(theory[0], (analytic.PressFit, analytic.HertzBox))
    return Series(
        combination, levels, failed, **last, equal_force=at_force, equal_force_spread=spread, quantities=names, limits=limits,
        exact_theory=exact, share=theory[1], compared=theory[2], asked=asked,
    )  # fmt: skip


def _theory_at_force(theory: Any, share: float, force: Limit | None) -> tuple[dict[str, float], dict[str, float]]:
    """Return the values of the theory at the limit of the force, and their variation within the error bar of the force."""
    if force is None or not force.value > force.uncertainty or not hasattr(theory, "at_force"):
        return {}, {}
    forces = force.value, force.value + force.uncertainty
    values, upper = (theory_quantities(theory.at_force(value / share), share) for value in forces)
    return values, {name: abs(upper[name] - value) for name, value in values.items()}


def _limit(levels: Sequence[Level], quantity: str) -> Limit | None:
    """Return the limit of a quantity, or None if it is known on fewer than three levels or if mesh sizes coincide.

    The error bar of a quantity that is only known at nodes is at least half the distance between them on the finest mesh.
    """
    values = [(level.h, level.values[quantity]) for level in levels if quantity in level.values]
    if len({h for h, _ in values}) < max(3, len(values)):
        return None
    limit = fit_limit(*zip(*values, strict=True))
    return replace(limit, uncertainty=max(limit.uncertainty, levels[-1].spacings.get(quantity, 0.0)))


# Default refinement level of the meshes of a sweep. Mesh errors of this level are usually smaller than the trends of
# interest.
DEFAULT_LEVEL = 2
# Number of points of a curve of the theory.
CURVE_POINTS = 60


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
        of the first argument. A parameter of a case is the path of a number or a string in the case file, such as
        ``"contact.hertz.friction"``, ``"material[0].E"`` or ``"mesh.element"``, where tables in a list are numbered from 0.
        It can also be a name in ``[study.parameters]``, which sets several linked values.
    quantities : sequence of str, or dict of str to callable
        Further quantities, described for `convergence_study`.
    element, formulation : str, optional
        Element type and contact formulation; by default those of the last combination in ``study.combinations`` or, without
        this key, those of the case.
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
        If the case, a parameter or a value is invalid, if the runs do not read a parameter, for example because ``[study]``
        replaces it, or if the model could not be solved for any combination.

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
        refuse_case_options({"element": element, "formulation": formulation, "level": level})
        return _sweep_of_function(case, parameters, quantities, options)
    if not isinstance(parameters, Mapping) or isinstance(quantities, Mapping):
        raise CaseError(
            "values without a name and functions as quantities are only for Python models: for a case, give names of both"
        )
    case = case if isinstance(case, Case) else read_case(case)
    choices = _choices(parameters)
    names = tuple(dict.fromkeys((*settings(case).quantities, *quantities)))
    check_names(case, names)
    job_of_choice = partial(_job, case, element=element, formulation=formulation, level=level)
    jobs = [job_of_choice(choice) for choice in choices]
    check_swept_keys(choices, jobs, partial(job_of_choice, sized=False), data_of(case))
    # The first case, or the first with a theory, is built in advance, because an invalid key would make every run fail.
    first = next((job for job in jobs if _theory_at(job.data, job.pair)), jobs[0])
    build_case(first.data, name=case.name, folder=case.folder, mesh=case.mesh)
    results = run_study(jobs, "no point of the sweep could be solved", **options)
    return Sweep(
        **report_fields(case),
        **_sweep_fields(parameters, choices, results),
        combination="; ".join(dict.fromkeys(str(job.marks["combination"]) for job in jobs)),
        theories=_theory_curves(case, parameters, jobs[0].pair),
        asked=names,
        compared="at equal approach" if jobs[0].pair in case.approach else "",
    )


def _sweep_of_function(
    function: Function,
    parameters: Mapping[str, Sequence[Value]] | Sequence[Value],
    quantities: Quantities,
    options: Any,
) -> Sweep:
    """Return the sweep of a function that returns models; `options` are passed to `run_functions`."""
    named = isinstance(parameters, Mapping)
    values = parameters if isinstance(parameters, Mapping) else {first_parameter(function): [*parameters]}
    choices, name, measures = _choices(values), function_name(function), measures_of(quantities)
    calls = (partial(function, **choice) if named else partial(function, *choice.values()) for choice in choices)
    runs = [
        FunctionRun(label=label_of(choice), name=name, marks=choice, measures=measures, function=call)
        for choice, call in zip(choices, calls, strict=True)
    ]
    results = run_functions(runs, "no point of the sweep could be solved", **options)
    points = _sweep_fields(values, choices, results)
    if not measures.keys().isdisjoint(LABELS):  # functions may evaluate other pairs
        points["pairs"] = ()
    return Sweep(**function_fields(function, results), **points, combination=name, asked=tuple(quantities), compared="")


def _choices(parameters: Mapping[str, Sequence[Value]]) -> list[dict[str, Value]]:
    """Return all combinations of the values; the last parameter varies fastest. Raises CaseError for none or too many."""
    if not parameters or not all(len(values) for values in parameters.values()):
        raise CaseError("a sweep needs at least one parameter with at least one value")
    check_runs(prod(len(values) for values in parameters.values()))
    return [dict(zip(parameters, values, strict=True)) for values in itertools.product(*parameters.values())]


def _sweep_fields(
    parameters: Mapping[str, Sequence[Value]], choices: Sequence[dict[str, Value]], results: Sequence[Result]
) -> dict[str, Any]:
    """Return the fields of a `Sweep` that describe its parameters and points."""
    runs = list(zip(choices, results, strict=True))
    return {
        "parameters": {name: tuple(values) for name, values in parameters.items()},
        "points": [Point(parameters=choice, **fields_of(Point, r)) for choice, r in runs if "error" not in r],
        "failed": [(choice, str(result["error"])) for choice, result in runs if "error" in result],
        "pairs": next((tuple(result["pairs"]) for result in results if "pairs" in result), ()),
    }


def _theory_curves(case: Case, parameters: Mapping[str, Sequence[Value]], pair: str | None) -> tuple[TheoryCurve, ...]:
    """Return curves of the theory of a contact pair over the plotted parameter, one for each choice of the others.

    There are none if the values of this parameter are not numbers or are all equal.
    """
    abscissa, varied = abscissa_of(parameters)
    values, others = parameters[abscissa], {name: parameters[name] for name in parameters if name != abscissa}
    numbers = [float(value) for value in values if not isinstance(value, (str, bool))]
    if len(numbers) < len(values) or min(numbers) == max(numbers):
        return ()
    low, high = min(numbers), max(numbers)
    x = np.geomspace(low, high, CURVE_POINTS) if low > 0 else np.linspace(low, high, CURVE_POINTS)
    data, curves = data_of(case), []
    for choice in (dict(zip(others, values, strict=True)) for values in itertools.product(*others.values())):
        rows = [_theory_at(substitute(data, {abscissa: float(value), **choice}), pair) for value in x]
        names = [name for name in rows[0] if all(name in row for row in rows)]
        theory = {name: np.array([row[name] for row in rows]) for name in names}
        curves.append(TheoryCurve(label_of(choice, varied), x, theory))
    return tuple(curves)


def _theory_at(data: dict[str, Any], pair: str | None) -> dict[str, float]:
    """Return the quantities of the theory of a contact pair of a parsed case file; empty if it is undefined."""
    try:
        theories = stored_description(data)["theories"].get(pair or "", {})
    except FastcontactError:  # for example because Poisson's ratio is outside the range of the theory
        return {}
    return theory_quantities(theories.get("theory"), theories.get("share", 1.0))


def _job(
    case: Case, choice: Choice, *, element: str | None, formulation: str | None, level: int | None, sized: bool = True
) -> Job:
    """Return the job that solves a case for one choice of parameter values; if it is not `sized`, its size is 0."""
    setup = settings(case, substitute(data_of(case), choice))
    combination = matching_combination(setup, element, formulation)
    level = (DEFAULT_LEVEL if setup.by_shape else 0) if level is None else level
    # Runs with the largest meshes start first, according to the number of points on level 0.
    sized = sized and setup.generator is not None
    size = make_mesh(recipe(setup, combination.element, 0), None).n_points if sized else 0
    marks = {**choice, "combination": f"{combination}, level {level}"}
    return job_of(case, setup, combination, level, label=label_of(choice), marks=marks, size=size)


def function_name(function: Function) -> str:
    """Return the name of a function for tables and messages."""
    return str(getattr(function, "__name__", type(function).__name__))


def function_fields(function: Function, results: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the fields of a `Report` that describe a function: name, title, source text, and units of the `results`."""
    try:
        text = inspect.getsource(function)
    except (OSError, TypeError):
        text = ""
    name, units = function_name(function), next((result["units"] for result in results if result.get("units")), None)
    title = (inspect.getdoc(function) or name).partition("\n")[0]
    return {"name": name, "title": title, "text": text, "units": known_units(units or {})}


def measures_of(quantities: Quantities) -> dict[str, Measure]:
    """Return the quantities that are given as functions; CaseError if an unknown name is given instead."""
    if isinstance(quantities, Mapping):
        return dict(quantities)
    for name in quantities:
        if name not in LABELS:
            raise CaseError(
                unknown("quantity", name, LABELS)
                + "; others are given as functions of the last step, such as quantities={'top': lambda step: ...}"
            )
    return {}


def refuse_case_options(options: Mapping[str, Any]) -> None:
    """Raise CaseError if one of these options, which only apply to case files, is not None."""
    for name, value in options.items():
        if value is not None:
            raise CaseError(
                f"leave out '{name}', which is only for case files: a function defines its mesh and its contact itself"
            )


def run_functions(
    runs: Sequence[FunctionRun], failure: str, *, executor: Executor | None, workers: int | None, **options: Any
) -> list[dict[str, Any]]:
    """Return the results of `run_study`; by default the runs are executed one after the other in this process."""
    if (executor is not None or (workers or 1) > 1) and not isinstance(executor, ThreadPoolExecutor):
        _check_picklable(runs[0])
    return run_study(runs, failure, executor=executor, workers=workers or 1, **options)


def _check_picklable(run: FunctionRun) -> None:
    """Raise CaseError if a function cannot be sent to another process or cannot be imported there."""
    try:
        if any(function.__module__ == "__main__" for function in (run.function.func, *run.measures.values())):
            inspect.getfile(sys.modules["__main__"])  # TypeError without a file, as in notebooks
        ForkingPickler.dumps(run)
    except Exception as error:
        raise CaseError(
            f"{run.name} or a quantity cannot be sent to other processes ({error}): define functions with names at the top "
            "of a module, or use workers=1"
        ) from error
