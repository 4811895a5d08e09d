"""The tree search compared with brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact import ContactError
from fastcontact._jit import decorators
from fastcontact.contact.search.closest import closest


def search(points, corners):
    found = closest(points, corners)
    return found.facet, found.xi, found.normal, found.overhang


def curve(corners, s):
    if corners.shape[1] == 2:
        return 0.5 * (1 - s) * corners[:, 0] + 0.5 * (1 + s) * corners[:, 1]
    return 0.5 * s * (s - 1) * corners[:, 0] + 0.5 * s * (s + 1) * corners[:, 1] + (1 - s * s) * corners[:, 2]


def brute_force(points, corners):
    """Distances to the closest facet by dense sampling, from above."""
    samples = np.concatenate([curve(corners, s) for s in np.linspace(-1, 1, 2001)])
    return np.sqrt(((points[:, None] - samples[None]) ** 2).sum(axis=2).min(axis=1))


def random_facets(seed, n, n_nodes):
    rng = np.random.default_rng(seed)
    start = rng.uniform(-5, 5, (n, 2))
    end = start + rng.normal(0, 1, (n, 2))
    corners = np.stack([start, end], axis=1)
    if n_nodes == 3:
        middle = 0.5 * (start + end) + 0.15 * rng.normal(0, 1, (n, 2)) * np.linalg.norm(end - start, axis=1)[:, None]
        corners = np.concatenate([corners, middle[:, None]], axis=1)
    return np.ascontiguousarray(corners), rng.uniform(-7, 7, (12, 2))


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 40), n_nodes=st.sampled_from([2, 3]))
def test_the_closest_facet_is_found(seed, n, n_nodes):
    corners, points = random_facets(seed, n, n_nodes)
    facet, xi, normal, _ = search(points, corners)
    found = np.linalg.norm(points - np.stack([curve(corners[f : f + 1], s)[0] for f, s in zip(facet, xi)]), axis=1)
    expected = brute_force(points, corners)
    assert (found <= expected + 1e-12).all()
    assert (found >= expected - 5e-3).all()
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-14


def test_projection_on_a_circle_of_quadratic_facets_and_normals_point_outward():
    angle = np.linspace(0, -np.pi / 2, 9)  # clockwise: the solid lies inside
    end, middle = angle, 0.5 * (angle[1:] + angle[:-1])
    on = lambda a: 10 * np.column_stack([np.cos(a), np.sin(a)])  # noqa: E731
    corners = np.ascontiguousarray(np.stack([on(end[1:]), on(end[:-1]), on(middle)], axis=1))
    directions = np.linspace(-1.5, -0.05, 23)
    _, _, normal, overhang = search(1.3 * on(directions), corners)
    unit = on(directions) / 10
    assert np.abs(normal - unit).max() < 2e-3
    assert (overhang == 0).all()


def test_overhang_counts_facet_lengths_beyond_the_end():
    corners = np.array([[[0.0, 0.0], [2.0, 0.0]], [[2.0, 0.0], [4.0, 0.0]]])
    _, _, _, overhang = search(np.array([[5.0, 1.0], [-3.0, 0.5], [1.0, 1.0]]), corners)
    assert overhang == pytest.approx([0.5, 1.5, 0.0], abs=1e-15)


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), n_nodes=st.sampled_from([2, 3]), scale=st.floats(-9, 9))
def test_beyond_a_convex_node_the_facet_that_ends_there_is_taken(seed, n_nodes, scale):
    """However coordinates are rounded: both facets end in the same node, which is the closest point of both."""
    rng = np.random.default_rng(seed)
    node = 10.0**scale * rng.uniform(-5, 5, 2)
    turn = rng.uniform(0, 2 * np.pi)
    out = np.array([np.cos(turn), np.sin(turn)])
    aside = np.array([-out[1], out[0]])
    before, after = (node - 10.0**scale * rng.uniform(0.5, 2) * (0.4 * out + sign * aside) for sign in (1.0, -1.0))
    ends = np.stack([[before, node], [node, after]])
    corners = ends if n_nodes == 2 else np.concatenate([ends, ends.mean(axis=1, keepdims=True)], axis=1)
    sideways = rng.uniform(-0.3, 0.3, (20, 1))
    points = node + 10.0**scale * rng.uniform(0.1, 3, (20, 1)) * (out + sideways * aside)
    for order in ([0, 1], [1, 0]):
        facet, xi, _, _ = search(points, np.ascontiguousarray(corners[order]))
        assert (facet == order.index(0)).all()
        assert (xi == 1.0).all()


def test_of_equally_close_facets_the_one_that_ends_there_is_taken():
    corners = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]]])
    facet, xi, _, _ = search(np.array([[1.0, 0.7]]), corners)
    assert (facet[0], xi[0]) == (0, 1.0)


@pytest.mark.parametrize("n_nodes", [2, 3])
def test_the_tree_finds_what_one_facet_after_the_other_finds(n_nodes):
    """Points near, at the ends and a million sizes away; facets that coincide, in any order of points."""
    corners, near = random_facets(7, 300, n_nodes)
    corners[200:220] = corners[100:120]
    rng = np.random.default_rng(8)
    near = np.concatenate([near, corners[:, 0], corners[:, 1], rng.uniform(-7, 7, (500, 2))])
    points = np.concatenate([near, 1e6 * rng.normal(size=(20, 2))])
    found = closest(points, corners)
    alone = [closest(points, corners[f : f + 1]) for f in range(len(corners))]
    distance = np.array([one.distance for one in alone])
    assert found.distance == pytest.approx(distance.min(axis=0), rel=1e-15, abs=0)
    first = np.argmin(distance[:, : len(near)], axis=0)
    same = found.facet[: len(near)] == first
    # Equally close but for rounding, where facets share an end or cross.
    assert (
        np.abs(distance[found.facet[: len(near)], np.arange(len(near))] - distance.min(axis=0)[: len(near)]).max()
        < 1e-14
    )
    assert same[~np.isclose(np.sort(distance, axis=0)[1, : len(near)], distance.min(axis=0)[: len(near)])].all()
    assert not np.isin(found.facet, np.arange(200, 220)).any()
    some = rng.permutation(len(points))
    again = closest(points[some], corners)
    for field in ("facet", "xi", "normal", "overhang", "position", "distance"):
        assert np.array_equal(getattr(again, field), getattr(found, field)[some])


def test_threads_do_not_change_a_bit(monkeypatch):
    corners, _ = random_facets(9, 500, 2)
    points, found = np.random.default_rng(10).uniform(-7, 7, (30_000, 2)), []
    for count in (1, 3):
        monkeypatch.setattr(decorators, "threads", lambda count=count: count)
        found.append(closest(points, corners))
    for field in ("facet", "xi", "normal", "overhang", "position", "distance"):
        assert np.array_equal(getattr(found[0], field), getattr(found[1], field))


def test_points_that_are_not_finite_are_told():
    corners, points = random_facets(1, 5, 3)
    points[3, 1] = np.nan
    with pytest.raises(ContactError, match="1 points to project are not finite"):
        closest(points, corners)
