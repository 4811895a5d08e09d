"""The model of a load step, if parts of it are temporary.

Constraints, such as those of locked pretension sections, prescribed temperatures and convection films may act only in some
load steps. The model of a step, called its stage, contains those that act in this step.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.arrays import Array
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint, TemporaryConstraint
from fastcontact.heat.loads import FixedTemperature, TemporaryHeat
from fastcontact.model.model import TEMPORARY, Model
from fastcontact.results.step import StepResult


def stage_of(model: Model, last: StepResult | None, begin: float = 0.0) -> Model:
    """Return the model of the load step whose result is `last`.

    Without a last step, return the model of the first load step, which begins at the instant `begin`.
    """
    if last is None:
        return _stage(model, begin, np.zeros(model.mesh.points.shape), None, {})[0]
    before = float(np.nextafter(last.load_factor, -np.inf))
    return _stage(model, before, last.displacement, None, (last.restart or {}).get("locked", {}))[0]


def next_stage(
    prepare: Callable[[Model], Problem], model: Model, problem: Problem, state: State, begin: float
) -> tuple[Problem, State]:
    """Return the problem and the state of the load step that begins at an instant.

    Parameters
    ----------
    prepare : callable
        Function that returns the `Problem` of a model.
    model : Model
        The complete model of the user.
    problem : Problem
        Problem of the previous step.
    state : State
        State at the beginning of the step.
    begin : float
        Pseudo-time at the beginning of the step.
    """
    stage, values = _stage(model, begin, problem.displacement(state.u), state.rise, state.locked)
    if _names(stage) == _names(problem.model):
        return problem, state
    problem = prepare(stage)
    solver = problem.solver.snapshot()
    return problem, replace(state, solver=solver, extrapolation=Extrapolation(), locked=values)


def _names(model: Model) -> list[str]:
    """Return the names of the constraints of a model and of its temporary temperatures and films."""
    temporary = [load for load in model.heat_loads if isinstance(load, TemporaryHeat)]
    return [*(relation.name for relation in model.relations), *(load.label for load in temporary)]


def _stage(
    model: Model, begin: float, displacement: Array, rise: Array | None, stored: Mapping[str, Any]
) -> tuple[Model, dict[str, Array]]:
    """Return the model of the load step that begins at an instant, and the initial values of its temporary parts.

    Parameters
    ----------
    model : Model
        The complete model of the user.
    begin : float
        Pseudo-time at the beginning of the step.
    displacement : ndarray (n_points, dim)
        Displacements at this instant [length].
    rise : ndarray (n_points,) or None
        Temperature rise at this instant, with conduction of heat [temperature].
    stored : mapping
        Initial values of parts that acted in earlier steps.

    Returns
    -------
    model : Model
    values : dict
        For each part, by its name, the value at the instant at which it became active; see `State.locked`.
    """
    values: dict[str, Array] = {}
    relations: list[MultiPointConstraint] = []
    for item in model.relations:
        if not isinstance(item, TemporaryConstraint):
            relations.append(item)
        elif item.acts_from(begin):
            values[item.name] = np.asarray(stored.get(item.name, item.rows @ displacement.ravel()))
            relations += item.begun_constraints(values[item.name])
    loads: list[Any] = []
    for load in model.heat_loads:
        if isinstance(load, FixedTemperature) and load.begins > -np.inf and load.acts_from(begin):
            initial_rise = np.zeros(len(displacement)) if rise is None else rise
            values[load.label] = np.asarray(stored.get(load.label, initial_rise))
            loads.append(replace(load, reached=values[load.label]))
        elif not isinstance(load, TemporaryHeat) or load.acts_from(begin):
            loads.append(load)
    if not any(isinstance(item, TEMPORARY) for item in (*model.relations, *model.heat_loads)):
        return model, values
    stage = copy.copy(model)
    stage.relations, stage.heat_loads = relations, loads
    return stage, values
