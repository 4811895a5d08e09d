"""Segmentation of secondary lines at the projected primary nodes, and integration over the segments.

The gap between non-matching facets has a kink opposite every primary node, and is smooth between two kinks (Popp, Gee and
Wall, 2009). At an end of the primary side, secondary facets are cut along the normal at this end. Points beyond the cut do
not face the primary side, and their projections must agree with this cut.
"""

from __future__ import annotations

import numpy as np

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices
from fastcontact.contact.formulations._overlap import Coupling, Overlap, OverlapPoints
from fastcontact.contact.pairing import FACING, Candidates, pair
from fastcontact.contact.projection import CORNER, DeformedSide, closest
from fastcontact.contact.surface import FacetBlock, Surface, by_block
from fastcontact.contact.surface_smoothing import Smoothing
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION

# Largest reference coordinate at which a facet is cut where the primary side ends. If the cut is nearer to the end of the
# facet, the complete facet faces the primary side within the smallest tolerance of projections.
LARGEST_CUT = 1.0 - 2.0 * SINGLE_PRECISION
NO_BORDERS = np.empty(0, np.intp), np.empty(0)


@record
class LinePoints(OverlapPoints):
    """Integration points of all segments of a block of lines, with their reference coordinates `xi` (n,) [-]."""

    xi: Array


def line_points(
    block: FacetBlock, primary: DeformedSide, reference: Array, axisymmetric: bool, n_gauss: int, tolerance: float,
    borders: tuple[Indices, Array] = NO_BORDERS,
) -> LinePoints:  # fmt: skip
    """Cut the facets of a block in the configuration of `primary`, and place Gauss points in every segment.

    The primary side is extended by `tolerance` facet lengths at its ends. `borders` are additional cuts, given by their
    facets (n,) and reference coordinates (n,).
    """
    n = len(block.facets)
    ends = np.tile(np.arange(n), 2), np.repeat([-1.0, 1.0], n)
    cuts = ends, _opposite_nodes(block, primary), borders, opposite_ends(block, primary, tolerance)
    facet, xi = map(np.concatenate, zip(*cuts, strict=True))
    order = np.lexsort((xi, facet))
    facet, xi = facet[order], xi[order]
    is_segment = (facet[1:] == facet[:-1]) & (np.diff(xi) > LENGTH_ROUND_OFF)
    begin, end = xi[:-1][is_segment], xi[1:][is_segment]
    s, w = quadrature.gauss_line(n_gauss)
    xi = (0.5 * (begin + end)[:, None] + 0.5 * (end - begin)[:, None] * s[:, 0]).ravel()
    weight = (0.5 * (end - begin)[:, None] * w).ravel()
    facet = np.repeat(facet[:-1][is_segment], len(w))
    element = elements.get(block.element)
    nodes, shape = reference[block.facets[facet]], element.shape(xi[:, None])
    tangent = np.einsum("nk,nkd->nd", element.gradient(xi[:, None])[:, :, 0], nodes)
    area = np.linalg.norm(tangent, axis=1) * weight
    if axisymmetric:
        area *= 2 * np.pi * np.maximum(np.einsum("nk,nk->n", shape, nodes[:, :, 0]), 0.0)
    return LinePoints(facet, shape, area, xi)


def normals_at(block: FacetBlock, coordinates: Array, points: LinePoints) -> Array:
    """Return the unit normals (n, 2) of a block at integration points, for nodal `coordinates` (n_points, 2)."""
    gradient = elements.get(block.element).gradient(points.xi[:, None])[:, :, 0]
    tangent = np.einsum("nk,nkd->nd", gradient, coordinates[block.facets[points.facet]])
    return unit_vectors(np.column_stack([tangent[:, 1], -tangent[:, 0]]))


