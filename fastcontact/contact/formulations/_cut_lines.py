"""Lines cut opposite the nodes of the other side, and integrated piece by piece.

The gap between facets that do not match has a kink wherever a node of the primary side stands opposite; between two of
those it is smooth (Popp, Gee and Wall, 2009).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.formulations._overlap import Coupling, Overlap
from fastcontact.contact.pairing import Candidates, pair
from fastcontact.contact.search.closest import closest
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.mesh import elements, quadrature

Array = NDArray[np.float64]
# Parts of a facet shorter than this, in its own length, are rounding errors of the cut.
SLIVER = 1e-10
# Lines face each other if their normals enclose more than 120 degrees: beside a corner the flank is closest, but not faced.
OPPOSITE = -0.5
NO_BORDERS = np.empty(0, np.intp), np.empty(0)


@dataclass(frozen=True, eq=False)
class LinePoints:
    """Integration points of all pieces of a block: facet (n,), xi (n,), shape (n, k), reference area (n,)."""

    facet: NDArray[np.intp]
    xi: Array
    shape: Array
    area: Array


def line_points(
    block: FacetBlock,
    primary: Surface,
    reference: Array,
    deformed: Array,
    axisymmetric: bool,
    n_gauss: int,
    borders: tuple[NDArray[np.intp], Array] = NO_BORDERS,
) -> LinePoints:
    """Cut the facets of a block on the deformed configuration and put Gauss points on every piece.

    `borders` are further cuts: facets (n,) and xi (n,).
    """
    facet, begin, end = _cuts(block, primary, deformed, borders)
    s, w = quadrature.gauss_line(n_gauss)
    xi = (0.5 * (begin + end)[:, None] + 0.5 * (end - begin)[:, None] * s[:, 0]).ravel()
    weight = (0.5 * (end - begin)[:, None] * w).ravel()
    facet = np.repeat(facet, len(w))
    element = elements.get(block.element)
    corners, shape = reference[block.facets[facet]], element.shape(xi[:, None])
    tangent = np.einsum("nk,nkd->nd", element.gradient(xi[:, None])[:, :, 0], corners)
    area = np.linalg.norm(tangent, axis=1) * weight
    if axisymmetric:
        area *= 2 * np.pi * np.maximum(np.einsum("nk,nk->n", shape, corners[:, :, 0]), 0.0)
    return LinePoints(facet, xi, shape, area)


def _cuts(
    block: FacetBlock, primary: Surface, deformed: Array, borders: tuple[NDArray[np.intp], Array]
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return (facet, begin, end) of the pieces of the facets of a block, in their reference coordinate."""
    ends = np.unique(np.concatenate([other.facets[:, :2].ravel() for other in primary.blocks]))
    opposite = closest(deformed[ends], deformed[block.facets])
    along = opposite.xi[:, 0]
    inside = (opposite.overhang == 0.0) & (np.abs(along) < 1.0 - SLIVER)
    n = len(block.facets)
    facet = np.concatenate([np.arange(n), np.arange(n), opposite.facet[inside], borders[0]])
    xi = np.concatenate([np.full(n, -1.0), np.full(n, 1.0), along[inside], borders[1]])
    order = np.lexsort((xi, facet))
    facet, xi = facet[order], xi[order]
    piece = (facet[1:] == facet[:-1]) & (np.diff(xi) > SLIVER)
    return facet[:-1][piece], xi[:-1][piece], xi[1:][piece]


def normals_at(block: FacetBlock, coordinates: Array, points: LinePoints) -> Array:
    """Return the unit normals (n, 2) of a block at integration points, for nodal `coordinates` (n_points, 2)."""
    gradient = elements.get(block.element).gradient(points.xi[:, None])[:, :, 0]
    tangent = np.einsum("nk,nkd->nd", gradient, coordinates[block.facets[points.facet]])
    return np.column_stack([tangent[:, 1], -tangent[:, 0]]) / np.linalg.norm(tangent, axis=1, keepdims=True)


def line_overlap(
    secondary: Surface, primary: Surface, reference: Array, deformed: Array, axisymmetric: bool, tolerance: float
) -> Overlap:
    """Cut and integrate the secondary facets on the deformed configuration; areas are those of the reference.

    Parameters
    ----------
    secondary, primary : Surface
    reference, deformed : ndarray (n_points, 2)
        Coordinates of all points [length].
    axisymmetric : bool
        Integrals run over the full circle.
    tolerance : float
        How far a point may stand out beyond the end of the primary side and still face it, in facet lengths.
    """
    first = np.cumsum([0] + [len(block.facets) for block in primary.blocks])
    masses, couplings = [], []
    for block in secondary.blocks:
        n, k = block.facets.shape
        points = line_points(block, primary, reference, deformed, axisymmetric, k + 2)
        at = Candidates(block.facets[points.facet], points.shape).positions(deformed)
        facing = pair(at, primary, deformed, tolerance)
        opposite = np.einsum("nd,nd->n", normals_at(block, deformed, points), facing.normal) < OPPOSITE
        # A piece faces the other side with all its points or none: with too few it would not carry a field of its own.
        mostly = (facing.paired & opposite).reshape(-1, k + 2).mean(axis=1) > 0.5
        area = np.where(np.repeat(mostly, k + 2), points.area, 0.0)
        mass = np.zeros((n, k, k))
        np.add.at(mass, points.facet, area[:, None, None] * points.shape[:, :, None] * points.shape[:, None, :])
        masses.append(mass)
        for number, other in enumerate(primary.blocks):
            rows = np.flatnonzero((area > 0) & (facing.facet >= first[number]) & (facing.facet < first[number + 1]))
            shape = elements.get(other.element).shape(facing.xi[rows])
            products = area[rows, None, None] * points.shape[rows, :, None] * shape[:, None, :]
            ends = np.column_stack([points.facet[rows], facing.facet[rows] - first[number]])
            pairs, place = np.unique(ends, axis=0, return_inverse=True)
            integrals = np.zeros((len(pairs), *products.shape[1:]))
            np.add.at(integrals, place.ravel(), products)
            couplings.append(Coupling(block, other, pairs, integrals))
    return Overlap(masses, couplings)
