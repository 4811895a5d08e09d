"""Linear relations of a deck: equations, rigid bodies and couplings, as rows over all displacement components."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.cases.decks.assembled import facet_points
from fastcontact.cases.decks.content import Equation, Link
from fastcontact.cases.decks.meshing import DeckMesh
from fastcontact.elasticity.loads import Traction
from fastcontact.elasticity.relations import Relation
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]
Term = tuple[int, int, float]  # point, component, coefficient


def make_rotations(found: DeckMesh) -> None:
    """Give every reference node a point for its rotation, before the mesh is made."""
    for link in found.made.content.links:
        point = found.made.node(link.reference, link.place)
        if link.rotation:
            found.rotations[point] = found.made.node(link.rotation, link.place)
        elif found.kinematics == "axisymmetric":
            raise link.place.refuse("is not supported in axisymmetric models: relate the nodes by *EQUATION")
        else:
            found.rotation(point)


def relations_of(found: DeckMesh, mesh: Mesh) -> list[Relation]:
    """Return the relations of all equations, rigid bodies and couplings."""
    content = found.made.content
    rows = [_equation(found, equation) for equation in content.equations]
    made = [_relation("the equations of the deck", rows, mesh)] if rows else []
    for link in content.links:
        rows = _distributing(found, mesh, link) if link.distributing else _rigid(found, link)
        made.append(_relation(f"*{link.place.keyword} of line {link.place.line}", rows, mesh))
    return made


def _relation(name: str, rows: list[list[Term]], mesh: Mesh) -> Relation:
    row = [i for i, terms in enumerate(rows) for _ in terms]
    column = [point * mesh.dim + axis for terms in rows for point, axis, _ in terms]
    values = [coefficient for terms in rows for _, _, coefficient in terms]
    matrix = csr_array((values, (row, column)), shape=(len(rows), mesh.n_points * mesh.dim))
    matrix.sum_duplicates()
    matrix.eliminate_zeros()
    return Relation(name, matrix)


def _equation(found: DeckMesh, equation: Equation) -> list[Term]:
    terms = []
    for name, component, coefficient in equation.terms:
        point = found.made.node(name, equation.place)
        if not 1 <= component <= found.dim:
            raise equation.place.refuse(f"component {component} of '{name}' is none of 1 to {found.dim}")
        terms.append((point, component - 1, coefficient))
    if not any(coefficient for _, _, coefficient in terms):
        raise equation.place.refuse("all coefficients of the equation are zero")
    return terms


def _points(found: DeckMesh, link: Link) -> list[int]:
    """Return the points that follow a reference point, without itself."""
    made = found.made
    if link.kind == "nodes":
        points = made.nodes(link.group, link.place)
    elif link.kind == "elements":
        keys = made.keys("element", link.group, link.place)
        points = [p for key in keys if key in made.solids for p in made.solids[key].points]
    else:
        faces = made.faces(link.group, link.place)
        points = [p for key, facet in faces for p in facet_points(made.solids[key], facet)]
    reference = made.node(link.reference, link.place)
    kept = sorted(set(points) - {reference, found.rotations[reference]})
    if not kept:
        raise link.place.refuse(f"'{link.group}' holds no nodes that could follow the reference node")
    return kept


def _turn(dim: int, axis: int, arm: Array) -> list[tuple[int, float]]:
    """Return the rotation components, with factors, that move the end of an arm (dim,) along an axis."""
    if dim == 2:
        return [(0, -arm[1] if axis == 0 else arm[0])]
    after, last = (axis + 1) % 3, (axis + 2) % 3
    return [(after, arm[last]), (last, -arm[after])]


def _rigid(found: DeckMesh, link: Link) -> list[list[Term]]:
    """Return the equations by which nodes follow the motion of a reference point with its rotation."""
    made, dim = found.made, found.dim
    reference = made.node(link.reference, link.place)
    rotation, middle = found.rotations[reference], np.array(made.points[reference])
    rows = []
    for point in _points(found, link):
        arm = np.array(made.points[point]) - middle
        for axis in (component - 1 for component in link.components if component <= dim):
            turns = [(rotation, k, -factor) for k, factor in _turn(dim, axis, arm) if factor]
            rows.append([(point, axis, 1.0), (reference, axis, -1.0), *turns])
    return rows


def _distributing(found: DeckMesh, mesh: Mesh, link: Link) -> list[list[Term]]:
    """Return the equations by which a reference point follows the mean motion of a surface, weighted by area.

    The rotation is that of least squares, ``J theta = sum of w r x u`` with r from the middle of the surface.
    """
    made, dim = found.made, found.dim
    reference = made.node(link.reference, link.place)
    rotation = found.rotations[reference]
    group = found.add_facets(f"coupling of line {link.place.line}", made.faces(link.group, link.place))
    areas = Traction(_known(mesh, found, group), {0: 1.0}, None).vector(mesh, found.kinematics)[:, 0]
    points = np.array(_points(found, link))
    weight = areas[points] / areas[points].sum()
    where = np.array(made.points)[points]
    middle = weight @ where
    arms = where - middle
    turn = _mean_rotation(weight, arms, dim)  # (rotations, points, dim)
    rows = []
    for k in range(turn.shape[0]):
        terms = [(int(p), axis, -float(turn[k, i, axis])) for i, p in enumerate(points) for axis in range(dim)]
        rows.append([(rotation, k, 1.0), *terms])
    offset = np.array(made.points[reference]) - middle
    for axis in range(dim):
        terms = [(int(p), axis, -float(w)) for p, w in zip(points, weight, strict=True)]
        rows.append([(reference, axis, 1.0), *terms, *((rotation, k, -f) for k, f in _turn(dim, axis, offset) if f)])
    return rows


def _known(mesh: Mesh, found: DeckMesh, group: str) -> str:
    """Return a group of the mesh with the same facets as one that was added after the mesh was made."""
    return next(
        name for name, members in found.groups.items() if members == found.groups[group] and name in mesh.cell_groups
    )


def _mean_rotation(weight: Array, arms: Array, dim: int) -> Array:
    """Return how displacements (points, dim) make the mean rotation (rotations, points, dim) [1 / length]."""
    x, y, z = arms.T
    zero = np.zeros_like(x)
    if dim == 2:
        cross = np.stack([np.column_stack([-y, x])])
        inertia = np.array([[weight @ (x * x + y * y)]])
    else:
        cross = np.stack(
            [np.column_stack([zero, -z, y]), np.column_stack([z, zero, -x]), np.column_stack([-y, x, zero])]
        )
        inertia = (weight @ (arms**2).sum(axis=1)) * np.eye(3) - np.einsum("n,ni,nj->ij", weight, arms, arms)
    return np.einsum("kl,lnd,n->knd", np.linalg.inv(inertia), cross, weight)
