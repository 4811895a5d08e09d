"""Quadrature rules on reference lines, triangles, squares and solids, and determinants of Jacobian matrices.

A `Rule` is a tuple ``(points, weights)`` of the points (n_q, dim) in reference coordinates [-] and their weights (n_q,) [-],
which add up to the measure of the reference cell.
"""

from __future__ import annotations

from functools import cache
from itertools import permutations

import numpy as np

from fastcontact.arrays import Array

Rule = tuple[Array, Array]


@cache
def gauss_line(n: int) -> Rule:
    """Return the Gauss-Legendre rule with `n` points on [-1, 1], exact to degree 2n - 1."""
    points, weights = np.polynomial.legendre.leggauss(n)
    return points.reshape(-1, 1), weights


def simpson_line() -> Rule:
    """Return Simpson's rule on [-1, 1], exact to degree 3."""
    return np.array([[-1.0], [1.0], [0.0]]), np.array([1.0, 1.0, 4.0]) / 3.0


def gauss_square(n: int) -> Rule:
    """Return the tensor-product Gauss rule with n x n points on [-1, 1]^2, exact to degree 2n - 1 in each coordinate."""
    return tensor_product(gauss_line(n), gauss_line(n))


# Symmetric rules on the triangle by degree: the weights of orbits of one, three and six points, each followed by the
# independent barycentric coordinates of its points (Strang and Fix, 1973; Dunavant, 1985; Radon, 1948).
_ROOTS = np.sqrt(15.0), -np.sqrt(15.0)
_TRIANGLE: dict[int, list[tuple[float, ...]]] = {
    1: [(1.0,)],
    2: [(1.0 / 3.0, 1.0 / 6.0)],
    4: [(0.223381589678011, 0.445948490915965), (0.109951743655322, 0.091576213509771)],
    5: [(9.0 / 40.0,), *(((155.0 + root) / 1200.0, (6.0 + root) / 21.0) for root in _ROOTS)],
    6: [
        (0.1167862757263978, 0.2492867451708992),
        (0.05084490637020978, 0.06308901449150417),
        (0.08285107561836291, 0.05314504984480938, 0.3103524510337927),
    ],
    8: [
        (0.144315607677777,),
        (0.09509163426728974, 0.4592925882927181),
        (0.1032173705347262, 0.1705693077517538),
        (0.03245849762319998, 0.05054722831703223),
        (0.0272303141744292, 0.008394777409941592, 0.2631128296346346),
    ],
}


def triangle(degree: int) -> Rule:
    """Return the symmetric rule, with interior points, on the triangle (0, 0), (1, 0), (0, 1) that is exact to `degree`.

    The degree is 1, 2, 4, 5, 6 or 8; the rule has 1, 3, 6, 7, 12 or 16 points.
    """
    return _orbit_rule(_TRIANGLE[degree])


def triangle_3_midpoints() -> Rule:
    """Return the three-point rule on the triangle, at the midpoints of sides, exact to degree 2 (Strang and Fix, 1973)."""
    return _orbit_rule([(1.0 / 3.0, 0.5)])


def _orbit_rule(orbits: list[tuple[float, ...]]) -> Rule:
    """Return the symmetric rule on the triangle whose orbits have the given weights and barycentric coordinates.

    The weights of all points add up to 1 before they are multiplied by the area of the triangle.
    """
    points: list[tuple[float, float]] = []
    weights: list[float] = []
    for weight, *coordinates in orbits:
        a, b = (2 * coordinates or [1.0 / 3.0, 1.0 / 3.0])[:2]
        orbit = dict.fromkeys(permutations((a, b, 1 - (a + b) if coordinates else a)))
        points += [(y, x) for x, y, _ in orbit]
        weights += [weight] * len(orbit)
    return np.array(points), np.array(weights) / 2.0


def triangle_7_closed() -> Rule:
    """Return the seven-point rule on the triangle, with the corners, the midpoints of the sides and the centroid.

    It is exact to degree 3, and all weights are positive (Hammer and Stroud, 1956).
    """
    points = np.array([[0, 0], [6, 0], [0, 6], [3, 0], [3, 3], [0, 3], [2, 2]]) / 6.0
    return points, np.array([3.0, 3.0, 3.0, 8.0, 8.0, 8.0, 27.0]) / 120.0


