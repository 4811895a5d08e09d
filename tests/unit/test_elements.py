"""One test for every reference element: a new element passes it or is wrong."""

import numpy as np
import pytest

from fastcontact import elements
from fastcontact.errors import MeshError

ALL = list(elements.ELEMENTS.values())
SOLID = [e for e in ALL if e.facet]


def interior_points(element, n=7):
    """Points inside the cell: random blends of its corners."""
    rng = np.random.default_rng(1)
    blend = rng.dirichlet(np.ones(element.n_corners), n)
    return blend @ element.nodes[: element.n_corners]


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_shape_functions_are_one_at_their_node_and_sum_to_one(element):
    assert np.abs(element.shape(element.nodes) - np.eye(element.n_nodes)).max() < 1e-14
    assert np.abs(element.shape(interior_points(element)).sum(axis=1) - 1.0).max() < 1e-14


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_gradients_are_the_derivatives_of_the_shape_functions(element):
    xi = interior_points(element)
    for k in range(element.dim):
        h = np.zeros(element.dim)
        h[k] = 1e-6
        difference = (element.shape(xi + h) - element.shape(xi - h)) / 2e-6
        assert np.abs(difference - element.gradient(xi)[:, :, k]).max() < 1e-9


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_polynomials_of_the_element_order_are_reproduced(element):
    xi = interior_points(element)

    def polynomial(x):
        return (0.3 + x @ np.arange(1, element.dim + 1)) ** element.order

    assert np.abs(element.shape(xi) @ polynomial(element.nodes) - polynomial(xi)).max() < 1e-13


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_quadrature_measures_the_cell_and_extrapolation_keeps_linear_fields(element):
    points, weights = element.quadrature
    measure = {1: 2.0, 2: 0.5 if element.n_corners == 3 else 4.0}[element.dim]
    assert weights.sum() == pytest.approx(measure, rel=1e-14)
    if len(points) >= element.n_corners:
        linear = points @ np.arange(1.0, element.dim + 1) + 0.5
        expected = element.nodes @ np.arange(1.0, element.dim + 1) + 0.5
        assert np.abs(element.extrapolation @ linear - expected).max() < 1e-13
    assert np.abs(element.extrapolation.sum(axis=1) - 1.0).max() < 1e-14


@pytest.mark.parametrize("element", SOLID, ids=lambda e: e.name)
def test_facets_point_outward_and_have_their_mid_node_in_the_middle(element):
    centre = element.nodes[: element.n_corners].mean(axis=0)
    for facet in element.facets:
        nodes = element.nodes[list(facet)]
        tangent = nodes[1] - nodes[0]
        normal = np.array([tangent[1], -tangent[0]])
        assert normal @ (nodes[:2].mean(axis=0) - centre) > 0
        assert len(facet) == elements.get(element.facet).n_nodes
        if len(facet) == 3:
            assert np.allclose(nodes[2], nodes[:2].mean(axis=0))


def test_linear_and_quadratic_partners_share_their_corners():
    for element in ALL:
        linear, quadratic = elements.get(element.linear), elements.get(element.quadratic)
        assert np.array_equal(linear.nodes, quadratic.nodes[: linear.n_nodes])


def test_an_unknown_element_offers_near_names():
    with pytest.raises(MeshError, match=r"'tri7'.*did you mean 'tri6'|'tri7'.*'tri6'"):
        elements.get("tri7")
