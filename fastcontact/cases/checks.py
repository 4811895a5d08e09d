"""Checks of a case, which compare quantities of the last step with a theory or a documented value."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from operator import attrgetter
from typing import Any

import numpy as np

from fastcontact.analysis.resultants import contact_moment
from fastcontact.cases.keys import NUMBER, check_keys
from fastcontact.errors import CaseError, check_known, unknown
from fastcontact.results.step import ContactResult, StepResult

Table = Mapping[str, Any]  # of a case file

STRESS = {"xx": 0, "yy": 1, "zz": 2, "xy": 3, "yz": 4, "xz": 5}
_AXES = {"x": 0, "y": 1, "z": 2}
# Quantities that exist in three dimensions only.
ONLY_IN_3D = ("stress.yz", "stress.xz", "displacement.z", "force.z", "moment.x", "moment.y")
# Quantities that require an option of the pair: the option, and the message if it is missing.
REQUIRED_OPTIONS = {
    "torque": ("rotation", "only an obstacle with a 'rotation' has one"),
    "heat": ("conductance", "only a contact with the option 'conductance' transmits heat"),
    "wear_max": ("wear", "only a contact with the option 'wear' has one"),
}


def contact_at_point(step: StepResult, point: int) -> tuple[ContactResult, int] | None:
    """Return the last contact with a point on its secondary side, and the row of the point, or None if there is none."""
    for contact in reversed(step.contact.values()):
        rows = np.flatnonzero(contact.points == point)
        if len(rows):
            return contact, int(rows[0])
    return None


def _midpoint(bounds: tuple[float, float]) -> float:
    """Return the midpoint of the bounds of a radius [length], or the lower bound if the upper one is not finite."""
    lower, upper = bounds
    return 0.5 * (lower + upper) if math.isfinite(upper) else lower


def _contact_field(field: str) -> Callable[[StepResult, int], float]:
    """Return a function of step and point: the magnitude of a contact field; NaN if the point is on no secondary side."""

    def value(step: StepResult, point: int) -> float:
        contact, row = contact_at_point(step, point) or (None, 0)
        return math.nan if contact is None else float(np.linalg.norm(getattr(contact, field)[row]))

    return value


def _component(vector: Callable[..., Any], index: int) -> Callable[..., Any]:
    """Return a function with the arguments of `vector` that returns one component of its result."""
    return lambda *arguments: vector(*arguments)[index]


# Quantities of a contact pair: the kind of unit, and the function that returns the quantity, or None if it is undefined.
PAIR_QUANTITIES: dict[str, tuple[str, Callable[[ContactResult], Any]]] = {
    "force": ("force", lambda contact: np.linalg.norm(contact.force)),
    "pressure_max": ("pressure", lambda contact: contact.pressure_max),
    "radius": ("length", lambda contact: _midpoint(contact.radius)),
    "stick_radius": ("length", lambda contact: _midpoint(contact.stick_radius)),
    "torque": ("moment", lambda contact: contact.torque),
    "wear_max": ("length", lambda contact: None if contact.wear is None else contact.wear.max(initial=0.0)),
    "heat": ("power", lambda contact: None),  # `measured` reads it from the step
    **{f"force.{axis}": ("force", _component(lambda contact: contact.force, i)) for axis, i in _AXES.items()},
    **{f"moment.{axis}": ("moment", _component(contact_moment, i)) for axis, i in {**_AXES, "z": -1}.items()},
}  # fmt: skip
# Quantities of a probe: the kind of unit, and the function that returns the quantity at a point in a step.
PROBE_QUANTITIES: dict[str, tuple[str, Callable[[StepResult, int], Any]]] = {
    "pressure": ("pressure", _contact_field("pressure")),
    "shear": ("pressure", _contact_field("shear")),
    "von_mises": ("pressure", lambda step, point: step.von_mises[point]),
    "temperature": (
        "temperature", lambda step, point: None if step.temperature is None else step.temperature[point]),
    **{f"stress.{c}": ("pressure", _component(lambda step, p: step.stress[p], i)) for c, i in STRESS.items()},
    **{f"displacement.{a}": ("length", _component(lambda step, p: step.displacement[p], i)) for a, i in _AXES.items()},
}  # fmt: skip


def kind_of_unit(quantity: str) -> str | None:
    """Return the kind of the unit of a quantity such as ``"PAIR.force"`` or ``"PROBE.stress.yy"``; None if it is unknown."""
    return {**PROBE_QUANTITIES, **PAIR_QUANTITIES}.get(quantity.partition(".")[2], (None,))[0]


@dataclass(frozen=True)
class Check:
    """Comparison of a quantity of the last step with a theory or a documented value.

    Attributes
    ----------
    name : str
        Name of the check.
    quantity : str
        Quantity of a probe: ``"PROBE.pressure"``, ``"PROBE.shear"``, ``"PROBE.von_mises"``, ``"PROBE.temperature"``,
        ``"PROBE.stress.yy"`` or ``"PROBE.displacement.x"``. Quantity of a contact pair: ``"PAIR.force"`` and its
        component ``"PAIR.force.x"``, on the secondary side; ``"PAIR.pressure_max"``; ``"PAIR.radius"`` or
        ``"PAIR.stick_radius"``, the midpoint of the bounds; ``"PAIR.moment.z"``, about the middle of the contact;
        ``"PAIR.torque"``, of a rotating obstacle about its axis; ``"PAIR.wear_max"``, the largest wear depth; or
        ``"PAIR.heat"``, the heat flow to the primary side.
    tolerance : float
        Largest admissible relative deviation [-].
    theory : str
        Contact pair whose theory provides the target; empty for a documented value.
    of : str
        Name of the target in the theory, such as ``"stick_radius"`` or ``"normal.pressure_max"``. For a stress, the
        sign of the target is reversed, since pressures are positive in compression.
    value : float, optional
        The documented value [unit of the quantity].
    source : str
        Source of the documented value.
    factor : float
        Factor by which the quantity is multiplied before the comparison [-]. Its default is 1, except for forces if the
        model represents a fraction of the theory's contact: 4 for a quarter.
    """

    name: str
    quantity: str
    tolerance: float
    theory: str = ""
    of: str = "pressure_max"
    value: float | None = None
    source: str = ""
    factor: float = 1.0

    @property
    def unit(self) -> str:
        """Kind of unit: ``"pressure"``, ``"force"``, ``"moment"``, ``"length"``, ``"power"`` or ``"temperature"``."""
        return kind_of_unit(self.quantity) or ""

    def target(self, theory: Any) -> float:
        """Return the target; `theory` is the theory of the pair, or None for a documented value."""
        if theory is None:
            assert self.value is not None
            return self.value
        number = float(attrgetter(self.of)(theory))
        return -number if ".stress." in self.quantity and self.theory else number

    def description(self) -> str:
        """Return a one-line description of the comparison."""
        source = f" ({self.source})" if self.source else ""
        against = f"the theory's {self.of}" if self.theory else f"{self.value:g}{source}"
        return f"{self.quantity} against {against} within {self.tolerance:g}"


CHECK: dict[str, Any] = {
    **dict.fromkeys(("name", "quantity", "theory", "of", "source"), str),
    **dict.fromkeys(("tolerance", "value", "factor"), NUMBER),
}


def read_check(
    where: str, entry: Table, probes: Mapping[str, int], pairs: Table, theories: Table, kinematics: str = "3d"
) -> Check:
    """Return the check that an entry of a case file describes. Raises CaseError if a key or a value is invalid."""
    check_keys(where, entry, CHECK, ("quantity", "tolerance"))
    if ("theory" in entry) == ("value" in entry):
        raise CaseError(f"{where} needs either 'theory', the name of a contact pair with a theory, or 'value'")
    owner, _, field = entry["quantity"].partition(".")
    check_known(f"contact pair or probe in {where}.quantity", owner, [*probes, *pairs], CaseError)
    quantities = defined_names(PROBE_QUANTITIES if owner in probes else PAIR_QUANTITIES, kinematics)
    check_known(f"quantity in {where}", field, quantities, CaseError)
    if owner in pairs and field in REQUIRED_OPTIONS and REQUIRED_OPTIONS[field][0] not in pairs[owner]:
        raise CaseError(f"{where}: '{owner}' has no {field}: {REQUIRED_OPTIONS[field][1]}")
    base = field.split(".")[0]
    theory = theories.get(entry.get("theory", ""), {})
    share = theory.get("share", 1.0) if base == "force" else 1.0
    defaults = {
        "name": entry["quantity"],
        "of": default_target(base, theory.get("theory")) if owner in pairs else "pressure_max",
        "factor": 1.0 / float(share),
    }
    numbers = {key: float(entry[key]) for key in ("tolerance", "value", "factor") if key in entry}
    check = Check(**{**defaults, **entry, **numbers})
    if not 0.0 < check.tolerance < math.inf:
        raise CaseError(
            f"{where}.tolerance = {check.tolerance:g} must be a positive number, e.g. 0.01 for one per cent"
        )
    if not (math.isfinite(check.factor) and check.factor):
        raise CaseError(f"{where}.factor = {check.factor:g} must be finite and nonzero")
    if check.value is not None and not math.isfinite(check.value):
        raise CaseError(f"{where}.value = {check.value:g} must be finite")
    if check.value == 0.0:
        raise CaseError(f"{where}: the value is 0, so the relative deviation is undefined; check another quantity")
    if check.theory:
        check_known(f"theory in {where}", check.theory, theories, CaseError)
        check_target(where, check, theories[check.theory]["theory"])
    return check


def default_target(quantity: str, theory: Any) -> str:
    """Return the name of the number of a theory that corresponds to a quantity of a pair, usually its own name.

    The mean of the bounds of a contact radius tends to the mean of the semi-axes if the contact is an ellipse.
    """
    return "radius_mean" if quantity == "radius" and hasattr(theory, "radius_mean") else quantity


def defined_names(names: Collection[str], kinematics: str) -> list[str]:
    """Return those `names` of quantities that the kinematics define; plane models have no force along z."""
    omitted: tuple[str, ...] = () if kinematics == "3d" else ONLY_IN_3D
    if kinematics == "axisymmetric":  # moments and radial forces cancel over the circle
        omitted = (*ONLY_IN_3D, "moment.z", "force.x")
    return [name for name in names if name not in omitted]


def check_target(where: str, check: Check, theory: Any) -> None:
    """Raise CaseError if the theory lacks the target, or if the target is zero or infinite."""
    try:
        target = check.target(theory)
    except (AttributeError, TypeError):
        public = [name for name in dir(theory) if not name.startswith("_")]
        numbers = [name for name in public if type(getattr(theory, name, None)) in NUMBER]
        raise CaseError(unknown(f"number of the theory in {where}.of", check.of, numbers)) from None
    if not (math.isfinite(target) and target):
        raise CaseError(f"{where}: the theory's {check.of} is {target:g}, so the relative deviation is undefined")


def quantity_value(quantity: str, step: StepResult, probes: Mapping[str, int]) -> float:
    """Return a quantity, such as ``"PAIR.force"``, in a step; NaN if it is undefined, such as wear without contact."""
    owner, _, field = quantity.partition(".")
    if owner in probes:
        value = PROBE_QUANTITIES[field][1](step, probes[owner])
    elif field == "heat":
        value = step.heat.get("contacts", {}).get(owner)
    else:
        value = PAIR_QUANTITIES[field][1](step.contact[owner])
    return math.nan if value is None else float(value)


def outcome(check: Check, step: StepResult, probes: Mapping[str, int], theories: Mapping[str, Any]) -> dict[str, Any]:
    """Return the entry of a check in the summary: value, target, relative deviation [-], and whether the check passed.

    If the case states a mesh-converged solution, the entry includes the deviation of the value from this solution and the
    deviation of this solution from the theory.
    """
    theory = theories[check.theory] if check.theory else {}
    owner, _, field = check.quantity.partition(".")
    if field == "force" and check.theory:
        quantity = step.contact[owner].force_against_theory(theory["share"])
    else:
        quantity = quantity_value(check.quantity, step, probes)
    value, target = check.factor * quantity, check.target(theory.get("theory"))
    solution = theory.get("mesh_converged")
    mesh_converged = check.target(solution) if hasattr(solution, check.of) else None
    return {
        **{name: getattr(check, name) for name in ("name", "quantity", "unit", "source", "tolerance")},
        "value": value,
        "target": target,
        "of": check.of if check.theory else None,
        "deviation": value / target - 1.0,
        "passed": bool(abs(value / target - 1.0) <= check.tolerance),
        "distance_to_mesh_converged": None if mesh_converged is None else value / mesh_converged - 1.0,
        "mesh_converged_deviation": None if mesh_converged is None else mesh_converged / target - 1.0,
    }
