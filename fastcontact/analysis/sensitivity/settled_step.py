"""Reconstruction of the equations at the end of a load step, in a form that can be differentiated."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fastcontact.analysis import restart
from fastcontact.analysis.convergence_messages import named_nodes, nearest_nodes
from fastcontact.analysis.criteria import Criteria
from fastcontact.analysis.load_step import prepare_start
from fastcontact.analysis.newton import newton
from fastcontact.analysis.problem import Problem, prepare
from fastcontact.analysis.sensitivity.moving_contact import REMEDY, MovingContact
from fastcontact.analysis.solution import Equilibrium
from fastcontact.analysis.stages import stage_of
from fastcontact.errors import ModelError
from fastcontact.model.model import Model
from fastcontact.model.ramp import Ramp
from fastcontact.results.step import StepResult


def settled_step(
    model: Model, step: StepResult, ramp: Ramp, criteria: Criteria, linear_solver: str
) -> tuple[Problem, MovingContact]:
    """Return the problem, and the contact at the end of a step with its multipliers.

    Raises
    ------
    ModelError
        If the step belongs to another case, or depends on earlier ones.
    """
    _check_path(model, step, criteria)
    case = restart.identity(model, ramp, criteria)
    restart.check(step, case, model)
    model.check(ramp)
    problem = prepare(model, ramp, criteria, linear_solver=linear_solver)
    touched = frozenset(name for name, contact in step.contact.items() if contact.active.any())
    state, load = restart.put_back(problem, step, touched), problem.load_at(step.load_factor)
    state = replace(state, obstacles=problem.obstacles_at(load, state.u))
    balanced = newton(problem, prepare_start(problem, state, step.index, load), load)
    settled, u = balanced.settled, balanced.u
    if settled is None:
        none = np.empty(0)
        solution = Equilibrium(u, none, none, np.empty(0, bool), np.empty(0, bool), 1)
        return problem, MovingContact(problem, state, load, step.load_factor, u, solution)
    return problem, MovingContact(problem, state, load, step.load_factor, u, settled.solution)


def _check_path(model: Model, step: StepResult, criteria: Criteria) -> None:
    for pair in model.contact:
        for option, meaning in (
            ("friction", "friction"),
            ("wear", "wear"),
            ("cohesion", "a cohesive layer"),
            ("adhesion", "adhesion"),
        ):
            if pair.options.get(option):
                raise ModelError(
                    f"contact '{pair.name}' has {meaning}: its results depend on all load steps, and sensitivities consider "
                    f"a single step. Use finite differences of two solutions, or omit {option}"
                )
        if pair.fluid is not None:
            raise ModelError(f"contact '{pair.name}' has a fluid, which sensitivities do not support: omit it")
        if pair.options.get("kind") == "bilateral_once_closed":
            raise ModelError(
                f"contact '{pair.name}' keeps nodes closed that closed in earlier load steps, and sensitivities consider a "
                "single step. Use finite differences of two solutions"
            )
    if stage_of(model, step) is not model:
        raise ModelError(
            "pretension sections or temporary supports hold positions from earlier load steps, and sensitivities consider a "
            "single step. Request them in the last step before the lock, or use finite differences of two solutions"
        )
    if criteria.geometry_updates is not None and not criteria.keep_pairing:
        raise ModelError(
            f"after a fixed number of geometry updates ({criteria.geometry_updates}) contact detection has not "
            "converged: omit geometry_updates, or keep the pairing (keep_pairing)"
        )


def checked_margin(contact: MovingContact, least: float) -> float:
    """Return the distance of the active set from a change, see `Sensitivities.margin`.

    Raises
    ------
    ModelError
        If it is less than `least`.
    """
    constraints, solution = contact.constraints, contact.solution
    size = float(np.abs(contact.u).max(initial=0.0))
    gap = constraints.gap0 + constraints.B @ contact.u
    near = np.full(len(constraints), np.inf)
    for name, rows in constraints.rows.items():
        active, usable = solution.active[rows], constraints.usable[rows]
        # Forces are divided by areas, since the force of a constraint with a small area is small.
        areas = constraints.parts[name].areas
        force = solution.multiplier[rows] / (1.0 if areas is None else areas)
        largest = float(np.abs(force).max(initial=0.0)) or 1.0
        near[rows] = np.where(active, force / largest, np.where(usable, gap[rows] / size, np.inf))
    if constraints.equality is not None:
        near[constraints.equality] = np.inf
    wrong = np.flatnonzero(~(near >= least))
    if len(wrong):
        nodes = nearest_nodes(contact.problem, constraints, wrong)
        shown = float(np.abs(near[wrong]).max())
        kind = (
            "open" if solution.active[wrong].all() else "close" if not solution.active[wrong].any() else "open or close"
        )
        many = "1 constraint is" if len(wrong) == 1 else f"{len(wrong)} constraints are"
        raise ModelError(
            f"{many} about to {kind}, at {named_nodes(contact.problem, nodes)}: forces or gaps are "
            f"{shown:.1e} of the largest, less than margin = {least:g}. The one-sided derivatives differ there. "
            f"{REMEDY}"
        )
    return min(1.0, float(near.min(initial=1.0)))
