"""The parameters that results have sensitivities by, and what they change in the equations of a load step."""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.sensitivity.adjoint import Change
from fastcontact.analysis.sensitivity.moving_contact import MovingContact
from fastcontact.analysis.sensitivity.quantities import Asked
from fastcontact.analysis.wear import Worn
from fastcontact.elasticity.loads import evaluated
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.elasticity.varying_constants import varying
from fastcontact.errors import ModelError, unknown
from fastcontact.model.model import Model
from fastcontact.model.ramp import combined, multiplier

Array = NDArray[np.float64]
FORMS = {
    "E": '("E", material)',
    "nu": '("nu", material)',
    "load": '("load", group)',
    "prescribed": '("prescribed", group)',
    "motion": '("motion", obstacle)',
    "clearance": '("clearance", pair)',
}
# By how much constants of materials are changed, relative to what is allowed, and motions and clearances, by edges of facets.
CONSTANT, LENGTH = 1e-3, 1e-5


def change_by(contact: MovingContact, asked: Asked) -> Change:
    """Return what a parameter changes in the equations; ModelError if there is no such parameter."""
    kind = str(asked[0]) if asked else ""
    if kind not in FORMS:
        raise ModelError(unknown("parameter", kind, FORMS))
    if len(asked) != 2 and not (kind == "prescribed" and len(asked) == 3):
        raise ModelError(f"the parameter {asked} must have the form {FORMS[kind]}")
    if kind in ("E", "nu"):
        return _of_material(contact, asked)
    if kind == "load":
        return _of_load(contact, asked)
    if kind == "prescribed":
        return _of_prescribed(contact, asked)
    return _of_motion(contact, asked) if kind == "motion" else _of_clearance(contact, asked)


def _nothing(contact: MovingContact) -> Change:
    n = len(contact.u)
    nodes = 0 if contact.closed is None else len(contact.closed)
    return Change(np.zeros(n), np.zeros(n), np.zeros(n + len(contact.active) + nodes))


