"""The model in one load step: with the pretension sections that are locked in it, and the temporary relations that hold."""

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
from fastcontact.model.model import Model
from fastcontact.model.pretension import locked_lengths
from fastcontact.results.step import StepResult


def stage_of(model: Model, last: StepResult | None, begin: float = 0.0) -> Model:
    """Return the model as it was in the `last` step; before all steps as it is in the first one, from the instant `begin`."""
    if last is None:
        return _stage(model, begin, np.zeros(model.mesh.points.shape), {})[0]
    before = float(np.nextafter(last.load_factor, -np.inf))
    return _stage(model, before, last.displacement, (last.restart or {}).get("locked", {}))[0]


def go_on(
    prepared: Callable[[Model], Problem], model: Model, problem: Problem, state: State, begin: float
) -> tuple[Problem, State]:
    """Return problem and state for the step that begins at an instant.

    Parameters
    ----------
    prepared : callable
        Makes the problem of a model.
    model : Model
        With all temporary relations, and without locked sections.
    problem : Problem
        Of the step before.
    state : State
        At the beginning of the step.
    begin : float
    """
    stage, kept = _stage(model, begin, problem.displacement(state.u), state.locked)
    if [relation.name for relation in stage.relations] == [relation.name for relation in problem.model.relations]:
        return problem, state
    problem = prepared(stage)
    return problem, replace(
        state, solver=problem.solver.snapshot(), extrapolation=Extrapolation(), rigid=None, locked=kept
    )


def at_present_length(model: Model) -> list[MultiPointConstraint]:
    """Return the relations that keep all pretension sections as they are in small motions."""
    return [own.locked(model.mesh.points.size, 0.0) for own in model.pretensions]


def _stage(
    model: Model, begin: float, displacement: Array, kept: Mapping[str, Any]
) -> tuple[Model, dict[str, float | Array]]:
    """Return the model in the step that begins at an instant, and what its locks and temporary relations began with.

    That is `kept` from when they began, and follows from the displacements (n_points, dim) [length] for new ones: lengths by
    the names of sections, values (m,) by those of relations.
    """
    lengths = locked_lengths(model.pretensions, begin, displacement, kept)
    locks = [
        own.locked(model.mesh.points.size, lengths[own.label]) for own in model.pretensions if own.label in lengths
    ]
    reached: dict[str, float | Array] = {**lengths}
    relations: list[MultiPointConstraint] = []
    for own in model.relations:
        if not isinstance(own, TemporaryConstraint):
            relations.append(own)
        elif own.acts_from(begin):
            reached[own.name] = kept[own.name] if own.name in kept else own.rows @ displacement.ravel()
            relations += own.after(np.asarray(reached[own.name]))
    if not locks and not any(isinstance(own, TemporaryConstraint) for own in model.relations):
        return model, reached
    made = copy.copy(model)
    made.relations = [*relations, *locks]
    return made, reached
