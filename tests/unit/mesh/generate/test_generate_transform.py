"""Mirrored, merged, united and transformed meshes: invariants and changes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.generate import block, merge_points, mirrored, renamed, to_quadratic, transformed, union

ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "quad9")
SOLIDS_3D = [name for name, element in elements.ELEMENTS.items() if element.dim == 3]
small = st.floats(-100.0, 100.0)


def patch(element="quad4"):
    return block((2.0, 1.0), (3, 2), element, (0.5, -0.25), distortion=0.2)


def outer(mesh):
    (facets,) = fc.topology.outer_facets(mesh).values()
    return sorted(map(tuple, facets.tolist()))


@given(at=small, element=st.sampled_from(ELEMENTS), axis=st.sampled_from(("x", "y")))
@settings(max_examples=25, deadline=None)
def test_a_mirror_keeps_areas_orientation_and_facets_and_undoes_itself(at, element, axis):
    mesh = patch(element)
    image = mirrored(mesh, axis, at)
    before, after = fc.quality(mesh), fc.quality(image)
    assert after.n_bad == 0
    assert after.measure == pytest.approx(before.measure)
    assert after.smallest_angle == pytest.approx(before.smallest_angle)
    (lines,) = image.facets.values()
    assert sorted(map(tuple, lines.tolist())) == outer(image)
    back = mirrored(image, axis, at)
    assert back.points == pytest.approx(mesh.points, abs=1e-12 * (1 + abs(at)))
    assert all(np.array_equal(back.cells[name], mesh.cells[name]) for name in mesh.cells)


@pytest.mark.parametrize("name", SOLIDS_3D)
@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_mirrored_3d_cell_has_the_same_volume(name, axis):
    element = elements.get(name)
    points = element.nodes @ np.array([[1.0, 0.1, 0.0], [0.2, 1.1, 0.0], [0.0, 0.3, 0.9]])
    mesh = fc.Mesh(points, {name: [np.arange(element.n_nodes)]})
    before, after = fc.quality(mesh), fc.quality(mirrored(mesh, axis))
    assert before.measure > 0.0
    assert after.measure == pytest.approx(before.measure)


def test_mirrored_groups_are_renamed_by_mapping_or_function():
    mesh = patch()
    by_mapping = mirrored(mesh, "y", rename={"TOP": "BELOW", "TOP_LEFT": None})
    assert "BELOW" in by_mapping.cell_groups
    assert "TOP" not in by_mapping.cell_groups
    assert "TOP_LEFT" not in by_mapping.point_groups
    assert "BOTTOM" in by_mapping.cell_groups
    assert set(renamed(mesh, str.lower).cell_groups) == {name.lower() for name in mesh.cell_groups}


def test_groups_given_one_name_are_united():
    assert len(renamed(patch(), {"LEFT": "SIDES", "RIGHT": "SIDES"}).cell_groups["SIDES"]) == 4


def test_union_stacks_points_and_keeps_each_group_where_it_was():
    first, second = patch("quad4"), transformed(patch("tri3"), translate=(10.0, 0.0))
    both = union(first, second)
    assert both.n_points == first.n_points + second.n_points
    assert list(both.cells) == ["quad4", "line2", "tri3"]
    for part, shift in ((first, 0), (second, first.n_points)):
        assert set(part.points_of("BLOCK") + shift) <= set(both.points_of("BLOCK").tolist())
    for group in first.cell_groups:
        assert len(both.cell_groups[group]) == len(first.cell_groups[group]) + len(second.cell_groups[group])
        expected = np.concatenate([first.points_of(group), second.points_of(group) + first.n_points])
        assert np.array_equal(both.points_of(group), np.unique(expected))
    assert len(both.points_of("TOP_LEFT")) == 2
    assert fc.quality(both).measure == pytest.approx(2 * fc.quality(first).measure)


def test_union_never_merges_and_of_one_mesh_is_that_mesh():
    mesh = patch()
    assert fc.topology.bodies(union(mesh, mesh))[0] == 2
    alone = union(mesh)
    assert np.array_equal(alone.points, mesh.points)
    assert all(np.array_equal(alone.cell_groups[name], mesh.cell_groups[name]) for name in mesh.cell_groups)


@pytest.mark.parametrize("element", ELEMENTS)
def test_welding_two_halves_gives_one_body_with_one_row_of_points_less(element):
    half = patch(element)
    both = union(half, mirrored(half, "x", 0.5, {"LEFT": "OTHER_LEFT"}))
    welded = merge_points(both, 1e-9)
    assert fc.topology.bodies(both)[0] == 2
    assert fc.topology.bodies(welded)[0] == 1
    assert welded.n_points == both.n_points - len(half.points_of("LEFT"))
    assert np.array_equal(welded.points_of("LEFT"), welded.points_of("OTHER_LEFT"))
    assert fc.quality(welded).measure == pytest.approx(4.0)
    assert len(np.unique(np.concatenate([block.ravel() for block in welded.cells.values()]))) == welded.n_points


def test_welding_keeps_the_first_point_and_its_exact_place():
    points = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0 + 1e-7, 0.0], [1.0, 1.0], [1e-7, 1.0]]
    mesh = fc.Mesh(points, {"tri3": [[0, 1, 2], [3, 4, 5]]}, point_groups={"CORNER": [3]})
    welded = merge_points(mesh, 1e-6)
    assert welded.points.tolist() == [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]
    assert welded.cells["tri3"].tolist() == [[0, 1, 2], [1, 3, 2]]
    assert welded.point("CORNER") == 1
    assert merge_points(mesh, 1e-8) is mesh


@given(dx=small, dy=small, scale=st.floats(0.01, 100.0), angle=st.floats(-720.0, 720.0))
@settings(max_examples=25, deadline=None)
def test_moving_keeps_the_shape(dx, dy, scale, angle):
    mesh = patch("tri3")
    moved = transformed(mesh, translate=(dx, dy), scale=scale, rotate=angle)
    before, after = fc.quality(mesh), fc.quality(moved)
    assert after.measure == pytest.approx(scale**2 * before.measure, rel=1e-6)
    assert after.longest_edge == pytest.approx(scale * before.longest_edge, rel=1e-6)
    assert after.smallest_angle == pytest.approx(before.smallest_angle, rel=1e-6)
    assert after.worst_aspect == pytest.approx(before.worst_aspect, rel=1e-6)
    assert after.n_bad == 0


def test_a_quarter_turn_is_counter_clockwise_and_comes_before_the_shift():
    mesh = fc.Mesh([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]], {"tri3": [[0, 1, 2]]})
    turned = transformed(mesh, translate=(5.0, 0.0), scale=2.0, rotate=90.0)
    assert turned.points == pytest.approx(np.array([[5.0, 2.0], [3.0, 0.0], [5.0, 0.0]]), abs=1e-12)


def test_mirroring_commutes_with_mid_nodes():
    mesh = patch("quad4")
    first, second = mirrored(to_quadratic(mesh), "x"), to_quadratic(mirrored(mesh, "x"))
    centres = [mesh.points[mesh.cells["quad8"]].mean(axis=1) for mesh in (first, second)]
    assert centres[0] == pytest.approx(centres[1])
