# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loops for incompatible modes, which compute the condensed stiffness and additional stresses.

Shared arguments: ``points`` (n_points, dim) [length]; ``cells`` (n_cells, n_nodes); ``dN`` (n_q, n_nodes, dim), ``xi`` (n_q,
dim) and ``weights`` (n_q,) of the quadrature; ``middle`` (1, n_nodes, dim), shape derivatives at the centre of the reference
cell; ``voigt`` (dim, dim), the Voigt number of the component (i, j); ``moduli`` (n_moduli, n_components, n_components)
[pressure]; ``with_modes`` (n_moduli,) of bool, the mask of moduli with modes; ``material`` (n_cells, 1 or n_q), the rows of
moduli for cells, or for their quadrature points. There are 4 modes if dim is 2, and 13 modes if dim is 3.

Let M be the strains due to unit modes, B those due to unit nodal displacements, modal = sum w M^T D M = L L^T, and mixed =
sum w M^T D B. Static condensation eliminates the amplitudes of the modes, a = -modal^-1 mixed u, and subtracts
(L^-1 mixed)^T (L^-1 mixed) from the stiffness.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.dilatation_kernels import add_products, back_substitute, forward_substitute
from fastcontact.elasticity.element_2d_kernels import find_owned
from fastcontact.mesh.jacobian_kernels import at_nodes, gradients, inverse_jacobian


@kernel
def _modes(xi, q, inverse, ratio, voigt, M):
    """Fill `M` (n_components, n_modes) with the strains due to unit modes at point q.

    `inverse` (dim, dim) is the inverse Jacobian at the centre, and `ratio` is det J at the centre divided by det J at the
    point.
    """
    dim = xi.shape[1]
    M[:] = 0.0
    for k in range(dim):
        for j in range(dim):
            slope = -2.0 * ratio * xi[q, k] * inverse[j, k]
            for i in range(dim):
                M[voigt[i, j], dim * k + i] += slope
    if dim == 3:
        for i in range(3):
            M[i, 9] = ratio * xi[q, 0] * xi[q, 1]
            M[i, 10] = ratio * xi[q, 1] * xi[q, 2]
            M[i, 11] = ratio * xi[q, 0] * xi[q, 2]
            M[i, 12] = ratio * xi[q, 0] * xi[q, 1] * xi[q, 2]


@kernel
def _integrate(x, dN, xi, weights, middle, voigt, moduli, rows, modal, mixed):
    """Fill `modal` (n_modes, n_modes) and `mixed` (n_modes, n_nodes * dim) of the cell with the nodes `x` (n_nodes, dim).

    `rows` (1 or n_q,) are the rows of moduli for the cell or for its quadrature points.
    """
    dim, n_modes = x.shape[1], modal.shape[0]
    J, inverse, at_middle = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim, dim))
    M, S = np.empty((moduli.shape[1], n_modes)), np.empty((moduli.shape[1], n_modes))
    gradient = np.empty(x.shape)
    middle_det = inverse_jacobian(x, middle, 0, J, at_middle)
    modal[:] = 0.0
    mixed[:] = 0.0
    for q in range(weights.shape[0]):
        det = inverse_jacobian(x, dN, q, J, inverse)
        _modes(xi, q, at_middle, middle_det / det, voigt, M)
        D = moduli[rows[q % rows.shape[0]]]
        for c in range(M.shape[0]):
            for m in range(n_modes):
                S[c, m] = 0.0
            for e in range(M.shape[0]):
                factor = det * weights[q] * D[c, e]
                if factor != 0.0:
                    for m in range(n_modes):
                        S[c, m] += factor * M[e, m]
        for c in range(M.shape[0]):
            for m in range(n_modes):
                if M[c, m] != 0.0:
                    for n in range(m + 1):
                        modal[m, n] += M[c, m] * S[c, n]
        gradients(dN, q, inverse, gradient)
        for a in range(x.shape[0]):
            for i in range(dim):
                for j in range(dim):
                    for m in range(n_modes):
                        mixed[m, dim * a + i] += S[voigt[i, j], m] * gradient[a, j]


