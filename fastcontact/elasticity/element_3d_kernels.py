# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loops for three-dimensional solids, which compute stiffness and stresses.

Shared arguments: ``points`` (n_points, 3) [length]; ``cells`` (n_cells, n_nodes); ``N`` (n_q, n_nodes), ``dN`` (n_q,
n_nodes, 3), ``weights`` (n_q,) of the reference element; ``moduli`` (n_materials, 6, 6) [pressure], symmetric, for strains
(xx, yy, zz, 2xy, 2yz, 2xz); ``material`` (n_cells,). `N` and `axisymmetric` have no effect, and are arguments because the
loops of both dimensions are called in the same way. In helpers, ``slots`` and ``in_part`` are those of `add_stiffness` and
`find_owned`, and ``flat`` is the matrix ``data`` as a vector.
"""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel, kernel
from fastcontact.elasticity.constitutive_kernels import voigt
from fastcontact.elasticity.element_2d_kernels import find_owned
from fastcontact.mesh.jacobian_kernels import cofactors, jacobian_3d, transposed


@kernel
def _gather(values, cells, c, x):
    """Fill `x` (3, n_nodes) with the vectors of `values` (n_points, 3) at the nodes of cell `c`."""
    for a in range(cells.shape[1]):
        p = cells[c, a]
        for i in range(3):
            x[i, a] = values[p, i]


@kernel
def map_3d(x, slopes, q, gradient):
    """Fill `gradient` (3, n_nodes) with shape derivatives in x, y, z at point q; return det J.

    `x` (3, n_nodes) are the positions of the nodes, and `slopes` (n_q, 3, n_nodes) the derivatives dN, see `transposed`.
    """
    j00, j01, j02, j10, j11, j12, j20, j21, j22 = jacobian_3d(x, slopes, q)
    c00, c01, c02, c10, c11, c12, c20, c21, c22 = cofactors(j00, j01, j02, j10, j11, j12, j20, j21, j22)
    det = j00 * c00 + j01 * c01 + j02 * c02
    inverse = 1.0 / det
    for a in range(x.shape[1]):
        r, s, t = slopes[q, 0, a] * inverse, slopes[q, 1, a] * inverse, slopes[q, 2, a] * inverse
        gradient[0, a] = c00 * r + c10 * s + c20 * t
        gradient[1, a] = c01 * r + c11 * s + c21 * t
        gradient[2, a] = c02 * r + c12 * s + c22 * t
    return det


@kernel
def _tensor(D, tensor):
    """Fill `tensor` (9, 9) with moduli (6, 6): D_ikjl in row 3 i + j and column 3 k + l, for K_ij = D_ikjl g_kl."""
    for row in range(9):
        for column in range(9):
            i, j, k, n = row // 3, row % 3, column // 3, column % 3
            tensor[row, column] = D[voigt(i, k), voigt(j, n)]


@kernel
def _integrate_products(x, slopes, weights, gradient, g):
    """Fill `g` (6, n_nodes, n_nodes) with the integrals of dN_a/dx_i dN_b/dx_j for ij = 00, 01, 02, 11, 12, 22.

    Returns whether the Jacobian is positive at all points. The innermost loop is short and contains a single sum, so that the
    compiler vectorises it.
    """
    n_nodes = x.shape[1]
    g[:] = 0.0
    for q in range(weights.shape[0]):
        det = map_3d(x, slopes, q, gradient)
        if not det > 0.0:
            return False
        weight = weights[q] * det
        ij = 0
        for i in range(3):
            for j in range(i, 3):
                for a in range(n_nodes):
                    factor = weight * gradient[i, a]
                    for b in range(n_nodes):
                        g[ij, a, b] += factor * gradient[j, b]
                ij += 1
    return True


@kernel
def add_block(flat, add_upper, add_lower, upper, lower, block):
    """Add the `block` (9,) of a node pair at the slot `upper`, and its transpose at the slot `lower`.

    `add_upper` and `add_lower` state whether they are added. The transpose of a diagonal block is not added.
    """
    u, v = 9 * upper, 9 * lower
    if add_upper:
        for k in range(9):
            flat[u + k] += block[k]
    if u != v and add_lower:
        for k in range(9):
            flat[v + k] += block[3 * (k % 3) + k // 3]


@inlined_kernel
def _add_isotropic_block(flat, distinct, add_upper, add_lower, upper, lower, lam, mu, g):
    """Add the block of two nodes for Lamé's constants: K_ij = lambda g_ij + mu g_ji + mu g_kk delta_ij.

    `distinct` states whether the nodes differ. The order of g is xx, yy, zz, xy, xz, yz, yx, zx, zy.
    """
    xx, yy, zz, xy, xz, yz, yx, zx, zy = g
    trace, lam_mu = mu * (xx + yy + zz), lam + mu
    k01, k02, k12 = lam * xy + mu * yx, lam * xz + mu * zx, lam * yz + mu * zy
    k10, k20, k21 = lam * yx + mu * xy, lam * zx + mu * xz, lam * zy + mu * yz
    if not distinct:  # equal up to round-off; makes K bitwise symmetric
        k10, k20, k21 = k01, k02, k12
    block = lam_mu * xx + trace, k01, k02, k10, lam_mu * yy + trace, k12, k20, k21, lam_mu * zz + trace
    add_block(flat, add_upper, add_lower, upper, lower, block)


@kernel
def _add_isotropic(g, lam, mu, slots, c, in_part, flat):
    """Add the blocks of a cell for Lamé's constants, given the integrals of `_integrate_products`."""
    for b in range(g.shape[1]):
        for a in range(b + 1):
            products = (
                g[0, a, b], g[3, a, b], g[5, a, b], g[1, a, b], g[2, a, b], g[4, a, b], g[1, b, a], g[2, b, a], g[4, b, a],
            )  # fmt: skip
            upper, lower = slots[c, a, b], slots[c, b, a]
            _add_isotropic_block(flat, a != b, in_part[a], in_part[b], upper, lower, lam, mu, products)