def quartered_triangle(rule: Rule) -> Rule:
    """Return the composite rule on the four congruent quarters of the triangle, with coincident points merged."""
    points, weights = rule
    shifts = np.array([[0.0, 0.0], [0.5, 0.0], [0.0, 0.5]])
    pieces = [shift + 0.5 * points for shift in shifts] + [0.5 - 0.5 * points]
    return _merge_points(np.concatenate(pieces), np.tile(weights / 4.0, 4))


def _merge_points(points: Array, weights: Array) -> Rule:
    """Return a rule with coincident points merged."""
    unique, index = np.unique(np.round(points, 14), axis=0, return_inverse=True)
    merged_weights = np.zeros(len(unique))
    np.add.at(merged_weights, index.ravel(), weights)
    return unique, merged_weights


def gauss_cube(n: int) -> Rule:
    """Return the tensor-product Gauss rule with n x n x n points on [-1, 1]^3, exact to degree 2n - 1 in each coordinate."""
    points, weights = tensor_product(gauss_square(n), gauss_line(n))
    return points[:, ::-1].copy(), weights  # the points along z are consecutive


def tetrahedron_1() -> Rule:
    """Return the centroid rule on the tetrahedron (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), exact to degree 1."""
    return np.full((1, 3), 0.25), np.array([1.0 / 6.0])


def tetrahedron_5() -> Rule:
    """Return the five-point rule on the tetrahedron, exact to degree 3 (Hammer, Marlowe and Stroud, 1956).

    The weight of the centroid is negative.
    """
    a, b = 1.0 / 6.0, 0.5
    points = [[0.25, 0.25, 0.25], [a, a, a], [a, a, b], [a, b, a], [b, a, a]]
    return np.array(points), np.array([-2.0 / 15.0] + [3.0 / 40.0] * 4)


def tensor_product(base: Rule, line: Rule) -> Rule:
    """Return the product of a rule on a base in the first coordinates with a rule on the line [-1, 1] in the last one."""
    (x, w), (z, v) = base, line
    points = np.column_stack([np.tile(x, (len(z), 1)), np.repeat(z[:, 0], len(x))])
    return points, np.outer(v, w).ravel()


def pyramid_5() -> Rule:
    """Return the five-point rule on the pyramid, exact to degree 2.

    The pyramid has the base [-1, 1]^2 at z = 0 and the apex (0, 0, 1). Four points lie above the midpoints of the half
    diagonals of the base, and one lies on the axis. All weights are equal. The heights h and k solve 4 h + k = 5/4 and
    4 h^2 + k^2 = 1/2, so that 1, z and z^2 are integrated exactly. code_aster has the same rule in PYRAM5.
    """
    h, k = (10.0 - np.sqrt(15.0)) / 40.0, 0.25 + np.sqrt(15.0) / 10.0
    points = [[0.5, 0.5, h], [-0.5, 0.5, h], [-0.5, -0.5, h], [0.5, -0.5, h], [0.0, 0.0, k]]
    return np.array(points), np.full(5, 4.0 / 15.0)


def conical_pyramid(n: int) -> Rule:
    """Return the conical product rule with n x n x n points on the pyramid of `pyramid_5`, exact to degree 2n - 1.

    It is the product of Gauss-Legendre rules in x / (1 - z) and y / (1 - z) and of a Gauss-Jacobi rule with the weight
    (1 - z)^2 in z (Stroud, 1971, section 2.5). It is also exact for the rational shape functions of pyramids, which are
    polynomials in these coordinates.
    """
    x, w = np.polynomial.legendre.leggauss(n)
    z, v = _gauss_jacobi(n)
    A, B, Z = np.meshgrid(x, x, z, indexing="ij")
    points = np.column_stack([(A * (1 - Z)).ravel(), (B * (1 - Z)).ravel(), Z.ravel()])
    return points, np.einsum("i,j,k->ijk", w, w, v).ravel()


def _gauss_jacobi(n: int) -> tuple[Array, Array]:
    """Return the Gauss-Jacobi rule with `n` points on [0, 1] for the weight (1 - z)^2 (Golub and Welsch, 1969).

    Its points are the eigenvalues of the Jacobi matrix, which contains the recurrence coefficients of the Jacobi polynomials
    with alpha = 2 and beta = 0, mapped to [0, 1].
    """
    k = np.arange(n)
    diagonal = -4.0 / ((2 * k + 2) * (2 * k + 4))
    k = k[1:]
    off_diagonal = 2 * k * (k + 2) / ((2 * k + 2) * np.sqrt((2 * k + 1) * (2 * k + 3)))
    roots, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(off_diagonal, 1) + np.diag(off_diagonal, -1))
    return (1.0 + roots) / 2.0, vectors[0] ** 2 / 3.0


