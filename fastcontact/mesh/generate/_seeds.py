"""First guess of the inner points of a convex outline; their triangles are nearly equilateral."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact.mesh.generate._check import affordable
from fastcontact.mesh.generate._spacing import Spacing

Array = NDArray[np.float64]

_ROW = np.sqrt(3.0) / 2  # height of an equilateral triangle
_CLEAR = 0.6  # seeds stay this many edge lengths off the outline


def inner_seeds(outline: Array, spacing: Spacing, density: float) -> Array:
    """Return points (m, 2) [length] inside a convex `outline` (n, 2) [length], about ``density * spacing`` apart."""
    from scipy.spatial import cKDTree

    low, high = outline.min(axis=0), outline.max(axis=0)
    field = _lattice(spacing, density, low, high) if spacing.uniform else _rings(spacing, density, low, high)
    corners = _apart(_corner_seeds(outline, spacing, density), outline, spacing, density)
    size = density * spacing(field)
    inside = field[_depth(outline, field) > _CLEAR * size]
    if not len(corners):
        return inside
    free = cKDTree(corners).query(inside)[0] > 0.7 * density * spacing(inside)
    return np.vstack([corners, inside[free]])


def _apart(seeds: Array, outline: Array, spacing: Spacing, density: float) -> Array:
    """Return the seeds (m, 2) far enough from the outline and from the seeds before them, where a body is narrow."""
    kept: list[Array] = []
    for seed, depth, size in zip(seeds, _depth(outline, seeds), density * spacing(seeds), strict=True):
        if depth > 0.4 * size and all(np.hypot(*(seed - other)) > 0.7 * size for other in kept):
            kept.append(seed)
    return np.array(kept).reshape(-1, 2)


def _depth(outline: Array, points: Array) -> Array:
    """Distance (m,) of the points to the nearest side of the convex polygon, negative outside [length]."""
    sides = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([-sides[:, 1], sides[:, 0]]) / np.hypot(sides[:, 0], sides[:, 1])[:, None]
    offsets = (normals * outline).sum(axis=1)
    depth = np.full(len(points), np.inf)
    for normal, offset in zip(normals, offsets, strict=True):
        np.minimum(depth, points @ normal - offset, out=depth)
    return depth


def _corner_seeds(outline: Array, spacing: Spacing, density: float) -> Array:
    """One point on the bisector of each corner of about 90 degrees, so that its angle is halved, not cut off."""
    ahead = np.roll(outline, -1, axis=0) - outline
    behind = np.roll(outline, 1, axis=0) - outline
    ahead /= np.hypot(ahead[:, 0], ahead[:, 1])[:, None]
    behind /= np.hypot(behind[:, 0], behind[:, 1])[:, None]
    square = np.abs((ahead * behind).sum(axis=1)) < 0.3
    bisector = (ahead + behind)[square]
    bisector /= np.hypot(bisector[:, 0], bisector[:, 1])[:, None]
    corner = outline[square]
    return corner + 0.8 * density * spacing(corner)[:, None] * bisector


def _lattice(spacing: Spacing, density: float, low: Array, high: Array) -> Array:
    """Equilateral lattice over the box, one row through the pole."""
    size = density * spacing.far
    pole = np.asarray(spacing.pole)
    rows = np.arange(np.floor((low[1] - pole[1]) / (_ROW * size)), np.ceil((high[1] - pole[1]) / (_ROW * size)) + 1)
    columns = np.arange(np.floor((low[0] - pole[0]) / size) - 1, np.ceil((high[0] - pole[0]) / size) + 1)
    affordable(2.0 * len(rows) * len(columns))
    row, column = np.meshgrid(rows, columns, indexing="ij")
    x = pole[0] + size * (column + 0.5 * (row % 2))
    return np.column_stack([x.ravel(), (pole[1] + _ROW * size * row).ravel()])


def _rings(spacing: Spacing, density: float, low: Array, high: Array) -> Array:
    """Circles around the pole, their distance and the distance of points on them after the spacing.

    Where the spacing grows in proportion to the distance from the pole this is an equilateral lattice under the
    conformal map exp, so the triangles stay equilateral.
    """
    pole = np.asarray(spacing.pole)
    corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]) - pole
    farthest = np.hypot(corners[:, 0], corners[:, 1]).max()
    rings, radius, shift, total = [], 0.0, 0.0, 0
    while radius < farthest:
        size = density * float(spacing.at_distance(radius))
        radius += _ROW * size
        n = max(6, round(2 * np.pi * radius / size))
        total += n
        affordable(2.0 * total)
        angle = 2 * np.pi * (np.arange(n) + shift) / n - 0.5 * np.pi
        rings.append(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        shift = 0.5 - shift
    return pole + np.vstack(rings)
