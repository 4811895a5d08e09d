"""Mesh of a deck: solids, facets of surfaces, groups, and a point for the rotation of each reference node."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from fastcontact._tools.grouping import grouped
from fastcontact.arrays import Indices
from fastcontact.cases.decks.assembled import Assembly, Element, Face, qualified
from fastcontact.cases.decks.blocks import Location, key_of
from fastcontact.cases.decks.content import Content, Surface
from fastcontact.mesh import topology
from fastcontact.mesh.mesh import Mesh, starts_of

# Largest difference in z between the points of a plane model, relative to its size.
PLANE_TOLERANCE = 1e-9


@dataclass
class DeckMesh(Assembly):
    """The assembly of a deck with the facets and groups of its mesh.

    Attributes
    ----------
    rotations : dict of int to int
        For each reference point, the point whose displacement represents its rotation [radian]. In plane models the first
        component is the rotation.
    facets : dict of str to list of tuple of int
        Points of the distinct facets by facet type.
    row_of_facet : dict of tuple of int to int
        Row of a facet in the list of its type, by its sorted points.
    groups : dict of str to dict of str to list of int
        Groups of cells, as rows by element type.
    point_groups : dict of str to ndarray (n,) of int
        Groups of points in ascending order.
    excluded : dict of str to list of int
        Points of the facets around a node-based surface that do not belong to the surface, by the group of the facets.
    """

    rotations: dict[int, int] = field(default_factory=dict)
    facets: dict[str, list[tuple[int, ...]]] = field(default_factory=dict)
    row_of_facet: dict[tuple[int, ...], int] = field(default_factory=dict)
    groups: dict[str, dict[str, list[int]]] = field(default_factory=dict)
    point_groups: dict[str, Indices] = field(default_factory=dict)
    excluded: dict[str, list[int]] = field(default_factory=dict)

    def add_facets(self, group: str, faces: Iterable[Face]) -> str:
        """Make a group of facets and return its name."""
        self.groups[group] = self.facet_rows(faces)
        return group

    def facet_rows(self, faces: Iterable[Face]) -> dict[str, list[int]]:
        """Return the rows of facets by facet type; facets that do not exist yet are created."""
        rows: dict[str, list[int]] = {}
        for face in faces:
            facets = self.facets.setdefault(face.type, [])
            row = self.row_of_facet.setdefault(tuple(sorted(face.points)), len(facets))
            if row == len(facets):
                facets.append(face.points)
            rows.setdefault(face.type, []).append(row)
        return rows

    def add_solids(self, group: str, solids: Iterable[Element]) -> str:
        """Make a group of the solids among some elements, and return its name."""
        self.groups[group] = grouped((e.type.element, e.row) for e in solids if e.type is not None)
        return group

    def add_points(self, group: str, points: Iterable[int]) -> str:
        """Return the name of an existing group with these points, or of the new group `group`."""
        members = ascending(points)
        for name, existing in self.point_groups.items():
            if np.array_equal(existing, members):
                return name
        self.point_groups[group] = members
        return group

    def rotation(self, point: int) -> int:
        """Return the point that represents the rotation of a reference point; it is created if it does not exist."""
        if point not in self.rotations:
            self.rotations[point] = len(self.points)
            self.points = np.concatenate([self.points, self.points[[point]]])
        return self.rotations[point]

    def mesh(self) -> Mesh:
        """Return the mesh, with inverted solids reoriented."""
        facets = {name: np.array(block, np.int32) for name, block in self.facets.items()}
        cells = {**self.solid_mesh.cells, **facets}
        starts = starts_of(cells)
        groups = {
            group: np.concatenate([[], *(starts[name] + np.array(rows) for name, rows in members.items())]).astype(int)
            for group, members in self.groups.items()
        }
        mesh = Mesh(self.points[:, : self.dim], cells, groups, self.point_groups)
        mesh, inverted = topology.oriented(mesh)
        if inverted:
            self.content.notes.append(f"{inverted} elements were inverted and are reoriented")
        return mesh


def ascending(points: Iterable[int]) -> Indices:
    """Return the distinct points (n,) in ascending order."""
    return np.unique(points if isinstance(points, np.ndarray) else np.fromiter(points, np.intp))


def deck_mesh_of(content: Content) -> DeckMesh:
    """Return the assembly of a deck with groups for its sets and surfaces.

    Raises CaseError if there are no solids, if kinematics are mixed, if elements without displacements are used in steps
    other than *HEAT TRANSFER, or if a plane model is not flat.
    """
    deck_mesh = DeckMesh(content)
    if not deck_mesh.solids:
        raise content.steps[0].error("the deck has no solid elements")
    first = deck_mesh.solids[0].type
    for element in deck_mesh.solids:
        if element.type.kinematics != first.kinematics:
            raise element.cell.error(
                f"elements of type {element.type.name} and {first.name} ({first.kinematics}) cannot be in one model"
            )
        if element.type.heat_only and content.heat != "uncoupled":
            raise element.cell.error(
                f"elements of type {element.type.name} conduct heat alone: they need *HEAT TRANSFER in all steps"
            )
    points = deck_mesh.points
    if deck_mesh.dim == 2 and np.ptp(points[:, 2]) > PLANE_TOLERANCE * np.ptp(points[:, :2]):
        raise deck_mesh.solids[0].cell.error(f"elements of type {first.name} lie in the plane z = const, but z differs")
    _add_groups(deck_mesh)
    return deck_mesh


def _add_groups(deck_mesh: DeckMesh) -> None:
    """Add groups for the sets and surfaces of the deck; groups of a part are named ``Instance.name``."""
    for scope in deck_mesh.scopes:
        part = deck_mesh.part(scope)
        prefix = f"{deck_mesh.content.instances[scope].name}." if scope else ""
        for name, members in part.node_sets.items():
            points = deck_mesh.members_of("node", scope, name, members[0].location) if members else []
            deck_mesh.point_groups[prefix + part.set_names[name]] = ascending(points)
        for name, definition in part.surfaces.items():
            if definition.of_nodes and definition.entries:
                _add_node_based_surface(deck_mesh, prefix + definition.name, definition, scope)
            elif definition.entries:  # an unused surface may be empty
                faces = deck_mesh.faces(qualified(scope, name), definition.location)
                deck_mesh.add_facets(prefix + definition.name, faces)
        for name, members in part.element_sets.items():
            if name not in part.surfaces and members:
                solids = deck_mesh.members_of("element", scope, name, members[0].location)
                deck_mesh.add_solids(prefix + part.set_names[name], solids)


def _add_node_based_surface(deck_mesh: DeckMesh, group: str, definition: Surface, scope: str) -> None:
    """Add a group of the facets around the nodes of a node-based surface; other points of these facets are `excluded`."""
    complete, further, remaining = deck_mesh.faces_of_nodes(definition, scope)
    if not (complete or further):  # the nodes belong to no solid
        return
    deck_mesh.add_facets(group, [*complete, *further])
    if remaining:
        points = {point for face in (*complete, *further) for point in face.points}
        deck_mesh.excluded[group] = sorted(points.difference(deck_mesh.surface_nodes(definition, scope)))


def check_nodes(deck_mesh: DeckMesh, name: str, location: Location) -> None:
    """Raise CaseError if a node of a node-based surface is on no outer face of a solid."""
    definition, scope = deck_mesh.surface(name, location)
    for point in deck_mesh.surface_nodes(definition, scope) if definition.of_nodes else ():
        if point not in deck_mesh.outer_faces_at:
            raise definition.error(
                f"node {deck_mesh.label_of(point)} of surface '{definition.name}' is on no outer face of a solid: "
                "contact needs nodes of bodies, so leave it out"
            )


def group_of_surface(deck_mesh: DeckMesh, name: str) -> str:
    """Return the name of the group of a surface, whose name may be in upper or lower case."""
    return next(group for group in deck_mesh.groups if key_of(group) == key_of(name))
