# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loops for the projected dilatation: its stiffness, and the mean stress that it causes at points of the cells.

Shared arguments: ``points`` (n_points, dim) [length]; ``cells`` (n_cells, n_nodes); ``N`` (n_q, n_nodes), ``dN`` (n_q,
n_nodes, dim), ``weights`` (n_q,) of the reference element; ``basis`` (n_q, m), the polynomials at the same points, the
constant first; ``bulk`` (n_materials, 2) [pressure], the bulk moduli of the mean dilatation and of the other polynomials,
zero for materials without projection; ``material`` (n_cells,). dim is 2 or 3.

Let d.u be the dilatation due to the nodal displacements u, w the quadrature weights times det J, and p the polynomials. Their
mass matrix is M = sum w p p^T = L L^T, and g = sum w p d^T. The projected dilatation is p^T M^-1 g u. The polynomials
L^-1 p are orthonormal, and the first of them is constant, so that the stiffness is (L^-1 g)^T B (L^-1 g) with the diagonal
matrix B of the bulk moduli (Hughes, Int. J. Numer. Meth. Engng 15, 1980).
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.element_2d_kernels import TWO_PI, find_owned
from fastcontact.mesh.jacobian_kernels import at_nodes, gradients, inverse_jacobian


@kernel
def _measure(x, N, dN, q, axisymmetric, J, inverse, gradient):
    """Fill `gradient` (n_nodes, dim) with the dilatation due to unit displacements of the nodes `x` (n_nodes, dim).

    Returns det J, in axisymmetry times the circumference 2 pi r; `J` and `inverse` (dim, dim) are overwritten.
    """
    measure = inverse_jacobian(x, dN, q, J, inverse)
    gradients(dN, q, inverse, gradient)
    if not axisymmetric:
        return measure
    radius = 0.0
    for a in range(x.shape[0]):
        radius += N[q, a] * x[a, 0]
    for a in range(x.shape[0]):
        gradient[a, 0] += N[q, a] / radius
    return measure * TWO_PI * radius


@kernel
def _integrate(x, N, dN, weights, basis, axisymmetric, J, inverse, gradient, mass, g):
    """Fill `mass` (m, m) and `g` (m, n_nodes * dim) for the cell with the nodes `x` (n_nodes, dim)."""
    mass[:] = 0.0
    g[:] = 0.0
    dim = x.shape[1]
    for q in range(weights.shape[0]):
        measure = weights[q] * _measure(x, N, dN, q, axisymmetric, J, inverse, gradient)
        for m in range(basis.shape[1]):
            factor = measure * basis[q, m]
            for n in range(m + 1):
                mass[m, n] += factor * basis[q, n]
            for a in range(x.shape[0]):
                for i in range(dim):
                    g[m, dim * a + i] += factor * gradient[a, i]


@kernel
def forward_substitute(mass, g):
    """Replace the lower triangle of `mass` (m, m) by its Cholesky factor L, and then `g` (m, n) by L^-1 g."""
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
def back_substitute(L, y):
    """Replace `y` (m,) by L^-T y, with the lower triangle of L (m, m)."""
    for m in range(len(y) - 1, -1, -1):
        for k in range(m + 1, len(y)):
            y[m] -= L[k, m] * y[k]
        y[m] /= L[m, m]


@kernel
def add_products(factors, g, slots, c, in_part, row, data):
    """Add ``g^T diag(factors) g`` of cell `c`, with `g` (m, n_nodes * dim), to `data` (n_blocks, dim, dim).

    Only the rows of nodes that are marked in `in_part` (n_nodes,) are changed. `slots` (n_cells, n_nodes, n_nodes) contains
    the indices of the blocks in `data`, and `row` (n_nodes * dim,) is overwritten.
    """
    n_nodes, dim = len(in_part), data.shape[1]
    for a in range(n_nodes):
        if not in_part[a]:
            continue
        for i in range(dim):
            row[:] = 0.0
            for m in range(len(factors)):
                for k in range(n_nodes * dim):
                    row[k] += factors[m] * (g[m, dim * a + i] * g[m, k])
            for b in range(n_nodes):
                for j in range(dim):
                    data[slots[c, a, b], i, j] += row[dim * b + j]


@kernel
def add_stiffness(points, cells, N, dN, weights, basis, bulk, material, axisymmetric, slots, owner, part, data):
    """Add the stiffness of the projected dilatation to `data` (n_blocks, dim, dim), for nodes with ``owner[node] == part``.

    `slots`, `owner`, `part` and `data` are as in `element_2d_kernels.add_stiffness`, which checks that Jacobians are
    positive.
    """
    n_cells, n_nodes = cells.shape
    dim, size = points.shape[1], basis.shape[1]
    x, gradient = np.empty((n_nodes, dim)), np.empty((n_nodes, dim))
    J, inverse = np.empty((dim, dim)), np.empty((dim, dim))
    mass, g, factors = np.empty((size, size)), np.empty((size, n_nodes * dim)), np.empty(size)
    row, in_part = np.empty(n_nodes * dim), np.empty(n_nodes, np.bool_)
    for c in range(n_cells):
        factors[:], factors[0] = bulk[material[c], 1], bulk[material[c], 0]
        if factors[0] == 0.0 or not find_owned(cells, c, owner, part, in_part):
            continue
        at_nodes(points, cells, c, x)
        _integrate(x, N, dN, weights, basis, axisymmetric, J, inverse, gradient, mass, g)
        forward_substitute(mass, g)
        add_products(factors, g, slots, c, in_part, row, data)


@kernel
def add_pressure(points, cells, N, dN, weights, basis, bulk, material, axisymmetric, displacement, basis_out, out):
    """Add the bulk moduli times the projected dilatation to the normal stresses in `out` (n_cells, n_out, n_components).

    `displacement` (n_points, dim) [length] contains the displacements, and `basis_out` (n_out, m) [-] the polynomials at the
    points of `out` [pressure].
    """
    n_cells, n_nodes = cells.shape
    dim, size = points.shape[1], basis.shape[1]
    x, u, gradient = np.empty((n_nodes, dim)), np.empty((n_nodes, dim)), np.empty((n_nodes, dim))
    J, inverse = np.empty((dim, dim)), np.empty((dim, dim))
    mass, g = np.empty((size, size)), np.empty((size, n_nodes * dim))
    moment, coefficient = np.empty((size, 1)), np.empty(size)
    for c in range(n_cells):
        bulk_mean, bulk_remainder = bulk[material[c], 0], bulk[material[c], 1]
        if bulk_mean == 0.0:
            continue
        at_nodes(points, cells, c, x)
        at_nodes(displacement, cells, c, u)
        _integrate(x, N, dN, weights, basis, axisymmetric, J, inverse, gradient, mass, g)
        moment[:] = 0.0
        for m in range(size):
            for k in range(n_nodes * dim):
                moment[m, 0] += g[m, k] * u[k // dim, k % dim]
        forward_substitute(mass, moment)
        for m in range(size):
            coefficient[m] = moment[m, 0] * (bulk_mean if m == 0 else bulk_remainder)
        back_substitute(mass, coefficient)
        for k in range(basis_out.shape[0]):
            mean_stress = 0.0
            for m in range(size):
                mean_stress += basis_out[k, m] * coefficient[m]
            for i in range(3):
                out[c, k, i] += mean_stress