@kernel
def subtract_stiffness(
    points, cells, dN, xi, weights, middle, voigt, moduli, with_modes, material, slots, owner, part, data
):
    """Subtract the stiffness of condensed modes from `data` (n_blocks, dim, dim), in the rows of nodes that `part` owns.

    `slots`, `owner` and `part` are as in `element_2d_kernels.add_stiffness`, which checks that Jacobians are positive.
    """
    n_cells, n_nodes = cells.shape
    dim = points.shape[1]
    n_modes = 4 if dim == 2 else 13
    x, row, in_part = np.empty((n_nodes, dim)), np.empty(n_nodes * dim), np.empty(n_nodes, np.bool_)
    modal, mixed, factors = np.empty((n_modes, n_modes)), np.empty((n_modes, n_nodes * dim)), np.full(n_modes, -1.0)
    for c in range(n_cells):
        if not with_modes[material[c, 0]] or not find_owned(cells, c, owner, part, in_part):
            continue
        at_nodes(points, cells, c, x)
        _integrate(x, dN, xi, weights, middle, voigt, moduli, material[c], modal, mixed)
        forward_substitute(modal, mixed)
        add_products(factors, mixed, slots, c, in_part, row, data)


@kernel
def add_stress(
    points, cells, dN, xi, weights, middle, voigt, moduli, with_modes, material, displacement, subtracted, xi_out, dN_out,
    interpolation, out,
):  # fmt: skip
    """Add the stresses due to the modes to `out` (n_cells, n_out, n_components), in place.

    `displacement` (n_points, dim) contains the displacements, and `subtracted` (n_cells or 0, n_q, n_components) the stresses
    that were subtracted for temperature and initial states. The points of `out` are `xi_out` (n_out, dim). The shape
    derivatives there are `dN_out` (n_out, n_nodes, dim), and the weights of the quadrature points for the interpolation to
    these points are `interpolation` (n_out, n_q).
    """
    n_cells, n_nodes = cells.shape
    dim, size = points.shape[1], moduli.shape[1]
    n_modes = 4 if dim == 2 else 13
    x, u = np.empty((n_nodes, dim)), np.empty((n_nodes, dim))
    modal, mixed, force = np.empty((n_modes, n_modes)), np.empty((n_modes, n_nodes * dim)), np.empty((n_modes, 1))
    J, inverse, at_middle = np.empty((dim, dim)), np.empty((dim, dim)), np.empty((dim, dim))
    M, strain = np.empty((size, n_modes)), np.empty(size)
    for c in range(n_cells):
        if not with_modes[material[c, 0]]:
            continue
        at_nodes(points, cells, c, x)
        at_nodes(displacement, cells, c, u)
        _integrate(x, dN, xi, weights, middle, voigt, moduli, material[c], modal, mixed)
        middle_det = inverse_jacobian(x, middle, 0, J, at_middle)
        for m in range(n_modes):
            force[m, 0] = 0.0
            for k in range(n_nodes * dim):
                force[m, 0] -= mixed[m, k] * u[k // dim, k % dim]
        if subtracted.shape[0]:
            for q in range(weights.shape[0]):
                det = inverse_jacobian(x, dN, q, J, inverse)
                _modes(xi, q, at_middle, middle_det / det, voigt, M)
                for e in range(size):
                    for m in range(n_modes):
                        force[m, 0] += det * weights[q] * M[e, m] * subtracted[c, q, e]
        forward_substitute(modal, force)
        back_substitute(modal, force[:, 0])
        for k in range(xi_out.shape[0]):
            det = inverse_jacobian(x, dN_out, k, J, inverse)
            _modes(xi_out, k, at_middle, middle_det / det, voigt, M)
            for e in range(size):
                strain[e] = 0.0
                for m in range(n_modes):
                    strain[e] += M[e, m] * force[m, 0]
            for q in range(material.shape[1]):
                weight = 1.0 if material.shape[1] == 1 else interpolation[k, q]
                for e in range(size):
                    for f in range(size):
                        out[c, k, e] += weight * moduli[material[c, q], e, f] * strain[f]
