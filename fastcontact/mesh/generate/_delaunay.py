"""Delaunay triangulation of a convex set of points, and its edges and stars."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]


def delaunay(points: Array) -> Numbers:
    """Return counter-clockwise triangles (n_triangles, 3) of the convex hull of `points` (n, 2) [length], without flat ones.

    Nodes in line on the hull give triangles of zero area by rounding; they are dropped.
    """
    from scipy.spatial import Delaunay

    triangles = Delaunay(points).simplices.astype(np.intp)
    first, second, third = (points[triangles[:, i]] for i in range(3))
    u, v = second - first, third - first
    twice_area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    flat = np.abs(twice_area) <= 1e-9 * ((u * u).sum(axis=1) + (v * v).sum(axis=1))
    clockwise = twice_area < 0
    triangles[clockwise] = triangles[clockwise][:, [0, 2, 1]]
    return triangles[~flat]


def edges_of(triangles: Numbers) -> Numbers:
    """Return the edges (n_edges, 2) of `triangles` (n_triangles, 3), each once, smaller point number first."""
    ends = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ends.sort(axis=1)
    n = int(ends.max()) + 1
    keys = np.unique(ends[:, 0] * n + ends[:, 1])
    return np.column_stack([keys // n, keys % n])


def stars_of(triangles: Numbers, n_points: int) -> Numbers:
    """Return the edges (n_points, degree, 2) of `triangles` (n_triangles, 3) opposite to each point, padded with -1."""
    centre = triangles.ravel()
    opposite = np.stack([np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)], axis=2).reshape(-1, 2)
    order = np.argsort(centre, kind="stable")
    centre, opposite = centre[order], opposite[order]
    degree = np.bincount(centre, minlength=n_points)
    first = np.concatenate([[0], np.cumsum(degree)[:-1]])
    stars = np.full((n_points, degree.max(), 2), -1)
    stars[centre, np.arange(len(centre)) - first[centre]] = opposite
    return stars
