# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Element loop of nonlinear bodies: tangent stiffness, internal forces, stresses, energies and history.

The formulation is total Lagrangian. Nodal forces are integrals of P . dN/dX over the reference configuration, and the tangent
consists of integrals of dN/dX . A . dN/dX (Bonet and Wood, 2008, chapter 9). At small strains, P is the Cauchy stress, J - 1
is the trace of the strain, and F denotes the displacement gradient, because the differences F - I and J - 1 would add
round-off to small strains. With thermal expansion, F is the elastic part of the deformation gradient, relative to the
stress-free intermediate configuration (Lu and Pister, 1975).

Shared arguments: ``finite`` states whether strains are finite; ``bulk`` is a bulk modulus [pressure]. ``constants``, D, F, P,
A, ``old`` and ``new`` are described in `constitutive_kernels`, ``slots``, ``owner`` and ``part`` in `element_2d_kernels`.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.elasticity.constitutive_kernels import (
    INVARIANTS,
    PLASTIC,
    add_volumetric,
    cofactor,
    determinant,
    evaluate_law,
    first_invariant,
    plastic,
    sum_products,
    voigt,
)
from fastcontact.elasticity.dilatation_kernels import back_substitute, forward_substitute
from fastcontact.elasticity.element_2d_kernels import TWO_PI, find_owned
from fastcontact.elasticity.element_3d_kernels import add_block
from fastcontact.elasticity.tile_product import tile
from fastcontact.mesh.jacobian_kernels import cofactors

# Largest number of Newton iterations for F_zz in plane stress, and tolerance of P_zz relative to its derivative.
MAX_ITERATIONS, TOLERANCE = 50, 1e-13
# Status codes that `linearise` returns together with the number of a cell; zero means success.
INVERTED, NO_PLANE_STRESS = 1, 2


@kernel
def _tables(dN, columns, rows):
    """Store dN (n_q, n_nodes, dim) in `columns` (n_nodes, n_rows) and, transposed, in `rows` (3 n_q, width).

    Column ``3 q + i`` of `columns`, and the same row of `rows`, contain the derivatives of all shape functions with respect
    to the reference coordinate i at point q. Other entries are zero; `n_rows` and `width` are multiples of four.
    """
    n_q, n_nodes, dim = dN.shape
    columns[:], rows[:] = 0.0, 0.0
    for q in range(n_q):
        for a in range(n_nodes):
            for i in range(dim):
                columns[a, 3 * q + i] = rows[3 * q + i, a] = dN[q, a, i]


@kernel
def _map(points, displacement, cells, c, columns, x, derivatives):
    """Fill `derivatives` (n_rows, 8) with those of positions (columns 0 to 2) and of displacements (columns 4 to 6).

    Row ``3 q + i`` belongs to point q and the reference coordinate i. `columns` (n_nodes, n_rows) contains the derivatives of
    the shape functions, see `_tables`. The positions and displacements of the nodes of cell `c` are stored in `x` (n_nodes,
    8).
    """
    n_nodes = cells.shape[1]
    for a in range(n_nodes):
        p = cells[c, a]
        for i in range(points.shape[1]):
            x[a, i], x[a, 4 + i] = points[p, i], displacement[p, i]
    for row in range(0, columns.shape[1], 4):
        tile(columns, 0, row, x, 0, 0, n_nodes, derivatives, row, True)
        tile(columns, 0, row, x, 0, 4, n_nodes, derivatives, row, True)