@kernel
def _add_general(g, tensor, products, block, slots, c, in_part, flat):
    """Add the blocks of a cell for any moduli: K_ij = D_ikjl g_kl; `products` and `block` (9,) are overwritten."""
    for b in range(g.shape[1]):
        for a in range(b + 1):
            products[0], products[4], products[8] = g[0, a, b], g[3, a, b], g[5, a, b]
            products[1], products[2], products[5] = g[1, a, b], g[2, a, b], g[4, a, b]
            products[3], products[6], products[7] = g[1, b, a], g[2, b, a], g[4, b, a]
            for row in range(9):
                total = 0.0
                for column in range(9):
                    total += tensor[row, column] * products[column]
                block[row] = total
            if a == b:  # equal up to round-off; makes K bitwise symmetric
                block[3], block[6], block[7] = block[1], block[2], block[5]
            add_block(flat, in_part[a], in_part[b], slots[c, a, b], slots[c, b, a], block)


@kernel
def _add_tetrahedron(points, cells, c, volume, lam, mu, slots, in_part, gradient, flat):
    """Add the blocks of a linear tetrahedron, whose gradients (4, 3) are constant, for Lamé's constants.

    `volume` is that of the reference cell. Returns whether the Jacobian is positive. With a fixed number of nodes, this takes
    half as long as `_integrate_products` and `_add_isotropic`.
    """
    first = cells[c, 0]
    x0, y0, z0 = points[first, 0], points[first, 1], points[first, 2]
    r, s, t = cells[c, 1], cells[c, 2], cells[c, 3]
    xr, yr, zr = points[r, 0] - x0, points[r, 1] - y0, points[r, 2] - z0
    xs, ys, zs = points[s, 0] - x0, points[s, 1] - y0, points[s, 2] - z0
    xt, yt, zt = points[t, 0] - x0, points[t, 1] - y0, points[t, 2] - z0
    gradient[1, 0], gradient[1, 1], gradient[1, 2] = ys * zt - zs * yt, zs * xt - xs * zt, xs * yt - ys * xt
    gradient[2, 0], gradient[2, 1], gradient[2, 2] = zr * yt - yr * zt, xr * zt - zr * xt, yr * xt - xr * yt
    gradient[3, 0], gradient[3, 1], gradient[3, 2] = yr * zs - zr * ys, zr * xs - xr * zs, xr * ys - yr * xs
    det = xr * gradient[1, 0] + yr * gradient[1, 1] + zr * gradient[1, 2]
    if not det > 0.0:
        return False
    for i in range(3):
        gradient[0, i] = -(gradient[1, i] + gradient[2, i] + gradient[3, i])
    weight = volume / det  # the volume of the cell is `volume` times det, and gradients are cofactors over det
    for b in range(4):
        gx, gy, gz = weight * gradient[b, 0], weight * gradient[b, 1], weight * gradient[b, 2]
        for a in range(b + 1):
            x, y, z = gradient[a, 0], gradient[a, 1], gradient[a, 2]
            g = x * gx, y * gy, z * gz, x * gy, x * gz, y * gz, y * gx, z * gx, z * gy
            _add_isotropic_block(flat, a != b, in_part[a], in_part[b], slots[c, a, b], slots[c, b, a], lam, mu, g)
    return True


