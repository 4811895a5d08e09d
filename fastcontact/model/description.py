"""Description of a model in sentences."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from fastcontact.elasticity.inertia_loads import Centrifugal
from fastcontact.elasticity.initial_states import ALWAYS, COMPONENTS
from fastcontact.elasticity.loads import listed
from fastcontact.elasticity.nonlinear_materials import NonlinearElastic
from fastcontact.heat.loads import TemporaryHeat
from fastcontact.model.contact_pair import ContactPair

KINEMATICS = {
    "axisymmetric": "axisymmetric model (x is the radius, y the axis; forces are those over the full circle)",
    "plane_strain": "model in plane strain (forces are those for a depth of 1)",
    "plane_stress": "model in plane stress (forces are those for a thickness of 1)",
    "3d": "model in three dimensions",
}


def sentences(model: Any) -> Iterator[str]:
    """Yield the lines that describe a `Model`: kinematics, mesh, materials, supports, loads, contact and solution."""
    mesh = model.mesh
    cells = " and ".join(f"{len(block)} {name}" for name, block in mesh.solids.items())
    article = "An" if model.kinematics == "axisymmetric" else "A"
    yield f"{article} {KINEMATICS[model.kinematics]} of {mesh.n_points} points, {cells}: {model.n_dofs} degrees of freedom."
    if unit_names := [f"{kind} in {unit}" for kind, unit in model.units.items() if unit not in ("", "-")]:
        yield f"Units: {', '.join(unit_names)}."
    for (material, groups), modes in zip(model.materials, model.uses_incompatible_modes(), strict=True):
        locking = ", with the mean-dilatation method" if material.averaged and not modes else ""
        locking += ", with incompatible modes" if modes else ""
        yield f"Material: {material.described} in {listed(groups)}{locking}."
    if not model.materials:
        yield "Material: none yet."
    yield from _supports(model)
    for load in model.loads:
        yield f"Load: {load.name}: {_load(load)}{_history(load.ramp)}."
    for temperature in model.temperatures:
        if temperature.instant:  # the history was described at its first instant
            continue
        value = "a number for each point" if isinstance(temperature.value, np.ndarray) else _value(temperature.value)
        groups = temperature.name.removeprefix("the temperature of ")
        history, times = _history(temperature.ramp), temperature.times
        if times:
            history = f", at {len(times)} instants from {times[0]:g} to {times[-1]:g}"
        yield f"Temperature: {value} (reference: {temperature.reference:g}) in {groups}{history}."
    for load in model.heat_loads:
        history = _history(load.ramp)
        if isinstance(load, TemporaryHeat) and load.temporary:
            history += f", from {max(load.begins, 0.0):g} to {load.ends:g}"
        yield f"Heat: {load.name.removeprefix('the ')}: {', '.join(map(_value, load.values))}{history}."
    for state in model.initial_states:
        components = [f"{COMPONENTS[number]} = {value:g}" for number, value in state.components.items()]
        kind, groups = state.name.removeprefix("the initial ").split(" of ", 1)
        yield f"Initial {kind}: {', '.join(components)} in {groups}{_history(None if state.ramp == ALWAYS else state.ramp)}."
    yield from dict.fromkeys(f"Relation: {relation.name}{_history(relation.ramp)}." for relation in model.relations)
    for spring in model.springs:
        yield f"Spring: {spring.name.removeprefix('the spring ')}."
    for pair in model.contact:
        yield f"Contact '{pair.name}': {_contact(model, pair)}."
    if not model.contact:
        yield "Contact: none."
    yield (
        f"Analysis: quasi-static, with {_theory(model)}, in the load steps of the ramp given to solve (20 equal steps by "
        "default)" + ("; the contact geometry follows the deformation." if model.contact else ".")
    )


def _theory(model: Any) -> str:
    """Return the assumptions about strains, and about materials or pressures."""
    nonlinear = any(isinstance(law, NonlinearElastic) for law, _ in model.materials)
    if model.strain == "finite":
        return "finite strains and pressures that follow the surface"
    return "small strains with plasticity" if nonlinear else "small strains and linear elasticity"


def _supports(model: Any) -> Iterator[str]:
    """Yield a line for the supports of each group that share a history, and a line for the axis of symmetry."""
    by_group: dict[tuple[str, Any], list[str]] = {}
    for support in model.supports:
        texts = by_group.setdefault((support.group, support.ramp), [])
        texts.append(f"{'xyz'[support.component]} = {_value(support.value)}")
        if support.rotation is not None and support.component == model.mesh.dim - 1:
            rotation = support.rotation
            texts.append(f"rotated by {rotation.angle:g} rad about {rotation.centre}{_history(support.rotation_ramp)}")
    for (group, ramp), components in by_group.items():
        count = len(model.mesh.points_of(group))
        yield f"Support: {', '.join(components)} on '{group}' ({count} points){_history(ramp)}."
    on_axis = len(model.axis_nodes)
    if on_axis:
        yield f"Support: x = 0 at the {on_axis} points on the axis, by symmetry."
    if not (by_group or model.relations or model.springs or on_axis):
        yield "Support: none."


def _load(load: Any) -> str:
    """Return the components or values of a load."""
    components: Mapping[int, Any] | None = getattr(load, "components", None)
    if isinstance(load, Centrifugal):
        return f"speed {load.speed:g} about the axis through {load.origin} along {load.direction}"
    if components is None:
        return ", ".join(map(_value, load.values))
    return ", ".join(f"{'xyz'[axis]} = {_value(value)}" for axis, value in components.items())


def _value(value: Any) -> str:
    """Return a number, or a note that the value is a function of position or given at several load factors."""
    if isinstance(value, tuple):
        return "; ".join(f"{_value(entry)} at the load factor {instant:g}" for instant, entry in value)
    return "a function of position" if callable(value) else f"{value:g}"


def _history(ramp: Any) -> str:
    """Return a note that an item has a separate history, or an empty string."""
    return "" if ramp is None else ", with a separate history"


def _contact(model: Any, pair: ContactPair) -> str:
    """Return the sides, the formulation, the law and the options of a contact pair."""
    n_nodes = len(model.mesh.points_of(pair.secondary))
    friction = pair.options.get("friction")
    law = f"with friction {friction:g}" if friction else "without friction"
    kind = pair.options.get("kind", "unilateral")
    law = {"tied": "tied", "gap_only": "gap only, without forces"}.get(kind, law if kind == "unilateral" else kind)
    opposite = f"'{pair.primary}'" if pair.obstacle is None else pair.opposite
    further_options = sorted({*pair.options} - {"friction", "kind", "multipliers"})
    text = f" (further options: {', '.join(further_options)})" if further_options else ""
    if pair.fluid is not None:
        text += f", fluid of pressure {pair.fluid.pressure:g} from '{pair.fluid.source}'{_history(pair.fluid.ramp)}"
    return f"'{pair.secondary}' ({n_nodes} points) on {opposite}, {pair.method}, {law}{text}"
