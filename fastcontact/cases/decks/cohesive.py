"""Cohesive surfaces of a deck: *COHESIVE BEHAVIOR, *DAMAGE INITIATION and *DAMAGE EVOLUTION as a cohesive layer."""

from __future__ import annotations

from typing import Any

from fastcontact.cases.decks.blocks import Block, as_number
from fastcontact.cases.decks.content import Content, Interaction
from fastcontact.contact.cohesion import ELASTIC

INITIATIONS = {"QUADS": "quadratic", "MAXS": "maximum"}
MODES = {"BK": "bk", "POWER LAW": "power"}


def keep(content: Content, current: Interaction, block: Block) -> None:
    """*COHESIVE BEHAVIOR, *DAMAGE INITIATION, *DAMAGE EVOLUTION: stored until all are read."""
    if block.keyword in current.cohesion:
        raise block.refuse(f"surface interaction '{current.name}' has this keyword twice")
    current.cohesion[block.keyword] = block


def stabilization(content: Content, current: Interaction, block: Block) -> None:
    """*DAMAGE STABILIZATION: without effect."""
    content.note(block, "no effect: layers break without viscosity")


def cohesion_of(content: Content, law: Interaction) -> dict[str, Any]:
    """Return the options of a pair for its cohesive layer: a tie without stiffness and damage, none without a layer.

    Raises CaseError if no law of the package matches the one of the deck.
    """
    blocks = law.cohesion
    if not blocks:
        return {}
    behaviour, initiation, evolution = (
        blocks.get(name) for name in ("COHESIVE BEHAVIOR", "DAMAGE INITIATION", "DAMAGE EVOLUTION")
    )
    if behaviour is None:
        first = next(iter(blocks.values()))
        raise first.refuse(f"surface interaction '{law.name}' has no *COHESIVE BEHAVIOR")
    if law.friction or law.changes or law.penalty is not None or law.kind != "unilateral":
        raise behaviour.refuse("*FRICTION, NO SEPARATION and soft contact beside a cohesive layer are not supported")
    stiffness = _stiffness(behaviour)
    if initiation is None and evolution is None and stiffness is None:
        content.note(behaviour, "neither stiffness nor damage: the sides are tied")
        return {"kind": "tied"}
    if initiation is None or evolution is None:
        raise behaviour.refuse("*DAMAGE INITIATION and *DAMAGE EVOLUTION are both needed: layers here break")
    strength, shear = _in_modes(initiation, "strengths")
    criterion = INITIATIONS[initiation.choice("CRITERION", tuple(INITIATIONS))]
    given = {"strength": strength, "shear_strength": shear, "initiation": criterion}
    given.update(_evolution(evolution, given, stiffness))
    if stiffness is None:
        content.note(
            behaviour,
            f"no stiffness: damage begins at {ELASTIC:g} of the opening at which the layer is broken",
        )
    else:
        given["stiffness"] = stiffness
    content.note(
        behaviour,
        "sides that are pressed together have the stiffness of the layer, also where it is broken",
    )
    return {"cohesion": given}


def _stiffness(block: Block) -> float | None:
    """Return the stiffness of a layer, None if not given; raises CaseError if it differs between the directions."""
    block.choice("TYPE", ("UNCOUPLED",))
    block.choice("ELIGIBILITY", ("CURRENT CONTACTS", "ORIGINAL CONTACTS"))
    if not block.rows:
        return None
    row = block.only("modes or fields")
    values = {row.number(index, row.number(0)) for index in range(3)}
    if len(values) > 1:
        raise row.refuse("a layer has one stiffness here, the same for opening and for sliding")
    return row.positive(0, "stiffness")


def _evolution(block: Block, given: dict[str, Any], stiffness: float | None) -> dict[str, Any]:
    """Return the fracture energies of a layer and its mixed-mode law."""
    block.choice("SOFTENING", ("LINEAR",))
    block.choice("MODE MIX RATIO", ("ENERGY",))
    kind = block.choice("TYPE", ("DISPLACEMENT", "ENERGY"))
    mode = block.choice("MIXED MODE BEHAVIOR", ("TABULAR", *MODES))
    if kind == "ENERGY" and mode in MODES:
        energy, shear = _in_modes(block, "energies")
        power = as_number(block.location, block.required("POWER"))
        return {"energy": energy, "shear_energy": shear, "mixed_mode": MODES[mode], "exponent": power}
    if mode in MODES:
        raise block.refuse(f"MIXED MODE BEHAVIOR={mode} is that of TYPE=ENERGY")
    value = block.only("modes or fields").positive(0, "number")
    if kind == "ENERGY":
        return {"energy": value, "shear_energy": value}
    strength = given["strength"]
    if given["initiation"] != "quadratic" or given["shear_strength"] != strength:
        raise block.refuse("TYPE=DISPLACEMENT is supported with CRITERION=QUADS of one strength only: give energies")
    end = value / (1.0 - ELASTIC) if stiffness is None else strength / stiffness + value
    return {"energy": 0.5 * strength * end}


def _in_modes(block: Block, quantity: str) -> tuple[float, float]:
    """Return the numbers for opening and for sliding, the latter the same along both directions."""
    row = block.only("modes or fields")
    values = [row.positive(index, "number") for index in range(3)]
    if values[1] != values[2]:
        raise row.refuse(
            f"the {quantity} along both shear directions must be the same, not {values[1]:g} and {values[2]:g}"
        )
    return values[0], values[1]
