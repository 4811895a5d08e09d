"""Penetration depths of overlapping bodies."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import permutations

import numpy as np

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.projection import closest_of_types
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_pieces
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.round_off import LENGTH_ROUND_OFF

# A point lies on a surface if its distance, relative to the largest coordinate of the surface, is below this [-].
ON_SURFACE = 1e-10


def penetration(mesh: Mesh, kinematics: str, coordinates: Array) -> list[tuple[int, int, float, Array]]:
    """Return (first, second, depth, position) for each ordered pair of bodies whose first has nodes inside the second.

    `depth` is the largest penetration depth of these nodes, see `depths` [length], and `position` (dim,) is the
    position of the node with this depth [length].
    """
    overlaps = []
    for first, second, points, depth in depths(mesh, kinematics, coordinates):
        deepest = int(np.argmax(depth))
        if depth[deepest] > 0.0:
            overlaps.append((first, second, float(depth[deepest]), coordinates[points[deepest]]))
    return overlaps


def depths(mesh: Mesh, kinematics: str, coordinates: Array) -> Iterator[tuple[int, int, Indices, Array]]:
    """Yield (first, second, points (n,), depth (n,)) for each ordered pair of bodies with overlapping bounding boxes.

    `points` are those outer nodes of the first body that lie in the bounding box of the second. Depths are their
    distances to the outer surface of the second body, and zero for points outside that body [length]. The axis of an
    axisymmetric body is not part of its surface. Facets are treated as curved. Facets of second order deviate from a
    smooth curved surface by less than r^2 / h, where r is the rise of a facet and h its length. Depths below the sum of
    these bounds for the two bodies are set to zero.
    """
    count, body_of = bodies(mesh)
    if count < 2:
        return
    outer = outer_facets(mesh)
    sides = [{name: facets[body_of[facets[:, 0]] == body] for name, facets in outer.items()} for body in range(count)]
    nodes = [np.unique(np.concatenate([facets.ravel() for facets in side.values()])) for side in sides]
    nodal_tolerance = np.zeros(mesh.n_points)
    for name, facets in outer.items():
        np.maximum.at(nodal_tolerance, facets, _curvature_tolerance(name, coordinates[facets])[:, None])
    for first, second in permutations(range(count), 2):
        low, high = coordinates[nodes[second]].min(axis=0), coordinates[nodes[second]].max(axis=0)
        candidates = nodes[first]
        candidates = candidates[((coordinates[candidates] >= low) & (coordinates[candidates] <= high)).all(axis=1)]
        if not len(candidates):
            continue
        blocks = {name: coordinates[facets] for name, facets in sides[second].items() if len(facets)}
        off_axis = None
        if kinematics == "axisymmetric":
            size = max(float(np.abs(block).max()) for block in blocks.values())
            off_axis = [(np.abs(block[:, :, 0]) > LENGTH_ROUND_OFF * size).any(axis=1) for block in blocks.values()]
        depth, facet = _depths(coordinates[candidates], list(blocks.values()), off_axis)
        tolerance = np.concatenate([_curvature_tolerance(name, block) for name, block in blocks.items()])[facet]
        yield first, second, candidates, np.where(depth <= tolerance + nodal_tolerance[candidates], 0.0, depth)


def _curvature_tolerance(name: str, nodes: Array) -> Array:
    """Return bounds (n,) of the deviation of facets (n, k, dim) from a smooth surface through their nodes [length].

    A parabola of rise r over a chord of length h deviates from its circle by about r^3 / h^2. The bound r^2 / h leaves a
    margin for varying curvature. It is zero for straight facets, which contain no information about curvature.
    """
    element = elements.get(name)
    if element.order == 1:
        return np.zeros(len(nodes))
    middle, ends = nodes[:, element.n_corners :][:, : len(element.edges)], nodes[:, element.edges]
    length = np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2)
    rise = np.linalg.norm(middle - ends.mean(axis=2), axis=2)
    return np.asarray((rise**2 / length).max(axis=1))


def _depths(points: Array, facets: list[Array], selected: list[Mask] | None = None) -> tuple[Array, Indices]:
    """Return the depths (n,) [length] of `points` (n, dim) below a closed surface, zero outside, and the closest facets (n,).

    `facets` contains the node coordinates (m, n_nodes, dim) of the facets of each element type. The closest facets are
    numbered consecutively over all types. Distances are those to the facets `selected`, by default all. If the closest
    point lies in the interior of a facet, the normal of the facet decides whether the point is inside the surface. On edges
    and corners the normals of adjacent facets may disagree, and the winding number of the surface decides.
    """
    selected = [np.ones(len(nodes), bool) for nodes in facets] if selected is None else selected
    targets = [nodes[mask] for nodes, mask in zip(facets, selected, strict=True)]
    closest = closest_of_types(points, [nodes for nodes in targets if len(nodes)])
    size = max(float(np.abs(nodes).max()) for nodes in facets)
    height = np.einsum("nd,nd->n", points - closest.position, closest.normal)  # above the tangent planes
    inside = height < 0
    # The vector from the closest point is parallel to the normal only if this point lies in the interior of a facet.
    undecided = np.flatnonzero((np.abs(height) < 0.999 * closest.distance) & (closest.distance > ON_SURFACE * size))
    if len(undecided):
        dim = points.shape[1]
        pieces = [nodes[:, flat_pieces(nodes.shape[1], dim)].reshape(-1, dim, dim) for nodes in facets]
        inside[undecided] = winding_numbers(points[undecided], np.concatenate(pieces)) > 0.5
    depth = np.where(inside & (closest.distance > ON_SURFACE * size), closest.distance, 0.0)
    return depth, np.flatnonzero(np.concatenate(selected))[closest.facet]


def winding_numbers(points: Array, pieces: Array) -> Array:
    """Return the winding number (n,) [-] of a closed surface around each of `points` (n, dim) [length]: 1 inside, 0 outside.

    The surface consists of `pieces` (m, dim, dim), which are lines or triangles [length]. The winding number is the sum of
    their angles in the plane, or of their solid angles (Van Oosterom and Strackee, 1983, eq. 8), divided by a full angle.
    Angles are positive for outward normals.
    """
    corners, numbers = np.ascontiguousarray(np.moveaxis(pieces, 0, 2)), np.empty(len(points))
    for i, point in enumerate(points):
        arms = corners - point[:, None]
        products = np.einsum("idm,jdm->ijm", arms, arms)
        a, b, *c = arms  # written out, determinants take a fourteenth of the time of `numpy.linalg.det`
        sine, cosine = a[0] * b[1] - a[1] * b[0], products[0, 1]
        if c:  # half the solid angle
            sine = sum(c[0][k] * (a[k - 2] * b[k - 1] - a[k - 1] * b[k - 2]) for k in range(3))
            r = np.sqrt(products[range(3), range(3)])
            cosine = r.prod(axis=0) + sum(products[k, k - 1] * r[k - 2] for k in range(3))
        numbers[i] = np.arctan2(sine, cosine).sum() / (2.0 * np.pi)
    return numbers
