"""The closest facet to each of many points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastcontact.kernels import search2d

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Closest:
    """Projections of points on their closest facets.

    Attributes
    ----------
    facet : ndarray of int (n,)
        Row of the facet; of equally close ones the first.
    xi : ndarray (n,)
        Reference coordinate of the projection, in [-1, 1].
    normal : ndarray (n, 2)
        Unit normal of the facet there, to the right of its direction.
    overhang : ndarray (n,)
        How far a point stands out beyond the end of its facet, in facet lengths; 0 within.
    """

    facet: NDArray[np.intp]
    xi: Array
    normal: Array
    overhang: Array


def closest(points: Array, corners: Array) -> Closest:
    """Project `points` (n, 2) on the closest of the line facets `corners` (n_facets, 2 or 3 nodes, 2)."""
    points, corners = np.ascontiguousarray(points), np.ascontiguousarray(corners)
    low, high, child, span, order = search2d.build_tree(corners)
    n = len(points)
    found = Closest(np.empty(n, np.intp), np.empty(n), np.empty((n, 2)), np.empty(n))
    search2d.closest_facets(
        points, corners, low, high, child, span, order, found.facet, found.xi, found.normal, found.overhang
    )
    return found
