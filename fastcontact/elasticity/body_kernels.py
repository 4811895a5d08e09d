# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loop of bodies with nonlinear laws: tangent stiffness, internal forces, stress, energy and history.

In the reference configuration (total Lagrangian), nodal forces are integrals of P : dN/dX, and the tangent consists of
integrals of dN/dX : A : dN/dX (Bonet and Wood, 2008, chapter 9). At small strains, P is the Cauchy stress and J is one plus
the trace of the strain. With thermal expansion, F is the elastic part of the deformation gradient, relative to the
stress-free intermediate configuration (Lu and Pister, 1975).
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.constitutive_kernels import add_second_derivative, cofactor, determinant, respond, voigt
from fastcontact.elasticity.dilatation_kernels import back_substitute, reduce
from fastcontact.elasticity.element_2d_kernels import TWO_PI, owned
from fastcontact.mesh.jacobian_kernels import at_nodes, gradients, inverse_jacobian

# Largest number of Newton iterations for the out-of-plane strain in plane stress, and tolerance relative to the modulus.
THROUGH, ENOUGH = 50, 1e-13
# Status codes of `linearise`, in addition to the number of a cell.
INVERTED, NO_PLANE_STRESS = 1, 2


@kernel
def _gradients(x, N, dN, weights, axisymmetric, J, inverse, at_point, gradient, hoop, volume):
    """Fill shape derivatives `gradient` (n_q, dim, n_nodes), N / r in `hoop` (n_q, n_nodes), weights `volume` (n_q,)."""
    for q in range(N.shape[0]):
        volume[q] = weights[q] * inverse_jacobian(x, dN, q, J, inverse)
        gradients(dN, q, inverse, at_point)
        for i in range(x.shape[1]):
            for a in range(x.shape[0]):
                gradient[q, i, a] = at_point[a, i]
        if axisymmetric:
            radius = 0.0
            for a in range(x.shape[0]):
                radius += N[q, a] * x[a, 0]
            volume[q] *= TWO_PI * radius
            for a in range(x.shape[0]):
                hoop[q, a] = N[q, a] / radius


@kernel
def _deformation(u, gradient, hoop, F):
    """Fill F (3, 3) from displacements u (n_nodes, dim) and shape derivatives (dim, n_nodes)."""
    F[:] = 0.0
    F[0, 0] = F[1, 1] = F[2, 2] = 1.0
    for a in range(u.shape[0]):
        for i in range(u.shape[1]):
            for j in range(u.shape[1]):
                F[i, j] += u[a, i] * gradient[j, a]
        F[2, 2] += u[a, 0] * hoop[a]


@kernel
def _expanded(strain, N, cell, rise, finite, F, gradient, hoop):
    """Remove the thermal expansion from F, the shape derivatives `gradient` (dim, n_nodes) and `hoop` (n_nodes,), in place.

    `rise` (n_points,) is the temperature rise, and `strain` (6,) the thermal strain per degree, with engineering shears.
    Returns the thermal volume ratio and the thermal stretch along z.
    """
    degrees = 0.0
    for a in range(len(cell)):
        degrees += N[a] * rise[cell[a]]
    U, inverse = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            U[i, j] = 1.0 + degrees * strain[i] if i == j else 0.5 * degrees * strain[voigt(i, j)]
    if not finite:
        F -= U
        for i in range(3):
            F[i, i] += 1.0
        return 1.0, U[2, 2]
    cofactor(U, inverse)
    ratio = determinant(U)
    inverse /= ratio
    F[:] = F @ inverse
    dim = gradient.shape[0]
    gradient[:] = np.ascontiguousarray(inverse[:dim, :dim].T) @ gradient
    hoop *= inverse[2, 2]
    return ratio, U[2, 2]


@kernel
def _dilatation(F, finite, G):
    """Return J and fill G (3, 3) with dJ/dF; at small strains, J is one plus the trace of the strain."""
    if finite:
        cofactor(F, G)
        return determinant(F)
    G[:] = 0.0
    G[0, 0] = G[1, 1] = G[2, 2] = 1.0
    return F[0, 0] + F[1, 1] + F[2, 2] - 2.0


