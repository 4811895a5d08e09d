# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Jacobian matrices of cells, and gradients of shape functions."""

import numpy as np

from fastcontact._jit.decorators import innermost_kernel, kernel


@kernel
def transposed(dN):
    """Return derivatives (n_q, n_nodes, dim) as (n_q, dim, n_nodes), so that loops over nodes are contiguous."""
    n_q, n_nodes, dim = dN.shape
    out = np.empty((n_q, dim, n_nodes))
    for q in range(n_q):
        for a in range(n_nodes):
            for i in range(dim):
                out[q, i, a] = dN[q, a, i]
    return out


@innermost_kernel
def jacobian_2d(x, slopes, q):
    """Return the four entries of J, row by row, at point q, for nodes x (2, n_nodes), slopes dN / dxi (n_q, 2, n_nodes)."""
    j00 = j01 = j10 = j11 = 0.0
    for a in range(x.shape[1]):
        r, s = slopes[q, 0, a], slopes[q, 1, a]
        j00 += r * x[0, a]
        j01 += r * x[1, a]
        j10 += s * x[0, a]
        j11 += s * x[1, a]
    return j00, j01, j10, j11


@innermost_kernel
def jacobian_3d(x, slopes, q):
    """Return the nine entries of J, row by row, at point q, for nodes x (3, n_nodes), slopes dN / dxi (n_q, 3, n_nodes)."""
    j00 = j01 = j02 = j10 = j11 = j12 = j20 = j21 = j22 = 0.0
    for a in range(x.shape[1]):
        r, s, t = slopes[q, 0, a], slopes[q, 1, a], slopes[q, 2, a]
        j00 += r * x[0, a]
        j01 += r * x[1, a]
        j02 += r * x[2, a]
        j10 += s * x[0, a]
        j11 += s * x[1, a]
        j12 += s * x[2, a]
        j20 += t * x[0, a]
        j21 += t * x[1, a]
        j22 += t * x[2, a]
    return j00, j01, j02, j10, j11, j12, j20, j21, j22


@innermost_kernel
def cofactors(j00, j01, j02, j10, j11, j12, j20, j21, j22):
    """Return the nine cofactors of J (3, 3), row by row; divided by det J they are the transposed inverse."""
    c00, c01, c02 = j11 * j22 - j12 * j21, j12 * j20 - j10 * j22, j10 * j21 - j11 * j20
    c10, c11, c12 = j02 * j21 - j01 * j22, j00 * j22 - j02 * j20, j01 * j20 - j00 * j21
    return c00, c01, c02, c10, c11, c12, j01 * j12 - j02 * j11, j02 * j10 - j00 * j12, j00 * j11 - j01 * j10


@kernel
def at_nodes(values, cells, c, x):
    """Fill `x` (n_nodes, dim) with the vectors of `values` (n_points, dim) at the nodes of cell `c`."""
    for a in range(cells.shape[1]):
        for i in range(values.shape[1]):
            x[a, i] = values[cells[c, a], i]


@kernel
def inverse_jacobian(x, dN, q, J, inverse):
    """Fill `inverse` (dim, dim) with the derivatives dxi_k / dx_i at [i, k], for nodes `x` (n_nodes, dim); return det J.

    `dN` (n_q, n_nodes, dim) are the derivatives of the shape functions, of which those at point q are used. `J` (dim, dim) is
    overwritten by dx_i / dxi_k at [k, i]; dim is 2 or 3.
    """
    dim = x.shape[1]
    for k in range(dim):
        for i in range(dim):
            value = 0.0
            for a in range(x.shape[0]):
                value += dN[q, a, k] * x[a, i]
            J[k, i] = value
    if dim == 2:
        det = J[0, 0] * J[1, 1] - J[0, 1] * J[1, 0]
        inverse[0, 0], inverse[0, 1] = J[1, 1] / det, -J[0, 1] / det
        inverse[1, 0], inverse[1, 1] = -J[1, 0] / det, J[0, 0] / det
        return det
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        for m in range(3):
            n, r = (m + 1) % 3, (m + 2) % 3
            inverse[i, m] = J[n, j] * J[r, k] - J[n, k] * J[r, j]
    det = J[0, 0] * inverse[0, 0] + J[0, 1] * inverse[1, 0] + J[0, 2] * inverse[2, 0]
    for i in range(3):
        for m in range(3):
            inverse[i, m] /= det
    return det


@kernel
def gradients(dN, q, inverse, gradient):
    """Fill `gradient` (n_nodes, dim) with the derivatives of the shape functions with respect to x at point q.

    `dN` (n_q, n_nodes, dim) are the derivatives in reference coordinates, `inverse` (dim, dim) that of `inverse_jacobian`.
    """
    for a in range(dN.shape[1]):
        for i in range(inverse.shape[0]):
            value = 0.0
            for k in range(inverse.shape[0]):
                value += dN[q, a, k] * inverse[i, k]
            gradient[a, i] = value
