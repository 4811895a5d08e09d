"""Closest points of single facets in 3D: closed forms compared with general descent; unique minima."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from test_search import grid

from fastcontact.contact.search import facets_3d_kernels, straight_3d_kernels
from fastcontact.contact.search import projection_3d_kernels as projection3d
from fastcontact.contact.search.facet_tables import tables
from fastcontact.contact.search.projection_3d_kernels import Domain, Facets
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles

OF_SIZE = {3: "tri3", 4: "quad4", 6: "tri6", 8: "quad8", 9: "quad9"}


def domain(m):
    nodes, sides = tables(m)[:2]
    return Domain(nodes, flat_triangles(m), sides)


def prepared(corners):
    """Facets (n, m, 3) ready for a search, and their boxes."""
    n, m = corners.shape[:2]
    table = tables(m)
    facets = Facets(corners, np.zeros(3), np.empty(corners.shape), np.empty(n), np.empty(n))
    low, high = np.empty((n, 3)), np.empty((n, 3))
    facets_3d_kernels.prepare(facets, 0, n, table.to_terms, table.weights, low, high)
    return facets, low, high


def bent(m, seed, bend):
    rng = np.random.default_rng(seed)
    nodes = tables(m)[0]
    return np.column_stack([nodes * rng.uniform(0.3, 2, 2), np.zeros(m)])[None] + bend * rng.normal(size=(1, m, 3)), rng


def on(corners, m, xi):
    return elements.get(OF_SIZE[m]).shape(np.atleast_2d(xi)) @ corners


def minima(facets, m, point):
    """Squared distances at the local minima that descents from all over the facet lead to."""
    shape = domain(m)
    found = []
    for s, t in grid(OF_SIZE[m], 7):
        s, t, converged = projection3d.descend(facets.terms, 0, s, t, shape.sides, point)
        assert converged
        found.append((s, t, 2.0 * projection3d.half_square(facets.terms, 0, s, t, point)))
    return np.array(found)


@settings(max_examples=200, deadline=None)
@given(
    seed=st.integers(0, 10**6), m=st.sampled_from([4, 6, 8, 9]), bend=st.sampled_from([0.01, 0.05, 0.2, 0.6]),
    near=st.floats(0.0, 0.999),
)  # fmt: skip
def test_within_the_bound_there_is_one_minimum(seed, m, bend, near):
    corners, rng = bent(m, seed, bend)
    facets, _, _ = prepared(corners)
    if facets.convexity_bound[0] == 0.0:
        return
    place = grid(OF_SIZE[m], 9)[rng.integers(len(grid(OF_SIZE[m], 9)))]
    foot, direction = on(corners[0], m, place)[0], rng.normal(size=3)
    if m == 4:
        # Along the normal at the foot, which then is a stationary point, as far as |(r - X) . c| stays below the bound.
        a, b, c = facets.terms[0, 1:]
        direction = np.cross(a + place[1] * c, b + place[0] * c)
        most = facets.convexity_bound[0] / max(abs(direction @ c), 1e-300)
    else:
        most = np.sqrt(facets.convexity_bound[0]) / np.linalg.norm(direction)
    point = tuple(foot + near * min(most, 1e3) * direction)
    found = minima(facets, m, point)
    best = found[np.argmin(found[:, 2])]
    assert np.abs(found[:, :2] - best[:2]).max() < 1e-5
    if m == 4:
        assert best[:2] == pytest.approx(place, abs=1e-5)


def test_beyond_the_bound_there_may_be_two():
    """The saddle z = s t / 2: a point on its axis is nearest to two places as soon as (r - X) . c exceeds 1."""
    corners = np.array([[[-1.0, -1, 0.5], [1, -1, -0.5], [1, 1, 0.5], [-1, 1, -0.5]]])
    facets, _, _ = prepared(corners)
    assert 0.25 < facets.convexity_bound[0] < 1.0
    below, beyond = minima(facets, 4, (0.0, 0.0, 1.8)), minima(facets, 4, (0.0, 0.0, 2.2))
    assert np.abs(below[:, :2]).max() < 1e-6
    assert len(np.unique(np.round(beyond[:, :2], 3), axis=0)) > 1


def compare_bilinear(corners, point):
    """Check the closed form against the general search, wherever the closed form claims to be right."""
    facets, _, _ = prepared(corners)
    o, a, b, c = (tuple(term) for term in facets.terms[0])
    s, t, square = straight_3d_kernels.on_bilinear(tuple(np.subtract(point, o)), a, b, c, np.inf)
    rest = np.subtract(point, on(corners[0], 4, (s, t))[0])
    if not (square >= 0.0 and abs(rest @ c) < facets.convexity_bound[0]):
        return False
    size = np.linalg.norm(corners[0] - corners[0].mean(axis=0), axis=1).max()
    assert rest @ rest == pytest.approx(square, rel=1e-11, abs=1e-26 * size**2)
    u, v, half, converged = projection3d.project(facets, 0, domain(4), tuple(point), np.inf)
    assert converged
    assert np.sqrt(square) == pytest.approx(np.sqrt(2 * half), rel=1e-11, abs=1e-13 * size)
    assert np.abs(on(corners[0], 4, (s, t)) - on(corners[0], 4, (u, v))).max() < 1e-6 * (size + np.sqrt(square))
    # Brute force stays above.
    away = np.linalg.norm(on(corners[0], 4, grid("quad4", 41)) - point, axis=1).min()
    assert np.sqrt(square) <= away * (1 + 1e-12) + 1e-13 * size
    return True


@settings(max_examples=300, deadline=None)
@given(
    seed=st.integers(0, 10**6), bend=st.sampled_from([0.0, 0.01, 0.1, 0.4]), far=st.sampled_from([0.0, 0.1, 1.0, 30.0])
)
def test_bilinear_facets_in_closed_form(seed, bend, far):
    corners, rng = bent(4, seed, bend)
    point = on(corners[0], 4, rng.uniform(-1, 1, 2))[0] + far * rng.normal(size=3)
    assert compare_bilinear(corners, point) or bend >= 0.1 or far * bend >= 0.1


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_degenerate_and_strongly_warped_facets_are_right_or_refused(seed):
    rng = np.random.default_rng(seed)
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    triangle, needle, folded = square.copy(), square * [1, 1e-7, 1], square.copy()
    triangle[3] = triangle[2]  # one side collapsed
    folded[2] = [0.1, 0.1, 0.0]  # not convex
    line = square * [1, 0, 0]
    point_like = np.zeros((4, 3))
    drawn = rng.normal(size=(4, 3)), rng.normal(size=(4, 3)) * [1, 1, 9]
    for corners in (triangle, needle, folded, line, point_like, *drawn):
        compare_bilinear(corners[None], rng.uniform(-1, 2, 3))
    facets, _, _ = prepared(np.stack([line, point_like]))
    assert facets.convexity_bound.tolist() == [0.0, 0.0]


def test_a_bilinear_facet_out_of_reach_is_told_at_once():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [1, 1, 0.1], [0, 1, 0]]])
    facets, _, _ = prepared(corners)
    o, a, b, c = (tuple(term) for term in facets.terms[0])
    far = tuple(np.subtract((5.0, 0.5, 0.0), o))
    assert straight_3d_kernels.on_bilinear(far, a, b, c, 3.9)[2] == np.inf
    assert straight_3d_kernels.on_bilinear(far, a, b, c, 4.1)[2] == pytest.approx(16.0, abs=0.01)


@settings(max_examples=300, deadline=None)
@given(seed=st.integers(0, 10**6), shape=st.sampled_from([1.0, 1e-3, 1e-6, 0.0]), far=st.sampled_from([1e-3, 1.0, 1e6]))
@example(seed=5564, shape=0.0, far=1.0)
@example(seed=10, shape=0.0, far=1e-3)
@example(seed=106, shape=0.0, far=1e-3)
@example(seed=308, shape=1e-6, far=1e-3)
def test_flat_triangles_in_closed_form(seed, shape, far):
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(3, 3)) * [1, shape, shape]
    point = corners.mean(axis=0) + far * rng.normal(size=3)
    a, b = corners[1] - corners[0], corners[2] - corners[0]
    s, t = straight_3d_kernels.on_flat(tuple(point - corners[0]), tuple(a), tuple(b))
    assert min(s, t, 1 - s - t) >= -1e-12
    found = np.linalg.norm(corners[0] + s * a + t * b - point)
    # The closest point lies on a side, or its rest is perpendicular to both tangents.
    sides = []
    for p, q in ((0, 1), (1, 2), (2, 0)):
        along = corners[q] - corners[p]
        place = np.clip((point - corners[p]) @ along / max(along @ along, 1e-300), 0, 1)
        sides.append(np.linalg.norm(corners[p] + place * along - point))
    within, *_ = np.linalg.lstsq(np.column_stack([a, b]), point - corners[0], rcond=None)
    best = min(sides)
    if min(*within, 1 - within.sum()) > 0:
        best = min(best, np.linalg.norm(corners[0] + within @ [a, b] - point))
    assert found == pytest.approx(best, rel=1e-9, abs=1e-9 * np.abs(corners).max())


@settings(max_examples=100, deadline=None)
@given(seed=st.integers(0, 10**6), m=st.sampled_from([3, 4, 6, 8, 9]), bend=st.sampled_from([0.0, 0.05, 0.5]))
def test_facets_are_prepared_as_they_are(seed, m, bend):
    corners, _ = bent(m, seed, bend)
    facets, low, high = prepared(corners)
    xi = grid(OF_SIZE[m], 21)
    places = on(corners[0], m, xi)
    polynomial = np.array([[projection3d.component(facets.terms, 0, d, *place)[0] for d in range(3)] for place in xi])
    assert np.abs(polynomial - places).max() < 1e-13
    assert (places >= low - 1e-13).all()
    assert (places <= high + 1e-13).all()
    assert (facets.deviation[0] == 0) == (m == 3 or bend == 0)