def _opposite_nodes(block: FacetBlock, primary: DeformedSide) -> tuple[Indices, Array]:
    """Return the points of a block opposite the ends of primary facets, as facets and reference coordinates.

    Where two primary facets meet, the opposite point lies on the bisector of the angle between them, at which the closest
    facet changes. The closest point of the block is used only where the primary side ends, and at corners of the primary
    side, near which points do not face the flank. It is unsuitable elsewhere: at a concave corner with a gap or an
    interference, the closest point jumps from one facet to the next as the bodies move.
    """
    side, deformed, normals = primary.surface, primary.coordinates, primary.nodal_normals
    ends, first = np.unique(side.ends, return_index=True)
    position, normal = deformed[side.points[ends]], normals[ends]
    opposite = closest(position, deformed[block.facets])
    xi_0 = opposite.xi[:, 0]
    has_two_facets = side.inner_ends.ravel()[first]
    cosine = np.ones(len(side.points))  # between the normals of facets and of nodes, small at corners
    deviation = np.einsum("fad,fad->fa", primary.facet_normals, normals[side.all_local])
    np.minimum.at(cosine, side.all_local, np.where(side.node_weights > 0.0, deviation, 1.0))
    smooth = has_two_facets & ~(cosine < np.cos(np.radians(0.5 * CORNER)))[ends]
    in_facet = np.flatnonzero((opposite.overhang == 0.0) & (np.abs(xi_0) < LARGEST_CUT) & ~smooth)
    inner = np.flatnonzero(has_two_facets)
    facets = np.column_stack([opposite.facet[inner], block.neighbours[opposite.facet[inner]]])
    distance = _signed_distances(deformed[block.facets[facets]], position[inner][:, None], normal[inner][:, None])
    distance[facets < 0] = 1.0
    row, xi = _zeros(distance.reshape(-1, block.facets.shape[1]))
    return np.concatenate([opposite.facet[in_facet], facets.ravel()[row]]), np.concatenate([xi_0[in_facet], xi])


def _signed_distances(points: Array, origin: Array, normal: Array) -> Array:
    """Return signed distances of `points` (..., k, 2) from lines through `origin` along `normal` (..., 2) [length]."""
    offset = points - origin[..., None, :]
    return np.asarray(offset[..., 0] * normal[..., None, 1] - offset[..., 1] * normal[..., None, 0])


def opposite_ends(block: FacetBlock, primary: DeformedSide, tolerance: float) -> tuple[Indices, Array]:
    """Return the points of a block on the normals at the ends of the primary side, as facets and reference coordinates."""
    side, deformed = primary.surface, primary.coordinates
    # A tolerance of the order of round-off does not extend the side, because the cut would leave a sliver of this width.
    ends = (1.0, 1.0 + 2.0 * tolerance) if tolerance > SINGLE_PRECISION else (1.0,)
    facets, coordinates = [], []
    for primary_block, offset in zip(side.blocks, side.offsets):
        shape = elements.get(primary_block.element).shape
        inner_ends = side.inner_ends[offset : offset + len(primary_block.facets)]
        for end, s in zip(np.repeat([0, 1], len(ends)), np.outer([-1.0, 1.0], ends).ravel(), strict=True):
            free = np.flatnonzero(~inner_ends[:, end])
            weights = shape(np.array([[s]]))[0]
            position = np.einsum("k,fkd->fd", weights, deformed[primary_block.facets[free]])
            normal = np.einsum("k,fkd->fd", weights, primary.nodal_normals[primary_block.local[free]])
            distance = _signed_distances(deformed[block.facets][None], position[:, None], normal[:, None])
            facet, xi = _zeros(distance.reshape(-1, block.facets.shape[1]))
            facets.append(facet % len(block.facets))
            coordinates.append(xi)
    facet, xi = np.concatenate(facets), np.concatenate(coordinates)
    is_inside = np.abs(xi) < LARGEST_CUT
    return facet[is_inside], xi[is_inside]


