# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loop of bodies with nonlinear laws: tangent stiffness, internal forces, stress, energy, history.

In the reference configuration (total Lagrangian): nodal forces are integrals of P : dN/dX, the tangent is those of
dN/dX : A : dN/dX (Bonet and Wood, 2008, chapter 9). For small strains the same loop takes P as the Cauchy stress and J as
one plus the trace of the strain. Bodies that expand by a temperature are measured from where they would then be without
stress (an intermediate configuration: Lu and Pister, 1975): F is the elastic part of the deformation gradient.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.constitutive_kernels import add_second_derivative, cofactor, determinant, respond, voigt
from fastcontact.elasticity.element_2d_kernels import TWO_PI, owned
from fastcontact.mesh.jacobian_kernels import at_nodes, gradients, inverse_jacobian

# Newton iterations for the strain across plane stress, and when they end, relative to the modulus.
THROUGH, ENOUGH = 50, 1e-13
# What `linearise` returns beside the number of a cell.
INVERTED, NO_PLANE_STRESS = 1, 2


@kernel
def _gradients(x, N, dN, weights, axisymmetric, J, inverse, gradient, hoop, volume):
    """Fill shape derivatives `gradient` (n_q, n_nodes, dim), N / r in `hoop` (n_q, n_nodes), weights `volume` (n_q,)."""
    for q in range(N.shape[0]):
        volume[q] = weights[q] * inverse_jacobian(x, dN, q, J, inverse)
        gradients(dN, q, inverse, gradient[q])
        if axisymmetric:
            radius = 0.0
            for a in range(x.shape[0]):
                radius += N[q, a] * x[a, 0]
            volume[q] *= TWO_PI * radius
            for a in range(x.shape[0]):
                hoop[q, a] = N[q, a] / radius


@kernel
def _deformation(displacement, cell, gradient, hoop, F):
    """Fill F (3, 3) from shape derivatives (n_nodes, dim)."""
    F[:] = 0.0
    F[0, 0] = F[1, 1] = F[2, 2] = 1.0
    for a in range(gradient.shape[0]):
        for i in range(gradient.shape[1]):
            for j in range(gradient.shape[1]):
                F[i, j] += displacement[cell[a], i] * gradient[a, j]
        F[2, 2] += displacement[cell[a], 0] * hoop[a]


@kernel
def _expanded(strain, N, cell, rise, finite, F, gradient, hoop):
    """Take the expansion by a `rise` (n_points,) out of F, shape derivatives (n_nodes, dim) and `hoop` (n_nodes,), in place.

    `strain` (6,) is that of a degree, with engineering shears. Return the ratio of the volumes, and how much longer fibres
    along z are.
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
    dim = gradient.shape[1]
    gradient[:] = gradient @ np.ascontiguousarray(inverse[:dim, :dim])
    hoop *= inverse[2, 2]
    return ratio, U[2, 2]


@kernel
def _dilatation(F, finite, G):
    """Return J and fill G (3, 3) with its derivative; for small strains one plus the trace of the strain."""
    if finite:
        cofactor(F, G)
        return determinant(F)
    G[:] = 0.0
    G[0, 0] = G[1, 1] = G[2, 2] = 1.0
    return F[0, 0] + F[1, 1] + F[2, 2] - 2.0


@kernel
def _add_volumetric(F, G, pressure, turning, bulk, P, A):
    """Add the part of the dilatation: `pressure` times dJ/dF to P; to A its change by `bulk` with J, `turning` with dJ/dF."""
    for row in range(9):
        P[row // 3, row % 3] += pressure * G[row // 3, row % 3]
        for column in range(9):
            A[row, column] += bulk * G[row // 3, row % 3] * G[column // 3, column % 3]
    if turning != 0.0:
        add_second_derivative(F, turning, A)


@kernel
def _leave_out_initial_stress(G, J, P, turning, A):
    """Take delta_ik S_JL out of A, S being the second Piola-Kirchhoff stress of P and `turning` times G = dJ/dF.

    And what pressure, `turning` < 0, does as the dilatation varies inside of a cell.
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
    """Respond with the F_zz at which P_zz vanishes, eliminated from A; return the energy, and whether it was found.

    Without stress the body is `thicker` by this ratio.
    """
    F[2, 2] = (1.0 + old[8]) / thicker if finite else 2.0 + old[8] - thicker
    for _ in range(THROUGH):
        energy = respond(constants, D, F, old, new, P, A)
        J = _dilatation(F, finite, G)
        pressure = bulk * (J - 1.0)
        _add_volumetric(F, G, pressure, pressure if finite else 0.0, bulk, P, A)
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
def _add_tangent_in_space(gradient, weight, A, product, local):
    """As `_add_tangent`, with loop bounds that the compiler knows: the whole kernel takes 0.6 of the time on hex8."""
    for b in range(gradient.shape[0]):
        x, y, z = gradient[b, 0], gradient[b, 1], gradient[b, 2]
        for row in range(9):
            for k in range(3):
                product[row, k] = weight * (A[row, 3 * k] * x + A[row, 3 * k + 1] * y + A[row, 3 * k + 2] * z)
        for a in range(b + 1):
            x, y, z = gradient[a, 0], gradient[a, 1], gradient[a, 2]
            for i in range(3):
                for k in range(3):
                    local[a, b, i, k] += x * product[3 * i, k] + y * product[3 * i + 1, k] + z * product[3 * i + 2, k]


