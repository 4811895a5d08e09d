"""Projection on a surface along averaged normals: continuous where facets meet, as the closest point is not.

On a surface of facets the closest point jumps where an edge folds inward, by a distance in proportion to the gap; a
pairing that is renewed in a loop may then flip for ever. Along normals interpolated between nodal means the projection
moves on smoothly (Puso and Laursen, 2004, section 3; Popp, Gitterle, Gee and Wall, 2010, section 4.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.contact.search.closest import Closest
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.mesh import elements

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

MAX_ITERATIONS = 15
# In reference coordinates: a step below which the projection has converged, and what counts as inside a facet.
STEP = 1e-13
INSIDE = 1e-10
# A projection that ends farther beyond its facet than this, in facet lengths, is not trusted.
BEYOND = 1.0
# Facets that meet at a smaller angle than this approximate a smooth surface; others form a corner [degrees].
CORNER = 45.0


@dataclass(frozen=True, eq=False)
class Places:
    """Points of a surface given by facets and reference coordinates; k is the largest number of nodes of a facet.

    Attributes
    ----------
    nodes, local : ndarray of int (n, k)
        Point numbers, and positions in the points of the surface; of facets with fewer nodes some are repeated.
    shape : ndarray (n, k)
        Shape functions; zero for what is repeated.
    gradient : ndarray (n, k, dim - 1)
        Their derivatives.
    """

    nodes: NDArray[np.int32]
    local: Indices
    shape: Array
    gradient: Array


def places(side: Surface, facet: Indices, xi: Array) -> Places:
    """Return the points of `side` at the reference coordinates `xi` (n, dim - 1) of facets (n,)."""
    if len(side.blocks) == 1:
        return _of_block(side.blocks[0], facet, xi)
    width = max(block.facets.shape[1] for block in side.blocks)
    n = len(facet)
    found = Places(
        np.empty((n, width), np.int32),
        np.empty((n, width), np.intp),
        np.zeros((n, width)),
        np.zeros((n, width, xi.shape[1])),
    )
    first = 0
    for block in side.blocks:
        mine = np.flatnonzero((facet >= first) & (facet < first + len(block.facets)))
        own, k = _of_block(block, facet[mine] - first, xi[mine]), block.facets.shape[1]
        columns = np.minimum(np.arange(width), k - 1)
        found.nodes[mine], found.local[mine] = own.nodes[:, columns], own.local[:, columns]
        found.shape[mine, :k], found.gradient[mine, :k] = own.shape, own.gradient
        first += len(block.facets)
    return found


def _of_block(block: FacetBlock, rows: Indices, xi: Array) -> Places:
    element = elements.get(block.element)
    return Places(block.facets[rows], block.local[rows], element.shape(xi), element.gradient(xi))


def nodal_normals(side: Surface, coordinates: Array) -> Array:
    """Return the mean of the facets' unit normals at each node (m, dim), weighted by their angles there, normalised.

    The angles make it depend on the surface alone, not on how it is cut into facets (Thuermer and Wuethrich, 1998).
    """
    total = np.zeros((len(side.points), coordinates.shape[1]))
    for block in side.blocks:
        np.add.at(total, block.local, _angles(block, coordinates)[:, :, None] * facet_normals(block, coordinates))
    return total / np.linalg.norm(total, axis=1, keepdims=True)


def smooth_normals(side: Surface, coordinates: Array) -> list[Array]:
    """Return by block the unit normals (n_facets, n_nodes, dim) that facets have at their nodes as parts of a smooth surface.

    The nodal means of `nodal_normals`; at corners the mean of those facets alone that meet the facet smoothly, so that a
    punch is flat up to its corner, also where its flanks belong to the surface.
    """
    means = nodal_normals(side, coordinates)
    own = [facet_normals(block, coordinates) for block in side.blocks]
    smooth = [means[block.local] for block in side.blocks]
    # A node is at a corner where a facet leans from the mean by more than half the angle between two that form one.
    flat, corner = np.cos(np.radians(0.5 * CORNER)), np.zeros(len(side.points), bool)
    for block, normals, mean in zip(side.blocks, own, smooth, strict=True):
        corner[block.local[np.einsum("fad,fad->fa", normals, mean) < flat]] = True
    if not corner.any():
        return smooth
    node = np.concatenate([block.local.ravel() for block in side.blocks])
    weight = np.concatenate([_angles(block, coordinates).ravel() for block in side.blocks])
    normal = np.concatenate([normals.reshape(-1, coordinates.shape[1]) for normals in own])
    joined = np.concatenate([normals.reshape(-1, coordinates.shape[1]) for normals in smooth])
    for at in np.flatnonzero(corner):
        here = np.flatnonzero(node == at)
        beside = normal[here] @ normal[here].T > np.cos(np.radians(CORNER))
        total = (beside * weight[here]) @ normal[here]
        joined[here] = total / np.linalg.norm(total, axis=1, keepdims=True)
    ends = np.cumsum([normals.shape[0] * normals.shape[1] for normals in own])[:-1]
    return [part.reshape(like.shape) for part, like in zip(np.split(joined, ends), own, strict=True)]


def at_nodes_of_facets(parts: Sequence[Array]) -> Array:
    """Return what blocks have at the nodes of their facets (n_facets, k, ...) as one array, as wide as the widest block.

    The last entry of facets with fewer nodes is repeated, as in `places`.
    """
    width = max(part.shape[1] for part in parts)
    return np.concatenate([part[:, np.minimum(np.arange(width), part.shape[1] - 1)] for part in parts])


def facet_normals(block: FacetBlock, coordinates: Array) -> Array:
    """Return the unit normals (n_facets, n_nodes, dim) of facets at their own nodes."""
    element = elements.get(block.element)
    tangent = np.einsum("akj,fkd->fadj", element.gradient(element.nodes), coordinates[block.facets])
    if element.dim == 1:
        normal = np.stack([tangent[..., 1, 0], -tangent[..., 0, 0]], axis=2)
    else:
        normal = np.cross(tangent[..., 0], tangent[..., 1])
    return normal / np.linalg.norm(normal, axis=2, keepdims=True)


def _angles(block: FacetBlock, coordinates: Array) -> Array:
    """Return the angles of facets at their corners (n_facets, n_nodes); 1 at other nodes, and on lines."""
    element, corners = elements.get(block.element), coordinates[block.facets]
    angle = np.ones(block.facets.shape)
    for corner in range(element.n_corners if element.dim == 2 else 0):
        sides = [corners[:, b if a == corner else a] - corners[:, corner] for a, b in element.edges if corner in (a, b)]
        sine = np.linalg.norm(np.cross(sides[0], sides[1]), axis=1)
        angle[:, corner] = np.arctan2(sine, np.einsum("fd,fd->f", sides[0], sides[1]))
    return angle


def interpolated(normals: Array, at: Places) -> Array:
    """Return unit normals (n, dim) at places, interpolated from those at the nodes of their facets (n, k, dim)."""
    normal = np.einsum("nk,nkd->nd", at.shape, normals)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def along_normals(
    points: Array, side: Surface, coordinates: Array, normals: Array, start: Closest
) -> tuple[Indices, Array, Array]:
    """Project points on a surface in 3D along its interpolated normals, starting from their closest points.

    Parameters
    ----------
    points : ndarray (n, 3)
        [length].
    side : Surface
    coordinates : ndarray (n_points, 3)
        Of all nodes [length].
    normals : ndarray (n_facets, k, 3)
        Unit normals of the facets at their nodes, see `smooth_normals`.
    start : Closest
        Closest points; kept where the projection fails.

    Returns
    -------
    facet : ndarray of int (n,)
    xi : ndarray (n, 2)
        Inside the facet.
    overhang : ndarray (n,)
        How far the projection lies beyond the end of its facet, in facet lengths.
    """
    facet, xi, overhang = start.facet.copy(), start.xi.copy(), start.overhang.copy()
    # Seen from the midst of the surface: far from the origin, rounding would be coarser than a converged step.
    midst = 0.5 * (coordinates[side.points].min(axis=0) + coordinates[side.points].max(axis=0))
    height = np.einsum("nd,nd->n", points - start.position, start.normal)
    points, coordinates = points - midst, coordinates - midst
    found, good = _newton(points, side, coordinates, normals, facet, xi, height)
    beyond = _beyond(side, facet, found)
    good &= beyond <= BEYOND
    xi[good], overhang[good] = found[good], beyond[good]
    astray = np.flatnonzero(good & (beyond > INSIDE))
    if len(astray):
        point, other = _neighbours(side, facet, astray)
        middle = np.concatenate([_middle(block) for block in side.blocks])[other]
        found, good = _newton(points[point], side, coordinates, normals, other, middle, height[point])
        beyond = np.where(good, _beyond(side, other, found), np.inf)
        best = np.lexsort((other, np.maximum(beyond, INSIDE), point))
        best = best[np.unique(point[best], return_index=True)[1]]
        best = best[beyond[best] < overhang[point[best]]]
        facet[point[best]], xi[point[best]], overhang[point[best]] = other[best], found[best], beyond[best]
    return facet, _inside(side, facet, xi), np.where(overhang > INSIDE, overhang, 0.0)


def _newton(
    points: Array, side: Surface, coordinates: Array, normals: Array, facet: Indices, xi: Array, height: Array
) -> tuple[Array, NDArray[np.bool_]]:
    """Solve ``X(xi) + height n(xi) = point`` on the extended facets; return xi (n, 2) and where it converged."""
    xi, height = xi.copy(), height.copy()
    converged = np.zeros(len(points), bool)
    busy = np.arange(len(points))
    for _ in range(MAX_ITERATIONS):
        at = places(side, facet[busy], xi[busy])
        corners, directions = coordinates[at.nodes], normals[facet[busy]]
        carried = corners + height[busy, None, None] * directions
        residual = points[busy] - np.einsum("nk,nkd->nd", at.shape, carried)
        normal = np.einsum("nk,nkd->nd", at.shape, directions)
        jacobian = np.concatenate([np.einsum("nkj,nkd->ndj", at.gradient, carried), normal[:, :, None]], axis=2)
        regular = np.abs(np.linalg.det(jacobian)) > 1e-8 * np.prod(np.linalg.norm(jacobian, axis=1), axis=1)
        busy, residual, jacobian = busy[regular], residual[regular], jacobian[regular]
        step = np.linalg.solve(jacobian, residual[:, :, None])[:, :, 0]
        # Far off, a full step may leave the region where the interpolated normals mean anything.
        step *= np.minimum(1.0, 1.0 / np.maximum(np.abs(step[:, :2]).max(axis=1, initial=0.0), 1e-300))[:, None]
        xi[busy] += step[:, :2]
        height[busy] += step[:, 2]
        done = np.abs(step[:, :2]).max(axis=1, initial=0.0) <= STEP * (1.0 + np.abs(xi[busy]).max(axis=1, initial=0.0))
        converged[busy[done]] = True
        busy = busy[~done]
        if not len(busy):
            break
    return xi, converged


def _beyond(side: Surface, facet: Indices, xi: Array) -> Array:
    """Return how far reference coordinates lie outside their facets (n,), in facet lengths; 0 inside."""
    triangle = _triangular(side)[facet]
    s, t = xi.T
    in_triangle = np.maximum.reduce([-s, -t, s + t - 1.0])
    in_square = 0.5 * (np.maximum(np.abs(s), np.abs(t)) - 1.0)
    return np.maximum(np.where(triangle, in_triangle, in_square), 0.0)


def _inside(side: Surface, facet: Indices, xi: Array) -> Array:
    """Return reference coordinates (n, 2) moved into their facets."""
    triangle = _triangular(side)[facet][:, None]
    square = np.clip(xi, -1.0, 1.0)
    corner = np.maximum(xi, 0.0)
    return np.where(triangle, corner / np.maximum(corner.sum(axis=1, keepdims=True), 1.0), square)


def _triangular(side: Surface) -> NDArray[np.bool_]:
    """Return which facets are triangles."""
    return np.concatenate([np.full(len(b.facets), elements.get(b.element).n_corners == 3) for b in side.blocks])


def _middle(block: FacetBlock) -> Array:
    """Return the reference coordinates of the middles of the facets (n_facets, 2)."""
    element = elements.get(block.element)
    return np.tile(element.nodes[: element.n_corners].mean(axis=0), (len(block.facets), 1))


def _neighbours(side: Surface, facet: Indices, rows: Indices) -> tuple[Indices, Indices]:
    """Return pairs (row, other): the facets that share a node with the facet of each of `rows`, itself apart."""
    nodes = np.concatenate([block.local.ravel() for block in side.blocks])
    sizes = np.concatenate([np.full(len(block.local), block.local.shape[1]) for block in side.blocks])
    start = np.concatenate([[0], np.cumsum(sizes)])
    incidence = csr_array((np.ones(len(nodes)), nodes, start), shape=(side.n_facets, len(side.points)))
    shared = csr_array(incidence[facet[rows]] @ incidence.T).tocoo()
    row, other = rows[shared.row], shared.col.astype(np.intp)
    apart = other != facet[row]
    return row[apart], other[apart]
