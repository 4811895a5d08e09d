"""Projection along averaged normals: continuous across facets, unlike closest-point projection.

On a faceted surface the closest point jumps at concave edges, by a distance proportional to the gap; iterated pairings may
then not converge. Along normals interpolated between nodal means the projection varies continuously (Puso and Laursen, 2004,
section 3; Popp, Gitterle, Gee and Wall, 2010, section 4.2), on facets in 3D (`along_normals`) and on lines in the plane
(`along_line_normals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastcontact._jit.parallel import portions, shared
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.contact import line_projection_kernels
from fastcontact.contact.search.closest import Closest
from fastcontact.contact.search.facet_tables import tables
from fastcontact.contact.surface import FacetBlock, Surface, line_neighbours
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors

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
        Shape functions; zero for repeated nodes.
    gradient : ndarray (n, k, dim - 1)
        Their derivatives.
    """

    nodes: Numbers
    local: Indices
    shape: Array
    gradient: Array


def places(side: Surface, facet: Indices, xi: Array) -> Places:
    """Return the points of `side` at the reference coordinates `xi` (n, dim - 1) of facets (n,)."""
    if len(side.blocks) == 1:
        return _of_block(side.blocks[0], facet, xi)
    width = max(block.facets.shape[1] for block in side.blocks)
    n = len(facet)
    projected = Places(
        np.empty((n, width), np.int32),
        np.empty((n, width), np.intp),
        np.zeros((n, width)),
        np.zeros((n, width, xi.shape[1])),
    )
    first = 0
    for block in side.blocks:
        in_block = np.flatnonzero((facet >= first) & (facet < first + len(block.facets)))
        shape, k = _of_block(block, facet[in_block] - first, xi[in_block]), block.facets.shape[1]
        columns = np.minimum(np.arange(width), k - 1)
        projected.nodes[in_block], projected.local[in_block] = shape.nodes[:, columns], shape.local[:, columns]
        projected.shape[in_block, :k], projected.gradient[in_block, :k] = shape.shape, shape.gradient
        first += len(block.facets)
    return projected


def _of_block(block: FacetBlock, rows: Indices, xi: Array) -> Places:
    element = elements.get(block.element)
    return Places(block.facets[rows], block.local[rows], element.shape(xi), element.gradient(xi))


def nodal_normals(side: Surface, coordinates: Array) -> Array:
    """Return the mean of the facets' unit normals at each node (m, dim), weighted by their angles there, normalised.

    With these weights it depends on the surface alone, not on its division into facets (Thuermer and Wuethrich, 1998).
    """
    normals = [facet_normals(block, coordinates) for block in side.blocks]
    return _nodal_means(
        side, normals, [facet_angles(elements.get(block.element), coordinates[block.facets]) for block in side.blocks]
    )


def _nodal_means(side: Surface, values: Sequence[Array], angles: Sequence[Array]) -> Array:
    """Return the means (m, dim) of `nodal_normals` from the normals and angles of the facets of each block."""
    n, dim = len(side.points), values[0].shape[2]
    at = np.concatenate([block.local.ravel() for block in side.blocks])
    weighted = [(angle[:, :, None] * normals).reshape(-1, dim) for normals, angle in zip(values, angles, strict=True)]
    total: Array = np.column_stack([np.bincount(at, component, n) for component in np.concatenate(weighted).T])
    side.add_across_ends(total)
    return total / np.linalg.norm(total, axis=1, keepdims=True)


