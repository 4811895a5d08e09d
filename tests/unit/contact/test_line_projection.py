"""Projection on lines and facets along averaged normals: kernels compared with NumPy, continuity, invariants."""

import numpy as np
import pytest
from scipy.optimize import brentq

import fastcontact as fc
from fastcontact._jit import decorators
from fastcontact.contact import projection, projection_kernels
from fastcontact.contact.pairing import pair
from fastcontact.contact.projection import (
    DeformedSide,
    along_line_normals,
    along_normals,
    closest_of_types,
    facet_points,
    interpolate,
)
from fastcontact.contact.surface import surface
from fastcontact.mesh import elements
from fastcontact.mesh.generate import box, merge_points, union


def wavy(element, n=8):
    """The top of a block bent into a wave: it folds inward and outward."""
    mesh = fc.generate.block((4.0, 1.0), (n, 1), element)
    points = mesh.points.copy()
    points[:, 1] += 0.3 * np.sin(2.5 * points[:, 0]) * points[:, 1]
    mesh = mesh.replace(points=points)
    return mesh, surface(mesh, "TOP")


def projected(candidates, side, points, project=along_normals):
    """Return the normals at the nodes of facets, the closest points, and the projection along the normals."""
    deformed, start = DeformedSide(side, points), closest_of_types(candidates, side.node_positions(points))
    normals = deformed.smooth_normals
    return normals, start, project(candidates, deformed, normals, start)


def feet(side, points, facet, xi):
    at = facet_points(side, facet, xi)
    return np.einsum("nk,nkd->nd", at.shape, points[at.nodes])


def cross(a, b):
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_against_a_plain_root_on_every_facet(element):
    """Height over the surface is small, so that each point has one projection: that of a bracketed root."""
    mesh, side = wavy(element)
    reference = elements.get(side.only_block.element)
    rng = np.random.default_rng(5)
    x = rng.uniform(0.1, 3.9, 60)
    candidates = np.column_stack([x, 1.0 + 0.3 * np.sin(2.5 * x) + rng.uniform(0.0, 0.1, 60)])
    normals, _, (facet, xi, _, _) = projected(candidates, side, mesh.points, along_line_normals)
    for i, point in enumerate(candidates):

        def aside(s, f, point=point):
            N = reference.shape(np.array([[s]]))[0]
            return float(cross(point - N @ mesh.points[side.only_block.facets[f]], N @ normals[f]))

        roots = [
            (f, brentq(aside, -1.0, 1.0, args=(f,), xtol=1e-14))
            for f in range(side.n_facets)
            if aside(-1.0, f) * aside(1.0, f) <= 0.0
        ]
        assert any(f == facet[i] and abs(s - xi[i, 0]) < 1e-11 for f, s in roots)


@pytest.mark.parametrize("element", ["quad4", "quad8"])
def test_the_projection_moves_on_smoothly_over_folds(element):
    """The closest point jumps over a valley, and stays at the node over a ridge."""
    mesh, side = wavy(element)
    x = np.linspace(0.1, 3.9, 4001)
    track = np.column_stack([x, 1.0 + 0.3 * np.sin(2.5 * x) + 0.15])
    for normals, most in (("averaged", 4.0), ("facet", np.inf)):
        found = pair(track, DeformedSide(side, mesh.points), 1e-6, normals)
        foot = feet(side, mesh.points, found.facet, found.xi)
        turned = np.linalg.norm(np.diff(found.normal, axis=0), axis=1)
        if normals == "averaged":
            assert found.paired.all()
            assert np.linalg.norm(np.diff(foot, axis=0), axis=1).max() < most * (x[1] - x[0])
            assert turned.max() < 0.02
        elif element == "quad4":
            assert turned.max() > 0.1
            assert found.paired.all()  # beyond both facets at a fold is not beyond the end of the line


def test_beyond_the_end_a_point_stands_out():
    mesh = fc.generate.block((4.0, 1.0), (8, 1), "quad4")
    side = surface(mesh, "TOP")
    for by, tolerance, paired in ((0.001, 0.5, True), (0.2, 0.5, True), (0.35, 0.5, False), (0.001, 1e-6, False)):
        found = pair(np.array([[4.0 + by, 1.2], [-by, 0.9]]), DeformedSide(side, mesh.points), tolerance, "averaged")
        assert found.paired.tolist() == [paired, paired]


