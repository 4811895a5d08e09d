"""Run an analysis: solve its load steps in order, from the undeformed state or from the last step of an earlier run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from fastcontact._jit import ahead
from fastcontact._tools.argument_types import typed
from fastcontact.analysis import restart, step_halving
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.interpenetration import Peak
from fastcontact.analysis.problem import Problem, linear_with_quadratic_cells, prepare
from fastcontact.analysis.progress import Progress
from fastcontact.analysis.result_warnings import coarse_contacts, result_warnings
from fastcontact.analysis.stages import next_stage, stage_of
from fastcontact.errors import ModelError, warn
from fastcontact.linear.choice import automatic_choice, check_solver, check_tolerance
from fastcontact.linear.protocol import TOLERANCE
from fastcontact.model.model import Model
from fastcontact.model.model_warnings import model_warnings
from fastcontact.model.ramp import Ramp, RampLike, ramp_of
from fastcontact.results.step import StepResult, Steps, coarse_contact_notes


@typed(ModelError)
def solve(
    model: Model,
    ramp: RampLike | None = None,
    *,
    linear_solver: str = "auto",
    linear_tolerance: float = TOLERANCE,
    linear_precision: str | None = None,
    criteria: Criteria | None = None,
    on_step: Callable[[StepResult], None] | None = None,
    resume: Sequence[StepResult] = (),
    progress: bool = False,
) -> Steps:
    """Solve a model along a load ramp, from its beginning or from the last step of an earlier analysis.

    Parameters
    ----------
    model : Model
    ramp : Ramp, int or array, optional
        One of: the number of equal load steps (20 by default); the load factors (n,) at the ends of the steps [-]; or
        the points (n, 2) of the load function, each of them an instant and a multiplier [-]. Every point but the first
        is the end of a step.
    linear_solver : str
        ``"direct"``, ``"cholmod"``, ``"amg"``, ``"pyamg"`` or ``"auto"``; see `linear.choice.make`.
    linear_tolerance : float
        Relative residual at which iterative linear solvers stop, at most 0.001. `Criteria.relative` replaces it if that
        is smaller.
    linear_precision : {"single", "double"}, optional
        Precision inside the multigrid cycle, by default single; the solution is always in double precision.
    criteria : Criteria, optional
    on_step : callable, optional
        Called with every new `StepResult`, e.g. ``ResultWriter.write``. To keep only some steps, see `solve_steps`.
    resume : sequence of StepResult
        Earlier steps of the same model, after which the analysis continues as if it had not stopped: the value that
        `solve` returned, ``open_results(path)`` or ``ResultWriter.done``. The linear solver, tolerances, limits and the
        remaining ramp may differ from those of the earlier analysis.
    progress : bool
        Show the progress on standard error, updated after every step, also in notebooks.

    Returns
    -------
    Steps
        List of StepResult: the steps of `resume`, then the new ones. Only the last step holds its `restart`, the data
        from which another analysis can continue.

    Raises
    ------
    MeshError, ModelError, ContactError, ConvergenceError
        If the model is invalid, or differs from the model of `resume`; if a step does not converge even after it has been
        halved `Criteria.max_halvings` times. In the latter case `on_step` has received all steps before this one.

    Warns
    -----
    FastcontactWarning
        Before the first step about the model, and after the last step about the result. Each warning states a number
        and is stored in `StepResult.warnings`. Contacts with too few elements across their radius in earlier steps are
        only stated there.

    Examples
    --------
    >>> import fastcontact as fc
    >>> model = fc.Model(fc.generate.half_spheres(size=10.0), kinematics="axisymmetric")
    >>> model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    >>> model.fix("A1A2", "x")
    >>> model.prescribe("A2B2", y=-2.0)
    >>> model.prescribe("A1B1", y=+2.0)
    >>> model.add_contact("hertz", secondary="CONT1", primary="CONT2")
    >>> steps = fc.solve(model, 2)
    >>> [step.load_factor for step in steps]
    [0.5, 1.0]
    """
    steps, ramp = Steps(resume), ramp_of(ramp)
    total = len(steps) + len(restart.remaining(ramp, steps[-1] if steps else None))
    with Progress(total, show=progress, done=len(steps)) as status:
        new_steps = solve_steps(
            model, ramp, linear_solver=linear_solver, linear_tolerance=linear_tolerance,
            linear_precision=linear_precision, criteria=criteria, resume=steps,
        )  # fmt: skip
        for step in new_steps:
            if on_step is not None:
                on_step(step)
            status.step(step)
            if steps and steps[-1].restart is not None:
                steps[-1] = replace(steps[-1], restart=None)
            steps.append(step)
    return steps


@typed(ModelError)
def solve_steps(
    model: Model,
    ramp: RampLike | None = None,
    *,
    linear_solver: str = "auto",
    linear_tolerance: float = TOLERANCE,
    linear_precision: str | None = None,
    criteria: Criteria | None = None,
    resume: Sequence[StepResult] = (),
) -> Iterator[StepResult]:
    """Solve a model step by step: compute each step when it is requested, and keep none in memory.

    `solve` keeps all steps, which take 80 bytes per point and step in 2D and 112 bytes in 3D. With `solve_steps`, only the
    steps that the caller keeps stay in memory, and the caller may stop the analysis after any step. Parameters, errors and
    warnings are those of `solve`. An invalid model raises its error in the call itself, before the first step is requested.

    Returns
    -------
    iterator of StepResult
        The new steps. Each one has its `restart`, the data from which another analysis can continue.

    Examples
    --------
    >>> for step in solve_steps(model):  # doctest: +SKIP
    ...     out.write(step)
    """
    ramp, criteria = ramp_of(ramp), criteria or Criteria()
    check_solver(linear_solver)
    check_tolerance(linear_tolerance)
    case = restart.identity(model, ramp, criteria)
    last = resume[-1] if len(resume) else None
    if last is not None:
        restart.check(last, case, model)
    instants = restart.remaining(ramp, last)
    if not instants:
        return iter(())
    ahead.request_helpers(_kernel_sets(model, linear_solver))
    model.check(ramp)
    prepare_model = partial(
        prepare, ramp=ramp, criteria=criteria, linear_solver=linear_solver, linear_tolerance=linear_tolerance,
        linear_precision=linear_precision,
    )  # fmt: skip
    return _solved_steps(model, ramp, prepare_model, instants, case, last, _peaks(resume))


def _kernel_sets(model: Model, linear_solver: str) -> list[str]:
    """Return the keys of the table in `_jit.ahead` that lists the kernels to compile in advance for a model."""
    dim = model.mesh.dim
    default, _ = automatic_choice(dim, model.mesh.n_points * dim, False, linear_with_quadratic_cells(model))
    multigrid = "amg" in (linear_solver, default if linear_solver == "auto" else "")
    return [f"{dim}d", *([f"{dim}d amg"] if multigrid else [])]


def _peaks(steps: Iterable[StepResult], earlier: Mapping[str, Peak] | None = None) -> dict[str, Peak]:
    """Return, for each contact pair, the data of the step with its largest normal force."""
    peaks = dict(earlier or {})
    for step in steps:
        for name, contact in step.contact.items():
            if name not in peaks or contact.normal_force > peaks[name][2][name].normal_force:
                peaks[name] = step.index, step.displacement, step.contact
    return peaks


def _solved_steps(
    model: Model, ramp: Ramp, prepare_model: Callable[[Model], Problem], instants: list[float], case: dict[str, Any],
    last: StepResult | None, peaks: dict[str, Peak],
) -> Iterator[StepResult]:  # fmt: skip
    """Yield the steps at `instants`, after the step `last`; `peaks` is the result of `_peaks` up to then."""
    model_texts = model_warnings(model, ramp)
    for text in model_texts if last is None else ():
        warn(text)
    problem = prepare_model(stage_of(model, last, ramp.table[0][0]))
    for text in problem.warnings if last is None else ():  # before the first step: the warning may explain its failure
        warn(text)
    model_texts += problem.warnings
    touched = frozenset(name for name, (_, _, contact) in peaks.items() if contact[name].active.any())
    state = problem.initial_state() if last is None else restart.put_back(problem, last, touched)
    begin, last_index = problem.ramp.table[0][0], 0
    # The first step in which the positions of bodies are undetermined, their motions, and by how much they moved.
    undetermined: tuple[int, dict[str, list[str]], float] | None = None
    if last is not None:
        begin, last_index, last = last.load_factor, last.index, None  # to free the memory of the step
    for index, instant in enumerate(instants, start=last_index + 1):
        problem, state = next_stage(prepare_model, model, problem, state, begin)
        state, step = step_halving.advance(problem, state, index, begin, instant)
        report = step.iterations.get("regularised", {})
        if undetermined is None and report.get("undetermined"):
            undetermined = index, report["undetermined"], report["moved"]
        peaks = _peaks([step], peaks)
        if coarse := coarse_contacts(problem, state, step):
            step = replace(step, iterations={**step.iterations, "coarse_contacts": coarse})
        if instant == instants[-1]:
            warnings = result_warnings(problem, state, step, undetermined, peaks)
            for text in warnings:
                warn(text)
        else:  # a contact that grows from a point begins with few elements: only results of this step are affected
            warnings = coarse_contact_notes(step.iterations)
        warned = (*model_texts * (index == 1), *warnings)
        yield replace(step, warnings=warned, restart=restart.restart_data(problem, state, case))
        del step  # to free its memory before the next step is computed
        begin = instant
