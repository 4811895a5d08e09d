"""The assembly of a deck: points in order, cells, and sets and surfaces resolved to them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fastcontact.arrays import Array
from fastcontact.cases.decks.blocks import Place, folded
from fastcontact.cases.decks.content import Cell, Content, Instance, Members, Part, SurfaceDefinition
from fastcontact.cases.decks.element_types import ElementType, element_type
from fastcontact.mesh import elements

# Instance (empty for what belongs to no part) and number.
Key = tuple[str, int]
# Names of sets that a message lists, and characters that it shows of one.
SHOWN = 12
LONGEST = 80


@dataclass(frozen=True)
class Solid:
    """A solid element: as the deck has it, its type, and its points."""

    cell: Cell
    type: ElementType
    points: tuple[int, ...]


@dataclass
class Assembled:
    """Points and solids of a deck with all its instances.

    Attributes
    ----------
    content : Content
    points : list of (float, float, float)
        Coordinates in the assembly [length].
    index : dict of (str, int) to int
        Point number by instance and node number.
    solids : dict of (str, int) to Solid
        By instance and element number.
    discrete : dict of (str, int) to (Cell, tuple of int)
        Gap elements and springs with their points.
    """

    content: Content
    points: list[tuple[float, ...]] = field(default_factory=list)
    index: dict[Key, int] = field(default_factory=dict)
    solids: dict[Key, Solid] = field(default_factory=dict)
    discrete: dict[Key, tuple[Cell, tuple[int, ...]]] = field(default_factory=dict)
    resolved: dict[tuple[str, str, str], list[Key]] = field(default_factory=dict)
    open: list[tuple[str, str, str]] = field(default_factory=list)

    def part(self, scope: str) -> Part:
        """Return the part of an instance, or what belongs to none."""
        return self.content.instances[scope].part if scope else self.content.root

    @cached_property
    def scopes(self) -> list[str]:
        """Names of all instances as they are looked up, and the empty one."""
        return ["", *self.content.instances]

    def place_of(self, name: str) -> tuple[str, str]:
        """Return the instance that a name begins with, empty for none, and the rest: ``Part-1.17`` is node 17 of Part-1."""
        text = folded(name)
        for scope in self.content.instances:
            if text.startswith(scope + "."):
                return scope, text[len(scope) + 1 :]
        return "", text

    def keys(self, kind: str, name: str, place: Place) -> list[Key]:
        """Return the nodes or elements (`kind`) of a set or a single number; CaseError at `place` if there is none."""
        scope, rest = self.place_of(name)
        if rest.isdigit():
            return [self._existing(kind, (scope, int(rest[:19])), place)]
        return self.members(kind, scope, rest, place, name)

    def members(self, kind: str, scope: str, name: str, place: Place, shown: str = "") -> list[Key]:
        """Return the nodes or elements of a set that is defined in an instance, sets of sets included."""
        part, label = self.part(scope), (kind, scope, name)
        sets = part.node_sets if kind == "node" else part.element_sets
        if name not in sets:
            known = sorted({part.set_names[key] for key in sets})
            listed = ", ".join(known[:SHOWN]) + (", ..." if len(known) > SHOWN else "") or "none"
            raise place.refuse(f"set '{(shown or name)[:LONGEST]}' is not defined; {kind} sets: {listed}")
        if label not in self.resolved:
            if label in self.open:
                raise place.refuse(f"set '{part.set_names[name]}' contains itself")
            self.open.append(label)
            found = dict.fromkeys(key for entry in sets[name] for key in self._entry(kind, scope, entry))
            self.open.pop()
            self.resolved[label] = list(found)
        return self.resolved[label]

    def _entry(self, kind: str, scope: str, entry: Members) -> Iterator[Key]:
        scope = entry.instance or scope
        if scope and scope not in self.content.instances:
            known = ", ".join(instance.name for instance in self.content.instances.values()) or "none"
            raise entry.place.refuse(f"instance '{scope}' is not defined; instances: {known}")
        if entry.name:
            yield from self._named(kind, scope, entry)
            return
        if not entry.generated:
            yield self._existing(kind, (scope, entry.first), entry.place)
            return
        numbers = range(entry.first, entry.last + 1, entry.increment)
        there = self.part(scope).nodes if kind == "node" else self.part(scope).cells
        found = (
            [n for n in numbers if n in there]
            if len(numbers) <= len(there)
            else sorted(n for n in there if n in numbers)
        )
        if len(found) < len(numbers):
            absent = len(numbers) - len(found)
            text = f"{absent} of the {len(numbers)} numbers {entry.first} to {entry.last} are no {kind}s and left out"
            self.content.note(entry.place, text)
        yield from ((scope, n) for n in found)

    def _named(self, kind: str, scope: str, entry: Members) -> Iterator[Key]:
        if scope or not any(entry.name.upper().startswith(name) for name in self.content.instances):
            part = self.part(scope)
            if kind == "node" and folded(entry.name) not in part.node_sets and folded(entry.name) in part.element_sets:
                for key in self.members("element", scope, folded(entry.name), entry.place):
                    yield from ((scope, n) for n in part.cells[key[1]].nodes)
                return
            yield from self.members(kind, scope, folded(entry.name), entry.place, entry.name)
        else:
            yield from self.keys(kind, entry.name, entry.place)

    def _existing(self, kind: str, key: Key, place: Place) -> Key:
        there = self.part(key[0]).nodes if kind == "node" else self.part(key[0]).cells
        if key[1] not in there:
            where = f" in instance '{self.content.instances[key[0]].name}'" if key[0] else ""
            raise place.refuse(f"{kind} {key[1]} is not defined{where}")
        return key

    def nodes(self, name: str, place: Place) -> list[int]:
        """Return the points of a node set or a single node; errors as for `keys`."""
        return [self.index[key] for key in self.keys("node", name, place)]

    def node(self, name: str, place: Place) -> int:
        """Return the only point of a node set, or of a number; errors as for `keys`, or if there are several."""
        found = self.nodes(name, place)
        if len(found) != 1:
            raise place.refuse(f"'{name}' holds {len(found)} nodes where one is needed")
        return found[0]

    def faces(self, name: str, place: Place) -> list[tuple[Key, int]]:
        """Return the elements of a surface and the place of each face among the facets of its element."""
        definition, scope = self.surface(name, place)
        if definition.of_nodes:
            return self._faces_of_nodes(definition, scope)
        found: dict[tuple[Key, int], None] = {}
        for face in definition.faces:
            given = face.of if not scope else f"{scope}.{face.of}"
            keys = self.keys("element", given, face.place)
            if face.label:
                entries = [(key, self.facet(key, int(face.label[1:]), face.place)) for key in keys]
            else:
                entries = self._free_faces(keys, face.place)
            found.update(dict.fromkeys(entries))
        return list(found)

    def surface(self, name: str, place: Place) -> tuple[SurfaceDefinition, str]:
        """Return the definition of a surface and the instance it stands in; CaseError if there is none."""
        scope, rest = self.place_of(name)
        surfaces = self.part(scope).surfaces
        if rest not in surfaces:
            known = ", ".join(sorted(other.name for other in surfaces.values())) or "none"
            raise place.refuse(f"surface '{name[:80]}' is not defined; surfaces: {known}")
        if not surfaces[rest].faces:
            raise surfaces[rest].place.refuse(f"surface '{surfaces[rest].name[:80]}' has no faces")
        return surfaces[rest], scope

    def facet(self, key: Key, label: int, place: Place) -> int:
        """Return the place of the face with a label, 1 and up, among the facets of its element."""
        solid = self.solids.get(key)
        if solid is None:
            raise place.refuse(f"element {key[1]} is no solid, so it has no faces")
        faces = solid.type.faces
        if not 1 <= label <= len(faces):
            raise place.refuse(
                f"element {key[1]} of type {solid.type.name} has no face {label}, only 1 to {len(faces)}"
            )
        return matching(solid.type.element)[label - 1]

    def _free_faces(self, keys: list[Key], place: Place) -> list[tuple[Key, int]]:
        """Return the faces of elements that no other element shares."""
        return [
            (key, facet) for key in keys for facet, corners in self._sides(key, place) if len(self.owners[corners]) == 1
        ]

    def _sides(self, key: Key, place: Place) -> list[tuple[int, frozenset[int]]]:
        if key not in self.solids:
            raise place.refuse(f"element {key[1]} is no solid, so it has no faces")
        return corners_of(self.solids[key])

    @cached_property
    def owners(self) -> dict[frozenset[int], list[tuple[Key, int]]]:
        """Which solids and facets have the corners of each face."""
        found: dict[frozenset[int], list[tuple[Key, int]]] = {}
        for key, solid in self.solids.items():
            for facet, corners in corners_of(solid):
                found.setdefault(corners, []).append((key, facet))
        return found

    def _faces_of_nodes(self, definition: SurfaceDefinition, scope: str) -> list[tuple[Key, int]]:
        """Return the outer faces all of whose nodes belong to a surface of nodes."""
        chosen: set[int] = set()
        for face in definition.faces:
            chosen.update(self.nodes(face.of if not scope else f"{scope}.{face.of}", face.place))
        found = [sides[0] for corners, sides in self.owners.items() if len(sides) == 1 and corners <= chosen]
        carried = {p for key, facet in found for p in facet_points(self.solids[key], facet)}
        if chosen - carried:
            number = min(chosen - carried)
            name = next(key for key, index in self.index.items() if index == number)
            raise definition.place.refuse(
                f"the nodes of surface '{definition.name}' make up no whole faces: {len(chosen - carried)} of {len(chosen)} "
                f"belong to none (first: node {name[1]}); contact needs faces, TYPE=ELEMENT"
            )
        return found


def corners_of(solid: Solid) -> list[tuple[int, frozenset[int]]]:
    """Return the facets of an element, each with the points of its corners."""
    found = []
    for label, facet in enumerate(matching(solid.type.element)):
        found.append((facet, frozenset(solid.points[i] for i in solid.type.faces[label])))
    return found


def facet_points(solid: Solid, facet: int) -> tuple[int, ...]:
    """Return the points of a facet of an element."""
    return tuple(solid.points[i] for i in elements.get(solid.type.element).facets[facet])


MATCHING: dict[str, tuple[int, ...]] = {}


def matching(element: str) -> tuple[int, ...]:
    """Return the facet of an element for each face that labels 1, 2, ... name."""
    if element not in MATCHING:
        kind = ElementType("", element, "")
        facets = [frozenset(facet) for facet in elements.get(element).facets]
        MATCHING[element] = tuple(
            next(i for i, facet in enumerate(facets) if facet >= frozenset(face)) for face in kind.faces
        )
    return MATCHING[element]


def assembled(content: Content) -> Assembled:
    """Return the points and solids of all instances; CaseError where an element uses a node that is not there."""
    made = Assembled(content)
    for scope in made.scopes:
        part = made.part(scope)
        where = _placed(part, content.instances.get(scope))
        for number, point in zip(part.nodes, where.tolist(), strict=True):
            made.index[scope, number] = len(made.points)
            made.points.append(tuple(point))
        for number, cell in part.cells.items():
            for node in cell.nodes:
                if node not in part.nodes:
                    raise cell.place.refuse(f"element {number} uses node {node}, which is not defined")
            points = tuple(made.index[scope, node] for node in cell.nodes)
            kind = element_type(cell.type)
            if kind is None:
                made.discrete[scope, number] = (cell, points)
            else:
                made.solids[scope, number] = Solid(cell, kind, points)
    return made


def _placed(part: Part, instance: Instance | None) -> Array:
    """Return the coordinates (n, 3) of the nodes of a part in the assembly [length]."""
    points = np.array(list(part.nodes.values()), float).reshape(-1, 3)
    if instance is None:
        return points
    points = points + np.array(instance.translation)
    if instance.rotation:
        a, b = np.array(instance.rotation[:3]), np.array(instance.rotation[3:6])
        axis = (b - a) / np.linalg.norm(b - a)
        angle = math.radians(instance.rotation[6])
        relative = points - a
        along = np.outer(relative @ axis, axis)
        points = a + along + math.cos(angle) * (relative - along) + math.sin(angle) * np.cross(axis, relative)
        size = np.abs(points).max(initial=0.0)
        points[np.abs(points) < 1e-14 * size] = 0.0
    return points