@kernel
def _add_tangent(gradient, hoop, weight, A, product, local):
    """Add a point's tangent to `local` (n_nodes, n_nodes, dim, dim), of nodes a <= b; `product` (9, dim) is room."""
    n_nodes, dim = gradient.shape
    if dim == 3:
        _add_tangent_in_space(gradient, weight, A, product, local)
        return
    for b in range(n_nodes):
        for row in range(9):
            if row != 8 and (row // 3 >= dim or row % 3 >= dim):
                continue
            for k in range(dim):
                value = 0.0
                for m in range(dim):
                    value += A[row, 3 * k + m] * gradient[b, m]
                if k == 0 and hoop[b] != 0.0:
                    value += A[row, 8] * hoop[b]
                product[row, k] = weight * value
        for a in range(b + 1):
            for i in range(dim):
                for k in range(dim):
                    value = 0.0
                    for j in range(dim):
                        value += gradient[a, j] * product[3 * i + j, k]
                    if i == 0 and hoop[a] != 0.0:
                        value += hoop[a] * product[8, k]
                    local[a, b, i, k] += value


@kernel
def _forces(gradient, hoop, weight, P, forces):
    """Add a point's nodal forces to `forces` (n_nodes, dim)."""
    for a in range(gradient.shape[0]):
        for i in range(gradient.shape[1]):
            for j in range(gradient.shape[1]):
                forces[a, i] += weight * P[i, j] * gradient[a, j]
        forces[a, 0] += weight * P[2, 2] * hoop[a]


@kernel
def _cauchy(F, P, finite, out):
    """Fill `out` with the Cauchy stress xx, yy, zz, xy, in 3D also yz, xz."""
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
def linearise(
    points, cells, N, dN, weights, polynomials, axisymmetric, plane_stress, finite, geometric, displacement,
    constants, moduli, bulk, expansion, rise,
    material, old, slots, owner, part, data, force, new, stress, energy,
):  # fmt: skip
    """Add the tangent to `data` (n_blocks, dim, dim) and forces to `force` (n_points, dim), in rows of nodes of a `part`.

    Of its cells, those whose first node it has, it fills the history `new` (n_cells, n_q, 9), the Cauchy `stress`
    (n_cells, n_q, n_components) and `energy` (n_cells, 2): elastic, plastic work. With `bulk` (n_materials, 2): bulk
    modulus of the dilatation projected on `polynomials` (n_q, m), and of the rest. Returns a status and the number of a
    cell, zero and -1 where all went well. A `rise` (n_points,) of the temperature, which may be empty, brings strains of
    `expansion` (n_materials, 6) a degree. With `geometric` 2 the tangent is whole; 1 leaves out how dJ/dF turns by pressure,
    0 the initial-stress stiffness and how dJ/dF turns under tension, so that it is positive semidefinite.
    """
    n_cells, n_nodes = cells.shape
    n_q, dim, m = N.shape[0], points.shape[1], polynomials.shape[1]
    gradient, hoop, volume = np.empty((n_q, n_nodes, dim)), np.zeros((n_q, n_nodes)), np.empty(n_q)
    x, jacobian, inverse = np.empty((n_nodes, dim)), np.empty((dim, dim)), np.empty((dim, dim))
    F, J, G, thicker = np.empty((n_q, 3, 3)), np.empty(n_q), np.empty((3, 3)), np.ones(n_q)
    P, A, product = np.empty((3, 3)), np.empty((9, 9)), np.empty((9, dim))
    local, forces = np.empty((n_nodes, n_nodes, dim, dim)), np.empty((n_nodes, dim))
    mass, projection, dilatation = np.empty((m, m)), np.empty((m, n_nodes * dim)), np.empty(m)
    history, mine = np.empty(9), np.empty(n_nodes, np.bool_)
    for c in range(n_cells):
        if not owned(cells, c, owner, part, mine):
            continue
        at_nodes(points, cells, c, x)
        _gradients(x, N, dN, weights, axisymmetric, jacobian, inverse, gradient, hoop, volume)
        whole = bulk[material[c, 0], 0]
        local[:], forces[:], mass[:], projection[:], dilatation[:] = 0.0, 0.0, 0.0, 0.0, 0.0
        for q in range(n_q):
            _deformation(displacement, cells[c], gradient[q], hoop[q], F[q])
            if len(rise):
                strain = expansion[material[c, q]]
                ratio, thicker[q] = _expanded(strain, N[q], cells[c], rise, finite, F[q], gradient[q], hoop[q])
                volume[q] *= ratio
            J[q] = _dilatation(F[q], finite, G)
            if finite and not (J[q] > 0.0):
                return INVERTED, c
            for k in range(m if whole > 0.0 else 0):
                share = volume[q] * polynomials[q, k]
                dilatation[k] += share * (J[q] - 1.0)
                for n in range(m):
                    mass[k, n] += share * polynomials[q, n]
                for a in range(n_nodes):
                    for i in range(dim):
                        value = G[2, 2] * hoop[q, a] if i == 0 else 0.0
                        for j in range(dim):
                            value += G[i, j] * gradient[q, a, j]
                        projection[k, a * dim + i] += share * value
        stored = dissipated = 0.0
        if whole > 0.0:
            solved = np.linalg.solve(mass, projection)
            coefficients = np.linalg.solve(mass, dilatation)
            stored += 0.5 * whole * (coefficients * dilatation).sum()
            for b in range(n_nodes):
                for a in range(b + 1):
                    for i in range(dim):
                        for k in range(dim):
                            for n in range(m):
                                local[a, b, i, k] += whole * projection[n, a * dim + i] * solved[n, b * dim + k]
        for q in range(n_q):
            row = material[c, q]
            law, rest = constants[row], bulk[row, 1]
            if plane_stress:
                own, settled = _through(law, moduli[row], rest, finite, thicker[q], F[q], old[c, q], history, P, A, G)
                if not settled:
                    return NO_PLANE_STRESS, c
                if finite and geometric == 0:
                    _leave_out_initial_stress(G, _dilatation(F[q], finite, G), P, 0.0, A)
            else:
                own = respond(law, moduli[row], F[q], old[c, q], history, P, A) + 0.5 * rest * (J[q] - 1.0) ** 2
                pressure = rest * (J[q] - 1.0)
                for k in range(m if whole > 0.0 else 0):
                    pressure += whole * polynomials[q, k] * coefficients[k]
                _dilatation(F[q], finite, G)
                turning = pressure if finite and geometric == 2 else 0.0
                if finite and geometric == 0:
                    turning = min(pressure, 0.0)
                    _leave_out_initial_stress(G, J[q], P, turning, A)
                _add_volumetric(F[q], G, pressure, turning, rest, P, A)
            stored += volume[q] * own
            dissipated += volume[q] * history[7]
            _add_tangent(gradient[q], hoop[q], volume[q], A, product, local)
            _forces(gradient[q], hoop[q], volume[q], P, forces)
            if mine[0]:
                new[c, q] = history
                _cauchy(F[q], P, finite, stress[c, q])
        if mine[0]:
            energy[c, 0], energy[c, 1] = stored, dissipated
        for b in range(n_nodes):
            if mine[b]:
                for i in range(dim):
                    force[cells[c, b], i] += forces[b, i]
            for a in range(b + 1):
                upper, lower = slots[c, a, b], slots[c, b, a]
                for i in range(dim):
                    for k in range(dim):
                        # The diagonal block is symmetric but for round-off.
                        value = local[a, b, i, k] if a != b or i <= k else local[a, b, k, i]
                        if mine[a]:
                            data[upper, i, k] += value
                        if a != b and mine[b]:
                            data[lower, k, i] += value
    return 0, -1
