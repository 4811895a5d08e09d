"""The ramp: load steps one after the other, from the beginning or where others stopped, each handed over when it is done."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fastcontact.analysis import restart, result_warnings, step_halving
from fastcontact.analysis.analysis import Analysis
from fastcontact.analysis.criteria import Criteria
from fastcontact.errors import warn
from fastcontact.model import warnings
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp, linear_ramp
from fastcontact.results.step import StepResult


def solve(
    model: Model,
    ramp: Ramp | None = None,
    *,
    linear_solver: str = "auto",
    linear_tolerance: float = 1e-10,
    linear_precision: str | None = None,
    criteria: Criteria | None = None,
    on_step: Callable[[StepResult], None] | None = None,
    resume: Sequence[StepResult] = (),
) -> list[StepResult]:
    """Solve a model along a load ramp, from its beginning or after steps that are there already.

    Parameters
    ----------
    model : Model
        Checked whole before any numerics.
    ramp : Ramp, optional
        By default 20 equal steps.
    linear_solver : str
        ``"direct"``, ``"cholmod"``, ``"amg"``, ``"pyamg"`` or ``"auto"``; see `linear.choice.make`.
    linear_tolerance : float
        Relative residual of iterative linear solvers.
    linear_precision : {"single", "double"}, optional
        Of the numbers inside the multigrid cycle, single by default; the solution is in double precision always.
    criteria : Criteria, optional
        Convergence criteria and the handling of the geometry.
    on_step : callable, optional
        Called with every new `StepResult` as soon as its step has converged, e.g. ``ResultWriter.write``. To keep only
        some of the steps in memory, see `solve_steps`.
    resume : sequence of StepResult
        Steps of the same case to go on after: what `solve` returned, ``open_results(path)`` or ``ResultWriter.done``;
        none by default. The analysis goes on with the instants of the ramp after the last of them and ends as if it had
        never stopped. Linear solver, tolerances and limits may be others, and so may the ramp from there on.

    Returns
    -------
    list of StepResult
        Those to go on after, and the new ones. Of all these only the last one keeps its `restart`.

    Raises
    ------
    MeshError, ModelError, ContactError
        If the model is wrong, or is another one than that of the steps to go on after.
    ConvergenceError
        If a step does not converge, nor in parts (`Criteria.max_halvings`); steps before it have been handed to
        `on_step`.

    Warns
    -----
    FastcontactWarning
        At the beginning, if the model is doubtful: units that slipped, poor cells, integrals that are not exact, nodes
        that coincide. At the end, if bodies interpenetrate where no contact is defined, a contact never closed, was lost
        or is not resolved by the mesh, a penalty lets it penetrate by more than 1 % of the largest displacement, strains
        or rotations leave the range of linear kinematics, or a fixed number of geometry updates was too small. The
        results of the first and of the last step keep the texts.
    """
    steps = list(resume)
    for step in solve_steps(
        model, ramp, linear_solver=linear_solver, linear_tolerance=linear_tolerance, linear_precision=linear_precision,
        criteria=criteria, resume=steps,
    ):  # fmt: skip
        if on_step is not None:
            on_step(step)
        if steps and steps[-1].restart is not None:
            steps[-1] = replace(steps[-1], restart=None)
        steps.append(step)
    return steps


def solve_steps(
    model: Model,
    ramp: Ramp | None = None,
    *,
    linear_solver: str = "auto",
    linear_tolerance: float = 1e-10,
    linear_precision: str | None = None,
    criteria: Criteria | None = None,
    resume: Sequence[StepResult] = (),
) -> Iterator[StepResult]:
    """Solve a model step by step: a new step is computed when it is asked for, and none is kept.

    Of a long analysis `solve` returns all steps, 80 bytes a point and step in 2D, 120 in 3D. Here what the caller keeps
    stays in memory, and an analysis may be ended at any step. Parameters, errors and warnings are those of `solve`; a
    wrong model is told at once.

    Returns
    -------
    iterator of StepResult
        The new steps, each with its `restart`.

    Examples
    --------
    >>> for step in solve_steps(model):  # doctest: +SKIP
    ...     out.write(step)
    """
    ramp, criteria = ramp or linear_ramp(), criteria or Criteria()
    case = restart.identity(model, ramp, criteria)
    last = resume[-1] if len(resume) else None
    if last is not None:
        restart.check(last, case)
    instants = restart.remaining(ramp, last)
    if not instants:
        return iter(())
    model.check(ramp)
    prepare = partial(Analysis, model, linear_solver, linear_tolerance, criteria, ramp, linear_precision)
    touched = {name: True for step in resume for name, found in step.contact.items() if found.active.any()}
    return _marched(model, prepare, instants, case, last, touched)


def _marched(
    model: Model, prepare: Callable[[], Analysis], instants: list[float], case: dict[str, Any], last: StepResult | None,
    touched: dict[str, bool],
) -> Iterator[StepResult]:  # fmt: skip
    """Yield the steps at `instants`, the first of them after `last`; `touched` are the pairs that closed before."""
    doubtful = warnings.doubts(model)
    for text in doubtful if last is None else ():
        warn(text)
    analysis = prepare()
    analysis.touched = touched
    begin, before = analysis.ramp.table[0][0], 0
    if last is not None:
        restart.put_back(analysis, last)
        begin, before, last = last.load_factor, last.index, None  # kept no longer
    for index, instant in enumerate(instants, start=before + 1):
        step = step_halving.advance(analysis, index, begin, instant, analysis.criteria.max_halvings)
        found = result_warnings.at_the_end(analysis, step) if instant == instants[-1] else []
        for text in found:
            warn(text)
        told = (*doubtful * (index == 1), *found)
        yield replace(step, warnings=told, restart=restart.taken(analysis, case))
        del step  # before the next one is computed
        begin = instant
