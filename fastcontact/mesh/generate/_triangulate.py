"""Triangulation of bodies with a convex outline of named sides, without random numbers.

Edges are at most as long as a size function prescribes. The initial inner points form a lattice, or rings about the pole.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh.generate._check import affordable
from fastcontact.mesh.generate._spacing import Spacing
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import corner_angles

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
        angle = 0.0 if points is None else np.degrees(corner_angles(points[delaunay(points)]).min())
        if angle > best_angle:
            best, best_angle = points, angle
        if best is not None and best_angle >= good_angle:
            return best, _checked(delaunay(best), len(best), len(outline))
    raise MeshError(
        f"no triangulation with edges up to {spacing.near:g} at the pole and {spacing.far:g} far from it "
        "was found: change a size slightly, or let it grow over a longer distance"
    )


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
    rows = np.arange(np.floor(low[1] / (_ROW_HEIGHT * size)), np.ceil(high[1] / (_ROW_HEIGHT * size)) + 1)
    columns = np.arange(np.floor(low[0] / size) - 1, np.ceil(high[0] / size) + 1)
    affordable(2.0 * len(rows) * len(columns))
    row, column = np.meshgrid(rows, columns, indexing="ij")
    return np.column_stack([(size * (column + 0.5 * (row % 2))).ravel(), (_ROW_HEIGHT * size * row).ravel()])


def _rings(spacing: Spacing, density: float, low: Array, high: Array) -> Array:
    """Return points on circles around the pole, with radial and circumferential distances by the spacing.

    If the spacing is proportional to the distance from the pole this is an equilateral lattice under the conformal map exp,
    so that the triangles stay equilateral.
    """
    farthest = max(np.hypot(x, y) for x in (low[0], high[0]) for y in (low[1], high[1]))
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
    return np.vstack(rings)


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
