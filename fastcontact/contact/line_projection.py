"""Projection on lines along averaged normals: the counterpart of `projection` in the plane."""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact import line_projection_kernels
from fastcontact.contact.search.closest import Closest
from fastcontact.contact.surface import Surface, line_neighbours


def along_line_normals(
    points: Array, side: Surface, coordinates: Array, normals: Array, start: Closest
) -> tuple[Indices, Array, Array]:
    """Project points (n, 2) on a line along its interpolated normals; see `projection.along_normals`."""
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
    return facet, xi[:, None], overhang


def smooth_ends(side: Surface, normals: Array) -> Mask:
    """Return the ends (n_facets, 2) of lines at which another line continues without a corner.

    `normals` (n_facets, k, 2) are those of the facets at their nodes, see `projection.smooth_normals`: the same for both
    facets at such an end.
    """
    ends = np.concatenate([block.local[:, :2] for block in side.blocks])
    total = np.zeros((len(side.points), 2))
    np.add.at(total, ends, normals[:, :2])
    return np.asarray(side.inner_ends & (np.linalg.norm(total, axis=1)[ends] > 2.0 - 1e-6))
