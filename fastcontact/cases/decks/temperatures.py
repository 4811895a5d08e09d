"""Temperatures of a deck: initial values, histories over the steps, and temperature loads of the model."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Assembly
from fastcontact.cases.decks.blocks import Block, Location
from fastcontact.cases.decks.content import Content, Given, Material
from fastcontact.cases.decks.histories import ByShape, Histories
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

# Numbers of coefficients of expansion and conductivity by type.
COEFFICIENTS = {"ISO": 1, "ORTHO": 3}


def expansion(content: Content, current: Material, block: Block) -> None:
    """*EXPANSION: coefficients at one temperature."""
    current.expansion = along_axes(current, block)
    if "ZERO" in block.parameters:
        content.note(
            block, "ZERO has no effect: strains count from the initial temperatures, coefficients are constant"
        )


def along_axes(current: Material, block: Block) -> float | tuple[float, ...]:
    """Return coefficients at one temperature, one for all directions or one along each axis."""
    kind = block.choice("TYPE", tuple(COEFFICIENTS))
    if len(block.rows) != 1:
        raise block.refuse(
            f"material '{current.name}': {len(block.rows)} data lines where one is needed: coefficients that depend on "
            "temperatures are not supported"
        )
    row, count = block.rows[0], COEFFICIENTS[kind]
    values = tuple(row.number(index) for index in range(count))
    if any(row.entries[count + 1 :]):
        raise row.refuse(f"material '{current.name}': TYPE={kind} has {count} coefficients, at one temperature")
    return values[0] if kind == "ISO" else values


def conductivity_of(material: Material, block: Block) -> float | tuple[float, ...]:
    """Return the conductivity of a material, one or three along its axes; raises CaseError unless all are positive."""
    values = along_axes(material, block)
    if not np.min(values) > 0.0:
        raise block.refuse(f"material '{material.name}': the conductivity {np.min(values):g} must be positive")
    return values


def initial_conditions(content: Content, block: Block) -> None:
    """*INITIAL CONDITIONS: nodal temperatures or element stresses before the first step."""
    kind = " ".join(block.required("TYPE").upper().split())
    if kind not in ("TEMPERATURE", "STRESS"):
        raise block.refuse(f"TYPE={kind[:40]} is not supported, only TEMPERATURE and STRESS")
    (content.initial if kind == "TEMPERATURE" else content.stresses).append(block)


def initial_temperatures(assembly: Assembly, blocks: Iterable[Block]) -> dict[int, float]:
    """Return initial temperatures by point; of several for a point, the last one counts."""
    return {point: value for block in blocks for point, value, _ in _by_point(assembly, block)}


def give(assembly: Assembly, histories: Histories[int], given: Given) -> None:
    """Set the temperatures of a *TEMPERATURE for the current step."""
    if given.new:
        histories.forget()
    for point, value, location in _by_point(assembly, given.block):
        histories.give(point, value, given.amplitude, location)


def _by_point(assembly: Assembly, block: Block) -> Iterator[tuple[int, float, Location]]:
    """Yield the temperatures of a block by point, with the location of each."""
    for row in block.each():
        if any(row.entries[2:]):
            raise row.refuse("gradients of the temperature are those of beams and shells: give one number")
        value = row.number(1)
        yield from ((point, value, row.location) for point in assembly.nodes(row.text(0), row.location))


def add_temperatures(model: Model, histories: Histories[int]) -> None:
    """Add the temperatures relative to the initial ones to a model, with as few fields as the histories allow."""
    fields = list(ByShape.of((_rise(table), points) for table, points in histories.alike()))
    times = sorted({time for *_, table in fields for time, _ in table})
    if len(fields) <= len(times):
        for _, points, sizes, table in fields:
            rises = np.zeros(model.mesh.n_points)
            rises[points] = sizes(points) if callable(sizes) else sizes
            _add(model, rises, table)
        return
    for k, time in enumerate(times):  # histories that differ between nodes: one field for each of their corners
        around = sorted({times[0], *times[max(k - 1, 0) : k + 2], times[-1]})
        rises = np.zeros(model.mesh.n_points)
        for _, points, sizes, table in fields:
            instants, factors = zip(*table, strict=True)
            factor = np.interp(time, instants, factors)
            rises[points] = factor * (sizes(points) if callable(sizes) else sizes)
        _add(model, rises, tuple((other, float(other == time)) for other in around))


def _rise(table: Table) -> Table:
    return tuple((time, value - table[0][1]) for time, value in table)


def _add(model: Model, rises: Array, ramp: Table) -> None:
    for section in model.pretensions:  # their opposite nodes are not in the deck
        rises[section.opposite] = rises[section.nodes]
    if rises.any() and any(factor for _, factor in ramp):
        model.add_temperature(rises, ramp=ramp)
