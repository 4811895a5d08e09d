"""Parameters of sensitivities, and the derivatives of the residual with respect to them."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fastcontact.analysis.sensitivity.adjoint import Change
from fastcontact.analysis.sensitivity.material_constants import CONSTANTS, by_constant, check_constant
from fastcontact.analysis.sensitivity.moving_contact import MovingContact
from fastcontact.analysis.sensitivity.quantities import Label
from fastcontact.analysis.wear import Worn
from fastcontact.arrays import Array
from fastcontact.elasticity.inertia_loads import Centrifugal
from fastcontact.elasticity.loads import Load, evaluated
from fastcontact.elasticity.temperature import Temperature
from fastcontact.errors import ModelError, unknown
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.model import Model
from fastcontact.model.parts.base import Support, displacement_name
from fastcontact.model.pretension import Pretension, PretensionForce
from fastcontact.model.ramp import combined, multiplier

Item = TypeVar("Item", bound=Load | Temperature)
FORMS = {
    "E": '("E", material), with the number of the axis, "1", of an Orthotropic',
    "nu": '("nu", material), with the axes, "12", of an Orthotropic',
    "G": '("G", material, "12") of an Orthotropic',
    "expansion": '("expansion", material), or ("expansion", material, "1") along one axis',
    "load": '("load", group)',
    "speed": '("speed", group)',
    "temperature": '("temperature", group)',
    "pretension": '("pretension", name)',
    "prescribed": '("prescribed", group) or ("prescribed", group, "y")',
    "motion": '("motion", obstacle)',
    "clearance": '("clearance", pair)',
}
WITH_COMPONENT = (*CONSTANTS, "prescribed")


def check_parameter(model: Model, parameter: Label) -> None:
    """Raise ModelError if a model has no such parameter."""
    kind = str(parameter[0]) if parameter else ""
    if kind == "friction":
        raise ModelError(
            "results have no sensitivity to friction: if all nodes stick they do not depend on it, and if nodes slip they "
            "depend on all load steps. Use finite differences of two solutions"
        )
    if kind not in FORMS:
        raise ModelError(unknown("parameter", kind, FORMS))
    if len(parameter) not in (2, 3 if kind in WITH_COMPONENT else 2):
        raise ModelError(f"the parameter {parameter} must have the form {FORMS[kind]}")
    KINDS[kind][0](model, parameter)


def _item(kind: str, known: Mapping[str, Any], parameter: Label) -> Any:
    """Return the item of a given name; ModelError if there is none."""
    if parameter[1] not in known:
        raise ModelError(unknown(kind, str(parameter[1]), known))
    return known[str(parameter[1])]


def _nothing(contact: MovingContact) -> Change:
    n = len(contact.u)
    nodes = 0 if contact.closed is None else len(contact.closed)
    return Change(np.zeros(n), np.zeros(n), np.zeros(n + len(contact.active) + nodes))


def _named(kind: str, items: Sequence[Item], parameter: Label, others: Sequence[str] = ()) -> list[Item]:
    """Return the loads or temperatures on a group, restricted to it.

    Raises ModelError if there are none and the name is not in `others`.
    """
    group = str(parameter[1])
    items_of_group = [
        item if len(item.places) == 1 else replace(item, groups=(group,))  # type: ignore[type-var]
        for item in items if group in item.places
    ]  # fmt: skip
    if not items_of_group and parameter[1] not in others:
        names = [place for item in items for place in item.places]
        raise ModelError(unknown(kind, str(parameter[1]), list(dict.fromkeys([*names, *others]))))
    return items_of_group


def _loads(model: Model, parameter: Label) -> list[Load]:
    """Return the loads on a group; none for a force-driven obstacle."""
    driven = [pair.name for pair in model.force_driven.pairs]
    return _named("group with a load, or obstacle with a force,", model.loads, parameter, driven)


def _forces(contact: MovingContact, loads: Sequence[Load]) -> Array:
    """Return the nodal forces (n_dofs,) of loads at the end of the step [force]."""
    problem, force = contact.problem, np.zeros(len(contact.u))
    for load in loads:
        forces = problem.model.load_vector(load).ravel() * multiplier(load.ramp, problem.ramp, contact.instant)
        force[: problem.model.n_dofs] += forces
    return force


def _of_load(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with the factor of the loads on a group, or of the force on an obstacle."""
    problem = contact.problem
    driven = problem.force_driven.number(str(parameter[1]))
    out = -_forces(contact, _loads(problem.model, parameter))
    if driven is not None:
        pair = problem.force_driven.pairs[driven]
        force = [value or 0.0 for value in pair.force]
        factor = multiplier(pair.ramp, problem.ramp, contact.instant)
        out[problem.force_driven.dofs(driven)] -= np.array(force) * factor
    return replace(_nothing(contact), out=out)


def _speeds(model: Model, parameter: Label) -> list[Centrifugal]:
    """Return the centrifugal forces on a group."""
    turning = [load for load in model.loads if isinstance(load, Centrifugal)]
    return _named("group with a centrifugal force", turning, parameter)


