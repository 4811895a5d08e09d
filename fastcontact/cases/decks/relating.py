"""Linear relations of a deck: equations, rigid bodies and couplings, as rows over all displacement components."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

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


def make_rotations(found: DeckMesh) -> None:
    """Give every reference node a point for its rotation, before the mesh is made."""
    for link in found.made.content.links:
        point = found.made.node(link.reference, link.location)
        if link.rotation:
            found.rotations[point] = found.made.node(link.rotation, link.location)
        elif found.kinematics == "axisymmetric":
            raise link.location.refuse("is not supported in axisymmetric models: relate the nodes by *EQUATION")
        else:
            found.rotation(point)


def relations_of(found: DeckMesh, mesh: Mesh) -> list[MultiPointConstraint]:
    """Return the relations of all equations, rigid bodies and couplings."""
    content = found.made.content
    axes = local_directions(found.made)
    rows = [_equation(found, equation, axes) for equation in content.equations]
    rows += [row for pin in content.pins for row in _pinned(found, pin)]
    rows += [row for constraint in content.multi_points for row in multi_point_rows(found, constraint)]
    made = [relation("the equations of the deck", rows, mesh.points.shape)] if rows else []
    for link in content.links:
        rows = _distributing(found, mesh, link) if link.distributing else _rigid(found, link)
        made.append(relation(f"*{link.location.keyword} of line {link.location.line}", rows, mesh.points.shape))
    return made


def _equation(found: DeckMesh, equation: Equation, axes: Mapping[int, Array]) -> list[Term]:
    """Return the terms of an equation along the axes of space; components count along the local `axes` of points."""
    terms: list[Term] = []
    for name, component, coefficient in equation.terms:
        point = found.made.node(name, equation.location)
        if not 1 <= component <= found.dim:
            raise equation.location.refuse(f"component {component} of '{name}' is not within 1 to {found.dim}")
        along = axes.get(point, np.eye(3))[component - 1]
        terms += [(point, axis, coefficient * along[axis]) for axis in np.flatnonzero(along[: found.dim]).tolist()]
    if not any(coefficient for _, _, coefficient in terms):
        raise equation.location.refuse("all coefficients of the equation are zero")
    return terms


def _pinned(found: DeckMesh, pin: Pin) -> list[list[Term]]:
    """Return the equations by which nodes have the displacements of others."""
    first, second = (found.made.nodes(name, pin.location) for name in (pin.first, pin.second))
    if len(second) == 1:
        second = second * len(first)
    if len(first) != len(second) or set(zip(first, second, strict=True)) & set(zip(second, first, strict=True)):
        raise pin.location.refuse(
            f"'{pin.first}' and '{pin.second}' have {len(first)} and {len(second)} nodes: as many are needed, or one that "
            "leads, each another one"
        )
    return [[(p, axis, 1.0), (q, axis, -1.0)] for p, q in zip(first, second, strict=True) for axis in range(found.dim)]


def _points(found: DeckMesh, link: Link) -> list[int]:
    """Return the points that follow a reference point, without itself."""
    made = found.made
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
    kept = sorted(set(points) - {reference, found.rotations[reference]})
    if not kept:
        raise link.location.refuse(f"'{link.group}' holds no nodes that could follow the reference node")
    return kept


def _reference(found: DeckMesh, link: Link) -> ReferencePoint:
    point = found.made.node(link.reference, link.location)
    return ReferencePoint(point, found.rotations[point], tuple(found.made.points[point][: found.dim].tolist()))


def _rigid(found: DeckMesh, link: Link) -> list[list[Term]]:
    """Return the equations by which nodes follow the motion of a reference point with its rotation."""
    points, dim = np.array(_points(found, link), np.intp), found.dim
    rows = rigid_rows(_reference(found, link), points, found.made.points[points, :dim], range(dim))
    along = [_directions(found, link, point) for point in points.tolist()]
    return [row for i, axes in enumerate(along) for row in _along(rows[i * dim : (i + 1) * dim], axes)]


def _directions(found: DeckMesh, link: Link, point: int) -> Array:
    """Return the directions (n, dim) of the components that a coupling relates at a point [-]."""
    axes = np.eye(3)
    if link.orientation:
        axes = local_axes(orientation_of(found.made.content, link.orientation, link.location), found.made.points[point])
    return axes[[component - 1 for component in link.components if component <= found.dim], : found.dim]


def _along(rows: Sequence[Sequence[Term]], directions: Array) -> list[list[Term]]:
    """Return equations of displacement components, one for each axis, as such along `directions` (n, dim)."""
    return [
        [
            (point, axis, float(factor) * value)
            for factor, row in zip(direction, rows, strict=True)
            for point, axis, value in row
        ]
        for direction in directions
    ]


def _distributing(found: DeckMesh, mesh: Mesh, link: Link) -> list[list[Term]]:
    """Return the equations by which a reference point follows the mean motion of a surface, weighted by area."""
    made = found.made
    group = found.add_facets(f"coupling of line {link.location.line}", made.faces(link.group, link.location))
    areas = Traction(_known(mesh, found, group), {0: 1.0}, None).vector(mesh, found.kinematics)[:, 0]
    points = np.array(_points(found, link), np.intp)
    weight = areas[points] / areas[points].sum()
    with refusing(link.location):
        rows = distributing_rows(_reference(found, link), points, made.points[points, : found.dim], weight)
    turns = len(rows) - found.dim
    return rows[:turns] + _along(rows[turns:], _directions(found, link, made.node(link.reference, link.location)))


def _known(mesh: Mesh, found: DeckMesh, group: str) -> str:
    """Return a group of the mesh with the same facets as one that was added after the mesh was made."""
    return next(
        name for name, members in found.groups.items() if members == found.groups[group] and name in mesh.cell_groups
    )
