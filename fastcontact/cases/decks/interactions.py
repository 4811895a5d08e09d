"""Surface interactions of a deck: keywords of contact properties, and the resulting options of contact pairs."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from fastcontact.cases.decks.blocks import Block, Location, Row, as_number, errors_at, look_up, register
from fastcontact.cases.decks.content import Content, Interaction, Step
from fastcontact.cases.decks.histories import JUMP
from fastcontact.contact.cohesion import INITIATION_RATIO
from fastcontact.contact.conductance import Conductance
from fastcontact.contact.overclosure import TabularLaw
from fastcontact.errors import ContactError
from fastcontact.model.model import Model

# Criteria of damage initiation and mixed-mode laws of the package, by their names in decks.
INITIATIONS = {"QUADS": "quadratic", "MAXS": "maximum"}
MIXED_MODE_LAWS = {"BK": "bk", "POWER LAW": "power"}
# Conductance of ties relative to the conductivity over the size of the model. The temperatures of the sides then differ by
# about the inverse of this number, relative to the variation of the temperature.
PERFECT = 1e8
# Clearance at which the conductance falls to zero, relative to the last clearance of a table.
JUST_BEYOND = 1.0 + 1e-9


def interaction(content: Content, block: Block) -> Interaction:
    """Read *SURFACE INTERACTION and return the new contact properties, to which the following keywords belong."""
    name = block.required("NAME")
    properties = register("surface interaction", name, content.interactions, Interaction(name, block.location), block)
    if block.rows:
        block.rows[0].number(0, 1.0)
        content.note(block.rows[0], "the thickness of the interaction has no effect; sections define the thickness")
    return properties


def changed_interaction(content: Content, step: Step, block: Block) -> Interaction:
    """Read *CHANGE FRICTION; the *FRICTION below it defines the friction from the start of the current step."""
    name = block.required("INTERACTION")
    original = look_up("surface interaction", name, content.interactions, block)
    changed = Interaction(name, block.location, friction=-1.0)  # the negative value reveals a missing *FRICTION
    original.friction_changes.append((len(content.steps) - 1, changed))
    return changed


def behaviour(content: Content, current: Interaction, block: Block) -> None:
    """Read *SURFACE BEHAVIOR: hard or tied contact, a linear, tabular or exponential penalty law, and separation."""
    law = block.choice("PRESSURE-OVERCLOSURE", ("HARD", "LINEAR", "EXPONENTIAL", "TABULAR", "TIED"))
    if law == "LINEAR":
        current.penalty = block.only_row().positive(0, "slope")
    elif law == "EXPONENTIAL":
        row = block.only_row()
        current.penalty = {"clearance": row.positive(0, "clearance"), "pressure": row.positive(1, "pressure")}
    elif law == "TABULAR":
        current.penalty = _table(block)
    elif law == "TIED":
        current.kind = "tied"
    if "NO SEPARATION" in block.parameters:
        current.kind = "bilateral_once_closed"


def _table(block: Block) -> float | list[tuple[float, float]]:
    """Return the table of overclosures [length] and pressures, or its slope if it is a straight line from the origin."""
    points = [(row.number(1), row.number(0)) for row in block.rows]
    try:
        TabularLaw("", points)
    except ContactError:
        raise block.error("TABULAR needs ascending pressures and overclosures, with a first pressure of zero") from None
    return points[1][1] / points[1][0] if len(points) == 2 and points[0][0] == 0.0 else points


def friction(content: Content, current: Interaction, block: Block) -> None:
    """Read *FRICTION: the coefficient of friction and, as in CalculiX, the stick slope [pressure / length]."""
    row = block.only_row()
    current.friction = row.number(0)
    if current.friction < 0:
        raise row.error(f"the coefficient of friction {current.friction:g} is negative")
    if row.text(1) and row.number(1):
        current.stick_slope = row.positive(1, "stick slope")
        content.note(row, f"{current.stick_slope:g} is the stick slope, shear traction divided by slip, as in CalculiX")
    if len(row.entries) > 2 and any(row.entries[2:]):
        raise row.error("friction that depends on pressure or temperature is not supported: give one coefficient")


def gap_conductance(content: Content, current: Interaction, block: Block) -> None:
    """Store *GAP CONDUCTANCE, whose meaning depends on the steps, which are read later."""
    current.conductance.append(block)


def gap_heat_generation(content: Content, current: Interaction, block: Block) -> None:
    """Read *GAP HEAT GENERATION: the fraction of the frictional work that becomes heat, half of which enters each side."""
    row = block.rows[0] if block.rows else Row(block.location, ())
    heat_fraction, secondary_fraction = row.number(0, 1.0), row.number(1, 0.5)
    if not 0.0 <= heat_fraction <= 1.0:
        raise row.error(
            f"the fraction {heat_fraction:g} of the frictional work that becomes heat must lie between 0 and 1"
        )
    if secondary_fraction != 0.5:
        raise row.error(f"the fraction of the heat on the secondary side must be 0.5, not {secondary_fraction:g}")
    if row.number(2, 0.0) > 0.0:
        raise row.error("a prescribed sliding velocity is not supported")
    current.friction_heat = block.location, heat_fraction


def store(content: Content, current: Interaction, block: Block) -> None:
    """Store *COHESIVE BEHAVIOR, *DAMAGE INITIATION or *DAMAGE EVOLUTION, which are interpreted together."""
    if block.keyword in current.cohesion:
        raise block.error(f"surface interaction '{current.name}' has this keyword twice")
    current.cohesion[block.keyword] = block


def kind_and_friction_of(content: Content, law: Interaction) -> dict[str, Any]:
    """Return the kind, the penalty and the friction of a pair without a cohesive layer."""
    options: dict[str, Any] = {} if law.kind == "unilateral" else {"kind": law.kind}
    if law.kind == "tied":
        if law.friction or law.friction_changes:
            content.note(law, "*FRICTION has no effect in tied contact")
        return options
    if options and (law.friction or law.friction_changes):
        raise law.error("friction with NO SEPARATION is not supported: leave out one of them")
    if law.penalty is not None:
        options["penalty"] = law.penalty
    options |= _friction_of(law, len(content.steps))
    return options | _friction_heat_of(content, law) if "friction" in options and content.heat else options


def _friction_of(law: Interaction, n_steps: int) -> dict[str, Any]:
    """Return the friction options of a pair, whose coefficient *CHANGE FRICTION changes at the start of steps."""
    table, stick_slopes = [(0.0, law.friction)], {law.stick_slope} if law.friction else set()
    for n_before, changed in law.friction_changes:
        if changed.friction < 0.0 or changed.penalty is not None or changed.kind != law.kind:
            raise changed.error("must be followed by *FRICTION and by no other change of the interaction")
        table += [(float(n_before), table[-1][1]), (n_before + JUMP, changed.friction)]
        stick_slopes |= {changed.stick_slope} if changed.friction else set()
        if len(stick_slopes) > 1:
            raise changed.error("a change of the stick slope is not supported: repeat the earlier slope")
    largest = max(value for _, value in table)
    if not largest:
        return {}
    options: dict[str, Any] = {"friction": largest, "tangential_penalty": stick_slopes.pop()}
    if law.friction_changes:
        points = {**dict(table), float(n_steps): table[-1][1]}
        options["friction_ramp"] = [(time, value / largest) for time, value in sorted(points.items())]
    return options


def cohesion_of(content: Content, law: Interaction) -> dict[str, Any]:
    """Return the options of a pair for its cohesive layer; a layer without stiffness and damage is a tie.

    Raises CaseError if the law of the deck is not supported.
    """
    blocks = law.cohesion
    names = ("COHESIVE BEHAVIOR", "DAMAGE INITIATION", "DAMAGE EVOLUTION")
    behaviour, initiation, evolution = map(blocks.get, names)
    if behaviour is None:
        first = next(iter(blocks.values()))
        raise first.error(f"surface interaction '{law.name}' has no *COHESIVE BEHAVIOR")
    if law.friction or law.friction_changes or law.penalty is not None or law.kind != "unilateral":
        raise behaviour.error("a cohesive layer excludes *FRICTION, NO SEPARATION, and tied or soft contact")
    stiffness = _stiffness(behaviour)
    if initiation is None and evolution is None and stiffness is None:
        content.note(behaviour, "the layer has neither stiffness nor damage, so the sides are tied")
        return {"kind": "tied"}
    if initiation is None or evolution is None:
        raise behaviour.error("*DAMAGE INITIATION and *DAMAGE EVOLUTION are both needed")
    strength, shear = _opening_and_shear(initiation, "strengths")
    criterion = INITIATIONS[initiation.choice("CRITERION", tuple(INITIATIONS))]
    constants = {"strength": strength, "shear_strength": shear, "initiation": criterion}
    constants.update(_evolution(evolution, constants, stiffness))
    if stiffness is None:
        opening = f"{INITIATION_RATIO:g} of the opening at which it fails"
        content.note(behaviour, f"without a stiffness, damage begins at {opening}")
    else:
        constants["stiffness"] = stiffness
    content.note(behaviour, "sides that are pressed together have the stiffness of the layer, even where it is broken")
    return {"cohesion": constants}


def _stiffness(block: Block) -> float | None:
    """Return the stiffness [pressure / length] of a layer, or None. Raises CaseError if it depends on the direction."""
    block.choice("TYPE", ("UNCOUPLED",))
    block.choice("ELIGIBILITY", ("CURRENT CONTACTS", "ORIGINAL CONTACTS"))
    if not block.rows:
        return None
    row = block.only_row("modes or fields")
    values = {row.number(index, row.number(0)) for index in range(3)}
    if len(values) > 1:
        raise row.error("a layer must have the same stiffness for opening and for sliding")
    return row.positive(0, "stiffness")


def _evolution(block: Block, initiation: dict[str, Any], stiffness: float | None) -> dict[str, Any]:
    """Return the fracture energies [force / length] and the mixed-mode law of a layer with these constants of initiation."""
    block.choice("SOFTENING", ("LINEAR",))
    block.choice("MODE MIX RATIO", ("ENERGY",))
    kind = block.choice("TYPE", ("DISPLACEMENT", "ENERGY"))
    mode = block.choice("MIXED MODE BEHAVIOR", ("TABULAR", *MIXED_MODE_LAWS))
    if kind == "ENERGY" and mode in MIXED_MODE_LAWS:
        energy, shear = _opening_and_shear(block, "energies")
        power = as_number(block.location, block.required("POWER"))
        return {"energy": energy, "shear_energy": shear, "mixed_mode": MIXED_MODE_LAWS[mode], "exponent": power}
    if mode in MIXED_MODE_LAWS:
        raise block.error(f"MIXED MODE BEHAVIOR={mode} requires TYPE=ENERGY")
    value = block.only_row("modes or fields").positive(0, "number")
    if kind == "ENERGY":
        return {"energy": value, "shear_energy": value}
    strength = initiation["strength"]
    if initiation["initiation"] != "quadratic" or initiation["shear_strength"] != strength:
        raise block.error("TYPE=DISPLACEMENT is supported only with CRITERION=QUADS and equal strengths: give energies")
    failure_opening = value / (1.0 - INITIATION_RATIO) if stiffness is None else strength / stiffness + value
    return {"energy": 0.5 * strength * failure_opening}


def _opening_and_shear(block: Block, quantity: str) -> tuple[float, float]:
    """Return the numbers for opening and for sliding. Raises CaseError if those of the two shear directions differ."""
    row = block.only_row("modes or fields")
    values = [row.positive(index, "number") for index in range(3)]
    if values[1] != values[2]:
        raise row.error(
            f"the {quantity} along both shear directions must be the same, not {values[1]:g} and {values[2]:g}"
        )
    return values[0], values[1]


def conductance_of(content: Content, law: Interaction) -> dict[str, Any]:
    """Return the option `conductance` of a pair, a number or tables by pressure and gap, or an empty dictionary."""
    constant, tables = None, {}  # type: float | None, dict[str, Any]
    for block in law.conductance:
        rows = [(row.number(1, 0.0), row.number(0)) for row in block.rows]
        if len({row.number(2, 0.0) for row in block.rows}) > 1:
            raise block.error("a conductance that depends on the temperature is not supported: give one table")
        if not rows or any(b[0] <= a[0] for a, b in pairwise(rows)):
            raise block.error("needs conductances with ascending pressures or clearances")
        if len(rows) == 1:
            constant = rows[0][1]
            continue
        explicit = "PRESSURE" in block.parameters
        variable = "pressure" if explicit or rows[-1][1] >= rows[0][1] else "gap"
        if not explicit:
            convention = "pressure, as in CalculiX" if variable == "pressure" else "clearance, as in Abaqus"
            content.note(block, f"the conductance depends on {convention}")
        tables[variable] = rows if variable == "pressure" else [*rows, (rows[-1][0] * JUST_BEYOND, 0.0)]
        if variable == "pressure" and content.heat == "uncoupled":
            content.note(block, "steps with heat alone have no pressures: closed contact conducts as at zero pressure")
    if constant is not None and tables:
        raise law.conductance[0].error("a constant conductance and a table are given: leave out one of them")
    if constant is None and not tables:
        return {}
    with errors_at(law.conductance[0]):
        Conductance(law.name, tables or constant)
    return {"conductance": tables or constant}


def _friction_heat_of(content: Content, law: Interaction) -> dict[str, Any]:
    """Return the option `friction_heat`: the fraction of the frictional work that becomes heat, divided by the step duration.

    In each step the load factor increases by 1, so that this division converts work to power.
    """
    if law.friction_heat is None:
        if law.conductance:
            content.note(law, "friction generates no heat without *GAP HEAT GENERATION, as in CalculiX")
        return {}
    location, heat_fraction = law.friction_heat
    periods = {step.period for step in content.steps}
    if len(periods) > 1:
        raise location.error("frictional heating is supported only if all steps have the same duration")
    return {"friction_heat": heat_fraction / periods.pop()}


def perfect_conductance(content: Content, model: Model, location: Location) -> Any:
    """Return the conductance of a tie [power / (area temperature)], which keeps both sides at nearly the same temperature."""
    largest = max(np.max(material.conductivity) for material, _ in model.materials)
    h = PERFECT * float(largest) / float(np.ptp(model.mesh.points, axis=0).max())
    difference = "the temperatures of the sides differ by about 1e-8 of their variation"
    content.note(location, f"the conductance is {h:.3g}; {difference}")
    return (lambda pressure, gap: np.full(gap.shape, h)) if content.heat == "uncoupled" else h