def smooth_normals(side: Surface, coordinates: Array) -> list[Array]:
    """Return, for each block, unit normals (n_facets, n_nodes, dim) at the nodes of facets as parts of a smooth surface.

    These are the nodal means of `nodal_normals`; at corners only the facets that meet the facet smoothly enter the mean, so
    that a punch is flat up to its corner, also where its flanks belong to the surface.
    """
    facet_normals_of_blocks = [facet_normals(block, coordinates) for block in side.blocks]
    angles = [facet_angles(elements.get(block.element), coordinates[block.facets]) for block in side.blocks]
    means = _nodal_means(side, facet_normals_of_blocks, angles)
    smooth = [means[block.local] for block in side.blocks]
    # A node is at a corner where a facet deviates from the mean by more than half the angle between two that form one.
    flat, corner = np.cos(np.radians(0.5 * CORNER)), np.zeros(len(side.points), bool)
    for block, normals, mean in zip(side.blocks, facet_normals_of_blocks, smooth, strict=True):
        corner[block.local[np.einsum("fad,fad->fa", normals, mean) < flat]] = True
    if not corner.any():
        return smooth
    node = np.concatenate([block.local.ravel() for block in side.blocks])
    weight = np.concatenate([angle.ravel() for angle in angles])
    normal = np.concatenate([normals.reshape(-1, coordinates.shape[1]) for normals in facet_normals_of_blocks])
    joined = np.concatenate([normals.reshape(-1, coordinates.shape[1]) for normals in smooth])
    places_of, start = np.argsort(node, kind="stable"), np.concatenate([[0], np.cumsum(np.bincount(node))])
    for at in np.flatnonzero(corner):
        here = places_of[start[at] : start[at + 1]]
        beside = normal[here] @ normal[here].T > np.cos(np.radians(CORNER))
        total = (beside * weight[here]) @ normal[here]
        joined[here] = total / np.linalg.norm(total, axis=1, keepdims=True)
    ends = np.cumsum([normals.shape[0] * normals.shape[1] for normals in facet_normals_of_blocks])[:-1]
    return [
        means.reshape(like.shape) for means, like in zip(np.split(joined, ends), facet_normals_of_blocks, strict=True)
    ]


def at_nodes_of_facets(of_blocks: Sequence[Array]) -> Array:
    """Return values at the nodes of facets (n_facets, k, ...) of all blocks as one array, as wide as the widest block.

    The last entry of facets with fewer nodes is repeated, as in `places`.
    """
    width = max(values.shape[1] for values in of_blocks)
    return np.concatenate([values[:, np.minimum(np.arange(width), values.shape[1] - 1)] for values in of_blocks])


def facet_normals(block: FacetBlock, coordinates: Array) -> Array:
    """Return the unit normals (n_facets, n_nodes, dim) of facets at their own nodes."""
    element, nodes = elements.get(block.element), coordinates[block.facets]
    slopes = element.gradient(element.nodes)
    if element.dim == 2:
        from fastcontact.contact import projection_kernels

        out = np.empty(nodes.shape)
        shared(lambda portion: projection_kernels.normals(nodes, slopes, *portion, out), portions(*block.facets.shape))
        return out
    normal = area_vectors(nodes, slopes)
    return normal / np.linalg.norm(normal, axis=2, keepdims=True)


def facet_angles(element: elements.Element, nodes: Array) -> Array:
    """Return the angles (n, k) of facets with nodes (n, k, dim) at their corners; 1 at other nodes, and on lines."""
    if element.dim == 1:
        return np.ones(nodes.shape[:2])
    from fastcontact.contact import projection_kernels

    angle, n = np.empty(nodes.shape[:2]), element.n_corners
    around = np.arange(n)  # edges run from each corner to the next
    beside = np.column_stack([(around + 1) % n, (around - 1) % n])
    shared(
        lambda portion: projection_kernels.angles(nodes, beside, *portion, angle), portions(len(nodes), nodes.shape[1])
    )
    return angle


def interpolated(normals: Array, at: Places) -> Array:
    """Return unit normals (n, dim) interpolated from those at the nodes of facets (n, k, dim)."""
    normal = np.einsum("nk,nkd->nd", at.shape, normals)
    return normal / np.linalg.norm(normal, axis=1, keepdims=True)


