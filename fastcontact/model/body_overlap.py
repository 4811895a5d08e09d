"""Penetration depths of overlapping bodies."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.search.closest import closest_of_kinds
from fastcontact.contact.search.facet_tables import flat_triangles
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.round_off import LENGTH_ROUND_OFF

# Points nearer to a surface than this, relative to the size of the model, lie on it.
ON_SURFACE = 1e-10


def penetration(mesh: Mesh, kinematics: str, coordinates: Array) -> list[tuple[int, int, float, Array]]:
    """Return (body, other, depth, where) for each pair of bodies of which the first has nodes inside the second.

    `depth` is the largest of the depths of the pair in `depths` [length], and `where` (dim,) its position [length].
    """
    overlaps = []
    for number, other, points, depth in depths(mesh, kinematics, coordinates):
        deepest = int(np.argmax(depth))
        if depth[deepest] > 0.0:
            overlaps.append((number, other, float(depth[deepest]), coordinates[points[deepest]]))
    return overlaps


def depths(mesh: Mesh, kinematics: str, coordinates: Array) -> Iterator[tuple[int, int, Indices, Array]]:
    """Yield (body, other, points (n,), depth (n,)) for each pair of bodies that may overlap.

    Depths are the distances of points on the outside of the first body to the outside of the second, and zero for points that
    do not lie in the second body [length]. The axis of an axisymmetric body is not part of its outside. Facets are treated as
    curved. Each of two meshes of a smooth curved surface deviates from it by less than the square of the rise of a facet over
    its length; within this tolerance bodies touch and do not overlap.
    """
    count, body = bodies(mesh)
    if count < 2:
        return
    outer = outer_facets(mesh)
    sides = [{name: facets[body[facets[:, 0]] == number] for name, facets in outer.items()} for number in range(count)]
    nodes = [np.unique(np.concatenate([facets.ravel() for facets in side.values()])) for side in sides]
    stray = np.zeros(mesh.n_points)
    for name, facets in outer.items():
        np.maximum.at(stray, facets, _strays(name, coordinates[facets])[:, None])
    for number, other in ((a, b) for a in range(count) for b in range(count) if a != b):
        low, high = coordinates[nodes[other]].min(axis=0), coordinates[nodes[other]].max(axis=0)
        near = nodes[number]
        near = near[((coordinates[near] >= low) & (coordinates[near] <= high)).all(axis=1)]
        if not len(near):
            continue
        kinds = [(name, coordinates[facets]) for name, facets in sides[other].items() if len(facets)]
        corners = [block for _, block in kinds]
        selected = None
        if kinematics == "axisymmetric":
            size = max(float(np.abs(block).max()) for block in corners)
            selected = [(np.abs(block[:, :, 0]) > LENGTH_ROUND_OFF * size).any(axis=1) for block in corners]
        depth, facet = _depths(coordinates[near], corners, selected)
        play = np.concatenate([_strays(name, block) for name, block in kinds])[facet]
        yield number, other, near, np.where(depth <= play + stray[near], 0.0, depth)


def _strays(name: str, corners: Array) -> Array:
    """Return the largest deviations (n,) of facets (n, k, dim) from a smooth surface through their nodes [length].

    A parabola of rise r over a chord of length h deviates from its circle by r^3 / h^2; r^2 / h leaves a margin for varying
    curvature. Straight facets contain no information about a curved surface, and get zero.
    """
    element = elements.get(name)
    if element.order == 1:
        return np.zeros(len(corners))
    ends = np.array(element.edges)
    middle = corners[:, element.n_corners : element.n_corners + len(ends)]
    chord = corners[:, ends[:, 1]] - corners[:, ends[:, 0]]
    length = np.linalg.norm(chord, axis=2)
    rise = np.linalg.norm(middle - 0.5 * (corners[:, ends[:, 0]] + corners[:, ends[:, 1]]), axis=2)
    return np.asarray((rise**2 / length).max(axis=1))


def _depths(points: Array, kinds: list[Array], selected: list[Mask] | None = None) -> tuple[Array, Indices]:
    """Return the depths of `points` (n, dim) in the closed surface of facets (m, n_nodes, dim), 0 outside.

    The second result is the closest facet (n,), numbered through the kinds. Distances are those to the facets `selected`, by
    default all. If the closest point lies inside a facet, the normal of the facet decides whether the point is inside.
    On ends, edges and corners adjacent normals may disagree, and the winding number of the surface decides.
    """
    selected = [np.ones(len(corners), bool) for corners in kinds] if selected is None else selected
    counted = [corners[mask] for corners, mask in zip(kinds, selected, strict=True)]
    closest = closest_of_kinds(points, [corners for corners in counted if len(corners)])
    size = max(float(np.abs(corners).max()) for corners in kinds)
    height = np.einsum("nd,nd->n", points - closest.position, closest.normal)  # above the tangent planes
    inside = height < 0
    unsure = np.flatnonzero((np.abs(height) < 0.999 * closest.distance) & (closest.distance > ON_SURFACE * size))
    if len(unsure):
        pieces = [corners[:, _flat_pieces(corners)].reshape(-1, *2 * corners.shape[2:]) for corners in kinds]
        inside[unsure] = winding_numbers(points[unsure], np.concatenate(pieces)) > 0.5
    depth = np.where(inside & (closest.distance > ON_SURFACE * size), closest.distance, 0.0)
    return depth, np.flatnonzero(np.concatenate(selected))[closest.facet]


def winding_numbers(points: Array, pieces: Array) -> Array:
    """Return the winding number (n,) [-] of a closed surface around each of `points` (n, dim) [length]: 1 inside, 0 outside.

    It is the sum of the angles, or solid angles (Van Oosterom and Strackee, 1983, eq. 8), of the `pieces` (m, dim, dim)
    [length] of the surface, lines or triangles, divided by a full angle. Angles are positive for outward normals.
    """
    turns = np.empty(len(points))
    for i, point in enumerate(points):
        arms = pieces - point
        products = np.einsum("mid,mjd->mij", arms, arms)
        sine, cosine = np.linalg.det(arms), products[:, 0, 1]
        if arms.shape[2] == 3:  # half the solid angle
            r = np.sqrt(np.diagonal(products, axis1=1, axis2=2))
            cosine = r.prod(axis=1) + sum(products[:, k, k - 1] * r[:, k - 2] for k in range(3))
        turns[i] = np.arctan2(sine, cosine).sum() / (2.0 * np.pi)
    return turns


def _flat_pieces(corners: Array) -> Indices:
    """Return the lines (n, 2) or triangles (n, 3) between the nodes of facets (m, n_nodes, dim)."""
    n_nodes, dim = corners.shape[1:]
    if dim == 2:
        return np.array([[0, 1]] if n_nodes == 2 else [[0, 2], [2, 1]])
    return flat_triangles(n_nodes)
