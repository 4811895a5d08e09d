"""Rotations of solid cells at one place of each: half the curl of the displacement."""

import numpy as np

from fastcontact._jit import kernel


@kernel
def _slopes(values, cells, c, dN, out):
    """Fill `out` (dim, dim) with the derivatives of `values` (n_points, dim) along the cell: component, direction."""
    for i in range(out.shape[0]):
        for k in range(out.shape[1]):
            total = 0.0
            for a in range(cells.shape[1]):
                total += values[cells[c, a], i] * dN[a, k]
            out[i, k] = total


@kernel
def _square_2d(x, u):
    """Return the square of the rotation, given the derivatives of position and displacement along the cell (2, 2)."""
    det = x[0, 0] * x[1, 1] - x[0, 1] * x[1, 0]
    uy = u[0, 1] * x[0, 0] - u[0, 0] * x[0, 1]
    vx = u[1, 0] * x[1, 1] - u[1, 1] * x[1, 0]
    return (0.5 * (vx - uy) / det) ** 2


@kernel
def _square_3d(x, u, inverse):
    """Return the square of the rotation, given the derivatives of position and displacement along the cell (3, 3)."""
    for k in range(3):
        for i in range(3):
            p, q, r, s = (k + 1) % 3, (k + 2) % 3, (i + 1) % 3, (i + 2) % 3
            inverse[k, i] = x[r, p] * x[s, q] - x[r, q] * x[s, p]
    det = x[0, 0] * inverse[0, 0] + x[0, 1] * inverse[1, 0] + x[0, 2] * inverse[2, 0]
    square = 0.0
    for i in range(3):
        for j in range(i):
            skew = 0.0
            for k in range(3):
                skew += u[i, k] * inverse[k, j] - u[j, k] * inverse[k, i]
            square += (0.5 * skew / det) ** 2
    return square


@kernel
def largest(points, displacement, cells, dN):
    """Return the square of the largest rotation of a cell, and its number: -1 where no cell rotates.

    Parameters
    ----------
    points, displacement : (n_points, dim)
    cells : (n_cells, n_nodes)
    dN : (n_nodes, dim)
        Shape derivatives at the place, the same in every cell.
    """
    dim = points.shape[1]
    x, u, inverse = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim, dim))
    most, number = 0.0, -1
    for c in range(cells.shape[0]):
        _slopes(points, cells, c, dN, x)
        _slopes(displacement, cells, c, dN, u)
        square = _square_2d(x, u) if dim == 2 else _square_3d(x, u, inverse)
        if square > most:
            most, number = square, c
    return most, number