def test_a_closed_line_has_no_end():
    points = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 12, endpoint=False)])
    inner = 0.5 * points
    cells = np.array([[i, (i + 1) % 12, 12 + (i + 1) % 12, 12 + i] for i in range(12)])
    facets = np.array([[i, (i + 1) % 12] for i in range(12)])
    mesh = fc.Mesh(
        np.vstack([points, inner]), {"quad4": cells, "line2": facets}, cell_groups={"OUT": np.arange(12, 24)}
    )
    side = surface(mesh, "OUT")
    angle = np.linspace(0.0, 2 * np.pi, 100)
    found = pair(
        1.1 * np.column_stack([np.cos(angle), np.sin(angle)]), DeformedSide(side, mesh.points), 1e-6, "averaged"
    )
    assert found.paired.all()
    # On a circle nodal means are radial, so the projection runs towards the centre.
    assert np.abs(found.normal - np.column_stack([np.cos(angle), np.sin(angle)])).max() < 1e-12


KINDS = ("hex8", "hex20", "hex27", "tet4", "tet10")


def rough(element, n=3, by=0.03):
    """A box with a rough top, and its top."""
    mesh = box((1.0, 1.0, 1.0), (n, n, 1), element)
    points = mesh.points.copy()
    points[:, 2] += by * np.sin(17.0 * np.arange(len(points))) * (points[:, 2] > 0.99)
    mesh = mesh.replace(points=points)
    return mesh.points, surface(mesh, "ZMAX")


def mixed():
    """A top of quadrangles and triangles, a little rough."""
    halves = union(box((0.5, 1, 1), (2, 4, 1), "hex8"), box((0.5, 1, 1), (2, 4, 1), "wedge6", (0.5, 0, 0)))
    mesh = merge_points(halves, tolerance=1e-9)
    return mesh.points + 0.02 * np.sin(np.arange(mesh.points.size)).reshape(-1, 3), surface(mesh, "ZMAX")


def above(n, seed=0, beside=0.1):
    return np.random.default_rng(seed).uniform([-beside, -beside, 0.9], [1 + beside, 1 + beside, 1.2], (n, 3))


@pytest.mark.parametrize("element", KINDS)
def test_normals_are_those_of_the_tangents(element):
    points, side = rough(element)
    (block,) = side.blocks
    facet = elements.get(block.element)
    tangent = np.einsum("akj,fkd->fadj", facet.gradient(facet.nodes), points[block.facets])
    normal = np.cross(tangent[..., 0], tangent[..., 1])
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    assert DeformedSide(side, points).facet_normals == pytest.approx(normal, abs=1e-13)


@pytest.mark.parametrize("element", KINDS)
def test_means_are_weighted_by_the_angles_at_corners(element):
    points, side = rough(element)
    (block,) = side.blocks
    facet = elements.get(block.element)
    total, own = np.zeros((len(side.points), 3)), DeformedSide(side, points).facet_normals
    for row, nodes in enumerate(block.facets):
        for a in range(facet.n_nodes):
            weight = 1.0
            if a < facet.n_corners:
                ends = [b if a == c else c for b, c in facet.edges if a in (b, c)]
                p, q = points[nodes[ends]] - points[nodes[a]]
                weight = np.arccos(p @ q / np.linalg.norm(p) / np.linalg.norm(q))
            total[block.local[row, a]] += weight * own[row, a]
    total /= np.linalg.norm(total, axis=1, keepdims=True)
    assert DeformedSide(side, points).nodal_normals == pytest.approx(total, abs=1e-13)


@pytest.mark.parametrize("element", KINDS)
@pytest.mark.parametrize("shift", [0.0, 1e4])
def test_points_lie_along_the_normal_of_their_projection_of_projection_kernels(element, shift):
    points, side = rough(element, by=0.02)
    points, candidates = points + shift, above(200, beside=-0.1) + shift
    normals, _, (facet, xi, overhang, normal) = projected(candidates, side, points)
    assert (overhang == 0.0).all()
    assert normal == pytest.approx(interpolate(normals[facet], facet_points(side, facet, xi)), abs=1e-13)
    assert np.abs(np.cross(candidates - feet(side, points, facet, xi), normal)).max() < 1e-12 * max(1.0, shift)


def test_beyond_the_end_the_projection_stays_in_the_facet_and_tells_by_how_much():
    points, side = rough("hex8", 4, 0.0)
    candidates = np.array([[1.1, 0.3, 1.1], [0.3, -0.05, 1.2], [0.3, 0.3, 1.0]])
    _, _, (facet, xi, overhang, normal) = projected(candidates, side, points)
    assert overhang == pytest.approx([0.4, 0.2, 0.0], abs=1e-12)  # facets are a quarter long
    assert (np.abs(xi) <= 1.0).all()
    assert normal == pytest.approx(np.tile([0.0, 0, 1], (3, 1)), abs=1e-15)
    assert feet(side, points, facet, xi) == pytest.approx(
        np.array([[1.0, 0.3, 1.0], [0.3, 0.0, 1.0], [0.3, 0.3, 1.0]]), abs=1e-12
    )