@kernel
def _deformation_gradient(derivatives, q, dim, rows, finite, inverse, gradient, F):
    """Fill F (3, 3) and, in `gradient` (n_q * 3 + 1, width), dN/dX at point q; return the determinant of dX/dxi.

    `derivatives` is computed by `_map`, and `rows` by `_tables`. `inverse` (3, 4) is filled with the inverse of dX/dxi. Row
    ``3 q + i`` of `gradient` contains the derivatives of all shape functions with respect to the coordinate i.
    """
    k, identity = 3 * q, 1.0 if finite else 0.0
    j00, j01, j02 = derivatives[k, 0], derivatives[k, 1], derivatives[k, 2]
    j10, j11, j12 = derivatives[k + 1, 0], derivatives[k + 1, 1], derivatives[k + 1, 2]
    j20, j21, j22 = derivatives[k + 2, 0], derivatives[k + 2, 1], 1.0 if dim == 2 else derivatives[k + 2, 2]
    c00, c01, c02, c10, c11, c12, c20, c21, c22 = cofactors(j00, j01, j02, j10, j11, j12, j20, j21, j22)
    det = j00 * c00 + j01 * c01 + j02 * c02
    factor = 1.0 / det
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = factor * c00, factor * c01, factor * c02
    inverse[1, 0], inverse[1, 1], inverse[1, 2] = factor * c10, factor * c11, factor * c12
    inverse[2, 0], inverse[2, 1], inverse[2, 2] = factor * c20, factor * c21, factor * c22
    for a in range(0, gradient.shape[1], 4):
        tile(inverse, 0, 0, rows, k, a, 3, gradient, k, True)
    for i in range(3):
        r, s, t = derivatives[k, 4 + i], derivatives[k + 1, 4 + i], derivatives[k + 2, 4 + i]
        for j in range(3):
            F[i, j] = r * inverse[0, j] + s * inverse[1, j] + t * inverse[2, j] + (identity if i == j else 0.0)
    return det


@kernel
def _add_hoop_terms(x, N, q, gradient, F):
    """Fill the third row of `gradient` of point q with N / r, add the hoop strain to F, and return 2 pi r."""
    radius = hoop = 0.0
    for a in range(len(x)):
        radius += N[q, a] * x[a, 0]
        hoop += N[q, a] * x[a, 4]
    for a in range(len(x)):
        gradient[3 * q + 2, a] = N[q, a] / radius
    F[2, 2] += hoop / radius
    return TWO_PI * radius


@kernel
def _remove_expansion(expansion, N, cell, rise, finite, F, gradient):
    """Remove thermal expansion from F and from the shape derivatives `gradient` (3, width), in place.

    `rise` (n_points,) is the temperature rise, and `expansion` (6,) the thermal strain per unit rise, with engineering shear
    strains. Returns the thermal volume ratio and the thermal strain along z.
    """
    rise_at_point, identity = 0.0, 1.0 if finite else 0.0
    for a in range(len(cell)):
        rise_at_point += N[a] * rise[cell[a]]
    U, inverse = np.empty((3, 3)), np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            U[i, j] = (
                identity + rise_at_point * expansion[i] if i == j else 0.5 * rise_at_point * expansion[voigt(i, j)]
            )
    if not finite:
        F -= U
        return 1.0, U[2, 2]
    cofactor(U, inverse)
    ratio = determinant(U)
    inverse /= ratio
    elastic, pulled_back = F @ inverse, np.ascontiguousarray(inverse.T) @ gradient
    for i in range(3):  # assigning to a slice would also compile the error message for wrong shapes
        for j in range(3):
            F[i, j] = elastic[i, j]
        for a in range(gradient.shape[1]):
            gradient[i, a] = pulled_back[i, a]
    return ratio, U[2, 2] - 1.0


@kernel
def _dilatation(F, finite, G):
    """Return J - 1 and fill G (3, 3) with dJ/dF."""
    if finite:
        cofactor(F, G)
        return determinant(F) - 1.0
    G[:] = 0.0
    G[0, 0] = G[1, 1] = G[2, 2] = 1.0
    return F[0, 0] + F[1, 1] + F[2, 2]


