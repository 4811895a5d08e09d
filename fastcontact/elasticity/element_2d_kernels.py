# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loops for plane and axisymmetric solids, which compute stiffness and stresses, and nodal sums.

Shared arguments: ``points`` (n_points, 2) [length]; ``cells`` (n_cells, n_nodes); ``N`` (n_q, n_nodes),
``dN`` (n_q, n_nodes, 2), ``weights`` (n_q,) of the reference element; ``moduli`` (n_materials, 4, 4) [pressure] for
strains (xx, yy, zz, 2xy); ``material`` (n_cells,). Axisymmetric integrals are over the full circle, with the weights
2 pi r det J w.
"""

import numpy as np

from fastcontact._jit.decorators import interpretable_kernel, kernel
from fastcontact.mesh.jacobian_kernels import jacobian_2d, transposed

TWO_PI = 2.0 * np.pi


@kernel
def _map(points, cell, N, dN, q, gradient):
    """Fill `gradient` (n_nodes, 2) with shape derivatives in x, y at point q; return det J and the radius."""
    n_nodes = cell.shape[0]
    j00 = j01 = j10 = j11 = radius = 0.0
    for a in range(n_nodes):
        x, y = points[cell[a], 0], points[cell[a], 1]
        j00 += dN[q, a, 0] * x
        j01 += dN[q, a, 0] * y
        j10 += dN[q, a, 1] * x
        j11 += dN[q, a, 1] * y
        radius += N[q, a] * x
    det = j00 * j11 - j01 * j10
    for a in range(n_nodes):
        gradient[a, 0] = (j11 * dN[q, a, 0] - j01 * dN[q, a, 1]) / det
        gradient[a, 1] = (j00 * dN[q, a, 1] - j10 * dN[q, a, 0]) / det
    return det, radius


@kernel
def find_owned(cells, c, owner, part, in_part):
    """Fill `in_part` (n_nodes,) with whether the nodes of cell `c` belong to `part`; return whether any of them do."""
    any_in_part = False
    for a in range(cells.shape[1]):
        in_part[a] = owner[cells[c, a]] == part
        any_in_part = any_in_part or in_part[a]
    return any_in_part


@kernel
def _integrate(points, cell, N, dN, weights, D, axisymmetric, gradient, local):
    """Add the stiffness for moduli D (4, 4) to `local` (n_nodes, n_nodes, 2, 2); return whether the Jacobian is positive."""
    n_nodes = cell.shape[0]
    for q in range(weights.shape[0]):
        det, radius = _map(points, cell, N, dN, q, gradient)
        if not det > 0.0:
            return False
        weight = weights[q] * det
        if axisymmetric:
            weight *= TWO_PI * radius
        for b in range(n_nodes):
            bx, by = weight * gradient[b, 0], weight * gradient[b, 1]
            bh = weight * N[q, b] / radius if axisymmetric else 0.0
            xx_x, xx_y = D[0, 0] * bx + D[0, 2] * bh + D[0, 3] * by, D[0, 1] * by + D[0, 3] * bx
            yy_x, yy_y = D[1, 0] * bx + D[1, 2] * bh + D[1, 3] * by, D[1, 1] * by + D[1, 3] * bx
            zz_x, zz_y = D[2, 0] * bx + D[2, 2] * bh + D[2, 3] * by, D[2, 1] * by + D[2, 3] * bx
            xy_x, xy_y = D[3, 0] * bx + D[3, 2] * bh + D[3, 3] * by, D[3, 1] * by + D[3, 3] * bx
            for a in range(b + 1):
                ax, ay = gradient[a, 0], gradient[a, 1]
                ah = N[q, a] / radius if axisymmetric else 0.0
                local[a, b, 0, 0] += ax * xx_x + ah * zz_x + ay * xy_x
                local[a, b, 0, 1] += ax * xx_y + ah * zz_y + ay * xy_y
                local[a, b, 1, 0] += ay * yy_x + ax * xy_x
                local[a, b, 1, 1] += ay * yy_y + ax * xy_y
    return True


@interpretable_kernel
def add_stiffness(points, cells, N, dN, weights, moduli, isotropic, material, axisymmetric, slots, owner, part, data):
    """Add element stiffness blocks to `data` (n_blocks, 2, 2), in the rows of nodes with ``owner[node] == part``.

    The block of each node pair of a cell has the index `slots` (n_cells, n_nodes, n_nodes). Each thread adds to the rows of
    the nodes of its part, in the order of the cells. Returns the number of the first cell whose Jacobian is not positive, or
    -1. `isotropic` has no effect, and is an argument because the loops of both dimensions are called in the same way.
    """
    n_cells, n_nodes = cells.shape
    gradient = np.empty((n_nodes, 2))
    local = np.empty((n_nodes, n_nodes, 2, 2))
    in_part = np.empty(n_nodes, np.bool_)
    for c in range(n_cells):
        if not find_owned(cells, c, owner, part, in_part):
            continue
        local[:] = 0.0
        if not _integrate(points, cells[c], N, dN, weights, moduli[material[c]], axisymmetric, gradient, local):
            return c
        for b in range(n_nodes):
            local[b, b, 1, 0] = local[b, b, 0, 1]  # equal up to round-off; makes K bitwise symmetric
            for a in range(b + 1):
                upper, lower = slots[c, a, b], slots[c, b, a]
                if in_part[a]:
                    for i in range(2):
                        for j in range(2):
                            data[upper, i, j] += local[a, b, i, j]
                if a != b and in_part[b]:
                    for i in range(2):
                        for j in range(2):
                            data[lower, j, i] += local[a, b, i, j]
    return -1


@interpretable_kernel
def stress(points, cells, N, dN, moduli, material, axisymmetric, displacement, out):
    """Fill `out` (n_cells, n_q, 4) with the stress xx, yy, zz, xy at the points of the tables N, dN.

    Positions and displacements are differentiated with respect to reference coordinates, and their derivatives are combined,
    without computing gradients of shape functions.
    """
    n_cells, n_nodes = cells.shape
    slopes, x, u = transposed(dN), np.empty((2, n_nodes)), np.empty((2, n_nodes))
    for c in range(n_cells):
        D = moduli[material[c]]
        for a in range(n_nodes):
            p = cells[c, a]
            x[0, a], x[1, a] = points[p, 0], points[p, 1]
            u[0, a], u[1, a] = displacement[p, 0], displacement[p, 1]
        for q in range(N.shape[0]):
            x_r, y_r, x_s, y_s = jacobian_2d(x, slopes, q)
            ux_r, uy_r, ux_s, uy_s = jacobian_2d(u, slopes, q)
            inverse = 1.0 / (x_r * y_s - y_r * x_s)
            exx = (ux_r * y_s - ux_s * y_r) * inverse
            eyy = (uy_s * x_r - uy_r * x_s) * inverse
            gxy = (ux_s * x_r - ux_r * x_s + uy_r * y_s - uy_s * y_r) * inverse
            ezz = 0.0
            if axisymmetric:
                radius = ux = 0.0
                for a in range(n_nodes):
                    radius += N[q, a] * x[0, a]
                    ux += N[q, a] * u[0, a]
                ezz = ux / radius
            for i in range(4):
                out[c, q, i] = D[i, 0] * exx + D[i, 1] * eyy + D[i, 2] * ezz + D[i, 3] * gxy


@interpretable_kernel
def add_nodal(cells, extrapolation, at_points, low, high, total, count):
    """Extrapolate values from quadrature points to the nodes of each cell, and sum them at the points of the mesh.

    Only nodes with numbers from `low` to ``high - 1`` are processed. `extrapolation` is (n_nodes, n_q) and `at_points`
    (n_cells, n_q, n_components). The values are added to `total` (n_points, n_components), and the number of cells of each
    point to `count` (n_points,).
    """
    n_cells, n_nodes = cells.shape
    for c in range(n_cells):
        for a in range(n_nodes):
            p = cells[c, a]
            if p < low or p >= high:
                continue
            count[p] += 1
            for i in range(at_points.shape[2]):
                value = 0.0
                for q in range(at_points.shape[1]):
                    value += extrapolation[a, q] * at_points[c, q, i]
                total[p, i] += value
