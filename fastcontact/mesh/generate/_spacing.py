"""Positions of nodes on lines and arcs with segments of given or varying size, and structured blocks between four sides."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.mesh.generate._check import check_size, segments
from fastcontact.mesh.mesh import Mesh

Curve = Callable[[Array], Array]


@dataclass(frozen=True)
class Spacing:
    """Desired edge length as a function of the distance from the pole, which is the origin.

    The length is `near` up to the distance `plateau` from the pole, varies linearly to `far` at `reach`, and is `far` beyond.

    Attributes
    ----------
    near, far : float
        Edge lengths at the pole and far from it [length].
    plateau, reach : float
        Distances from the pole between which the edge length varies [length].
    """

    near: float
    far: float
    plateau: float = 0.0
    reach: float = 1.0

    @property
    def uniform(self) -> bool:
        """Whether the length is the same everywhere."""
        return self.near == self.far

    def at_distance(self, distance: Array | float) -> Array:
        """Return the edge length (...) [length] at `distance` (...) [length] from the pole."""
        ramp = np.clip((np.asarray(distance) - self.plateau) / (self.reach - self.plateau), 0.0, 1.0)
        return self.near + (self.far - self.near) * ramp

    def __call__(self, points: Array) -> Array:
        """Return the desired edge length (n,) [length] at `points` (n, 2) [length]."""
        return self.at_distance(np.hypot(points[:, 0], points[:, 1]))


def segments_for(length: float, size: float) -> int:
    """Return the smallest number of equal segments of a `length` that are not longer than `size` [both length]."""
    return segments(length / size)


def progression(length: float, first: float, last: float) -> Array:
    """Return relative abscissae (n + 1,) [-] from 0 to 1 of segments in geometric progression.

    The n segments of a line of `length` [length] are those of the progression from `first` to `last` [length], multiplied by
    a common factor of at most one; n is the smallest number for which such a factor exists. The ratio of the last segment to
    the first is ``last / first``, unless a single segment suffices. From the sum of a geometric series,
    S = (last q - first) / (q - 1), the ratio of adjacent segments is q = (S - first) / (S - last).
    """
    if first == last:
        return np.linspace(0.0, 1.0, segments_for(length, first) + 1)
    if length <= min(first, last):
        return np.array([0.0, 1.0])
    n = 2
    if length * (1 - 1e-12) > max(first, last):  # otherwise two segments suffice, up to round-off
        # log(last / first) / log(q), without cancellation if the sizes are nearly equal.
        ratios = math.log1p((last - first) / first) / math.log1p((last - first) / (length - last))
        n = 1 + segments(ratios)
    abscissa = np.concatenate([[0.0], np.cumsum(np.geomspace(first, last, n))])
    return abscissa / abscissa[-1]


def divide(curve: Curve, length: float, spacing: Spacing) -> Array:
    """Return points (n + 1, 2) [length] that divide a curve of given `length` [length] into segments according to `spacing`.

    The function `curve` (n, 2) [length] of parameters (n,) [-] from 0 to 1 must have constant speed.
    """
    if spacing.uniform:
        return curve(np.linspace(0.0, 1.0, segments_for(length, spacing.far) + 1))
    # The number of segments is the integral of ds / h, for which each of the smallest segments has 16 samples.
    samples = np.linspace(0.0, 1.0, 16 * segments_for(length, min(spacing.near, spacing.far)) + 1)
    density = length / spacing(curve(0.5 * (samples[:-1] + samples[1:])))
    cumulative = np.concatenate([[0.0], np.cumsum(density * np.diff(samples))])
    n = segments(cumulative[-1])
    parameter = np.interp(np.linspace(0.0, cumulative[-1], n + 1), cumulative, samples)
    parameter[0], parameter[-1] = 0.0, 1.0
    return curve(parameter)


def graded_positions(length: float, spacing: Spacing) -> Array:
    """Return positions (n + 1,) [length] from 0 to `length` [length], graded by a spacing with its pole at 0."""
    return divide(lambda s: np.column_stack([length * s, np.zeros(len(s))]), length, spacing)[:, 0]


def growing_positions(length: float, first: float, growth: float) -> Array:
    """Return positions (n + 1,) [length] from 0 to `length` [length] with distances in geometric progression.

    The first distance is at most `first` [length], and successive distances have the ratio `growth` [-] > 1.
    """
    n = segments(np.log1p(length * (growth - 1.0) / first) / np.log(growth))
    position = np.concatenate([[0.0], np.cumsum(growth ** np.arange(n))])
    return np.asarray(length * position / position[-1])


def straight_side(start: Sequence[float], end: Sequence[float], relative: Array) -> Array:
    """Return points (n, 2) [length] of a straight side at the abscissae `relative` (n,) [-]. The ends are exact."""
    a, b, s = np.asarray(start, float), np.asarray(end, float), relative[:, None]
    return np.where(s < 1.0, a + s * (b - a), b)


def arc(centre: Sequence[float], radius: float, angles: Array) -> Array:
    """Return points (n, 2) [length] of a circle at `angles` (n,) [radian] from its topmost point, clockwise."""
    return np.asarray(centre, float) + radius * np.column_stack([np.sin(angles), np.cos(angles)])


def rectangular_grid(x: Array, y: Array) -> Array:
    """Return the grid (n + 1, m + 1, 2) [length] of the coordinates `x` (n + 1,) [length] and `y` (m + 1,) [length]."""
    check_size(len(x) * len(y))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)


def coons_patch(bottom: Array, right: Array, top: Array, left: Array, u: Array, v: Array) -> Array:
    """Return the grid (n + 1, m + 1, 2) [length] between four sides, whose nodes it contains.

    It is the bilinearly blended Coons patch (W. J. Gordon and C. A. Hall, Int. J. Numer. Meth. Engng 7, 1973, eq. 6). The
    nodes of `bottom` (n + 1, 2) [length] and `top` (n + 1, 2) [length] have the relative abscissae `u` (n + 1,) [-], from 0
    to 1, and those of `right` (m + 1, 2) [length] and `left` (m + 1, 2) [length] have `v` (m + 1,) [-].
    """
    check_size(len(u) * len(v))
    U, V = u[:, None, None], v[None, :, None]
    between_rows = (1 - V) * bottom[:, None] + V * top[:, None]
    between_columns = (1 - U) * left[None] + U * right[None]
    corners = (1 - U) * ((1 - V) * bottom[0] + V * top[0]) + U * ((1 - V) * bottom[-1] + V * top[-1])
    grid = between_rows + between_columns - corners
    grid[:, 0], grid[:, -1], grid[0], grid[-1] = bottom, top, left, right
    return grid


def grid_mesh(grid: Array, solid: str, sides: Mapping[str, str], triangles: bool = False) -> Mesh:
    """Return the linear mesh of a grid, with all cells in the group `solid`.

    The first index of the `grid` (n + 1, m + 1, 2) [length] increases to the right, the second one upward. `sides` maps
    BOTTOM, RIGHT, TOP and LEFT to names of groups of lines. With `triangles`, each quadrangle is divided in two along
    alternating diagonals.
    """
    n, m = grid.shape[0] - 1, grid.shape[1] - 1
    numbers = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    quads = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], axis=2)
    name, block = ("tri3", _triangles(quads)) if triangles else ("quad4", quads.reshape(-1, 4))
    nodes = {"BOTTOM": numbers[:, 0], "RIGHT": numbers[-1], "TOP": numbers[::-1, -1], "LEFT": numbers[0, ::-1]}
    lines = {side: np.column_stack([nodes[side][:-1], nodes[side][1:]]) for side in sides}
    mesh = Mesh(grid.reshape(-1, 2), {name: block}, {solid: np.arange(len(block))})
    return mesh.with_facets({group: {"line2": lines[side]} for side, group in sides.items()})


def _triangles(quads: Indices) -> Indices:
    """Return the triangles (2 n m, 3) into which alternating diagonals divide quadrangles (n, m, 4)."""
    i, j = np.indices(quads.shape[:2])
    rising = quads[..., [[0, 1, 2], [0, 2, 3]]]
    falling = quads[..., [[0, 1, 3], [1, 2, 3]]]
    return np.where(((i + j) % 2 == 0)[..., None, None], rising, falling).reshape(-1, 3)
