"""Dual shape functions: biorthogonal, sum of one, bounded on any part of a facet."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact.contact.formulations._dual_basis import MOST, biorthogonal, dual_functions, positive
from fastcontact.mesh import elements, quadrature

FACETS = ("line2", "line3", "tri3", "tri6", "quad4", "quad8", "quad9")


def corners(name):
    element = elements.get(name)
    return element.nodes[: element.n_corners]


def cut(polygon, direction, level):
    """The part of a polygon below a level along a direction."""
    kept = []
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        here, there = a @ direction - level, b @ direction - level
        if here <= 0:
            kept.append(a)
        if here * there < 0:
            kept.append(a + (b - a) * here / (here - there))
    return np.array(kept).reshape(-1, 2)


def rule(polygon):
    """Points and weights on a line (2, 1) or a convex polygon (n, 2)."""
    if polygon.shape[1] == 1:
        s, w = quadrature.gauss_line(6)
        length = float(polygon[1, 0] - polygon[0, 0])
        return polygon[0] + 0.5 * (1 + s) * length, 0.5 * w * length
    p, w = quadrature.triangle(8)
    points, weights = [], []
    for b, c in pairwise(polygon[1:]):
        u, v = b - polygon[0], c - polygon[0]
        points.append(polygon[0] + p[:, :1] * u + p[:, 1:] * v)
        weights.append(w * (u[0] * v[1] - u[1] * v[0]))
    return np.vstack(points), np.concatenate(weights)


def mass_over(name, polygon):
    xi, w = rule(polygon)
    N = elements.get(name).shape(xi) @ positive(name).T
    return np.einsum("q,qa,qb->ab", w, N, N)


@pytest.mark.parametrize("name", FACETS)
def test_the_positive_functions_are_positive_and_sum_to_one(name):
    element = elements.get(name)
    steps = np.linspace(0, 1, 41)
    if element.dim == 1:
        xi = 2 * steps[:, None] - 1
    else:
        xi = np.array([[a, b] for a in steps for b in steps])
        xi = xi[xi.sum(axis=1) <= 1 + 1e-12] if element.n_corners == 3 else 2 * xi - 1
    N = element.shape(xi) @ positive(name).T
    assert N.min() > -1e-15
    assert N.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    weights = mass_over(name, corners(name)).sum(axis=1)
    assert weights.min() >= 0.5 * weights.max() * (1 - 1e-12)  # none is much lighter than the others


@pytest.mark.parametrize("name", ["line3", "tri6", "quad9"])
def test_they_are_the_polynomials_of_bernstein(name):
    """Of the degree-2 Bernstein polynomials, the one of a corner is the square of its linear function."""
    xi, _ = rule(corners(name))
    element = elements.get(name)
    N = element.shape(xi) @ positive(name).T
    assert N[:, : element.n_corners] == pytest.approx(elements.get(element.linear).shape(xi) ** 2, abs=1e-14)


@pytest.mark.parametrize("name", FACETS)
def test_the_displacement_of_a_gap_is_that_of_one_node_and_of_the_ends_of_its_edge(name):
    """What makes the elimination triangular: corners first, then mid nodes, then centres."""
    back = np.linalg.inv(positive(name)).T
    assert np.array_equal(np.triu(back, 1), np.zeros_like(back))
    assert np.diag(back).min() >= 1.0
    assert back.sum(axis=1) == pytest.approx(1.0, abs=1e-13)


def test_dual_functions_of_straight_lines_are_those_of_wohlmuth():
    dual, _ = biorthogonal(mass_over("line2", corners("line2"))[None], np.ones((1, 2), bool))
    assert dual[0] == pytest.approx(np.array([[2.0, -1.0], [-1.0, 2.0]]), abs=1e-14)


@pytest.mark.parametrize("name", FACETS)
def test_whole_facets_have_biorthogonal_functions_of_sum_one(name):
    mass = mass_over(name, corners(name))[None]
    every = np.ones(mass.shape[:2], bool)
    dual, D = dual_functions(mass, every, np.ones(mass.shape[:2]))
    assert D[0] == pytest.approx(np.diag(mass[0].sum(axis=1)), abs=0.0)
    assert dual @ mass == pytest.approx(D, abs=1e-13)
    assert dual[0].sum(axis=0) == pytest.approx(1.0, abs=1e-12)


@settings(max_examples=200, deadline=None)
@given(
    name=st.sampled_from(FACETS),
    angles=st.lists(st.floats(0, 6.28), min_size=1, max_size=3),
    levels=st.lists(st.floats(-6, 0), min_size=3, max_size=3),
    left_out=st.integers(-1, 8),
)
def test_on_any_part_of_a_facet_the_functions_sum_to_one_and_stay_moderate(name, angles, levels, left_out):
    element = elements.get(name)
    part = corners(name)
    if element.dim == 1:
        length = 2 * 10 ** levels[0]
        start = -1 + (2 - length) * abs(np.sin(angles[0]))
        part = np.array([[start], [start + length]])
    else:
        for angle, level in zip(angles, levels, strict=False):
            direction = np.array([np.cos(angle), np.sin(angle)])
            low, high = (part @ direction).min(), (part @ direction).max()
            part = cut(part, direction, low + 10**level * (high - low))
            if len(part) < 3:
                return
    mass = mass_over(name, part)[None]
    area = mass.sum()
    if area < 1e-11:
        return
    weight = mass.sum(axis=2)
    fraction = weight / mass_over(name, corners(name)).sum(axis=1)
    kept = np.arange(element.n_nodes)[None] != left_out
    dual, D = dual_functions(mass, kept, fraction)
    assert dual[0].sum(axis=0) == pytest.approx(1.0, abs=1e-8)  # a uniform pressure is carried on
    assert dual @ mass == pytest.approx(D, abs=1e-8 * area)
    assert np.sqrt(np.einsum("ab,bc,ac->a", dual[0], mass[0], dual[0]) / area).max() <= MOST
    taking_part = np.diag(D[0]) > 0
    assert not taking_part[~kept[0]].any()
    among = D[0][np.ix_(taking_part, taking_part)]
    assert np.array_equal(among, np.diag(np.diag(among)))
    assert (dual[0] @ weight[0])[taking_part].min() > 0.0


@pytest.mark.parametrize("name", FACETS)
def test_the_functions_that_a_whole_facet_keeps_stay_the_same_as_it_deforms(name):
    """Beside a plane of symmetry nodes are left out, and of the others no functions may suit: one of them is chosen."""
    mass, element, random = mass_over(name, corners(name))[None], elements.get(name), np.random.default_rng(3)
    held = (0,) if element.dim == 1 else (0, 1, *((element.n_corners,) if element.order == 2 else ()))
    kept = ~np.isin(np.arange(element.n_nodes), held)[None]
    chosen = set()
    for _ in range(50):
        _, D = dual_functions(mass, kept, 1.0 + 0.03 * random.uniform(-1.0, 1.0, kept.shape))
        chosen.add(tuple((np.diag(D[0]) > 0).tolist()))
    assert len(chosen) == 1


@pytest.mark.parametrize("edges", [0, 1, 2])
@pytest.mark.parametrize("name", ["quad4", "quad8", "quad9"])
def test_the_functions_do_not_depend_on_the_corner_from_which_a_facet_is_numbered(name, edges):
    """Nodes of a corner, of an edge and of two are left out: what remains keeps the symmetry of the facet."""
    element = elements.get(name)
    out = {0, *(node for edge in element.edges[:edges] for node in edge)}
    out |= set(range(element.n_corners, element.n_corners + edges)) if element.order == 2 else set()
    middle = element.nodes[: element.n_corners].mean(axis=0)
    axis = element.nodes[[*out]].mean(axis=0) - middle  # the facet and what is left out are symmetric about it
    axis /= np.linalg.norm(axis)
    mirrored = 2.0 * (element.nodes - middle) @ np.outer(axis, axis) - (element.nodes - middle) + middle
    image = np.linalg.norm(element.nodes[:, None] - mirrored, axis=2).argmin(axis=0)
    kept = ~np.isin(np.arange(element.n_nodes), [*out])[None]
    assert np.array_equal(kept[0, image], kept[0])
    dual, _ = dual_functions(mass_over(name, corners(name))[None], kept, np.ones(kept.shape))
    assert dual[0][np.ix_(image, image)] == pytest.approx(dual[0], abs=1e-9)


def test_a_facet_that_faces_nothing_has_no_functions():
    dual, D = dual_functions(np.zeros((1, 4, 4)), np.ones((1, 4), bool), np.zeros((1, 4)))
    assert not dual.any()
    assert not D.any()


def test_a_strip_across_the_middle_has_one_function():
    """There no polynomial tells the nodes apart; one of them takes the whole pressure."""
    mass = mass_over("line3", np.array([[0.1], [0.1001]]))[None]
    fraction = mass.sum(axis=2) / mass_over("line3", corners("line3")).sum(axis=1)
    dual, D = dual_functions(mass, np.ones((1, 3), bool), fraction)
    assert (np.diag(D[0]) > 0).sum() == 1
    assert dual[0].sum(axis=0) == pytest.approx(1.0, abs=1e-12)
