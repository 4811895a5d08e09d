"""Parameters of sensitivity analyses, and the derivatives of the residual with respect to them."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from fastcontact.analysis.sensitivity.adjoint import Change
from fastcontact.analysis.sensitivity.moving_contact import INCREMENT, MovingContact
from fastcontact.analysis.sensitivity.quantities import Label
from fastcontact.analysis.wear import Worn
from fastcontact.arrays import Array, scattered
from fastcontact.elasticity.anisotropic_materials import AXIS_PAIRS, Anisotropic, Orthotropic
from fastcontact.elasticity.inertia_loads import Centrifugal
from fastcontact.elasticity.loads import Load
from fastcontact.elasticity.materials import LinearElastic, Material
from fastcontact.elasticity.temperature import Temperature
from fastcontact.elasticity.varying_constants import varying_items
from fastcontact.errors import ModelError, check_known, unknown
from fastcontact.model.contact_pair import ContactPair
from fastcontact.model.model import Model
from fastcontact.model.parts.base import Support, displacement_name
from fastcontact.model.pretension import Pretension, PretensionForce
from fastcontact.model.ramp import combined, multiplier

# Names of the components of the constants of orthotropic materials, by constant.
CONSTANTS = {"E": "123", "nu": AXIS_PAIRS, "G": AXIS_PAIRS, "expansion": "123"}


def _constant_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a constant of a material, by finite differences."""
    model, name = contact.problem.model, str(parameter[0])
    number, material, component = _constant_of(model, parameter)
    step = INCREMENT * _admissible_range(material, name, component)

    def with_increment(increment: float) -> MovingContact:
        changed_model, problem = copy.copy(model), contact.problem
        changed_model.materials = list(model.materials)
        groups = model.materials[number][1]
        changed_model.materials[number] = _with_constant(material, name, component, increment), groups
        pairs = {p.name: changed_model.bind(p, problem.pairs[p.name].held_motions) for p in changed_model.contact}
        return replace(contact, problem=replace(problem, model=changed_model, pairs=pairs))

    # Central differences with an error of fourth order in the step.
    def difference(h: float) -> Array:
        return _internal_forces(with_increment(h)) - _internal_forces(with_increment(-h))

    residual = (8.0 * difference(step) - difference(2 * step)) / (12.0 * step)
    change = replace(_zero_change(contact), residual=residual)
    if not contact.problem.pairs:
        return change
    return replace(change, sample=contact.parameter_derivative(with_increment, step))


def _constant_of(model: Model, parameter: Label) -> tuple[int, Material, int | None]:
    """Return the number of a material in the model, the material, and the requested component."""
    matches = [
        (i, material) for i, (material, groups) in enumerate(model.materials)
        if parameter[1] == i or parameter[1] in (model.mesh.cell_groups if groups is None else groups)
    ]  # fmt: skip
    if not matches:
        names = [name for _, groups in model.materials for name in groups or model.mesh.cell_groups]
        raise ModelError(unknown("material", str(parameter[1]), [*names, *map(str, range(len(model.materials)))]))
    (number, material), name = matches[0], str(parameter[0])
    value = getattr(material, name, None)
    components = value if isinstance(value, tuple) else (value,)
    if value is None or any(map(varying_items, components)):
        raise ModelError(f"the material {parameter[1]!r} has no constant {name}: its sensitivity is not available")
    return number, material, _component(parameter, list(CONSTANTS[name]) if len(components) > 1 else [])


def _component(parameter: Label, names: Sequence[str]) -> int | None:
    """Return the number of the requested component; None if the constant is a scalar or all components are requested."""
    if len(parameter) == 2 and (not names or parameter[0] == "expansion"):
        return None
    if len(parameter) == 2:
        raise ModelError(f"{parameter[0]} of the material {parameter[1]!r} has components: request (..., '{names[0]}')")
    check_known(f"component of {parameter[0]}", str(parameter[2]), names, ModelError)
    return names.index(str(parameter[2]))


