"""Quadrature rules on reference lines, triangles and squares."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rule = tuple[Array, Array]


def gauss_line(n: int) -> Rule:
    """Gauss-Legendre rule with `n` points on [-1, 1], exact to degree 2n - 1."""
    points, weights = np.polynomial.legendre.leggauss(n)
    return points.reshape(-1, 1), weights


def simpson_line() -> Rule:
    """Simpson's rule on [-1, 1], exact to degree 3."""
    return np.array([[-1.0], [1.0], [0.0]]), np.array([1.0, 1.0, 4.0]) / 3.0


def trapezium_line() -> Rule:
    """Trapezium rule on [-1, 1], exact to degree 1."""
    return np.array([[-1.0], [1.0]]), np.array([1.0, 1.0])


def gauss_square(n: int) -> Rule:
    """Tensor Gauss rule with n x n points on [-1, 1]^2."""
    x, w = np.polynomial.legendre.leggauss(n)
    X, Y = np.meshgrid(x, x, indexing="xy")
    return np.column_stack([X.ravel(), Y.ravel()]), np.outer(w, w).ravel()


def triangle_1() -> Rule:
    """Centroid rule on the triangle (0,0) (1,0) (0,1), exact to degree 1."""
    return np.array([[1.0, 1.0]]) / 3.0, np.array([0.5])


def triangle_3() -> Rule:
    """Three interior points, exact to degree 2 (Strang and Fix, 1973)."""
    return np.array([[1.0, 1.0], [4.0, 1.0], [1.0, 4.0]]) / 6.0, np.full(3, 1.0 / 6.0)


def triangle_6() -> Rule:
    """Six interior points, exact to degree 4 (Dunavant, 1985)."""
    a, b = 0.445948490915965, 0.091576213509771
    wa, wb = 0.223381589678011 / 2.0, 0.109951743655322 / 2.0
    points = [[a, a], [1 - 2 * a, a], [a, 1 - 2 * a], [b, b], [1 - 2 * b, b], [b, 1 - 2 * b]]
    return np.array(points), np.array([wa, wa, wa, wb, wb, wb])


def subdivided(rule: Rule, parts: int) -> Rule:
    """Return a rule on [-1, 1] applied on `parts` equal pieces; points that coincide are merged."""
    points, weights = rule
    left = -1.0 + 2.0 * np.arange(parts) / parts
    all_points = (left[:, None] + (points[:, 0] + 1.0) / parts).ravel()
    all_weights = np.tile(weights / parts, parts)
    unique, place = np.unique(np.round(all_points, 14), return_inverse=True)
    merged = np.zeros(len(unique))
    np.add.at(merged, place, all_weights)
    return unique[:, None], merged
