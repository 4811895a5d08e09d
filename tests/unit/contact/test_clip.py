"""Intersection of facets in 3D: areas add up at any position; products are integrated exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact._jit.decorators import set_threads, threads
from fastcontact.contact.formulations import _cut_faces_kernels
from fastcontact.contact.search.box_tree_kernels import build, tree_order
from fastcontact.contact.search.facet_tables import tables
from fastcontact.mesh import elements, quadrature


def planes(corners):
    n, count = corners.shape[:2]
    origin, axes = np.empty((n, 3)), np.empty((n, 3, 3))
    _cut_faces_kernels.planes(corners, count, origin, axes)
    return origin, axes


def facing(secondary, primary, room=1000, reach=2.0):
    """Pairs of polygons (n, n_corners, 3) that face each other."""
    (origin, axes), (_, other_axes) = planes(secondary), planes(primary)
    radius = np.linalg.norm(secondary - origin[:, None], axis=2).max(axis=1)
    numbers = tree_order(primary[:, 0].copy(), 1)
    tree = build(primary.min(axis=1)[numbers], primary.max(axis=1)[numbers])
    pairs = np.empty((room, 2), np.intp)
    count = _cut_faces_kernels.facing_pairs(
        secondary, secondary.shape[1], origin, axes, radius, np.full(len(secondary), reach),
        primary, primary.shape[1], np.ascontiguousarray(other_axes[:, 2]), numbers, tree, -0.1, pairs,
    )  # fmt: skip
    return pairs[: min(count, room)], count


def integrated(secondary, primary, kinds, reference=None, heights=None):
    """Pairs, mass and coupling of facets given by their nodes, with the rule of degree 8; with heights, their integrals, too.

    `heights` (2, k, k) are powers of the reference coordinates, the same for all facets of a side, that count by a half.
    """
    one, other = (elements.get(kind) for kind in kinds)
    corners, opposite = secondary[:, : one.n_corners].copy(), primary[:, : other.n_corners].copy()
    pairs, _ = facing(corners, opposite)
    origin, axes = planes(corners)
    to_terms, other_to_terms = tables(one.n_nodes).to_terms, tables(other.n_nodes).to_terms
    reference = secondary if reference is None else reference
    mass = np.empty((len(secondary), one.n_nodes, one.n_nodes))
    coupling = np.empty((len(pairs), one.n_nodes, other.n_nodes))
    closer = np.empty((len(secondary), one.n_nodes))
    above = [np.tile(powers, (len(side), 1, 1)) for powers, side in zip(
        np.zeros((2, 0, 0)) if heights is None else heights, (secondary, primary), strict=True
    )]  # fmt: skip
    factor = np.full((len(pairs), 2), 0.5)
    wrong = _cut_faces_kernels.integrate(
        0, len(corners), np.searchsorted(pairs[:, 0], np.arange(len(corners) + 1)),
        corners, one.n_corners, origin, axes, to_terms @ secondary, to_terms @ reference, to_terms,
        one.nodes[: one.n_corners].mean(axis=0), opposite, other.n_corners, other_to_terms @ primary,
        other_to_terms, other.nodes[: other.n_corners].mean(axis=0), pairs, *quadrature.triangle(8), *above, factor,
        mass, coupling, closer,
    )  # fmt: skip
    assert wrong == -1
    return (pairs, mass, coupling) if heights is None else (pairs, mass, coupling, closer)


def rotation(seed):
    q, _ = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    return q * np.sign(np.linalg.det(q))


def lines(n):
    return np.linspace(0, 1, n + 1)


def grid(nx, ny, height, up, kind="quad4"):
    """Quadrangles (n, n_nodes, 3) over the unit square at a height, looking up or down."""
    element = elements.get(kind)
    x, y = lines(nx), lines(ny)
    order = np.arange(element.n_nodes) if up else np.array(element.reversed)
    found = []
    for i in range(nx):
        for j in range(ny):
            s, t = 0.5 * (1 + element.nodes[order].T)
            flat = x[i] + s * (x[i + 1] - x[i]), y[j] + t * (y[j + 1] - y[j])
            found.append(np.column_stack([*flat, np.full(element.n_nodes, height)]))
    return np.array(found)


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 1000), nx=st.integers(1, 4), ny=st.integers(1, 4), gap=st.floats(-0.3, 0.3))
def test_pieces_of_one_square_cover_the_other(seed, nx, ny, gap):
    Q = rotation(seed)
    lower, upper = grid(nx, ny, 0.0, True) @ Q.T, grid(3, 2, gap, False) @ Q.T
    pairs, mass, coupling = integrated(lower, upper, ("quad4", "quad4"))
    assert mass.sum(axis=(1, 2)) == pytest.approx(1.0 / (nx * ny), abs=1e-12)
    per_facet = np.bincount(pairs[:, 0], weights=coupling.sum(axis=(1, 2)), minlength=nx * ny)
    assert per_facet == pytest.approx(1.0 / (nx * ny), abs=1e-12)


def test_facets_are_integrated_to_the_same_bits_by_any_number_of_threads():
    before, found = threads(), []
    for count in (1, min(2, before)):
        set_threads(count)
        found.append(integrated(grid(9, 8, 0.0, True), grid(7, 11, 0.1, False), ("quad4", "quad4")))
    set_threads(before)
    for one, other in zip(*found, strict=True):
        assert np.array_equal(one, other)


def overlap_of_intervals(a, b):
    return max(a[0], b[0]), min(a[1], b[1])


@pytest.mark.parametrize("kinds", [("quad4", "quad4"), ("quad8", "quad4"), ("quad4", "quad9"), ("quad9", "quad8")])
def test_products_agree_with_a_rule_on_rectangles(kinds):
    """Facets along the axes overlap in rectangles, which the product rule of Gauss integrates exactly.

    The reference surface is stretched threefold in x, and areas are those of the reference.
    """
    lower, upper = grid(2, 3, 0.0, True, kinds[0]), grid(3, 2, 0.2, False, kinds[1])
    stretched = lower * np.array([3.0, 1.0, 1.0])
    heights = np.random.default_rng(1).normal(size=(2, 3, 3))
    pairs, mass, coupling, closer = integrated(lower, upper, kinds, stretched, heights)
    expected_closer = np.zeros_like(closer)
    (one, other), points = (elements.get(kind) for kind in kinds), quadrature.gauss_square(4)
    expected_mass = np.zeros_like(mass)
    seen = 0
    for (s, p), found in zip(pairs, coupling, strict=True):
        boxes = [
            (nodes[:, d].min(), nodes[:, d].max()) for nodes in (lower[s], upper[p]) for d in range(2)
        ]  # x and y of the one, x and y of the other
        (x0, x1), (y0, y1) = (overlap_of_intervals(boxes[d], boxes[2 + d]) for d in range(2))
        assert x1 > x0
        assert y1 > y0
        x = x0 + 0.5 * (1 + points[0][:, 0]) * (x1 - x0)
        y = y0 + 0.5 * (1 + points[0][:, 1]) * (y1 - y0)
        weights = points[1] * 0.25 * (x1 - x0) * (y1 - y0) * 3.0
        shapes, above = [], np.zeros(len(weights))
        for element, nodes, box in ((one, lower[s], boxes[:2]), (other, upper[p], boxes[2:])):
            xi = np.column_stack([2 * (v - a) / (b - a) - 1 for v, (a, b) in zip((x, y), box, strict=True)])
            xi = xi[:, ::-1] if shapes else xi  # what looks down has s and t swapped
            above += 0.5 * np.polynomial.polynomial.polyval2d(*xi.T, heights[len(shapes)])
            shapes.append(element.shape(xi))
            assert shapes[-1] @ nodes[:, :2] == pytest.approx(np.column_stack([x, y]), abs=1e-12)
        assert found == pytest.approx(np.einsum("q,qa,qb->ab", weights, *shapes), abs=1e-13)
        expected_mass[s] += np.einsum("q,qa,qb->ab", weights, shapes[0], shapes[0])
        expected_closer[s] += np.einsum("q,qa,q->a", weights, shapes[0], above)
        seen += 1
    assert seen == 16  # pieces in 4 columns and 4 rows
    assert mass == pytest.approx(expected_mass, abs=1e-13)
    assert closer == pytest.approx(expected_closer, abs=1e-13)


def test_a_triangle_and_a_quadrangle_share_their_common_part():
    triangle = np.array([[[0.0, 0, 0], [2, 0, 0], [0, 2, 0]]])
    square = np.array([[[0.0, 0, 1], [0, 1.5, 1], [1.5, 1.5, 1], [1.5, 0, 1]]])
    _, mass, _ = integrated(triangle, square, ("tri3", "quad4"))
    assert mass.sum() == pytest.approx(2.0 - 2 * 0.5 * 0.25, abs=1e-14)


def test_facets_that_look_the_same_way_or_lie_apart_share_nothing():
    square, opposite = grid(1, 1, 0.0, True), grid(1, 1, 0.1, False)
    assert facing(square, grid(1, 1, 0.1, True))[1] == 0
    assert facing(square, opposite + np.array([5.0, 0, 0]))[1] == 0
    assert facing(square, opposite + np.array([1.0, 0, 0]))[1] == 0
    assert facing(square, opposite)[1] == 1
    assert facing(square, grid(1, 1, 1.0, False), reach=0.2)[1] == 0


def test_all_pairs_of_large_grids_are_found():
    """The tree against the counting of overlapping intervals."""
    lower, upper = grid(13, 9, 0.0, True), grid(7, 11, 0.1, False)
    overlaps = [
        sum(min(a[i + 1], b[j + 1]) - max(a[i], b[j]) > 1e-9 for i in range(len(a) - 1) for j in range(len(b) - 1))
        for a, b in ((lines(13), lines(7)), (lines(9), lines(11)))
    ]
    pairs, count = facing(lower, upper)
    assert count == overlaps[0] * overlaps[1]
    assert len(np.unique(pairs, axis=0)) == count
    assert (np.diff(pairs[:, 0]) >= 0).all()


def test_too_little_room_is_told():
    pairs, count = facing(grid(2, 2, 0.0, True), grid(3, 3, 0.1, False), room=1)
    assert count == 16
    assert len(pairs) == 1
