"""Structured blocks between four curved sides."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.mesh.generate._check import affordable
from fastcontact.mesh.mesh import Mesh

SIDES = ("BOTTOM", "RIGHT", "TOP", "LEFT")


def rectangular(x: Array, y: Array) -> Array:
    """Return the grid (n + 1, m + 1, 2) [length] of the coordinates `x` (n + 1,) [length] and `y` (m + 1,) [length]."""
    affordable(len(x) * len(y))
    return np.stack(np.meshgrid(x, y, indexing="ij"), axis=2)


def transfinite(bottom: Array, right: Array, top: Array, left: Array, u: Array, v: Array) -> Array:
    """Return the grid (n + 1, m + 1, 2) [length] between four sides by bilinear blending; it has exactly their nodes.

    It is the bilinearly blended Coons patch (W. J. Gordon and C. A. Hall, Int. J. Numer. Meth. Engng 7, 1973, eq. 6). The
    sides are `bottom` (n + 1, 2) [length] and `top` (n + 1, 2) [length], with the relative abscissae `u` (n + 1,) [-] of
    their nodes from 0 to 1, and `right` (m + 1, 2) [length] and `left` (m + 1, 2) [length], with `v` (m + 1,) [-].
    """
    affordable(len(u) * len(v))
    U, V = u[:, None, None], v[None, :, None]
    between_rows = (1 - V) * bottom[:, None] + V * top[:, None]
    between_columns = (1 - U) * left[None] + U * right[None]
    corners = (1 - U) * ((1 - V) * bottom[0] + V * top[0]) + U * ((1 - V) * bottom[-1] + V * top[-1])
    grid = between_rows + between_columns - corners
    grid[:, 0], grid[:, -1], grid[0], grid[-1] = bottom, top, left, right
    return grid


def structured(grid: Array, solid: str, sides: Mapping[str, str], triangles: bool = False) -> Mesh:
    """Return the linear mesh of a grid, its cells in the group `solid`.

    The `grid` (n + 1, m + 1, 2) [length] is right-handed: the first index runs to the right, the second up. `sides` maps
    BOTTOM, RIGHT, TOP, LEFT to names of groups of lines; with `triangles`, each quadrangle is divided in two along
    alternating diagonals.
    """
    n, m = grid.shape[0] - 1, grid.shape[1] - 1
    numbers = np.arange((n + 1) * (m + 1)).reshape(n + 1, m + 1)
    quads = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], axis=2)
    name, block = ("tri3", _cut(quads)) if triangles else ("quad4", quads.reshape(-1, 4))
    nodes = {"BOTTOM": numbers[:, 0], "RIGHT": numbers[-1], "TOP": numbers[::-1, -1], "LEFT": numbers[0, ::-1]}
    lines = {side: np.column_stack([nodes[side][:-1], nodes[side][1:]]) for side in sides}
    mesh = Mesh(grid.reshape(-1, 2), {name: block}, {solid: np.arange(len(block))})
    return mesh.with_facets({group: {"line2": lines[side]} for side, group in sides.items()})


def _cut(quads: Indices) -> Indices:
    """Return the triangles (2 n m, 3) into which diagonals divide quadrangles (n, m, 4), alternating like a chessboard."""
    i, j = np.indices(quads.shape[:2])
    rising = quads[..., [[0, 1, 2], [0, 2, 3]]]
    falling = quads[..., [[0, 1, 3], [1, 2, 3]]]
    return np.where(((i + j) % 2 == 0)[..., None, None], rising, falling).reshape(-1, 3)
