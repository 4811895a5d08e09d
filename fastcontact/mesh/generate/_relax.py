"""Spread points evenly, by repulsive forces along the edges of their triangulation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.generate._delaunay import delaunay, edges_of

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]
Mask = NDArray[np.bool_]
Size = Callable[[Array], Array]

_STEP = 0.2  # pseudo-time of one relaxation step
_STRETCH = 1.2  # bars push until they are this much longer than they can be, so that the points spread
_KEPT = 4  # steps with one triangulation


def relax(points: Array, movable: Mask, size: Size, steps: int) -> Array:
    """Return points (n, 2) [length], the movable ones spread by repulsive bars along the edges.

    The bars of a truss push its nodes apart until the lengths follow the size function (P.-O. Persson and
    G. Strang, A simple mesh generator in MATLAB, SIAM Review 46, 2004, section 2). Of the `points` (n, 2) [length] those
    `movable` (n,) of bool move, in so many `steps`; ``size(points)``, `size` (n,) [length], is the wanted length of edges.
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
