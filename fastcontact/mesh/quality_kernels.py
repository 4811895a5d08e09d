# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Jacobian determinants at the quadrature points of solid cells, and the longest edges, to detect poorly shaped cells."""

import numpy as np

from fastcontact._jit.decorators import interpretable_kernel, kernel
from fastcontact.mesh.jacobian_kernels import jacobian_2d, jacobian_3d, transposed


@kernel
def _determinant_2d(x, slopes, q):
    """Return det J of a cell with nodes x (2, n_nodes) at point q.

    `slopes` (n_q, 2, n_nodes) are the derivatives of the shape functions.
    """
    j00, j01, j10, j11 = jacobian_2d(x, slopes, q)
    return j00 * j11 - j01 * j10


@kernel
def _determinant_3d(x, slopes, q):
    """Return det J of a cell with nodes x (3, n_nodes) at point q.

    `slopes` (n_q, 3, n_nodes) are the derivatives of the shape functions.
    """
    j00, j01, j02, j10, j11, j12, j20, j21, j22 = jacobian_3d(x, slopes, q)
    return j00 * (j11 * j22 - j12 * j21) + j01 * (j12 * j20 - j10 * j22) + j02 * (j10 * j21 - j11 * j20)


@interpretable_kernel
def extremes(points, cells, dN, weights, edges, min_det, max_det, measure, longest):
    """Fill the smallest and largest det J, the area or volume, and the longest edge of each cell, all (n_cells,).

    Parameters
    ----------
    points : (n_points, dim)
        Coordinates of the points.
    cells : (n_cells, n_nodes)
        Connectivity of the cells.
    dN : (n_q, n_nodes, dim)
        Derivatives of the shape functions at the quadrature points.
    weights : (n_q,)
        Weights of the quadrature points.
    edges : (n_edges, 2)
        Local end nodes of the edges, which are treated as straight.
    min_det, max_det, measure, longest : (n_cells,)
        Smallest and largest det J, area or volume, and longest edge.
    """
    n_q, n_nodes, dim = dN.shape
    slopes, x = transposed(dN), np.empty((dim, n_nodes))
    for c in range(cells.shape[0]):
        for a in range(n_nodes):
            for i in range(dim):
                x[i, a] = points[cells[c, a], i]
        smallest, largest, total = np.inf, -np.inf, 0.0
        for q in range(n_q):
            det = _determinant_2d(x, slopes, q) if dim == 2 else _determinant_3d(x, slopes, q)
            smallest, largest = min(smallest, det), max(largest, det)
            total += weights[q] * det
        min_det[c], max_det[c], measure[c] = smallest, largest, total
        largest_square = 0.0
        for e in range(edges.shape[0]):
            length_squared = 0.0
            for i in range(dim):
                component = x[i, edges[e, 1]] - x[i, edges[e, 0]]
                length_squared += component * component
            largest_square = max(largest_square, length_squared)
        longest[c] = np.sqrt(largest_square)