def test_a_facet_that_is_left_hands_on_to_the_one_beside_it_of_any_kind():
    """From a wrong start the same feet are found as from the closest points, over triangles and quadrangles."""
    points, side = mixed()
    candidates = above(150, beside=-0.05)
    normals, start, (facet, xi, overhang, _) = projected(candidates, side, points)
    begin, beside = side.neighbours
    wrong = np.array([beside[begin[f]] for f in facet])
    corner = np.where(side.triangular[wrong, None], 0.3, 0.0) * np.ones((1, 2))
    again = along_normals(candidates, DeformedSide(side, points), normals, start._replace(facet=wrong, xi=corner))
    foot, same = feet(side, points, facet, xi), feet(side, points, *again[:2])
    # Where the facet of the start lies too far away for its plane to mean anything, the start is kept.
    aside = np.abs(np.cross(candidates - same, again[3])).max(axis=1)
    inner = (overhang == 0.0) & (again[2] == 0.0) & (aside < 1e-11)
    assert inner.mean() > 0.8
    assert len(np.unique(side.triangular[facet[inner]])) == 2
    assert foot[inner] == pytest.approx(same[inner], abs=1e-11)


def test_where_no_step_is_possible_the_closest_point_stays():
    points, side = rough("hex8", 2, 0.0)
    normals = np.tile([1.0, 0.0, 0.0], (side.n_facets, 4, 1))  # along the facets
    candidates = above(20, beside=-0.1)
    start = closest_of_types(candidates, side.node_positions(points))
    facet, xi, _, _ = along_normals(candidates, DeformedSide(side, points), normals, start)
    assert (facet == start.facet).all()
    assert (xi == start.xi).all()


def test_neighbours_share_a_node():
    _, side = mixed()
    begin, beside = side.neighbours
    nodes = [set(facet) for block in side.blocks for facet in block.local.tolist()]
    for f in range(side.n_facets):
        assert beside[begin[f] : begin[f + 1]].tolist() == [
            g for g in range(side.n_facets) if g != f and nodes[f] & nodes[g]
        ]


def test_corners_are_taken_one_by_one():
    """At every corner of a box the facets of each face have the normal of the face, whatever the number of corners."""
    mesh = fc.generate.box((1.0, 1.0, 1.0), (2, 2, 2), "hex8")
    side = surface(mesh.replace(cell_groups={**mesh.cell_groups, "ALL": np.concatenate(
        [mesh.cell_groups[name] for name in ("XMIN", "XMAX", "YMIN", "YMAX", "ZMIN", "ZMAX")]
    )}), "ALL")  # fmt: skip
    normals = DeformedSide(side, mesh.points).smooth_normals
    assert normals == pytest.approx(DeformedSide(side, mesh.points).facet_normals, abs=1e-15)


@pytest.mark.skipif(not decorators.jit_enabled(), reason="one thread interprets")
def test_threads_change_no_bit(monkeypatch):
    points, side = mixed()
    candidates = above(200)
    normals, start, alone = projected(candidates, side, points)
    monkeypatch.setattr(projection, "portions", lambda count, nodes=1: [(0, 3), (3, count // 2), (count // 2, count)])
    for one, other in zip(alone, along_normals(candidates, DeformedSide(side, points), normals, start), strict=True):
        assert (one == other).all()
    facet_normals, repeated = (DeformedSide(side, points).facet_normals for _ in range(2))
    assert np.array_equal(facet_normals, repeated)


def test_reference_coordinates_in_and_beyond_a_facet():
    for triangle, s, t, out, kept in (
        (True, 0.2, 0.3, 0.0, (0.2, 0.3)), (True, 0.9, 0.6, 0.5, (0.6, 0.4)), (True, -0.25, 0.5, 0.25, (0.0, 0.4)),
        (False, 0.2, -0.3, 0.0, (0.2, -0.3)), (False, 1.5, 0.0, 0.25, (1.0, 0.0)), (False, -2.0, 3.0, 1.0, (-1.0, 1.0)),
    ):  # fmt: skip
        assert projection_kernels.overhang_of(triangle, s, t) == pytest.approx(out)
        assert projection_kernels.clamped(triangle, s, t) == pytest.approx(kept)
