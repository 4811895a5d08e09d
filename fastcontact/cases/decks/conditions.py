"""Supports and loads of a deck over all steps, as histories of displacements, nodal forces, pressures and body forces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from fastcontact.cases.decks.assembled import Target, targets
from fastcontact.cases.decks.axes import local_directions
from fastcontact.cases.decks.blocks import Block, Location
from fastcontact.cases.decks.content import Condition
from fastcontact.cases.decks.fields import OF_HEAT, HeatConditions, initial_temperatures, temperatures_of_block
from fastcontact.cases.decks.histories import Histories, Value
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.cases.decks.sections import Locks
from fastcontact.round_off import LENGTH_ROUND_OFF

# Components that the named supports of *BOUNDARY prescribe.
NAMED = {
    "XSYMM": (1, 5, 6),
    "YSYMM": (2, 4, 6),
    "ZSYMM": (3, 4, 5),
    "ENCASTRE": (1, 2, 3, 4, 5, 6),
    "PINNED": (1, 2, 3),
}
# Point, component counted from 0, and whether the component is along a local axis.
Component = tuple[int, int, bool]


@dataclass(frozen=True, slots=True)
class Period:
    """Period in which a support acts.

    Attributes
    ----------
    location : Location or None
        Line of the deck that prescribes the support, if it acts only from a later step on; otherwise None.
    begins, ends : float
        Load factors [-] between which the support acts.
    keeps : bool
        True if the displacement remains equal to its value at the start of the period (FIXED).
    """

    location: Location | None
    begins: float
    ends: float = np.inf
    keeps: bool = False


ALWAYS = Period(None, 0.0)


class Conditions:
    """Supports and loads of a deck with their histories, and the periods of the supports that do not act in all steps."""

    def __init__(self, assembly: DeckMesh) -> None:
        self.assembly, content = assembly, assembly.content
        self.supports: Histories[Component] = Histories(content)
        self.forces: Histories[Component] = Histories(content)
        self.loads: Histories[Target] = Histories(content)
        initial = initial_temperatures(assembly, content.initial_temperatures)
        self.temperatures: Histories[int] = Histories(content, rest=initial)
        self.periods: dict[Component, Period] = {}  # latest periods; supports without an entry act from the start
        self.ended: list[tuple[Component, Period]] = []  # earlier periods
        self.fixed_in_step: set[Component] = set()  # supports with FIXED in the current step
        self.heat = HeatConditions(assembly, initial)
        self.locks = Locks(assembly)
        self.directions = local_directions(assembly)
        if assembly.dim == 3:  # rotations refer to the local axes of their node
            rotations, rotated = assembly.rotations, self.directions
            self.directions = {rotations[p]: axes for p, axes in rotated.items() if p in rotations} | rotated

    def run(self) -> None:
        """Record the supports and loads of all steps."""
        content = self.assembly.content
        for condition in content.supports:
            self._supports(condition, before=True)
        self.supports.begin()
        self.heat.temperatures.begin()
        self.periods.update((name, replace(ALWAYS, keeps=True)) for name in self.fixed_in_step)
        for number, step in enumerate(content.steps, start=1):
            self.locks.begin(number, [g for g in step.conditions if g.block.keyword == "BOUNDARY"], self.assembly)
            for condition in step.conditions:
                self._record_block(condition)
            self._update_periods(number)
            for histories in (self.supports, self.forces, self.loads, self.temperatures, self.heat):
                histories.advance(number, step)  # type: ignore[attr-defined]

    def _record_block(self, condition: Condition) -> None:
        """Record a block of supports or loads of the current step."""
        keyword, block = condition.block.keyword, condition.block
        if keyword == "TEMPERATURE":
            self.temperatures.record(condition, temperatures_of_block(self.assembly, condition.block))
        elif keyword in OF_HEAT:
            self.heat.record(condition)
        elif keyword == "BOUNDARY":
            self._supports(condition)
        elif keyword == "CLOAD":
            self.forces.record(condition, self._forces(block))
        else:
            entries = ((targets(self.assembly, row), row.number(2), row.location) for row in block.iter_rows())
            self.loads.record(condition, entries)

    def _update_periods(self, number: int) -> None:
        """Record the supports that begin or end at the start of step `number`, counted from 1."""
        begin, step_values = number - 1.0, self.supports.step_values
        # A value in this step ends the period of a support with FIXED, and a new period begins.
        candidates = (name for name in self.periods if name in step_values and name not in self.fixed_in_step)
        released = dict.fromkeys(name for name in candidates if self._acts(name) and self.periods[name].keeps)
        for name in (*self.supports.removals, *released):
            self.ended.append((name, replace(self.periods.pop(name, ALWAYS), ends=begin)))
        new_periods: dict[tuple[Location | None, bool], Period] = {}
        for name in step_values:
            if name in released or not self._acts(name):
                key = step_values[name].location if begin else None, name in self.fixed_in_step
                self.periods[name] = new_periods.setdefault(key, Period(key[0], begin, keeps=key[1]))
        self.fixed_in_step.clear()

    def _acts(self, name: Component) -> bool:
        """Return whether a support acts at the end of the steps recorded so far."""
        track = self.supports.tracks.get(name)
        return track is not None and track.alive

    def temporary(self) -> list[tuple[Component, Period]]:
        """Return the supports that do not act in all steps, with their periods."""
        return [*self.ended, *((name, period) for name, period in self.periods.items() if period.begins > 0.0)]

    def description(self, component: Component) -> str:
        """Return the description of a displacement component in terms of the deck, for messages."""
        point, axis, _ = component
        if point >= sum(map(len, self.assembly.index.values())):
            return f"rotation {axis + 1} of a reference node"
        return f"component {axis + 1} of node {self.assembly.number_of(point)}"

    def _supports(self, condition: Condition, before: bool = False) -> None:
        """Record a block *BOUNDARY of the current step or, if `before` is true, a block that precedes all steps."""
        block = condition.block
        kind = block.get("TYPE", "DISPLACEMENT").upper()
        if kind != "DISPLACEMENT":
            raise block.refuse(f"TYPE={kind} is not supported, only DISPLACEMENT")
        if condition.new:
            self.supports.remove_earlier()
            self.heat.temperatures.remove_earlier()
        driven = False
        for row in block.iter_rows():
            if row.text(1) == "11":
                self.heat.prescribe(condition, row)
                continue
            points = self.assembly.nodes(row.text(0), row.location)
            components, value = NAMED.get(row.text(1).upper()), 0.0
            if row.text(1).upper() in ("XASYMM", "YASYMM", "ZASYMM"):
                raise row.refuse(f"{row.text(1)} is not supported: give the components")
            if components is None:
                first = row.integer(1)
                last, value = row.integer(2, first), row.number(3, 0.0)
                if not 1 <= first <= last <= 6:
                    raise row.refuse(f"components {row.text(1)} to {row.text(2)} are not within 1 to 6")
                components = tuple(range(first, last + 1))
            driven = driven or bool(before and value)
            prescribed = Value(value, condition.amplitude, row.location)
            for point in points:
                for component in components:
                    self._support(point, component, prescribed, "FIXED" in block.parameters)
        if driven:
            self.assembly.content.note(block, "a displacement prescribed before the first step is applied in that step")

    def _support(self, point: int, component: int, prescribed: Value, fixed: bool) -> None:
        """Record a support of a point; `fixed` is true for FIXED.

        Raises CaseError if the component does not exist and the prescribed value is not zero.
        """
        name = self._component(point, component)
        if name is None:
            if prescribed.value:
                raise prescribed.location.refuse(f"component {component} does not exist at nodes of this model")
            return
        if self.locks.record(point, component, fixed):
            return
        if name[0] in self.directions:
            name, sign = self._local_component(*name[:2])
            prescribed = prescribed._replace(value=sign * prescribed.value)
        if fixed:
            self.fixed_in_step.add(name)
            if self._acts(name):
                self.supports.hold(name, prescribed.location)
                return
        self.supports.set_value(name, prescribed)

    def _component(self, point: int, component: int) -> Component | None:
        """Return a component of a point or, for rotations, of the point that represents them; None if it does not exist."""
        dim = self.assembly.dim
        if component <= dim:
            return point, component - 1, False
        if point in self.assembly.rotations and component > 3:
            axis = component - 4 if dim == 3 else {6: 0}.get(component, -1)
            return (self.assembly.rotations[point], axis, False) if axis >= 0 else None
        return None

    def _local_component(self, point: int, number: int) -> tuple[Component, float]:
        """Return the component along a local axis and 1.0, or the parallel global component and the sign of the axis."""
        direction = self.directions[point][number]
        axis = int(np.argmax(np.abs(direction)))
        if abs(abs(direction[axis]) - 1.0) < LENGTH_ROUND_OFF and axis < self.assembly.dim:
            return (point, axis, False), float(np.sign(direction[axis]))
        return (point, number, True), 1.0

    def _forces(self, block: Block) -> Iterator[tuple[list[Component], float, Location]]:
        """Yield the components, the value [force] and the location of each line of a *CLOAD block."""
        for row in block.iter_rows():
            component, value = row.integer(1), row.number(2)
            points = self.assembly.nodes(row.text(0), row.location)
            names = [self._component(point, component) if 1 <= component <= 6 else None for point in points]
            if None in names:
                raise row.refuse(f"a force cannot act on component {component} of this node")
            yield [(*name[:2], name[0] in self.directions) for name in names if name], value, row.location