def along_normals(
    points: Array, side: Surface, coordinates: Array, normals: Array, start: Closest
) -> tuple[Indices, Array, Array, Array]:
    """Project points on a surface in 3D along its interpolated normals, starting from their closest points.

    Parameters
    ----------
    points : ndarray (n, 3)
        [length].
    side : Surface
    coordinates : ndarray (n_points, 3)
        Coordinates of all nodes [length].
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
        Distance of the projection beyond the end of its facet, in facet lengths.
    normal : ndarray (n, 3)
        Interpolated unit normals there.
    """
    from fastcontact.contact import projection_kernels

    facet = start.facet.copy(), start.xi.copy(), start.overhang.copy(), np.empty(points.shape)
    # Relative to the middle of the surface: far from the origin, round-off would exceed a converged step.
    x = coordinates[side.points]
    midst = 0.5 * (x.min(axis=0) + x.max(axis=0))
    heights = np.einsum("nd,nd->n", points - start.position, start.normal)
    seen, kinds = points - midst, [coordinates[block.facets] - midst for block in side.blocks]
    sizes = np.cumsum([0] + [len(kind) for kind in kinds])
    at_nodes = [
        np.ascontiguousarray(normals[low:high, : kind.shape[1]])
        for kind, low, high in zip(kinds, sizes[:-1], sizes[1:], strict=True)
    ]
    terms, directions = _polynomials(kinds), _polynomials(at_nodes)
    shared(
        lambda portion: projection_kernels.along_normals(
            *portion, seen, heights, terms, directions, side.triangular, side.neighbours, facet
        ),
        portions(len(points)),
    )
    return facet


def _polynomials(kinds: Sequence[Array]) -> Array:
    """Return the coefficients (n_facets, width, 3) of vectors at the nodes of facets (n, m, 3), kind by kind."""
    from fastcontact.contact import projection_kernels

    out, first = np.empty((sum(map(len, kinds)), max(kind.shape[1] for kind in kinds), 3)), 0
    for kind in kinds:
        projection_kernels.coefficients(kind, tables(kind.shape[1]).to_terms, first, 0, len(kind), out)
        first += len(kind)
    return out


def along_line_normals(
    points: Array, side: Surface, coordinates: Array, normals: Array, start: Closest
) -> tuple[Indices, Array, Array, Array]:
    """Project points (n, 2) on a line along its interpolated normals; see `along_normals`."""
    n_facets = side.n_facets
    corners, at_nodes = np.zeros((n_facets, 3, 2)), np.zeros((n_facets, 3, 2))
    at_nodes[:, : normals.shape[1]] = normals
    counts, ends = np.empty(n_facets, np.intp), np.empty((n_facets, 2), np.intp)
    first = 0
    for block in side.blocks:
        rows, k = slice(first, first + len(block.facets)), block.facets.shape[1]
        corners[rows, :k], counts[rows], ends[rows] = coordinates[block.facets], k, block.local[:, :2]
        first = rows.stop
    facet, xi, overhang = start.facet.astype(np.intp), start.xi[:, 0].copy(), start.overhang.copy()
    work = np.empty(3), np.empty(3)
    neighbour = np.where(smooth_ends(side, normals), line_neighbours(ends), -1)
    line_projection_kernels.along_normals(
        np.ascontiguousarray(points), corners, at_nodes, counts, neighbour, facet, xi, overhang, *work
    )
    xi = xi[:, None]
    return facet, xi, overhang, interpolated(normals[facet], places(side, facet, xi))


def smooth_ends(side: Surface, normals: Array) -> Mask:
    """Return the ends (n_facets, 2) of lines at which another line continues without a corner.

    `normals` (n_facets, k, 2) are those of the facets at their nodes, see `smooth_normals`: the same for both
    facets at such an end.
    """
    ends = np.concatenate([block.local[:, :2] for block in side.blocks])
    total = np.zeros((len(side.points), 2))
    np.add.at(total, ends, normals[:, :2])
    return np.asarray(side.inner_ends & (np.linalg.norm(total, axis=1)[ends] > 2.0 - 1e-6))
