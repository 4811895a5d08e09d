"""Deterministic triangulation of bodies with a convex outline of named sides.

The longest admissible edges are prescribed by a function. The initial inner points form a lattice, or rings about the pole.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import check_size
from fastcontact.mesh.generate._spacing import Spacing
from fastcontact.mesh.generate.quadratic import ends_of, unique_edges
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import corner_angles

# Since the edges of a triangulation differ, the distance of inner points is a fraction of the longest admissible edge. These
# fractions are tried in turn until the smallest angle of the best triangulation so far reaches the second number [degrees].
_ATTEMPTS = ((0.84, 35.0), (0.82, 35.0), (0.80, 33.0), (0.78, 31.0), (0.75, 29.0), (0.70, 20.0))
_ROUNDS = 8  # number of passes that add points where edges are too long
_MOVING_RADIUS = 3.0  # distance from an added point, in edge lengths, within which points move
_ROW_HEIGHT = np.sqrt(3.0) / 2  # height of an equilateral triangle
_CLEARANCE = 0.6  # smallest distance of seeds from the outline, in edge lengths


def triangulated_body(solid: str, sides: Sequence[tuple[str, Array]], spacing: Spacing) -> Mesh:
    """Return a triangle mesh of a convex body, with all cells in the group `solid`.

    Each of the `sides` (n, 2) [length] consists of a name and its nodes. The sides are in counter-clockwise order, and each
    begins where the previous one ends. `spacing` defines the longest inner edges.
    """
    outline = np.vstack([nodes[:-1] for _, nodes in sides])
    points, triangles = triangulate(outline, spacing)
    starts = np.arange(len(outline))
    lines = np.column_stack([starts, np.roll(starts, -1)])
    ends = np.cumsum([len(nodes) - 1 for _, nodes in sides])
    mesh = Mesh(points, {"tri3": triangles}, {solid: np.arange(len(triangles))})
    named_lines = zip(sides, np.split(lines, ends[:-1]), strict=True)
    return mesh.with_facets({name: {"line2": block} for (name, _), block in named_lines})


def triangulate(outline: Array, spacing: Spacing) -> tuple[Array, Indices]:
    """Return points (n_points, 2) [length] and triangles (n_triangles, 3), counter-clockwise, that fill a convex polygon.

    The corners of the `outline` (n, 2) [length], counter-clockwise, are the first n points, and no other point lies on it.
    `spacing` is the longest admissible length of an inner edge as a function of its midpoint. Raises MeshError if no
    well-shaped triangulation with such edges is found.
    """
    best, best_angle = None, 0.0
    for density, good_angle in _ATTEMPTS:
        points = _attempt(outline, spacing, density)
        angle = 0.0 if points is None else np.degrees(corner_angles(points[delaunay(points)]).min())
        if angle > best_angle:
            best, best_angle = points, angle
        if best is not None and best_angle >= good_angle:
            return best, _check_count(delaunay(best), len(best), len(outline))
    raise MeshError(
        f"no triangulation with edges up to {spacing.near:g} at the pole and {spacing.far:g} far from it "
        "was found: change a size slightly, or let it grow over a longer distance"
    )


def _attempt(outline: Array, spacing: Spacing, density: float) -> Array | None:
    """Return the points of a triangulation with edges of admissible length, or None if there are still longer edges.

    Inner points initially have the distance ``density * spacing``.
    """
    n_fixed = len(outline)
    points = np.vstack([outline, inner_seeds(outline, spacing, density)])
    movable = np.arange(len(points)) >= n_fixed
    points = relax(points, movable, spacing, 40)
    for _ in range(_ROUNDS):
        points = polish(points, movable, spacing, 20)
        midpoints = _midpoints_of_long_edges(points, n_fixed, spacing)
        if not len(midpoints):
            return points
        points = np.vstack([points, midpoints])
        movable = np.arange(len(points)) >= n_fixed
        # Only points near the new ones are relaxed, because the positions of the others are already good.
        is_near = nearest(midpoints, points)[0] < _MOVING_RADIUS * spacing(points)
        points = relax(points, movable & is_near, spacing, 16)
    return None


def _midpoints_of_long_edges(points: Array, n_fixed: int, spacing: Spacing) -> Array:
    """Return the midpoints (m, 2) of edges that are too long.

    Relative to the spacing, each is the longest of all edges at its two ends.
    """
    edges = ends_of(unique_edges({"tri3": delaunay(points)}))
    # Sides of the outline are excluded, but not chords that cut off a corner.
    is_side = np.isin(edges[:, 1] - edges[:, 0], (1, n_fixed - 1)) & (edges[:, 1] < n_fixed)
    edges = edges[~is_side]
    midpoints = points[edges].mean(axis=1)
    sides = points[edges[:, 0]] - points[edges[:, 1]]
    ratio = np.hypot(sides[:, 0], sides[:, 1]) / spacing(midpoints)
    is_long = ratio > 1.0 + 1e-9
    worst = np.zeros(len(points))
    np.maximum.at(worst, edges[is_long].ravel(), np.repeat(ratio[is_long], 2))
    return midpoints[is_long & (ratio >= worst[edges].max(axis=1))]


def _check_count(triangles: Indices, n_points: int, n_outline: int) -> Indices:
    """Return `triangles` unchanged. Raises MeshError unless their number is 2 n_points - 2 - n_outline (Euler's formula)."""
    expected = 2 * n_points - 2 - n_outline
    if len(triangles) != expected:
        raise MeshError(
            f"the triangulation has {len(triangles)} triangles, but {expected} are needed to fill the outline"
        )
    return triangles


def inner_seeds(outline: Array, spacing: Spacing, density: float) -> Array:
    """Return points (m, 2) [length] in a convex `outline` (n, 2) [length] at distances of about ``density * spacing``."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    candidates = _lattice(spacing, density, low, high) if spacing.uniform else _rings(spacing, density, low, high)
    corners = _accepted_seeds(_corner_seeds(outline, spacing, density), outline, spacing, density)
    size = density * spacing(candidates)
    seeds = candidates[_depths(outline, candidates) > _CLEARANCE * size]
    if not len(corners):
        return seeds
    free = nearest(corners, seeds)[0] > 0.7 * density * spacing(seeds)
    return np.vstack([corners, seeds[free]])


def _accepted_seeds(seeds: Array, outline: Array, spacing: Spacing, density: float) -> Array:
    """Return the seeds (m, 2) without those too close to the outline or to earlier seeds, as in narrow bodies."""
    accepted: list[Array] = []
    for seed, depth, size in zip(seeds, _depths(outline, seeds), density * spacing(seeds), strict=True):
        if depth > 0.4 * size and all(np.hypot(*(seed - earlier)) > 0.7 * size for earlier in accepted):
            accepted.append(seed)
    return np.array(accepted).reshape(-1, 2)


def _depths(outline: Array, points: Array) -> Array:
    """Return the distances (m,) of points to the nearest side of a convex polygon, which are negative outside [length]."""
    sides = np.roll(outline, -1, axis=0) - outline
    normals = np.column_stack([-sides[:, 1], sides[:, 0]]) / np.hypot(sides[:, 0], sides[:, 1])[:, None]
    offsets = (normals * outline).sum(axis=1)
    depth = np.full(len(points), np.inf)
    for normal, offset in zip(normals, offsets, strict=True):
        np.minimum(depth, points @ normal - offset, out=depth)
    return depth


def _corner_seeds(outline: Array, spacing: Spacing, density: float) -> Array:
    """Return a point on the bisector of each corner of about 90 degrees, so that an edge halves the angle of the corner."""
    to_next = np.roll(outline, -1, axis=0) - outline
    to_previous = np.roll(outline, 1, axis=0) - outline
    to_next /= np.hypot(to_next[:, 0], to_next[:, 1])[:, None]
    to_previous /= np.hypot(to_previous[:, 0], to_previous[:, 1])[:, None]
    right_angle = np.abs((to_next * to_previous).sum(axis=1)) < 0.3
    bisector = (to_next + to_previous)[right_angle]
    bisector /= np.hypot(bisector[:, 0], bisector[:, 1])[:, None]
    corner = outline[right_angle]
    return corner + 0.8 * density * spacing(corner)[:, None] * bisector


def _lattice(spacing: Spacing, density: float, low: Array, high: Array) -> Array:
    """Return the points of an equilateral lattice over a box, with one row through the pole."""
    size = density * spacing.far
    rows = np.arange(np.floor(low[1] / (_ROW_HEIGHT * size)), np.ceil(high[1] / (_ROW_HEIGHT * size)) + 1)
    columns = np.arange(np.floor(low[0] / size) - 1, np.ceil(high[0] / size) + 1)
    check_size(2.0 * len(rows) * len(columns))
    row, column = np.meshgrid(rows, columns, indexing="ij")
    return np.column_stack([(size * (column + 0.5 * (row % 2))).ravel(), (_ROW_HEIGHT * size * row).ravel()])


def _rings(spacing: Spacing, density: float, low: Array, high: Array) -> Array:
    """Return points on circles around the pole, with radial and circumferential distances according to the spacing.

    If the spacing is proportional to the distance from the pole, the points are the image of an equilateral lattice under the
    conformal map exp, so that the triangles are nearly equilateral.
    """
    farthest = max(np.hypot(x, y) for x in (low[0], high[0]) for y in (low[1], high[1]))
    rings, radius, shift, total = [], 0.0, 0.0, 0
    while radius < farthest:
        size = density * float(spacing.at_distance(radius))
        radius += _ROW_HEIGHT * size
        n = max(6, round(2 * np.pi * radius / size))
        total += n
        check_size(2.0 * total)
        angle = 2 * np.pi * (np.arange(n) + shift) / n - 0.5 * np.pi
        rings.append(radius * np.column_stack([np.cos(angle), np.sin(angle)]))
        shift = 0.5 - shift
    return np.vstack(rings)


Size = Callable[[Array], Array]

_STEPS_PER_TRIANGULATION = 4  # steps of `relax` and sweeps of `polish` with one triangulation
_STEP = 0.2  # pseudo-time of one step of `relax`
_STRETCH = 1.2  # rest length of the bars relative to their scaled length; it exceeds 1 so that the points spread
_DIRECTIONS = np.linspace(0.0, 2 * np.pi, 13)[:-1]
_TRIALS = np.column_stack([np.cos(_DIRECTIONS), np.sin(_DIRECTIONS)])
_TRIALS = np.vstack([_TRIALS, 0.5 * _TRIALS])
_GOOD_SINE = np.sin(np.radians(50.0))  # points around which all angles are larger are not moved
# Penalty of an edge that is too long: a constant, and a term per relative excess of the length, as sines of angles.
_LENGTH_PENALTY = 0.5, 2.0


def delaunay(points: Array) -> Indices:
    """Return the counter-clockwise triangles (n_triangles, 3) of the Delaunay triangulation of `points` (n, 2) [length].

    Triangles of zero area, which collinear points of the convex hull cause by round-off, are left out.
    """
    from scipy.spatial import Delaunay

    triangles = Delaunay(points).simplices.astype(np.intp)
    first, second, third = (points[triangles[:, i]] for i in range(3))
    u, v = second - first, third - first
    twice_area = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    flat = twice_area <= 1e-9 * ((u * u).sum(axis=1) + (v * v).sum(axis=1))
    return triangles[~flat]


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
    """Return points (n, 2) [length] after relaxation by repulsive bars along the edges.

    The bars of a truss push its nodes apart until their lengths follow the function `size` (n,) [length] of positions
    (P.-O. Persson and G. Strang, A simple mesh generator in MATLAB, SIAM Review 46, 2004, section 2). Only those
    `points` (n, 2) [length] move that the mask `movable` (n,) selects, in `steps` steps.
    """
    points = points.copy()
    if not movable.any():
        return points
    for step in range(steps):
        if step % _STEPS_PER_TRIANGULATION == 0:
            edges = ends_of(unique_edges({"tri3": delaunay(points)}))
            edges = edges[movable[edges].any(axis=1)]
            desired = size(points[edges].mean(axis=1))
        points[movable] += _STEP * _bar_forces(points, edges, desired)[movable]
    return points


def _bar_forces(points: Array, edges: Indices, desired: Array) -> Array:
    """Return the sums (n, 2) of the bar forces at the points. Bars that exceed their rest length have no force."""
    bars = points[edges[:, 0]] - points[edges[:, 1]]
    length = np.sqrt((bars * bars).sum(axis=1))
    # The rest lengths are scaled to the actual lengths, so that the pressure is the same everywhere.
    rest_length = _STRETCH * desired * np.sqrt((length**2).sum() / (desired**2).sum())
    force = (np.maximum(rest_length - length, 0.0) / length)[:, None] * bars
    total = np.empty_like(points)
    for axis in range(2):
        total[:, axis] = np.bincount(edges[:, 0], force[:, axis], len(points))
        total[:, axis] -= np.bincount(edges[:, 1], force[:, axis], len(points))
    return total


def polish(points: Array, movable: Mask, limit: Size, sweeps: int) -> Array:
    """Return points (n, 2) [length] that are moved one by one to improve the worst triangle around each of them.

    A trial move is accepted if it increases the smallest angle around the point, with a penalty on edges that are too
    long (smart smoothing after L. Freitag and C. Ollivier-Gooch, Int. J. Numer. Meth. Engng 40, 1997). Points that move
    simultaneously share no edge. Only those `points` (n, 2) [length] move that the mask `movable` (n,) selects, in
    at most `sweeps` sweeps. The function `limit` (n,) [length] of positions returns the longest admissible edge.
    """
    points = points.copy()
    radius, moved = 0.1, True
    for sweep in range(sweeps):
        if sweep % _STEPS_PER_TRIANGULATION == 0:
            if not moved:
                break
            triangles = delaunay(points)
            edges, stars, moved = ends_of(unique_edges({"tri3": triangles})), stars_of(triangles, len(points)), False
        moved |= _sweep(points, movable, edges, stars, limit(points), radius)
        radius *= 0.9
    return points


def _sweep(points: Array, movable: Mask, edges: Indices, stars: Indices, limit: Array, radius: float) -> bool:
    """Try to move every point with a small angle, the worst first, in place, and return whether any point has moved.

    `limit` (n,) are the longest admissible edges at the points, and `radius` is the length of trial moves relative to them.
    """
    quality = np.full(len(points), np.inf)
    quality[movable] = _star_quality(points[movable, None], points, stars[movable], limit[movable])[:, 0]
    quality[quality >= _GOOD_SINE] = np.inf
    moved = False
    for _ in range(6):  # sets of points that share no edge
        neighbours = np.full(len(points), np.inf)
        np.minimum.at(neighbours, edges[:, 0], quality[edges[:, 1]])
        np.minimum.at(neighbours, edges[:, 1], quality[edges[:, 0]])
        selected = np.flatnonzero(quality < neighbours)
        if not len(selected):
            break
        moved |= _try_moves(points, selected, stars, limit, radius)
        quality[selected] = np.inf
    return moved


def _try_moves(points: Array, selected: Indices, stars: Indices, limit: Array, radius: float) -> bool:
    """Move each selected point in place to its best trial position if that is better, and return whether any has moved."""
    trials = points[selected, None] + radius * limit[selected, None, None] * _TRIALS
    positions = np.concatenate([points[selected, None], trials], axis=1)
    best = _star_quality(positions, points, stars[selected], limit[selected]).argmax(axis=1)
    points[selected] = positions[np.arange(len(selected)), best]
    return bool(best.any())


def _star_quality(positions: Array, points: Array, stars: Indices, limit: Array) -> Array:
    """Return the quality (m, k) of the worst triangle around each of m points for its trial positions (m, k, 2)."""
    a, b = points[stars[:, None, :, 0]], points[stars[:, None, :, 1]]
    u, v, w = a - positions[:, :, None], b - positions[:, :, None], b - a
    twice_area = u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0]
    uu, vv, ww = (u * u).sum(axis=-1), (v * v).sum(axis=-1), (w * w).sum(axis=-1)
    # The smallest angle is opposite the shortest side. Its sine is twice the area divided by the product of the other
    # sides.
    shortest = np.minimum(np.minimum(uu, vv), ww)
    sine = twice_area * np.sqrt(shortest / np.maximum(uu * vv * ww, 1e-300))
    excess = np.sqrt(np.maximum(uu, vv)) / limit[:, None, None] - 1.0
    quality = sine - np.where(excess > 0.0, _LENGTH_PENALTY[0] + _LENGTH_PENALTY[1] * excess, 0.0)
    return np.where(stars[:, None, :, 0] >= 0, quality, np.inf).min(axis=-1)
