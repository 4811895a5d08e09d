"""Element loops of 3D solids: stiffness, stress at quadrature points, internal forces.

Shared arguments, as in `solid2d`: ``points`` (n_points, 3); ``cells`` (n_cells, n_nodes); ``N`` (n_q, n_nodes),
``dN`` (n_q, n_nodes, 3), ``weights`` (n_q,) of the reference element; ``moduli`` (n_materials, 6, 6), symmetric, for
strains (xx, yy, zz, 2xy, 2yz, 2xz); ``material`` (n_cells,). `N` and `axisymmetric` mean nothing here; they are taken
so that the loops of both dimensions are called alike.
"""

import numpy as np

from fastcontact._jit import kernel


@kernel
def _transposed(dN):
    """Return the derivatives as (n_q, 3, n_nodes), so that loops over nodes run along memory."""
    n_q, n_nodes, _ = dN.shape
    out = np.empty((n_q, 3, n_nodes))
    for q in range(n_q):
        for a in range(n_nodes):
            for i in range(3):
                out[q, i, a] = dN[q, a, i]
    return out


@kernel
def _gather(points, cell, x):
    """Fill `x` (3, n_nodes) with the coordinates of a cell."""
    for a in range(cell.shape[0]):
        p = cell[a]
        for i in range(3):
            x[i, a] = points[p, i]


@kernel
def _map(x, slopes, q, gradient):
    """Fill `gradient` (3, n_nodes) with shape derivatives in x, y, z; return det J."""
    n_nodes = x.shape[1]
    j00 = j01 = j02 = j10 = j11 = j12 = j20 = j21 = j22 = 0.0
    for a in range(n_nodes):
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
    c00, c01, c02 = j11 * j22 - j12 * j21, j12 * j20 - j10 * j22, j10 * j21 - j11 * j20
    c10, c11, c12 = j02 * j21 - j01 * j22, j00 * j22 - j02 * j20, j01 * j20 - j00 * j21
    c20, c21, c22 = j01 * j12 - j02 * j11, j02 * j10 - j00 * j12, j00 * j11 - j01 * j10
    det = j00 * c00 + j01 * c01 + j02 * c02
    inverse = 1.0 / det
    for a in range(n_nodes):
        r, s, t = slopes[q, 0, a] * inverse, slopes[q, 1, a] * inverse, slopes[q, 2, a] * inverse
        gradient[0, a] = c00 * r + c10 * s + c20 * t
        gradient[1, a] = c01 * r + c11 * s + c21 * t
        gradient[2, a] = c02 * r + c12 * s + c22 * t
    return det


@kernel
def _is_isotropic(D):
    """Return whether the moduli are those of an isotropic material, but for round-off."""
    shear, coupling = D[3, 3], D[0, 1]
    for i in range(6):
        for j in range(6):
            expected = 0.0
            if i < 3 and j < 3:
                expected = coupling
            if i == j:
                expected += 2.0 * shear if i < 3 else shear
            if not abs(D[i, j] - expected) <= 1e-14 * abs(D[0, 0]):
                return False
    return True


@kernel
def _general_block(D, g, a, b, block):
    """Fill `block` (9,) with K_ij = D_ikjl g_kl of a node pair, from `g` (3, 3, n_nodes, n_nodes)."""
    for i in range(3):
        for j in range(3):
            total = 0.0
            for k in range(3):
                # Number of the stress component i, k in the order xx, yy, zz, xy, yz, xz.
                row = i if i == k else (5 if i + k == 2 else i + k + 2 - (i + k) // 3)
                for m in range(3):
                    column = j if j == m else (5 if j + m == 2 else j + m + 2 - (j + m) // 3)
                    total += D[row, column] * g[k, m, a, b]
            block[3 * i + j] = total


@kernel
def add_stiffness(points, cells, N, dN, weights, moduli, material, axisymmetric, slots, data):
    """Add element stiffness blocks to `data` (n_blocks, 3, 3), written in place at `slots`.

    Returns the number of the first cell with a Jacobian that is not positive, or -1. Per cell, the products of
    gradients are integrated first, once for all moduli; then K_ij = D_ikjl int dN_a/dx_k dN_b/dx_l dV.
    """
    n_cells, n_nodes = cells.shape
    slopes = _transposed(dN)
    x, gradient = np.empty((3, n_nodes)), np.empty((3, n_nodes))
    g = np.empty((3, 3, n_nodes, n_nodes))
    block = np.empty(9)
    isotropic = np.empty(moduli.shape[0], np.bool_)
    for m in range(moduli.shape[0]):
        isotropic[m] = _is_isotropic(moduli[m])
    flat = data.reshape(-1)
    for c in range(n_cells):
        _gather(points, cells[c], x)
        g[:] = 0.0
        for q in range(weights.shape[0]):
            det = _map(x, slopes, q, gradient)
            if not det > 0.0:
                return c
            weight = weights[q] * det
            for a in range(n_nodes):
                for i in range(3):
                    scaled = weight * gradient[i, a]
                    for j in range(i, 3):
                        for b in range(n_nodes):
                            g[i, j, a, b] += scaled * gradient[j, b]
    return -1