@kernel
def _add_volumetric(F, G, pressure, turning, bulk, tangent, P, A):
    """Add the volumetric parts `pressure` dJ/dF to P and, if `tangent`, `bulk` dJ/dF dJ/dF + `turning` d2J/dF2 to A."""
    along = G.reshape(9)
    for row in range(9):
        P[row // 3, row % 3] += pressure * along[row]
        for column in range(9 if tangent else 0):
            A[row, column] += bulk * along[row] * along[column]
    if turning != 0.0:
        add_second_derivative(F, turning, A)


@kernel
def _leave_out_initial_stress(G, J, P, turning, A):
    """Subtract the initial-stress term delta_ik S_JL from A.

    S is the second Piola-Kirchhoff stress of P plus `turning` times G = dJ/dF. In compression, `turning` < 0, the effect of
    the variation of the dilatation within a cell is subtracted as well.
    """
    for row in range(9):
        for column in range(9):
            A[row, column] -= turning / J * G[row // 3, row % 3] * G[column // 3, column % 3]
    for j in range(3):
        for m in range(3):
            S = 0.0
            for k in range(3):
                S += G[k, j] * (P[k, m] + turning * G[k, m])
            for i in range(3):
                A[3 * i + j, 3 * i + m] -= S / J


@kernel
def _through(constants, D, bulk, finite, thicker, F, old, new, P, A, G):
    """Solve for the F_zz at which P_zz vanishes, and eliminate F_zz from A.

    `thicker` is the stress-free out-of-plane stretch. Returns the energy density, and whether the iteration converged.
    """
    F[2, 2] = (1.0 + old[8]) / thicker if finite else 2.0 + old[8] - thicker
    for _ in range(THROUGH):
        J = _dilatation(F, finite, G)
        energy = respond(constants, D, F, J, G, True, old, new, P, A)
        pressure = bulk * (J - 1.0)
        _add_volumetric(F, G, pressure, pressure if finite else 0.0, bulk, True, P, A)
        if not A[8, 8] > 0.0:
            return energy, False
        if abs(P[2, 2]) <= ENOUGH * A[8, 8]:
            new[8] = F[2, 2] * thicker - 1.0 if finite else F[2, 2] + thicker - 2.0
            for row in range(8):
                for column in range(8):
                    A[row, column] -= A[row, 8] * A[8, column] / A[8, 8]
            return energy + 0.5 * bulk * (J - 1.0) ** 2, True
        F[2, 2] = max(F[2, 2] - P[2, 2] / A[8, 8], 0.2 * F[2, 2])
    return 0.0, False


@kernel
def _respond(constants, D, bulk, pressure, thicker, plane_stress, finite, geometric, everywhere, F, old, new, P, A, G):
    """Fill the history `new` (9,), P and A of a point; return its energy density, and whether plane stress converged.

    `pressure` is the pressure of the projected dilatation and `bulk` the bulk modulus of its remainder. The other arguments
    are those of `linearise`, `_through` and `respond`.
    """
    if plane_stress:
        energy, settled = _through(constants, D, bulk, finite, thicker, F, old, new, P, A, G)
        if finite and geometric == 0:
            _leave_out_initial_stress(G, determinant(F), P, 0.0, A)
        return energy, settled
    J = _dilatation(F, finite, G)
    energy = respond(constants, D, F, J, G, everywhere, old, new, P, A) + 0.5 * bulk * (J - 1.0) ** 2
    pressure += bulk * (J - 1.0)
    turning = pressure if finite and geometric == 2 else 0.0
    if finite and geometric == 0:
        turning = min(pressure, 0.0)
        _leave_out_initial_stress(G, J, P, turning, A)
    _add_volumetric(F, G, pressure, turning, bulk, everywhere or new[6] > old[6], P, A)
    return energy, True


@kernel
def _subtract_elastic(constants, D, bulk, plane_stress, A):
    """Subtract the elastic tangent at small strains from A (9, 9), without the part of the projected dilatation."""
    none, new, P, G, of_elasticity = np.zeros(9), np.empty(9), np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9))
    _respond(constants, D, bulk, 0.0, 1.0, plane_stress, False, 2, True, np.eye(3), none, new, P, of_elasticity, G)
    A -= of_elasticity


@kernel
def _project(polynomials, volume, gradient, hoop, finite, F, G, mass, projected):
    """Project the dilatation of a cell on polynomials.

    Fills the Cholesky factor `mass` (m, m) of the mass matrix of the polynomials, and `projected` with the coefficients of
    the dilatation in the orthonormalised polynomials. The columns of `projected` (m, n_nodes * dim + 1) are the derivatives
    by the displacements of all nodes along x, then along y and z, and the coefficients. With a single column, it contains
    the coefficients only.
    """
    n_q, dim, n_nodes = gradient.shape
    last = projected.shape[1] - 1
    mass[:], projected[:] = 0.0, 0.0
    for q in range(n_q):
        J = _dilatation(F[q], finite, G)
        for k in range(polynomials.shape[1]):
            share = volume[q] * polynomials[q, k]
            for n in range(k + 1):
                mass[k, n] += share * polynomials[q, n]
            projected[k, last] += share * (J - 1.0)
            if last == 0:
                continue
            for i in range(dim):
                for j in range(dim):
                    for a in range(n_nodes):
                        projected[k, i * n_nodes + a] += share * G[i, j] * gradient[q, j, a]
            for a in range(n_nodes):
                projected[k, a] += share * G[2, 2] * hoop[q, a]
    reduce(mass, projected)


