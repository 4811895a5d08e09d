# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loops of the dilatation projected on few polynomials of each cell: its stiffness, and its pressure at points.

Shared arguments: ``points`` (n_points, dim) [length]; ``cells`` (n_cells, n_nodes); ``N`` (n_q, n_nodes), ``dN`` (n_q,
n_nodes, dim), ``weights`` (n_q,) of the reference element; ``basis`` (n_q, m), the polynomials at the same points, the
constant first; ``bulk`` (n_materials, 2) [pressure], the moduli of the mean dilatation and of the other polynomials, zero
where a material takes the dilatation as it is; ``material`` (n_cells,). dim is 2 or 3.

With the dilatation t = d.u, the weights w of the quadrature and the polynomials p, M = sum w p p^T = L L^T is their mass
matrix and g = sum w p d^T. L^-1 p are orthonormal polynomials, the projection is p^T M^-1 g u, and its stiffness
(L^-1 g)^T B (L^-1 g) with the diagonal matrix B of the moduli (Hughes, Int. J. Numer. Meth. Engng 15, 1980).
"""

import numpy as np

from fastcontact._jit.decorators import kernel

TWO_PI = 2.0 * np.pi


@kernel
def _plane(x, N, dN, q, axisymmetric, d):
    """Fill `d` (n_nodes * 2,) with the dilatation of unit displacements of the nodes `x` (n_nodes, 2); return the measure."""
    j00 = j01 = j10 = j11 = radius = 0.0
    for a in range(x.shape[0]):
        j00 += dN[q, a, 0] * x[a, 0]
        j01 += dN[q, a, 0] * x[a, 1]
        j10 += dN[q, a, 1] * x[a, 0]
        j11 += dN[q, a, 1] * x[a, 1]
        radius += N[q, a] * x[a, 0]
    det = j00 * j11 - j01 * j10
    for a in range(x.shape[0]):
        d[2 * a] = (j11 * dN[q, a, 0] - j01 * dN[q, a, 1]) / det
        d[2 * a + 1] = (j00 * dN[q, a, 1] - j10 * dN[q, a, 0]) / det
    if not axisymmetric:
        return det
    for a in range(x.shape[0]):
        d[2 * a] += N[q, a] / radius
    return det * TWO_PI * radius


@kernel
def _solid(x, dN, q, d):
    """Fill `d` (n_nodes * 3,) with the dilatation of unit displacements of the nodes `x` (n_nodes, 3); return det J."""
    j00 = j01 = j02 = j10 = j11 = j12 = j20 = j21 = j22 = 0.0
    for a in range(x.shape[0]):
        r, s, t = dN[q, a, 0], dN[q, a, 1], dN[q, a, 2]
        j00 += r * x[a, 0]
        j01 += r * x[a, 1]
        j02 += r * x[a, 2]
        j10 += s * x[a, 0]
        j11 += s * x[a, 1]
        j12 += s * x[a, 2]
        j20 += t * x[a, 0]
        j21 += t * x[a, 1]
        j22 += t * x[a, 2]
    c00, c01, c02 = j11 * j22 - j12 * j21, j12 * j20 - j10 * j22, j10 * j21 - j11 * j20
    c10, c11, c12 = j02 * j21 - j01 * j22, j00 * j22 - j02 * j20, j01 * j20 - j00 * j21
    c20, c21, c22 = j01 * j12 - j02 * j11, j02 * j10 - j00 * j12, j00 * j11 - j01 * j10
    det = j00 * c00 + j01 * c01 + j02 * c02
    inverse = 1.0 / det
    for a in range(x.shape[0]):
        r, s, t = dN[q, a, 0] * inverse, dN[q, a, 1] * inverse, dN[q, a, 2] * inverse
        d[3 * a] = c00 * r + c10 * s + c20 * t
        d[3 * a + 1] = c01 * r + c11 * s + c21 * t
        d[3 * a + 2] = c02 * r + c12 * s + c22 * t
    return det


@kernel
def _integrate(x, N, dN, weights, basis, axisymmetric, d, mass, g):
    """Fill `mass` (m, m) and `g` (m, n_nodes * dim) for the cell with the nodes `x` (n_nodes, dim)."""
    mass[:] = 0.0
    g[:] = 0.0
    for q in range(weights.shape[0]):
        measure = _plane(x, N, dN, q, axisymmetric, d) if x.shape[1] == 2 else _solid(x, dN, q, d)
        measure *= weights[q]
        for m in range(basis.shape[1]):
            factor = measure * basis[q, m]
            for n in range(m + 1):
                mass[m, n] += factor * basis[q, n]
            for k in range(d.shape[0]):
                g[m, k] += factor * d[k]


@kernel
def _reduce(mass, g):
    """Replace the lower half of `mass` (m, m) by its Cholesky factor L, and `g` (m, n) by L^-1 g."""
    for m in range(mass.shape[0]):
        for n in range(m + 1):
            value = mass[m, n]
            for k in range(n):
                value -= mass[m, k] * mass[n, k]
            mass[m, n] = np.sqrt(value) if m == n else value / mass[n, n]
        for n in range(m):
            for k in range(g.shape[1]):
                g[m, k] -= mass[m, n] * g[n, k]
        for k in range(g.shape[1]):
            g[m, k] /= mass[m, m]


@kernel
def add_stiffness(points, cells, N, dN, weights, basis, bulk, material, axisymmetric, slots, owner, part, data):
    """Add the stiffness of the projected dilatation to `data` (n_blocks, dim, dim), in the rows of a part's nodes.

    Arguments as for the element loops of the whole stiffness; Jacobians have been found positive.
    """
    n_cells, n_nodes = cells.shape
    dim, size = points.shape[1], basis.shape[1]
    x, d = np.empty((n_nodes, dim)), np.empty(n_nodes * dim)
    mass, g = np.empty((size, size)), np.empty((size, n_nodes * dim))
    row = np.empty(n_nodes * dim)
    for c in range(n_cells):
        mean, rest = bulk[material[c], 0], bulk[material[c], 1]
        mine = False
        for a in range(n_nodes):
            mine = mine or owner[cells[c, a]] == part
        if mean == 0.0 or not mine:
            continue
        for a in range(n_nodes):
            for i in range(dim):
                x[a, i] = points[cells[c, a], i]
        _integrate(x, N, dN, weights, basis, axisymmetric, d, mass, g)
        _reduce(mass, g)
        for a in range(n_nodes):
            if owner[cells[c, a]] != part:
                continue
            for i in range(dim):
                for k in range(n_nodes * dim):
                    row[k] = mean * (g[0, dim * a + i] * g[0, k])
                for m in range(1, size):
                    for k in range(n_nodes * dim):
                        row[k] += rest * (g[m, dim * a + i] * g[m, k])
                for b in range(n_nodes):
                    for j in range(dim):
                        data[slots[c, a, b], i, j] += row[dim * b + j]


@kernel
def add_pressure(points, cells, N, dN, weights, basis, bulk, material, axisymmetric, displacement, at, out):
    """Add the moduli times the projected dilatation to the normal stresses of `out` (n_cells, n_out, n_components), in place.

    `displacement` (n_points, dim); `at` (n_out, m): the polynomials at the points of `out`.
    """
    n_cells, n_nodes = cells.shape
    dim, size = points.shape[1], basis.shape[1]
    x, d = np.empty((n_nodes, dim)), np.empty(n_nodes * dim)
    mass, g = np.empty((size, size)), np.empty((size, 1))
    value, u = np.empty(size), np.empty(n_nodes * dim)
    for c in range(n_cells):
        mean, rest = bulk[material[c], 0], bulk[material[c], 1]
        if mean == 0.0:
            continue
        for a in range(n_nodes):
            for i in range(dim):
                x[a, i] = points[cells[c, a], i]
                u[dim * a + i] = displacement[cells[c, a], i]
        mass[:] = 0.0
        g[:] = 0.0
        for q in range(weights.shape[0]):
            measure = _plane(x, N, dN, q, axisymmetric, d) if dim == 2 else _solid(x, dN, q, d)
            measure *= weights[q]
            dilatation = 0.0
            for k in range(d.shape[0]):
                dilatation += d[k] * u[k]
            for m in range(size):
                factor = measure * basis[q, m]
                for n in range(m + 1):
                    mass[m, n] += factor * basis[q, n]
                g[m, 0] += factor * dilatation
        _reduce(mass, g)
        for m in range(size):
            value[m] = g[m, 0] * (mean if m == 0 else rest)
        for m in range(size - 1, -1, -1):  # the transposed factor
            for k in range(m + 1, size):
                value[m] -= mass[k, m] * value[k]
            value[m] /= mass[m, m]
        for k in range(at.shape[0]):
            pressure = 0.0
            for m in range(size):
                pressure += at[k, m] * value[m]
            for i in range(3):
                out[c, k, i] += pressure