def product_rule(element: str, n: int, n_cartesian: int | None = None) -> Rule:
    """Return a product rule on the reference cell of the linear element `element`, with `n` points in each direction.

    If `n_cartesian` is given, it replaces `n` in the Cartesian directions of squares, cubes and prisms. Raises KeyError for
    an unknown element.
    """
    m = n if n_cartesian is None else n_cartesian
    return {
        "line2": lambda: gauss_line(n),
        "tri3": lambda: collapsed_triangle(n),
        "quad4": lambda: gauss_square(m),
        "tet4": lambda: collapsed_tetrahedron(n),
        "hex8": lambda: gauss_cube(m),
        "wedge6": lambda: tensor_product(collapsed_triangle(n), gauss_line(m)),
        "pyramid5": lambda: conical_pyramid(n),
    }[element]()


def subdivided(rule: Rule, count: int) -> Rule:
    """Return the composite rule on `count` equal intervals of [-1, 1], with coincident points merged."""
    points, weights = rule
    starts = -1.0 + 2.0 * np.arange(count) / count
    all_points = (starts[:, None] + (points[:, 0] + 1.0) / count).ravel()
    return _merge_points(all_points[:, None], np.tile(weights / count, count))


def collapsed_triangle(n: int) -> Rule:
    """Return the product rule with n x n points on the triangle (0, 0), (1, 0), (0, 1), exact to degree 2n - 2.

    It is the product of Gauss-Legendre rules in x and in y / (1 - x) (Stroud, 1971, section 2.4).
    """
    s, w = np.polynomial.legendre.leggauss(n)
    s, w = (1.0 + s) / 2.0, w / 2.0
    x, t = (a.ravel() for a in np.meshgrid(s, s, indexing="ij"))
    return np.column_stack([x, (1.0 - x) * t]), np.outer(w * (1.0 - s), w).ravel()


def collapsed_tetrahedron(n: int) -> Rule:
    """Return the product rule with n x n x n points on the tetrahedron of `tetrahedron_1`, exact to degree 2n - 3.

    It extends `collapsed_triangle` by one dimension (Stroud, 1971, section 2.4).
    """
    s, w = np.polynomial.legendre.leggauss(n)
    s, w = (1.0 + s) / 2.0, w / 2.0
    face, v = collapsed_triangle(n)
    points = np.column_stack([np.repeat(s, len(v)), np.kron((1.0 - s)[:, None], face)])
    return points, np.outer(w * (1.0 - s) ** 2, v).ravel()


def determinants(J: Array) -> Array:
    """Return the determinants (...) [unit of J^dim] of the Jacobian matrices `J` (..., dim, dim) [unit of J].

    They are computed by Laplace's expansion, which is three to five times as fast as `numpy.linalg.det`.
    """
    minor = J[..., -2, -2] * J[..., -1, -1] - J[..., -2, -1] * J[..., -1, -2]
    if J.shape[-1] == 2:
        return np.asarray(minor)
    second = J[..., 1, 0] * J[..., 2, 2] - J[..., 1, 2] * J[..., 2, 0]
    third = J[..., 1, 0] * J[..., 2, 1] - J[..., 1, 1] * J[..., 2, 0]
    return np.asarray(J[..., 0, 0] * minor - J[..., 0, 1] * second + J[..., 0, 2] * third)


def jacobian_determinants(x: Array, gradients: Array) -> Array:
    """Return the Jacobian determinants (n_q, n_cells) [length^dim] of cells at n_q points.

    `x` (n_cells, n_nodes, dim) [length] are the positions of the nodes, and `gradients` (n_q, n_nodes, dim) [-] the
    derivatives of the shape functions at the points.
    """
    n_cells, n_nodes, dim = x.shape
    rows = np.moveaxis(x, 2, 1).reshape(-1, n_nodes)
    return np.stack([determinants((rows @ gradient).reshape(n_cells, dim, dim)) for gradient in gradients])
