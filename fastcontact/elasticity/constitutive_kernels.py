# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Constitutive laws at one quadrature point: first Piola-Kirchhoff stress, its derivative, and the history.

Shared arguments: ``F`` (3, 3) is the deformation gradient [-] and ``P`` (3, 3) the first Piola-Kirchhoff stress [pressure].
The first nine rows and columns of ``A`` (18, 12) contain its derivative dP/dF, in which component iJ has the index 3 i + J;
the other entries are work space. For laws at small strains, F is the displacement gradient and P the Cauchy stress.
`constants` (n_constants,) begin with the number of the law, see `nonlinear_materials`. `old` and `new` (9,) are the history
variables at the beginning and the end of the load step: the plastic strain (xx, yy, zz, xy, yz, xz, tensor
components), the equivalent plastic strain, the plastic work [energy / volume], and in plane stress F_zz - 1. At finite
strains, L - I takes the place of the plastic strain, where L is the lower triangular factor of the inverse plastic metric,
C_p^-1 = L L^T. For laws that have a bulk modulus, `evaluate_law` adds the volumetric part of P and A, and the element loop
adds that of the energy, U(J) = K (J - 1)^2 / 2.
"""

import numpy as np

from fastcontact._jit.decorators import innermost_kernel, kernel
from fastcontact.elasticity.tile_product import tile

LINEAR, PLASTIC, SAINT_VENANT, INVARIANTS, OGDEN, LOGARITHMIC = range(6)
# First rows of the two groups of rows of A that `first_invariant` uses as work space.
LEFT, RIGHT = 12, 15
# Relative excess of the trial stress over the yield stress that is considered round-off.
YIELD_TOLERANCE = 1e-12
# Relative difference of squared stretches below which the tangent treats them as equal.
EQUAL_STRETCHES = 1e-7
# Relative difference of squared stretches below which second divided differences are computed by a series.
SERIES_LIMIT = 1e-3


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
def _add_volumetric(F, G, volumetric, tangent, P, A):
    """Add the `volumetric` terms to P and, if `tangent` is true, to A; see `evaluate_law`."""
    pressure, bulk, d2J_factor = volumetric
    for i in range(3):
        for j in range(3):
            P[i, j] += pressure * G[i, j]
    for row in range(9 if tangent else 0):  # reshaping G would take longer than the loops
        factor = bulk * G[row // 3, row % 3]
        for column in range(9):
            A[row, column] += factor * G[column // 3, column % 3]
    _add_second_derivative(F, d2J_factor, A)


@kernel
def right_cauchy_green(F, C):
    """Fill C (3, 3) with F^T F."""
    for i in range(3):
        for j in range(3):
            C[i, j] = F[0, i] * F[0, j] + F[1, i] * F[1, j] + F[2, i] * F[2, j]


@kernel
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


@kernel
def _yield_stress(constants, p):
    """Return the yield stress, its slope at the equivalent plastic strain p, and the end of this segment of the table."""
    n = int(constants[4])
    for k in range(n - 1):
        p0, s0, p1, s1 = constants[5 + 2 * k], constants[6 + 2 * k], constants[7 + 2 * k], constants[8 + 2 * k]
        if p < p1:
            slope = (s1 - s0) / (p1 - p0)
            return s0 + slope * (p - p0), slope, p1
    return constants[4 + 2 * n], 0.0, np.inf


@kernel
def _plastic(constants, F, tangent, old, new, P, A):
    """Apply von Mises plasticity by radial return (Simo and Hughes, 1998, boxes 3.1, 3.2); return the elastic energy.

    P, A and the energy are the deviatoric parts. Isotropic hardening is tabulated. Kinematic hardening is linear (Prager),
    with the modulus H.
    """
    mu, H, xi = constants[1], constants[3], np.empty(9)
    mean, square = (F[0, 0] + F[1, 1] + F[2, 2]) / 3.0, 0.0
    for i in range(3):
        for j in range(3):
            strain = 0.5 * (F[i, j] + F[j, i]) - (mean if i == j else 0.0)
            xi[3 * i + j] = 2.0 * mu * strain - (2.0 * mu + 2.0 / 3.0 * H) * old[voigt(i, j)]
            square += xi[3 * i + j] ** 2
    trial = np.sqrt(1.5 * square)
    p, work, equivalent = old[6], old[7], trial
    limit, slope, end = _yield_stress(constants, p)
    while equivalent > limit * (1.0 + YIELD_TOLERANCE):
        step = min((equivalent - limit) / (3.0 * mu + H + slope), end - p)
        equivalent -= (3.0 * mu + H) * step
        work += (limit + 0.5 * slope * step) * step
        p += step
        if p < end:
            break
        limit, slope, end = _yield_stress(constants, p)
    increment = p - old[6]
    flow = 1.5 * increment / trial if increment > 0.0 else 0.0
    new[6] = p
    old_square = new_square = energy = 0.0
    for i in range(3):
        for j in range(3):
            c = voigt(i, j)
            old_square += old[c] ** 2
            new[c] = old[c] + flow * xi[3 * i + j]
            new_square += new[c] ** 2
            P[i, j] = 2.0 * mu * (0.5 * (F[i, j] + F[j, i]) - (mean if i == j else 0.0) - new[c])
            energy += P[i, j] * P[i, j] / (4.0 * mu)
    new[7] = work + H / 3.0 * (new_square - old_square)
    if not (tangent or increment > 0.0):
        return energy
    shear = 2.0 * mu * (1.0 - 2.0 * mu * flow)
    rank_one = 0.0
    if increment > 0.0:
        rank_one = 9.0 * mu * mu / trial**2 * (1.0 / (3.0 * mu + H + slope) - increment / trial)
    for row in range(9):
        for column in range(9):
            A[row, column] = -rank_one * xi[row] * xi[column]
    for i in range(3):
        for j in range(3):
            A[3 * i + j, 3 * i + j] += 0.5 * shear
            A[3 * i + j, 3 * j + i] += 0.5 * shear
            A[4 * i, 4 * j] -= shear / 3.0
    return energy


@kernel
def _first_piola_kirchhoff(F, S, P):
    """Fill P with ``F S``, where S (3, 3) is the second Piola-Kirchhoff stress."""
    for i in range(3):
        for j in range(3):
            P[i, j] = F[i, 0] * S[0, j] + F[i, 1] * S[1, j] + F[i, 2] * S[2, j]


@kernel
def _push_forward(F, S, C, A):
    """Fill A, given the second Piola-Kirchhoff stress S (3, 3) and its moduli C (9, 9) for Green-Lagrange strains."""
    pushed = np.empty((9, 9))
    for i in range(3):
        for j in range(3):
            for column in range(9):
                value = 0.0
                for k in range(3):
                    value += F[i, k] * C[3 * k + j, column]
                pushed[3 * i + j, column] = value
    for row in range(9):
        for k in range(3):
            for m in range(3):
                value = S[row % 3, m] if row // 3 == k else 0.0
                for n in range(3):
                    value += pushed[row, 3 * n + m] * F[k, n]
                A[row, 3 * k + m] = value


@kernel
def _first_difference(x, y):
    """Return the divided difference of ln(x) / 2 at x and y."""
    difference = (x - y) / y
    return 0.5 / x if difference == 0.0 else 0.5 * np.log1p(difference) / (x - y)


@kernel
def _second_difference(x, y, z):
    """Return the second divided difference of ln(x) / 2 at x <= y <= z."""
    if z - x > SERIES_LIMIT * z:
        return (_first_difference(y, z) - _first_difference(x, y)) / (z - x)
    mean = (x + y + z) / 3.0
    a, b, c = x / mean - 1.0, y / mean - 1.0, z / mean - 1.0
    return ((a**3 + b**3 + c**3) / 15.0 - (a * a + b * b + c * c) / 8.0 - 0.5) * 0.5 / mean**2


@kernel
def _logarithmic(constants, F, tangent, old, new, P, A):
    """Apply plasticity with logarithmic elastic strains (Eterovic and Bathe, 1990; Simo, 1992); return the elastic energy.

    With the factor L of the plastic deformation at the beginning of the load step, the trial elastic strain is ln(C) / 2,
    where C = (F L)^T F L. `_plastic` relates it to its conjugate stress T. The plastic flow is integrated by the exponential
    map in the principal axes of C. Derivatives of the strain in principal axes are divided differences of the logarithm
    (Daleckii and Krein).
    """
    C, T, D, L = np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9)), np.eye(3)
    for i in range(3):
        for j in range(i + 1):
            L[i, j] += old[voigt(i, j)]
    right_cauchy_green(F @ L, C)
    squared, axes = np.linalg.eigh(C)
    without_strain = old.copy()
    without_strain[:6] = 0.0
    with_moduli = np.bool_(True)  # for a literal, Numba would compile the law again
    energy = _plastic(constants, (axes * (0.5 * np.log(squared))) @ axes.T, with_moduli, without_strain, new, T, D)
    slope, L_axes = np.empty((3, 3)), L @ axes
    _flow(L_axes, axes, old, new)
    for a in range(3):
        for b in range(3):
            slope[a, b] = 2.0 * _first_difference(squared[a], squared[b])
    transformation, T, factor = _congruence(axes), axes.T @ T @ axes, slope.reshape(9)
    S = L_axes @ (slope * T) @ L_axes.T
    _first_piola_kirchhoff(F, S, P)
    if not tangent:
        return energy
    moduli = transformation.T @ D @ transformation * factor
    moduli *= factor.reshape(9, 1)
    for a in range(3):
        for b in range(3):
            for c in range(3):
                low, high = min(a, b, c), max(a, b, c)
                value = T[a, c] * _second_difference(squared[low], squared[a + b + c - low - high], squared[high])
                for row in (3 * a + b, 3 * b + a):
                    for column in (3 * b + c, 3 * c + b):
                        moduli[row, column] += value
                        moduli[column, row] += value
    transformation = _congruence(L_axes)
    _push_forward(F, S, transformation @ moduli @ transformation.T, A)
    return energy


@kernel
def _congruence(axes):
    """Return the matrix (9, 9) that maps the 9 components of a tensor M to those of Q M Q^T, with `axes` (3, 3) as Q."""
    transformation = np.empty((9, 9))
    for row in range(9):
        for column in range(9):
            transformation[row, column] = axes[row // 3, column // 3] * axes[row % 3, column % 3]
    return transformation


@kernel
def _flow(L_axes, axes, old, new):
    """Replace the increment of plastic strain in `new` by L - I at the end of the load step; see the module docstring.

    The columns of `axes` (3, 3) are the principal axes of the increment, and `L_axes` (3, 3) is the factor before the load
    step times `axes`.
    """
    if new[6] > old[6]:
        increment = np.empty((3, 3))
        for i in range(3):
            for j in range(3):
                increment[i, j] = new[voigt(i, j)]
        metric = (L_axes * np.exp(-2.0 * np.diag(axes.T @ increment @ axes))) @ L_axes.T
        factor = np.linalg.cholesky(metric)
        for i in range(3):
            for j in range(i + 1):
                new[voigt(i, j)] = factor[i, j] - (1.0 if i == j else 0.0)
    else:
        for k in range(6):  # assigning to a slice would also compile its error message, which takes seconds
            new[k] = old[k]


@kernel
def _saint_venant(D, F, tangent, P, A):
    """Apply Hooke's law to Green-Lagrange strain and second Piola-Kirchhoff stress; return the energy density."""
    strain, S, C = np.empty((3, 3)), np.empty((3, 3)), np.empty((9, 9))
    right_cauchy_green(F, strain)
    strain *= 0.5
    for i in range(3):
        strain[i, i] -= 0.5
    energy = _hooke(D, strain, S)
    _first_piola_kirchhoff(F, S, P)
    if not tangent:
        return energy
    for row in range(9):
        for column in range(9):
            C[row, column] = D[voigt(row // 3, row % 3), voigt(column // 3, column % 3)]
    _push_forward(F, S, C, A)
    return energy


@innermost_kernel
def _add_isochoric(value, first, number, power, scale, J, G, dW, d2W, tangent, P, A):
    """Add to P and A the terms of a function of the isochoric invariant ``scale * value``, except for second derivatives.

    `scale` is ``J**-power``, and `first` (3, 3) is the derivative of the value. `dW` and `d2W` are the first and second
    derivatives of the energy with respect to the invariant. The terms of A are stored in the rows LEFT, ``LEFT + number``
    and ``RIGHT + number``, see `first_invariant`. Returns the factors of the second derivatives of the value and of J.
    """
    inverse, factor = power / J, dW * scale
    ratio, GG_factor = inverse * value, factor * inverse * (inverse + 1.0 / J) * value
    curvature, mixed = d2W * scale * scale, factor * inverse
    for i in range(3):
        for j in range(3):
            change = first[i, j] - ratio * G[i, j]
            P[i, j] += factor * change
            if tangent:
                e = 3 * i + j
                A[RIGHT + number, e] = first[i, j]
                A[LEFT + number, e] = curvature * change - mixed * G[i, j]
                A[LEFT, e] += GG_factor * G[i, j] - mixed * first[i, j] - curvature * ratio * change
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
    for row in range(0, 12 if tangent else 0, 4):
        for column in range(0, 12, 4):
            tile(A, LEFT, row, A, RIGHT, column, n, A, row, True)
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
    C, first, square = np.empty((3, 3)), np.empty((3, 3)), 0.0
    right_cauchy_green(F, C)
    for i in range(3):
        for j in range(3):
            first[i, j] = I1 * F[i, j] - F[i, 0] * C[0, j] - F[i, 1] * C[1, j] - F[i, 2] * C[2, j]
            square += C[i, j] ** 2
    I2 = 0.5 * (I1 * I1 - square)
    I2_factor, J_factor = _add_isochoric(0.5 * I2, first, 2, 4.0 / 3.0, scale, J, G, 2.0 * C01, 0.0, tangent, P, A)
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
    """Apply Ogden's law of the isochoric stretches; return the energy density.

    The energy is the sum of 2 mu / alpha^2 (l1^alpha + l2^alpha + l3^alpha - 3) (Ogden, 1972); the moduli in principal axes
    are those of Simo and Taylor (1991, equation 2.28).
    """
    n = int(constants[3])
    C = np.empty((3, 3))
    right_cauchy_green(F, C)
    squared, axes = np.linalg.eigh(C)
    scale = (squared[0] * squared[1] * squared[2]) ** (-1.0 / 6.0)
    beta, gamma, energy = np.zeros(3), np.zeros((3, 3)), 0.0
    powers = np.empty(3)
    for term in range(n):
        mu, alpha = constants[4 + 2 * term], constants[5 + 2 * term]
        for a in range(3):
            powers[a] = (scale * np.sqrt(squared[a])) ** alpha
        total = powers[0] + powers[1] + powers[2]
        energy += 2.0 * mu / alpha**2 * (total - 3.0)
        for a in range(3):
            beta[a] += 2.0 * mu / alpha * (powers[a] - total / 3.0)
            for b in range(3):
                gamma[a, b] += 2.0 * mu * (total / 9.0 - (powers[a] + powers[b]) / 3.0)
            gamma[a, a] += 2.0 * mu * powers[a]
    S, moduli, transformation = (axes * (beta / squared)) @ axes.T, np.zeros((9, 9)), _congruence(axes)
    _first_piola_kirchhoff(F, S, P)
    if not tangent:
        return energy
    for a in range(3):
        for b in range(3):
            moduli[4 * a, 4 * b] = (gamma[a, b] - (2.0 * beta[a] if a == b else 0.0)) / (squared[a] * squared[b])
            if a != b:
                difference = squared[b] - squared[a]
                shear = 0.5 * (gamma[b, b] - 2.0 * beta[b] - gamma[a, b]) / (squared[b] * squared[b])
                if abs(difference) > EQUAL_STRETCHES * squared[b]:
                    shear = (beta[b] / squared[b] - beta[a] / squared[a]) / difference
                moduli[3 * a + b, 3 * a + b] = moduli[3 * a + b, 3 * b + a] = shear
    _push_forward(F, S, transformation @ moduli @ transformation.T, A)
    return energy


@kernel
def _other_law(constants, D, F, tangent, old, new, P, A):
    """Apply a law other than `_invariants`; return the elastic energy density without the volumetric part."""
    law = int(constants[0])
    if law == LINEAR:
        return _linear(D, F, tangent, P, A)
    if law == PLASTIC:
        return _plastic(constants, F, tangent, old, new, P, A)
    if law == LOGARITHMIC:
        return _logarithmic(constants, F, tangent, old, new, P, A)
    if law == SAINT_VENANT:
        return _saint_venant(D, F, tangent, P, A)
    return _ogden(constants, F, tangent, P, A)


@kernel
def evaluate_law(constants, D, F, J, G, volumetric, tangent, old, new, P, A):
    """Fill `new`, P and A according to the law of `constants`, and return the elastic energy [energy / volume].

    The energy does not include the volumetric part of the law. `volumetric` contains a pressure, a bulk modulus and a factor:
    P includes ``pressure dJ/dF``, and A includes ``bulk dJ/dF dJ/dF + factor d2J/dF2``. D (6, 6) contains the moduli of
    Hooke's law. J and G (3, 3) are the determinant of F and its derivative. If `tangent` is false, A is required only at
    small strains, and only where plastic flow occurs.
    """
    for e in range(9):
        new[e] = old[e]
    if int(constants[0]) == INVARIANTS:
        return _invariants(constants, F, J, G, volumetric, tangent, P, A)
    energy = _other_law(constants, D, F, tangent, old, new, P, A)
    _add_volumetric(F, G, volumetric, tangent or new[6] > old[6], P, A)
    return energy