def _zeros(values: Array) -> tuple[Indices, Array]:
    """Return the zeros of fields inside lines of two or three nodes.

    They are given by rows of the nodal `values` (n, k), and reference coordinates.
    """
    a, b = values[:, 0], values[:, 1]
    slope, middle = 0.5 * (b - a), 0.5 * (a + b) if values.shape[1] == 2 else values[:, 2]
    half_curvature = 0.5 * (a + b) - middle
    root = np.sqrt(np.maximum(slope**2 - 4.0 * half_curvature * middle, 0.0))
    # The quadratic formula in a form without cancellation.
    q = -0.5 * (slope + np.where(slope < 0.0, -root, root))
    with np.errstate(divide="ignore", invalid="ignore"):
        roots = np.stack([q / half_curvature, middle / q], axis=1)
    roots[slope**2 < 4.0 * half_curvature * middle] = np.nan
    row, number = np.nonzero(np.abs(roots) < 1.0 - LENGTH_ROUND_OFF)
    return row, roots[row, number]


def line_overlap(
    secondary: Surface, primary: DeformedSide, reference: Array, axisymmetric: bool, tolerance: float,
    smoothing: Smoothing | None,
) -> Overlap:  # fmt: skip
    """Cut the secondary facets in the deformed configuration, and integrate over the segments.

    Integrals use the areas of the undeformed configuration.

    Parameters
    ----------
    secondary : Surface
    primary : DeformedSide
    reference : ndarray (n_points, 2)
        Undeformed coordinates of all points [length].
    axisymmetric : bool
        Whether integrals run over the full circle.
    tolerance : float
        Largest distance beyond the end of the primary side at which a point still faces this side, in facet lengths.
    smoothing : Smoothing or None
        The smooth surfaces that the facets approximate; None if gaps are measured between the facets.
    """
    deformed, side = primary.coordinates, primary.surface
    masses, couplings, gap_reductions, overlap_points = [], [], [], []
    for block, offset in zip(secondary.blocks, secondary.offsets):
        n, k = block.facets.shape
        points = line_points(block, primary, reference, axisymmetric, k + 2, tolerance)
        candidates = Candidates(block.facets[points.facet], points.shape)
        pairing = pair(candidates.positions(deformed), primary, tolerance)
        # Near a corner, the closest facet may be on a flank that does not face the point.
        is_opposed = np.einsum("nd,nd->n", normals_at(block, deformed, points), pairing.normal) < -FACING
        # Either all points of a segment face the other side or none, because too few points would not determine a field.
        is_facing = (pairing.paired & is_opposed).reshape(-1, k + 2).mean(axis=1) > 0.5
        area = np.where(np.repeat(is_facing, k + 2), points.area, 0.0)
        mass = np.zeros((n, k, k))
        np.add.at(mass, points.facet, area[:, None, None] * points.shape[:, :, None] * points.shape[:, None, :])
        masses.append(mass)
        overlap_points.append(replace(points, area=area))
        gap_reduction = np.zeros((n, k, 2))
        if smoothing is not None:
            on_secondary = offset + points.facet, points.xi[:, None]
            volume = area * smoothing.overlap(on_secondary, (pairing.facet, pairing.xi), deformed)
            vectors = (volume[:, None] * pairing.normal)[:, None]
            np.add.at(gap_reduction, points.facet, points.shape[:, :, None] * vectors)
        gap_reductions.append(gap_reduction)
        covered = np.flatnonzero(area > 0)
        rows_of_blocks = by_block(pairing.facet[covered], side.sizes)
        for primary_block, (positions, primary_facet) in zip(side.blocks, rows_of_blocks, strict=True):
            rows = covered[positions]
            shape = elements.get(primary_block.element).shape(pairing.xi[rows])
            products = area[rows, None, None] * points.shape[rows, :, None] * shape[:, None, :]
            pairs = np.column_stack([points.facet[rows], primary_facet])
            couplings.append(Coupling(block, primary_block, pairs, products))
    return Overlap(masses, couplings, gap_reductions, overlap_points)
