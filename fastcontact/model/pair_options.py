"""Options of contact pairs: types of all options, and the conversion of those that do not depend on the formulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike

from fastcontact._tools.argument_types import finite_vector
from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import CohesiveLaw, cohesive_law
from fastcontact.contact.conductance import Conductance
from fastcontact.contact.overclosure import ExponentialLaw, OverclosureLaw, TabularLaw
from fastcontact.contact.pair_options import KINDS, Field, PairOptions
from fastcontact.contact.surface import Surface
from fastcontact.elasticity.loads import Value, check_number, check_value, evaluated
from fastcontact.errors import ContactError, check_known
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.ramp import History, table_of, table_value


class FormulationOptions(TypedDict, total=False):
    """Options that are arguments of formulations. Every formulation has the first five, only some have the others."""

    friction: float | None
    surface_smoothing: bool | None
    slip: str | None
    normals: str | ArrayLike | None
    projection_tolerance: float | None
    opposite: str | None
    multipliers: str | None
    augmentation: float | None
    integration: str | None
    n_gauss: int | None


class SharedOptions(TypedDict, total=False):
    """Options that do not depend on the formulation of a contact pair; units are stated in `PairOptions`."""

    kind: str | None
    clearance: Value | None
    clearance_primary: Value | None
    clearance_ramp: History
    friction_ramp: History
    excluded: str | Sequence[str] | None
    frictionless: str | Sequence[str] | None
    frictionless_along: ArrayLike | None
    penalty: float | Sequence[tuple[float, float]] | Mapping[str, float] | None
    tangential_penalty: Value | None
    cohesion: Mapping[str, float | str] | None
    adhesion: Mapping[str, float] | None
    wear: float | None
    conductance: Any
    friction_heat: float | None
    obstacle_temperature: float | None
    search_distance: float | None


class ContactOptions(FormulationOptions, SharedOptions, total=False):
    """Options of `Model.add_contact`, which describes them, except for the two sides."""


SHARED_OPTIONS = tuple(sorted(SharedOptions.__annotations__))
# Names of the required and of the optional constants of a cohesive layer and of adhesion. The values of the constants
# in CHOICES are strings; all other values are positive numbers.
LAWS = {
    "cohesion": (
        ("strength", "energy"),
        ("stiffness", "shear_strength", "shear_energy", "exponent", "initiation", "mixed_mode"),
    ),
    "adhesion": (("strength", "work"), ("stiffness",)),
}
CHOICES = {"initiation": ("bk", "quadratic", "maximum"), "mixed_mode": ("bk", "power")}


def pair_options(name: str, options: Mapping[str, Any], mesh: Mesh, side: Surface, has_obstacle: bool) -> PairOptions:
    """Return the options of contact pair `name` with the secondary `side`, converted for formulations.

    `mesh` contains the groups that options name. Raises ContactError or ModelError if an option is invalid; the message names
    the pair.
    """
    if has_obstacle and "clearance_primary" in options:
        raise ContactError(f"a rigid obstacle has no 'clearance_primary': give contact '{name}' a 'clearance'")
    _check_obstacle_temperature(name, options, has_obstacle)
    if "clearance_ramp" in options and not {"clearance", "clearance_primary"} & set(options):
        raise ContactError(f"contact '{name}' has a clearance_ramp, but no clearance that it could multiply")
    clearance_ramp = table_of(options.get("clearance_ramp"), f"the clearance_ramp of contact '{name}'")
    _check_friction_ramp(name, options)
    return PairOptions(
        _function(f"the clearance of contact '{name}'", options.get("clearance")),
        _function(f"the clearance_primary of contact '{name}'", options.get("clearance_primary")),
        excluded=_group_mask(name, "excluded", options, mesh, side),
        frictionless=_group_mask(name, "frictionless", options, mesh, side),
        frictionless_along=_vector(name, "frictionless_along", options, mesh.dim),
        kind=_kind(name, options, has_obstacle),
        penalty=_penalty(name, options),
        tangential_penalty=_tangential_penalty(name, options.get("tangential_penalty")),
        search_distance=_positive(name, "search_distance", options, "the distance is unlimited"),
        wear=_positive(name, "wear", options, "there is no wear"),
        conductance=Conductance(name, options["conductance"]) if "conductance" in options else None,
        friction_heat=_friction_heat(name, options),
        obstacle_temperature=options.get("obstacle_temperature"),
        cohesion=_cohesion(name, options),
        initial_clearance_factor=1.0 if clearance_ramp is None else table_value(clearance_ramp, 0.0),
    )


def _cohesion(name: str, options: Mapping[str, Any]) -> CohesiveLaw | None:
    """Return the cohesive law of a pair, or None if it has no such law."""
    laws = [option for option in LAWS if option in options]
    if not laws:
        return None
    exclusive = ("adhesion", "friction", "penalty", "tangential_penalty", "wear")
    excess = [option for option in exclusive if option in options and option != laws[0]]
    if excess or options.get("kind", "unilateral") != "unilateral":
        conflict = (excess or ["kind"])[0]
        raise ContactError(f"contact '{name}' has {laws[0]}, which excludes {conflict}: leave out one of the two")
    option, constants = laws[0], options[laws[0]]
    required, optional = LAWS[option]
    if not isinstance(constants, Mapping) or not set(required) <= set(constants):
        raise ContactError(f"the {option} of contact '{name}' needs {' and '.join(required)}, each given by name")
    for key, value in constants.items():
        check_known(f"constant of the {option} of contact '{name}'", key, required + optional, ContactError)
        if key in CHOICES:
            check_known(f"{key} in the {option} of contact '{name}'", value, CHOICES[key], ContactError)
            continue
        check_number(f"the {key} in the {option} of contact '{name}'", value)
        if not value > 0:
            raise ContactError(f"the {key} {value} in the {option} of contact '{name}' must be positive")
    values = {key: value if key in CHOICES else float(value) for key, value in constants.items()}
    further = {key: value for key, value in values.items() if key in optional}
    law = cohesive_law(*(values[key] for key in required), reversible=option == "adhesion", **further)
    shear_fractions = np.linspace(0.0, 1.0, 65)
    onset, end = law.limits(np.sqrt(1.0 - shear_fractions), np.sqrt(shear_fractions))
    if not (onset < end).all():
        raise ContactError(
            f"the {option} of contact '{name}' would fail before its traction decreases: its stiffness {law.stiffness:g} "
            f"must be above {law.stiffness * float((onset / end).max()):g}, strength^2 / (2 energy)"
        )
    return law


def _kind(name: str, options: Mapping[str, Any], has_obstacle: bool) -> str:
    """Return the kind of contact, after checks for contradicting options."""
    kind = options.get("kind", "unilateral")
    check_known(f"kind of contact '{name}'", kind, KINDS, ContactError)
    if kind != "unilateral" and options.get("friction"):
        raise ContactError(f"contact '{name}' is {kind}, which excludes friction: leave out 'friction' or 'kind'")
    if options.get("tangential_penalty") is not None and not options.get("friction"):
        raise ContactError(f"contact '{name}' has a tangential_penalty, but no friction that it could soften")
    if kind == "gap_only" and "penalty" in options:
        raise ContactError(f"contact '{name}' is gap_only, which has no forces: leave out 'penalty' or 'kind'")
    if kind == "tied" and has_obstacle:
        raise ContactError(
            f"contact '{name}' cannot be tied to a rigid obstacle: prescribe the displacements of the group, or couple them"
        )
    if kind != "unilateral" and "wear" in options:
        raise ContactError(f"contact '{name}' is {kind}, which does not wear: leave out 'wear' or 'kind'")
    excess = [key for key in ("clearance", "clearance_primary", "penalty", "search_distance") if key in options]
    if kind == "tied" and excess:
        raise ContactError(f"contact '{name}' is tied, which keeps the initial gaps exactly: leave out '{excess[0]}'")
    return str(kind)


def _positive(name: str, option: str, options: Mapping[str, Any], default: str) -> float | None:
    """Return the positive number of an option, or None if it is not given.

    `default` describes the effect of omitting the option, for messages.
    """
    value = options.get(option)
    if value is None:
        return None
    check_number(f"the {option} of contact '{name}'", value)
    if not value > 0:
        raise ContactError(f"{option} = {value} of contact '{name}' must be positive; without it, {default}")
    return float(value)


def _check_obstacle_temperature(name: str, options: Mapping[str, Any], has_obstacle: bool) -> None:
    """Raise ContactError for heat flow to an obstacle of unknown temperature, or a temperature without an obstacle."""
    temperature = options.get("obstacle_temperature")
    if temperature is None:
        if has_obstacle and {"conductance", "friction_heat"} & set(options):
            raise ContactError(
                f"heat flow through contact '{name}' needs the temperature of its obstacle: give it obstacle_temperature=..."
            )
        return
    check_number(f"the obstacle_temperature of contact '{name}'", temperature)
    if not has_obstacle:
        raise ContactError(f"contact '{name}' has an obstacle_temperature, but no obstacle: use fix_temperature")
    if options.get("conductance") is None:
        raise ContactError(f"contact '{name}' has an obstacle_temperature, but no conductance to the obstacle")


def _friction_heat(name: str, options: Mapping[str, Any]) -> float:
    """Return the fraction of the frictional work that becomes heat, which is zero by default."""
    fraction = options.get("friction_heat", 0.0)
    check_number(f"the friction_heat of contact '{name}'", fraction)
    if not 0.0 <= fraction <= 1.0:
        raise ContactError(f"friction_heat = {fraction} of contact '{name}' must be a fraction of the work, 0 to 1")
    if fraction and not options.get("friction"):
        raise ContactError(f"contact '{name}' has a friction_heat, but no friction that could generate it")
    return float(fraction)


def _vector(name: str, option: str, options: Mapping[str, Any], dim: int) -> Array | None:
    """Return the vector (dim,) of an option, or None if it is not given."""
    value = options.get(option)
    if value is None:
        return None
    vector = finite_vector(value, dim)
    if vector is None or not vector.any():
        raise ContactError(f"{option} = {value!r} of contact '{name}' must be a vector of {dim} numbers, not all zero")
    return vector


def _penalty(name: str, options: Mapping[str, Any]) -> float | OverclosureLaw | None:
    """Return a stiffness per area, or the law that a table or the constants of an exponential law define."""
    penalty = options.get("penalty")
    if isinstance(penalty, Mapping):
        for key, value in penalty.items():
            check_number(f"the {key} in the penalty of contact '{name}'", value)
        if set(penalty) != {"clearance", "pressure"} or min(penalty.values()) <= 0.0:
            raise ContactError(
                f"an exponential penalty of contact '{name}' needs two positive numbers, the pressure at a gap of zero and "
                "the clearance at which 1 % of this pressure remains: {'clearance': 0.001, 'pressure': 5.0}"
            )
        return ExponentialLaw(**penalty)
    if isinstance(penalty, (Sequence, np.ndarray)) and not isinstance(penalty, str):
        return TabularLaw(name, penalty)
    return _positive(name, "penalty", options, "there is no penetration")


def _tangential_penalty(name: str, value: Any) -> Field | None:
    """Return a number or a function of position as a function, and None unchanged."""
    penalty = _function(f"the tangential_penalty of contact '{name}'", value)
    return None if penalty is None else partial(_positive_values, penalty, name)


def _positive_values(penalty: Field, name: str, positions: Array) -> Array:
    """Return the tangential penalties (n,) at `positions` (n, dim). Raises ContactError if one is not positive."""
    values = penalty(positions)
    if not (values > 0).all():
        remedy = "without it, there is no elastic slip"
        raise ContactError(f"the tangential_penalty {values.min():g} of contact '{name}' must be positive; {remedy}")
    return values


def _check_friction_ramp(name: str, options: Mapping[str, Any]) -> None:
    """Raise ContactError for a ramp of friction without a coefficient of friction, or with negative multipliers."""
    caption = f"the friction_ramp of contact '{name}'"
    table = table_of(options.get("friction_ramp"), caption)
    if table is not None and not options.get("friction"):
        raise ContactError(f"contact '{name}' has a friction_ramp, but no friction that it could multiply")
    if table is not None and min(factor for _, factor in table) < 0.0:
        raise ContactError(f"{caption} has negative multipliers: coefficients are 0 or more")


def _group_mask(name: str, option: str, options: Mapping[str, Any], mesh: Mesh, side: Surface) -> Mask | None:
    """Return a mask (n_points,) of the nodes of the groups named by an option, or None if it names no group."""
    groups = options.get(option)
    if groups is None:
        return None
    groups = [groups] if isinstance(groups, str) else groups
    if not isinstance(groups, Sequence) or not all(isinstance(group, str) for group in groups):
        raise ContactError(f"{option} = {groups!r} of contact '{name}' must be a group or a list of groups")
    mask = np.zeros(mesh.n_points, bool)
    for group in groups:
        mask[mesh.points_of(group)] = True
        if not np.isin(side.points, mesh.points_of(group)).any():
            raise ContactError(
                f"group '{group}', {option} in contact '{name}', has no nodes on the secondary side '{side.group}': "
                "only that side carries constraints; swap the sides or name other nodes"
            )
    if option == "excluded" and mask[side.points].all():
        raise ContactError(f"contact '{name}' excludes all nodes of '{side.group}': no node remains for contact")
    return mask


def _function(caption: str, value: Any) -> Field | None:
    """Return a number or a function of position as a function that checks its result, and None unchanged."""
    if value is None:
        return None
    check_value(caption, value)
    return partial(evaluated, value, name=caption)
