"""One test for every reference element; every new element must pass it."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from fastcontact.errors import MeshError
from fastcontact.mesh import elements

pytestmark = pytest.mark.pairwise

ALL = list(elements.ELEMENTS.values())
SOLID = [e for e in ALL if e.facet_elements]


def interior_points(element, n=7):
    """Points inside the cell: random blends of its corners."""
    blend = np.random.default_rng(1).dirichlet(np.ones(element.n_corners), n)
    return blend @ element.nodes[: element.n_corners]


def measure(element):
    """Length, area or volume of the reference cell, from its corners alone."""
    corners = element.nodes[: element.n_corners]
    return np.ptp(corners) if element.dim == 1 else ConvexHull(corners).volume


def normals(facet, nodes):
    """Normals (n_q, dim) of a facet at its quadrature points: area per unit of its reference cell."""
    tangents = np.einsum("qna,nd->qad", facet.tables[1], nodes)
    if facet.dim == 1:
        return np.column_stack([tangents[:, 0, 1], -tangents[:, 0, 0]])
    return np.cross(tangents[:, 0], tangents[:, 1])


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
    assert np.isfinite(element.gradient(element.nodes)).all()


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_polynomials_of_the_element_order_are_reproduced(element):
    xi = interior_points(element)

    def polynomial(x):
        return (0.3 + x @ np.arange(1, element.dim + 1)) ** element.order

    assert np.abs(element.shape(xi) @ polynomial(element.nodes) - polynomial(xi)).max() < 1e-13


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_quadrature_measures_the_cell_and_extrapolation_keeps_linear_fields(element):
    points, weights = element.quadrature
    assert weights.sum() == pytest.approx(measure(element), rel=1e-14)
    if len(points) >= element.n_corners:
        linear = points @ np.arange(1.0, element.dim + 1) + 0.5
        expected = element.nodes @ np.arange(1.0, element.dim + 1) + 0.5
        assert np.abs(element.extrapolation @ linear - expected).max() < 1e-13
    assert np.abs(element.extrapolation.sum(axis=1) - 1.0).max() < 1e-14


@pytest.mark.parametrize("element", SOLID, ids=lambda e: e.name)
def test_facets_are_the_outside_of_the_cell_with_normals_outward(element):
    centre = element.nodes[: element.n_corners].mean(axis=0)
    assert len(element.facets) == len(element.facet_elements)
    flux = 0.0
    for local, name in zip(element.facets, element.facet_elements):
        facet, nodes = elements.get(name), element.nodes[list(local)]
        assert facet.dim == element.dim - 1
        # Mid nodes and centres stand where the facet's own element has them between its corners.
        corners = nodes[: facet.n_corners]
        assert np.allclose(facet.corner_shape(facet.nodes) @ corners, nodes, atol=1e-15)
        outward, (N, _, weights) = normals(facet, nodes), facet.tables
        assert (np.einsum("qd,d->q", outward, corners.mean(axis=0) - centre) > 0).all()
        flux += np.einsum("q,qd,qd->", weights, outward, N @ nodes)
    assert flux / element.dim == pytest.approx(measure(element), rel=1e-14)  # divergence theorem


@pytest.mark.parametrize("element", SOLID, ids=lambda e: e.name)
def test_facet_shape_functions_are_those_of_the_cell_on_that_facet(element):
    for local, name in zip(element.facets, element.facet_elements):
        facet = elements.get(name)
        xi = interior_points(facet)
        values = element.shape(facet.shape(xi) @ element.nodes[list(local)])
        assert np.abs(values[:, list(local)] - facet.shape(xi)).max() < 1e-14
        others = np.setdiff1d(np.arange(element.n_nodes), local)
        assert np.abs(values[:, others]).max(initial=0.0) < 1e-14


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_mid_nodes_stand_in_the_order_of_the_edges(element):
    edges = np.array(element.edges)
    ends = element.nodes[edges]
    assert len(np.unique(np.sort(edges, axis=1), axis=0)) == len(edges)
    if element.order == 2:
        assert np.array_equal(element.nodes[element.n_corners : element.n_corners + len(edges)], ends.mean(axis=1))


@pytest.mark.parametrize("element", ALL, ids=lambda e: e.name)
def test_reversed_is_the_same_cell_inside_out(element):
    order = list(element.reversed)
    assert sorted(order) == list(range(element.n_nodes))
    assert [order[i] for i in order] == list(range(element.n_nodes))
    xi = interior_points(element)
    mirrored = -xi if element.dim == 1 else xi[:, [1, 0, 2][: element.dim]]
    assert np.abs(element.shape(xi) @ element.nodes[order] - mirrored).max() < 1e-14
    sets = {frozenset(facet) for facet in element.facets}
    assert {frozenset(order[i] for i in facet) for facet in element.facets} == sets


def test_linear_and_quadratic_partners_share_their_corners():
    for element in ALL:
        linear, quadratic = elements.get(element.linear), elements.get(element.quadratic)
        assert np.array_equal(linear.nodes, quadratic.nodes[: linear.n_nodes])


def test_names_in_other_programs_are_unique():
    for table in (elements.BY_MED, elements.BY_MESHIO, elements.BY_VTK):
        assert len(table) == len(ALL)


def test_an_unknown_element_offers_near_names():
    with pytest.raises(MeshError, match=r"'tri7'.*did you mean 'tri6'|'tri7'.*'tri6'"):
        elements.get("tri7")
