"""Quadrature rules compared with exact integrals, and quality measures of known meshes."""

import itertools
import math
from math import factorial

import numpy as np
import pytest
from refusals import refused

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh import quadrature as rules
from fastcontact.mesh.quality import check_cells, extremes, quality


def on_box(*powers):
    return math.prod((1 - (-1) ** (i + 1)) / (i + 1) for i in powers)


def on_triangle(i, j):
    return factorial(i) * factorial(j) / factorial(i + j + 2)


def on_tetrahedron(i, j, k):
    return factorial(i) * factorial(j) * factorial(k) / factorial(i + j + k + 3)


def on_pyramid(i, j, k):
    # x = a (1 - z), y = b (1 - z): a Beta function in z is left.
    return on_box(i, j) * factorial(i + j + 2) * factorial(k) / factorial(i + j + k + 3)


def on_prism(i, j, k):
    return on_triangle(i, j) * on_box(k)


RULES = {
    "gauss_line": (rules.gauss_line(3), on_box, 5),
    "simpson": (rules.simpson_line(), on_box, 3),
    "subdivided simpson": (rules.subdivided(rules.simpson_line(), 3), on_box, 3),
    "gauss_square": (rules.gauss_square(2), on_box, 3),
    "triangle_1": (rules.triangle(1), on_triangle, 1),
    "triangle_3": (rules.triangle(2), on_triangle, 2),
    "triangle_3_midpoints": (rules.triangle_3_midpoints(), on_triangle, 2),
    "triangle_6": (rules.triangle(4), on_triangle, 4),
    "triangle_7": (rules.triangle(5), on_triangle, 5),
    "gauss_cube": (rules.gauss_cube(3), on_box, 5),
    "tetrahedron_1": (rules.tetrahedron_1(), on_tetrahedron, 1),
    "tetrahedron_5": (rules.tetrahedron_5(), on_tetrahedron, 3),
    "prism": (rules.tensor_product(rules.triangle(5), rules.gauss_line(3)), on_prism, 5),
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


def one(name, points):
    return fc.Mesh(points, {name: [np.arange(len(points))]})


def test_a_right_triangle():
    found = quality(one("tri3", [[0, 0], [3, 0], [0, 4]]))
    assert found.smallest_angle == pytest.approx(math.degrees(math.asin(3 / 5)))
    assert found.largest_angle == pytest.approx(90.0)
    assert (found.shortest_edge, found.longest_edge) == (3.0, 5.0)
    assert found.worst_aspect == pytest.approx(5 / 3)
    assert found.measure == pytest.approx(6.0)
    assert (found.n_points, found.n_cells, found.n_bad, found.dim) == (3, {"tri3": 1}, 0, 2)


def test_a_rhomb_and_a_dart():
    rhomb = quality(one("quad4", [[0, 0], [2, 0], [3, math.sqrt(3)], [1, math.sqrt(3)]]))
    assert (rhomb.smallest_angle, rhomb.largest_angle) == pytest.approx((60.0, 120.0))
    dart = quality(one("quad4", [[0, 0], [4, 0], [1, 1], [0, 4]]))
    assert dart.largest_angle > 180.0
    assert dart.measure == pytest.approx(4.0)


def test_facets_of_a_cube_have_right_angles():
    corners = elements.get("hex8").nodes
    found = quality(fc.Mesh(corners, {"hex8": [range(8)], "quad4": [[0, 1, 2, 3]]}))
    assert (found.smallest_angle, found.largest_angle) == pytest.approx((90.0, 90.0))
    assert "volume 8 [length^3]" in str(found)


def test_a_curved_side_counts_in_the_area():
    nodes = elements.get("tri6").nodes.copy()
    nodes[4] += 0.1  # outward, along the normal (1, 1): a parabola of height 0.1 sqrt(2) over a chord of sqrt(2)
    assert quality(one("tri6", nodes)).measure == pytest.approx(0.5 + 2 / 3 * 0.1 * 2)


def test_the_first_inverted_cell_is_named_with_place_and_count():
    points = [[0, 0], [1, 0], [0, 1], [1, 1], [2, 0]]
    mesh = fc.Mesh(points, {"line2": [[0, 1]], "tri3": [[0, 1, 2], [1, 2, 3], [1, 3, 4]]})
    assert quality(mesh).n_bad == 2
    with pytest.raises(fc.MeshError) as error:
        check_cells(mesh)
    message = str(error.value)
    assert "cell 2 (tri3 at (0.666667, 0.666667), area -0.5) is inverted (number of such cells: 2)" in message
    assert "topology.oriented" in message


@pytest.mark.parametrize("height", [0.0, 1e-15])
def test_a_flat_cell_is_degenerate(height):
    mesh = one("tri3", [[0, 0], [1, 0], [0.5, height]])
    assert quality(mesh).n_bad == 1
    refused(fc.MeshError, r"cell 0 .* is degenerate \(number of such cells: 1\)", check_cells, mesh)


def test_a_cell_with_all_nodes_in_one_place_is_degenerate_and_does_not_warn():
    with np.errstate(all="raise"):
        assert quality(one("tri3", np.ones((3, 2)))).n_bad == 1


def test_a_thin_cell_is_not_degenerate():
    mesh = one("tri3", [[0, 0], [1, 0], [0.5, 1e-6]])
    check_cells(mesh)
    assert quality(mesh).n_bad == 0


def test_a_folded_quadratic_cell_is_inverted_though_its_corners_are_fine():
    nodes = elements.get("tri6").nodes.copy()
    nodes[3] = [0.5, 0.6]
    mesh = one("tri6", nodes)
    assert quality(mesh).n_bad == 1
    refused(fc.MeshError, "inverted", check_cells, mesh)


def test_a_mesh_without_solid_cells_has_no_figures():
    found = quality(fc.Mesh([[0, 0], [1, 0]], {"line2": [[0, 1]]}))
    assert math.isnan(found.smallest_angle)
    assert math.isnan(found.longest_edge)
    assert (found.measure, found.n_bad) == (0.0, 0)


def test_the_report_is_a_few_lines_with_units():
    lines = str(quality(fc.generate.block((2.0, 1.0), (4, 2), "tri3"))).splitlines()
    assert len(lines) == 4
    assert lines[0].startswith("15 points, 16 tri3, 12 line2")
    assert "45.0" in lines[1]
    assert "degrees" in lines[1]
    assert "[length]" in lines[2]
    assert lines[3] == "area 2 [length^2]"


@pytest.mark.parametrize("name", [name for name, element in elements.ELEMENTS.items() if element.dim > 1])
def test_extreme_jacobians_and_longest_edges(name):
    element = elements.get(name)
    solid = element.dim == 3
    mesh = fc.generate.box((1.0, 2.0, 1.5), (2, 2, 1), name) if solid else fc.generate.block((1.0, 2.0), (3, 2), name)
    points = mesh.points + np.random.default_rng(1).uniform(-0.9, 0.9, mesh.points.shape)  # some cells fold
    cells, (_, dN, weights) = mesh.cells[name], element.tables
    measure, low, high, longest = extremes(mesh.replace(points=points), name)
    det = np.linalg.det(np.einsum("cnd,qnj->cqdj", points[cells], dN))
    assert (det < 0).any()
    np.testing.assert_allclose(low, det.min(axis=1), rtol=0, atol=1e-13 * np.abs(det).max())
    np.testing.assert_allclose(high, det.max(axis=1), rtol=0, atol=1e-13 * np.abs(det).max())
    np.testing.assert_allclose(measure, det @ weights, rtol=0, atol=1e-13 * np.abs(det).max())
    ends = points[cells][:, np.array(element.edges)]
    np.testing.assert_allclose(longest, np.linalg.norm(ends[:, :, 1] - ends[:, :, 0], axis=2).max(axis=1), rtol=1e-14)


@pytest.mark.parametrize("dim", [2, 3])
def test_determinants_equal_those_of_lapack(dim):
    J = np.random.default_rng(3).normal(size=(5, 4, dim, dim))
    assert rules.determinants(J) == pytest.approx(np.linalg.det(J), rel=1e-12)
