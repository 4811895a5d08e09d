"""Pretension sections that are locked at the end of a load step: from then on the problem has a relation more for each."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.model.model import Model
from fastcontact.model.pretension import with_locks
from fastcontact.results.step import StepResult

Array = NDArray[np.float64]


def locked_before(model: Model, last: StepResult | None) -> Model:
    """Return the model with the sections that were locked when the `last` step began."""
    if last is None:
        return model
    return _locked(model, float(np.nextafter(last.load_factor, -np.inf)), last.displacement)


def go_on(
    prepared: Callable[[Model], Problem], model: Model, problem: Problem, state: State, begin: float
) -> tuple[Problem, State]:
    """Return problem and state for the step that begins at an instant, with the sections that are locked from there on.

    Parameters
    ----------
    prepared : callable
        Makes the problem of a model.
    model : Model
        Without locked sections.
    problem : Problem
        Of the step before.
    state : State
        At the beginning of the step.
    begin : float
    """
    locked = _locked(model, begin, problem.displacement(state.u))
    if len(locked.relations) == len(problem.model.relations):
        return problem, state
    problem = prepared(locked)
    return problem, replace(state, solver=problem.solver.snapshot(), extrapolation=Extrapolation(), rigid=None)


def _locked(model: Model, begin: float, displacement: Array) -> Model:
    locks = with_locks(model.pretensions, begin, displacement)
    if not locks:
        return model
    made = copy.copy(model)
    made.relations = [*model.relations, *locks]
    return made