@kernel
def _subtract_initial_stress(omitted, G, J, P, pressure, d2J_factor, A):
    """Subtract the initial-stress term delta_ik S_JL from A if `omitted` is true.

    G (3, 3) is dJ/dF, and A contains `d2J_factor` times the second derivative of J, which may differ from `pressure`. S is
    the second Piola-Kirchhoff stress of the part ``P + (d2J_factor - pressure) G`` of P. In compression, where `d2J_factor`
    is negative, the part ``d2J_factor / J`` times the dyadic product of G with itself, which is due to the variation of the
    dilatation, is also subtracted.
    """
    for row in range(9 if omitted else 0):
        for column in range(9):
            A[row, column] -= d2J_factor / J * G[row // 3, row % 3] * G[column // 3, column % 3]
    for j in range(3 if omitted else 0):
        for m in range(3):
            S = 0.0
            for k in range(3):
                S += G[k, j] * (P[k, m] + (d2J_factor - pressure) * G[k, m])
            for i in range(3):
                A[3 * i + j, 3 * i + m] -= S / J


@kernel
def _solve_plane_stress(constants, D, bulk, finite, strain_z, F, old, new, P, A, G):
    """Solve for the value of F_zz at which P_zz vanishes, and eliminate F_zz from A.

    `strain_z` is the thermal strain along z. Returns the energy density, and whether the iteration has converged.
    """
    tangent = np.bool_(True)  # for a literal, Numba would compile the laws again
    F[2, 2] = (1.0 + old[8]) / (1.0 + strain_z) if finite else old[8] - strain_z
    for _ in range(MAX_ITERATIONS):
        dilatation = _dilatation(F, finite, G)
        pressure = bulk * dilatation
        volumetric = (pressure, bulk, pressure if finite else 0.0)
        energy = evaluate_law(constants, D, F, 1.0 + dilatation, G, volumetric, tangent, old, new, P, A)
        if not A[8, 8] > 0.0:
            return energy, False
        if abs(P[2, 2]) <= TOLERANCE * A[8, 8]:
            new[8] = F[2, 2] * (1.0 + strain_z) - 1.0 if finite else F[2, 2] + strain_z
            for row in range(8):
                for column in range(8):
                    A[row, column] -= A[row, 8] * A[8, column] / A[8, 8]
            return energy + 0.5 * bulk * dilatation**2, True
        corrected = F[2, 2] - P[2, 2] / A[8, 8]
        F[2, 2] = max(corrected, 0.2 * F[2, 2]) if finite else corrected
    return 0.0, False


@kernel
def _evaluate_point(
    constants, D, bulk, pressure, strain_z, plane_stress, finite, geometric, tangent, F, dilatation, G, old, new, P, A
):  # fmt: skip
    """Fill the history `new` (9,), P and A of a point; return its energy density, and whether plane stress has converged.

    `pressure` is due to the projected dilatation, and `bulk` is the bulk modulus of the unprojected `dilatation` J - 1, whose
    derivative is G (3, 3); see `linearise`. For the other arguments, see also `_solve_plane_stress` and `evaluate_law`.
    """
    omitted = finite and geometric == 0 and tangent
    if plane_stress:
        energy, converged = _solve_plane_stress(constants, D, bulk, finite, strain_z, F, old, new, P, A, G)
        _subtract_initial_stress(omitted, G, determinant(F), P, 0.0, 0.0, A)
        return energy, converged
    J = 1.0 + dilatation
    pressure += bulk * dilatation
    d2J_factor = pressure if finite and geometric == 2 and tangent else min(pressure, 0.0) if omitted else 0.0
    energy = evaluate_law(constants, D, F, J, G, (pressure, bulk, d2J_factor), tangent, old, new, P, A)
    _subtract_initial_stress(omitted, G, J, P, pressure, d2J_factor, A)
    return energy + 0.5 * bulk * dilatation**2, True


@kernel
def _elastic_tangent(constants, D, bulk, plane_stress):
    """Return A (24, 12) for small elastic strains, without the projected dilatation."""
    no_history, new, P, elastic = np.zeros(9), np.empty(9), np.empty((3, 3)), np.zeros((24, 12))
    F, G = np.zeros((3, 3)), np.empty((3, 3))
    finite, tangent, geometric = np.bool_(False), np.bool_(True), np.int64(2)  # no literals, see `_solve_plane_stress`
    dilatation = _dilatation(F, finite, G)
    _evaluate_point(
        constants, D, bulk, 0.0, 0.0, plane_stress, finite, geometric, tangent, F, dilatation, G, no_history, new, P, elastic
    )  # fmt: skip
    return elastic


@kernel
def _weighted_transpose(P, first, weight, dim, out, row):
    """Fill three rows of `out` (n_rows, 4), from `row` on, with `weight` times P.T; P begins at row `first` of its array.

    The third row is for the shape derivatives along z or, in axisymmetry, for N / r, which multiplies the radial
    displacement.
    """
    for i in range(3):
        for j in range(3):
            out[row + j, i] = weight * P[first + i, j]
    out[row + 2, 0] = weight * P[first + (2 if dim == 2 else 0), 2]


@kernel
def _integrate(factors, gradient, out, row):
    """Fill four rows of `out` (n_rows, width) with nodal forces, integrated over the points of a cell.

    `factors` (3 n_q, 4) is filled by `_weighted_transpose`.
    """
    for a in range(0, gradient.shape[1], 4):
        tile(factors, 0, 0, gradient, 0, a, len(factors), out, row, True)


@kernel
def _copy(source, first, out, row):
    """Copy the matrix (3, 3) that begins at row `first` of `source` to the rows of `out` from `row` on."""
    for i in range(3):
        for j in range(3):
            out[row + i, j] = source[first + i, j]


@kernel
def _project(polynomials, volume, gradient, dim, dilatation, G, factors, cholesky, projected, slopes):
    """Project the dilatation of a cell onto polynomials.

    G (3 n_q, 3) contains the derivatives of the `dilatation` (n_q,) with respect to F. The results are the lower
    triangular factor `cholesky` (m, m) of the mass matrix of the `polynomials` (n_q, m), which are integrated over the cell
    with `volume` (n_q,); the coefficients `projected` (m, 1) in the orthonormal basis that this factor defines; and, if the
    array is not empty, the derivatives `slopes` (4 m, width) of the coefficients with respect to the displacements, four rows
    for each polynomial.
    """
    m = len(cholesky)
    cholesky[:], projected[:] = 0.0, 0.0
    for k in range(m):
        for q in range(len(volume)):
            weight = volume[q] * polynomials[q, k]
            for n in range(k + 1):
                cholesky[k, n] += weight * polynomials[q, n]
            projected[k, 0] += weight * dilatation[q]
            _weighted_transpose(G, 3 * q, weight, dim, factors, 3 * q)
        if len(slopes):
            _integrate(factors, gradient, slopes, 4 * k)
    forward_substitute(cholesky, projected)
    for k in range(m if len(slopes) else 0):
        for n in range(k):
            for i in range(4):
                for a in range(slopes.shape[1]):
                    slopes[4 * k + i, a] -= cholesky[k, n] * slopes[4 * n + i, a]
        for i in range(4):
            for a in range(slopes.shape[1]):
                slopes[4 * k + i, a] /= cholesky[k, k]


@kernel
def _pressures(bulk, polynomials, cholesky, projected, pressure):
    """Fill the `pressure` (n_q,) due to the projected dilatation, and return its energy."""
    m = len(projected)
    coefficients, energy = np.empty(m), 0.0
    for k in range(m):
        coefficients[k] = projected[k, 0]
        energy += 0.5 * bulk * coefficients[k] ** 2
    back_substitute(cholesky, coefficients)
    for q in range(polynomials.shape[0]):
        pressure[q] = 0.0
        for k in range(m):
            pressure[q] += bulk * polynomials[q, k] * coefficients[k]
    return energy


@kernel
def _store_tangent(gradient, q, weight, A, dim, n, left, right):
    """Store the factors of the stiffness at point q for `_stiffness`, in three rows from n on.

    The weighted shape derivatives are stored in `left` (3 n_q, width). The products of the blocks (i, k) of A and the shape
    derivatives, for the pairs i <= k of displacement components, are stored in `right` (n_pairs * (3 n_q + 1), width). If dim
    is 2, the row and the column zz of A are first moved to xz, because the third shape derivative multiplies the radial
    displacement.
    """
    step, pair = len(left) + 1, 0
    for e in range(9 if dim == 2 else 0):
        A[2, e], A[5, e] = A[8, e], 0.0
    for e in range(9 if dim == 2 else 0):
        A[e, 2], A[e, 5] = A[e, 8], 0.0
    for row in range(3):
        for a in range(left.shape[1]):
            left[n + row, a] = weight * gradient[3 * q + row, a]
    for k in range(dim):
        for i in range(k + 1):
            for a in range(0, left.shape[1], 4):
                tile(A, 3 * i, 3 * k, gradient, 3 * q, a, 3, right, pair * step + n, True)
            pair += 1


@kernel
def _stiffness(left, right, n, dim, bulk, slopes, local):
    """Fill the stiffness `local` (n_pairs * width, width) from n rows of factors and the projected dilatation.

    The block of a pair i <= k has rows for component k of the nodes b, and columns for component i of the nodes a. If i = k,
    only tiles up to the diagonal are filled.
    """
    step, width, pair = len(left) + 1, left.shape[1], 0
    weighted = bulk * slopes
    for k in range(dim):
        for i in range(k + 1):
            for b in range(0, width, 4):
                for a in range(0, b + 4 if i == k else width, 4):
                    out_row = pair * width + b
                    tile(left, 0, b, right, pair * step, a, n, local, out_row, True)
                    for m in range(0, len(weighted), 4):
                        tile(weighted, m + k, b, slopes, m + i, a, 1, local, out_row, False)
            pair += 1


@kernel
def _cauchy(F, P, finite, c, q, out):
    """Fill `out` at point q of cell `c` with the Cauchy stress xx, yy, zz, xy and, in 3D, yz, xz."""
    factor = 1.0 / determinant(F) if finite else 1.0
    for e in range(out.shape[2]):
        i, j = (e, e) if e < 3 else ((0, 1) if e == 3 else ((1, 2) if e == 4 else (0, 2)))
        out[c, q, e] = factor * (P[i, 0] * F[j, 0] + P[i, 1] * F[j, 1] + P[i, 2] * F[j, 2]) if finite else P[i, j]


@kernel
def _assemble(local, slots, in_part, data):
    """Add the stiffness of a cell, see `_stiffness`, to `data` (n_blocks, dim, dim), in rows of nodes marked in `in_part`.

    The blocks (a, b) and (b, a) of a node pair are transposes of each other, and diagonal blocks are symmetric.
    """
    n_nodes, dim, width, flat = len(slots), data.shape[1], local.shape[1], data.reshape(-1)
    for b in range(n_nodes):
        for a in range(b + 1):
            upper, lower, add_upper, add_lower = slots[a, b], slots[b, a], in_part[a], in_part[b]
            xx, xy, yx, yy = local[b, a], local[width + b, a], local[width + a, b], local[2 * width + b, a]
            if dim == 3:
                xz, zx = local[3 * width + b, a], local[3 * width + a, b]
                yz, zy, zz = local[4 * width + b, a], local[4 * width + a, b], local[5 * width + b, a]
                add_block(flat, add_upper, add_lower, upper, lower, (xx, xy, xz, yx, yy, yz, zx, zy, zz))
                continue
            if add_upper:
                for e, value in enumerate((xx, xy, yx, yy)):
                    flat[4 * upper + e] += value
            if a != b and add_lower:
                for e, value in enumerate((xx, yx, xy, yy)):
                    flat[4 * lower + e] += value


@kernel
def linearise(
    points, cells, N, dN, weights, polynomials, axisymmetric, plane_stress, finite, geometric, displacement,
    constants, moduli, bulk, expansion, rise,
    material, old, slots, owner, part, has_elastic, data, force, new, stress, energy,
):  # fmt: skip
    """Add the tangent to `data` (n_blocks, dim, dim) and forces to `force` (n_points, dim), in the rows of nodes of `part`.

    For cells whose first node belongs to the part, this fills the history `new` (n_cells, n_q, 9), the Cauchy `stress`
    (n_cells, n_q, n_components) and `energy` (n_cells, 2), the elastic energy and the plastic work. `bulk` (n_materials, 2)
    contains the two parts of the bulk modulus: the first multiplies the dilatation projected onto `polynomials` (n_q, m), and
    the second the unprojected dilatation at each point. A temperature `rise` (n_points,), which may be empty, causes the
    strains `expansion` (n_materials, 6) per unit rise.

    With ``geometric = 2``, the tangent is complete. With 1, the second derivative of J is omitted. With 0, the initial-stress
    stiffness and, in tension, the second derivative of J are omitted, so that the tangent is positive semidefinite. If `data`
    is empty, no tangent is computed. If `has_elastic` is true, `data` must already contain the elastic tangent of small
    strains, and only the difference from it is added, at points with plastic flow. Returns a status code and the number of
    the cell that caused it, or 0 and -1.
    """
    n_cells, n_nodes = cells.shape
    n_q, dim, m, tangent = N.shape[0], points.shape[1], polynomials.shape[1], len(data) > 0
    full_tangent, width, n_pairs = tangent and not has_elastic, -(-n_nodes // 4) * 4, dim * (dim + 1) // 2
    columns, rows = np.empty((n_nodes, -(-3 * n_q // 4) * 4)), np.empty((3 * n_q, width))
    _tables(dN, columns, rows)
    x, derivatives, inverse = np.zeros((n_nodes, 8)), np.empty((columns.shape[1], 8)), np.zeros((3, 4))
    gradient, volume, forces = np.empty((3 * n_q + 1, width)), np.empty(n_q), np.empty((4, width))
    F, G, Fs, Gs = np.empty((3, 3)), np.empty((3, 3)), np.empty((3 * n_q, 3)), np.empty((3 * n_q, 3))
    dilatation, strain_z, pressure = np.empty(n_q), np.zeros(n_q), np.empty(n_q)
    P, A, in_part = np.empty((3, 3)), np.zeros((24, 12)), np.empty(n_nodes, np.bool_)
    before, after, factors = np.zeros(9), np.zeros(9), np.zeros((3 * n_q, 4))
    left, right = np.empty((3 * n_q, width)), np.empty((n_pairs * (3 * n_q + 1), width))
    local = np.empty((n_pairs * width, width))
    cholesky, projected, slopes = np.empty((m, m)), np.empty((m, 1)), np.empty((4 * m if full_tangent else 0, width))
    # Numba counts references to arrays by atomic operations where views are created, and in functions that call others in
    # branches. In `_evaluate_point`, this would take as long as the law of the first invariant itself, which is therefore
    # called directly in this function.
    row, law, D, direct, yields, elastic_tangent = -1, constants[0], moduli[0], False, False, A
    for c in range(n_cells):
        if not find_owned(cells, c, owner, part, in_part):
            continue
        _map(points, displacement, cells, c, columns, x, derivatives)
        for q in range(n_q):
            volume[q] = weights[q] * _deformation_gradient(derivatives, q, dim, rows, finite, inverse, gradient, F)
            if axisymmetric:
                volume[q] *= _add_hoop_terms(x, N, q, gradient, F)
            if len(rise):
                expansion_of_q, rows_of_q = expansion[material[c, q]], slice(3 * q, 3 * q + 3)
                ratio, strain_z[q] = _remove_expansion(
                    expansion_of_q, N[q], cells[c], rise, finite, F, gradient[rows_of_q]
                )
                volume[q] *= ratio
            dilatation[q] = _dilatation(F, finite, G)
            if finite and not dilatation[q] > -1.0:
                return INVERTED, c
            _copy(F, 0, Fs, 3 * q)
            _copy(G, 0, Gs, 3 * q)
        pressure[:] = 0.0
        stored, dissipated, bulk_mean, n_factors = 0.0, 0.0, bulk[material[c, 0], 0], 0
        if bulk_mean > 0.0:
            _project(polynomials, volume, gradient, dim, dilatation, Gs, factors, cholesky, projected, slopes)
            stored += _pressures(bulk_mean, polynomials, cholesky, projected, pressure)
        for q in range(n_q):
            if material[c, q] != row:
                row = material[c, q]
                law, D = constants[row], moduli[row]
                direct = finite and geometric == 2 and not plane_stress and law[0] == INVARIANTS and law[4] == 0.0
                yields = law[0] == PLASTIC and not plane_stress
                if tangent and has_elastic and law[0] == PLASTIC:
                    elastic_tangent = _elastic_tangent(law, D, bulk[row, 1], plane_stress)
            for e in range(9 if len(new) else 0):
                before[e] = old[c, q, e]
            _copy(Fs, 3 * q, F, 0)
            _copy(Gs, 3 * q, G, 0)
            if direct:
                J, total = 1.0 + dilatation[q], pressure[q] + bulk[row, 1] * dilatation[q]
                volumetric = total, bulk[row, 1], total
                density, factor, d2J_factor, _, _ = first_invariant(law, F, J, G, volumetric, full_tangent, P, A)
                sum_products(2, factor, d2J_factor, full_tangent, F, A)
                density += 0.5 * bulk[row, 1] * dilatation[q] ** 2
            elif yields:
                density = plastic(law, F, full_tangent, before, after, P, A)
                volumetric = pressure[q] + bulk[row, 1] * dilatation[q], bulk[row, 1], 0.0
                add_volumetric(F, G, volumetric, full_tangent or after[6] > before[6], P, A)
                density += 0.5 * bulk[row, 1] * dilatation[q] ** 2
                dissipated += volume[q] * after[7]
            else:
                density, converged = _evaluate_point(
                    law, D, bulk[row, 1], pressure[q], strain_z[q], plane_stress, finite, geometric, full_tangent, F,
                    dilatation[q], G, before, after, P, A,
                )  # fmt: skip
                if not converged:
                    return NO_PLANE_STRESS, c
                dissipated += volume[q] * after[7]
            stored += volume[q] * density
            _weighted_transpose(P, 0, volume[q], dim, factors, 3 * q)
            flows = not direct and after[6] > before[6]
            for e in range(9 if tangent and has_elastic and flows else 0):
                for k in range(9):
                    A[e, k] -= elastic_tangent[e, k]
            if tangent and (flows or not has_elastic):
                _store_tangent(gradient, q, volume[q], A, dim, n_factors, left, right)
                n_factors += 3
            if in_part[0]:
                for e in range(9 if len(new) else 0):
                    new[c, q, e] = before[e] if direct else after[e]
                _cauchy(F, P, finite, c, q, stress)
        _integrate(factors, gradient, forces, 0)
        if in_part[0]:
            energy[c, 0], energy[c, 1] = stored, dissipated
        for b in range(n_nodes):
            if in_part[b]:
                for i in range(dim):
                    force[cells[c, b], i] += forces[i, b]
        if n_factors:
            _stiffness(left, right, n_factors, dim, bulk_mean, slopes if bulk_mean > 0.0 else slopes[:0], local)
            _assemble(local, slots[c], in_part, data)
    return 0, -1
