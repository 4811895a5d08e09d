"""Segmentation of secondary faces by clipping with the primary faces, and integration over the segments (Puso, 2004).

Both sides are projected along the normal of the secondary facet, so that each segment has one facet on either side.
Curved facets are clipped as their corner polygons, an error of second order in the facet's length over its radius.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact._jit import parallel
from fastcontact.arrays import Array, Indices
from fastcontact.contact.formulations import _cut_faces_kernels
from fastcontact.contact.formulations._overlap import Coupling, Overlap
from fastcontact.contact.prescribed_normals import FACING
from fastcontact.contact.search.box_tree_kernels import build, tree_order
from fastcontact.contact.search.closest import closest_of_kinds
from fastcontact.contact.search.facet_tables import tables
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.contact.surface_smoothing import Smoothing, frames
from fastcontact.errors import ContactError
from fastcontact.mesh import elements, quadrature

# Largest distance of a facing facet: in distances of the closest primary facet, and radii of the facet itself.
DISTANCES, RADII = 2.0, 3.0
# Work per secondary facet relative to that per node of a cell, for the choice of threads.
EFFORT = 400
# Total degree in s and t of the products of mapped shape functions of a facet.
DEGREE = {3: 1, 4: 2, 6: 2, 8: 3, 9: 4}


def face_overlap(
    secondary: Surface, primary: Surface, reference: Array, deformed: Array, smoothing: Smoothing | None
) -> Overlap:
    """Cut and integrate the secondary facets on the deformed configuration; areas are those of the reference.

    Parameters
    ----------
    secondary, primary : Surface
    reference, deformed : ndarray (n_points, 3)
        Coordinates of all points [length].
    smoothing : Smoothing or None
        The smooth surfaces that facets approximate, if they are taken into account.

    Raises
    ------
    ContactError
        If a facet is too distorted to be projected.
    """
    secondary_polygons = [_Polygons.of(block, deformed) for block in secondary.blocks]
    primary_polygons = [_Polygons.of(block, deformed) for block in primary.blocks]
    centres = np.concatenate([polygons.origin for polygons in secondary_polygons])
    away = closest_of_kinds(centres, primary.corners(deformed)).distance
    axes = None if smoothing is None else [frames(side, reference, deformed) for side in (secondary, primary)]
    masses, couplings, closer, first = [], [], [], 0
    for of_secondary in secondary_polygons:
        size, nodes = of_secondary.block.facets.shape
        reach = DISTANCES * away[first : first + size] + RADII * of_secondary.radius
        mass, depth, first_other = np.zeros((size, nodes, nodes)), np.zeros((size, nodes)), 0
        for of_primary in primary_polygons:
            pairs = _facing(of_secondary, of_primary, reach)
            rows = slice(first, first + size), slice(first_other, first_other + len(of_primary.nodes))
            heights = _heights(smoothing, pairs, rows, axes)
            coupling, area, deep = _integrated(of_secondary, of_primary, pairs, reference, heights)
            couplings.append(coupling)
            mass += area
            depth += deep
            first_other += len(of_primary.nodes)
        masses.append(mass)
        closer.append(depth[:, :, None] * -of_secondary.axes[:, None, 2])
        first += size
    return Overlap(masses, couplings, closer)


def _heights(
    smoothing: Smoothing | None, pairs: Indices, rows: tuple[slice, slice], axes: list[Array] | None
) -> tuple[Array, Array, Array]:
    """Return the heights of the facets of two blocks above their planes, and the factors (n_pairs, 2) of `Smoothing.shared`.

    Without smoothing the heights have no coefficients. `rows` are the facets of the two blocks, `axes` the `frames` of all.
    """
    if smoothing is None or axes is None:
        none = np.zeros((0, 0, 0))
        return none, none, np.zeros((len(pairs), 2))
    secondary, primary = smoothing.secondary.part(rows[0]), smoothing.primary.part(rows[1])
    axes_of_facets = axes[0][rows[0]], axes[1][rows[1]]
    return (
        secondary.heights,
        primary.heights,
        Smoothing(secondary, primary).shared(pairs[:, 0], pairs[:, 1], axes_of_facets),
    )


@dataclass(frozen=True, eq=False)
class _Polygons:
    """Facets of one kind: nodes (n, k, 3), the planes of their corners, radii around the centres (n,), boxes."""

    block: FacetBlock
    nodes: Array
    count: int
    origin: Array
    axes: Array
    radius: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, block: FacetBlock, deformed: Array) -> _Polygons:
        """Return the deformed facets of a block."""
        nodes, count = deformed[block.facets], elements.get(block.element).n_corners
        origin, axes = np.empty((len(nodes), 3)), np.empty((len(nodes), 3, 3))
        _cut_faces_kernels.planes(nodes, count, origin, axes)
        corners = nodes[:, :count]
        radius = np.linalg.norm(corners - origin[:, None], axis=2).max(axis=1)
        return cls(block, nodes, count, origin, axes, radius, corners.min(axis=1), corners.max(axis=1))


def _facing(secondary: _Polygons, primary: _Polygons, reach: Array) -> Indices:
    """Return the pairs of facets (n, 2) that overlap, in ascending order."""
    numbers = tree_order(primary.origin, 1)
    tree = build(primary.low[numbers], primary.high[numbers])
    room = 8 * (len(secondary.nodes) + len(primary.nodes))
    while True:
        pairs = np.empty((room, 2), np.intp)
        count = _cut_faces_kernels.facing_pairs(
            secondary.nodes, secondary.count, secondary.origin, secondary.axes, secondary.radius, reach,
            primary.nodes, primary.count, np.ascontiguousarray(primary.axes[:, 2]), numbers, tree, -FACING, pairs,
        )  # fmt: skip
        if count <= room:
            return pairs[np.lexsort((pairs[:count, 1], pairs[:count, 0]))]
        room = count


def _integrated(
    secondary: _Polygons, primary: _Polygons, pairs: Indices, reference: Array, heights: tuple[Array, Array, Array]
) -> tuple[Coupling, Array, Array]:
    """Return the coupling of pairs of facets, and mass and `closer` of the secondary ones over the overlap."""
    one, other = elements.get(secondary.block.element), elements.get(primary.block.element)
    to_terms, other_to_terms = tables(one.n_nodes).to_terms, tables(other.n_nodes).to_terms
    n, k = secondary.block.facets.shape
    mass, integrals, closer = np.empty((n, k, k)), np.empty((len(pairs), k, other.n_nodes)), np.empty((n, k))
    degree = DEGREE[one.n_nodes] + max(DEGREE[one.n_nodes], DEGREE[other.n_nodes])
    if one.n_nodes == other.n_nodes == 3:  # integrated exactly, whichever the first corner
        degree = max(degree, heights[0].shape[1])
    given = (
        np.searchsorted(pairs[:, 0], np.arange(n + 1)), secondary.nodes, secondary.count, secondary.origin, secondary.axes,
        to_terms @ secondary.nodes, to_terms @ reference[secondary.block.facets], to_terms, _middle(one),
        primary.nodes, primary.count, other_to_terms @ primary.nodes, other_to_terms, _middle(other),
        pairs, *quadrature.triangle(min(degree + degree % 2, 8)), *heights, mass, integrals, closer,
    )  # fmt: skip
    failed = parallel.shared(
        lambda portion: _cut_faces_kernels.integrate(*portion, *given), parallel.portions(n, EFFORT)
    )
    if max(failed) >= 0:
        first, second = (side.origin[row] for side, row in zip((secondary, primary), pairs[max(failed)], strict=True))
        raise ContactError(f"the facets near {first} and {second} are too distorted to be cut: improve the mesh there")
    return Coupling(secondary.block, primary.block, pairs, integrals), mass, closer


def _middle(element: elements.Element) -> Array:
    return np.ascontiguousarray(element.nodes[: element.n_corners].mean(axis=0))