def _of_load(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by the factor of the loads on a group, or of the force on an obstacle."""
    problem, name = contact.problem, str(asked[1])
    model, instant = problem.model, contact.instant
    found = [load for load in model.loads if load.group == name]
    driven = problem.force_driven.number(name)
    if not found and driven is None:
        names = [load.group for load in model.loads] + [pair.name for pair in problem.force_driven.pairs]
        raise ModelError(unknown("group with a load, or obstacle with a force,", name, list(dict.fromkeys(names))))
    change = _nothing(contact)
    for load in found:
        change.out[: model.n_dofs] -= model.load_vector(load).ravel() * multiplier(load.ramp, problem.ramp, instant)
    if driven is not None:
        pair = problem.force_driven.pairs[driven]
        force = [value or 0.0 for value in pair.force]
        change.out[problem.force_driven.dofs(driven)] -= np.array(force) * multiplier(pair.ramp, problem.ramp, instant)
    return change


def _of_prescribed(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by the factor of what supports prescribe on a group."""
    problem, group = contact.problem, asked[1]
    model, instant = problem.model, contact.instant
    only = "xyz".find(str(asked[2])) if len(asked) == 3 else None
    supports = [s for s in model.supports if s.group == group and only in (None, s.component)]
    normal = f"the displacement normal prescribed on '{group}'"
    along = [number for number, relation in enumerate(model.relations) if relation.name == normal and only is None]
    if not (supports or along):
        names = list(dict.fromkeys(s.group for s in model.supports))
        raise ModelError(unknown("group whose displacement is prescribed", ", ".join(map(str, asked[1:])), names))
    values = np.zeros(problem.shape)
    for support in supports:
        nodes = model.mesh.points_of(support.group)
        given = evaluated(support.value, model.mesh.points[nodes], support.name)
        values[nodes, support.component] = given * multiplier(support.ramp, problem.ramp, instant)
    if model.kinematics == "axisymmetric":
        values[model.axis_nodes, 0] = 0.0
    factors = [multiplier(r.ramp, problem.ramp, instant) if i in along else 0.0 for i, r in enumerate(model.relations)]
    lift = problem.system.lift(values.ravel(), problem.system.values(factors))
    return replace(_nothing(contact), lift=lift)


def _of_motion(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by the factor of the motion of a rigid obstacle."""
    problem, name = contact.problem, str(asked[1])
    moved = [pair for pair in problem.model.contact if pair.name == name and any(pair.motion)]
    if not moved:
        names = [pair.name for pair in problem.model.contact if any(pair.motion)]
        raise ModelError(unknown("rigid obstacle with a motion", name, names))
    motion = np.array(moved[0].motion) * multiplier(moved[0].ramp, problem.ramp, contact.instant)
    number = problem.force_driven.number(name)
    if number is not None:
        values = np.zeros(len(contact.u))
        values[problem.force_driven.dofs(number)] = motion
        none = [0.0] * len(problem.model.relations)
        return replace(_nothing(contact), lift=problem.system.lift(values, problem.system.values(none)))

    def changed(by: float) -> MovingContact:
        obstacles = {**contact.load.obstacles, name: contact.load.obstacles[name] + by * motion}
        return replace(contact, load=replace(contact.load, obstacles=obstacles))

    size = float(np.abs(motion).max())
    if size == 0.0:
        return _nothing(contact)
    return replace(_nothing(contact), sample=contact.along(changed, contact.step / size))


def _of_clearance(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by a length that is added to the gap of a contact pair."""
    problem, name = contact.problem, str(asked[1])
    if name not in problem.pairs:
        raise ModelError(unknown("contact pair", name, list(problem.pairs)))
    pair = problem.pairs[name]
    if pair.options.tied:
        raise ModelError(f"contact '{name}' is tied: it keeps its gaps, and has no clearance")
    count = len(pair.secondary.points)

    def changed(by: float) -> MovingContact:
        worn = {**contact.state.worn, name: Worn(np.full(count, by), np.zeros(count))}
        return replace(contact, state=replace(contact.state, worn=worn))

    return replace(_nothing(contact), sample=contact.along(changed, contact.step))


def _of_material(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by a constant of an isotropic material."""
    model, constant = contact.problem.model, str(asked[0])
    number = _material(model, asked)
    material = model.materials[number][0]
    if not isinstance(material, LinearElastic) or varying(getattr(material, constant)):
        raise ModelError(
            f"the material {asked[1]!r} is no LinearElastic with one number for {constant}: one that varies or has axes "
            "has no sensitivity by that"
        )
    value = float(getattr(material, constant))
    room = value if constant == "E" else min(0.5 - value, 1.0 + value)
    step = CONSTANT * room

    def at(by: float) -> MovingContact:
        changed = {"E": material.E, "nu": material.nu, constant: value + by}
        volumetric = "mean_dilatation" if material.averaged else "plain"
        other = replace(material, E=changed["E"], nu=changed["nu"], volumetric=volumetric)
        made = copy.copy(model)
        made.materials = [(other if i == number else m, groups) for i, (m, groups) in enumerate(model.materials)]
        return replace(contact, problem=_with_model(contact.problem, made))

    # Of the fourth order: what is left is the step to the fourth power.
    parts = [
        weight * (forces_of(at(place * step)) - forces_of(at(-place * step))) for place, weight in ((1, 8.0), (2, -1.0))
    ]
    sample = contact.along(at, step) if contact.problem.pairs else _nothing(contact).sample
    return replace(_nothing(contact), out=(parts[0] + parts[1]) / (12.0 * step), sample=sample)


def _material(model: Model, asked: Asked) -> int:
    found = [
        i
        for i, (_, groups) in enumerate(model.materials)
        if asked[1] == i or (groups is not None and asked[1] in groups)
    ]
    if not found:
        names = [name for _, groups in model.materials for name in groups or ()]
        raise ModelError(unknown("material", str(asked[1]), [*names, *map(str, range(len(model.materials)))]))
    return found[0]


def _with_model(problem: Problem, model: Model) -> Problem:
    supported = model.prescribed_by_ramp()[0]
    return replace(problem, model=model, pairs={pair.name: model.bind(pair, supported) for pair in model.contact})


def forces_of(contact: MovingContact) -> Array:
    """Return the internal forces of the materials (n_dofs,) less those of heat and initial states [force]."""
    problem = contact.problem
    model = problem.model
    found = np.zeros(len(contact.u))
    inside = model.internal_forces(problem.displacement(contact.u))
    for by_ramp in (model.thermal_forces_by_ramp(), model.initial_forces_by_ramp()):
        if by_ramp:
            inside = inside - combined(by_ramp, problem.ramp, contact.instant, problem.displacement(contact.u).shape)
    found[: model.n_dofs] = inside.ravel()
    return found
