"""Temperatures, initial stresses and thermal loads of a deck: prescribed temperatures, heat flows, fluxes and films."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from typing import Any, Generic

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import Assembly, Face, Target, targets
from fastcontact.cases.decks.blocks import Block, Location, Row
from fastcontact.cases.decks.content import Condition, Content, Step
from fastcontact.cases.decks.histories import ByShape, Histories, Name, Value
from fastcontact.cases.decks.meshing import DeckMesh, rows_by_type
from fastcontact.mesh.mesh import starts_of
from fastcontact.model.model import Model
from fastcontact.model.ramp import Table


def initial_conditions(content: Content, block: Block) -> None:
    """Store a block *INITIAL CONDITIONS, which gives nodal temperatures or element stresses before the first step."""
    kind = " ".join(block.required("TYPE").upper().split())
    if kind not in ("TEMPERATURE", "STRESS"):
        raise block.refuse(f"TYPE={kind[:40]} is not supported, only TEMPERATURE and STRESS")
    (content.initial_temperatures if kind == "TEMPERATURE" else content.initial_stresses).append(block)


def initial_temperatures(assembly: Assembly, blocks: Iterable[Block]) -> dict[int, float]:
    """Return the initial temperatures by point; the last of several values at a point applies."""
    rows = (row for block in blocks for row in temperatures_of_block(assembly, block))
    return {point: value for points, value, _ in rows for point in points}


def temperatures_of_block(assembly: Assembly, block: Block) -> Iterator[tuple[list[int], float, Location]]:
    """Yield each point of a block with its temperature and the location of the data line."""
    for row in block.iter_rows():
        if any(row.entries[2:]):
            raise row.refuse("temperature gradients exist in beams and shells only: give a single temperature")
        value = row.number(1)
        yield assembly.nodes(row.text(0), row.location), value, row.location


def add_temperatures(model: Model, histories: Histories[int]) -> None:
    """Add temperature changes from the initial temperatures to a model.

    Histories that differ only by a factor share a field. If the histories have corners at fewer times than there are such
    fields, one field for each of these times is added instead.
    """
    fields = list(ByShape.of((relative_table(table, table[0][1]), points) for table, points in histories.distinct()))
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


# Stress components in the order of a data line, by the dimension of the mesh.
ORDER = {2: ("xx", "yy", "zz", "xy"), 3: ("xx", "yy", "zz", "xy", "xz", "yz")}


def add_initial_stresses(model: Model, deck_mesh: DeckMesh) -> None:
    """Add the initial stresses to a model; the last of several lines for an element applies.

    Raises CaseError if a line does not have exactly one value per component, or if an element is not a solid or has an
    orientation.
    """
    content, names = deck_mesh.content, ORDER[deck_mesh.dim]
    if not content.initial_stresses:
        return
    starts = starts_of(model.mesh.solids)
    values = np.zeros((sum(map(len, model.mesh.solids.values())), len(names)))
    for block in content.initial_stresses:
        for row in block.iter_rows():
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
                        f"element {element.number} has an *ORIENTATION: initial stresses in local axes are not supported"
                    )
                values[starts[element.type.element] + element.row] = numbers
    components: dict[str, Any] = {name: values[:, [k]] for k, name in enumerate(names) if values[:, k].any()}
    if components:
        model.add_initial_stress(**components)


# Keywords of heat loads.
OF_HEAT = ("CFLUX", "DFLUX", "DSFLUX", "FILM", "SFILM")
# Number of the degree of freedom of the temperature.
TEMPERATURE = 11


def check_steps(content: Content) -> None:
    """Set `content.heat` from the steps. Raises CaseError if the procedures or the loads of the steps are inconsistent."""
    first = next((step for step in content.steps if step.heat), None)
    content.heat = first.heat if first else ""
    for number, step in enumerate(content.steps):
        if first and step.heat != first.heat and (first.heat == "alone" or number > content.steps.index(first)):
            raise step.refuse(
                "*HEAT TRANSFER cannot be combined with other procedures, and *COUPLED TEMPERATURE-DISPLACEMENT cannot "
                "precede them: use *HEAT TRANSFER for all steps, or *COUPLED TEMPERATURE-DISPLACEMENT for all"
            )
        for block in (condition.block for condition in step.conditions):
            if block.keyword in OF_HEAT and not step.heat:
                raise block.refuse("needs a step with *HEAT TRANSFER or *COUPLED TEMPERATURE-DISPLACEMENT")
            if block.keyword == "TEMPERATURE" and first:
                raise block.refuse(
                    "temperatures are computed in this deck: prescribe degree of freedom 11 by *BOUNDARY"
                )
            if block.keyword in ("CLOAD", "DLOAD", "DSLOAD") and step.heat == "alone":
                raise block.refuse(
                    "is not a heat load: use *COUPLED TEMPERATURE-DISPLACEMENT in place of *HEAT TRANSFER"
                )


class Spans(Generic[Name]):
    """Intervals of the load factor in which loads act, from the steps that apply and remove the loads."""

    def __init__(self) -> None:
        self._begun: dict[Name, float] = {}
        self._ended: dict[Name, list[tuple[float, float]]] = {}

    def advance(self, history: Histories[Name], begin: float) -> None:
        """Record the loads that begin or end at the load factor `begin`; to be called before `history.advance`."""
        for name in history.removals:
            self._ended.setdefault(name, []).append((self._begun.pop(name), begin))
        for name in (*history.step_values, *history.initial):
            self._begun.setdefault(name, begin)

    def of(self, names: Iterable[Name]) -> dict[tuple[float, float], list[Name]]:
        """Return the names of loads by the interval of load factors in which they act."""
        by_span: dict[tuple[float, float], list[Name]] = {}
        for name in names:
            open_spans = [(self._begun[name], np.inf)] if name in self._begun else []
            for span in (*self._ended.get(name, ()), *open_spans):
                by_span.setdefault(span, []).append(name)
        return {(begin, end): members for (begin, end), members in by_span.items() if begin < end}


class HeatConditions:
    """Prescribed temperatures, nodal heat flows, heat fluxes and films of a deck, with their histories."""

    def __init__(self, assembly: DeckMesh, initial: Mapping[int, float]) -> None:
        self.assembly, content = assembly, assembly.content
        self.reference = _reference_temperature(assembly, initial) if content.heat else 0.0
        self.rest: dict[Target, float] = {}  # ambient temperatures of absent films
        uniform = dict.fromkeys(range(len(assembly.points)), self.reference) if content.heat else {}
        self.temperatures: Histories[int] = Histories(content, rest=uniform)
        self.powers: Histories[int] = Histories(content)
        self.fluxes: Histories[Target] = Histories(content)
        self.films: Histories[Target] = Histories(content, rest=self.rest)
        self.temperature_spans: Spans[int] = Spans()
        self.film_spans: Spans[Target] = Spans()
        self.film_of: dict[tuple[str, Face | None], Target] = {}
        self.begun = False

    @property
    def histories(self) -> tuple[Histories[Any], ...]:
        """The histories of all heat loads."""
        return self.temperatures, self.powers, self.fluxes, self.films

    def prescribe(self, condition: Condition, row: Row) -> None:
        """Record the prescribed temperature of nodes in a line of *BOUNDARY."""
        if not self.assembly.content.heat:
            raise row.refuse(
                "degree of freedom 11 (temperature) is not within 1 to 6: in static steps use *TEMPERATURE"
            )
        if "FIXED" in condition.block.parameters:
            raise row.refuse("FIXED is not supported for temperatures: give their values")
        for point in self._points_of_solids(row):
            self.temperatures.set_value(point, Value(row.number(3, 0.0), condition.amplitude, row.location))

    def _points_of_solids(self, row: Row) -> list[int]:
        """Return the points of the node set in a line. Raises CaseError if a point belongs to no solid."""
        points = self.assembly.nodes(row.text(0), row.location)
        for point in points:
            if point not in self.assembly.solid_points:
                raise row.refuse(f"node {self.assembly.number_of(point)} belongs to no solid, so it has no temperature")
        return points

    def record(self, condition: Condition) -> None:
        """Record a block of heat loads of the current step."""
        keyword = condition.block.keyword
        histories: dict[str, Histories[Any]] = {"CFLUX": self.powers, "FILM": self.films, "SFILM": self.films}
        entries = ((list(self._names(row)), row.number(2), row.location) for row in condition.block.iter_rows())
        histories.get(keyword, self.fluxes).record(condition, entries)

    def _names(self, row: Row) -> Iterator[int | Target]:
        """Yield the points or the targets of a line of a heat load, and remove the films that it replaces."""
        keyword = row.location.keyword
        if keyword == "CFLUX":
            if row.integer(1, TEMPERATURE) not in (0, TEMPERATURE):
                raise row.refuse(f"degree of freedom {row.text(1)} is not 11, the temperature")
            yield from self._points_of_solids(row)
            return
        film = keyword in ("FILM", "SFILM")
        if film and row.number(3) < 0.0:
            raise row.refuse(f"the film coefficient {row.number(3):g} must not be negative")
        for target in targets(self.assembly, row, (row.number(3),) if film else ()):
            if film:
                self._replace_film(target, row)
            yield target

    def _replace_film(self, film: Target, row: Row) -> None:
        """Remove an earlier film of the same face with another coefficient.

        Raises CaseError if the current step defines both.
        """
        self.rest[film] = self.reference
        earlier = self.film_of.get((film.keyword, film.face))
        if earlier is not None and earlier != film:
            if earlier in self.films.step_values:
                (new,), (old,) = film.numbers, earlier.numbers
                raise row.refuse(f"{new:g} is the second film coefficient of this face in one step, after {old:g}")
            if earlier in self.films.tracks and self.films.tracks[earlier].alive:
                self.films.removals[earlier] = None
        self.film_of[film.keyword, film.face] = film

    def advance(self, number: int, step: Step) -> None:
        """Advance to the end of step `number`, counted from 1."""
        begin = float(number - 1) if self.begun else -np.inf
        self.temperature_spans.advance(self.temperatures, begin)
        self.film_spans.advance(self.films, begin)
        for history in self.histories:
            history.advance(number, step)
        self.begun = self.begun or bool(step.heat)

    def loads(self, thickness: float) -> list[Callable[[Model], None]]:
        """Create the mesh groups of all heat loads, and return functions that add the loads to a model.

        `thickness` [length] converts nodal heat flows to flows per unit thickness.
        """
        assembly, adders = self.assembly, []  # type: DeckMesh, list[Callable[[Model], None]]
        spans: list[tuple[float, float]] = []
        rises = ByShape[int]()
        for table, names in self.temperatures.distinct():
            for span, points in self.temperature_spans.of(names).items():
                spans += [span] * (span not in spans)
                rises.add(spans.index(span), relative_table(table, self.reference), points)
        for number, nodes, value, table in rises:
            group = assembly.add_points(f"temperature {len(adders)}", nodes)
            fixed = {"value": _absolute_temperature(value, self.reference), "ramp": table, **_limits(spans[number])}
            adders.append(partial(Model.fix_temperature, group=group, **fixed))
        for _, nodes, value, table in ByShape.of(self.powers.distinct()):
            group = assembly.add_points(f"heat {len(adders)}", nodes)
            powers = tuple((time, power / thickness) for time, power in table)
            adders.append(partial(Model.add_nodal_heat, group=group, value=value, ramp=powers))
        sources = ByShape[str]()
        on_faces = ByShape[tuple[str, str]]()
        for table, fluxes in self.fluxes.distinct():
            for flux in fluxes:
                for cell, rows in assembly.facet_rows([flux.face] if flux.face else []).items():
                    on_faces.add((flux.keyword, cell), table, rows)
                for cell, rows in rows_by_type(flux.elements).items():
                    sources.add(cell, table, rows)
        for cell, indices, value, table in sources:
            assembly.groups[group := f"heat source {len(adders)}"] = {cell: indices.tolist()}
            adders.append(partial(Model.add_heat_source, value=value, groups=group, ramp=table))
        for (keyword, cell), indices, value, table in on_faces:
            assembly.groups[group := f"{keyword.lower()} {len(adders)}"] = {cell: indices.tolist()}
            adders.append(partial(Model.add_heat_flux, group=group, value=value, ramp=table))
        faces_by_film: dict[tuple[Table, float, tuple[float, float]], list[Face]] = {}
        for table, films in self.films.distinct():
            for span, members in self.film_spans.of(films).items():
                for film in members:
                    assert film.face is not None
                    faces_by_film.setdefault((table, film.numbers[0], span), []).append(film.face)
        for (table, coefficient, span), faces in faces_by_film.items():
            group = assembly.add_facets(f"film {len(adders)}", faces)
            rise = relative_table(table, self.reference)
            size = max((value for _, value in rise), key=abs)
            ramp = tuple((time, value / size) for time, value in rise) if size else None
            film_options: dict[str, Any] = {"ambient": self.reference + size, "ramp": ramp, **_limits(span)}
            adders.append(partial(Model.add_film, group=group, coefficient=coefficient, **film_options))
        return adders


def relative_table(table: Table, reference: float) -> Table:
    """Return a history minus a reference value."""
    return tuple((time, value - reference) for time, value in table)


def _limits(span: tuple[float, float]) -> dict[str, float]:
    """Return the arguments `begins` and `ends` of methods of `Model` for an interval of load factors."""
    return {name: limit for name, limit in zip(("begins", "ends"), span, strict=True) if np.isfinite(limit)}


def _absolute_temperature(value: Any, reference: float) -> Any:
    """Return the temperature for a rise `value` above the reference; both are numbers or functions of the position."""

    def absolute(points: Array) -> Array:
        return np.asarray(value(points) + reference)

    return absolute if callable(value) else value + reference


def _reference_temperature(assembly: Assembly, initial: Mapping[int, float]) -> float:
    """Return the initial temperature of the solids, or zero if it is not uniform and has no effect.

    Raises CaseError if it is not uniform and a coupled step computes thermal strains.
    """
    content = assembly.content
    values = {initial.get(point, 0.0) for point in assembly.solid_points}
    if len(values) == 1:
        return values.pop()
    location = content.initial_temperatures[0].location
    if content.heat == "coupled" and any(material.expansion for material in content.materials.values()):
        raise location.refuse(
            f"initial temperatures from {min(values):g} to {max(values):g} are not supported with thermal expansion in "
            "coupled steps: thermal strains refer to a single temperature"
        )
    content.note(location, "no effect: initial temperatures differ, and steady temperatures do not depend on them")
    return 0.0
