"""How deep bodies lie inside each other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.contact.search.closest import closest_of_kinds
from fastcontact.contact.search.facet_tables import flat_triangles
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.model import body_overlap_kernels

# Points nearer to a surface than this, relative to the size of the model, lie on it.
ON_SURFACE = 1e-10


def penetration(mesh: Mesh, kinematics: str, coordinates: Array) -> list[tuple[int, int, float, Array]]:
    """Return (body, other, depth, where) for each pair of bodies of which the first has nodes inside the second.

    Depth is the largest of `depths` [length].
    """
    overlaps = []
    for number, other, points, depth in depths(mesh, kinematics, coordinates):
        deepest = int(np.argmax(depth))
        if depth[deepest] > 0.0:
            overlaps.append((number, other, float(depth[deepest]), coordinates[points[deepest]]))
    return overlaps


def depths(mesh: Mesh, kinematics: str, coordinates: Array) -> Iterator[tuple[int, int, Indices, Array]]:
    """Yield (body, other, points (n,), depth (n,)) for each pair of bodies that may overlap.

    Depths are distances of points on the outside of the first body to the outside of the second, zero where they do not lie
    in it [length]. The axis of an axisymmetric body is not its outside. Facets count as they are curved. Two meshes of one
    smooth curved surface stray from it, each by less than the square of the rise of a facet over its length: within that
    bodies touch and do not overlap.
    """
    count, body = bodies(mesh)
    if count < 2:
        return
    outer = outer_facets(mesh)
    sides = [{name: facets[body[facets[:, 0]] == number] for name, facets in outer.items()} for number in range(count)]
    nodes = [np.unique(np.concatenate([facets.ravel() for facets in side.values()])) for side in sides]
    own = np.zeros(mesh.n_points)
    for name, facets in outer.items():
        np.maximum.at(own, facets, _strays(name, coordinates[facets])[:, None])
    for number, other in ((a, b) for a in range(count) for b in range(count) if a != b):
        low, high = coordinates[nodes[other]].min(axis=0), coordinates[nodes[other]].max(axis=0)
        near = nodes[number]
        near = near[((coordinates[near] >= low) & (coordinates[near] <= high)).all(axis=1)]
        if not len(near):
            continue
        kinds = [(name, coordinates[facets]) for name, facets in sides[other].items() if len(facets)]
        corners = [block for _, block in kinds]
        if mesh.dim == 3:
            depth, facet = _depths_in_space(coordinates[near], corners)
        else:
            depth, facet = _depths_in_plane(coordinates[near], corners, kinematics == "axisymmetric")
        play = np.concatenate([_strays(name, block) for name, block in kinds])[facet]
        yield number, other, near, np.where(depth <= play + own[near], 0.0, depth)


def _strays(name: str, corners: Array) -> Array:
    """Return how far facets (n, k, dim) may stray from a smooth surface through their nodes (n,) [length].

    A parabola over a chord of length h that rises by r over it strays from its circle by r^3 / h^2; r^2 / h leaves room
    for curvatures that change. Straight facets tell nothing of a surface they might stand for, and get zero.
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


def _depths_in_plane(points: Array, kinds: list[Array], axisymmetric: bool) -> tuple[Array, Indices]:
    """Return how deep each of `points` (n, 2) lies in the closed curves of facets (m, 2 or 3, 2), 0 outside.

    Also the closest facet (n,), counted through the kinds, of those inside.
    """
    depth, size = np.zeros(len(points)), max(float(np.abs(corners).max()) for corners in kinds)
    crossed = np.zeros(len(points), np.int64)
    for corners in kinds:
        body_overlap_kernels.count_crossings(points, np.ascontiguousarray(corners), crossed)
    inside = crossed % 2 == 1
    facet = np.zeros(len(points), np.intp)
    if inside.any():
        off_axis = [
            (np.abs(corners[:, :, 0]) > 1e-9 * size).any(axis=1) if axisymmetric else np.ones(len(corners), bool)
            for corners in kinds
        ]
        away = [corners[kept] for corners, kept in zip(kinds, off_axis, strict=True)]
        closest = closest_of_kinds(points[inside], [corners for corners in away if len(corners)])
        depth[inside] = closest.distance
        facet[inside] = np.flatnonzero(np.concatenate(off_axis))[closest.facet]
    return np.where(depth > ON_SURFACE * size, depth, 0.0), facet


def _depths_in_space(points: Array, kinds: list[Array]) -> tuple[Array, Indices]:
    """Return how deep each of `points` (n, 3) lies in the closed surface of facets (m, n_nodes, 3), 0 outside.

    Also the closest facet (n,), counted through the kinds.

    Where the closest point lies inside a facet, its normal tells in from out. Where it lies on an edge or a corner the
    normals around may disagree, and the winding number of the surface tells.
    """
    closest = closest_of_kinds(points, kinds)
    size = max(float(np.abs(corners).max()) for corners in kinds)
    height = np.einsum("nd,nd->n", points - closest.position, closest.normal)  # above the tangent planes
    inside = height < 0
    unsure = np.flatnonzero((np.abs(height) < 0.999 * closest.distance) & (closest.distance > ON_SURFACE * size))
    if len(unsure):
        triangles = np.concatenate(
            [corners[:, flat_triangles(corners.shape[1])].reshape(-1, 3, 3) for corners in kinds]
        )
        number = np.empty(len(unsure))
        body_overlap_kernels.winding_numbers(np.ascontiguousarray(points[unsure]), triangles, number)
        inside[unsure] = number > 0.5
    return np.where(inside & (closest.distance > ON_SURFACE * size), closest.distance, 0.0), closest.facet
