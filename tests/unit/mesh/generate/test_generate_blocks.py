"""Blocks, block on block, and the cylinder: sizes, groups, grading, orientation."""

import inspect
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fastcontact as fc
from fastcontact.mesh import elements
from fastcontact.mesh.generate._spacing import coons_patch, rectangular_grid
from fastcontact.mesh.generate.box import SOLIDS

ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "quad9")
side = st.floats(0.1, 10.0)
few = st.integers(1, 6)


@given(st.sampled_from(ELEMENTS), side, side, few, few, st.floats(0.0, 0.24))
@settings(max_examples=40, deadline=None)
def test_a_block_fills_its_rectangle_whatever_the_distortion(element, width, height, n, m, distortion):
    mesh = fc.generate.block((width, height), (n, m), element, (-1.0, 2.0), distortion=distortion)
    quality = fc.quality(mesh)
    assert quality.measure == pytest.approx(width * height)
    assert quality.n_bad == 0
    order = elements.get(element).order
    for group, nodes, axis, place in (
        ("BOTTOM", n, 1, 2.0), ("RIGHT", m, 0, width - 1.0), ("TOP", n, 1, 2.0 + height), ("LEFT", m, 0, -1.0),
    ):  # fmt: skip
        points = mesh.points[mesh.points_of(group)]
        assert len(points) == order * nodes + 1
        assert points[:, axis] == pytest.approx(place)
    (lines,), (outer,) = mesh.facets.values(), fc.topology.outer_facets(mesh).values()
    assert sorted(map(tuple, lines.tolist())) == sorted(map(tuple, outer.tolist()))
    assert len(mesh.cell_groups["BLOCK"]) == n * m * (2 if element.startswith("tri") else 1)


def test_distortion_moves_inner_nodes_only_and_always_the_same_way():
    straight, bent, again = (fc.generate.block((4, 2), (4, 2), distortion=d) for d in (0.0, 0.2, 0.2))
    moved = np.linalg.norm(bent.points - straight.points, axis=1) > 0
    edge = np.unique(np.concatenate([straight.points_of(g) for g in ("BOTTOM", "RIGHT", "TOP", "LEFT")]))
    assert not moved[edge].any()
    assert moved.sum() == 3
    assert bent.points.tobytes() == again.points.tobytes()


def test_corners_of_a_block_are_named():
    mesh = fc.generate.block((4.0, 2.0), (3, 3), origin=(1.0, 1.0), name="SLAB")
    found = {name: mesh.points[mesh.point(name)].tolist() for name in mesh.point_groups}
    assert found["BOTTOM_LEFT"] == [1.0, 1.0]
    assert found["TOP_RIGHT"] == [5.0, 3.0]
    assert set(found) == {"BOTTOM_LEFT", "BOTTOM_RIGHT", "TOP_RIGHT", "TOP_LEFT"}
    assert len(mesh.cell_groups["SLAB"]) == 9


@pytest.mark.parametrize("element", ELEMENTS)
def test_two_blocks_face_each_other_on_one_line(element):
    mesh = fc.generate.block_on_block(element, size_upper=(6.0, 3.0), shift=2.0, distortion=0.1)
    assert fc.topology.bodies(mesh)[0] == 2
    assert mesh.points[mesh.points_of("CONT_LOWER"), 1] == pytest.approx(0.0, abs=1e-15)
    assert mesh.points[mesh.points_of("CONT_UPPER"), 1] == pytest.approx(0.0, abs=1e-15)
    assert np.ptp(mesh.points[mesh.points_of("CONT_UPPER"), 0]) == pytest.approx(6.0)
    assert mesh.points[mesh.point("UPPER_BOTTOM_LEFT")].tolist() == [2.0, 0.0]
    outer = {f"LOWER_{side}" for side in ("BOTTOM", "LEFT", "RIGHT")} | {
        f"UPPER_{side}" for side in ("TOP", "LEFT", "RIGHT")
    }
    assert set(mesh.cell_groups) == outer | {"LOWER", "UPPER", "CONT_LOWER", "CONT_UPPER"}
    assert fc.quality(mesh).measure == pytest.approx(10 * 5 + 6 * 3)


@pytest.mark.parametrize("element", ELEMENTS)
def test_cylinder_touches_the_block_at_the_pole(element):
    mesh = fc.generate.cylinder_on_block(element, R=10.0, size=4.0, contact_size=0.5, block_size=(15.0, 12.0))
    assert fc.topology.bodies(mesh)[0] == 2
    quality = fc.quality(mesh)
    exact = math.pi * 10**2 / 4 + 15 * 12
    assert quality.measure == pytest.approx(exact, rel=1e-2 if elements.get(element).order == 1 else 1e-4)
    groups = {"CYLINDER", "BLOCK", "AXIS", "CYLINDER_TOP", "CYLINDER_SIDE", "CONT_CYLINDER"}
    assert set(mesh.cell_groups) == groups | {"CONT_BLOCK", "BLOCK_SIDE", "BLOCK_BOTTOM"}
    assert set(mesh.point_groups) == {"POLE_CYLINDER", "POLE_BLOCK", "CENTRE"}
    assert mesh.point("POLE_CYLINDER") != mesh.point("POLE_BLOCK")
    assert np.abs(mesh.points[[mesh.point("POLE_CYLINDER"), mesh.point("POLE_BLOCK")]]).max() == 0.0
    assert mesh.points[mesh.points_of("AXIS"), 0] == pytest.approx(0.0, abs=0.0)
    assert mesh.points[mesh.points_of("CYLINDER_TOP"), 1] == pytest.approx(10.0)
    assert mesh.points[mesh.points_of("BLOCK_BOTTOM"), 1] == pytest.approx(-12.0)
    arc = mesh.points[mesh.points_of("CONT_CYLINDER")]
    assert np.hypot(arc[:, 0], arc[:, 1] - 10.0) == pytest.approx(10.0, rel=1e-12)


