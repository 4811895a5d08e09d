# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Constitutive laws at one quadrature point: first Piola-Kirchhoff stress, its derivative, and the history.

Shared arguments: ``F`` (3, 3) is the deformation gradient [-] and ``P`` (3, 3) the first Piola-Kirchhoff stress [pressure].
The first nine rows and columns of ``A`` (24, 12) contain its derivative dP/dF, in which component iJ has the index 3 i + J;
the other entries are work space. For laws at small strains, F is the displacement gradient and P the Cauchy stress.
`constants` (n_constants,) begin with the number of the law, see `nonlinear_materials`. `old` and `new` (9,) are the history
variables at the beginning and the end of the load step: the plastic strain (xx, yy, zz, xy, yz, xz, tensor
components), the equivalent plastic strain, the plastic work [energy / volume], and in plane stress F_zz - 1. At finite
strains, L - I takes the place of the plastic strain, where L is the lower triangular factor of the inverse plastic metric,
C_p^-1 = L L^T. For laws that have a bulk modulus, `evaluate_law` adds the volumetric part of P and A, and the element loop
adds that of the energy, U(J) = K (J - 1)^2 / 2. ``tangent`` states whether A is computed.
"""

import numpy as np

from fastcontact._jit.decorators import innermost_kernel, kernel
from fastcontact.elasticity.tile_product import tile

LINEAR, PLASTIC, SAINT_VENANT, INVARIANTS, OGDEN, LOGARITHMIC = range(6)
# First rows of the two groups of six rows of A that serve as work space, see `_multiply`.
LEFT, RIGHT = 12, 18
# Relative excess of the trial stress over the yield stress that is considered round-off.
YIELD_TOLERANCE = 1e-12
# Relative difference of squared stretches below which the tangent treats them as equal.
EQUAL_STRETCHES = 1e-7


@kernel
def determinant(F):
    """Return det F."""
    return (
        F[0, 0] * (F[1, 1] * F[2, 2] - F[1, 2] * F[2, 1])
        - F[0, 1] * (F[1, 0] * F[2, 2] - F[1, 2] * F[2, 0])
        + F[0, 2] * (F[1, 0] * F[2, 1] - F[1, 1] * F[2, 0])
    )


@kernel
def cofactor(F, G):
    """Fill G (3, 3) with dJ/dF = J F^-T."""
    for i in range(3):
        k, m = (i + 1) % 3, (i + 2) % 3
        for j in range(3):
            p, r = (j + 1) % 3, (j + 2) % 3
            G[i, j] = F[k, p] * F[m, r] - F[k, r] * F[m, p]


@innermost_kernel
def _add_second_derivative(F, factor, A):
    """Add factor d2J/dF2 to A (9, 9)."""
    for m in range(3 if factor != 0.0 else 0):
        i, k = (m + 1) % 3, (m + 2) % 3
        for n in range(3):
            j, p = (n + 1) % 3, (n + 2) % 3
            change = factor * F[m, n]
            A[3 * i + j, 3 * k + p] += change
            A[3 * k + p, 3 * i + j] += change
            A[3 * i + p, 3 * k + j] -= change
            A[3 * k + j, 3 * i + p] -= change


@kernel
def add_volumetric(F, G, volumetric, tangent, P, A):
    """Add the `volumetric` terms to P and, if `tangent` is true, to A; see `evaluate_law`."""
    pressure, bulk, d2J_factor = volumetric
    for i in range(3):
        for j in range(3):
            P[i, j] += pressure * G[i, j]
    for row in range(3 if tangent else 0):
        for i in range(3):
            factor = bulk * G[row, i]
            for column in range(3):
                for j in range(3):
                    A[3 * row + i, 3 * column + j] += factor * G[column, j]
    _add_second_derivative(F, d2J_factor, A)


@kernel
def right_cauchy_green(F, C):
    """Fill C (3, 3) with F^T F."""
    for i in range(3):
        for j in range(3):
            C[i, j] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]


@innermost_kernel
def voigt(i, j):
    """Return the number of component (i, j) in the order xx, yy, zz, xy, yz, xz."""
    if i == j:
        return i
    if i + j == 1:
        return 3
    return 4 if i + j == 3 else 5


@kernel
def _hooke(D, strain, stress):
    """Fill `stress` (3, 3) with D (6, 6) times a symmetric `strain` (3, 3); return half their product."""
    energy = 0.0
    for i in range(3):
        for j in range(3):
            row, value = voigt(i, j), 0.0
            for k in range(3):
                for m in range(3):
                    value += D[row, voigt(k, m)] * strain[k, m]
            stress[i, j] = value
            energy += 0.5 * value * strain[i, j]
    return energy


@kernel
def _linear(D, F, tangent, P, A):
    """Apply Hooke's law for small strains with moduli D (6, 6); return the energy density."""
    strain = 0.5 * (F + F.T)
    for row in range(9 if tangent else 0):
        for column in range(9):
            A[row, column] = D[voigt(row // 3, row % 3), voigt(column // 3, column % 3)]
    return _hooke(D, strain, P)


@innermost_kernel
def _yield_stress(constants, p):
    """Return the yield stress, its slope at the equivalent plastic strain p, and the end of this segment of the table."""
    n = int(constants[4])
    limit, slope, end = constants[4 + 2 * n], 0.0, np.inf
    for k in range(n - 2, -1, -1):
        p0, s0, p1, s1 = constants[5 + 2 * k], constants[6 + 2 * k], constants[7 + 2 * k], constants[8 + 2 * k]
        if p < p1:
            slope, end = (s1 - s0) / (p1 - p0), p1
            limit = s0 + slope * (p - p0)
    return limit, slope, end


@innermost_kernel
def _multiply(n, tangent, A):
    """Fill A with the sum of n dyadic products of its rows LEFT + k and RIGHT + k, if `tangent` is true."""
    for row in range(0, 12 if tangent else 0, 4):
        for column in range(0, 12, 4):
            tile(A, LEFT, row, A, RIGHT, column, n, A, row, True)


@innermost_kernel
def _radial_return(constants, trial, old):
    """Compute the radial return from the von Mises stress `trial` (Simo and Hughes, 1998, boxes 3.1 and 3.2).

    The results are the equivalent plastic strain, the plastic work without that of kinematic hardening, the ratio of the
    increment of plastic strain to the relative trial stress xi, and two coefficients of the moduli: twice the shear modulus
    and the factor of ``-xi xi``.
    """
    mu, H, p, work, equivalent, returned = constants[1], constants[3], old[6], old[7], trial, False
    limit, slope, end = _yield_stress(constants, p)
    while not returned and equivalent > limit * (1.0 + YIELD_TOLERANCE):
        step = min((equivalent - limit) / (3.0 * mu + H + slope), end - p)
        equivalent -= (3.0 * mu + H) * step
        work += (limit + 0.5 * slope * step) * step
        p += step
        returned = p < end
        limit, slope, end = _yield_stress(constants, p)
    increment, flow, rank_one = p - old[6], 0.0, 0.0
    if increment > 0.0:
        flow = 1.5 * increment / trial
        rank_one = 9.0 * mu * mu / trial**2 * (1.0 / (3.0 * mu + H + slope) - increment / trial)
    return p, work, flow, 2.0 * mu * (1.0 - 2.0 * mu * flow), rank_one


@innermost_kernel
def plastic(constants, F, tangent, old, new, P, A):
    """Apply von Mises plasticity by radial return; return the elastic energy.

    P, A and the energy are the deviatoric parts. Isotropic hardening is tabulated. Kinematic hardening is linear (Prager),
    with the modulus H. The relative trial stress xi is stored in the work space of A.
    """
    mu, H = constants[1], constants[3]
    mean, square = (F[0, 0] + F[1, 1] + F[2, 2]) / 3.0, 0.0
    for i in range(3):
        for j in range(3):
            strain = 0.5 * (F[i, j] + F[j, i]) - (mean if i == j else 0.0)
            P[i, j] = 2.0 * mu * strain
            xi = 2.0 * mu * strain - (2.0 * mu + 2.0 / 3.0 * H) * old[voigt(i, j)]
            A[RIGHT, 3 * i + j] = xi
            square += xi**2
    p, work, flow, shear, rank_one = _radial_return(constants, np.sqrt(1.5 * square), old)
    old_square = new_square = energy = 0.0
    for i in range(3):
        for j in range(3):
            c, xi = voigt(i, j), A[RIGHT, 3 * i + j]
            A[LEFT, 3 * i + j] = -rank_one * xi
            old_square += old[c] ** 2
            new[c] = old[c] + flow * xi
            new_square += new[c] ** 2
            P[i, j] -= 2.0 * mu * new[c]
            energy += P[i, j] * P[i, j] / (4.0 * mu)
    new[6], new[7] = p, work + H / 3.0 * (new_square - old_square)
    tangent |= p > old[6]
    _multiply(1, tangent, A)
    for i in range(3 if tangent else 0):
        for j in range(3):
            A[3 * i + j, 3 * i + j] += 0.5 * shear
            A[3 * i + j, 3 * j + i] += 0.5 * shear
            A[4 * i, 4 * j] -= shear / 3.0
    return energy


@kernel
def _diagonalise(C, axes):
    """Diagonalise the symmetric matrix C (3, 3) by Jacobi rotations, and fill the columns of `axes` with its eigenvectors.

    `axes` has the shape (3, 3). Only the upper triangle of C is used (Golub and Van Loan, 2013, section 8.5).
    """
    for i in range(3):
        for j in range(3):
            axes[i, j] = 1.0 if i == j else 0.0
    trace = C[0, 0] + C[1, 1] + C[2, 2]
    while trace + (abs(C[0, 1]) + abs(C[0, 2]) + abs(C[1, 2])) > trace:
        for k in range(2, -1, -1):
            p, q = (1 if k == 0 else 0), (1 if k == 2 else 2)
            if C[p, q] == 0.0:
                continue
            cotangent = 0.5 * (C[q, q] - C[p, p]) / C[p, q]  # of twice the angle of rotation
            t = np.copysign(1.0, cotangent) / (abs(cotangent) + np.sqrt(cotangent * cotangent + 1.0))
            c = 1.0 / np.sqrt(t * t + 1.0)
            s, change = t * c, t * C[p, q]
            C[p, p] -= change
            C[q, q] += change
            C[p, q] = 0.0
            low, high = (min(k, p), max(k, p)), (min(k, q), max(k, q))
            C[low], C[high] = c * C[low] - s * C[high], s * C[low] + c * C[high]
            for i in range(3):
                axes[i, p], axes[i, q] = c * axes[i, p] - s * axes[i, q], s * axes[i, p] + c * axes[i, q]


@kernel
def _from_principal_axes(F, axes, C, beta, gamma, shear, tangent, P, A):
    """Fill P and A, given stresses and moduli in the principal axes of the diagonalised right Cauchy-Green tensor C (3, 3).

    The columns of `axes` (3, 3) are the principal axes or, for elastic strains, their products with the factor L. `beta` (3,)
    contains the Kirchhoff stresses, and `gamma` (3, 3) their derivatives with respect to the logarithmic strains. In the
    plane normal to axis a, ``shear[a]`` is the ratio of shear components of the second Piola-Kirchhoff stress to those of C
    (Simo and Taylor, 1991, equation 2.28).
    """
    deformed = np.empty((3, 3))
    for i in range(3):
        for a in range(3):
            deformed[i, a] = F[i, 0] * axes[0, a] + F[i, 1] * axes[1, a] + F[i, 2] * axes[2, a]
    for i in range(3):
        for j in range(3):
            P[i, j] = 0.0
            for a in range(3):
                b, c = (a + 1) % 3, (a + 2) % 3
                A[LEFT + a, 3 * i + j] = deformed[i, a] * axes[j, a]
                A[LEFT + 3 + a, 3 * i + j] = deformed[i, b] * axes[j, c] + deformed[i, c] * axes[j, b]
                P[i, j] += beta[a] / C[a, a] * A[LEFT + a, 3 * i + j]
    for a in range(3 if tangent else 0):
        for e in range(9):
            A[RIGHT + a, e] = -2.0 * beta[a] / C[a, a] ** 2 * A[LEFT + a, e]
            A[RIGHT + 3 + a, e] = shear[a] * A[LEFT + 3 + a, e]
        for b in range(3):
            modulus = gamma[a, b] / (C[a, a] * C[b, b])
            for e in range(9):
                A[RIGHT + a, e] += modulus * A[LEFT + b, e]
    _multiply(6, tangent, A)
    for j in range(3 if tangent else 0):
        for m in range(3):
            S = 0.0
            for a in range(3):
                S += beta[a] / C[a, a] * axes[j, a] * axes[m, a]
            for i in range(3):
                A[3 * i + j, 3 * i + m] += S


@kernel
def _logarithmic(constants, F, tangent, old, new, P, A):
    """Apply plasticity with logarithmic elastic strains (Eterovic and Bathe, 1990; Simo, 1992); return the elastic energy.

    With the factor L of the plastic deformation at the beginning of the load step, the trial elastic strain is ln(C) / 2,
    where C = (F L)^T F L. The return to the yield surface and the exponential map, which integrates the plastic flow, leave
    the principal axes of C unchanged.
    """
    C, axes, L_axes, gamma = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    beta, shear, mu, square, energy = np.empty(3), np.empty(3), constants[1], 0.0, 0.0
    for i in range(3):
        for j in range(3):
            L_axes[i, j] = F[i, j]
            for k in range(j, 3):
                L_axes[i, j] += F[i, k] * old[voigt(k, j)]
    right_cauchy_green(L_axes, C)
    _diagonalise(C, axes)
    for a in range(3):
        beta[a] = mu * np.log(C[a, a])
    mean = (beta[0] + beta[1] + beta[2]) / 3.0
    for a in range(3):
        beta[a] -= mean
        square += beta[a] ** 2
        for i in range(3):
            L_axes[i, a] = axes[i, a]
            for k in range(i + 1):
                L_axes[i, a] += old[voigt(i, k)] * axes[k, a]
    new[6], new[7], flow, modulus, rank_one = _radial_return(constants, np.sqrt(1.5 * square), old)
    if flow > 0.0:
        _flow(L_axes, beta, flow, axes, gamma, new)
    for a in range(3):
        for b in range(3):
            gamma[a, b] = (modulus if a == b else 0.0) - modulus / 3.0 - rank_one * beta[a] * beta[b]
    for a in range(3):
        beta[a] *= 1.0 - 2.0 * mu * flow
        energy += beta[a] ** 2 / (4.0 * mu)
    for a in range(3):  # differences of stresses are formed from those of strains, without cancellation
        x, y = C[(a + 1) % 3, (a + 1) % 3], C[(a + 2) % 3, (a + 2) % 3]
        difference = (x - y) / y
        ratio = np.log1p(difference) / difference if difference != 0.0 else 1.0
        shear[a] = (0.5 * modulus * ratio - beta[(a + 2) % 3]) / (x * y)
    _from_principal_axes(F, L_axes, C, beta, gamma, shear, tangent, P, A)
    return energy


@kernel
def _flow(L_axes, xi, flow, scaled, L, new):
    """Replace the plastic strain in `new` by L - I at the end of the load step; see the module docstring.

    The columns of `L_axes` (3, 3) are the principal axes of the increment, multiplied by L at the beginning of the step. The
    increments along these axes are `flow` times `xi` (3,). `scaled` and L (3, 3) are overwritten.
    """
    for a in range(3):
        factor = np.exp(-flow * xi[a])
        for i in range(3):
            scaled[i, a] = factor * L_axes[i, a]
    for i in range(3):
        for j in range(i + 1):
            value = 0.0
            for a in range(3):
                value += scaled[i, a] * scaled[j, a]
            for k in range(j):
                value -= L[i, k] * L[j, k]
            L[i, j] = np.sqrt(value) if i == j else value / L[j, j]
            new[voigt(i, j)] = L[i, j] - (1.0 if i == j else 0.0)


@kernel
def _saint_venant(D, F, tangent, P, A):
    """Apply Hooke's law to Green-Lagrange strain and second Piola-Kirchhoff stress; return the energy density."""
    strain, S = np.empty((3, 3)), np.empty((3, 3))
    right_cauchy_green(F, strain)
    strain *= 0.5
    for i in range(3):
        strain[i, i] -= 0.5
    energy = _hooke(D, strain, S)
    for v in range(6):  # derivatives of the engineering strains
        m, n = (v, v) if v < 3 else (1 - v % 2, 1 + v // 4)
        for i in range(3):
            for j in range(3):
                A[LEFT + v, 3 * i + j] = F[i, n] if j == m else (F[i, m] if j == n else 0.0)
    for e in range(9):
        i, j = e // 3, e % 3
        P[i, j] = F[i, 0] * S[0, j] + F[i, 1] * S[1, j] + F[i, 2] * S[2, j]
        for v in range(6 if tangent else 0):
            A[RIGHT + v, e] = 0.0
            for w in range(6):
                A[RIGHT + v, e] += D[v, w] * A[LEFT + w, e]
    _multiply(6, tangent, A)
    for i in range(3 if tangent else 0):
        for j in range(3):
            for m in range(3):
                A[3 * i + j, 3 * i + m] += S[j, m]
    return energy


@innermost_kernel
def _add_isochoric(value, derivative, number, power, scale, J, G, dW, d2W, tangent, P, A):
    """Add to P and A the terms of a function of the isochoric invariant ``scale * value``, except for second derivatives.

    `scale` is ``J**-power``, and `derivative` (3, 3) is that of the value. `dW` and `d2W` are the first and second
    derivatives of the energy with respect to the invariant. The terms of A are stored in the rows LEFT, ``LEFT + number``
    and ``RIGHT + number``, see `first_invariant`. Returns the factors of the second derivatives of the value and of J.
    """
    inverse, factor = power / J, dW * scale
    ratio, GG_factor = inverse * value, factor * inverse * (inverse + 1.0 / J) * value
    curvature, mixed = d2W * scale * scale, factor * inverse
    for i in range(3):
        for j in range(3):
            change = derivative[i, j] - ratio * G[i, j]
            P[i, j] += factor * change
            if tangent:
                e = 3 * i + j
                A[RIGHT + number, e] = derivative[i, j]
                A[LEFT + number, e] = curvature * change - mixed * G[i, j]
                A[LEFT, e] += GG_factor * G[i, j] - mixed * derivative[i, j] - curvature * ratio * change
    return factor, -factor * ratio


@innermost_kernel
def first_invariant(constants, F, J, G, volumetric, tangent, P, A):
    """Fill P and the work space of A for a polynomial law of the isochoric first invariant with `volumetric` terms.

    The energy is C10 (I1 - 3) + C20 (I1 - 3)^2 + C30 (I1 - 3)^3 (Yeoh, 1993); see `evaluate_law` for the other terms. Except
    for second derivatives, the tangent is a sum of dyadic products of the rows LEFT + k and RIGHT + k of A. The rows
    from RIGHT on are G, F and, if there is another invariant, the derivative of half of it. Returns the energy density, the
    factors of the second derivatives of I1 / 2 (the identity) and J, I1 and ``J**(-2/3)``.
    """
    C10, C20, C30 = constants[3], constants[5], constants[6]
    pressure, bulk, d2J_factor = volumetric
    I1 = 0.0
    for i in range(3):
        for j in range(3):
            I1 += F[i, j] ** 2
            P[i, j] = pressure * G[i, j]
            if tangent:
                A[RIGHT, 3 * i + j], A[LEFT, 3 * i + j] = G[i, j], bulk * G[i, j]
    root = np.cbrt(J)
    scale = 1.0 / (root * root)
    x = scale * I1 - 3.0
    dW, d2W = C10 + 2.0 * C20 * x + 3.0 * C30 * x * x, 2.0 * C20 + 6.0 * C30 * x
    factor, J_factor = _add_isochoric(0.5 * I1, F, 1, 2.0 / 3.0, scale, J, G, 2.0 * dW, 4.0 * d2W, tangent, P, A)
    return C10 * x + C20 * x**2 + C30 * x**3, factor, d2J_factor + J_factor, I1, scale


@innermost_kernel
def sum_products(n, factor, d2J_factor, tangent, F, A):
    """Fill A with the n dyadic products of its work space and the terms with second derivatives, if `tangent` is true.

    For the work space and the factors, see `first_invariant`.
    """
    _multiply(n, tangent, A)
    for row in range(9 if tangent else 0):
        A[row, row] += factor
    _add_second_derivative(F, d2J_factor if tangent else 0.0, A)


@kernel
def _invariants(constants, F, J, G, volumetric, tangent, P, A):
    """Apply a polynomial law of the isochoric invariants (Rivlin and Saunders, 1951); see `first_invariant`."""
    C01 = constants[4]
    energy, factor, d2J_factor, I1, scale = first_invariant(constants, F, J, G, volumetric, tangent, P, A)
    if C01 != 0.0:
        return energy + _second_invariant(C01, I1, scale * scale, F, J, G, factor, d2J_factor, tangent, P, A)
    sum_products(2, factor, d2J_factor, tangent, F, A)
    return energy


@kernel
def _second_invariant(C01, I1, scale, F, J, G, factor, d2J_factor, tangent, P, A):
    """Add the term C01 (I2 - 3) of the energy to P, and fill A with all terms; return this term.

    `factor` and `d2J_factor` are results of `first_invariant`.
    """
    C, derivative, square = np.empty((3, 3)), np.empty((3, 3)), 0.0
    right_cauchy_green(F, C)
    for i in range(3):
        for j in range(3):
            derivative[i, j] = I1 * F[i, j] - F[i, 0] * C[0, j] - F[i, 1] * C[1, j] - F[i, 2] * C[2, j]
            square += C[i, j] ** 2
    I2 = 0.5 * (I1 * I1 - square)
    I2_factor, J_factor = _add_isochoric(0.5 * I2, derivative, 2, 4.0 / 3.0, scale, J, G, 2.0 * C01, 0.0, tangent, P, A)
    sum_products(3, factor + I2_factor * I1, d2J_factor + J_factor, tangent, F, A)
    for i in range(3 if tangent else 0):
        for j in range(3):
            for k in range(3):
                A[3 * i + j, 3 * i + k] -= I2_factor * C[k, j]
                A[3 * i + j, 3 * k + j] -= I2_factor * (F[i, 0] * F[k, 0] + F[i, 1] * F[k, 1] + F[i, 2] * F[k, 2])
                for m in range(3):
                    A[3 * i + j, 3 * k + m] += I2_factor * (2.0 * F[i, j] * F[k, m] - F[i, m] * F[k, j])
    return C01 * (scale * I2 - 3.0)


@kernel
def _ogden(constants, F, tangent, P, A):
    """Apply Ogden's law of the isochoric principal stretches; return the energy density.

    The energy is the sum of 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) (Ogden, 1972); the moduli in principal axes
    are those of Simo and Taylor (1991, equation 2.28).
    """
    n = int(constants[3])
    C, axes, gamma = np.empty((3, 3)), np.empty((3, 3)), np.zeros((3, 3))
    beta, shear, powers, energy = np.zeros(3), np.empty(3), np.empty(3), 0.0
    right_cauchy_green(F, C)
    _diagonalise(C, axes)
    scale = (C[0, 0] * C[1, 1] * C[2, 2]) ** (-1.0 / 6.0)
    for term in range(n):
        mu, alpha = constants[4 + 2 * term], constants[5 + 2 * term]
        for a in range(3):
            powers[a] = (scale * np.sqrt(C[a, a])) ** alpha
        total = powers[0] + powers[1] + powers[2]
        energy += 2.0 * mu / alpha**2 * (total - 3.0)
        for a in range(3):
            beta[a] += 2.0 * mu / alpha * (powers[a] - total / 3.0)
            for b in range(3):
                gamma[a, b] += 2.0 * mu * (total / 9.0 - (powers[a] + powers[b]) / 3.0)
            gamma[a, a] += 2.0 * mu * powers[a]
    for c in range(3):
        a, b = (c + 1) % 3, (c + 2) % 3
        x, y = C[a, a], C[b, b]
        shear[c] = 0.5 * (gamma[b, b] - 2.0 * beta[b] - gamma[a, b]) / (y * y)
        if abs(y - x) > EQUAL_STRETCHES * y:
            shear[c] = (beta[b] / y - beta[a] / x) / (y - x)
    _from_principal_axes(F, axes, C, beta, gamma, shear, tangent, P, A)
    return energy


@kernel
def evaluate_law(constants, D, F, J, G, volumetric, tangent, old, new, P, A):
    """Fill `new`, P and A according to the law of `constants`, and return the elastic energy [energy / volume].

    The energy does not include the volumetric part of the law. `volumetric` contains a pressure, a bulk modulus and a factor:
    P includes ``pressure dJ/dF``, and A includes ``bulk dJ/dF dJ/dF + factor d2J/dF2``. D (6, 6) contains the moduli of
    Hooke's law. J and G (3, 3) are the determinant of F and its derivative. If `tangent` is false, A is required only at
    small strains, and only where plastic flow occurs.
    """
    law = int(constants[0])
    for e in range(9):
        new[e] = old[e]
    if law == INVARIANTS:
        energy = _invariants(constants, F, J, G, volumetric, tangent, P, A)
    elif law == LINEAR:
        energy = _linear(D, F, tangent, P, A)
    elif law == PLASTIC:
        energy = plastic(constants, F, tangent, old, new, P, A)
    elif law == LOGARITHMIC:
        energy = _logarithmic(constants, F, tangent, old, new, P, A)
    elif law == SAINT_VENANT:
        energy = _saint_venant(D, F, tangent, P, A)
    else:
        energy = _ogden(constants, F, tangent, P, A)
    if law != INVARIANTS:
        add_volumetric(F, G, volumetric, tangent or new[6] > old[6], P, A)
    return energy
