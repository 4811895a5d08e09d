"""Move the inner points of a triangulation until it is well shaped."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastcontact.generate._delaunay import delaunay, edges_of, stars_of

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Mask = NDArray[np.bool_]
Size = Callable[[Array], Array]

_STEP = 0.2  # pseudo-time of one relaxation step
_STRETCH = 1.2  # bars push until they are this much longer than they can be, so that the points spread
_KEPT = 4  # steps with one triangulation


def relax(points: Array, movable: Mask, size: Size, steps: int) -> Array:
    """Spread the movable points by repulsive bars along the edges.

    The bars of a truss push its nodes apart until the lengths follow the size function (P.-O. Persson and
    G. Strang, A simple mesh generator in MATLAB, SIAM Review 46, 2004, section 2).

    Parameters
    ----------
    points : ndarray (n, 2)
        [length].
    movable : ndarray of bool (n,)
        Points that may move.
    size : callable
        ``size(points)`` is the wanted edge length (n,) [length].
    steps : int
        Number of moves.

    Returns
    -------
    ndarray (n, 2)
    """
    points = points.copy()
    for step in range(steps):
        if step % _KEPT == 0:
            edges = edges_of(delaunay(points))
            edges = edges[movable[edges].any(axis=1)]
            wanted = size(points[edges].mean(axis=1))
        push = _push(points, edges, wanted)
        points[movable] += _STEP * push[movable]
    return points


def _push(points: Array, edges: Numbers, wanted: Array) -> Array:
    """Sum (n, 2) of the bar forces at the points; a bar longer than its rest length does not pull."""
    bars = points[edges[:, 0]] - points[edges[:, 1]]
    length = np.sqrt((bars * bars).sum(axis=1))
    # The rest lengths are scaled to the lengths there are, so that the pressure is the same everywhere.
    rest = _STRETCH * wanted * np.sqrt((length**2).sum() / (wanted**2).sum())
    force = (np.maximum(rest - length, 0.0) / length)[:, None] * bars
    push = np.empty_like(points)
    for axis in range(2):
        push[:, axis] = np.bincount(edges[:, 0], force[:, axis], len(points))
        push[:, axis] -= np.bincount(edges[:, 1], force[:, axis], len(points))
    return push


_DIRECTIONS = np.linspace(0.0, 2 * np.pi, 13)[:-1]
_TRIALS = np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
_TRIALS = np.vstack([_TRIALS, 0.5 * _TRIALS])
_GOOD = np.sin(np.radians(50.0))  # a star whose smallest angle is larger needs no care
_TOO_LONG = 0.5, 2.0  # what an edge too long costs, at once and per relative excess, in sines of an angle


def polish(points: Array, movable: Mask, limit: Size, sweeps: int) -> Array:
    """Move single points so that the worst triangle around each gets better.

    A trial move is kept when it raises the smallest angle of the star, edges longer than `limit` counting against
    it (smart smoothing after L. Freitag and C. Ollivier-Gooch, Int. J. Numer. Meth. Engng 40, 1997). Points moved
    at the same time share no edge.
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


def _sweep(points: Array, movable: Mask, edges: Numbers, stars: Numbers, limit: Array, radius: float) -> bool:
    """Try to move every bad point once, worst first, in place; return whether any moved."""
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


def _try_moves(points: Array, chosen: Numbers, stars: Numbers, limit: Array, radius: float) -> bool:
    """Move each chosen point to its best trial place if that is better, in place; return whether any moved."""
    here = points[chosen]
    trials = here[:, None] + radius * limit[chosen, None, None] * _TRIALS
    places = np.concatenate([here[:, None], trials], axis=1)
    quality = _star_quality(places, points, stars[chosen], limit[chosen])
    best = quality.argmax(axis=1)
    points[chosen] = places[np.arange(len(chosen)), best]
    return bool(best.any())


def _star_quality(places: Array, points: Array, stars: Numbers, limit: Array) -> Array:
    """Quality (m, n_places) of the worst triangle around each point, were it at `places` (m, n_places, 2)."""
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
