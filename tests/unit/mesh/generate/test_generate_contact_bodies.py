"""Bodies of special contacts: two crowned blocks, a block under a flat punch, two rings."""

import math

import numpy as np
import pytest
from models import elastic_model

from fastcontact.errors import MeshError
from fastcontact.mesh.generate import crowned_blocks, punched_block, rings

QUADRANGLES = ("quad4", "quad8", "quad9")


def area(mesh, group):
    """Area of a group of solid cells, from the stiffness's own quadrature: the weight of a unit body force."""
    model = elastic_model(mesh, "plane_strain", E=1.0, nu=0.0)
    model.add_body_force(group, x=1.0)
    return next(iter(model.forces_by_ramp().values()))[:, 0].sum()


def points(mesh, group):
    return mesh.points[mesh.points_of(group)]


@pytest.mark.parametrize("element", QUADRANGLES)
def test_crowned_blocks_mirror_each_other_and_touch_at_one_point(element):
    mesh = crowned_blocks(element, R=200.0, extent=10.0, contact_radius=1.0, contact_size=0.25)
    half = mesh.n_points // 2
    assert np.array_equal(mesh.points[:half] * [1.0, -1.0], mesh.points[half:])
    lower, upper = points(mesh, "CONT_LOWER"), points(mesh, "CONT_UPPER")
    gap = upper[:, 1] - lower[:, 1]
    assert gap == pytest.approx(lower[:, 0] ** 2 / 200.0, abs=1e-14)
    assert (gap == 0).sum() == 1
    assert mesh.points[mesh.point("POLE_LOWER")] == pytest.approx([0.0, 0.0], abs=0.0)
    assert mesh.points[mesh.point("POLE_UPPER")] == pytest.approx([0.0, 0.0], abs=0.0)
    assert points(mesh, "FAR_LOWER")[:, 1] == pytest.approx(-10.0, rel=1e-14)
    assert np.abs(lower[:, 0]).max() <= 1.2


def test_crowned_blocks_are_finest_at_the_contact():
    mesh = crowned_blocks(extent=30.0, contact_radius=1.0, contact_size=0.1)
    x = np.sort(points(mesh, "CONT_LOWER")[:, 0])
    assert np.diff(x[np.abs(x) <= 1.0 + 1e-9]) == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize("element", QUADRANGLES)
def test_a_grid_line_stands_at_the_edge_of_the_punch(element):
    mesh = punched_block(element, punch_radius=2.0, extent=50.0, edge_size=0.05)
    beneath = points(mesh, "PUNCHED")
    assert beneath[:, 0].min() == 0.0
    assert beneath[:, 0].max() == 2.0
    assert (beneath[:, 1] == 0.0).all()
    assert mesh.points[mesh.point("EDGE")].tolist() == [2.0, 0.0]
    assert mesh.points[mesh.point("POLE")].tolist() == [0.0, 0.0]
    corners = np.unique(points(mesh, "TOP")[:, 0])
    next_to_edge = np.abs(corners - 2.0)[np.abs(corners - 2.0) > 0].min() * (1 if element == "quad4" else 2)
    assert 0.5 * 0.05 < next_to_edge <= 0.05 * (1 + 1e-12)
    assert area(mesh, "BLOCK") == pytest.approx(2500.0, rel=1e-12)
    assert points(mesh, "SYMMETRY_X")[:, 0].max() == 0.0
    assert points(mesh, "SIDE")[:, 0].min() == 50.0


@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6", "quad8", "quad9"])
def test_rings_have_their_areas_and_their_sides_stand_on_circles(element):
    mesh = rings(element, divisions_inner=(3, 10), divisions_outer=(4, 13))
    sides = {"BORE": 20.0, "CONT_INNER": 50.0, "CONT_OUTER": 50.0, "RIM": 100.0}
    for group, radius in sides.items():
        assert np.linalg.norm(points(mesh, group), axis=1) == pytest.approx(radius, rel=1e-14)
    assert (points(mesh, "SYMMETRY_X")[:, 0] == 0.0).all()
    assert (points(mesh, "SYMMETRY_Y")[:, 1] == 0.0).all()
    accuracy = 1e-2 if element in ("tri3", "quad4") else 1e-4
    for group, inner, outer in (("INNER", 20.0, 50.0), ("OUTER", 50.0, 100.0)):
        assert area(mesh, group) == pytest.approx(math.pi / 4 * (outer**2 - inner**2), rel=accuracy)
    assert not set(mesh.points_of("CONT_INNER")) & set(mesh.points_of("CONT_OUTER"))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: crowned_blocks("tri3"), "element 'tri3'"),
        (lambda: crowned_blocks(R=10.0, extent=40.0), "at most R = 10"),
        (lambda: crowned_blocks(growth=1.0), "growth = 1 is out of range"),
        (lambda: crowned_blocks(contact_size=2.0), "contact_size = 2"),
        (lambda: punched_block("tri3"), "element 'tri3'"),
        (lambda: punched_block(extent=1.5), "at least 2 punch_radius = 2"),
        (lambda: punched_block(growth=0.5), "growth = 0.5 is out of range"),
        (lambda: punched_block(edge_size=3.0), "edge_size = 3"),
        (lambda: rings(inner_radius=60.0), "must increase, not 60, 50, 100"),
        (lambda: rings(divisions_inner=(0, 3)), r"divisions_inner\[0\] = 0"),
        (lambda: rings("hex8"), "element 'hex8'"),
    ],
)
def test_wrong_arguments_are_named(make, words):
    with pytest.raises(MeshError, match=words):
        make()
