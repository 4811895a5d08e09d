"""Quadrature rules compared with exact integrals of monomials."""

import itertools
from math import factorial

import numpy as np
import pytest

from fastcontact.mesh import quadrature as rules


def on_line(i):
    return (1 - (-1) ** (i + 1)) / (i + 1)


def on_triangle(i, j):
    return factorial(i) * factorial(j) / factorial(i + j + 2)


def on_tetrahedron(i, j, k):
    return factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 3)


def on_pyramid(i, j, k):
    # x = a (1 - z), y = b (1 - z): a Beta function in z is left.
    return on_line(i) * on_line(j) * factorial(i + j + 2) * factorial(k) / factorial(i + j + k + 3)


def on_square(i, j):
    return on_line(i) * on_line(j)


def on_cube(i, j, k):
    return on_line(i) * on_line(j) * on_line(k)


def on_prism(i, j, k):
    return on_triangle(i, j) * on_line(k)


RULES = {
    "gauss_line": (rules.gauss_line(3), on_line, 5),
    "simpson": (rules.simpson_line(), on_line, 3),
    "subdivided simpson": (rules.subdivided(rules.simpson_line(), 3), on_line, 3),
    "gauss_square": (rules.gauss_square(2), on_square, 3),
    "triangle_1": (rules.triangle_1(), on_triangle, 1),
    "triangle_3": (rules.triangle_3(), on_triangle, 2),
    "triangle_3_sides": (rules.triangle_3_sides(), on_triangle, 2),
    "triangle_6": (rules.triangle_6(), on_triangle, 4),
    "triangle_7": (rules.triangle_7(), on_triangle, 5),
    "gauss_cube": (rules.gauss_cube(3), on_cube, 5),
    "tetrahedron_1": (rules.tetrahedron_1(), on_tetrahedron, 1),
    "tetrahedron_5": (rules.tetrahedron_5(), on_tetrahedron, 3),
    "prism": (rules.prism(rules.triangle_7(), rules.gauss_line(3)), on_prism, 5),
    "pyramid_5": (rules.pyramid_5(), on_pyramid, 2),
    "conical_pyramid": (rules.conical_pyramid(3), on_pyramid, 5),
    "conical_pyramid of 16": (rules.conical_pyramid(4), on_pyramid, 7),
}


def worst_error(rule, exact, degree):
    """Largest error among all monomials of exactly that total degree."""
    points, weights = rule
    powers = [p for p in itertools.product(range(degree + 1), repeat=points.shape[1]) if sum(p) == degree]
    return max(abs(weights @ np.prod(points**p, axis=1) - exact(*p)) for p in powers)


@pytest.mark.parametrize(("rule", "exact", "degree"), RULES.values(), ids=RULES)
def test_rules_are_exact_to_their_degree_and_no_further(rule, exact, degree):
    assert max(worst_error(rule, exact, d) for d in range(degree + 1)) < 1e-14
    assert worst_error(rule, exact, degree + 1) > 1e-6


@pytest.mark.parametrize(("rule", "exact", "degree"), RULES.values(), ids=RULES)
def test_points_lie_in_the_cell(rule, exact, degree):
    points, _ = rule
    assert (np.abs(points) <= 1.0).all()
    if exact in (on_triangle, on_tetrahedron):
        assert (points >= 0).all()
        assert (points.sum(axis=1) <= 1.0 + 1e-15).all()
    if exact is on_pyramid:
        assert (np.abs(points[:, :2]).max(axis=1) < 1 - points[:, 2]).all()
