"""Triangles inside a convex outline, edges no longer than a size function, without random numbers."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.errors import MeshError
from fastcontact.mesh.generate._delaunay import delaunay, edges_of
from fastcontact.mesh.generate._polish import polish
from fastcontact.mesh.generate._relax import relax
from fastcontact.mesh.generate._seeds import inner_seeds
from fastcontact.mesh.generate._spacing import Spacing

Array = NDArray[np.float64]
Numbers = NDArray[np.intp]

# Inner points stand closer than the longest edge allowed, since no triangulation has all its edges equal: fractions of it to
# try one after the other, and the smallest angle [degrees] with which an attempt, or a better one before, is accepted.
_ATTEMPTS = ((0.84, 35.0), (0.82, 35.0), (0.80, 33.0), (0.78, 31.0), (0.75, 29.0), (0.70, 20.0))
_ROUNDS = 8  # of adding points where edges are too long
_AROUND = 3.0  # edge lengths from an added point within which points move


def triangulated(outline: Array, spacing: Spacing) -> tuple[Array, Numbers]:
    """Return points (n_points, 2) [length] and triangles (n_triangles, 3), counter-clockwise, that fill a convex polygon.

    The corners of the `outline` (n, 2) [length], counter-clockwise, become the first n points, and no other point lies on it.
    `spacing` gives the longest edge allowed, at the middle of each inner edge.

    Raises
    ------
    MeshError
        If no well-shaped triangulation with edges that short is found.
    """
    best, best_angle = None, 0.0
    for density, good_angle in _ATTEMPTS:
        points = _attempt(outline, spacing, density)
        angle = 0.0 if points is None else smallest_angle(points, delaunay(points))
        if angle > best_angle:
            best, best_angle = points, angle
        if best is not None and best_angle >= good_angle:
            return best, _checked(delaunay(best), len(best), len(outline))
    raise MeshError(
        f"no triangulation with edges up to {spacing.near:g} at the pole and {spacing.far:g} far from it "
        "was found: change a size a little, or let it grow over a longer distance"
    )


def smallest_angle(points: Array, triangles: Numbers) -> float:
    """Return the smallest angle [degrees] of `triangles` (n_triangles, 3) on `points` (n, 2) [length]."""
    ahead = points[np.roll(triangles, -1, axis=1)] - points[triangles]
    behind = points[np.roll(triangles, 1, axis=1)] - points[triangles]
    cross = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    return float(np.degrees(np.arctan2(cross, (ahead * behind).sum(axis=-1)).min()))


def _attempt(outline: Array, spacing: Spacing, density: float) -> Array | None:
    """Points of a triangulation whose edges are short enough, or None."""
    from scipy.spatial import cKDTree

    n_fixed = len(outline)
    points = np.vstack([outline, inner_seeds(outline, spacing, density)])
    movable = np.arange(len(points)) >= n_fixed
    points = relax(points, movable, spacing, 40)
    for _ in range(_ROUNDS):
        points = polish(points, movable, spacing, 20)
        added = _middles_of_long_edges(points, n_fixed, spacing)
        if not len(added):
            return points
        points = np.vstack([points, added])
        movable = np.arange(len(points)) >= n_fixed
        # Only around the new points: elsewhere a good place was found already.
        near = cKDTree(added).query(points)[0] < _AROUND * spacing(points)
        points = relax(points, movable & near, spacing, 16)
    return None


def _middles_of_long_edges(points: Array, n_fixed: int, spacing: Spacing) -> Array:
    """Middle points (m, 2) of the edges that are too long, the longest only at each point."""
    edges = edges_of(delaunay(points))
    # Sides of the outline are as long as they are, but a chord that cuts a corner off counts.
    side = np.isin(edges[:, 1] - edges[:, 0], (1, n_fixed - 1)) & (edges[:, 1] < n_fixed)
    edges = edges[~side]
    middles = points[edges].mean(axis=1)
    sides = points[edges[:, 0]] - points[edges[:, 1]]
    ratio = np.hypot(sides[:, 0], sides[:, 1]) / spacing(middles)
    long = ratio > 1.0 + 1e-9
    worst = np.zeros(len(points))
    np.maximum.at(worst, edges[long].ravel(), np.repeat(ratio[long], 2))
    return middles[long & (ratio >= worst[edges].max(axis=1))]


def _checked(triangles: Numbers, n_points: int, n_outline: int) -> Numbers:
    """Return the triangles if they fill the polygon: Euler's formula counts 2 n_points - 2 - n_outline of them."""
    expected = 2 * n_points - 2 - n_outline
    if len(triangles) != expected:
        raise MeshError(f"the triangulation has {len(triangles)} triangles where {expected} fill the outline")
    return triangles
