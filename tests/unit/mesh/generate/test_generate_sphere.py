"""The quarter of a sphere on a block."""

import numpy as np
import pytest

import fastcontact as fc
from fastcontact import topology
from fastcontact.mesh import elements
from fastcontact.mesh.generate import sphere_octant, sphere_on_block
from fastcontact.mesh.generate.sphere import SOLIDS

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
    assert topology.bodies(mesh)[0] == 2
    for group, column, at in (
        ("SYMMETRY_X", 0, 0.0),
        ("SYMMETRY_Z", 2, 0.0),
        ("SPHERE_TOP", 1, 2.0),
        ("CONT_BLOCK", 1, 0.0),
        ("BLOCK_BOTTOM", 1, -2.0),
    ):
        assert np.abs(mesh.points[mesh.points_of(group), column] - at).max() < 1e-14
        assert (np.abs(mesh.points[:, column] - at) < 1e-12).sum() >= len(mesh.points_of(group))
    outer = sum(map(len, topology.outer_facets(mesh).values()))
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
        facets = mesh.cells_of(group)["quad4"]
        corners = mesh.points[facets]
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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"element": "quad4"}, "unknown element 'quad4'"),
        ({"element": "pyramid5"}, "unknown element 'pyramid5'"),
        ({"R": -1.0}, "R = -1 is out of range"),
        ({"size": 60.0}, "size = 60 is out of range"),
        ({"contact_size": 20.0}, r"contact_size = 20 .* size = 12.5"),
        ({"contact_radius": 30.0}, "contact_radius = 30 is out of range"),
        ({"block_size": (1.0, 2.0, 3.0)}, "block_size of sphere_on_block must be two numbers"),
        ({"block_size": (1.0, 0.0)}, r"block_size\[1\] = 0 is out of range"),
    ],
)
def test_wrong_arguments_are_named(arguments, message):
    with pytest.raises(fc.MeshError, match=message):
        sphere_on_block(**arguments)
