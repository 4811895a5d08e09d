"""How deep bodies lie inside each other."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.kernels import winding
from fastcontact.mesh import Mesh
from fastcontact.search import Closest, closest, closest_of_kinds, flat_triangles
from fastcontact.topology import bodies, outer_facets

Array = NDArray[np.float64]
Indices = NDArray[np.int32]

# Points nearer to a surface than this, relative to the size of the model, lie on it.
ON_SURFACE = 1e-10


def penetration(mesh: Mesh, kinematics: str, coordinates: Array) -> list[tuple[int, int, float, Array]]:
    """Return (body, other, depth, where) for each pair of bodies of which the first has nodes inside the second.

    Depth is the largest distance of such a node to the other body's outside [length]. The axis of an axisymmetric body
    is not its outside. In 3D the facets count as they are curved.
    """
    count, body = bodies(mesh)
    if count < 2:
        return []
    # In 2D the polygon of the corners stands for the outside: nodes and mid nodes cannot both tell in from out.
    outer = [facets[:, :2] if mesh.dim == 2 else facets for facets in outer_facets(mesh).values()]
    sides = [[facets[body[facets[:, 0]] == number] for facets in outer] for number in range(count)]
    nodes = [np.unique(np.concatenate([facets.ravel() for facets in side])) for side in sides]
    found = []
    for number, other in ((a, b) for a in range(count) for b in range(count) if a != b):
        low, high = coordinates[nodes[other]].min(axis=0), coordinates[nodes[other]].max(axis=0)
        near = nodes[number]
        near = near[((coordinates[near] >= low) & (coordinates[near] <= high)).all(axis=1)]
        kinds = [coordinates[facets] for facets in sides[other] if len(facets)]
        if not len(near):
            continue
        depth = (
            _depths_in_space(coordinates[near], kinds)
            if mesh.dim == 3
            else _depths_in_plane(coordinates[near], np.concatenate(kinds), kinematics == "axisymmetric")
        )
        deepest = int(np.argmax(depth))
        if depth[deepest] > 0.0:
            found.append((number, other, float(depth[deepest]), coordinates[near[deepest]]))
    return found


def _depths_in_plane(points: Array, edges: Array, axisymmetric: bool) -> Array:
    """Return how deep each of `points` (n, 2) lies in the closed polygons of `edges` (m, 2, 2), 0 outside."""
    depth = np.zeros(len(points))
    inside = _in_polygons(points, edges)
    if inside.any():
        on_axis = (np.abs(edges[:, :, 0]) <= 1e-9 * np.abs(edges).max()).all(axis=1)
        depth[inside] = closest(points[inside], edges[~on_axis] if axisymmetric else edges).distance
    return depth


def _in_polygons(points: Array, edges: Array) -> NDArray[np.bool_]:
    """Return which `points` (n, 2) lie inside the closed polygons of `edges` (m, 2, 2), by counting crossings."""
    inside = np.zeros(len(points), bool)
    (ax, ay), (bx, by) = edges[:, 0].T, edges[:, 1].T
    for i, (x, y) in enumerate(points):
        crossed = (ay > y) != (by > y)
        at = ax[crossed] + (y - ay[crossed]) * (bx[crossed] - ax[crossed]) / (by[crossed] - ay[crossed])
        inside[i] = np.count_nonzero(at > x) % 2 == 1
    return inside


def _depths_in_space(points: Array, kinds: list[Array]) -> Array:
    """Return how deep each of `points` (n, 3) lies in the closed surface of facets (m, n_nodes, 3), 0 outside.

    Where the closest point lies inside a facet, its normal tells in from out. Where it lies on an edge or a corner the
    normals around may disagree, and the winding number of the surface tells.
    """
    found = closest_of_kinds(points, kinds)
    size = max(float(np.abs(corners).max()) for corners in kinds)
    height = _heights(points, found)
    inside = height < 0
    unsure = np.flatnonzero((np.abs(height) < 0.999 * found.distance) & (found.distance > ON_SURFACE * size))
    if len(unsure):
        triangles = np.concatenate(
            [corners[:, flat_triangles(corners.shape[1])].reshape(-1, 3, 3) for corners in kinds]
        )
        number = np.empty(len(unsure))
        winding.winding_numbers(np.ascontiguousarray(points[unsure]), triangles, number)
        inside[unsure] = number > 0.5
    return np.where(inside & (found.distance > ON_SURFACE * size), found.distance, 0.0)


def _heights(points: Array, found: Closest) -> Array:
    """Return the heights (n,) of points above the tangent planes at their projections [length]."""
    return np.einsum("nd,nd->n", points - found.position, found.normal)
