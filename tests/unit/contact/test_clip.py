"""Intersection of facets in 3D, and dual shape functions on any part of a facet."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import united

import fastcontact as fc
from fastcontact._jit.decorators import set_threads, threads
from fastcontact.contact.formulations import _cut_faces_kernels
from fastcontact.contact.formulations._cut_faces import face_overlap
from fastcontact.contact.formulations._dual_basis import LARGEST_RMS, dual_functions, positive_basis
from fastcontact.contact.search.box_tree_kernels import build, tree_order
from fastcontact.contact.search.facet_tables import tables
from fastcontact.contact.surface import surface
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
    numbers = tree_order(primary[:, 0].copy())
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
    of_pairs = np.empty((len(pairs), one.n_nodes, one.n_nodes))
    coupling = np.empty((len(pairs), one.n_nodes, other.n_nodes))
    closer = np.empty((len(secondary), one.n_nodes))
    above = [np.tile(powers, (len(side), 1, 1)) for powers, side in zip(
        np.zeros((2, 0, 0)) if heights is None else heights, (secondary, primary), strict=True
    )]  # fmt: skip
    factor = np.full((len(pairs), 2), 0.5)
    folded = np.zeros(len(pairs), bool)
    _cut_faces_kernels.integrate(
        0, len(corners), np.searchsorted(pairs[:, 0], np.arange(len(corners) + 1)),
        corners, one.n_corners, origin, axes, to_terms @ secondary, to_terms @ reference, to_terms,
        one.nodes[: one.n_corners].mean(axis=0), opposite, other.n_corners, other_to_terms @ primary,
        other_to_terms, other.nodes[: other.n_corners].mean(axis=0), pairs, *quadrature.triangle(8), *above, factor,
        of_pairs, coupling, closer, folded,
    )  # fmt: skip
    assert not folded.any()
    mass = np.zeros((len(secondary), *of_pairs.shape[1:]))
    np.add.at(mass, pairs[:, 0], of_pairs)
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


def test_facets_that_are_inclined_to_each_other_share_all():
    flat = fc.generate.box((1.0, 1.0, 1.0), (1, 1, 1), origin=(0.0, 0.0, -1.0))
    inclined = fc.generate.box((3.0, 1.0, 1.0), (2, 1, 1), origin=(-1.0, 0.0, 0.0))
    points = inclined.points + np.outer(inclined.points[:, 0], [0.0, 0.0, np.tan(np.radians(80.0))])
    mesh = united(LOW_=flat, UP_=inclined.replace(points=points))
    found = face_overlap(surface(mesh, "LOW_ZMAX"), surface(mesh, "UP_ZMIN"), mesh.points, mesh.points, None)
    assert found.mass[0].sum() == pytest.approx(1.0, abs=1e-12)


def test_a_curved_facet_ends_where_it_turns_away():
    """A waisted cylinder, up to its equator: nothing lies above the flat facet beyond the waist."""
    flat = fc.generate.box((4.0, 1.0, 1.0), (1, 1, 1), origin=(0.0, 0.0, -1.0))
    rounded = fc.generate.box((1.0, 1.0, 1.0), (1, 1, 1), "hex20")
    x, y, height = rounded.points.T
    angle, radius = 0.5 + (0.5 * np.pi - 0.5) * x, 2.0 - 0.5 * height - 1.2 * y * (1.0 - y)
    points = np.column_stack([radius * np.sin(angle), y, 2.0 - radius * np.cos(angle)])
    mesh = united(LOW_=flat, UP_=rounded.replace(points=points))
    found = face_overlap(surface(mesh, "LOW_ZMAX"), surface(mesh, "UP_ZMIN"), mesh.points, mesh.points, None)
    assert found.mass[0].sum() == pytest.approx(2.0 * (1.0 - np.sin(0.5)) - 0.2, rel=0.1)


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
    N = elements.get(name).shape(xi) @ positive_basis(name).T
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
    N = element.shape(xi) @ positive_basis(name).T
    assert N.min() > -1e-15
    assert N.sum(axis=1) == pytest.approx(1.0, abs=1e-14)
    weights = mass_over(name, corners(name)).sum(axis=1)
    assert weights.min() >= 0.5 * weights.max() * (1 - 1e-12)  # none is much lighter than the others


@pytest.mark.parametrize("name", ["line3", "tri6", "quad9"])
def test_they_are_the_polynomials_of_bernstein(name):
    """Of the degree-2 Bernstein polynomials, the one of a corner is the square of its linear function."""
    xi, _ = rule(corners(name))
    element = elements.get(name)
    N = element.shape(xi) @ positive_basis(name).T
    assert N[:, : element.n_corners] == pytest.approx(elements.get(element.linear).shape(xi) ** 2, abs=1e-14)


@pytest.mark.parametrize("name", FACETS)
def test_the_displacement_of_a_gap_is_that_of_one_node_and_of_the_ends_of_its_edge(name):
    """What makes the elimination triangular: corners first, then mid nodes, then centres."""
    back = np.linalg.inv(positive_basis(name)).T
    assert np.array_equal(np.triu(back, 1), np.zeros_like(back))
    assert np.diag(back).min() >= 1.0
    assert back.sum(axis=1) == pytest.approx(1.0, abs=1e-13)


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
    assert np.sqrt(np.einsum("ab,bc,ac->a", dual[0], mass[0], dual[0]) / area).max() <= LARGEST_RMS
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
