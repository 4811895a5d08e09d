"""Loads of the model of a deck: forces, pressures, body forces, given temperatures and heat loads, from their histories.

Loads on cells and facets need groups of the mesh. Their functions create the groups before the mesh exists, and return
functions that add the loads to the model later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Element, Face, Target
from fastcontact.cases.decks.blocks import key_of
from fastcontact.cases.decks.conditions import Conditions
from fastcontact.cases.decks.histories import ByShape, Histories, Period
from fastcontact.cases.decks.meshing import DeckMesh, rows_by_type
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table

Adder = Callable[[Model], None]


def point_group(model: Model, deck_mesh: DeckMesh, kind: str, points: Iterable[int]) -> str:
    """Return the name of a group of points of the mesh; the group is created unless one with these points exists."""
    name = deck_mesh.add_points(f"{kind} {len(deck_mesh.point_groups)}", points)
    if name not in model.mesh.point_groups:
        model.mesh = model.mesh.with_groups(points={name: deck_mesh.point_groups[name]})
    return name


def add_forces(model: Model, deck_mesh: DeckMesh, conditions: Conditions, thickness: float) -> None:
    """Add the nodal forces; those along local axes are resolved into their global components."""
    by_shape = ByShape[int]()
    for table, names in conditions.forces.distinct():
        by_cosine: dict[tuple[int, float], list[int]] = {}
        for point, axis, local in names:
            direction = conditions.directions[point][axis] if local else np.eye(3)[axis]
            for k in np.flatnonzero(np.abs(direction[: deck_mesh.dim]) > 1e-12).tolist():
                by_cosine.setdefault((k, float(direction[k])), []).append(point)
        for (k, cosine), points in by_cosine.items():
            by_shape.add(k, tuple((t, v * cosine / thickness) for t, v in table), points)
    for axis, nodes, value, table in by_shape:
        if any(factor for _, factor in table):
            group = point_group(model, deck_mesh, "force", nodes)
            model.add_force(group, distribute=False, ramp=table, **{"xyz"[axis]: value})


def _on_faces(deck_mesh: DeckMesh, histories: Histories[Target]) -> ByShape[tuple[str, str]]:
    """Return the histories of the loads on faces by keyword and by type of facet."""
    by_shape = ByShape[tuple[str, str]]()
    for table, loads in histories.distinct():
        for load in loads:
            for cell, rows in deck_mesh.facet_rows([load.face] if load.face else []).items():
                by_shape.add((load.keyword, cell), table, rows)
    return by_shape


def pressures(deck_mesh: DeckMesh, conditions: Conditions) -> list[Adder]:
    """Return functions that add the pressures."""
    adders: list[Adder] = []
    for number, ((_, cell), rows, value, table) in enumerate(_on_faces(deck_mesh, conditions.loads), start=1):
        group = deck_mesh.add_cells(f"pressure {number}", cell, rows)
        if any(factor for _, factor in table):
            adders.append(partial(Model.add_pressure, group=group, value=value, ramp=table))
    return adders


def body_forces(deck_mesh: DeckMesh, conditions: Conditions) -> list[Adder]:
    """Return functions that add the body forces, weights and centrifugal forces as forces per volume."""
    by_shape = ByShape[tuple[str, tuple[float, ...], str]]()
    for table, loads in conditions.loads.distinct():
        for load in (load for load in loads if load.face is None):
            by_density: dict[tuple[str, float], list[int]] = {}
            for element in load.elements:
                if element.type is not None:
                    key = element.type.element, _density(deck_mesh, element, load)
                    by_density.setdefault(key, []).append(element.row)
            for (cell, density), members in by_density.items():
                scaled = tuple((time, density * value) for time, value in table)
                by_shape.add((load.kind, load.numbers, cell), scaled, members)
    adders: list[Adder] = []
    for number, ((kind, vector, cell), rows, value, table) in enumerate(by_shape, start=1):
        group = deck_mesh.add_cells(f"load {number}", cell, rows)
        components = _body_force(kind, vector, value, deck_mesh.dim)
        adders.append(partial(Model.add_body_force, groups=group, ramp=table, **components))
    return adders


def _density(deck_mesh: DeckMesh, element: Element, load: Target) -> float:
    """Return the factor of a body force at an element: the density of its material, or 1 for a force per volume."""
    if load.kind[0] == "B":
        return 1.0
    material = deck_mesh.content.materials[key_of(element.assigned_section.material)]
    if material.density is None:
        raise load.location.refuse(f"material '{material.name}' has no *DENSITY, which {load.kind} requires")
    return material.density


def _body_force(kind: str, vector: tuple[float, ...], value: Any, dim: int) -> dict[str, Any]:
    """Return the components of a body force for a load multiplier of 1, times the factor `value` of the cells."""

    def times(component: Any) -> Any:
        if not callable(value):
            return component
        return lambda points: value(points) * (component(points) if callable(component) else component)

    if kind[0] == "B":
        return {kind[1].lower(): times(1.0)}
    if kind == "GRAV":
        direction = np.array(vector) / np.linalg.norm(vector)
        return {"xyz"[k]: times(float(direction[k])) for k in range(dim) if direction[k]}
    origin, axis = np.array(vector[:3]), np.array(vector[3:])
    axis = axis / np.linalg.norm(axis)

    def outward(k: int, points: Array) -> Array:
        relative = np.pad(points, ((0, 0), (0, 3 - points.shape[1]))) - origin
        return np.asarray((relative - np.outer(relative @ axis, axis))[:, k])

    return {"xyz"[k]: times(partial(outward, k)) for k in range(dim) if abs(axis[k]) < 1.0}


def add_temperatures(model: Model, histories: Histories[int]) -> None:
    """Add temperature changes from the initial temperatures to a model.

    Histories that differ only by a factor share a field. If the histories have corners at fewer times than there are such
    fields, one field for each of these times is added instead.
    """
    fields = list(ByShape.of((_relative(table, table[0][1]), points) for table, points in histories.distinct()))
    times = sorted({time for *_, table in fields for time, _ in table})
    if len(fields) <= len(times):
        for _, points, values, table in fields:
            change = np.zeros(model.mesh.n_points)
            change[points] = values(points) if callable(values) else values
            _add_field(model, change, table)
        return
    for k, time in enumerate(times):
        corners = sorted({times[0], *times[max(k - 1, 0) : k + 2], times[-1]})
        change = np.zeros(model.mesh.n_points)
        for _, points, values, table in fields:
            instants, factors = zip(*table, strict=True)
            factor = np.interp(time, instants, factors)
            change[points] = factor * (values(points) if callable(values) else values)
        _add_field(model, change, tuple((corner, float(corner == time)) for corner in corners))


def _add_field(model: Model, change: Array, ramp: Table) -> None:
    """Add a field (n_points,) of temperature changes, unless it or its ramp is zero."""
    for section in model.pretensions:  # the deck does not contain the opposite nodes of a section
        change[section.opposite] = change[section.nodes]
    if change.any() and any(factor for _, factor in ramp):
        model.add_temperature(change, reference=0.0, ramp=ramp)


def heat_loads(deck_mesh: DeckMesh, conditions: Conditions, thickness: float) -> list[Adder]:
    """Return functions that add the prescribed temperatures, nodal heat flows, heat sources, heat fluxes and films.

    `thickness` [length] converts nodal heat flows to flows per unit thickness.
    """
    adders: list[Adder] = []
    reference, steps = conditions.reference, deck_mesh.content.steps
    begin = next((number for number, step in enumerate(steps) if step.heat), 0)
    rises = ByShape[tuple[float, float]]()
    for table, period, points in conditions.fixed_temperatures.in_periods():
        if period.ends > begin:
            rises.add(_span(period, begin), _relative(table, reference), points)
    for span, nodes, value, table in rises:
        group = deck_mesh.add_points(f"temperature {len(adders)}", nodes)
        fixed = {"value": _absolute_temperature(value, reference), "ramp": table, **_limits(span)}
        adders.append(partial(Model.fix_temperature, group=group, **fixed))
    for _, nodes, value, table in ByShape.of(conditions.powers.distinct()):
        group = deck_mesh.add_points(f"heat {len(adders)}", nodes)
        powers = tuple((time, power / thickness) for time, power in table)
        adders.append(partial(Model.add_nodal_heat, group=group, value=value, ramp=powers))
    sources = ByShape[str]()
    for table, fluxes in conditions.fluxes.distinct():
        for flux in fluxes:
            for cell, rows in rows_by_type(flux.elements).items():
                sources.add(cell, table, rows)
    on_faces = _on_faces(deck_mesh, conditions.fluxes)
    for cell, indices, value, table in sources:
        group = deck_mesh.add_cells(f"heat source {len(adders)}", cell, indices)
        adders.append(partial(Model.add_heat_source, value=value, groups=group, ramp=table))
    for (keyword, cell), indices, value, table in on_faces:
        group = deck_mesh.add_cells(f"{keyword.lower()} {len(adders)}", cell, indices)
        adders.append(partial(Model.add_heat_flux, group=group, value=value, ramp=table))
    faces_by_film: dict[tuple[Table, float, tuple[float, float]], list[Face | None]] = {}
    for table, period, films in conditions.films.in_periods():
        for film in films if period.ends > begin else ():
            faces_by_film.setdefault((table, film.numbers[0], _span(period, begin)), []).append(film.face)
    for (table, coefficient, span), faces in faces_by_film.items():
        group = deck_mesh.add_facets(f"film {len(adders)}", filter(None, faces))
        rise = _relative(table, reference)
        size = max((value for _, value in rise), key=abs)
        ramp = tuple((time, value / size) for time, value in rise) if size else None
        film_options: dict[str, Any] = {"ambient": reference + size, "ramp": ramp, **_limits(span)}
        adders.append(partial(Model.add_film, group=group, coefficient=coefficient, **film_options))
    return adders


def _relative(table: Table, reference: float) -> Table:
    """Return a history minus a reference value."""
    return tuple((time, value - reference) for time, value in table)


def _span(period: Period, begin: float) -> tuple[float, float]:
    """Return the load factors of a period; the first is minus infinity if temperatures are computed only from it on."""
    return period.begins if period.begins > begin else -np.inf, period.ends


def _limits(span: tuple[float, float]) -> dict[str, float]:
    """Return the arguments `begins` and `ends` of methods of `Model` for an interval of load factors."""
    return {name: limit for name, limit in zip(("begins", "ends"), span, strict=True) if np.isfinite(limit)}


def _absolute_temperature(value: Any, reference: float) -> Any:
    """Return the temperature for a rise `value` above the reference; both are numbers or functions of the position."""

    def absolute(points: Array) -> Array:
        return np.asarray(value(points) + reference)

    return absolute if callable(value) else value + reference
