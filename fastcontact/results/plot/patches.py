"""Cells in the plane, filled by a field and outlined; sides and fields of quadratic ones are curved."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fastcontact.arrays import AnyArray, Array
from fastcontact.contact.search.facet_tables import flat_triangles
from fastcontact.mesh import elements

# Number of subdivisions of each side of a cell, to show curved sides and nonlinear fields.
CUTS = 4
# Number of cells above which this would be invisible.
FEW = 5000


def fill(
    ax: Any, blocks: Mapping[str, AnyArray], points: Array, values: Array, colours: str, ends: tuple[float, float]
) -> Any:
    """Fill cells by their shape functions; return the artist with the colours.

    Parameters
    ----------
    ax : matplotlib Axes
    blocks : mapping of str to ndarray of int (n_cells, n_nodes)
        Cells by element type.
    points : ndarray (n_points, 2)
        [length]
    values : ndarray (n_points,)
        Values in any unit.
    colours : str
        Name of the colours.
    ends : (float, float)
        Values of the first and the last colour, in the unit of `values`.
    """
    from matplotlib.tri import Triangulation

    few = sum(map(len, blocks.values())) <= FEW
    places, heights, triangles, start = [], [], [], 0
    for name, cells in blocks.items():
        xi, pieces = _lattice(name) if few and name != "tri3" else (None, flat_triangles(cells.shape[1]))
        shape = elements.get(name).shape(xi) if xi is not None else np.eye(cells.shape[1])
        places.append(np.einsum("ps,nsd->npd", shape, points[cells]).reshape(-1, 2))
        heights.append((values[cells] @ shape.T).ravel())
        triangles.append((start + len(shape) * np.arange(len(cells))[:, None, None] + pieces).reshape(-1, 3))
        start += len(shape) * len(cells)
    x, y = np.concatenate(places).T
    return ax.tripcolor(
        Triangulation(x, y, np.concatenate(triangles)), np.concatenate(heights), shading="gouraud", cmap=colours,
        vmin=ends[0], vmax=ends[1],
    )  # fmt: skip


def outlines(name: str, corners: Array) -> Array:
    """Return cells (n, n_nodes, 2) of an element as polygons (n, m, 2) along their sides, curved ones subdivided."""
    kind = elements.get(name)
    if kind.order == 1:
        return corners[:, : kind.n_corners]
    line = elements.get("line3").shape(np.linspace(-1.0, 1.0, CUTS, endpoint=False)[:, None])
    return np.concatenate([np.einsum("ps,nsd->npd", line, corners[:, list(side)]) for side in kind.facets], axis=1)


def _lattice(name: str) -> tuple[Array, AnyArray]:
    """Return a lattice of reference coordinates (n, 2) in a cell, and the triangles (m, 3) between them."""
    corner = elements.get(name).n_corners == 3
    last = CUTS if corner else 2 * CUTS
    places = [(i, j) for i in range(CUTS + 1) for j in range(CUTS + 1) if i + j <= last]
    number = {lattice_point: k for k, lattice_point in enumerate(places)}
    squares = [(i, j) for i in range(CUTS) for j in range(CUTS)]
    xi = np.array(places, float) / CUTS
    lower = [(i, j) for i, j in squares if not corner or i + j < CUTS]
    upper = [(i, j) for i, j in squares if not corner or i + j < CUTS - 1]
    pieces = [[number[i, j], number[i + 1, j], number[i, j + 1]] for i, j in lower]
    pieces += [[number[i + 1, j], number[i + 1, j + 1], number[i, j + 1]] for i, j in upper]
    return (xi if corner else 2.0 * xi - 1.0), np.array(pieces)