@interpretable_kernel
def add_stiffness(points, cells, N, dN, weights, moduli, isotropic, material, axisymmetric, slots, owner, part, data):
    """Add element stiffness blocks to `data` (n_blocks, 3, 3), in the rows of nodes with ``owner[node] == part``.

    The block of each node pair of a cell has the index `slots` (n_cells, n_nodes, n_nodes). Each thread adds to the rows of
    the nodes of its part, in the order of the cells. Returns the number of the first cell whose Jacobian is not positive, or
    -1. The products of gradients are integrated first, and then multiplied by the moduli of the cell. For materials that are
    marked in `isotropic` (n_materials,), the moduli are Lamé's constants ``D[0, 1]`` and ``D[3, 3]``.
    """
    n_cells, n_nodes = cells.shape
    slopes, x, gradient = transposed(dN), np.empty((3, n_nodes)), np.empty((3, n_nodes))
    g, in_part, tetrahedron_gradient = np.empty((6, n_nodes, n_nodes)), np.empty(n_nodes, np.bool_), np.empty((4, 3))
    tensor, products, block = np.empty((9, 9)), np.empty(9), np.empty(9)
    volume = 0.0
    for weight in weights:
        volume += weight
    flat = data.reshape(-1)
    for c in range(n_cells):
        if not find_owned(cells, c, owner, part, in_part):
            continue
        lam, mu = moduli[material[c], 0, 1], moduli[material[c], 3, 3]
        if n_nodes == 4 and isotropic[material[c]]:
            if not _add_tetrahedron(points, cells, c, volume, lam, mu, slots, in_part, tetrahedron_gradient, flat):
                return c
            continue
        _gather(points, cells, c, x)
        if not _integrate_products(x, slopes, weights, gradient, g):
            return c
        if isotropic[material[c]]:
            _add_isotropic(g, lam, mu, slots, c, in_part, flat)
        else:
            _tensor(moduli[material[c]], tensor)
            _add_general(g, tensor, products, block, slots, c, in_part, flat)
    return -1


@interpretable_kernel
def stress(points, cells, N, dN, moduli, material, axisymmetric, displacement, out):
    """Fill `out` (n_cells, n_q, 6) with the stress xx, yy, zz, xy, yz, xz at the points of the table dN.

    Positions and displacements are differentiated with respect to reference coordinates, and their derivatives are combined,
    without computing gradients of shape functions.
    """
    n_cells, n_nodes = cells.shape
    slopes, x, u = transposed(dN), np.empty((3, n_nodes)), np.empty((3, n_nodes))
    for c in range(n_cells):
        _gather(points, cells, c, x)
        _gather(displacement, cells, c, u)
        D = moduli[material[c]]
        for q in range(dN.shape[0]):
            xr, yr, zr, xs, ys, zs, xt, yt, zt = jacobian_3d(x, slopes, q)
            ur, vr, wr, us, vs, ws, ut, vt, wt = jacobian_3d(u, slopes, q)
            rx, ry, rz, sx, sy, sz, tx, ty, tz = cofactors(xr, yr, zr, xs, ys, zs, xt, yt, zt)
            inverse = 1.0 / (xr * rx + yr * ry + zr * rz)
            exx = (rx * ur + sx * us + tx * ut) * inverse
            eyy = (ry * vr + sy * vs + ty * vt) * inverse
            ezz = (rz * wr + sz * ws + tz * wt) * inverse
            gxy = (ry * ur + sy * us + ty * ut + rx * vr + sx * vs + tx * vt) * inverse
            gyz = (rz * vr + sz * vs + tz * vt + ry * wr + sy * ws + ty * wt) * inverse
            gxz = (rx * wr + sx * ws + tx * wt + rz * ur + sz * us + tz * ut) * inverse
            for i in range(6):
                normal = D[i, 0] * exx + D[i, 1] * eyy + D[i, 2] * ezz
                out[c, q, i] = normal + D[i, 3] * gxy + D[i, 4] * gyz + D[i, 5] * gxz
