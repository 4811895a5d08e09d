"""Triangulation of bodies with a convex outline of named sides, without random numbers.

Edges are at most as long as a size function prescribes. The initial inner points form a lattice, or rings about the pole.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array, Indices
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import affordable
from fastcontact.mesh.generate._smooth import delaunay, edges_of, polish, relax
from fastcontact.mesh.generate._spacing import Spacing
from fastcontact.mesh.mesh import Mesh

# Since no triangulation has equal edges, inner points are placed at a fraction of the longest admissible edge. Attempts with
# these fractions are made in turn until the best one so far has no angle below the second number [degrees].
_ATTEMPTS = ((0.84, 35.0), (0.82, 35.0), (0.80, 33.0), (0.78, 31.0), (0.75, 29.0), (0.70, 20.0))
_ROUNDS = 8  # number of passes that add points where edges are too long
_MOVING_RADIUS = 3.0  # distance from an added point, in edge lengths, within which points move
_ROW_HEIGHT = np.sqrt(3.0) / 2  # height of an equilateral triangle
_CLEARANCE = 0.6  # smallest distance of seeds from the outline, in edge lengths


def filled(solid: str, sides: Sequence[tuple[str, Array]], spacing: Spacing) -> Mesh:
    """Return a triangle mesh of a convex body, its cells in the group `solid`.

    The `sides` (n, 2) [length], each given by a name and its nodes, run counter-clockwise, each from the end of the previous
    one. `spacing` defines the longest inner edges.
    """
    outline = np.vstack([nodes[:-1] for _, nodes in sides])
    points, triangles = triangulated(outline, spacing)
    starts = np.arange(len(outline))
    lines = np.column_stack([starts, np.roll(starts, -1)])
    ends = np.cumsum([len(nodes) - 1 for _, nodes in sides])
    mesh = Mesh(points, {"tri3": triangles}, {solid: np.arange(len(triangles))})
    of_sides = zip(sides, np.split(lines, ends[:-1]), strict=True)
    return mesh.with_facets({name: {"line2": block} for (name, _), block in of_sides})


def triangulated(outline: Array, spacing: Spacing) -> tuple[Array, Indices]:
    """Return points (n_points, 2) [length] and triangles (n_triangles, 3), counter-clockwise, that fill a convex polygon.

    The corners of the `outline` (n, 2) [length], counter-clockwise, are the first n points, and no other point lies on it.
    `spacing` defines the longest admissible edge, at the middle of each inner edge. Raises MeshError if no well-shaped
    triangulation with such edges is found.
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
        "was found: change a size slightly, or let it grow over a longer distance"
    )


def smallest_angle(points: Array, triangles: Indices) -> float:
    """Return the smallest angle [degrees] of `triangles` (n_triangles, 3) on `points` (n, 2) [length]."""
    ahead = points[np.roll(triangles, -1, axis=1)] - points[triangles]
    behind = points[np.roll(triangles, 1, axis=1)] - points[triangles]
    cross = ahead[..., 0] * behind[..., 1] - ahead[..., 1] * behind[..., 0]
    return float(np.degrees(np.arctan2(cross, (ahead * behind).sum(axis=-1)).min()))


def _attempt(outline: Array, spacing: Spacing, density: float) -> Array | None:
    """Return the points of a triangulation whose edges are short enough, or None."""
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
        # Only points around the new ones are relaxed; the positions of the others are already good.
        near = nearest(added, points)[0] < _MOVING_RADIUS * spacing(points)
        points = relax(points, movable & near, spacing, 16)
    return None


def _middles_of_long_edges(points: Array, n_fixed: int, spacing: Spacing) -> Array:
    """Return the middle points (m, 2) of edges that are too long; at each point only the longest counts."""
    edges = edges_of(delaunay(points))
    # Sides of the outline are excluded, but not chords that cut off a corner.
    side = np.isin(edges[:, 1] - edges[:, 0], (1, n_fixed - 1)) & (edges[:, 1] < n_fixed)
    edges = edges[~side]
    middles = points[edges].mean(axis=1)
    sides = points[edges[:, 0]] - points[edges[:, 1]]
    ratio = np.hypot(sides[:, 0], sides[:, 1]) / spacing(middles)
    long = ratio > 1.0 + 1e-9
    worst = np.zeros(len(points))
    np.maximum.at(worst, edges[long].ravel(), np.repeat(ratio[long], 2))
    return middles[long & (ratio >= worst[edges].max(axis=1))]


