"""The parameters that results have sensitivities by, and what they change in the equations of a load step."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fastcontact.analysis.problem import Problem
from fastcontact.analysis.sensitivity.adjoint import Change
from fastcontact.analysis.sensitivity.moving_contact import MovingContact
from fastcontact.analysis.sensitivity.quantities import Asked
from fastcontact.analysis.wear import Worn
from fastcontact.elasticity.loads import Load, evaluated
from fastcontact.elasticity.materials import LinearElastic
from fastcontact.elasticity.varying_constants import varying
from fastcontact.errors import ModelError, unknown
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.model import Model
from fastcontact.model.parts.base import Support
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


def check_parameter(model: Model, asked: Asked) -> None:
    """Raise ModelError if a model has no such parameter."""
    kind = str(asked[0]) if asked else ""
    if kind not in FORMS:
        raise ModelError(unknown("parameter", kind, FORMS))
    if len(asked) != 2 and not (kind == "prescribed" and len(asked) == 3):
        raise ModelError(f"the parameter {asked} must have the form {FORMS[kind]}")
    known: dict[str, Callable[[Model, Asked], object]] = {
        "E": _material, "nu": _material, "load": _loads, "prescribed": _prescribing, "motion": _moved, "clearance": _opened,
    }  # fmt: skip
    known[kind](model, asked)


def change_by(contact: MovingContact, asked: Asked) -> Change:
    """Return what a parameter that `check_parameter` has found changes in the equations."""
    kinds: dict[str, Callable[[MovingContact, Asked], Change]] = {
        "E": _of_material, "nu": _of_material, "load": _of_load, "prescribed": _of_prescribed, "motion": _of_motion,
        "clearance": _of_clearance,
    }  # fmt: skip
    return kinds[str(asked[0])](contact, asked)


def _nothing(contact: MovingContact) -> Change:
    n = len(contact.u)
    nodes = 0 if contact.closed is None else len(contact.closed)
    return Change(np.zeros(n), np.zeros(n), np.zeros(n + len(contact.active) + nodes))


def _loads(model: Model, asked: Asked) -> tuple[list[Load], int | None]:
    """Return the loads on a group, and the number of a rigid obstacle that a force drives."""
    name, driven = str(asked[1]), model.force_driven
    found = [load for load in model.loads if load.group == name]
    if not found and driven.number(name) is None:
        names = [load.group for load in model.loads] + [pair.name for pair in driven.pairs]
        raise ModelError(unknown("group with a load, or obstacle with a force,", name, list(dict.fromkeys(names))))
    return found, driven.number(name)


def _of_load(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by the factor of the loads on a group, or of the force on an obstacle."""
    problem, instant = contact.problem, contact.instant
    model = problem.model
    found, driven = _loads(model, asked)
    change = _nothing(contact)
    for load in found:
        change.out[: model.n_dofs] -= model.load_vector(load).ravel() * multiplier(load.ramp, problem.ramp, instant)
    if driven is not None:
        pair = problem.force_driven.pairs[driven]
        force = [value or 0.0 for value in pair.force]
        change.out[problem.force_driven.dofs(driven)] -= np.array(force) * multiplier(pair.ramp, problem.ramp, instant)
    return change


def _prescribing(model: Model, asked: Asked) -> tuple[list[Support], list[int]]:
    """Return the supports on a group, and the numbers of relations that prescribe its displacement along normals."""
    group, only = asked[1], "xyz".find(str(asked[2])) if len(asked) == 3 else None
    supports = [s for s in model.supports if s.group == group and only in (None, s.component)]
    kinds = ("normal", "x", "y", "z") if only is None else (str(asked[2]),)
    names = [f"the displacement {kind} prescribed on '{group}'" for kind in kinds]
    wanted = {*(name for name in names if "normal" in name.split()[2]), *(f"{name} along axes" for name in names)}
    along = [number for number, relation in enumerate(model.relations) if relation.name in wanted]
    if not (supports or along):
        known = list(dict.fromkeys(s.group for s in model.supports))
        raise ModelError(unknown("group whose displacement is prescribed", ", ".join(map(str, asked[1:])), known))
    return supports, along


def _of_prescribed(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by the factor of what supports prescribe on a group."""
    problem, instant = contact.problem, contact.instant
    model = problem.model
    supports, along = _prescribing(model, asked)
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


def _moved(model: Model, asked: Asked) -> ContactPair:
    """Return the pair of a rigid obstacle that is moved."""
    moved = {pair.name: pair for pair in model.contact if any(pair.motion)}
    if asked[1] not in moved:
        raise ModelError(unknown("rigid obstacle with a motion", str(asked[1]), list(moved)))
    return moved[str(asked[1])]


def _of_motion(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by the factor of the motion of a rigid obstacle."""
    problem, name = contact.problem, str(asked[1])
    pair = _moved(problem.model, asked)
    motion = np.array(pair.motion) * multiplier(pair.ramp, problem.ramp, contact.instant)
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


def _opened(model: Model, asked: Asked) -> None:
    """Refuse clearances of pairs that are not there, or tied."""
    pairs = {pair.name: pair for pair in model.contact}
    if asked[1] not in pairs:
        raise ModelError(unknown("contact pair", str(asked[1]), list(pairs)))
    if pairs[str(asked[1])].options.get("kind") == "tied":
        raise ModelError(f"contact '{asked[1]}' is tied: it keeps its gaps, and has no clearance")


def _of_clearance(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by a length that is added to the gap of a contact pair."""
    name = str(asked[1])
    pair = contact.problem.pairs[name]
    count = len(pair.secondary.points)

    def changed(by: float) -> MovingContact:
        worn = {**contact.state.worn, name: Worn(np.full(count, by), np.zeros(count))}
        return replace(contact, state=replace(contact.state, worn=worn))

    return replace(_nothing(contact), sample=contact.along(changed, contact.step))


def _of_material(contact: MovingContact, asked: Asked) -> Change:
    """Return the change by a constant of an isotropic material."""
    model, constant = contact.problem.model, str(asked[0])
    number, material = _material(model, asked)
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


def _material(model: Model, asked: Asked) -> tuple[int, LinearElastic]:
    """Return an isotropic material with one number for a constant, and its own number in the model."""
    found = [
        (i, material) for i, (material, groups) in enumerate(model.materials)
        if asked[1] == i or (groups is not None and asked[1] in groups)
    ]  # fmt: skip
    if not found:
        names = [name for _, groups in model.materials for name in groups or ()]
        raise ModelError(unknown("material", str(asked[1]), [*names, *map(str, range(len(model.materials)))]))
    number, material = found[0]
    if not isinstance(material, LinearElastic) or varying(getattr(material, str(asked[0]))):
        raise ModelError(
            f"the material {asked[1]!r} is no LinearElastic with one number for {asked[0]}: one that varies or has axes "
            "has no sensitivity by that"
        )
    return number, material


def _with_model(problem: Problem, model: Model) -> Problem:
    pairs = {pair.name: model.bind(pair, problem.pairs[pair.name].held) for pair in model.contact}
    return replace(problem, model=model, pairs=pairs)


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