def _admissible_range(material: Material, name: str, component: int | None) -> float:
    """Return the approximate distance of a constant from the limits of its admissible range, with all others fixed.

    It scales the increments of finite differences. An isotropic Poisson's ratio lies between -1 and 0.5; that of an
    orthotropic material is admissible while the compliance matrix is positive definite.
    """
    value = getattr(material, name)
    if name == "expansion":  # forces are linear in it, so that any increment is accurate
        return 1.0 / INCREMENT
    if name != "nu":
        return float(value if component is None else value[component])
    if isinstance(material, LinearElastic):
        return min(0.5 - value, 1.0 + value)
    assert isinstance(material, Orthotropic)
    assert component is not None
    i, j = (int(axis) - 1 for axis in AXIS_PAIRS[component])
    S = material.local_compliance[:3, :3]
    size = np.sqrt(np.diag(S))
    return float(np.linalg.eigvalsh(S / np.outer(size, size))[0] * size[j] / size[i])


def _with_constant(material: Material, name: str, component: int | None, increment: float) -> Material:
    """Return the material with a constant, or one of its components, changed by `increment`."""
    value = getattr(material, name)
    if isinstance(value, tuple):
        value = tuple(v + increment * (component in (None, i)) for i, v in enumerate(value))
    else:
        value = value + increment
    if isinstance(material, LinearElastic):
        volumetric = "mean_dilatation" if material.averaged else "plain"
        modes = material.incompatible_modes
        return replace(material, **{"volumetric": volumetric, "incompatible_modes": modes, name: value})
    assert isinstance(material, Orthotropic | Anisotropic)
    return replace(material, **{name: value})


def _internal_forces(contact: MovingContact) -> Array:
    """Return the internal forces (n_dofs,) minus the equivalent forces of thermal expansion and initial states [force]."""
    problem, model = contact.problem, contact.problem.model
    displacement = problem.displacement(contact.u)
    forces = model.internal_forces(displacement)
    for by_ramp in (model.thermal_forces_by_ramp(), model.initial_forces_by_ramp()):
        forces = forces - combined(by_ramp, problem.ramp, contact.instant, displacement.shape)
    return np.pad(forces.ravel(), (0, len(contact.u) - model.n_dofs))


Item = TypeVar("Item", bound=Load | Temperature)
WITH_COMPONENT = (*CONSTANTS, "prescribed")


def check_parameter(model: Model, parameter: Label) -> None:
    """Raise ModelError if a model does not have a parameter."""
    kind = str(parameter[0]) if parameter else ""
    if kind == "friction":
        raise ModelError(
            "results have no sensitivity to friction: if all nodes stick they do not depend on it, and if nodes slip they "
            "depend on all load steps. Use finite differences of two solutions"
        )
    check_known("parameter", kind, KINDS, ModelError)
    form, check, _ = KINDS[kind]
    if len(parameter) not in (2, 3 if kind in WITH_COMPONENT else 2):
        raise ModelError(f"the parameter {parameter} must have the form {form}")
    check(model, parameter)


def _item(kind: str, items: Mapping[str, Any], parameter: Label) -> Any:
    """Return the item whose name is `parameter[1]`; ModelError if there is none."""
    check_known(kind, parameter[1], items, ModelError)
    return items[str(parameter[1])]


def _zero_change(contact: MovingContact) -> Change:
    """Return derivatives that are zero."""
    n, nodes = len(contact.u), 0 if contact.closed is None else len(contact.closed)
    return Change(np.zeros(n), np.zeros(n), np.zeros(n + len(contact.active) + nodes))


def _items_on_group(kind: str, items: Sequence[Item], parameter: Label, others: Sequence[str] = ()) -> list[Item]:
    """Return the loads or temperatures on a group, restricted to this group.

    Raises ModelError if there are none and the name is not in `others`.
    """
    group = str(parameter[1])
    items_of_group = [
        item if len(item.group_names) == 1 else replace(item, groups=(group,))  # type: ignore[type-var]
        for item in items if group in item.group_names
    ]  # fmt: skip
    if not items_of_group and parameter[1] not in others:
        names = [name for item in items for name in item.group_names]
        raise ModelError(unknown(kind, str(parameter[1]), list(dict.fromkeys([*names, *others]))))
    return items_of_group


def _loads(model: Model, parameter: Label) -> list[Load]:
    """Return the loads on a group; empty for a force-driven obstacle."""
    driven = [pair.name for pair in model.force_driven.pairs]
    return _items_on_group("group with a load, or obstacle with a force,", model.loads, parameter, driven)


def _forces(contact: MovingContact, loads: Sequence[Load]) -> Array:
    """Return the nodal forces (n_dofs,) of loads at the end of the step [force]."""
    problem, force = contact.problem, np.zeros(len(contact.u))
    for load in loads:
        forces = problem.model.load_vector(load).ravel() * multiplier(load.ramp, problem.ramp, contact.instant)
        force[: problem.model.n_dofs] += forces
    return force