def _of_speed(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with the angular speed of a group; forces are proportional to its square."""
    loads = [load for load in _speeds(contact.problem.model, parameter) if load.speed]
    out = [-2.0 / load.speed * _forces(contact, [load]) for load in loads]
    return replace(_nothing(contact), out=np.sum(out, axis=0) if out else np.zeros(len(contact.u)))


def _temperatures(model: Model, parameter: Label) -> list[Temperature]:
    """Return the temperatures of a group."""
    return _named("group with a temperature", model.temperatures, parameter)


def _of_temperature(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with the factor of the temperature rise of a group."""
    problem, change = contact.problem, _nothing(contact)
    heated = copy.copy(problem.model)
    heated.temperatures = _temperatures(heated, parameter)
    forces = combined(heated.thermal_forces_by_ramp(), problem.ramp, contact.instant, heated.mesh.points.shape)
    change.out[: heated.n_dofs] = -forces.ravel()
    return change


def _pretension(model: Model, parameter: Label) -> Pretension:
    """Return a pretension section."""
    section: Pretension = _item("pretension", {item.label: item for item in model.pretensions}, parameter)
    return section


def _of_pretension(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with the factor of the force of a pretension section, or of its shortening."""
    model = contact.problem.model
    section = _pretension(model, parameter)
    if section.shortening is not None:
        along = [i for i, relation in enumerate(model.relations) if relation.name == section.prescribed]
        return _lifted(contact, np.zeros(contact.problem.shape), along)
    forces = [load for load in model.loads if isinstance(load, PretensionForce) and load.section is section]
    return replace(_nothing(contact), out=-_forces(contact, forces))


def _prescribing(model: Model, parameter: Label) -> tuple[list[Support], list[int]]:
    """Return the supports on a group, and the numbers of constraints that prescribe its displacement along normals."""
    group, only = parameter[1], "xyz".find(str(parameter[2])) if len(parameter) == 3 else None
    supports = [s for s in model.supports if s.group == group and only in (None, s.component)]
    kinds = ("normal", "x", "y", "z") if only is None else (str(parameter[2]),)
    names = {kind: displacement_name(kind, str(group)) for kind in kinds}
    wanted = {names.get("normal"), *(f"{name} along axes" for name in names.values())}
    along = [number for number, relation in enumerate(model.relations) if relation.name in wanted]
    if not (supports or along):
        known = list(dict.fromkeys(s.group for s in model.supports))
        raise ModelError(unknown("group whose displacement is prescribed", ", ".join(map(str, parameter[1:])), known))
    return supports, along


def _of_prescribed(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with the load factor of prescribed displacements of a group."""
    problem, instant = contact.problem, contact.instant
    model = problem.model
    supports, along = _prescribing(model, parameter)
    if any(support.rotation is not None for support in supports):
        raise ModelError(
            f"results are not linear in the rotation of '{parameter[1]}': its sensitivity is not available"
        )
    values = np.zeros(problem.shape)
    for support in supports:
        nodes = model.mesh.points_of(support.group)
        given = evaluated(support.value, model.mesh.points[nodes], support.name)
        values[nodes, support.component] = given * multiplier(support.ramp, problem.ramp, instant)
    if model.kinematics == "axisymmetric":
        values[model.axis_nodes, 0] = 0.0
    return _lifted(contact, values, along)


def _lifted(contact: MovingContact, values: Array, along: Sequence[int]) -> Change:
    """Return the change with prescribed displacements (n_points, dim) [length] and the values of some constraints."""
    problem = contact.problem
    factors = [
        multiplier(relation.ramp, problem.ramp, contact.instant) if i in along else 0.0
        for i, relation in enumerate(problem.model.relations)
    ]
    lift = problem.system.lift(values.ravel(), problem.system.values(factors))
    return replace(_nothing(contact), lift=lift)


def _moved(model: Model, parameter: Label) -> ContactPair:
    """Return the pair of a rigid obstacle with a prescribed motion."""
    moved = {pair.name: pair for pair in model.contact if any(pair.motion)}
    obstacle: ContactPair = _item("rigid obstacle with a motion", moved, parameter)
    return obstacle


def _of_motion(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with the factor of the motion of a rigid obstacle."""
    problem, name = contact.problem, str(parameter[1])
    pair = _moved(problem.model, parameter)
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


def _opened(model: Model, parameter: Label) -> None:
    """Raise ModelError if a contact pair does not exist or is tied, so that it has no clearance."""
    if _item("contact pair", {pair.name: pair for pair in model.contact}, parameter).options.get("kind") == "tied":
        raise ModelError(f"contact '{parameter[1]}' is tied: it keeps its gaps, and has no clearance")


def _of_clearance(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with a length added to the gap of a contact pair."""
    name = str(parameter[1])
    pair = contact.problem.pairs[name]
    count = len(pair.secondary.points)

    def changed(by: float) -> MovingContact:
        worn = {**contact.state.worn, name: Worn(np.full(count, by), np.zeros(count))}
        return replace(contact, state=replace(contact.state, worn=worn))

    return replace(_nothing(contact), sample=contact.along(changed, contact.step))


def _of_constant(contact: MovingContact, parameter: Label) -> Change:
    """Return the change with a constant of a material."""
    unchanged = _nothing(contact)
    out, sample = by_constant(contact, parameter)
    return replace(unchanged, out=out, sample=unchanged.sample if sample is None else sample)


# For each kind of parameter, a check that raises ModelError if it does not exist, and the change of the residual.
KINDS: dict[str, tuple[Callable[[Model, Label], object], Callable[[MovingContact, Label], Change]]] = {
    **dict.fromkeys(CONSTANTS, (check_constant, _of_constant)),
    "load": (_loads, _of_load),
    "speed": (_speeds, _of_speed),
    "temperature": (_temperatures, _of_temperature),
    "pretension": (_pretension, _of_pretension),
    "prescribed": (_prescribing, _of_prescribed),
    "motion": (_moved, _of_motion),
    "clearance": (_opened, _of_clearance),
}
