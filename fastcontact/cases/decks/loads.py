"""Loads of the model of a deck: forces, pressures, body forces, temperatures, heat loads and initial stresses.

Loads on cells and facets need groups of the mesh. The functions for these loads create the groups before the mesh exists, and
return functions that add the loads to the model later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from itertools import chain
from typing import Any

import numpy as np

from fastcontact._tools.grouping import grouped
from fastcontact.arrays import Array, Indices
from fastcontact.cases.decks.assembled import Element, Face, Target
from fastcontact.cases.decks.blocks import key_of
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.histories import Histories, Period, ShapeGroups
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.elasticity.inertia_loads import Centrifugal
from fastcontact.mesh.mesh import starts_of
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table
from fastcontact.round_off import ROUND_OFF

# A function that adds a load to a model.
Adder = Callable[[Model], None]


def point_group(model: Model, deck_mesh: DeckMesh, kind: str, points: Iterable[int]) -> str:
    """Return the name of a group of points of the mesh; the group is created unless one with these points exists."""
    name = deck_mesh.add_points(f"{kind} {len(deck_mesh.point_groups)}", points)
    if name not in model.mesh.point_groups:
        model.mesh = model.mesh.with_groups(points={name: deck_mesh.point_groups[name]})
    return name


def add_forces(model: Model, deck_mesh: DeckMesh, conditions: Conditions, thickness: float) -> None:
    """Add the nodal forces; those along local axes are resolved into their global components."""
    by_shape = ShapeGroups[int]()
    for table, components in conditions.forces.distinct_tables():
        by_cosine: dict[tuple[int, float], list[int]] = {}
        for point, axis, local in components:
            direction = conditions.directions[point][axis] if local else np.eye(3)[axis]
            for k in np.flatnonzero(np.abs(direction[: deck_mesh.dim]) > ROUND_OFF).tolist():
                by_cosine.setdefault((k, float(direction[k])), []).append(point)
        for (k, cosine), points in by_cosine.items():
            by_shape.add(k, tuple((t, v * cosine / thickness) for t, v in table), points)
    for axis, nodes, value, table in by_shape:
        if any(factor for _, factor in table):
            group = point_group(model, deck_mesh, "force", nodes)
            model.add_force(group, distribute=False, ramp=table, **{"xyz"[axis]: value})


def distributed_loads(deck_mesh: DeckMesh, histories: Histories[Target]) -> list[Adder]:
    """Return functions that add pressures, forces per volume, heat fluxes and heat sources."""
    by_shape = ShapeGroups[tuple[str, str, tuple[float, ...], str]]()
    for table, loads in histories.distinct_tables():
        for load in loads:
            for cell, factor, rows in _cells_of(deck_mesh, load):
                scaled = tuple((time, factor * value) for time, value in table)
                by_shape.add((load.keyword, load.kind, load.numbers, cell), scaled, rows)
    adders: list[Adder] = []
    uniform = chain.from_iterable(_split(group) if group[0][1] == "CENTRIF" else [group] for group in by_shape)
    for number, ((keyword, kind, vector, cell), indices, value, table) in enumerate(uniform, start=1):
        group = f"*{keyword} {kind} {number}"
        deck_mesh.groups[group] = {cell: indices.tolist()}
        if any(multiplier for _, multiplier in table):
            adders.append(partial(_add_load, kind=kind, vector=vector, group=group, value=value, table=table))
    return adders


def _split(group: tuple[Any, Indices, Any, Table]) -> Iterable[tuple[Any, Indices, Any, Table]]:
    """Yield parts of a group of cells, see `ShapeGroups`, each with the value 1 and its own history."""
    key, indices, value, table = group
    values = value(indices) if callable(value) else np.ones(len(indices))
    for factor in np.unique(values).tolist():
        yield key, indices[values == factor], 1.0, tuple((time, factor * multiplier) for time, multiplier in table)


def _cells_of(deck_mesh: DeckMesh, load: Target) -> Iterable[tuple[str, float, list[int]]]:
    """Return the facets or solids on which a load acts, as type, factor of the load and rows of the type."""
    if load.face is not None:
        return [(cell, 1.0, rows) for cell, rows in deck_mesh.facet_rows([load.face]).items()]
    solids = [element for element in load.elements if element.type is not None]
    by_density = grouped(((e.type.element, _density(deck_mesh, e, load)), e.row) for e in solids)
    return [(cell, density, rows) for (cell, density), rows in by_density.items()]


def _add_load(model: Model, kind: str, vector: tuple[float, ...], group: str, value: Any, table: Table) -> None:
    """Add a distributed load of a `kind` of `Target` to a group."""
    if kind == "P":
        model.add_pressure(group, value, ramp=table)
    elif kind == "S":
        model.add_heat_flux(group, value, ramp=table)
    elif kind == "BF":
        model.add_heat_source(value, group, ramp=table)
    elif kind == "CENTRIF":  # without the check of the axis, since CalculiX allows any axis
        model.loads.append(Centrifugal((group,), 1.0, vector[:3], vector[3:], table))  # type: ignore[arg-type]
    else:
        model.add_body_force(group, ramp=table, **_body_force(kind, vector, value, model.mesh.dim))


def _density(deck_mesh: DeckMesh, element: Element, load: Target) -> float:
    """Return the factor of a load at an element: the density of its material for gravity, otherwise 1."""
    if load.kind[0] == "B":
        return 1.0
    material = deck_mesh.content.materials[key_of(element.section.material)]
    if material.density is None:
        raise load.location.error(f"material '{material.name}' has no *DENSITY, which {load.kind} requires")
    return material.density if load.kind == "GRAV" else 1.0


def _body_force(kind: str, vector: tuple[float, ...], value: Any, dim: int) -> dict[str, Any]:
    """Return the components of a body force for a load multiplier of 1, times the factor `value` of the cells."""

    def scaled(component: float) -> Any:
        return component if not callable(value) else lambda points: component * value(points)

    if kind[0] == "B":
        return {kind[1].lower(): scaled(1.0)}
    return {"xyz"[k]: scaled(vector[k]) for k in range(dim) if vector[k]}


def add_temperatures(model: Model, histories: Histories[int]) -> None:
    """Add temperature changes from the initial temperatures to a model.

    Histories that differ only by a factor share a field. If the histories have corners at fewer times than there are such
    fields, one field for each of these times is added instead.
    """
    fields = list(ShapeGroups.of((_rise(table, table[0][1]), points) for table, points in histories.distinct_tables()))
    times = sorted({time for *_, table in fields for time, _ in table})
    at_times = np.zeros((len(times), model.mesh.n_points))
    for _, points, values, table in fields:
        change = values(points) if callable(values) else values
        if len(fields) > len(times):
            at_times[:, points] = np.outer(np.interp(times, *np.transpose(table)), change)
        elif any(factor for _, factor in table):
            field = np.zeros(model.mesh.n_points)
            field[points] = change
            model.add_temperature(_copy_to_opposite_sides(model, field), reference=0.0, ramp=table)
    if len(fields) > len(times):
        model.add_temperature(_copy_to_opposite_sides(model, at_times), reference=0.0, times=times)


def _copy_to_opposite_sides(model: Model, values: Array) -> Array:
    """Return nodal values (..., n_points), copied to the opposite sides of pretension sections, which the deck lacks."""
    for section in model.pretensions:
        values[..., section.opposite] = values[..., section.nodes]
    return values


def heat_loads(deck_mesh: DeckMesh, conditions: Conditions, thickness: float) -> list[Adder]:
    """Return functions that add the prescribed temperatures, nodal heat flows and films.

    `thickness` [length] converts nodal heat flows to flows per unit thickness.
    """
    adders: list[Adder] = []
    reference, steps = conditions.reference, deck_mesh.content.steps
    begin = next((number for number, step in enumerate(steps) if step.heat), 0)
    rises = ShapeGroups[tuple[float, float]]()
    for table, period, points in conditions.fixed_temperatures.tables_by_period():
        if period.ends > begin:
            rises.add(_span(period, begin), _rise(table, reference), points)
    for (begins, ends), nodes, value, table in rises:
        group = deck_mesh.add_points(f"temperature {len(adders)}", nodes)
        fix = partial(Model.fix_temperature, begins=begins, ends=ends)
        adders.append(partial(fix, group=group, value=_absolute_temperature(value, reference), ramp=table))
    for _, nodes, value, table in ShapeGroups.of(conditions.powers.distinct_tables()):
        group = deck_mesh.add_points(f"heat {len(adders)}", nodes)
        powers = tuple((time, power / thickness) for time, power in table)
        adders.append(partial(Model.add_nodal_heat, group=group, value=value, ramp=powers))
    faces_by_film: dict[tuple[Table, float, tuple[float, float]], list[Face | None]] = {}
    for table, period, films in conditions.films.tables_by_period():
        for film in films if period.ends > begin else ():
            faces_by_film.setdefault((table, film.numbers[0], _span(period, begin)), []).append(film.face)
    for (table, coefficient, (begins, ends)), faces in faces_by_film.items():
        group = deck_mesh.add_facets(f"film {len(adders)}", filter(None, faces))
        rise = _rise(table, reference)
        peak = max((value for _, value in rise), key=abs)
        ramp = tuple((time, value / peak) for time, value in rise) if peak else None
        add = partial(Model.add_film, begins=begins, ends=ends)
        adders.append(partial(add, group=group, coefficient=coefficient, ambient=reference + peak, ramp=ramp))
    return adders


def _rise(table: Table, reference: float) -> Table:
    """Return a history minus a reference value."""
    return tuple((time, value - reference) for time, value in table)


def _span(period: Period, begin: float) -> tuple[float, float]:
    """Return the load factors of a period, with minus infinity for a start at or before `begin`, when conduction starts."""
    return period.begins if period.begins > begin else -np.inf, period.ends


def _absolute_temperature(value: Any, reference: float) -> Any:
    """Return the temperature for a rise `value` above the reference; both are numbers or functions of the position."""

    def absolute(points: Array) -> Array:
        return np.asarray(value(points) + reference)

    return absolute if callable(value) else value + reference


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
