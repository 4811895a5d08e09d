"""Derivatives of the residual with respect to material constants, by central differences at the solution."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fastcontact.analysis.sensitivity.moving_contact import CHANGED, MovingContact
from fastcontact.analysis.sensitivity.quantities import Label
from fastcontact.arrays import Array
from fastcontact.elasticity.anisotropic_materials import NAMES, Anisotropic, Orthotropic
from fastcontact.elasticity.materials import LinearElastic, Material
from fastcontact.elasticity.varying_constants import varying
from fastcontact.errors import ModelError, unknown
from fastcontact.model.model import Model
from fastcontact.model.ramp import combined

# Constants, and the names of their components for an orthotropic material.
CONSTANTS = {"E": "123", "nu": NAMES, "G": NAMES, "expansion": "123"}


def by_constant(contact: MovingContact, parameter: Label) -> tuple[Array, Array | None]:
    """Return the derivatives of `Change.out` (n_dofs,) and `Change.sample` with respect to a constant, None for zero."""
    model, name = contact.problem.model, str(parameter[0])
    number, material, component = _constant_of(model, parameter)
    step = CHANGED * _room(material, name, component)

    def at(by: float) -> MovingContact:
        made = copy.copy(model)
        made.materials = [
            (_changed(m, name, component, by) if i == number else m, groups)
            for i, (m, groups) in enumerate(model.materials)
        ]
        pairs = {pair.name: made.bind(pair, contact.problem.pairs[pair.name].held) for pair in made.contact}
        return replace(contact, problem=replace(contact.problem, model=made, pairs=pairs))

    # Central differences of fourth order in the step.
    forces = [weight * (_inside(at(far * step)) - _inside(at(-far * step))) for far, weight in ((1, 8.0), (2, -1.0))]
    return (forces[0] + forces[1]) / (12.0 * step), contact.along(at, step) if contact.problem.pairs else None


def check_constant(model: Model, parameter: Label) -> None:
    """Raise ModelError if no material has such a constant, or the constant varies."""
    _constant_of(model, parameter)


def _constant_of(model: Model, parameter: Label) -> tuple[int, Material, int | None]:
    """Return the number of a material in the model, the material, and the requested component."""
    matches = [
        (i, material) for i, (material, groups) in enumerate(model.materials)
        if parameter[1] == i or (groups is not None and parameter[1] in groups)
    ]  # fmt: skip
    if not matches:
        names = [name for _, groups in model.materials for name in groups or ()]
        raise ModelError(unknown("material", str(parameter[1]), [*names, *map(str, range(len(model.materials)))]))
    (number, material), name = matches[0], str(parameter[0])
    value = getattr(material, name, None)
    components = value if isinstance(value, tuple) else (value,)
    if value is None or any(map(varying, components)):
        raise ModelError(
            f"the material {parameter[1]!r} has no {name}, or one that varies: its sensitivity is not available"
        )
    return number, material, _component(parameter, list(CONSTANTS[name]) if len(components) > 1 else [])


def _component(parameter: Label, names: Sequence[str]) -> int | None:
    """Return the number of the requested component; None if a constant has only one, or all are requested."""
    if len(parameter) == 2 and (not names or parameter[0] == "expansion"):
        return None
    if len(parameter) == 2:
        raise ModelError(f"{parameter[0]} of the material {parameter[1]!r} has components: request (..., '{names[0]}')")
    if str(parameter[2]) not in names:
        raise ModelError(unknown(f"component of {parameter[0]}", str(parameter[2]), names))
    return names.index(str(parameter[2]))


def _room(material: Material, name: str, component: int | None) -> float:
    """Return the approximate range by which a constant may change, with all others fixed."""
    value = getattr(material, name)
    if name == "expansion":  # forces are linear in it
        return 1.0 / CHANGED
    if name != "nu":
        return float(value if component is None else value[component])
    if isinstance(material, LinearElastic):
        return min(0.5 - value, 1.0 + value)
    assert isinstance(material, Orthotropic)
    assert component is not None
    i, j = (int(axis) - 1 for axis in NAMES[component])
    S = material.local_compliance[:3, :3]
    size = np.sqrt(np.diag(S))
    return float(np.linalg.eigvalsh(S / np.outer(size, size))[0] * size[j] / size[i])


def _changed(material: Material, name: str, component: int | None, by: float) -> Material:
    """Return the material with a constant, or one of its components, changed by `by`."""
    value = getattr(material, name)
    if isinstance(value, tuple):
        value = tuple(v + by * (component in (None, i)) for i, v in enumerate(value))
    else:
        value = value + by
    if isinstance(material, LinearElastic):
        volumetric = "mean_dilatation" if material.averaged else "plain"
        return replace(
            material, **{"volumetric": volumetric, "incompatible_modes": material.incompatible_modes, name: value}
        )
    assert isinstance(material, Orthotropic | Anisotropic)
    return replace(material, **{name: value})


def _inside(contact: MovingContact) -> Array:
    """Return the internal forces (n_dofs,) minus those of thermal expansion and initial states [force]."""
    problem = contact.problem
    model = problem.model
    force = np.zeros(len(contact.u))
    inside = model.internal_forces(problem.displacement(contact.u))
    for by_ramp in (model.thermal_forces_by_ramp(), model.initial_forces_by_ramp()):
        if by_ramp:
            inside = inside - combined(by_ramp, problem.ramp, contact.instant, problem.displacement(contact.u).shape)
    force[: model.n_dofs] = inside.ravel()
    return force
