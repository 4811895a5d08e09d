"""Nearest points and close pairs of points.

The k-d trees of SciPy are used only for many points, because their import takes as long as a small run.
"""

from __future__ import annotations

from itertools import chain

import numpy as np

from fastcontact.arrays import Array, Indices

# Largest number of pairs of points for which all distances are computed.
MAX_PAIRS = 250_000
# Vector of at most unit length that is not parallel to an axis or a diagonal of a structured mesh. The projections of two
# points onto this vector differ by at most the distance between the points.
DIRECTION = np.array([0.46, 0.5718, 0.6789])


def nearest(points: Array, positions: Array) -> tuple[Array, Indices]:
    """Return the nearest of `points` (m, dim) to each of `positions` (n, dim).

    The result consists of the distances (n,) [length] and the rows (n,) of the nearest points.
    """
    if len(points) * len(positions) <= MAX_PAIRS:
        squared = ((positions[:, None] - points) ** 2).sum(axis=2)
        rows = squared.argmin(axis=1)
        return np.sqrt(squared[np.arange(len(rows)), rows]), rows
    from scipy.spatial import cKDTree

    distance, rows = cKDTree(points).query(positions)
    return np.asarray(distance), np.asarray(rows, np.intp)


def close_pairs(points: Array, max_distance: float) -> Indices:
    """Return the pairs of rows (k, 2) of `points` (n, dim) [length] whose distance is at most `max_distance` [length]."""
    second, first = pairs_within(points, points, np.full(len(points), max_distance))
    pairs = np.column_stack([first, second])[first < second]
    return pairs[np.lexsort(pairs.T[::-1])]


def pairs_within(points: Array, centres: Array, radii: Array) -> tuple[Indices, Indices]:
    """Return the pairs of a point and a centre whose distance is at most the radius of the centre.

    The result consists of the rows (k,) of `points` (n, dim) and the rows (k,) of `centres` (m, dim) [length], in the order
    of the centres. `radii` (m,) are the radii [length].
    """
    direction = DIRECTION[: points.shape[1]]
    point_projections, centre_projections = points @ direction, centres @ direction
    order = np.argsort(point_projections)
    first = np.searchsorted(point_projections[order], centre_projections - radii)
    end = np.searchsorted(point_projections[order], centre_projections + radii, "right")
    if (end - first).sum() <= 8 * MAX_PAIRS:
        centre = np.repeat(np.arange(len(centres)), end - first)
        point = order[np.arange(len(centre)) + np.repeat(end - np.cumsum(end - first), end - first)]
        # Each coordinate excludes most of the pairs that are not close.
        for x, x_centre in zip(points.T, centres.T, strict=True):
            is_close = np.abs(x[point] - x_centre[centre]) <= radii[centre]
            point, centre = point[is_close], centre[is_close]
        is_close = ((points[point] - centres[centre]) ** 2).sum(axis=1) <= radii[centre] ** 2
        return point[is_close], centre[is_close]
    from scipy.spatial import cKDTree

    members = cKDTree(points).query_ball_point(centres, radii)
    centre = np.repeat(np.arange(len(members)), list(map(len, members)))
    return np.fromiter(chain.from_iterable(members), np.intp, len(centre)), centre
