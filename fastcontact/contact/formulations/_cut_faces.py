"""Segmentation of secondary faces by clipping with the primary faces, and integration over the segments (Puso, 2004).

Both sides are projected along the normal of the secondary facet. Each segment then belongs to one facet on each side. Curved
facets are clipped as polygons of their corners, with an error of second order in the ratio of facet length to radius.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact._jit import parallel
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices
from fastcontact.contact.formulations import _cut_faces_kernels
from fastcontact.contact.formulations._overlap import Coupling, Overlap
from fastcontact.contact.pairing import FACING
from fastcontact.contact.projection import closest_of_types
from fastcontact.contact.search.box_tree_kernels import build, tree_order
from fastcontact.contact.search.facet_tables import polynomial_degree, tables
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.contact.surface_smoothing import Smoothing
from fastcontact.errors import ContactError
from fastcontact.mesh import elements, quadrature

# Two facets are clipped if their distance along the normal is at most REACH times the sum of the radius of the secondary
# facet and its distance from the closest primary facet. With 1, half of a facet is lost at an inclination of 80 degrees
# (`test_facets_that_are_inclined_to_each_other_share_all`).
REACH = 3.0
# Work per secondary facet in the units of `parallel.portions`, which choose the number of threads. A unit takes about 10 ns,
# and a facet 5 us (tri3) to 70 us (quad8).
EFFORT = 400
# Curved facets that are inclined to each other may be folded in the projection: a part of them faces away and is omitted. If
# the cosine of their normals is below this value, only facets that are distorted in their own planes are folded.
OPPOSED = -0.7


def face_overlap(
    secondary: Surface, primary: Surface, reference: Array, deformed: Array, smoothing: Smoothing | None
) -> Overlap:
    """Clip the secondary facets on the deformed configuration, and integrate over the segments.

    Integrals use the areas of the undeformed configuration.

    Parameters
    ----------
    secondary, primary : Surface
    reference, deformed : ndarray (n_points, 3)
        Undeformed and deformed coordinates of all points [length].
    smoothing : Smoothing or None
        The smooth surfaces that the facets approximate; None if gaps are measured between the facets.

    Raises
    ------
    ContactError
        If a facet is too distorted to be projected.
    """
    secondary_polygons = [_Polygons.of(block, deformed) for block in secondary.blocks]
    primary_polygons = [_Polygons.of(block, deformed) for block in primary.blocks]
    centres = np.concatenate([polygons.origin for polygons in secondary_polygons])
    distance = closest_of_types(centres, primary.node_positions(deformed)).distance
    axes = None if smoothing is None else smoothing.frames(deformed)
    masses, couplings, gap_reductions = [], [], []
    for polygons, offset in zip(secondary_polygons, secondary.offsets):
        n, k = polygons.block.facets.shape
        reach = REACH * (distance[offset : offset + n] + polygons.radius)
        mass, reduction = np.zeros((n, k, k)), np.zeros((n, k))
        for opposite, primary_offset in zip(primary_polygons, primary.offsets):
            pairs = _overlapping_pairs(polygons, opposite, reach)
            facets = slice(offset, offset + n), slice(primary_offset, primary_offset + len(opposite.nodes))
            heights = _heights(smoothing, pairs, facets, axes)
            coupling, mass_of_block, reduction_of_block = _integrals(polygons, opposite, pairs, reference, heights)
            couplings.append(coupling)
            mass += mass_of_block
            reduction += reduction_of_block
        masses.append(mass)
        gap_reductions.append(reduction[:, :, None] * -polygons.axes[:, None, 2])
    return Overlap(masses, couplings, gap_reductions, [])


def _heights(
    smoothing: Smoothing | None, pairs: Indices, facets: tuple[slice, slice], axes: list[Array] | None
) -> tuple[Array, Array, Array]:
    """Return the heights of the smooth surfaces above the facets of two blocks, and factors for each pair of facets.

    Parameters
    ----------
    smoothing : Smoothing or None
        The smooth surfaces; if None, the heights are empty arrays.
    pairs : ndarray of int (n_pairs, 2)
        Numbers of the secondary and the primary facet, each in its block.
    facets : (slice, slice)
        Ranges of the facets of the two blocks among all facets of their sides.
    axes : list of ndarray or None
        `Smoothing.frames` of all facets of both sides.

    Returns
    -------
    secondary, primary : ndarray
        Coefficients of the heights, see `surface_smoothing`.
    factors : ndarray (n_pairs, 2)
        See `Smoothing.height_factors`.
    """
    if smoothing is None or axes is None:
        no_heights = np.zeros((0, 0, 0))
        return no_heights, no_heights, np.zeros((len(pairs), 2))
    secondary, primary = facets
    factors = smoothing.height_factors(pairs[:, 0] + secondary.start, pairs[:, 1] + primary.start, axes)
    return smoothing.secondary.heights[secondary], smoothing.primary.heights[primary], factors


@record
class _Polygons:
    """Deformed facets of a block, as polygons of their corners in planes.

    Attributes
    ----------
    block : FacetBlock
    nodes : ndarray (n, k, 3)
        Positions of the k nodes of each of n facets [length].
    n_corners : int
        Number of corners of a facet.
    origin, axes : ndarray (n, 3), ndarray (n, 3, 3)
        Centres of the facets [length], and unit vectors in rows: two tangents of the plane of the corners, and its normal
        [-].
    radius : ndarray (n,)
        Largest distance of a corner from the centre [length].
    """

    block: FacetBlock
    nodes: Array
    n_corners: int
    origin: Array
    axes: Array
    radius: Array

    @classmethod
    def of(cls, block: FacetBlock, deformed: Array) -> _Polygons:
        """Return the facets of a block for nodal coordinates `deformed` (n_points, 3) [length]."""
        nodes, n_corners = deformed[block.facets], elements.get(block.element).n_corners
        origin, axes = np.empty((len(nodes), 3)), np.empty((len(nodes), 3, 3))
        _cut_faces_kernels.planes(nodes, n_corners, origin, axes)
        radius = np.linalg.norm(nodes[:, :n_corners] - origin[:, None], axis=2).max(axis=1)
        return cls(block, nodes, n_corners, origin, axes, radius)


def _overlapping_pairs(secondary: _Polygons, primary: _Polygons, reach: Array) -> Indices:
    """Return the pairs (n, 2) of a secondary and a primary facet whose projections overlap, in ascending order.

    `reach` (n_secondary,) are the largest distances at which facets are paired [length].
    """
    numbers = tree_order(primary.origin)
    corners = primary.nodes[numbers, : primary.n_corners]
    tree = build(corners.min(axis=1), corners.max(axis=1))
    capacity = 8 * (len(secondary.nodes) + len(primary.nodes))
    while True:
        pairs = np.empty((capacity, 2), np.intp)
        count = _cut_faces_kernels.facing_pairs(
            secondary.nodes, secondary.n_corners, secondary.origin, secondary.axes, secondary.radius, reach,
            primary.nodes, primary.n_corners, np.ascontiguousarray(primary.axes[:, 2]), numbers, tree, -FACING, pairs,
        )  # fmt: skip
        if count <= capacity:
            return pairs[np.lexsort((pairs[:count, 1], pairs[:count, 0]))]
        capacity = count


def _integrals(
    secondary: _Polygons, primary: _Polygons, pairs: Indices, reference: Array, heights: tuple[Array, Array, Array]
) -> tuple[Coupling, Array, Array]:
    """Return integrals of shape functions over the overlap of each pair of facets.

    Parameters
    ----------
    secondary, primary : _Polygons
    pairs : ndarray of int (n_pairs, 2)
        Numbers of the facets.
    reference : ndarray (n_points, 3)
        Undeformed coordinates of all points [length].
    heights : tuple of ndarray
        The value of `_heights`.

    Returns
    -------
    coupling : Coupling
    mass : ndarray (n, k, k)
        Integrals of products of two shape functions of the n secondary facets [area].
    gap_reduction : ndarray (n, k)
        Integrals of the shape functions times the distances by which the smooth surfaces are closer to each other than the
        facets [volume].

    Raises
    ------
    ContactError
        If a facet is too distorted to be projected.
    """
    element, opposite = elements.get(secondary.block.element), elements.get(primary.block.element)
    to_terms, opposite_to_terms = tables(element.n_nodes).to_terms, tables(opposite.n_nodes).to_terms
    n, k = secondary.block.facets.shape
    mass, integrals = np.empty((len(pairs), k, k)), np.empty((len(pairs), k, opposite.n_nodes))
    gap_reduction, start = np.empty((n, k)), np.searchsorted(pairs[:, 0], np.arange(n + 1))
    folded = np.zeros(len(pairs), bool)
    degree = polynomial_degree(element.n_nodes) + polynomial_degree(max(element.n_nodes, opposite.n_nodes))
    # Between triangles the quadrature is exact, so that the result does not depend on the choice of a first corner.
    if element.n_nodes == opposite.n_nodes == 3:
        degree = max(degree, heights[0].shape[1])
    arguments = (
        start, secondary.nodes, secondary.n_corners, secondary.origin, secondary.axes,
        to_terms @ secondary.nodes, to_terms @ reference[secondary.block.facets], to_terms, _centre(element),
        primary.nodes, primary.n_corners, opposite_to_terms @ primary.nodes, opposite_to_terms, _centre(opposite),
        pairs, *quadrature.triangle(min(degree + degree % 2, 8)), *heights, mass, integrals, gap_reduction, folded,
    )  # fmt: skip
    spans = parallel.portions(n, EFFORT)
    parallel.parallel_map(lambda span: _cut_faces_kernels.integrate(*span, *arguments), spans)
    opposed = np.einsum("nd,nd->n", secondary.axes[pairs[:, 0], 2], primary.axes[pairs[:, 1], 2]) < OPPOSED
    if (distorted := folded & opposed).any():
        first, second = (
            side.origin[row] for side, row in zip((secondary, primary), pairs[distorted.argmax()], strict=True)
        )
        raise ContactError(
            f"the facets near {first} and {second} are too distorted to be cut: improve the mesh there, exchange the sides, "
            "or use formulation 'continuous'"
        )
    sum_over_pairs = csr_array((np.ones(len(pairs)), np.arange(len(pairs)), start), shape=(n, len(pairs)))
    mass_of_facets = (sum_over_pairs @ mass.reshape(-1, k * k)).reshape(-1, k, k)
    coupling = Coupling(secondary.block, primary.block, pairs, integrals, -secondary.axes[:, 2])
    return coupling, mass_of_facets, gap_reduction


def _centre(element: elements.Element) -> Array:
    """Return the reference coordinates (2,) of the centre of a facet."""
    return np.ascontiguousarray(element.nodes[: element.n_corners].mean(axis=0))
