"""How deep bodies lie inside each other, in three dimensions."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.generate import box, sphere_octant, union
from fastcontact.kernels.winding import winding_numbers
from fastcontact.overlap import _depths_in_space, penetration
from fastcontact.topology import outer_facets

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
    assert np.abs(_depths_in_space(points @ turn.T, shell(mesh)) - expected).max() < 1e-13


@pytest.mark.parametrize("element", ["hex8", "hex20", "tet4", "tet10"])
def test_depths_in_an_octant_of_a_ball(element):
    mesh = sphere_octant(element, R=2.0, size=1.0, contact_size=0.3, contact_radius=0.3)
    points = np.random.default_rng(3).uniform([-0.3, -0.3, -0.3], [2.3, 2.3, 2.3], (400, 3))
    x, y, z = points.T
    radius = np.linalg.norm(points - [0, 2, 0], axis=1)
    expected = np.maximum(np.minimum.reduce([2 - radius, x, z, 2 - y]), 0.0)
    # Facets with straight sides cut off the ball by up to a tenth.
    tolerance = 0.12 if element in ("hex8", "tet4") else 2e-3
    assert np.abs(_depths_in_space(points, shell(mesh)) - expected).max() < tolerance


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
    depth = _depths_in_space(points, shell(mesh))
    triangles = mesh.points[outer_facets(mesh)["quad4"]][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    number = np.empty(len(points))
    winding_numbers(points, triangles, number)
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
    model = fc.Model(mesh, "3d")
    model.add_material(fc.LinearElastic(E=1.0, nu=0.3))
    model.fix("LOWER", "xyz")
    model.fix("UPPER", "xyz")
    with pytest.raises(fc.ModelError, match=r"body 'UPPER' overlaps body 'LOWER' by 0\.1 near"):
        model.check()