@kernel
def _pressures(bulk, polynomials, mass, projected, pressure):
    """Fill the `pressure` (n_q,) of the projected dilatation and return the energy of the projected dilatation."""
    m, last = projected.shape
    coefficients, energy = np.empty(m), 0.0
    for k in range(m):
        coefficients[k] = projected[k, last - 1]
        energy += 0.5 * bulk * coefficients[k] ** 2
    back_substitute(mass, coefficients)
    for q in range(polynomials.shape[0]):
        pressure[q] = 0.0
        for k in range(m):
            pressure[q] += bulk * polynomials[q, k] * coefficients[k]
    return energy


@kernel
def _add_projected_tangent(bulk, projected, local):
    """Add the stiffness of the projected dilatation to `local`, whose layout is that of `_add_tangent`."""
    n_nodes, dim = local.shape[0], local.shape[1]
    for b in range(n_nodes):
        for k in range(dim):
            for n in range(projected.shape[0]):
                factor = bulk * projected[n, k * n_nodes + b]
                for i in range(dim):
                    for a in range(b + 1):
                        local[b, k, i, a] += factor * projected[n, i * n_nodes + a]


@kernel
def _add_tangent(gradient, hoop, weight, A, product, local):
    """Add the tangent of a quadrature point to `local` (n_nodes b, dim k, dim i, n_nodes a) for a <= b.

    The change of P due to component k of node b is the product of columns of A with the shape derivatives of the node, of
    which the third one is along z or, in 2D, the hoop direction. `product` (9,) is work space.
    """
    dim, n_nodes = gradient.shape
    in_space, third = dim == 3, gradient[2] if dim == 3 else hoop
    for b in range(n_nodes):
        x, y, z = weight * gradient[0, b], weight * gradient[1, b], weight * third[b]
        for k in range(dim):
            column, last = (3 * k + 2, z) if in_space else (8, z if k == 0 else 0.0)
            for row in range(9):
                product[row] = A[row, 3 * k] * x + A[row, 3 * k + 1] * y + A[row, column] * last
            for i in range(dim):
                first, second = product[3 * i], product[3 * i + 1]
                rest = product[3 * i + 2] if in_space else (product[8] if i == 0 else 0.0)
                for a in range(b + 1):
                    local[b, k, i, a] += first * gradient[0, a] + second * gradient[1, a] + rest * third[a]


@kernel
def _forces(gradient, hoop, weight, P, forces):
    """Add the nodal forces of a quadrature point to `forces` (dim, n_nodes)."""
    for i in range(gradient.shape[0]):
        for j in range(gradient.shape[0]):
            for a in range(gradient.shape[1]):
                forces[i, a] += weight * P[i, j] * gradient[j, a]
    for a in range(gradient.shape[1]):
        forces[0, a] += weight * P[2, 2] * hoop[a]


@kernel
def _cauchy(F, P, finite, out):
    """Fill `out` with the Cauchy stress xx, yy, zz, xy and, in 3D, yz, xz."""
    J = determinant(F) if finite else 1.0
    for c in range(out.shape[0]):
        i, j = (c, c) if c < 3 else ((0, 1) if c == 3 else ((1, 2) if c == 4 else (0, 2)))
        if not finite:
            out[c] = P[i, j]
            continue
        value = 0.0
        for k in range(3):
            value += P[i, k] * F[j, k]
        out[c] = value / J


@kernel
def _assemble(local, slots, inside, data):
    """Add the stiffness of a cell to `data` (n_blocks, dim, dim), in the rows of nodes that are `inside`.

    Up to round-off, the block of a node pair is the transpose of the opposite block, and diagonal blocks are symmetric.
    """
    n_nodes, dim = local.shape[0], local.shape[1]
    for b in range(n_nodes):
        for a in range(b + 1):
            upper, lower = slots[a, b], slots[b, a]
            for i in range(dim):
                for k in range(dim):
                    value = local[b, k, i, a] if a != b or i <= k else local[b, i, k, a]
                    if inside[a]:
                        data[upper, i, k] += value
                    if a != b and inside[b]:
                        data[lower, k, i] += value


