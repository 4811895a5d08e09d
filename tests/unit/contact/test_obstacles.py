"""Rigid shapes: distances, normals, their consistency, and invalid arguments."""

import numpy as np
import pytest

from fastcontact import obstacles
from fastcontact.errors import ContactError

SHAPES_2D = {
    "half_space": obstacles.HalfSpace((0.3, -0.2), (1.0, 2.0)),
    "sphere": obstacles.Sphere((0.1, 2.0), 1.5),
    "hollow": obstacles.Sphere((0.1, 0.2), 5.0, hollow=True),
    "paraboloid": obstacles.paraboloid(3.0),
    "paraboloid_below": obstacles.paraboloid(3.0, tip=-0.5, side="below"),
    "cone": obstacles.cone(0.3),
}
SHAPES_3D = {
    "half_space": obstacles.HalfSpace((0.3, -0.2, 0.1), (1.0, 2.0, -1.0)),
    "sphere": obstacles.Sphere((0.1, 2.0, 0.4), 1.5),
    "cylinder": obstacles.Cylinder((0.0, 0.0, 2.0), (1.0, 0.5, 0.0), 1.2),
    "paraboloid": obstacles.paraboloid(3.0),
    "cone": obstacles.cone(0.3),
}
CASES = [(2, name, shape) for name, shape in SHAPES_2D.items()] + [(3, n, s) for n, s in SHAPES_3D.items()]


def points(dim):
    return np.random.default_rng(dim).uniform(-1, 1, (40, dim))


@pytest.mark.parametrize(("dim", "name", "shape"), CASES, ids=lambda v: v if isinstance(v, str) else None)
def test_normals_are_unit_and_point_to_growing_distance(dim, name, shape):
    x = points(dim)
    distance, normal = shape.distance(x)
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-14
    further, _ = shape.distance(x + 1e-6 * normal)
    assert (further > distance).all()


@pytest.mark.parametrize(("dim", "name", "shape"), CASES, ids=lambda v: v if isinstance(v, str) else None)
def test_stepping_back_by_the_distance_reaches_the_surface(dim, name, shape):
    x = points(dim)
    for _ in range(60):
        distance, normal = shape.distance(x)
        x = x - distance[:, None] * normal
    assert np.abs(shape.distance(x)[0]).max() < 1e-10


@pytest.mark.parametrize(("dim", "name", "shape"), CASES, ids=lambda v: v if isinstance(v, str) else None)
def test_on_the_surface_the_normal_is_the_gradient_of_the_distance(dim, name, shape):
    x = points(dim)
    for _ in range(60):
        distance, normal = shape.distance(x)
        x = x - distance[:, None] * normal
    x = x[np.linalg.norm(x[:, :-1], axis=1) > 1e-3]  # not at the tip of a cone
    _, normal = shape.distance(x)
    for k in range(dim):
        h = np.zeros(dim)
        h[k] = 1e-6
        slope = (shape.distance(x + h)[0] - shape.distance(x - h)[0]) / 2e-6
        assert np.abs(slope - normal[:, k]).max() < 1e-5


def test_a_flat_punch_ends_at_its_edge():
    distance, normal = obstacles.FlatPunch(1.0, height=0.5).distance(np.array([[0.9, 0.2], [1.1, 0.2], [0.0, 0.7]]))
    assert distance.tolist() == pytest.approx([0.3, np.inf, -0.2])
    assert normal[:, 1].tolist() == [-1.0, -1.0, -1.0]


@pytest.mark.parametrize(
    "make",
    [
        lambda: obstacles.Sphere((0.0, 0.0), -1.0),
        lambda: obstacles.paraboloid(0.0),
        lambda: obstacles.cone(float("nan")),
        lambda: obstacles.FlatPunch(1.0, side="left"),
        lambda: obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0)).distance(np.zeros((1, 2))),
        lambda: obstacles.HalfSpace((0.0, 0.0), (0.0, 0.0)).distance(np.zeros((1, 2))),
        lambda: obstacles.Cylinder((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1.0).distance(np.zeros((1, 2))),
    ],
)
def test_wrong_arguments_are_refused(make):
    with pytest.raises(ContactError):
        make()


def test_at_the_tip_of_a_cone_the_normal_is_the_axis_up_to_round_off():
    points = np.array([[1e-19, 0.0], [-1e-19, 0.0], [1.0, 0.0]])
    normals = obstacles.cone(0.3).distance(points)[1]
    np.testing.assert_allclose(np.abs(normals[:2]), [[0.0, 1.0]] * 2, atol=1e-15)
    assert abs(normals[2, 0]) > 0.2
