"""Depth of the initial penetration of bodies."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import elastic_model
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.mesh.generate import block, box, sphere_octant, union
from fastcontact.mesh.topology import outer_facets
from fastcontact.model.body_overlap import _depths, penetration, winding_numbers

SOLIDS = ("hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15", "pyramid5", "pyramid13")


def shell(mesh):
    return [mesh.points[facets] for facets in outer_facets(mesh).values()]


@pytest.mark.parametrize("element", SOLIDS)
def test_depths_in_a_box_are_exact(element):
    points = np.random.default_rng(1).uniform(-0.5, 1.5, (300, 3))
    expected = np.maximum(np.minimum(points, 1 - points).min(axis=1), 0.0)
    turn = Rotation.random(random_state=2).as_matrix()
    mesh = box((1.0, 1.0, 1.0), (2, 3, 2), element)
    mesh = mesh.replace(points=mesh.points @ turn.T)
    assert np.abs(_depths(points @ turn.T, shell(mesh))[0] - expected).max() < 1e-13


@pytest.mark.parametrize("element", ["hex8", "hex20", "tet4", "tet10"])
def test_depths_in_an_octant_of_a_ball(element):
    mesh = sphere_octant(element, R=2.0, size=1.0, contact_size=0.3, contact_radius=0.3)
    points = np.random.default_rng(3).uniform([-0.3, -0.3, -0.3], [2.3, 2.3, 2.3], (400, 3))
    x, y, z = points.T
    radius = np.linalg.norm(points - [0, 2, 0], axis=1)
    expected = np.maximum(np.minimum.reduce([2 - radius, x, z, 2 - y]), 0.0)
    # Facets with straight sides cut off the ball by up to a tenth.
    tolerance = 0.12 if element in ("hex8", "tet4") else 2e-3
    assert np.abs(_depths(points, shell(mesh))[0] - expected).max() < tolerance


def slab_with_a_sharp_edge(angle):
    """A wedge of the given interior angle [degrees] about the z axis, open towards x."""
    mesh = box((1.0, 1.0, 1.0), (3, 2, 2), "hex8")
    r, t, z = 0.2 + mesh.points[:, 0], (mesh.points[:, 1] - 0.5) * np.radians(angle), mesh.points[:, 2]
    return mesh.replace(points=np.column_stack([r * np.cos(t), r * np.sin(t), z]))


@settings(max_examples=25, deadline=None)
@given(angle=st.sampled_from([8.0, 40.0, 200.0, 320.0]), seed=st.integers(0, 1000))
def test_near_sharp_edges_the_winding_number_decides(angle, seed):
    mesh = slab_with_a_sharp_edge(angle)
    points = np.random.default_rng(seed).uniform([-1.2, -1.2, -0.1], [1.2, 1.2, 1.1], (200, 3))
    depth, _ = _depths(points, shell(mesh))
    triangles = mesh.points[outer_facets(mesh)["quad4"]][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    number = winding_numbers(points, triangles)
    assert np.abs(number - np.round(number)).max() < 1e-9
    # Bilinear facets bulge a little beyond their triangles.
    clear = np.abs(depth) > 2e-2
    assert (number[clear] > 0.5).all()
    assert (depth > 0).sum() >= 0.9 * (number > 0.5).sum()


def test_bodies_and_depths_are_told():
    lower, upper = (
        box((2.0, 2.0, 1.0), (2, 2, 1), name="LOWER"),
        box((0.6, 0.6, 1.0), (2, 2, 2), "tet10", (0.2, 0.1, 0.9)),
    )
    found = penetration(union(lower, upper), "3d", union(lower, upper).points)
    assert [(body, other) for body, other, _, _ in found] == [(1, 0)]
    assert found[0][2] == pytest.approx(0.1, rel=1e-12)
    assert found[0][3][2] == pytest.approx(0.9)


def test_bodies_that_touch_or_stand_apart_do_not_overlap():
    lower = box((2.0, 2.0, 1.0), (2, 2, 1), name="LOWER")
    for height in (1.0, 1.3):
        mesh = union(lower, box((1.0, 1.0, 1.0), (2, 2, 2), "hex20", (0.5, 0.5, height), name="UPPER"))
        assert penetration(mesh, "3d", mesh.points) == []


def test_an_overlap_without_contact_is_refused():
    mesh = union(
        box((2.0, 2.0, 1.0), (2, 2, 1), name="LOWER"),
        box((0.6, 0.6, 1.0), (2, 2, 2), "hex8", (0.2, 0.1, 0.9), name="UPPER"),
    )
    model = elastic_model(mesh, "3d", E=1.0, LOWER="xyz", UPPER="xyz")
    with pytest.raises(fc.ModelError, match=r"body 'UPPER' overlaps body 'LOWER' by 0\.1 near"):
        model.check()


def ring(inner, outer, n, element):
    """A quarter of a ring, n cells along its arcs."""
    mesh = block((1.0, 1.0), (2, n), element)
    r, angle = inner + (outer - inner) * mesh.points[:, 0], 0.5 * np.pi * mesh.points[:, 1]
    return mesh.replace(points=np.column_stack([r * np.cos(angle), r * np.sin(angle)]))


@pytest.mark.parametrize("element", ["tri6", "quad8", "quad9"])
@pytest.mark.parametrize("n", [4, 5, 7, 11])
def test_curved_bodies_that_touch_do_not_overlap(element, n):
    """Their corner polygons do, by the rise of an arc over its chord: 0.012 here."""
    mesh = union(ring(0.5, 1.0, 4, element), ring(1.0, 1.5, n, element))
    assert penetration(mesh, "plane_strain", mesh.points) == []


@pytest.mark.parametrize("element", ["tri6", "quad8"])
def test_the_depth_of_curved_bodies_counts_their_arcs(element):
    mesh = union(ring(0.5, 1.003, 4, element), ring(1.0, 1.5, 5, element))
    found = penetration(mesh, "plane_strain", mesh.points)
    assert sorted((a, b) for a, b, _, _ in found) == [(0, 1), (1, 0)]
    for _, _, depth, _ in found:
        assert depth == pytest.approx(0.003, rel=0.02)  # the polygons would say more than 0.015


@pytest.mark.filterwarnings("ignore:3 nodes lie where another one is")
def test_curved_bodies_that_touch_need_no_warning():
    """Two quarter rings held apart by nothing but their place: solved without contact, and without a false alarm."""
    mesh = union(ring(0.5, 1.0, 4, "quad8"), ring(1.0, 1.5, 5, "quad8"))
    x = mesh.points
    model = fc.Model(
        mesh.with_groups(points={"ALL": np.flatnonzero((x[:, 1] < 1e-9) | (x[:, 0] < 1e-9))}), "plane_strain"
    )
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    model.prescribe("ALL", x=lambda at: 1e-6 * at[:, 0], y=lambda at: 1e-6 * at[:, 1])
    fc.solve(model, fc.linear_ramp(1))  # warnings are errors here


def star(random, n):
    """A closed polygon round the origin, counter-clockwise: its sides (n, 2, 2)."""
    angle, radius = np.sort(random.uniform(0, 2 * np.pi, n)), random.uniform(0.3, 1.0, n)
    corners = np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])
    return np.stack([corners, np.roll(corners, -1, axis=0)], axis=1)


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 10_000))
def test_lines_wind_around_what_a_ray_leaves_once(seed):
    random = np.random.default_rng(seed)
    lines, points = star(random, 12), random.uniform(-1.2, 1.2, (60, 2))
    number = winding_numbers(points, lines)
    (x, y), ((ax, ay), (bx, by)) = points.T[..., None], lines.transpose(1, 2, 0)
    crossed = ((ay > y) != (by > y)) & (ax + (y - ay) * (bx - ax) / (by - ay) > x)
    assert np.abs(number - np.abs(np.round(number))).max() < 1e-12
    assert (np.round(number) % 2 == crossed.sum(axis=1) % 2).all()


def test_depths_in_a_lens_of_two_parabolas():
    """Points at the very height of its ends, its middle and its top, and between a parabola and its chords."""
    lens = np.array([[[1.0, 0.0], [-1.0, 0.0], [0.0, 0.5]], [[-1.0, 0.0], [1.0, 0.0], [0.0, -0.5]]])
    points = [
        [-2.0, 0.0],
        [0.0, 0.0],
        [0.5, 0.0],
        [2.0, 0.0],
        [-2.0, 0.5],
        [0.0, 0.4],
        [0.0, -0.4],
        [-3, -0.5],
        [0.5, 0.37],
    ]
    depth, facet = _depths(np.array(points), [lens])
    assert (depth > 0).tolist() == [False, True, True, False, False, True, True, False, True]
    assert depth[[1, 5, 6]] == pytest.approx([0.5, 0.1, 0.1], abs=1e-12)
    assert facet[[5, 6, 8]].tolist() == [0, 1, 0]
