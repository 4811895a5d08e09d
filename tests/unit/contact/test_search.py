"""The closest facet compared with brute force, and the frame of the projection."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refused
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from fastcontact import ContactError
from fastcontact._jit import decorators
from fastcontact.contact.projection import closest, closest_of_types
from fastcontact.contact.search.facet_tables import tables, terms
from fastcontact.mesh import elements
from fastcontact.mesh.flat_pieces import flat_triangles


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
    assert np.abs(normal - on(directions) / 10).max() < 2e-3
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


KINDS = ("tri3", "tri6", "quad4", "quad8", "quad9")
BY_SIZE = {elements.get(name).n_nodes: elements.get(name) for name in KINDS}


def triangular(name):
    return name.startswith("tri")


def grid(name, n):
    """Reference coordinates (m, 2) all over a facet, its sides included."""
    a = np.linspace(0 if triangular(name) else -1, 1, n)
    xi = np.stack(np.meshgrid(a, a, indexing="ij"), axis=-1).reshape(-1, 2)
    return xi[xi.sum(axis=1) <= 1 + 1e-12] if triangular(name) else xi


def scattered(name, seed, n, bend=0.02):
    """Facets (n, n_nodes, 3) of about unit size anywhere in a cube, bent at random, and points near them."""
    rng, element = np.random.default_rng(seed), elements.get(name)
    flat = np.column_stack([element.nodes / (1 if triangular(name) else 2), np.zeros(element.n_nodes)])
    turns = Rotation.random(n, random_state=seed).as_matrix()
    facets = (flat * rng.uniform(0.5, 1.5, (n, 1, 3)) + bend * rng.normal(size=(n, *flat.shape))) @ turns
    facets += rng.uniform(-2, 2, (n, 1, 3))
    points = facets[rng.integers(n, size=20)].mean(axis=1) + rng.uniform(-0.7, 0.7, (20, 3))
    return np.ascontiguousarray(facets), points


def on_facets(corners, facet, xi):
    return np.einsum("nk,nkd->nd", BY_SIZE[corners.shape[1]].shape(xi), corners[facet])


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 10_000), n=st.integers(1, 30), name=st.sampled_from(KINDS))
def test_the_closest_facet_is_found_of_search_3d(seed, n, name):
    corners, points = scattered(name, seed, n)
    found = closest(points, corners)
    samples = np.einsum("qk,nkd->nqd", elements.get(name).shape(grid(name, 61)), corners).reshape(-1, 3)
    expected = cKDTree(samples).query(points)[0]
    assert np.abs(on_facets(corners, found.facet, found.xi) - found.position).max() < 1e-11
    assert np.abs(np.linalg.norm(points - found.position, axis=1) - found.distance).max() < 1e-15
    assert (found.distance <= expected + 1e-12).all()
    assert (found.distance >= expected - 0.06).all()
    assert np.abs(np.linalg.norm(found.normal, axis=1) - 1).max() < 1e-14


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000), name=st.sampled_from(KINDS))
def test_a_projection_inside_a_facet_is_perpendicular_to_it(seed, name):
    corners, points = scattered(name, seed, 6)
    found = closest(points, corners)
    s, t = found.xi.T
    inside = (
        np.minimum.reduce([s, t, 1 - s - t]) > 1e-9 if triangular(name) else np.abs(found.xi).max(axis=1) < 1 - 1e-9
    )
    assert (found.overhang[inside] == 0).all()
    gap = np.einsum("nd,nd->n", points - found.position, found.normal)
    assert np.abs(np.abs(gap) - found.distance)[inside].max(initial=0.0) < 1e-11


@pytest.mark.parametrize("name", KINDS)
def test_facets_of_a_sphere_have_outward_normals_of_their_order(name):
    """Patches of the sphere of radius 10 about the x axis, seen from points outside and inside."""
    element, n = elements.get(name), 8
    step = 0.8 / n
    lower = np.array([[-0.4 + step * i, -0.4 + step * j] for i in range(n) for j in range(n)])
    local = element.nodes if triangular(name) else 0.5 * (1 + element.nodes)
    angles = [lower[:, None] + step * local]
    if triangular(name):
        angles.append(lower[:, None] + step * (1 - local))
    theta, phi = np.moveaxis(np.concatenate(angles), 2, 0)

    def ball(theta, phi, radius):
        return radius * np.stack([np.cos(theta) * np.cos(phi), np.sin(theta) * np.cos(phi), np.sin(phi)], axis=-1)

    angle = np.random.default_rng(1).uniform(-0.39, 0.39, (2, 200))
    for radius in (11.0, 9.5):
        found = closest(ball(*angle, radius), ball(theta, phi, 10.0))
        assert np.abs(found.distance - abs(radius - 10)).max() < (3e-2 if element.order == 1 else 2e-4)
        assert np.abs(found.normal - ball(*angle, 1.0)).max() < (0.08 if element.order == 1 else 4e-3)


def test_the_saddle_is_exact():
    """The facet z = x y: seen from a point above its middle that is stationary, but the ridges come closer."""
    corners = np.array([[[-1.0, -1, 1], [1, -1, -1], [1, 1, 1], [-1, 1, -1]]])
    found = closest(np.array([[0.0, 0.0, 3.0], [0.3, -0.2, -0.06], [2.0, 2.0, 1.0]]), corners)
    # Minimise 2 x^2 + (x^2 - 3)^2 along x = y: x^2 = 2, beyond the corner (1, 1).
    assert np.abs(found.xi[0]) == pytest.approx([1.0, 1.0], abs=0)
    assert found.distance[0] == pytest.approx(np.sqrt(6), rel=1e-15)
    assert found.xi[1] == pytest.approx([0.3, -0.2], abs=1e-12)
    assert found.distance[1] == pytest.approx(0.0, abs=1e-14)
    assert found.normal[1] == pytest.approx(np.array([0.2, -0.3, 1.0]) / np.sqrt(1.13), abs=1e-12)
    assert found.xi[2] == pytest.approx([1.0, 1.0], abs=0)


def test_overhang_counts_facet_lengths_beyond_the_sides():
    quad = np.array([[[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]])
    triangle = np.array([[[0.0, 0, 0], [2, 0, 0], [0, 1, 0]]])
    points = np.array([[3.0, 0.5, 1], [1.0, -0.25, 0], [-1.0, 1.5, 0.1], [0.5, 0.2, 5]])
    assert closest(points, quad).overhang == pytest.approx([0.5, 0.25, 0.5, 0.0], abs=1e-15)
    # Beyond the third side s + t = 1 of the triangle: (3, 0.5) has s = 1.5, t = 0.5; its foot is the corner (2, 0).
    assert closest(points, triangle).overhang == pytest.approx([1.0, 0.25, 0.5, 0.0], abs=1e-15)


@pytest.mark.parametrize("name", KINDS)
def test_turning_and_scaling_everything_changes_only_rounding(name):
    corners, points = scattered(name, 5, 25)
    turn, shift, scale = Rotation.random(random_state=6).as_matrix(), np.array([3.0, -20.0, 7.0]), 1e-6
    one = closest(points, corners)
    other = closest(scale * (points @ turn.T + shift), scale * (corners @ turn.T + shift))
    assert np.array_equal(one.facet, other.facet)
    assert np.abs(one.xi - other.xi).max() < 1e-11
    assert np.abs(one.overhang - other.overhang).max() < 1e-11
    assert np.abs(one.distance - other.distance / scale).max() < 1e-12
    assert np.abs(one.normal @ turn.T - other.normal).max() < 1e-11


def test_several_kinds_are_one_surface():
    kinds = [scattered(name, 7, 9)[0] for name in ("tri3", "quad8", "tri6")]
    points = scattered("quad4", 8, 30)[1]
    found = closest_of_types(points, kinds)
    alone = [closest(points, corners) for corners in kinds]
    assert found.distance == pytest.approx(np.min([one.distance for one in alone], axis=0), abs=0)
    for i, facet in enumerate(found.facet):
        kind, row = divmod(facet, 9)
        assert alone[kind].facet[i] == row
        assert alone[kind].xi[i] == pytest.approx(found.xi[i], abs=0)


@pytest.mark.parametrize("name", KINDS)
def test_the_tables_are_those_of_the_elements(name):
    element = elements.get(name)
    nodes, sides, to_terms, (bend, turn, second) = tables(element.n_nodes)
    assert np.array_equal(nodes, element.nodes)
    xi = grid(name, 31)
    assert np.abs(terms(xi, element.n_nodes) @ to_terms - element.shape(xi)).max() < 1e-14
    assert (xi @ sides[:, :2].T <= sides[:, 2] + 1e-14).all()
    # Facets lie no farther than their bend from the flat triangles between their nodes.
    corners = np.random.default_rng(2).normal(size=(50, element.n_nodes, 3))
    allowed = np.linalg.norm(to_terms @ corners, axis=2) @ bend
    weights = np.array([[1, 1, 1], [2, 1, 0], [0, 1, 2], [3, 1, 2]]) / np.array([[3], [3], [3], [6]])
    for flat in flat_triangles(element.n_nodes):
        curved = np.einsum("qk,nkd->nqd", element.shape(weights @ nodes[flat]), corners)
        assert (np.linalg.norm(curved - weights @ corners[:, flat], axis=2) <= allowed[:, None] + 1e-12).all()
    # Tangents at two places of the domain, one of them (0, 0), and second derivatives, by differences.
    places, step = xi * (1 - 2e-4) + 1e-4 * nodes.mean(axis=0), 1e-4
    at = lambda s, t: terms(places + step * np.array([s, t]), element.n_nodes)  # noqa: E731
    slopes = np.stack([at(1, 0) - at(-1, 0), at(0, 1) - at(0, -1)], axis=-1) / (2 * step)
    start = np.eye(element.n_nodes)[:, [1, 2]]
    assert (np.linalg.norm(slopes - start, axis=2).max(axis=0)[3:] <= turn[3:] + 1e-7).all()
    both = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) / (4 * step**2)
    twice = [(at(s, t) - 2 * at(0, 0) + at(-s, -t)) / step**2 for s, t in ((1, 0), (0, 1))]
    hessians = np.stack([twice[0], both, both, twice[1]], axis=-1).reshape(*both.shape, 2, 2)
    assert (np.linalg.norm(hessians, ord=2, axis=(2, 3)).max(axis=0)[3:] <= second[3:] + 1e-5).all()
    areas = [np.linalg.det(nodes[flat[1:]] - nodes[flat[0]]) / 2 for flat in flat_triangles(element.n_nodes)]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(0.5 if triangular(name) else 4.0)


def wavy(name, n):
    """A connected surface of facets (n_facets, n_nodes, 3) over the unit square, and points near it and at its nodes."""
    element, rng = elements.get(name), np.random.default_rng(11)
    lower = np.array([[i, j] for i in range(n) for j in range(n)]) / n
    local = element.nodes if triangular(name) else 0.5 * (1 + element.nodes)
    parts = [lower[:, None] + local / n] + ([lower[:, None] + (1 - local) / n] if triangular(name) else [])
    x, y = np.moveaxis(np.concatenate(parts), 2, 0)
    facets = np.stack([x, y, 0.1 * np.sin(5 * x) * np.cos(4 * y)], axis=-1)
    near = facets.mean(axis=1) + rng.normal(0, 0.3 / n, (len(facets), 3))
    return facets, np.concatenate([near, facets[:40, 0], facets[:40, 1], 1e6 * rng.normal(size=(20, 3))])


def of_lowest_number(points, facets):
    """Distances to the closest facet and the first of those that are equally close, one facet after the other."""
    found = [closest(points, facets[f : f + 1]) for f in range(len(facets))]
    distance = np.array([one.distance for one in found])
    best = distance.min(axis=0)
    place = np.array([one.position for one in found])
    nearest = place[distance.argmin(axis=0), np.arange(len(points))]
    size = np.ptp(facets, axis=1).max()
    meet = np.linalg.norm(place - nearest, axis=2) <= 1e-10 * size
    return best, np.argmax(meet & (distance <= best + 1e-10 * size + 1e-14 * best), axis=0)


@pytest.mark.parametrize("name", KINDS)
def test_the_tree_finds_what_one_facet_after_the_other_finds_of_search_3d(name):
    """Points at the nodes are shared by several facets, points a million sizes away nearly as close to many."""
    facets, points = wavy(name, 9)
    found = closest(points, facets)
    distance, first = of_lowest_number(points, facets)
    assert np.abs(found.distance - distance).max() <= 1e-15 * distance.max()
    assert np.abs(found.distance - distance)[:-20].max() < 1e-14
    assert np.array_equal(found.facet[:-20], first[:-20])


@pytest.mark.parametrize("name", ["line2", "tri3", "quad4", "quad8"])
def test_threads_do_not_change_a_bit(name, monkeypatch):
    if name == "line2":
        facets, points = random_facets(9, 500, 2)[0], np.random.default_rng(10).uniform(-7, 7, (30_000, 2))
    else:
        facets, points = wavy(name, 30)
        points = np.concatenate([points + 1e-3 * k for k in range(30_000 // len(points) + 1)])
    found = []
    for count in (1, 2, 3):
        monkeypatch.setattr(decorators, "threads", lambda count=count: count)
        found.append(closest(points, facets))
    for field in ("facet", "xi", "normal", "overhang", "position", "distance"):
        for other in found[1:]:
            assert np.array_equal(getattr(found[0], field), getattr(other, field))


def test_what_cannot_be_projected_is_told():
    line, near = random_facets(1, 5, 3)
    refused(ContactError, "1 projected points are not finite", closest, np.vstack([near, [np.nan, 0]]), line)
    corners, points = scattered("quad4", 1, 3)
    refused(ContactError, "1 projected points are not finite", closest, np.vstack([points, [np.nan, 0, 0]]), corners)
    refused(ContactError, r"did not converge .* folded or collapsed", closest, points, np.ones((1, 4, 3)))
    refused(ContactError, r"no facets of 5 nodes .* \[3, 4, 6, 8, 9\]", closest, points, np.ones((1, 5, 3)))


def test_short_facets_of_a_wide_surface_are_projected_on():
    """Round-off of coordinates near 1000, over facets 0.3 wide, exceeds the tolerance of Newton's method."""
    y, slope = (7.885176925015513, 17.85236330491464), (-1.1197208691274295e-05, -4.761778277224221e-06)
    corners = [
        [y[0], 0.0, slope[0]],
        [y[1], 0.0, slope[1]],
        [y[1], 0.3342327, -4.761319e-06],
        [y[0], 0.3342326, -1.11916e-05],
    ]
    far = np.array([[999.0, 999.0, 0.0], [1000.0, 999.0, 0.0], [1000.0, 1000.0, 0.0], [999.0, 1000.0, -2.4e-4]])
    random = np.random.default_rng(0)
    points = np.column_stack([random.uniform(9.0, 17.0, 2000), np.zeros(2000), random.uniform(0.02, 0.11, 2000)])
    found, alone = closest(points, np.array([corners, far])), closest(points, np.array([corners]))
    assert (found.facet == 0).all()
    assert np.abs(found.xi - alone.xi).max() < 1e-9
