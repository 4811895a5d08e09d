"""Temperatures and initial stresses of a deck, and the fields that they become in the model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Assembly
from fastcontact.cases.decks.blocks import Block, Location
from fastcontact.cases.decks.content import Content
from fastcontact.cases.decks.histories import ByShape, Histories
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.mesh.mesh import starts_of
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table


def initial_conditions(content: Content, block: Block) -> None:
    """Read *INITIAL CONDITIONS: nodal temperatures or element stresses before the first step."""
    kind = " ".join(block.required("TYPE").upper().split())
    if kind not in ("TEMPERATURE", "STRESS"):
        raise block.refuse(f"TYPE={kind[:40]} is not supported, only TEMPERATURE and STRESS")
    (content.initial if kind == "TEMPERATURE" else content.stresses).append(block)


def initial_temperatures(assembly: Assembly, blocks: Iterable[Block]) -> dict[int, float]:
    """Return the initial temperatures by point; the last of several values at a point is used."""
    return {point: value for block in blocks for point, value, _ in by_point(assembly, block)}


def by_point(assembly: Assembly, block: Block) -> Iterator[tuple[int, float, Location]]:
    """Yield the points of a block with their temperatures and the locations of the lines."""
    for row in block.each():
        if any(row.entries[2:]):
            raise row.refuse("gradients of the temperature are those of beams and shells: give one number")
        value = row.number(1)
        yield from ((point, value, row.location) for point in assembly.nodes(row.text(0), row.location))


def add_temperatures(model: Model, histories: Histories[int]) -> None:
    """Add temperatures relative to the initial temperatures to a model.

    There is a field for each shape of history or a field for each time with a corner of a history, whichever are fewer.
    """
    rises_of = (
        (tuple((time, value - table[0][1]) for time, value in table), points) for table, points in histories.alike()
    )
    fields = list(ByShape.of(rises_of))
    times = sorted({time for *_, table in fields for time, _ in table})
    if len(fields) <= len(times):
        for _, points, sizes, table in fields:
            rises = np.zeros(model.mesh.n_points)
            rises[points] = sizes(points) if callable(sizes) else sizes
            _add(model, rises, table)
        return
    for k, time in enumerate(times):  # fewer corners than shapes: one field for each corner
        around = sorted({times[0], *times[max(k - 1, 0) : k + 2], times[-1]})
        rises = np.zeros(model.mesh.n_points)
        for _, points, sizes, table in fields:
            instants, factors = zip(*table, strict=True)
            factor = np.interp(time, instants, factors)
            rises[points] = factor * (sizes(points) if callable(sizes) else sizes)
        _add(model, rises, tuple((other, float(other == time)) for other in around))


def _add(model: Model, rises: Array, ramp: Table) -> None:
    for section in model.pretensions:  # their opposite nodes are not in the deck
        rises[section.opposite] = rises[section.nodes]
    if rises.any() and any(factor for _, factor in ramp):
        model.add_temperature(rises, reference=0.0, ramp=ramp)


# Components in the order of a data line, by the dimension of the mesh.
ORDER = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "xz", "yz")}


def add_initial_stresses(model: Model, deck_mesh: DeckMesh) -> None:
    """Add the initial stresses to a model; the last of several lines for an element is used.

    Raises CaseError if a line has not all components, or if an element is not a solid or has an orientation.
    """
    content, names = deck_mesh.content, ORDER[deck_mesh.dim]
    if not content.stresses:
        return
    starts = starts_of(model.mesh.solids)
    values = np.zeros((sum(map(len, model.mesh.solids.values())), len(names)))
    for block in content.stresses:
        for row in block.each():
            if len(row.entries) != 1 + len(names):
                raise row.refuse(
                    f"{len(row.entries)} entries, but {1 + len(names)} are needed: an element or a set, and the components "
                    f"{', '.join(names)} of its stress; stresses by integration point are not supported"
                )
            numbers = [row.number(index) for index in range(1, 1 + len(names))]
            for element in deck_mesh.elements_of(row.text(0), row.location):
                if element.type is None:
                    raise row.refuse(f"element {element.number} is not a solid, so it has no initial stress")
                if element.section is not None and element.section.orientation:
                    raise row.refuse(
                        f"element {element.number} has an *ORIENTATION: initial stresses along such axes are not supported"
                    )
                values[starts[element.type.element] + element.row] = numbers
    given: dict[str, Any] = {name: values[:, [k]] for k, name in enumerate(names) if values[:, k].any()}
    if given:
        model.add_initial_stress(**given)