def _checked(triangles: Indices, n_points: int, n_outline: int) -> Indices:
    """Return the triangles if they fill the polygon: by Euler's formula there are 2 n_points - 2 - n_outline."""
    expected = 2 * n_points - 2 - n_outline
    if len(triangles) != expected:
        raise MeshError(
            f"the triangulation has {len(triangles)} triangles, but {expected} are needed to fill the outline"
        )
    return triangles


def inner_seeds(outline: Array, spacing: Spacing, density: float) -> Array:
    """Return points (m, 2) [length] inside a convex `outline` (n, 2) [length], about ``density * spacing`` apart."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    field = _lattice(spacing, density, low, high) if spacing.uniform else _rings(spacing, density, low, high)
    corners = _spaced(_corner_seeds(outline, spacing, density), outline, spacing, density)
    size = density * spacing(field)
    inside = field[_depth(outline, field) > _CLEARANCE * size]
    if not len(corners):
        return inside
    free = nearest(corners, inside)[0] > 0.7 * density * spacing(inside)
    return np.vstack([corners, inside[free]])


def _spaced(seeds: Array, outline: Array, spacing: Spacing, density: float) -> Array:
    """Return the seeds (m, 2) far enough from the outline and from earlier seeds, where a body is narrow."""
    accepted: list[Array] = []
    for seed, depth, size in zip(seeds, _depth(outline, seeds), density * spacing(seeds), strict=True):
        if depth > 0.4 * size and all(np.hypot(*(seed - other)) > 0.7 * size for other in accepted):
            accepted.append(seed)
    return np.array(accepted).reshape(-1, 2)


def _depth(outline: Array, points: Array) -> Array:
    """Return the distances (m,) of the points to the nearest side of the convex polygon, negative outside [length]."""
    sides = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([-sides[:, 1], sides[:, 0]]) / np.hypot(sides[:, 0], sides[:, 1])[:, None]
    offsets = (normals * outline).sum(axis=1)
    depth = np.full(len(points), np.inf)
    for normal, offset in zip(normals, offsets, strict=True):
        np.minimum(depth, points @ normal - offset, out=depth)
    return depth


def _corner_seeds(outline: Array, spacing: Spacing, density: float) -> Array:
    """Return a point on the bisector of each corner of about 90 degrees, so that an edge halves the angle of the corner."""
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
    """Return an equilateral lattice over the box, with one row through the pole."""
    size = density * spacing.far
    pole = np.asarray(spacing.pole)
    rows = np.arange(
        np.floor((low[1] - pole[1]) / (_ROW_HEIGHT * size)), np.ceil((high[1] - pole[1]) / (_ROW_HEIGHT * size)) + 1
    )
    columns = np.arange(np.floor((low[0] - pole[0]) / size) - 1, np.ceil((high[0] - pole[0]) / size) + 1)
    affordable(2.0 * len(rows) * len(columns))
    row, column = np.meshgrid(rows, columns, indexing="ij")
    x = pole[0] + size * (column + 0.5 * (row % 2))
    return np.column_stack([x.ravel(), (pole[1] + _ROW_HEIGHT * size * row).ravel()])


def _rings(spacing: Spacing, density: float, low: Array, high: Array) -> Array:
    """Return points on circles around the pole, with radial and circumferential distances by the spacing.

    If the spacing is proportional to the distance from the pole this is an equilateral lattice under the conformal map exp,
    so that the triangles stay equilateral.
    """
    pole = np.asarray(spacing.pole)
    corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]) - pole
    farthest = np.hypot(corners[:, 0], corners[:, 1]).max()
    rings, radius, shift, total = [], 0.0, 0.0, 0
    while radius < farthest:
        size = density * float(spacing.at_distance(radius))
        radius += _ROW_HEIGHT * size
        n = max(6, round(2 * np.pi * radius / size))
        total += n
        affordable(2.0 * total)
        angle = 2 * np.pi * (np.arange(n) + shift) / n - 0.5 * np.pi
        rings.append(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        shift = 0.5 - shift
    return pole + np.vstack(rings)
