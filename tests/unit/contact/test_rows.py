"""Rows of constraints from pairings, and positions on surfaces, compared with explicit sums."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.contact.pairing import Candidates, Pairing, gap_rows, rows_along
from fastcontact.contact.projection import places
from fastcontact.contact.surface import surface
from fastcontact.mesh import elements


@pytest.fixture(params=["quad4", "quad8"])
def sides(request):
    mesh = fc.generate.half_spheres(request.param, arc_sizes=(3.0, 6.0), radial_sizes=(3.0, 9.0), segments=3)
    return mesh, surface(mesh, "CONT1"), surface(mesh, "CONT2")


def test_only_the_first_and_the_last_end_of_an_open_line_meet_no_other(sides):
    _, side, _ = sides
    corners = side.facets[:, :2]
    outer = corners[~side.inner_ends]
    times = np.bincount(corners.ravel())
    np.testing.assert_array_equal(np.sort(outer), np.flatnonzero(times == 1))


def test_rows_are_sums_over_both_sides(sides):
    mesh, secondary, primary = sides
    rng = np.random.default_rng(2)
    n = len(secondary.points)
    nodes = Candidates(secondary.points[:, None], np.ones((n, 1)))
    facet, xi = rng.integers(0, primary.n_facets, n), rng.uniform(-1, 1, (n, 1))
    pairing = Pairing(facet, xi, rng.normal(size=(n, 2)), rng.random(n) < 0.7)
    direction, u = rng.normal(size=(n, 2)), rng.normal(size=mesh.points.shape)
    found = rows_along(direction, nodes, pairing, primary, u.size)
    shape = elements.get(primary.element).shape(xi)
    theirs = np.einsum("nk,nkd->nd", shape, u[primary.facets[facet]])
    moved = np.einsum("nd,nd->n", direction, u[secondary.points] - theirs)
    np.testing.assert_allclose(found @ u.ravel(), np.where(pairing.paired, moved, 0.0), atol=1e-13)
    np.testing.assert_array_equal(np.diff(found.indptr) == 0, ~pairing.paired)
    assert found.has_canonical_format
    G, gap = gap_rows(nodes, pairing, primary, mesh.points)
    np.testing.assert_allclose(gap, G @ mesh.points.ravel())


def test_a_node_that_is_named_twice_counts_twice():
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), radial_sizes=(3.0, 9.0), segments=3)
    side = surface(mesh, "CONT1")
    nodes = Candidates(np.repeat(side.points[:1, None], 2, axis=1), np.array([[0.25, 0.5]]))
    pairing = Pairing(np.array([5]), np.zeros((1, 1)), np.ones((1, 2)), np.ones(1, bool))
    found = rows_along(np.array([[1.0, 0.0]]), nodes, pairing, side, mesh.points.size)
    assert found[0, 2 * side.points[0]] == 0.75


def test_places_on_one_kind_of_facets_are_those_of_its_element(sides):
    _, side, _ = sides
    rng = np.random.default_rng(4)
    facet, xi = rng.integers(0, side.n_facets, 9), rng.uniform(-1, 1, (9, 1))
    at, element = places(side, facet, xi), elements.get(side.element)
    np.testing.assert_array_equal(at.nodes, side.facets[facet])
    np.testing.assert_array_equal(side.points[at.local], at.nodes)
    np.testing.assert_array_equal(at.shape, element.shape(xi))
    np.testing.assert_array_equal(at.gradient, element.gradient(xi))
