"""Linear constraints of a deck: equations, rigid bodies and couplings, as rows over all displacement components."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array
from fastcontact.cases.decks.assembled import facet_points
from fastcontact.cases.decks.content import Equation, Link, Pin
from fastcontact.cases.decks.local_axes import local_axes, local_directions, orientation_of
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.cases.decks.multi_points import multi_point_rows
from fastcontact.cases.decks.refusals import refusing
from fastcontact.elasticity.loads import Traction
from fastcontact.elasticity.multipoint_constraints import MultiPointConstraint
from fastcontact.mesh.mesh import Mesh
from fastcontact.model.couplings import ReferencePoint, Term, distributing_rows, relation, rigid_rows


def make_rotations(deck_mesh: DeckMesh) -> None:
    """Add a rotation point for every reference node, before the mesh is made."""
    for link in deck_mesh.made.content.links:
        point = deck_mesh.made.node(link.reference, link.location)
        if link.rotation:
            deck_mesh.rotations[point] = deck_mesh.made.node(link.rotation, link.location)
        elif deck_mesh.kinematics == "axisymmetric":
            raise link.refuse("is not supported in axisymmetric models: relate the nodes by *EQUATION")
        else:
            deck_mesh.rotation(point)


def relations_of(deck_mesh: DeckMesh, mesh: Mesh) -> list[MultiPointConstraint]:
    """Return the constraints of all equations, rigid bodies and couplings."""
    content = deck_mesh.made.content
    axes = local_directions(deck_mesh.made)
    rows = [_equation(deck_mesh, equation, axes) for equation in content.equations]
    rows += [row for pin in content.pins for row in _pinned(deck_mesh, pin)]
    rows += [row for constraint in content.multi_points for row in multi_point_rows(deck_mesh, constraint)]
    made = [relation("the equations of the deck", rows, mesh.points.shape)] if rows else []
    for link in content.links:
        name = f"*{link.location.keyword} of line {link.location.line}"
        made.append(MultiPointConstraint(name, _link_rows(deck_mesh, mesh, link)))
    return made


def _equation(deck_mesh: DeckMesh, equation: Equation, axes: Mapping[int, Array]) -> list[Term]:
    """Return the terms of an equation along the global axes; its components refer to the local `axes` of points."""
    terms: list[Term] = []
    for name, component, coefficient in equation.terms:
        point = deck_mesh.made.node(name, equation.location)
        if not 1 <= component <= deck_mesh.dim:
            raise equation.refuse(f"component {component} of '{name}' is not within 1 to {deck_mesh.dim}")
        along = axes.get(point, np.eye(3))[component - 1]
        terms += [(point, axis, coefficient * along[axis]) for axis in np.flatnonzero(along[: deck_mesh.dim]).tolist()]
    if not any(coefficient for _, _, coefficient in terms):
        raise equation.refuse("all coefficients of the equation are zero")
    return terms


def _pinned(deck_mesh: DeckMesh, pin: Pin) -> list[list[Term]]:
    """Return the equations that set the displacements of nodes equal to those of others."""
    first, second = (deck_mesh.made.nodes(name, pin.location) for name in (pin.first, pin.second))
    if len(second) == 1:
        second = second * len(first)
    if len(first) != len(second) or set(zip(first, second, strict=True)) & set(zip(second, first, strict=True)):
        raise pin.refuse(
            f"'{pin.first}' and '{pin.second}' have {len(first)} and {len(second)} nodes: as many are needed, or one that "
            "leads, each another one"
        )
    return [
        [(p, axis, 1.0), (q, axis, -1.0)] for p, q in zip(first, second, strict=True) for axis in range(deck_mesh.dim)
    ]


def _points(deck_mesh: DeckMesh, link: Link) -> list[int]:
    """Return the points that follow a reference point, without the point itself."""
    made = deck_mesh.made
    if link.kind == "nodes":
        points = made.nodes(link.group, link.location)
    elif link.kind == "elements":
        elements = made.elements_of(link.group, link.location)
        points = [p for element in elements if element.type is not None for p in element.points]
    else:
        definition, scope = made.surface(link.group, link.location)
        if definition.of_nodes:
            points = made.surface_nodes(definition, scope)
        else:
            points = [p for face in made.faces(link.group, link.location) for p in facet_points(*face)]
    reference = made.node(link.reference, link.location)
    kept = sorted(set(points) - {reference, deck_mesh.rotations[reference]})
    if not kept:
        raise link.refuse(f"'{link.group}' holds no nodes that could follow the reference node")
    return kept


def _link_rows(deck_mesh: DeckMesh, mesh: Mesh, link: Link) -> csr_array:
    """Return the rows that make nodes follow a reference point, or it the area-weighted mean motion of a surface."""
    made, n_dofs = deck_mesh.made, mesh.points.size
    point = made.node(link.reference, link.location)
    reference = ReferencePoint(point, deck_mesh.rotations[point], tuple(made.points[point][: deck_mesh.dim].tolist()))
    points = np.array(_points(deck_mesh, link), np.intp)
    places = made.points[points, : deck_mesh.dim]
    if not link.distributing:
        directions = np.array([_directions(deck_mesh, link, follower) for follower in points.tolist()])
        return rigid_rows(reference, points, places, directions, n_dofs)
    group = deck_mesh.add_facets(f"coupling of line {link.location.line}", made.faces(link.group, link.location))
    areas = Traction(_known(mesh, deck_mesh, group), {0: 1.0}, None).vector(mesh, deck_mesh.kinematics)[:, 0]
    weight = areas[points] / areas[points].sum()
    with refusing(link):
        return distributing_rows(reference, points, places, weight, _directions(deck_mesh, link, point), n_dofs)


def _directions(deck_mesh: DeckMesh, link: Link, point: int) -> Array:
    """Return the directions (n, dim) that a coupling constrains at a point [-]."""
    axes = np.eye(3)
    if link.orientation:
        axes = local_axes(
            orientation_of(deck_mesh.made.content, link.orientation, link.location), deck_mesh.made.points[point]
        )
    return axes[[component - 1 for component in link.components if component <= deck_mesh.dim], : deck_mesh.dim]


def _known(mesh: Mesh, deck_mesh: DeckMesh, group: str) -> str:
    """Return a group of the mesh with the same facets as one added after the mesh was made."""
    return next(
        name
        for name, members in deck_mesh.groups.items()
        if members == deck_mesh.groups[group] and name in mesh.cell_groups
    )