@pytest.mark.parametrize("element", ["tri3", "quad4"])
@pytest.mark.parametrize("group", ["CONT_CYLINDER", "CONT_BLOCK"])
def test_both_surfaces_are_finest_at_the_pole(element, group):
    mesh = fc.generate.cylinder_on_block(element, R=50.0, size=5.0, contact_size=0.25)
    start = "POLE_CYLINDER" if group == "CONT_CYLINDER" else "POLE_BLOCK"
    steps = np.diff(fc.topology.ordered_line(mesh, group, start=start).abscissa)
    assert 0.2 < steps[0] <= 0.28
    assert steps.max() <= 5.0 * (1 + 1e-9)
    assert (np.diff(steps[steps < 3.0]) > 0).all()


def test_a_transfinite_grid_of_straight_sides_is_the_rectangle():
    x, y = np.array([0.0, 0.2, 1.0]), np.array([0.0, 0.5, 0.6, 1.0])
    grid = rectangular_grid(3.0 * x, 2.0 * y)
    assert coons_patch(grid[:, 0], grid[-1], grid[:, -1], grid[0], x, y) == pytest.approx(grid, abs=1e-15)


def test_a_transfinite_grid_reproduces_a_bilinear_map():
    u, v = np.linspace(0, 1, 5) ** 2, np.linspace(0, 1, 4)
    U, V = np.meshgrid(u, v, indexing="ij")
    exact = np.stack([2 * U + V + 0.5 * U * V, V * 3 - 0.3 * U + 0.7 * U * V], axis=2)
    assert coons_patch(exact[:, 0], exact[-1], exact[:, -1], exact[0], u, v) == pytest.approx(exact, abs=1e-14)


@pytest.mark.parametrize("name", fc.generate.GENERATORS)
def test_generators_need_no_argument_and_take_plain_values_only(name):
    make = fc.generate.GENERATORS[name]
    assert make().n_points > 0
    assert "element" in inspect.signature(make).parameters
    for parameter in inspect.signature(make).parameters.values():
        assert isinstance(parameter.default, (str, int, float, tuple, type(None)))


# Boxes: exact volume, sides, conforming cells in every element.

SIZE, ORIGIN = (2.0, 1.5, 1.2), (0.5, -0.3, 0.1)
SIDES = {f"{axis}{end}": (k, end) for k, axis in enumerate("XYZ") for end in ("MIN", "MAX")}


@pytest.mark.parametrize("element", SOLIDS)
def test_volume_points_and_sides(element):
    mesh = fc.generate.box(SIZE, (3, 2, 2), element, ORIGIN)
    fc.Model(mesh, "3d")  # no cell is degenerate or inverted
    assert list(mesh.solids) == [element]
    assert fc.topology.corner_measures(mesh, element).sum() == pytest.approx(np.prod(SIZE), rel=1e-13)
    assert fc.quality(mesh).measure == pytest.approx(np.prod(SIZE), rel=1e-13)
    assert fc.topology.bodies(mesh)[0] == 1
    assert (fc.topology.bodies(mesh)[1] == 0).all()
    low, high = np.array(ORIGIN), np.array(ORIGIN) + SIZE
    for name, (axis, end) in SIDES.items():
        found = mesh.points_of(name)
        on = mesh.points[:, axis] == (low if end == "MIN" else high)[axis]
        assert np.array_equal(found, np.flatnonzero(on))


@pytest.mark.parametrize("element", SOLIDS)
def test_neighbours_share_their_facets_so_that_only_the_sides_are_outside(element):
    mesh = fc.generate.box(SIZE, (3, 2, 2), element, ORIGIN)
    outer = {name: sorted(map(tuple, block.tolist())) for name, block in fc.topology.outer_facets(mesh).items()}
    assert {name: sorted(map(tuple, block.tolist())) for name, block in mesh.facets.items()} == outer
    members = np.concatenate([mesh.cell_groups[name] for name in SIDES])
    assert len(members) == len(np.unique(members)) == sum(map(len, mesh.facets.values()))


@pytest.mark.parametrize("element", SOLIDS)
def test_number_of_cells_and_points(element):
    mesh = fc.generate.box(divisions=(2, 3, 4), element=element, name="SOLID")
    n = {"hex8": 1, "tet4": 6, "wedge6": 2, "pyramid5": 6}[elements.get(element).linear] * 24
    assert len(mesh.cells[element]) == len(mesh.cell_groups["SOLID"]) == n
    corners = 3 * 4 * 5
    if element == "hex27":
        assert mesh.n_points == 5 * 7 * 9
    if element in ("hex8", "tet4", "wedge6"):
        assert mesh.n_points == corners
    if element == "pyramid5":
        assert mesh.n_points == corners + 24


@pytest.mark.parametrize("element", [name for name in SOLIDS if elements.get(name).order == 2])
def test_quadratic_boxes_are_linear_ones_with_mid_nodes(element):
    mesh = fc.generate.box(SIZE, (2, 1, 1), element, ORIGIN)
    for name, block in mesh.cells.items():
        reference = elements.get(name)
        expected = reference.corner_shape(reference.nodes) @ mesh.points[block[:, : reference.n_corners]]
        assert np.abs(mesh.points[block] - expected).max() < 1e-15