def _load_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a factor of the loads on a group, or of the force on an obstacle."""
    problem = contact.problem
    driven = problem.force_driven.number(str(parameter[1]))
    residual = -_forces(contact, _loads(problem.model, parameter))
    if driven is not None:
        pair = problem.force_driven.pairs[driven]
        force = [value or 0.0 for value in pair.force]
        factor = multiplier(pair.ramp, problem.ramp, contact.instant)
        residual[problem.force_driven.dofs(driven)] -= np.array(force) * factor
    return replace(_zero_change(contact), residual=residual)


def _speeds(model: Model, parameter: Label) -> list[Centrifugal]:
    """Return the centrifugal forces on a group."""
    centrifugal = [load for load in model.loads if isinstance(load, Centrifugal)]
    return _items_on_group("group with a centrifugal force", centrifugal, parameter)


def _speed_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to the angular speed of a group; forces are proportional to its square."""
    loads = [load for load in _speeds(contact.problem.model, parameter) if load.speed]
    derivatives = [-2.0 / load.speed * _forces(contact, [load]) for load in loads]
    return replace(_zero_change(contact), residual=sum(derivatives, np.zeros(len(contact.u))))


def _temperatures(model: Model, parameter: Label) -> list[Temperature]:
    """Return the temperatures of a group."""
    return _items_on_group("group with a temperature", model.temperatures, parameter)


def _temperature_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a factor of the temperature rise of a group."""
    problem, change = contact.problem, _zero_change(contact)
    restricted = copy.copy(problem.model)
    restricted.temperatures = _temperatures(restricted, parameter)
    forces = combined(restricted.thermal_forces_by_ramp(), problem.ramp, contact.instant, restricted.mesh.points.shape)
    change.residual[: restricted.n_dofs] = -forces.ravel()
    return change


def _pretension(model: Model, parameter: Label) -> Pretension:
    """Return a pretension section."""
    section: Pretension = _item("pretension", {item.label: item for item in model.pretensions}, parameter)
    return section


def _pretension_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a factor of the force or of the shortening of a pretension section."""
    model = contact.problem.model
    section = _pretension(model, parameter)
    if section.shortening is not None:
        relation_numbers = [i for i, relation in enumerate(model.relations) if relation.name == section.constraint_name]
        return _prescribed_value_derivatives(contact, np.zeros(contact.problem.shape), relation_numbers)
    forces = [load for load in model.loads if isinstance(load, PretensionForce) and load.pretension is section]
    return replace(_zero_change(contact), residual=-_forces(contact, forces))


def _prescribed_parts(model: Model, parameter: Label) -> tuple[list[Support], list[int]]:
    """Return the supports on a group, and the numbers of constraints that prescribe displacements along normals or axes."""
    group, component = parameter[1], "xyz".find(str(parameter[2])) if len(parameter) == 3 else None
    supports = [s for s in model.supports if s.group == group and component in (None, s.component)]
    kinds = ("normal", "x", "y", "z") if component is None else (str(parameter[2]),)
    names = {kind: displacement_name(kind, str(group)) for kind in kinds}
    relation_names = {names.get("normal"), *(f"{name} along axes" for name in names.values())}
    relation_numbers = [number for number, relation in enumerate(model.relations) if relation.name in relation_names]
    if not (supports or relation_numbers):
        groups = list(dict.fromkeys(s.group for s in model.supports))
        raise ModelError(unknown("group whose displacement is prescribed", ", ".join(map(str, parameter[1:])), groups))
    return supports, relation_numbers