@kernel
def linearise(
    points, cells, N, dN, weights, polynomials, axisymmetric, plane_stress, finite, geometric, displacement,
    constants, moduli, bulk, expansion, rise,
    material, old, slots, owner, part, elastic, data, force, new, stress, energy,
):  # fmt: skip
    """Add the tangent to `data` (n_blocks, dim, dim) and forces to `force` (n_points, dim), in rows of nodes of a `part`.

    For the cells of the part, whose first node it owns, this fills the history `new` (n_cells, n_q, 9), the Cauchy `stress`
    (n_cells, n_q, n_components) and `energy` (n_cells, 2), the elastic energy and the plastic work. `bulk` (n_materials, 2)
    contains the bulk moduli of the dilatation projected on `polynomials` (n_q, m) and of its remainder. A temperature `rise`
    (n_points,), which may be empty, causes strains of `expansion` (n_materials, 6) per degree.

    With `geometric` 2, the tangent is complete; with 1, the second derivative of J is omitted; with 0, the initial-stress
    stiffness and, in tension, the second derivative of J are omitted, so that the tangent is positive semidefinite. If `data`
    is empty, no tangent is computed. If `elastic` is true, `data` contains the elastic tangent of small strains, and the
    difference is added at points with plastic flow. Returns a status and the number of a cell, zero and -1 on success.
    """
    n_cells, n_nodes = cells.shape
    n_q, dim, m, tangent = N.shape[0], points.shape[1], polynomials.shape[1], len(data) > 0
    gradient, hoop, volume = np.empty((n_q, dim, n_nodes)), np.zeros((n_q, n_nodes)), np.empty(n_q)
    x, u, at_point = np.empty((n_nodes, dim)), np.empty((n_nodes, dim)), np.empty((n_nodes, dim))
    jacobian, inverse = np.empty((dim, dim)), np.empty((dim, dim))
    F, G, thicker, pressure = np.empty((n_q, 3, 3)), np.empty((3, 3)), np.ones(n_q), np.empty(n_q)
    P, A, product, history = np.empty((3, 3)), np.empty((9, 9)), np.empty(9), np.empty(9)
    local, forces = np.empty((n_nodes, dim, dim, n_nodes)), np.empty((dim, n_nodes))
    mass, projected, inside = (
        np.empty((m, m)),
        np.empty((m, 1 if elastic else n_nodes * dim + 1)),
        np.empty(n_nodes, np.bool_),
    )
    for c in range(n_cells):
        if not owned(cells, c, owner, part, inside):
            continue
        at_nodes(points, cells, c, x)
        at_nodes(displacement, cells, c, u)
        _gradients(x, N, dN, weights, axisymmetric, jacobian, inverse, at_point, gradient, hoop, volume)
        for q in range(n_q):
            _deformation(u, gradient[q], hoop[q], F[q])
            if len(rise):
                strain = expansion[material[c, q]]
                ratio, thicker[q] = _expanded(strain, N[q], cells[c], rise, finite, F[q], gradient[q], hoop[q])
                volume[q] *= ratio
            if finite and not determinant(F[q]) > 0.0:
                return INVERTED, c
        local[:], forces[:], pressure[:] = 0.0, 0.0, 0.0
        stored, dissipated, mean, stiffens = 0.0, 0.0, bulk[material[c, 0], 0], tangent and not elastic
        if mean > 0.0:
            _project(polynomials, volume, gradient, hoop, finite, F, G, mass, projected)
            stored += _pressures(mean, polynomials, mass, projected, pressure)
            if tangent and not elastic:
                _add_projected_tangent(mean, projected, local)
        for q in range(n_q):
            row = material[c, q]
            density, settled = _respond(
                constants[row], moduli[row], bulk[row, 1], pressure[q], thicker[q], plane_stress, finite, geometric,
                not elastic, F[q], old[c, q], history, P, A, G,
            )  # fmt: skip
            if not settled:
                return NO_PLANE_STRESS, c
            stored += volume[q] * density
            dissipated += volume[q] * history[7]
            _forces(gradient[q], hoop[q], volume[q], P, forces)
            flows = history[6] > old[c, q, 6]
            if tangent and elastic and flows:
                _subtract_elastic(constants[row], moduli[row], bulk[row, 1], plane_stress, A)
            if tangent and (flows or not elastic):
                _add_tangent(gradient[q], hoop[q], volume[q], A, product, local)
                stiffens = True
            if inside[0]:
                new[c, q] = history
                _cauchy(F[q], P, finite, stress[c, q])
        if inside[0]:
            energy[c, 0], energy[c, 1] = stored, dissipated
        for b in range(n_nodes):
            if inside[b]:
                for i in range(dim):
                    force[cells[c, b], i] += forces[i, b]
        if stiffens:
            _assemble(local, slots[c], inside, data)
    return 0, -1
