"""Improvement of a Delaunay triangulation: relaxation of the points, then optimisation of the worst triangles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fastcontact.arrays import Array, Indices, Mask

Size = Callable[[Array], Array]

_KEPT = 4  # steps with one triangulation
_STEP = 0.2  # pseudo-time of one step of `relax`
_STRETCH = 1.2  # rest length of bars over their scaled length, so that the points spread
_DIRECTIONS = np.linspace(0.0, 2 * np.pi, 13)[:-1]
_TRIALS = np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
_TRIALS = np.vstack([_TRIALS, 0.5 * _TRIALS])
_GOOD = np.sin(np.radians(50.0))  # stars with a larger smallest angle are not changed
_TOO_LONG = 0.5, 2.0  # penalty of an edge that is too long, and per relative excess, as sine of an angle


def delaunay(points: Array) -> Indices:
    """Return counter-clockwise triangles (n_triangles, 3) of the convex hull of `points` (n, 2) [length], without flat ones.

    Collinear nodes on the hull cause triangles of zero area by round-off, which are dropped.
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


def edges_of(triangles: Indices) -> Indices:
    """Return the edges (n_edges, 2) of `triangles` (n_triangles, 3), each once, smaller point number first."""
    ends = np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ends.sort(axis=1)
    n = int(ends.max()) + 1
    keys = np.unique(ends[:, 0] * n + ends[:, 1])
    return np.column_stack([keys // n, keys % n])


def stars_of(triangles: Indices, n_points: int) -> Indices:
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


def relax(points: Array, movable: Mask, size: Size, steps: int) -> Array:
    """Return points (n, 2) [length], the movable ones relaxed by repulsive bars along the edges.

    The bars of a truss push its nodes apart until the lengths follow the size function (P.-O. Persson and G. Strang, A simple
    mesh generator in MATLAB, SIAM Review 46, 2004, section 2). Only the `movable` (n,) of the `points` (n, 2) [length] move,
    in `steps` steps; the function `size` (n,) [length] of points returns the desired length of edges.
    """
    points = points.copy()
    if not movable.any():
        return points
    for step in range(steps):
        if step % _KEPT == 0:
            edges = edges_of(delaunay(points))
            edges = edges[movable[edges].any(axis=1)]
            wanted = size(points[edges].mean(axis=1))
        push = _push(points, edges, wanted)
        points[movable] += _STEP * push[movable]
    return points


def _push(points: Array, edges: Indices, wanted: Array) -> Array:
    """Return the sums (n, 2) of the bar forces at the points; a bar longer than its rest length does not pull."""
    bars = points[edges[:, 0]] - points[edges[:, 1]]
    length = np.sqrt((bars * bars).sum(axis=1))
    # The rest lengths are scaled to the actual lengths, so that the pressure is the same everywhere.
    rest = _STRETCH * wanted * np.sqrt((length**2).sum() / (wanted**2).sum())
    force = (np.maximum(rest - length, 0.0) / length)[:, None] * bars
    push = np.empty_like(points)
    for axis in range(2):
        push[:, axis] = np.bincount(edges[:, 0], force[:, axis], len(points))
        push[:, axis] -= np.bincount(edges[:, 1], force[:, axis], len(points))
    return push


def polish(points: Array, movable: Mask, limit: Size, sweeps: int) -> Array:
    """Return points (n, 2) [length], moved one by one so that the worst triangle around each becomes better.

    A trial move is accepted if it raises the smallest angle of the star, with a penalty on edges that are too long (smart
    smoothing after L. Freitag and C. Ollivier-Gooch, Int. J. Numer. Meth. Engng 40, 1997). Points moved simultaneously share
    no edge. Only the `movable` (n,) of the `points` (n, 2) [length] move, in at most `sweeps` sweeps. The function
    `limit` (n,) [length] of points returns the longest admissible edge.
    """
    points = points.copy()
    radius, moved = 0.1, True
    for sweep in range(sweeps):
        if sweep % _KEPT == 0:
            if not moved:
                break
            triangles = delaunay(points)
            edges, stars, moved = edges_of(triangles), stars_of(triangles, len(points)), False
        moved |= _sweep(points, movable, edges, stars, limit(points), radius)
        radius *= 0.9
    return points


def _sweep(points: Array, movable: Mask, edges: Indices, stars: Indices, limit: Array, radius: float) -> bool:
    """Try to move every bad point once, the worst first, in place; return whether any point moved."""
    worth = np.full(len(points), np.inf)
    worth[movable] = _star_quality(points[movable, None], points, stars[movable], limit[movable])[:, 0]
    worth[worth >= _GOOD] = np.inf
    moved = False
    for _ in range(6):
        neighbours = np.full(len(points), np.inf)
        np.minimum.at(neighbours, edges[:, 0], worth[edges[:, 1]])
        np.minimum.at(neighbours, edges[:, 1], worth[edges[:, 0]])
        chosen = np.flatnonzero(worth < neighbours)
        if not len(chosen):
            break
        moved |= _try_moves(points, chosen, stars, limit, radius)
        worth[chosen] = np.inf
    return moved


def _try_moves(points: Array, chosen: Indices, stars: Indices, limit: Array, radius: float) -> bool:
    """Move each chosen point in place to its best trial position if that is better; return whether any point moved."""
    here = points[chosen]
    trials = here[:, None] + radius * limit[chosen, None, None] * _TRIALS
    places = np.concatenate([here[:, None], trials], axis=1)
    quality = _star_quality(places, points, stars[chosen], limit[chosen])
    best = quality.argmax(axis=1)
    points[chosen] = places[np.arange(len(chosen)), best]
    return bool(best.any())


def _star_quality(places: Array, points: Array, stars: Indices, limit: Array) -> Array:
    """Return the quality (m, n_places) of the worst triangle around each point for positions `places` (m, n_places, 2)."""
    a, b = points[stars[:, None, :, 0]], points[stars[:, None, :, 1]]
    u, v, w = a - places[:, :, None], b - places[:, :, None], b - a
    twice_area = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    uu, vv, ww = (u * u).sum(axis=-1), (v * v).sum(axis=-1), (w * w).sum(axis=-1)
    # The smallest angle is opposite the shortest side: its sine is 2 area / (product of the two others).
    shortest = np.minimum(np.minimum(uu, vv), ww)
    sine = twice_area * np.sqrt(shortest / np.maximum(uu * vv * ww, 1e-300))
    excess = np.sqrt(np.maximum(uu, vv)) / limit[:, None, None] - 1.0
    quality = sine - np.where(excess > 0.0, _TOO_LONG[0] + _TOO_LONG[1] * excess, 0.0)
    return np.where(stars[:, None, :, 0] >= 0, quality, np.inf).min(axis=-1)
