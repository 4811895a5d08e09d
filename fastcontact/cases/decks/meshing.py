"""The mesh of a deck: solids, facets of surfaces, groups, and a point for the rotation of each reference node."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from fastcontact.arrays import Indices
from fastcontact.cases.decks.assembled import Assembly, Element, Face, assemble, facet_points
from fastcontact.cases.decks.blocks import Location, folded
from fastcontact.cases.decks.content import Content, SurfaceDefinition
from fastcontact.mesh import topology
from fastcontact.mesh.mesh import Mesh, starts_of

FACETS = {2: {2: "line2", 3: "line3"}, 3: {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8"}}
# Largest difference in z between the points of a plane model, relative to its size.
FLAT = 1e-9


@dataclass
class DeckMesh(Assembly):
    """The assembly of a deck with the facets and groups of its mesh.

    Attributes
    ----------
    rotations : dict of int to int
        Point, for each reference point, whose displacement is the rotation of the reference point [radian]. In plane models
        the first component is the rotation.
    facets : dict of str to list of tuple of int
        Points of the distinct facets by facet type.
    rows : dict of tuple of int to int
        Row of a facet in the list of its type, by its sorted points.
    groups : dict of str to dict of str to list of int
        Groups of cells, as rows by element type.
    point_groups : dict of str to ndarray (n,) of int
        Groups of points in ascending order.
    loose : dict of str to list of int
        Points of the facets around a node-based surface that do not belong to the surface, by the group of the facets.
    """

    rotations: dict[int, int] = field(default_factory=dict)
    facets: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)
    rows: dict[tuple[int, ...], int] = field(default_factory=dict)
    groups: dict[str, dict[str, list[int]]] = field(default_factory=dict)
    point_groups: dict[str, Indices] = field(default_factory=dict)
    loose: dict[str, list[int]] = field(default_factory=dict)

    @cached_property
    def kinematics(self) -> str:
        """Kinematics of the solids."""
        return self.solids[0].solid.kinematics

    @property
    def dim(self) -> int:
        """Dimension of the mesh."""
        return 3 if self.kinematics == "3d" else 2

    def add_facets(self, group: str, faces: Iterable[Face]) -> str:
        """Make a group of facets and return its name; a facet is given as an element and the index of its facet."""
        self.groups[group] = self.facet_rows(faces)
        return group

    def facet_rows(self, faces: Iterable[Face]) -> dict[str, list[int]]:
        """Return the rows of facets by type; new facets are created."""
        members: dict[str, list[int]] = {}
        for face in faces:
            points = facet_points(*face)
            name = FACETS[self.dim][len(points)]
            block = self.facets.setdefault(name, [])
            row = self.rows.setdefault(tuple(sorted(points)), len(block))
            if row == len(block):
                block.append(points)
            members.setdefault(name, []).append(row)
        return members

    def add_solids(self, group: str, chosen: Iterable[Element]) -> str:
        """Make a group of solids and return its name."""
        self.groups[group] = rows_by_type(chosen)
        return group

    def add_points(self, group: str, points: Iterable[int]) -> str:
        """Return the name of the group with these points, which is created if there is none."""
        wanted = ascending(points)
        for name, members in self.point_groups.items():
            if np.array_equal(members, wanted):
                return name
        self.point_groups[group] = wanted
        return group

    def rotation(self, point: int) -> int:
        """Return the point that carries the rotation of a reference point, which is created if there is none."""
        if point not in self.rotations:
            self.rotations[point] = len(self.points)
            self.points = np.concatenate([self.points, self.points[[point]]])
        return self.rotations[point]

    def mesh(self) -> Mesh:
        """Return the mesh, with inverted solids reoriented."""
        solids = {name: [element.points for element in members] for name, members in self.solids_by_type.items()}
        cells = {name: np.array(block, np.int32) for name, block in {**solids, **self.facets}.items()}
        del solids
        starts = starts_of(cells)
        groups = {
            group: np.concatenate([[], *(starts[name] + np.array(rows) for name, rows in members.items())]).astype(int)
            for group, members in self.groups.items()
        }
        points = self.points[:, : self.dim]
        mesh = Mesh(points, cells, groups, self.point_groups)
        mesh, turned = topology.oriented(mesh)
        if turned:
            self.content.notes.append(f"{turned} elements were inverted and are reoriented")
        return mesh


def ascending(points: Iterable[int]) -> Indices:
    """Return the distinct points (n,) in ascending order."""
    return np.unique(points if isinstance(points, np.ndarray) else np.fromiter(points, np.intp))


def rows_by_type(chosen: Iterable[Element]) -> dict[str, list[int]]:
    """Return the rows of solids by cell type."""
    rows: dict[str, list[int]] = {}
    for element in chosen:
        if element.type is not None:
            rows.setdefault(element.type.element, []).append(element.row)
    return rows


def begun(content: Content) -> DeckMesh:
    """Return the assembly of a deck with groups for its sets and surfaces.

    Raises CaseError if there are no solids, if elements of several kinematics are mixed, if elements that only conduct heat
    are used in other steps, or if a plane model is not flat.
    """
    deck_mesh = DeckMesh(content)
    assemble(deck_mesh)
    if not deck_mesh.solids:
        raise content.steps[0].refuse("the deck has no solid elements")
    first = deck_mesh.solids[0].solid
    for element in deck_mesh.solids:
        if element.solid.kinematics != first.kinematics:
            raise element.cell.refuse(
                f"elements of type {element.solid.name} and {first.name} ({first.kinematics}) cannot be in one model"
            )
        if element.solid.conducts and content.heat != "alone":
            raise element.cell.refuse(
                f"elements of type {element.solid.name} conduct heat alone: they need steps with *HEAT TRANSFER, all of them"
            )
    points = deck_mesh.points
    if deck_mesh.dim == 2 and np.ptp(points[:, 2]) > FLAT * np.ptp(points[:, :2]):
        raise deck_mesh.solids[0].cell.refuse(
            f"elements of type {first.name} lie in the plane z = const, but z differs"
        )
    _name_sets(deck_mesh)
    return deck_mesh


def _name_sets(deck_mesh: DeckMesh) -> None:
    """Add groups for the sets and surfaces of the deck; groups of a part are named ``Instance.name``."""
    for scope in deck_mesh.scopes:
        part = deck_mesh.part(scope)
        prefix = f"{deck_mesh.content.instances[scope].name}." if scope else ""
        for name, members in part.node_sets.items():
            points = deck_mesh.members_of("node", scope, name, members[0].location) if members else []
            deck_mesh.point_groups[prefix + part.set_names[name]] = ascending(points)
        for name, definition in part.surfaces.items():
            if definition.of_nodes and definition.faces:
                _name_nodes(deck_mesh, prefix + definition.name, definition, scope)
            elif definition.faces:  # an unused surface may be empty
                faces = deck_mesh.faces(f"{scope}.{name}" if scope else name, definition.location)
                deck_mesh.add_facets(prefix + definition.name, faces)
        for name, members in part.element_sets.items():
            if name not in part.surfaces and members:
                deck_mesh.add_solids(
                    prefix + part.set_names[name], deck_mesh.members_of("element", scope, name, members[0].location)
                )


def _name_nodes(deck_mesh: DeckMesh, group: str, definition: SurfaceDefinition, scope: str) -> None:
    """Add a group of the facets around the nodes of a node-based surface; other points of the facets are `loose`."""
    whole, further, left = deck_mesh.faces_of_nodes(definition, scope)
    if not (whole or further):  # the nodes belong to no solid
        return
    deck_mesh.add_facets(group, [*whole, *further])
    if left:
        points = {point for face in (*whole, *further) for point in facet_points(*face)}
        deck_mesh.loose[group] = sorted(points.difference(deck_mesh.surface_nodes(definition, scope)))


def secondary_group(deck_mesh: DeckMesh, name: str, location: Location) -> str:
    """Return the group of a surface of faces or nodes; CaseError if a node is on no outer face of a solid."""
    definition, scope = deck_mesh.surface(name, location)
    if not definition.of_nodes:
        return group_of_surface(deck_mesh, name)
    whole, further, _ = deck_mesh.faces_of_nodes(definition, scope)
    carried = {point for face in (*whole, *further) for point in facet_points(*face)}
    for point in deck_mesh.surface_nodes(definition, scope):
        if point not in carried:
            raise definition.refuse(
                f"node {deck_mesh.number_of(point)} of surface '{definition.name}' is on no outer face of a solid: "
                "contact needs nodes of bodies, so leave it out"
            )
    return group_of_surface(deck_mesh, name)


def group_of_surface(deck_mesh: DeckMesh, name: str) -> str:
    """Return the name of the group of a surface; the case of letters is ignored."""
    wanted = folded(name)
    return next(group for group in deck_mesh.groups if folded(group) == wanted)