def _prescribed_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a factor of the prescribed displacements of a group."""
    problem, restricted = contact.problem, copy.copy(contact.problem.model)
    restricted.supports, relation_numbers = _prescribed_parts(problem.model, parameter)
    if any(support.rotation is not None for support in restricted.supports):
        raise ModelError(
            f"results are not linear in the rotation of '{parameter[1]}': its sensitivity is not available"
        )
    values = np.zeros(problem.shape)
    displacements, shape = restricted.prescribed_by_ramp()[1], restricted.mesh.points.shape
    values[: len(restricted.mesh.points)] = combined(displacements, problem.ramp, contact.instant, shape)
    return _prescribed_value_derivatives(contact, values, relation_numbers)


def _prescribed_value_derivatives(contact: MovingContact, values: Array, relation_numbers: Sequence[int]) -> Change:
    """Return the derivatives with respect to a factor of prescribed displacements and of the values of constraints.

    `values` (n_points, dim) are the displacements [length], and `relation_numbers` the numbers of the constraints.
    """
    problem = contact.problem
    all_factors = problem.factors(problem.model.relations, contact.instant)
    factors = [factor if i in relation_numbers else 0.0 for i, factor in enumerate(all_factors)]
    return replace(_zero_change(contact), lift=problem.system.lift(values.ravel(), factors))


def _moving_obstacle(model: Model, parameter: Label) -> ContactPair:
    """Return the pair of a rigid obstacle with a prescribed motion."""
    pairs = {pair.name: pair for pair in model.contact if any(pair.motion)}
    obstacle: ContactPair = _item("rigid obstacle with a motion", pairs, parameter)
    return obstacle


def _motion_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a factor of the motion of a rigid obstacle."""
    problem, name = contact.problem, str(parameter[1])
    pair = _moving_obstacle(problem.model, parameter)
    motion = np.array(pair.motion) * multiplier(pair.ramp, problem.ramp, contact.instant)
    number = problem.force_driven.number(name)
    if number is not None:
        values = scattered(motion, problem.force_driven.dofs(number), len(contact.u))
        zero_factors = [0.0] * len(problem.model.relations)
        return replace(_zero_change(contact), lift=problem.system.lift(values, zero_factors))

    def with_increment(increment: float) -> MovingContact:
        obstacles = {**contact.load.obstacles, name: contact.load.obstacles[name] + increment * motion}
        return replace(contact, load=replace(contact.load, obstacles=obstacles))

    size = float(np.abs(motion).max())
    if size == 0.0:
        return _zero_change(contact)
    return replace(_zero_change(contact), sample=contact.parameter_derivative(with_increment, contact.increment / size))


def _check_clearance(model: Model, parameter: Label) -> None:
    """Raise ModelError if a contact pair does not exist or is tied, so that it has no clearance."""
    if _item("contact pair", {pair.name: pair for pair in model.contact}, parameter).options.get("kind") == "tied":
        raise ModelError(f"contact '{parameter[1]}' is tied: its gaps are fixed, and it has no clearance")


def _clearance_derivatives(contact: MovingContact, parameter: Label) -> Change:
    """Return the derivatives with respect to a length that is added to the gaps of a contact pair."""
    name = str(parameter[1])
    pair = contact.problem.pairs[name]
    n_nodes = len(pair.secondary.points)

    def with_increment(increment: float) -> MovingContact:
        worn = {**contact.state.worn, name: Worn(np.full(n_nodes, increment), np.zeros(n_nodes))}
        return replace(contact, state=replace(contact.state, worn=worn))

    return replace(_zero_change(contact), sample=contact.parameter_derivative(with_increment, contact.increment))


_CONSTANT = _constant_of, _constant_derivatives
# The form of each kind of parameter, the function that raises ModelError if a model does not have the parameter, and the
# function that returns the derivatives of the residual.
KINDS: dict[str, tuple[str, Callable[[Model, Label], object], Callable[[MovingContact, Label], Change]]] = {
    "E": ('("E", material), or ("E", material, "1") along axis 1 of an Orthotropic', *_CONSTANT),
    "nu": ('("nu", material), or ("nu", material, "12") for axes 1 and 2 of an Orthotropic', *_CONSTANT),
    "G": ('("G", material, "12") for axes 1 and 2 of an Orthotropic', *_CONSTANT),
    "expansion": ('("expansion", material), or ("expansion", material, "1") along axis 1', *_CONSTANT),
    "load": ('("load", group)', _loads, _load_derivatives),
    "speed": ('("speed", group)', _speeds, _speed_derivatives),
    "temperature": ('("temperature", group)', _temperatures, _temperature_derivatives),
    "pretension": ('("pretension", name)', _pretension, _pretension_derivatives),
    "prescribed": ('("prescribed", group) or ("prescribed", group, "y")', _prescribed_parts, _prescribed_derivatives),
    "motion": ('("motion", obstacle)', _moving_obstacle, _motion_derivatives),
    "clearance": ('("clearance", pair)', _check_clearance, _clearance_derivatives),
}
