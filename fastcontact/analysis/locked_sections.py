"""Pretension sections locked at the end of a load step: each adds a multi-point constraint to later steps."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.problem import Problem
from fastcontact.analysis.state import State
from fastcontact.elasticity.relations import Relation
from fastcontact.model.model import Model
from fastcontact.model.pretension import locked_lengths
from fastcontact.results.step import StepResult


def locked_before(model: Model, last: StepResult | None) -> Model:
    """Return the model with the sections that were locked when the `last` step began."""
    if last is None:
        return model
    before, kept = float(np.nextafter(last.load_factor, -np.inf)), (last.restart or {}).get("locked", {})
    return _with_locks(model, locked_lengths(model.pretensions, before, last.displacement, kept))


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
    lengths = locked_lengths(model.pretensions, begin, problem.displacement(state.u), state.locked)
    locked = _with_locks(model, lengths)
    if len(locked.relations) == len(problem.model.relations):
        return problem, state
    problem = prepared(locked)
    return problem, replace(
        state, solver=problem.solver.snapshot(), extrapolation=Extrapolation(), rigid=None, locked=lengths
    )


def at_present_length(model: Model) -> list[Relation]:
    """Return the relations that keep all pretension sections as they are in small motions."""
    return [own.locked(model.mesh.points.size, 0.0) for own in model.pretensions]


def _with_locks(model: Model, lengths: Mapping[str, float]) -> Model:
    """Return the model with sections locked at shortenings by their names [length]."""
    if not lengths:
        return model
    made = copy.copy(model)
    locks = [
        own.locked(model.mesh.points.size, lengths[own.label]) for own in model.pretensions if own.label in lengths
    ]
    made.relations = [*model.relations, *locks]
    return made
