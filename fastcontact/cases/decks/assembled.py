"""Assembly of a deck: its points and elements, and those of its sets, surfaces and distributed loads."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from sys import intern
from typing import Any

import numpy as np

from fastcontact._tools.grouping import grouped
from fastcontact.arrays import Array
from fastcontact.cases.decks.blocks import LONGEST_QUOTED, Located, Location, Row, key_of, look_up
from fastcontact.cases.decks.content import Cell, Content, Instance, Members, Part, Surface, SurfaceEntry
from fastcontact.cases.decks.element_types import ElementType, element_type
from fastcontact.contact.obstacles.rigid_side import Rotation
from fastcontact.mesh import elements, topology
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import LENGTH_ROUND_OFF

# Largest number of set names that a message lists.
MOST_NAMES = 12


@dataclass(eq=False, slots=True)
class Element:
    """An element of an instance (`scope`) with its cell in the deck and its points.

    `type` is None unless the element is a solid. `row` is its index among the solids with the same type of mesh element.
    `section` assigns its material once the sections are read.
    """

    scope: str
    number: int
    cell: Cell
    type: Any  # ElementType or None
    points: tuple[int, ...]
    row: int = -1
    section: Any = None  # Section or None

    def face(self, facet: int) -> Face:
        """Return the face of a solid that is the facet of its mesh element with this index."""
        reference = elements.get(self.type.element)
        return Face(reference.facet_elements[facet], tuple(self.points[i] for i in reference.facets[facet]), self)


@dataclass(frozen=True, slots=True)
class Face:
    """A facet of a solid: its element type and its points, by which faces are compared."""

    type: str
    points: tuple[int, ...]
    solid: Element = field(compare=False)

    @property
    def corners(self) -> frozenset[int]:
        """The points at the corners."""
        return frozenset(self.points[: elements.get(self.type).n_corners])


@dataclass
class Assembly:
    """Points and elements of all instances of a deck.

    Attributes
    ----------
    content : Content
        Content of the deck.
    points : ndarray (n_points, 3)
        Coordinates in the assembly [length].
    index : dict of str to dict of int to int
        Point number by instance and node number. The name of the instance is empty for nodes outside all parts.
    elements : dict of str to dict of int to Element
        Elements by instance and element number.
    resolved : dict of (str, str, str) to list
        Members of the sets that have been resolved so far, by kind, instance and name.
    surfaces : dict of str to list of Face
        Faces of the surfaces that have been resolved so far.
    being_resolved : list of (str, str, str)
        Sets that are being resolved, for the detection of sets that contain themselves.
    repeating : set of (str, str, str)
        Sets and surfaces that list a member several times.
    """

    content: Content
    points: Array = field(default_factory=lambda: np.empty((0, 3)))
    index: dict[str, dict[int, int]] = field(default_factory=dict)
    elements: dict[str, dict[int, Element]] = field(default_factory=dict)
    resolved: dict[tuple[str, str, str], list[Any]] = field(default_factory=dict)
    surfaces: dict[str, list[Face]] = field(default_factory=dict)
    being_resolved: list[tuple[str, str, str]] = field(default_factory=list)
    repeating: set[tuple[str, str, str]] = field(default_factory=set)

    def __post_init__(self) -> None:
        """Add the points and elements of all instances. Raises CaseError if an element uses an undefined node."""
        n_points, counts = 0, dict[str, int]()
        coordinates = []
        for scope in self.scopes:
            part = self.part(scope)
            coordinates.append(_coordinates_in_assembly(part, self.content.instances.get(scope)))
            index = {number: n_points + row for number, row in part.nodes.items()} if n_points else part.nodes
            self.index[scope] = index
            n_points += len(index)
            elements = self.elements[scope] = {}
            for number, cell in part.cells.items():
                points = tuple(index.get(node, -1) for node in cell.nodes)
                if -1 in points:
                    raise cell.error(f"element {number} uses node {cell.nodes[points.index(-1)]}, which is not defined")
                solid_type = element_type(cell.type)
                row = -1 if solid_type is None else counts.setdefault(solid_type.element, 0)
                if solid_type is not None:
                    counts[solid_type.element] += 1
                elements[number] = Element(scope, number, cell, solid_type, points, row)
        self.points = np.concatenate(coordinates) if len(coordinates) > 1 else coordinates[0]

    @cached_property
    def kinematics(self) -> str:
        """Kinematics of the solids."""
        return self.solids[0].type.kinematics

    @property
    def dim(self) -> int:
        """Dimension of the mesh."""
        return 3 if self.kinematics == "3d" else 2

    @cached_property
    def solids(self) -> list[Element]:
        """All solids."""
        return [element for elements in self.elements.values() for element in elements.values() if element.type]

    @cached_property
    def solid_points(self) -> set[int]:
        """Points of all solids."""
        return {point for solid in self.solids for point in solid.points}

    @cached_property
    def discrete(self) -> list[Element]:
        """All gap elements and springs."""
        return [element for elements in self.elements.values() for element in elements.values() if element.type is None]

    def part(self, scope: str) -> Part:
        """Return the part of an instance, or the nodes and elements outside all parts if `scope` is empty."""
        return self.content.instances[scope].part if scope else self.content.root

    @cached_property
    def scopes(self) -> list[str]:
        """Names of all instances in the form used for lookup, preceded by the empty name."""
        return ["", *self.content.instances]

    def split_name(self, name: str) -> tuple[str, str]:
        """Split a name into its instance, which may be empty, and the name in it: ``Part-1.17`` is node 17 of Part-1."""
        text = key_of(name)
        for scope in self.content.instances:
            if text.startswith(scope + "."):
                return scope, text[len(scope) + 1 :]
        return "", text

    def members(self, kind: str, name: str, location: Location) -> list[Any]:
        """Return the points or elements (`kind` "node" or "element") of a set or a number; CaseError if it is undefined."""
        scope, label = self.split_name(name)
        if label.isdecimal():
            return [self._item(kind, scope, int(label[:19]), location)]
        return self.members_of(kind, scope, label, location, name)

    def members_of(self, kind: str, scope: str, name: str, location: Location, full_name: str = "") -> list[Any]:
        """Return the points or elements of a set of an instance, including those of nested sets.

        Raises CaseError if the set is not defined; the message contains `full_name`, by default `name`.
        """
        part, key = self.part(scope), (kind, scope, name)
        sets = part.node_sets if kind == "node" else part.element_sets
        if name not in sets:
            names = sorted({part.set_names[other] for other in sets})
            listed = ", ".join(names[:MOST_NAMES]) + (", ..." if len(names) > MOST_NAMES else "") or "none"
            raise location.error(f"set '{(full_name or name)[:LONGEST_QUOTED]}' is not defined; {kind} sets: {listed}")
        if key not in self.resolved:
            if key in self.being_resolved:
                raise location.error(f"set '{part.set_names[name]}' contains itself")
            self.being_resolved.append(key)
            members = [member for entry in sets[name] for member in self._members_of_entry(kind, scope, entry)]
            self.being_resolved.pop()
            self.resolved[key] = list(dict.fromkeys(members))
            self.repeating.update([key] if len(self.resolved[key]) < len(members) else [])
        self.repeating.update(self.being_resolved if key in self.repeating else [])
        return self.resolved[key]

    def _members_of_entry(self, kind: str, scope: str, entry: Members) -> Iterable[Any]:
        """Return the points or elements of one entry of a set; undefined numbers of a range are ignored."""
        scope = entry.instance or scope
        if scope:
            look_up("instance", scope, self.content.instances, entry)
        if entry.name:
            return self._members_by_name(kind, scope, entry)
        items, numbers = self._items_of(kind, scope), entry.numbers
        if not isinstance(numbers, range):
            return (items[n] if n in items else self._item(kind, scope, n, entry.location) for n in numbers)
        candidates = numbers if len(numbers) <= len(items) else sorted(items)
        existing = [n for n in candidates if n in items and n in numbers]
        if len(existing) < len(numbers):
            missing = f"{len(numbers) - len(existing)} of the {len(numbers)} numbers {numbers[0]} to {numbers[-1]}"
            self.content.note(entry, f"{missing} are not {kind}s and are ignored")
        return (items[n] for n in existing)

    def _members_by_name(self, kind: str, scope: str, entry: Members) -> Iterable[Any]:
        """Return the points or elements of a set that is an entry of a set; a node set may contain an element set."""
        if not scope and any(entry.name.upper().startswith(name) for name in self.content.instances):
            return self.members(kind, entry.name, entry.location)
        part, name = self.part(scope), key_of(entry.name)
        if kind == "node" and name not in part.node_sets and name in part.element_sets:
            elements = self.members_of("element", scope, name, entry.location)
            return dict.fromkeys(point for element in elements for point in element.points)
        return self.members_of(kind, scope, name, entry.location, entry.name)

    def _items_of(self, kind: str, scope: str) -> Mapping[int, Any]:
        """Return the points or elements of an instance by number."""
        return self.index.get(scope, {}) if kind == "node" else self.elements.get(scope, {})

    def _item(self, kind: str, scope: str, number: int, location: Location) -> Any:
        """Return the point or element with a number. Raises CaseError if there is none."""
        item = self._items_of(kind, scope).get(number)
        if item is None:
            where = f" in instance '{self.content.instances[scope].name}'" if scope else ""
            raise location.error(f"{kind} {number} is not defined{where}")
        return item

    def nodes(self, name: str, location: Location) -> list[int]:
        """Return the points of a node set or of a single node; errors as for `members`."""
        return self.members("node", name, location)

    def elements_of(self, name: str, location: Location) -> list[Element]:
        """Return the elements of an element set, or a single element; errors as for `members`."""
        return self.members("element", name, location)

    def node(self, name: str, location: Location) -> int:
        """Return the point of a node number or of a set with one node.

        Raises CaseError if it is not defined or not unique.
        """
        nodes = self.nodes(name, location)
        if len(nodes) != 1:
            raise location.error(f"'{name}' has {len(nodes)} nodes, but one is needed")
        return nodes[0]

    def faces(self, name: str, location: Location) -> list[Face]:
        """Return the faces of a surface. Raises CaseError if it has no faces."""
        definition, scope = self.surface(name, location)
        if definition.of_nodes:
            complete, _, remaining = self.faces_of_nodes(definition, scope)
            if remaining:
                raise definition.error(
                    f"the nodes of surface '{definition.name}' do not form whole faces: {len(remaining)} belong to none "
                    f"(first: node {self.label_of(remaining[0])}), and *{location.keyword} in line {location.line} "
                    "needs faces, TYPE=ELEMENT"
                )
            return complete
        if (key := key_of(name)) not in self.surfaces:
            faces: list[Face] = []
            for entry in definition.entries:
                members = self.elements_of(qualified(scope, entry.name), entry.location)
                faces += (face for element in members for face in self._faces_of(element, entry))
            self.surfaces[key] = list(dict.fromkeys(faces))
            self.repeating.update([("surface", *self.split_name(name))] if len(self.surfaces[key]) < len(faces) else [])
        return self.surfaces[key]

    def surface(self, name: str, location: Location) -> tuple[Surface, str]:
        """Return the definition of a surface and the instance that contains it. Raises CaseError if it is not defined."""
        scope, label = self.split_name(name)
        surfaces = self.part(scope).surfaces
        if label not in surfaces:
            names = ", ".join(sorted(surface.name for surface in surfaces.values())) or "none"
            raise location.error(f"surface '{name[:LONGEST_QUOTED]}' is not defined; surfaces: {names}")
        if not surfaces[label].entries:
            raise surfaces[label].error(f"surface '{surfaces[label].name[:LONGEST_QUOTED]}' has no faces")
        return surfaces[label], scope

    def _type_of_solid(self, element: Element, location: Location) -> ElementType:
        """Return the type of an element with faces. Raises CaseError if it is not a solid."""
        if element.type is None:
            raise location.error(f"element {element.number} is not a solid, so it has no faces")
        return element.type

    def face(self, element: Element, label: int, location: Location) -> Face:
        """Return the face of an element with a label, counted from 1. Raises CaseError if there is none."""
        solid = self._type_of_solid(element, location)
        if not 1 <= label <= len(solid.faces):
            raise location.error(
                f"element {element.number} of type {solid.name} has no face {label}, only 1 to {len(solid.faces)}"
            )
        return element.face(solid.faces[label - 1])

    def _faces_of(self, element: Element, entry: SurfaceEntry) -> list[Face]:
        """Return the face of an element that an entry of a surface selects, or its faces that no other solid shares."""
        if entry.label:
            return [self.face(element, int(entry.label[1:]), entry.location)]
        self._type_of_solid(element, entry.location)
        return self.outer_faces.get(element, [])

    @cached_property
    def solids_by_type(self) -> dict[str, list[Element]]:
        """The solids by type of mesh element, each at index `row`."""
        return grouped((element.type.element, element) for element in self.solids)

    @cached_property
    def solid_mesh(self) -> Mesh:
        """Mesh of the solids, without groups."""
        cells = {name: [element.points for element in members] for name, members in self.solids_by_type.items()}
        return Mesh(self.points[:, : self.dim], {name: np.array(block, np.int32) for name, block in cells.items()})

    @cached_property
    def outer_faces(self) -> dict[Element, list[Face]]:
        """The faces of each solid that no other solid shares."""
        solids = list(itertools.chain.from_iterable(self.solids_by_type.values()))
        cells = topology.cells_of_outer_facets(self.solid_mesh)
        return grouped(
            (solids[cell], Face(name, tuple(points), solids[cell]))
            for name, facets in topology.outer_facets(self.solid_mesh).items()
            for cell, points in zip(cells[name].tolist(), facets.tolist(), strict=True)
        )

    @cached_property
    def outer_faces_at(self) -> dict[int, list[Face]]:
        """The outer faces at each point."""
        return grouped((point, face) for faces in self.outer_faces.values() for face in faces for point in face.points)

    def faces_touching(self, points: set[int]) -> list[Face]:
        """Return the outer faces with a point in `points`."""
        return list(dict.fromkeys(face for point in sorted(points) for face in self.outer_faces_at.get(point, ())))

    def surface_nodes(self, definition: Surface, scope: str) -> list[int]:
        """Return the points of a node-based surface without repetition."""
        points = (self.nodes(qualified(scope, entry.name), entry.location) for entry in definition.entries)
        return list(dict.fromkeys(itertools.chain.from_iterable(points)))

    def label_of(self, point: int) -> str:
        """Return the label in the deck of the node at a point, with its instance."""
        for scope, nodes in self.index.items():
            for number, index in nodes.items():
                if index == point:
                    return f"{self.content.instances[scope].name}.{number}" if scope else str(number)
        return "of a rotation"

    def faces_of_nodes(self, definition: Surface, scope: str) -> tuple[list[Face], list[Face], list[int]]:
        """Return the complete faces of a node-based surface, incomplete faces around its remaining nodes, and these nodes.

        All corners of a complete face are on the surface. Around each node that belongs to no complete face, the faces with
        the largest number of nodes on the surface are returned.
        """
        nodes = set(self.surface_nodes(definition, scope))
        complete: list[tuple[Face, set[int]]] = []
        incomplete: list[tuple[Face, set[int]]] = []
        for face in self.faces_touching(nodes):
            (complete if face.corners <= nodes else incomplete).append((face, nodes.intersection(face.points)))
        remaining = nodes.difference(*(shared for _, shared in complete))
        largest: dict[int, int] = {}
        for _, shared in incomplete:
            largest.update((point, max(len(shared), largest.get(point, 0))) for point in shared & remaining)
        further = [face for face, shared in incomplete if any(largest[p] == len(shared) for p in shared & remaining)]
        return [face for face, _ in complete], further, sorted(remaining)


def qualified(scope: str, name: str) -> str:
    """Return the name of a set, a surface or an element of an instance, such as ``Part-1.17``; see `Assembly.split_name`."""
    return f"{scope}.{name}" if scope else name


def _coordinates_in_assembly(part: Part, instance: Instance | None) -> Array:
    """Return the coordinates (n, 3) of the nodes of a part in the assembly [length]."""
    points = np.asarray(part.coordinates).reshape(-1, 3)
    if instance is None:
        return points
    points = points + np.array(instance.translation)
    if instance.rotation:
        (a, b), angle = np.reshape(instance.rotation[:6], (2, 3)), math.radians(instance.rotation[6])
        points = a + (points - a) @ Rotation(tuple(a), tuple(b - a), angle).matrix(angle).T
        size = np.abs(points).max(initial=0.0)
        points[np.abs(points) < 1e-14 * size] = 0.0  # round-off, for example of the cosine of 90 degrees
    return points


# Labels of loads on surfaces and on faces of elements by keyword; the latter are followed by the number of the face.
SURFACE_LOADS = {"DSLOAD": "P", "DSFLUX": "S", "SFILM": "F"}
FACE_LOADS = {"DLOAD": "P", "DFLUX": "S", "FILM": "F"}
# Labels of loads on elements by keyword, with the number of their further entries.
ELEMENT_LOADS = {"DLOAD": {"GRAV": 3, "CENTRIF": 6, "BX": 0, "BY": 0, "BZ": 0}, "DFLUX": {"BF": 0}, "FILM": {}}


@dataclass(frozen=True, slots=True)
class Target(Located):
    """Target of a distributed load, a face or elements, with the keyword, the location and the kind of the load.

    `numbers` contains the unit vector [-] of gravity, two vectors for the axis of rotation of centrifugal forces (its point
    [length] closest to the origin, and a unit vector [-] along it), or the film coefficient [power / (area temperature)].
    """

    keyword: str
    location: Location = field(compare=False)
    kind: str
    face: Face | None = None
    elements: tuple[Element, ...] = ()
    numbers: tuple[float, ...] = ()


def targets(assembly: Assembly, row: Row, numbers: tuple[float, ...] = ()) -> list[Target]:
    """Return the targets of a data line of a distributed load. Raises CaseError if the load is not supported.

    `numbers` are stored with targets on faces.
    """
    keyword, label = row.location.keyword, intern(row.text(1).upper())  # many targets share a label
    load = "load " if keyword.endswith("LOAD") else ""
    if keyword in SURFACE_LOADS:
        letter = SURFACE_LOADS[keyword]
        if label != letter:
            raise row.error(f"{load}{label[:40]} on a surface is not supported, only {letter}")
        faces = assembly.faces(row.text(0), row.location)
        return [Target(keyword, row.location, letter, face, (), numbers) for face in faces]
    letter, element_loads = FACE_LOADS[keyword], ELEMENT_LOADS[keyword]
    on_all_solids = keyword == "DLOAD" and not row.text(0)
    elements = assembly.solids if on_all_solids else assembly.elements_of(row.text(0), row.location)
    if label[:1] == letter and label[1:].isdigit():
        faces = [assembly.face(element, int(label[1:]), row.location) for element in elements]
        return [Target(keyword, row.location, letter, face, (), numbers) for face in faces]
    if label not in element_loads:
        labels = ", ".join([f"{letter}1", f"{letter}2", "...", *element_loads])
        raise row.error(f"{load}{label[:40]} is not supported; expected one of {labels}")
    if label == "BZ" and assembly.dim == 2:
        raise row.error("BZ must not cause forces normal to the plane of the model")
    if not element_loads[label]:
        return [Target(keyword, row.location, label, None, (element,)) for element in elements]
    vector = np.array([row.number(3 + i, 0.0) for i in range(element_loads[label])])
    if not vector[-3:].any():
        raise row.error(f"the direction of {label} is missing")
    vector[-3:] /= np.linalg.norm(vector[-3:])
    if label == "CENTRIF":
        vector[3:] *= np.sign(vector[3 + np.argmax(np.abs(vector[3:]))])
        vector[:3] -= vector[:3] @ vector[3:] * vector[3:]
    if assembly.dim == 2:
        _check_plane_load(assembly, row, label, vector)
    return [Target(keyword, row.location, label, None, tuple(elements), tuple(vector.tolist()))]


def _check_plane_load(assembly: Assembly, row: Row, label: str, vector: Array) -> None:
    """Raise CaseError if gravity or the axis of a centrifugal force is not admissible in a plane or axisymmetric model."""
    axial, points = label == "CENTRIF", assembly.points
    x, y, z = np.abs(vector[-3:]) > LENGTH_ROUND_OFF
    offset = np.abs(vector[:3] - [0.0, 0.0, points[0, 2]]) > LENGTH_ROUND_OFF * np.ptp(points, axis=0).max()
    if assembly.kinematics == "axisymmetric":
        if x or z or (axial and (offset[0] or offset[2])):
            raise row.error(f"{label} must be along the axis of symmetry, y")
    elif (z and (x or y or not axial)) or (axial and offset[2] and not z):
        raise row.error(f"{label} must not cause forces normal to the plane of the model")
