"""Bodies of special contacts: a sphere on a block, crowned blocks, a block under a flat punch, two rings."""

import math

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.generate import crowned_blocks, punched_block, rings, sphere_octant, sphere_on_block
from fastcontact.mesh.generate._sphere import SOLIDS

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
    x = np.sort(points(crowned_blocks(extent=30.0, contact_radius=1.0, contact_size=0.1), "CONT_LOWER")[:, 0])
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
    for group, radius in {"BORE": 20.0, "CONT_INNER": 50.0, "CONT_OUTER": 50.0, "RIM": 100.0}.items():
        assert np.linalg.norm(points(mesh, group), axis=1) == pytest.approx(radius, rel=1e-14)
    assert (points(mesh, "SYMMETRY_X")[:, 0] == 0.0).all()
    assert (points(mesh, "SYMMETRY_Y")[:, 1] == 0.0).all()
    accuracy = 1e-2 if element in ("tri3", "quad4") else 1e-4
    for group, inner, outer in (("INNER", 20.0, 50.0), ("OUTER", 50.0, 100.0)):
        assert area(mesh, group) == pytest.approx(math.pi / 4 * (outer**2 - inner**2), rel=accuracy)
    assert not set(mesh.points_of("CONT_INNER")) & set(mesh.points_of("CONT_OUTER"))


SIZES = {"R": 2.0, "size": 1.0, "contact_size": 0.2, "contact_radius": 0.5}


def distance(points, R=2.0):
    return np.linalg.norm(points - [0.0, R, 0.0], axis=1)


@pytest.mark.parametrize("element", SOLIDS)
def test_all_nodes_of_the_surface_lie_on_the_sphere(element):
    mesh = sphere_octant(element, **SIZES)
    outside = np.union1d(mesh.points_of("CONT_SPHERE"), mesh.points_of("SPHERE_SIDE"))
    assert np.abs(distance(mesh.points[outside]) - 2.0).max() < 1e-14
    inside = np.setdiff1d(np.arange(mesh.n_points), outside)
    assert distance(mesh.points[inside]).max() < 2.0 - 1e-3


@pytest.mark.parametrize("element", SOLIDS)
def test_volumes(element):
    sphere, both = sphere_octant(element, **SIZES), sphere_on_block(element, block_size=(1.5, 0.75), **SIZES)
    exact = 4.0 / 3.0 * np.pi * 8.0 / 8.0
    volume = fc.quality(sphere).measure
    assert volume == pytest.approx(exact, rel=4e-2 if elements.get(element).order == 1 else 3e-4)
    assert fc.quality(both).measure - volume == pytest.approx(1.5 * 1.5 * 0.75, rel=1e-12)


@pytest.mark.parametrize("element", SOLIDS)
def test_groups_are_the_outside(element):
    mesh = sphere_on_block(element, **SIZES)
    assert fc.topology.bodies(mesh)[0] == 2
    for group, column, at in (
        ("SYMMETRY_X", 0, 0.0),
        ("SYMMETRY_Z", 2, 0.0),
        ("SPHERE_TOP", 1, 2.0),
        ("CONT_BLOCK", 1, 0.0),
        ("BLOCK_BOTTOM", 1, -2.0),
    ):
        assert np.abs(mesh.points[mesh.points_of(group), column] - at).max() < 1e-14
        assert (np.abs(mesh.points[:, column] - at) < 1e-12).sum() >= len(mesh.points_of(group))
    outer = sum(map(len, fc.topology.outer_facets(mesh).values()))
    named = np.unique(np.concatenate([mesh.cell_groups[g] for g in mesh.cell_groups if g not in ("SPHERE", "BLOCK")]))
    assert len(named) == outer == sum(map(len, mesh.facets.values()))
    for pole in ("POLE_SPHERE", "POLE_BLOCK"):
        assert mesh.points[mesh.point(pole)].tolist() == [0.0, 0.0, 0.0]
    assert mesh.point("POLE_SPHERE") in mesh.points_of("CONT_SPHERE")
    assert mesh.point("POLE_BLOCK") in mesh.points_of("CONT_BLOCK")
    assert mesh.points[mesh.point("CENTRE")] == pytest.approx([0.0, 2.0, 0.0], abs=1e-15)


def test_edges_are_finest_at_the_pole_and_do_not_match():
    mesh = sphere_on_block("hex8", **SIZES)
    for group in ("CONT_SPHERE", "CONT_BLOCK"):
        corners = mesh.points[mesh.cells_of(group)["quad4"]]
        length = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max(axis=1)
        away = np.linalg.norm(corners.mean(axis=1)[:, [0, 2]], axis=1)
        assert length[away < 0.4].max() < 0.2 * np.sqrt(2)
        assert length.max() < 1.05
        assert length[away > 1.0].min() > 0.2
    sphere = mesh.points[mesh.points_of("CONT_SPHERE")][:, [0, 2]]
    block = mesh.points[mesh.points_of("CONT_BLOCK")][:, [0, 2]]
    apart = np.linalg.norm(sphere[:, None] - block[None], axis=2).min(axis=1)
    assert (apart < 1e-6).sum() == 1  # the pole


def test_equal_arguments_give_equal_meshes():
    one, other = sphere_on_block("tet10", **SIZES), sphere_on_block("tet10", **SIZES)
    assert np.array_equal(one.points, other.points)
    assert all(np.array_equal(one.cells[name], other.cells[name]) for name in one.cells)
