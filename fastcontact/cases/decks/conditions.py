"""Supports and loads of a deck over all steps, as histories of displacements, forces, temperatures and heat flows."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact.cases.decks.assembled import Assembly, Element, Face, Target, targets
from fastcontact.cases.decks.axes import local_directions
from fastcontact.cases.decks.blocks import Block, Location, Row, key_of
from fastcontact.cases.decks.content import Step
from fastcontact.cases.decks.histories import Histories, Value
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.round_off import LENGTH_ROUND_OFF

# Components that the named supports of *BOUNDARY prescribe.
NAMED = {
    "XSYMM": (1, 5, 6),
    "YSYMM": (2, 4, 6),
    "ZSYMM": (3, 4, 5),
    "ENCASTRE": (1, 2, 3, 4, 5, 6),
    "PINNED": (1, 2, 3),
}
# Number of the degree of freedom of the temperature.
TEMPERATURE = 11
# Kinds of the sets that loads act on, by the first letters of the keyword.
KINDS = {"CL": "node", "CF": "node", "DL": "element", "DF": "element", "DS": "surface"}
# Difference of unit vectors, and of points relative to the size of the model, below which directions and axes are equal.
SAME_DIRECTION = 1e-5
# Point, component counted from 0, and whether the component is along a local axis.
Component = tuple[int, int, bool]


class Conditions:
    """Supports, loads and temperatures of a deck with their histories.

    Attributes
    ----------
    supports, forces, loads : Histories
        Displacements, nodal forces, and pressures and body forces.
    given_temperatures, fixed_temperatures : Histories
        Temperatures of *TEMPERATURE, and those that *BOUNDARY prescribes where temperatures are computed.
    powers, fluxes, films : Histories
        Nodal heat flows, heat fluxes and volumetric sources, and ambient temperatures of films.
    by_keyword : dict of str to Histories
        Histories of loads and temperatures by keyword.
    histories : tuple of Histories
        All histories.
    film_of : dict of (str, face) to Target
        Film that acts last on each face, by keyword and face.
    body_forces : dict of Element to list of (str, Target)
        Gravity and centrifugal forces by element, with the set or element number of their line.
    reference : float
        Initial temperature of the bodies where temperatures are computed [temperature].
    directions : dict of int to ndarray (3, 3)
        Local axes in rows [-], by point, of nodes with *TRANSFORM and of the points that represent their rotations.
    """

    def __init__(self, assembly: DeckMesh) -> None:
        self.assembly, content = assembly, assembly.content
        lines = (row for block in content.blocks["INITIAL TEMPERATURE"] for row in block.iter_rows())
        temperatures = (temperature_of(assembly, row) for row in lines)
        initial = {point: value for points, value, _ in temperatures for point in points}  # the last value applies
        self.reference = reference_temperature(assembly, initial) if content.heat else 0.0
        self.supports: Histories[Component] = Histories(content)
        self.forces: Histories[Component] = Histories(content, additive=True)
        self.loads: Histories[Target] = Histories(content, additive=True)
        self.given_temperatures: Histories[int] = Histories(content, baseline=initial)
        self.fixed_temperatures: Histories[int] = Histories(content, default=self.reference)
        self.powers: Histories[int] = Histories(content, additive=True)
        self.fluxes: Histories[Target] = Histories(content, additive=True)
        self.films: Histories[Target] = Histories(content, default=self.reference)
        self.film_of: dict[tuple[str, Face | None], Target] = {}
        self.body_forces: defaultdict[Element, list[tuple[str, Target]]] = defaultdict(list)
        self.by_keyword: dict[str, Histories[Any]] = {
            "CLOAD": self.forces, "TEMPERATURE": self.given_temperatures, "CFLUX": self.powers,
            **dict.fromkeys(("DLOAD", "DSLOAD"), self.loads), **dict.fromkeys(("DFLUX", "DSFLUX"), self.fluxes),
            **dict.fromkeys(("FILM", "SFILM"), self.films),
        }  # fmt: skip
        others = dict.fromkeys(self.by_keyword.values())
        self.histories: tuple[Histories[Any], ...] = (self.supports, self.fixed_temperatures, *others)
        self.directions = local_directions(assembly)
        if assembly.dim == 3:  # rotations refer to the local axes of their node
            rotations, rotated = assembly.rotations, self.directions
            self.directions = {rotations[p]: axes for p, axes in rotated.items() if p in rotations} | rotated

    def record(self) -> None:
        """Record the supports and loads of all steps."""
        for block in self.assembly.content.blocks["BOUNDARY"]:
            self._record_supports(block, precedes_steps=True)
        for history in (self.supports, self.fixed_temperatures):
            history.initial, history.step_values = history.step_values, {}
        steps = self.assembly.content.steps
        both = {block.keyword for step in steps for block in step.conditions}.issuperset(("DLOAD", "DSLOAD"))
        for number, step in enumerate(steps, start=1):
            for block in step.conditions:
                if block.keyword == "BOUNDARY":
                    self._record_supports(block)
                else:
                    self.by_keyword[block.keyword].record(block, map(self._load, block.iter_rows()))
            if both and self.loads.first_blocks:
                self._check_distributed_loads(step)
            for history in self.histories:
                history.advance(number, step)

    def _load(self, row: Row) -> tuple[list[Any], float, Location]:
        """Return the points, components or targets of a line of a load or a temperature, its value and its location."""
        keyword = row.location.keyword
        if keyword == "TEMPERATURE":
            return temperature_of(self.assembly, row)
        if keyword == "CLOAD":
            keys: list[Any] = self._force_components(row)
        elif keyword == "CFLUX":
            if row.integer(1, TEMPERATURE) not in (0, TEMPERATURE):
                raise row.error(f"degree of freedom {row.text(1)} is not 11, the temperature")
            keys = self._points_of_solids(row)
        elif keyword in ("FILM", "SFILM"):
            keys = self._films(row)
        else:
            keys = targets(self.assembly, row)
        if row.text(1).upper() in ("GRAV", "CENTRIF"):
            keys = [self._body_force(row, *keys)]
        elif (KINDS.get(keyword[:2], ""), *self.assembly.split_name(row.text(0))) in self.assembly.repeating:
            raise row.error(f"'{row.text(0)}' lists a member twice, on which the load acts twice in CalculiX")
        return keys, row.number(2), row.location

    def _body_force(self, row: Row, load: Target) -> Target:
        """Return the target of an earlier line that gravity or a centrifugal force of a line equals, or else its own target.

        Raises CaseError if another force of this kind acts on its elements, apart from gravity in another direction.
        """
        name, size = key_of(row.text(0)), np.ptp(self.assembly.points, axis=0).max()
        scales = np.array([size] * (len(load.numbers) - 3) + [1.0] * 3)
        entries = {id(entry): entry for element in load.elements for entry in self.body_forces[element]}
        for earlier_name, earlier in entries.values():
            if earlier.kind == load.kind and (earlier in self.loads.step_values or self.loads.keeps(earlier)):
                equal = (np.abs(np.subtract(load.numbers, earlier.numbers)) < SAME_DIRECTION * scales).all()
                if equal and name == earlier_name:
                    return earlier
                if equal or load.kind == "CENTRIF":
                    other = f"line {earlier.location.line} on elements of this set, but with another set or axis"
                    raise row.error(f"{load.kind} acts by {other}: repeat them, or remove it by OP=NEW")
        entry = (name, load)
        for element in load.elements:
            self.body_forces[element].append(entry)
        return load

    def _check_distributed_loads(self, step: Step) -> None:
        """Raise CaseError if *DLOAD and *DSLOAD interact, whose loads form one list in CalculiX, but two in Abaqus."""
        loads = self.loads
        kept = {load.face or load: load for load in loads.tracks if loads.keeps(load)}
        lists = [b.location for b in step.conditions if kept and b.removes_earlier and b.keyword in ("DLOAD", "DSLOAD")]
        replaced = [value.location for load, value in loads.step_values.items() if load.face in kept]
        for location in (*lists, *replaced):
            text = f"CalculiX replaces the load of {next(iter(kept.values()))}, which remains in Abaqus"
            raise location.error(f"{text}: give OP=NEW with both keywords, and repeat the loads that remain")

    def _force_components(self, row: Row) -> list[Component]:
        """Return the components on which the nodal force of a line acts."""
        number = row.integer(1)
        points = self.assembly.nodes(row.text(0), row.location)
        components = [self._component(point, number) if 1 <= number <= 6 else None for point in points]
        if None in components:
            raise row.error(f"a force cannot act on component {number} of this node")
        return [(*component[:2], component[0] in self.directions) for component in components if component]

    def _points_of_solids(self, row: Row) -> list[int]:
        """Return the points of the node set in a line. Raises CaseError if a point belongs to no solid."""
        points = self.assembly.nodes(row.text(0), row.location)
        for point in points:
            if point not in self.assembly.solid_points:
                raise row.error(f"node {self.assembly.label_of(point)} belongs to no solid, so it has no temperature")
        return points

    def _films(self, row: Row) -> list[Target]:
        """Return the films of a line, and remove earlier films of the same faces with another coefficient.

        Raises CaseError if the current step defines both.
        """
        coefficient, histories = row.number(3), self.films
        if coefficient < 0.0:
            raise row.error(f"the film coefficient {coefficient:g} must not be negative")
        films = targets(self.assembly, row, (coefficient,))
        for film in films:
            earlier = self.film_of.get((film.keyword, film.face), film)
            if earlier != film and earlier in histories.step_values:
                raise row.error(
                    f"{coefficient:g} is the second film coefficient of this face in one step, after {earlier.numbers[0]:g}"
                )
            if earlier != film and histories.keeps(earlier):
                histories.removals[earlier] = None
            self.film_of[film.keyword, film.face] = film
        return films

    def description(self, component: Component) -> str:
        """Return the description of a displacement component in terms of the deck, for messages."""
        point, axis, _ = component
        if point >= sum(map(len, self.assembly.index.values())):
            return f"rotation {axis + 1} of a reference node"
        return f"component {axis + 1} of node {self.assembly.label_of(point)}"

    def _record_supports(self, block: Block, precedes_steps: bool = False) -> None:
        """Record a block *BOUNDARY of the current step or, if `precedes_steps` is true, one that precedes all steps."""
        block.choice("TYPE", ("DISPLACEMENT",))
        if not precedes_steps:
            self.supports.begin(block)
            self.fixed_temperatures.begin(block)
        displaced_before_steps = False
        for row in block.iter_rows():
            if row.text(1) == "11":
                self._record_temperature(block, row)
                continue
            points = self.assembly.nodes(row.text(0), row.location)
            components, value = NAMED.get(row.text(1).upper()), 0.0
            if row.text(1).upper() in ("XASYMM", "YASYMM", "ZASYMM"):
                raise row.error(f"{row.text(1)} is not supported: give the components")
            if components is None:
                first = row.integer(1)
                last, value = row.integer(2, first), row.number(3, 0.0)
                if not 1 <= first <= last <= 6:
                    raise row.error(f"components {row.text(1)} to {row.text(2)} are not within 1 to 6")
                components = tuple(range(first, last + 1))
            displaced_before_steps |= bool(precedes_steps and value)
            prescribed = Value(value, block.get("AMPLITUDE"), row.location)
            for point in points:
                for component in components:
                    self._record_support(point, component, prescribed, "FIXED" in block.parameters)
        if displaced_before_steps:
            self.assembly.content.note(block, "a displacement prescribed before the first step is applied in that step")

    def _record_temperature(self, block: Block, row: Row) -> None:
        """Record the prescribed temperature of nodes in a line of *BOUNDARY."""
        if not self.assembly.content.heat:
            raise row.error("degree of freedom 11 (temperature) is not within 1 to 6: in static steps use *TEMPERATURE")
        if "FIXED" in block.parameters:
            raise row.error("FIXED is not supported for temperatures: give their values")
        for point in self._points_of_solids(row):
            value = Value(row.number(3, 0.0), block.get("AMPLITUDE"), row.location)
            self.fixed_temperatures.set_value(point, value)

    def _record_support(self, point: int, component: int, prescribed: Value, fixed: bool) -> None:
        """Record a support of a component of a point, counted from 1; `fixed` is true for FIXED.

        Raises CaseError if the component does not exist and the prescribed value is not zero.
        """
        key = self._component(point, component)
        if key is None:
            if prescribed.value:
                raise prescribed.location.error(f"component {component} does not exist at nodes of this model")
            return
        if key[0] in self.directions:
            key, sign = self._local_component(*key[:2])
            prescribed = prescribed._replace(value=sign * prescribed.value)
        record = self.supports.fix if fixed else self.supports.set_value
        record(key, prescribed)

    def _component(self, point: int, component: int) -> Component | None:
        """Return a component, counted from 1, of a point or of the point of its rotations; None if it does not exist."""
        dim = self.assembly.dim
        if component <= dim:
            return point, component - 1, False
        if point in self.assembly.rotations and component > 3:
            axis = component - 4 if dim == 3 else {6: 0}.get(component, -1)
            return (self.assembly.rotations[point], axis, False) if axis >= 0 else None
        return None

    def _local_component(self, point: int, number: int) -> tuple[Component, float]:
        """Return the component along local axis `number` and 1.0, or the parallel global component and its sign."""
        direction = self.directions[point][number]
        axis = int(np.argmax(np.abs(direction)))
        if abs(abs(direction[axis]) - 1.0) < LENGTH_ROUND_OFF and axis < self.assembly.dim:
            return (point, axis, False), float(np.sign(direction[axis]))
        return (point, number, True), 1.0


def temperature_of(assembly: Assembly, row: Row) -> tuple[list[int], float, Location]:
    """Return the points, the temperature and the location of a data line."""
    if any(row.entries[2:]):
        raise row.error("temperature gradients exist in beams and shells only: give a single temperature")
    value = row.number(1)
    return assembly.nodes(row.text(0), row.location), value, row.location


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
