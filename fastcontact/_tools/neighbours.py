"""Nearest points and close pairs of points; SciPy's trees, whose import takes as long as a small run, serve many points."""

from __future__ import annotations

from itertools import chain

import numpy as np

from fastcontact.arrays import Array, Indices

# Pairs of points up to which all distances are computed.
FEW = 250_000
# A direction of length at most 1 that is parallel to no axis or diagonal of a structured mesh. Points that are close have
# neighbouring projections on it.
NO_AXIS = np.array([0.46, 0.5718, 0.6789])


def nearest(places: Array, positions: Array) -> tuple[Array, Indices]:
    """Return distance (n,) and row (n,) of the nearest of `places` (m, dim) to each of `positions` (n, dim) [length]."""
    if len(places) * len(positions) <= FEW:
        squared = ((positions[:, None] - places) ** 2).sum(axis=2)
        rows = squared.argmin(axis=1)
        return np.sqrt(squared[np.arange(len(rows)), rows]), rows
    from scipy.spatial import cKDTree

    distance, rows = cKDTree(places).query(positions)
    return np.asarray(distance), np.asarray(rows, np.intp)


def close_pairs(points: Array, within: float) -> Indices:
    """Return the pairs of rows (k, 2) of `points` (n, dim) whose distance is at most `within` [length]."""
    along = points @ NO_AXIS[: points.shape[1]]
    order = np.argsort(along)
    near = np.diff(along[order]) <= within
    if not near.any():
        return np.empty((0, 2), np.intp)
    rows = np.sort(order[np.append(near, False) | np.insert(near, 0, False)])
    other, one = pairs_within(points[rows], points[rows], np.full(len(rows), within))
    pairs = rows[np.column_stack([one, other])[one < other]]
    return pairs[np.lexsort(pairs.T[::-1])]


def pairs_within(points: Array, centres: Array, radii: Array) -> tuple[Indices, Indices]:
    """Return the rows (k,) of `points` (n, dim) and of `centres` (m, dim) that are at most `radii` (m,) apart [length].

    They are in the order of the centres.
    """
    direction = NO_AXIS[: points.shape[1]]
    along, at = points @ direction, centres @ direction
    order = np.argsort(along)
    first, end = np.searchsorted(along[order], at - radii), np.searchsorted(along[order], at + radii, "right")
    if (end - first).sum() <= 8 * FEW:  # most pairs are excluded by one coordinate
        centre = np.repeat(np.arange(len(at)), end - first)
        point = order[np.arange(len(centre)) + np.repeat(end - np.cumsum(end - first), end - first)]
        for x, middle in zip(points.T, centres.T, strict=True):
            near = np.abs(x[point] - middle[centre]) <= radii[centre]
            point, centre = point[near], centre[near]
        near = ((points[point] - centres[centre]) ** 2).sum(axis=1) <= radii[centre] ** 2
        return point[near], centre[near]
    from scipy.spatial import cKDTree

    members = cKDTree(points).query_ball_point(centres, radii)
    centre = np.repeat(np.arange(len(members)), list(map(len, members)))
    return np.fromiter(chain.from_iterable(members), np.intp, len(centre)), centre
