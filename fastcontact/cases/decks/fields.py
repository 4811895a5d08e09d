"""Initial temperatures and stresses of a deck, and checks of its steps with heat conduction."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from fastcontact.cases.decks.assembled import Assembly
from fastcontact.cases.decks.blocks import Block, Location, Row
from fastcontact.cases.decks.content import Content
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.mesh.mesh import starts_of
from fastcontact.model.model import Model


def initial_conditions(content: Content, block: Block) -> None:
    """Store a block *INITIAL CONDITIONS, which gives nodal temperatures or element stresses before the first step."""
    kind = " ".join(block.required("TYPE").upper().split())
    if kind not in ("TEMPERATURE", "STRESS"):
        raise block.error(f"TYPE={kind[:40]} is not supported, only TEMPERATURE and STRESS")
    content.blocks[f"INITIAL {kind}"].append(block)


def initial_temperatures(assembly: Assembly, blocks: Iterable[Block]) -> dict[int, float]:
    """Return the initial temperatures by point; the last of several values at a point applies."""
    temperatures = (temperature_of(assembly, row) for block in blocks for row in block.iter_rows())
    return {point: value for points, value, _ in temperatures for point in points}


def temperature_of(assembly: Assembly, row: Row) -> tuple[list[int], float, Location]:
    """Return the points, the temperature and the location of a data line."""
    if any(row.entries[2:]):
        raise row.error("temperature gradients exist in beams and shells only: give a single temperature")
    value = row.number(1)
    return assembly.nodes(row.text(0), row.location), value, row.location


# Stress components in the order of a data line, by the dimension of the mesh.
STRESS_ORDER = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "xz", "yz")}


def add_initial_stresses(model: Model, deck_mesh: DeckMesh) -> None:
    """Add the initial stresses to a model; the last of several lines for an element applies.

    Raises CaseError if a line does not have exactly one value per component, or if an element is not a solid or has an
    orientation.
    """
    content, names = deck_mesh.content, STRESS_ORDER[deck_mesh.dim]
    if not content.blocks["INITIAL STRESS"]:
        return
    starts = starts_of(model.mesh.solids)
    values = np.zeros((sum(map(len, model.mesh.solids.values())), len(names)))
    for block in content.blocks["INITIAL STRESS"]:
        for row in block.iter_rows():
            if len(row.entries) != 1 + len(names):
                raise row.error(
                    f"{len(row.entries)} entries, but {1 + len(names)} are needed: an element or a set, and the components "
                    f"{', '.join(names)} of its stress; stresses by integration point are not supported"
                )
            numbers = [row.number(index) for index in range(1, 1 + len(names))]
            for element in deck_mesh.elements_of(row.text(0), row.location):
                if element.type is None:
                    raise row.error(f"element {element.number} is not a solid, so it has no initial stress")
                if element.section is not None and element.section.orientation:
                    raise row.error(
                        f"element {element.number} has an *ORIENTATION: initial stresses in local axes are not supported"
                    )
                values[starts[element.type.element] + element.row] = numbers
    components: dict[str, Any] = {name: values[:, [k]] for k, name in enumerate(names) if values[:, k].any()}
    if components:
        model.add_initial_stress(**components)


# Keywords of heat loads.
HEAT_LOADS = ("CFLUX", "DFLUX", "DSFLUX", "FILM", "SFILM")


def check_steps(content: Content) -> None:
    """Raise CaseError if the procedures or the loads of the steps are inconsistent."""
    first = next((step for step in content.steps if step.heat), None)
    for number, step in enumerate(content.steps):
        if first and step.heat != first.heat and (first.heat == "uncoupled" or number > content.steps.index(first)):
            raise step.error(
                "*HEAT TRANSFER cannot be combined with other procedures, and *COUPLED TEMPERATURE-DISPLACEMENT cannot "
                "precede them: use *HEAT TRANSFER for all steps, or *COUPLED TEMPERATURE-DISPLACEMENT for all"
            )
        for block in step.conditions:
            if block.keyword in HEAT_LOADS and not step.heat:
                raise block.error("needs a step with *HEAT TRANSFER or *COUPLED TEMPERATURE-DISPLACEMENT")
            if block.keyword == "TEMPERATURE" and first:
                raise block.error("temperatures are computed in this deck: prescribe degree of freedom 11 by *BOUNDARY")
            if block.keyword in ("CLOAD", "DLOAD", "DSLOAD") and step.heat == "uncoupled":
                raise block.error(
                    "is not a heat load: use *COUPLED TEMPERATURE-DISPLACEMENT in place of *HEAT TRANSFER"
                )


def reference_temperature(assembly: Assembly, initial: Mapping[int, float]) -> float:
    """Return the initial temperature of the solids, or zero if it is not uniform and has no effect.

    Raises CaseError if it is not uniform and a coupled step computes thermal strains.
    """
    content = assembly.content
    values = {initial.get(point, 0.0) for point in assembly.solid_points}
    if len(values) == 1:
        return values.pop()
    location = content.blocks["INITIAL TEMPERATURE"][0].location
    if content.heat == "coupled" and any(material.expansion for material in content.materials.values()):
        raise location.error(
            f"initial temperatures from {min(values):g} to {max(values):g} are not supported with thermal expansion in "
            "coupled steps: thermal strains refer to a single temperature"
        )
    content.note(location, "no effect: initial temperatures differ, and steady temperatures do not depend on them")
    return 0.0
