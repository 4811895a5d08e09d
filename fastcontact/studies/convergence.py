"""Mesh-convergence studies: solve a case on successively finer meshes, fit the limits, and compare them with a theory."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.cases.case import Case, read_case
from fastcontact.errors import CaseError, check_known, warn
from fastcontact.studies import function_runs as functions
from fastcontact.studies.checks import check_levels, check_runs
from fastcontact.studies.convergence_report import Study
from fastcontact.studies.execute import Progress, Result, run_study
from fastcontact.studies.fit import Limit, fit_limit
from fastcontact.studies.function_runs import Function, FunctionRun, Quantities
from fastcontact.studies.job import Job, fields_of, job_of
from fastcontact.studies.quantities import EXACT_THEORIES, LABELS, check_names, of_theory
from fastcontact.studies.report import of_case
from fastcontact.studies.series import Level, Series
from fastcontact.studies.settings import Combination, Named, Settings, combinations, settings


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

    From the limits follow the mesh error of every quantity and, if a theory is known, the model error. The meshes of a
    case come from its mesh generator, with sizes that are halved from level to level, or from uniform refinement of its
    mesh file, with new nodes on circular arcs placed on these arcs. The table ``[study]`` of a case file contains the
    settings. The meshes of a function are those that it generates.

    Parameters
    ----------
    case : Case, path-like or callable
        A case, the path of a case file, or a function. The function receives the mesh size and returns a `Model`, which is
        solved in 20 equal steps, or the result of `solve`.
    levels : int or sequence of float
        For a case the number of meshes. At least three are required for a limit, and five for a reliable error bar. For a
        function the mesh sizes, which may be any length that tends to zero as the mesh is refined [length].
    elements, formulations : sequence of str, optional
        Element types and contact formulations of a case, which are compared in all combinations; ``["all"]`` stands for all
        of them. By default those of ``[study]`` or, without this table, those of the case.
    quantities : sequence of str, or dict of str to callable
        Further quantities, in addition to the standard ones. For a case, their names, such as ``"C1.stress.yy"``,
        ``"C1.displacement.y"`` and ``"C1.pressure"`` at the point group C1. For a function, names of standard quantities,
        or functions by name. Such a function receives the last `StepResult`, or the list of all steps if its argument is
        called ``steps``, and returns a number.
    theory : dict of str to float, optional
        Theoretical values of quantities of a function, by their names. A case has its theory in the table ``[theory.PAIR]``.
    executor : concurrent.futures.Executor, optional
        Executor of the runs, for example ``Client.get_executor()`` of Dask or an ``MPIPoolExecutor`` of mpi4py; it is not
        shut down. By default the runs are executed in processes on this machine.
    workers : int, optional
        Number of processes; by default one for each processor, and 1 for a function. With 1 all runs are executed in the
        calling process. Several processes import the calling script, which must therefore call this function under
        ``if __name__ == "__main__":``.
    store : path-like, optional
        Folder with the results of finished runs of a case. They are reused, and new results are added.
    on_progress : callable, optional
        Function that is called with a `Progress` after every run.
    progress : bool
        Whether to show the progress on standard error, in terminals and notebooks.

    Returns
    -------
    Study

    Raises
    ------
    CaseError, FastcontactError
        If the case, a name or a number is invalid, or no mesh of any combination could be solved.

    Warns
    -----
    FastcontactWarning
        If the meshes of a function do not become finer with decreasing mesh size.

    Examples
    --------
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
        functions.refuse({"elements": elements, "formulations": formulations})
        return _of_function(case, levels, quantities, theory or {}, options)
    if not isinstance(levels, int | np.integer) or isinstance(quantities, Mapping) or theory is not None:
        raise CaseError(
            "mesh sizes, functions as quantities and theory are for Python models: give a case its number of levels, and its "
            "theory in the table [theory.PAIR]"
        )
    case = case if isinstance(case, Case) else read_case(case)
    if levels < 1:
        raise CaseError(f"levels = {levels} must be at least 1; an extrapolated limit needs 3")
    chosen = settings(case)
    check_names(case, [*chosen.quantities, *quantities])
    members = combinations(chosen, elements, formulations)
    check_runs(levels * len(members))
    check_levels(case, chosen, members, levels)
    jobs = [level_job(case, chosen, member, level) for level in range(levels) for member in members]
    results = run_study(jobs, "no level could be solved", **options)
    return gathered(case, jobs, results, [*chosen.quantities, *quantities])


def _of_function(
    function: Function, sizes: int | Sequence[float], wanted: Quantities, theory: Mapping[str, float], options: Any
) -> Study:
    """Return the study of a function that returns models; `options` are passed to `run_functions`."""
    for quantity in theory:
        check_known("quantity", quantity, [*LABELS, *wanted], CaseError, "theory: ")
    if isinstance(sizes, int | np.integer):
        raise CaseError(f"a study of a function needs its mesh sizes, such as [4.0, 2.0, 1.0], not {sizes} levels")
    descending = sorted(map(float, sizes), reverse=True)
    if not descending or len({*descending}) < len(descending) or not (descending[-1] > 0 and descending[0] < np.inf):
        raise CaseError(f"the mesh sizes must be positive and all different, not {[*sizes]}")
    name, measures = functions.function_name(function), functions.measures_of(wanted)
    argument = functions.first_parameter(function)
    runs = [
        FunctionRun(
            label=f"{argument} = {size:g}", name=name, marks={"level": level}, size=level,
            function=function, positional=(size,), named={}, measures=measures,
        )
        for level, size in enumerate(descending)
    ]  # fmt: skip
    results = functions.run_functions(runs, "no size could be solved", **options)
    solved = [(level, {**result, "h": descending[level], "theory": {**theory}}) for level, result in enumerate(results)]
    series = _series(
        Named(None, None, name), solved, [*wanted], (), (None, 1.0, "under the given load"), asked=tuple(wanted)
    )
    for coarse, fine in pairwise(series.levels):
        if fine.n_dofs <= coarse.n_dofs:
            warn(
                f"the mesh of size {fine.h:g} has {fine.n_dofs} degrees of freedom, that of size {coarse.h:g} has "
                f"{coarse.n_dofs}: sizes must be lengths that shrink as meshes get finer, or limits and orders mean nothing"
            )
            break
    return Study(**functions.of_function(function, results), series=[series], failed={}, theory=None)


def level_job(case: Case, chosen: Settings, member: Combination, level: int) -> Job:
    """Return the job that solves a case with one element type and formulation on the mesh of one level."""
    marks = {"level": level, "element": member.element, "formulation": member.formulation}
    return job_of(case, chosen, member, level, label=f"{member} level {level}", marks=marks, size=level)


def gathered(case: Case, jobs: Sequence[Job], results: Sequence[Result], wanted: Sequence[str]) -> Study:
    """Return the study of finished runs.

    The quantities in `wanted` are fitted in addition to the standard quantities and to those of the checks of the case.
    """
    by_combination: dict[Combination, list[tuple[int, Result]]] = {}
    for job, result in zip(jobs, results, strict=True):
        member = Combination(job.marks["element"], job.marks["formulation"])
        by_combination.setdefault(member, []).append((job.marks["level"], result))
    checked = [check.quantity for check in case.checks]
    theories = case.theories.get(settings(case).pair or "", {})
    theory, share = theories.get("theory"), theories.get("share", 1.0)
    compared = "at equal approach" if settings(case).pair in case.approach else "under the given load"
    series, failed = [], {}
    for member, runs in by_combination.items():
        if all("error" in result for _, result in runs):
            failed[str(member)] = str(runs[0][1]["error"])
        else:
            series.append(_series(member, runs, [*wanted], checked, (theory, share, compared)))
    return Study(**of_case(case), series=series, failed=failed, theory=theory)


def _series(
    member: Combination,
    results: list[tuple[int, Result]],
    wanted: Sequence[str],
    checked: Sequence[str],
    theory: tuple[Any, float, str],
    asked: tuple[str, ...] = (),
) -> Series:
    """Return the series of one element type and formulation with its limits.

    Quantities in `checked` are fitted if the results contain them. `theory` consists of the theory of the contact pair, the
    fraction of the contact that the model represents, and the condition of the comparison (see `Series.compared`).
    """
    solved = [(number, result) for number, result in results if "error" not in result]
    levels = [Level(number=number, **fields_of(Level, result)) for number, result in solved]
    known = levels[-1].values
    for name in wanted:
        check_known("quantity", name, known, CaseError)
    names = tuple(dict.fromkeys(name for name in (*LABELS, *checked, *wanted) if name in known))
    limits = {name: limit for name in names if (limit := _limit(levels, name)) is not None}
    failed = {number: str(result["error"]) for number, result in results if "error" in result}
    at_force, spread = _at_force(*theory[:2], limits.get("force"))
    last = {key: solved[-1][1][key] for key in ("theory", "reference")}
    return Series(
        member, levels, failed, **last, equal_force=at_force, equal_force_spread=spread, quantities=names, limits=limits,
        exact_theory=isinstance(theory[0], EXACT_THEORIES), share=theory[1], compared=theory[2], asked=asked,
    )  # fmt: skip


def _at_force(theory: Any, share: float, force: Limit | None) -> tuple[dict[str, float], dict[str, float]]:
    """Return the values of the theory at the limit of the force, and their variation within the error bar of the force."""
    if force is None or not force.value > force.uncertainty or not hasattr(theory, "at_force"):
        return {}, {}
    middle, upper = (of_theory(theory.at_force((force.value + off) / share), share) for off in (0.0, force.uncertainty))
    return middle, {name: abs(upper[name] - value) for name, value in middle.items()}


def _limit(levels: Sequence[Level], quantity: str) -> Limit | None:
    known = [(level.h, level.values[quantity]) for level in levels if quantity in level.values]
    if len({h for h, _ in known}) < max(3, len(known)):
        return None
    return fit_limit(*zip(*known, strict=True))
