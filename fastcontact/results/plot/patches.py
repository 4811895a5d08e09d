"""Drawing of plane cells with the colours of a field, and their outlines, with curved sides of quadratic cells."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact.arrays import AnyArray, Array
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles

# Number of subdivisions of each side of a cell, for curved sides and for fields that are not linear within the cell.
CUTS = 4
# Largest number of cells that are subdivided. With more cells, subdivisions would not be visible.
MOST_SUBDIVIDED = 5000


def fill(
    ax: Any, blocks: Mapping[str, AnyArray], points: Array, values: Array, colours: str, limits: tuple[float, float]
) -> Any:
    """Fill cells with the colours of a field that is interpolated by their shape functions.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Axes of the plot.
    blocks : mapping of str to ndarray of int (n_cells, n_nodes)
        Cells by element type.
    points : ndarray (n_points, 2)
        Positions of the points [length].
    values : ndarray (n_points,)
        Values of the field [any unit].
    colours : str
        Name of the colour map.
    limits : (float, float)
        Values of the first and the last colour [unit of `values`].

    Returns
    -------
    matplotlib artist
        Artist for a colour bar.
    """
    subdivided = sum(map(len, blocks.values())) <= MOST_SUBDIVIDED
    positions, interpolated, triangles, start = [], [], [], 0
    for name, cells in blocks.items():
        shape, pieces = np.eye(cells.shape[1]), flat_triangles(cells.shape[1])
        if subdivided and name != "tri3":
            kind = elements.get(name)
            xi, pieces = lattice(kind.n_corners == 3, CUTS)
            shape = kind.shape(xi if kind.n_corners == 3 else 2.0 * xi - 1.0)
        positions.append(np.einsum("ps,nsd->npd", shape, points[cells]).reshape(-1, 2))
        interpolated.append((values[cells] @ shape.T).ravel())
        triangles.append((start + len(shape) * np.arange(len(cells))[:, None, None] + pieces).reshape(-1, 3))
        start += len(shape) * len(cells)
    x, values = np.concatenate(positions), np.concatenate(interpolated)
    return fill_triangles(ax, x, np.concatenate(triangles), values, colours, limits)


def fill_triangles(
    ax: Any, points: Array, triangles: AnyArray, values: Array, colours: str, limits: tuple[float, float]
) -> Any:
    """Fill triangles (m, 3) between `points` (n, 2) with linearly interpolated `values` (n,); see `fill`."""
    from matplotlib.tri import Triangulation

    mesh = Triangulation(points[:, 0], points[:, 1], triangles)
    return ax.tripcolor(mesh, values, shading="gouraud", cmap=colours, vmin=limits[0], vmax=limits[1])


def outlines(name: str, corners: Array) -> Array:
    """Return the outlines (n, m, 2) of cells (n, n_nodes, 2) as polygons, in which curved sides are subdivided [length]."""
    kind = elements.get(name)
    if kind.order == 1:
        return corners[:, : kind.n_corners]
    line = elements.get("line3").shape(np.linspace(-1.0, 1.0, CUTS, endpoint=False)[:, None])
    return np.concatenate([np.einsum("ps,nsd->npd", line, corners[:, list(side)]) for side in kind.facets], axis=1)


def lattice(triangle: bool, n: int) -> tuple[Array, AnyArray]:
    """Return points (k, 2) [-] and triangles (m, 3) that divide the unit triangle or square, with `n` intervals per side."""
    points = [(i, j) for i in range(n + 1) for j in range(n + 1) if not triangle or i + j <= n]
    number = {point: k for k, point in enumerate(points)}
    squares = [((i, j), (i + 1, j), (i, j + 1), (i + 1, j + 1)) for i in range(n) for j in range(n)]
    pieces = [(a, b, c) for a, b, c, _ in squares] + [(b, d, c) for _, b, c, d in squares]
    triangles = [[number[point] for point in piece] for piece in pieces if number.keys() >= {*piece}]
    return np.array(points, float) / n, np.array(triangles)


def triangles_of(points: Array, facets: AnyArray) -> Array:
    """Return flat triangles (n, 3, dim) [length] that represent facets with `points` (n_points, dim) [length]."""
    return points[facets][:, flat_triangles(facets.shape[1])].reshape(-1, 3, points.shape[1])
