"""Overlap of bodies: initial, prescribed by supports, and pairs that join the same facets."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import elastic_model, last_step, supported, with_contact, with_obstacle
from refusals import refused
from scipy.spatial.transform import Rotation

import fastcontact as fc
from fastcontact.mesh.generate import block, block_on_block, box, sphere_octant, union
from fastcontact.model.body_overlap import _depths, penetration, winding_numbers
from fastcontact.model.model_warnings import model_warnings

SOLIDS = ("hex8", "hex20", "hex27", "tet4", "tet10", "wedge6", "wedge15", "pyramid5", "pyramid13")


def shell(mesh):
    return [mesh.points[facets] for facets in fc.topology.outer_facets(mesh).values()]


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
    triangles = mesh.points[fc.topology.outer_facets(mesh)["quad4"]][:, [[0, 1, 2], [0, 2, 3]]].reshape(-1, 3, 3)
    number = winding_numbers(points, triangles)
    assert np.abs(number - np.round(number)).max() < 1e-9
    # Bilinear facets bulge a little beyond their triangles.
    assert (number[np.abs(depth) > 2e-2] > 0.5).all()
    assert (depth > 0).sum() >= 0.9 * (number > 0.5).sum()


def test_bodies_that_touch_or_stand_apart_do_not_overlap():
    lower = box((2.0, 2.0, 1.0), (2, 2, 1), name="LOWER")
    for height in (1.0, 1.3):
        mesh = union(lower, box((1.0, 1.0, 1.0), (2, 2, 2), "hex20", (0.5, 0.5, height), name="UPPER"))
        assert penetration(mesh, "3d", mesh.points) == []


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
    x, y = [-2.0, 0.0, 0.5, 2.0, -2.0, 0.0, 0.0, -3.0, 0.5], [0.0, 0.0, 0.0, 0.0, 0.5, 0.4, -0.4, -0.5, 0.37]
    depth, facet = _depths(np.column_stack([x, y]), [lens])
    assert (depth > 0).tolist() == [False, True, True, False, False, True, True, False, True]
    assert depth[[1, 5, 6]] == pytest.approx([0.5, 0.1, 0.1], abs=1e-12)
    assert facet[[5, 6, 8]].tolist() == [0, 1, 0]


FORMULATIONS = ["node_to_segment", "continuous", "mortar"]


def floor(dim, height=0.0):
    return fc.obstacles.HalfSpace((0.0,) * (dim - 1) + (height,), (0.0,) * (dim - 1) + (1.0,))


def told(model, ramp=None):
    return [text for text in model_warnings(model, ramp or fc.linear_ramp(1)) if text.startswith("supports push")]


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize(
    ("mesh", "kinematics", "side"),
    [
        (block((1.0, 1.0), (2, 2)), "plane_strain", "BOTTOM"),
        (block((1.0, 1.0), (2, 2)), "axisymmetric", "BOTTOM"),
        (box((1.0, 1.0, 1.0), (1, 1, 1)), "3d", "ZMIN"),
    ],
)
def test_a_side_pushed_into_a_floor_is_refused(mesh, kinematics, side, formulation):
    model = elastic_model(mesh, kinematics)
    up = "yz"[mesh.dim - 2]
    supported(model, **{side: {up: -0.1}, "LEFT" if mesh.dim == 2 else "XMIN": "x"})
    model.add_obstacle("floor", secondary=side, obstacle=floor(mesh.dim), formulation=formulation)
    n = len(mesh.points_of(side))
    refused(fc.ModelError, rf"push {n} of the {n} nodes of '{side}' into the rigid .* by up to 0\.1 ", model.check)


@pytest.mark.each_value
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("sides", [("CONT_UPPER", "CONT_LOWER"), ("CONT_LOWER", "CONT_UPPER")])
def test_both_sides_prescribed(sides, friction, formulation):
    options = {"sides": sides, "formulation": formulation, "friction": friction}
    with pytest.raises(
        fc.ModelError, match=rf"nodes of '{sides[0]}' into '{sides[1]}', contact 'pair', by up to 0\.02 "
    ):
        pressed(0.02, **options).check()
    for by in (-0.02, 0.0):  # apart, and as they lie
        pressed(by, **options).check()


def shifted(by, mesh=None, **options):
    """A block moved by `by` into a wall at its left, by its top alone."""
    model = elastic_model(mesh or block((1.0, 1.0), (3, 4)), TOP={"x": -by, "y": 0.0})
    model.add_obstacle("wall", secondary="LEFT", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (1.0, 0.0)), **options)
    model.check()
    return model


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_single_node_gives_a_warning_with_number_and_place(formulation):
    model = shifted(0.01, formulation=formulation)
    corner = model.mesh.point("TOP_LEFT")
    (text,) = told(model)
    assert "supports push 1 of the 5 nodes of 'LEFT' into the rigid obstacle" in text
    assert f"by up to 0.01 (point {corner} at (0, 1), instant 1)" in text
    step, texts = last_step(model)
    assert text in texts
    assert text in step.warnings


def test_what_helps():
    assert not told(shifted(0.01, excluded=["TOP_LEFT"]))
    assert not told(shifted(0.01, penalty=1e5, formulation="node_to_segment"))
    assert not told(shifted(-0.01))


def test_the_worst_instant_counts():
    model = shifted(0.0)
    model.supports.clear()
    model.fix("TOP", "y")
    model.prescribe("TOP", x=-0.01, ramp=[(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)])
    (text,) = told(model, fc.Ramp((0.25, 0.5, 1.0)))
    assert "by up to 0.01" in text
    assert "instant 0.5" in text
    assert not told(model, fc.Ramp((1.0,)))


def test_an_obstacle_that_moves_into_held_nodes():
    model = elastic_model(box((1.0, 1.0, 1.0), (2, 2, 2)), XMIN="xyz")
    model.add_obstacle("plate", secondary="ZMIN", obstacle=floor(3), motion={"z": 0.05})
    model.check()
    (text,) = told(model)
    assert "3 of the 9 nodes of 'ZMIN'" in text
    assert "by up to 0.05" in text


def test_an_interference_between_nodes_that_are_held_on_both_sides():
    model = elastic_model(block_on_block(), LOWER_BOTTOM="xy", UPPER_TOP="xy", LOWER_LEFT="xy", UPPER_LEFT="xy")
    model.add_contact("pair", secondary="CONT_LOWER", primary="CONT_UPPER", clearance=-0.02)
    (text,) = told(model)
    assert "supports push 1 of the 9 nodes of 'CONT_LOWER' into 'CONT_UPPER', contact 'pair', by up to 0.02" in text


@pytest.mark.parametrize("secondary", ["CONT_LOWER", "CONT_UPPER"])
def test_a_tool_of_prescribed_nodes_is_right(secondary):
    model = elastic_model(block_on_block(), LOWER_BOTTOM="xy", UPPER={"x": 0.0, "y": -0.02})
    primary = {"CONT_LOWER": "CONT_UPPER", "CONT_UPPER": "CONT_LOWER"}[secondary]
    model.add_contact("pair", secondary=secondary, primary=primary)
    model.check()
    assert not told(model)


def test_an_overlap_before_any_load_is_that_of_the_mesh():
    model = with_obstacle(elastic_model(block((1.0, 1.0), (2, 2)), BOTTOM="xy"), "floor", "BOTTOM", floor(2, 0.01))
    model.check()
    assert not told(model)


def pressed(by, sides=("CONT_UPPER", "CONT_LOWER"), **options):
    """Two blocks both of whose contact sides are prescribed, the upper one lower by a length."""
    model = elastic_model(block_on_block(), CONT_LOWER="xy", CONT_UPPER={"x": 0.0, "y": -by})
    return with_contact(model, "pair", sides[0], sides[1], **options)


@pytest.mark.parametrize("kind", ["tied", "bilateral"])
def test_supports_that_tear_what_is_tied(kind):
    with pytest.raises(fc.ModelError, match=r"nodes of 'CONT_UPPER' off 'CONT_LOWER', contact 'pair', by up to 0\.02 "):
        pressed(-0.02, kind=kind).check()
    pressed(0.0, kind=kind).check()


def test_tied_sides_may_not_be_shifted_along_each_other():
    model = elastic_model(block_on_block(), CONT_LOWER="xy", CONT_UPPER={"x": 0.03, "y": 0.0})
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", kind="tied")
    refused(fc.ModelError, r"off 'CONT_LOWER', contact 'pair', by up to 0\.03 ", model.check)


def test_relations_that_hold_nodes_inside_are_told_at_the_end():
    model = elastic_model(block((1.0, 1.0), (2, 2)))
    model.couple("BOTTOM", "y")
    supported(model, BOTTOM_LEFT={"y": -0.1}, LEFT="x")
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor(2))
    _, texts = last_step(model)
    assert any("contact 'floor' carries nothing although its sides penetrate by 0.1:" in text for text in texts), texts
    assert not any("never closed" in text for text in texts)


def test_a_long_history_is_looked_at_in_some_instants():
    from fastcontact.model.prescribed_overlap import MAX_INSTANTS, Supports

    supports = Supports(np.zeros((1, 2), bool), {}, fc.linear_ramp(1000))
    assert len(supports.instants()) == MAX_INSTANTS
    assert supports.instants()[0] == 0.001
    assert supports.instants()[-1] == 1.0


def parts(mesh, group):
    """The mesh with the facets of a group, from left to right, in halves and in an overlapping part of them."""
    facets = mesh.cell_groups[group]
    centres = np.concatenate([mesh.points[f][:, :2].mean(axis=1) for f in mesh.cells_of(group).values()])
    facets = facets[np.argsort(centres[:, 0])]
    half, third = len(facets) // 2, len(facets) // 3
    return mesh.with_groups(
        cells={f"{group}_LEFT": facets[:half], f"{group}_RIGHT": facets[half:], f"{group}_OVER": facets[third:]}
    )


@pytest.fixture
def mesh():
    return parts(parts(block_on_block(), "CONT_UPPER"), "CONT_LOWER")


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("CONT_UPPER", "CONT_LOWER"), ("CONT_UPPER_LEFT", "CONT_LOWER")),
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER", "CONT_LOWER")),
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER_OVER", "CONT_LOWER")),
        (("CONT_UPPER", "CONT_LOWER_LEFT"), ("CONT_UPPER", "CONT_LOWER_OVER")),
        (("CONT_UPPER", "CONT_LOWER"), ("CONT_LOWER_LEFT", "CONT_UPPER")),
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_LOWER", "CONT_UPPER_OVER")),
        (("CONT_UPPER_OVER", "CONT_LOWER_LEFT"), ("CONT_LOWER_OVER", "CONT_UPPER_LEFT")),
    ],
)
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_facets_of_an_earlier_pair_are_refused(mesh, first, second, formulation):
    model = with_contact(elastic_model(mesh), "first", first[0], first[1], formulation=formulation)
    with pytest.raises(fc.ContactError, match=r"contact 'second' pairs .* also paired by contact 'first': .*point"):
        model.add_contact("second", secondary=second[0], primary=second[1], formulation=formulation)
    assert len(model.contact) == 1


def test_facets_that_stand_in_the_mesh_twice_are_the_same(mesh):
    """Mesh generators write a facet once for each group that holds it."""
    again = {name: np.concatenate([b, mesh.cells_of("CONT_UPPER").get(name, b[:0])]) for name, b in mesh.cells.items()}
    before = sum(map(len, mesh.cells.values()))
    assert list(mesh.cells)[-1] == "line2"
    copied = mesh.replace(cells=again)
    copied = copied.with_groups(cells={"COPY": range(before, before + len(mesh.cell_groups["CONT_UPPER"]))})
    model = with_contact(elastic_model(copied), "first", "CONT_UPPER", "CONT_LOWER")
    with pytest.raises(fc.ContactError, match="contact 'second' pairs"):
        model.add_contact("second", secondary="COPY", primary="CONT_LOWER")


def test_one_side_may_meet_two_others_and_several_obstacles(mesh):
    model, slope = elastic_model(mesh), fc.obstacles.HalfSpace((0.0, -5.0), (0.5, 1.0))
    for half in ("LEFT", "RIGHT"):
        model.add_contact(half, secondary="CONT_UPPER", primary=f"CONT_LOWER_{half}")
    model.add_obstacle("floor", secondary="CONT_UPPER", obstacle=floor(2, -5.0))
    model.add_obstacle("slope", secondary="CONT_UPPER", obstacle=slope)
    model.add_obstacle("moving", secondary="CONT_UPPER", obstacle=slope, motion={"y": 0.1})
    assert len(model.contact) == 5


def test_a_facet_that_stands_in_a_group_twice_is_loaded_once(mesh):
    line2 = mesh.cells["line2"]
    copied = mesh.replace(cells={**mesh.cells, "line2": np.vstack([line2, line2[:, ::-1]])})
    top = copied.cell_groups["UPPER_TOP"]
    copied = copied.with_groups(cells={"TWICE": np.concatenate([top, top + len(line2)])})
    model = elastic_model(copied)
    model.add_pressure("TWICE", 2.0)
    model.add_traction("TWICE", x=3.0)
    model.add_force("TWICE", y=5.0)
    width = np.ptp(copied.points[copied.points_of("UPPER_TOP"), 0])
    assert model.forces_by_ramp()[None].sum(axis=0) == pytest.approx([3.0 * width, 5.0 - 2.0 * width])


def test_a_load_that_supports_take_up_is_told(mesh):
    def lost(**force):
        model = elastic_model(mesh, UPPER_TOP="y", UPPER_LEFT="x", LOWER_BOTTOM="xy")
        model.add_force("UPPER_TOP", **force)
        return [text for text in model_warnings(model, fc.linear_ramp(1)) if "the supports carry all of it" in text]

    assert len(lost(y=1.0)) == 1
    assert not lost(x=1.0)
    assert not lost(x=1e-3, y=1.0)
    assert not lost(y=0.0)


def split(mesh, formulation, first, second, **options):
    model = with_contact(elastic_model(mesh), "first", first[0], first[1], formulation=formulation)
    model.add_contact("second", secondary=second[0], primary=second[1], formulation=formulation, **options)
    return [text for text in model_warnings(model, fc.linear_ramp(1)) if "adjoin each other" in text]


@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
@pytest.mark.parametrize(
    ("first", "second"),
    [
        (("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER_RIGHT", "CONT_LOWER")),
        (("CONT_UPPER", "CONT_LOWER_LEFT"), ("CONT_UPPER", "CONT_LOWER_RIGHT")),
        (("CONT_UPPER_LEFT", "CONT_LOWER_LEFT"), ("CONT_UPPER_RIGHT", "CONT_LOWER_RIGHT")),
        (("CONT_UPPER_LEFT", "CONT_LOWER_LEFT"), ("CONT_LOWER_RIGHT", "CONT_UPPER_RIGHT")),
    ],
)
def test_sides_that_are_split_give_a_warning(mesh, first, second, formulation):
    (text,) = split(mesh, formulation, first, second)
    assert text.startswith("contacts 'first' and 'second' adjoin each other at ")


def test_splitting_does_no_harm_where_nodes_carry_forces(mesh):
    sides = ("CONT_UPPER_LEFT", "CONT_LOWER"), ("CONT_UPPER_RIGHT", "CONT_LOWER")
    assert not split(mesh, "node_to_segment", *sides)
    assert split(mesh, "mortar", *sides)
    both = ("CONT_UPPER_LEFT", "CONT_LOWER_LEFT"), ("CONT_UPPER_RIGHT", "CONT_LOWER_RIGHT")
    assert split(mesh, "node_to_segment", *both)


@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar"])
def test_one_pair_of_both_halves_has_the_pressure_of_the_press(mesh, formulation):
    """What the warning advises is right, and what is silent is right, too."""
    model = elastic_model(mesh, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
    model.add_pressure("UPPER_TOP", 1.0)
    if formulation == "mortar":
        model.add_contact("all", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation)
    else:
        matching = parts(
            parts(block_on_block(divisions_lower=(6, 2), divisions_upper=(6, 2)), "CONT_UPPER"), "CONT_LOWER"
        )
        model = elastic_model(matching, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
        model.add_pressure("UPPER_TOP", 1.0)
        for half in ("LEFT", "RIGHT"):
            model.add_contact(half, secondary=f"CONT_UPPER_{half}", primary="CONT_LOWER", formulation=formulation)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    for contact in step.contact.values():
        assert contact.pressure == pytest.approx(np.ones(len(contact.points)), rel=1e-6)


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("friction", [None, 0.3])
@pytest.mark.parametrize("swapped", [False, True])
def test_pairs_share_the_force_of_a_common_node_by_area(solver, friction, swapped):
    """Their conditions there are the same, and leave the split of the force open; facets grow along the side."""
    even = block_on_block(divisions_lower=(6, 2), divisions_upper=(6, 2))
    points = even.points.copy()
    points[:, 0] = points[:, 0] ** 2 / points[:, 0].max()
    mesh = parts(parts(fc.Mesh(points, even.cells, even.cell_groups, even.point_groups), "CONT_UPPER"), "CONT_LOWER")
    model = elastic_model(mesh, LOWER_BOTTOM="y", LOWER_LEFT="x", UPPER_LEFT="x")
    model.add_pressure("UPPER_TOP", 1.0)
    for half in ("RIGHT", "LEFT") if swapped else ("LEFT", "RIGHT"):
        options = {} if friction is None else {"friction": friction}
        with_contact(model, half, f"CONT_UPPER_{half}", "CONT_LOWER", formulation="node_to_segment", **options)
    (step,) = fc.solve(model, fc.linear_ramp(1), linear_solver=solver, linear_tolerance=1e-12)
    for half, contact in step.contact.items():
        assert contact.pressure == pytest.approx(np.ones(len(contact.points)), rel=1e-6)
        width = np.ptp(mesh.points[mesh.points_of(f"CONT_UPPER_{half}"), 0])
        assert contact.force[1] == pytest.approx(width, rel=1e-6)
        assert contact.active.all()


def test_sides_that_meet_in_a_corner_are_silent():
    """A block in the corner of an angle touches it with two faces that have one node in common on both bodies."""
    points = [[0, 0], [3, 0], [3, 1], [1, 1], [1, 3], [0, 3], [0, 1], [1, 0], [1.5, 1.5], [3, 1.5], [3, 3], [1.5, 3]]
    angle = [[0, 7, 3, 6], [7, 1, 2, 3], [6, 3, 4, 5]]
    mesh = fc.Mesh(
        points, {"quad4": [*angle, [8, 9, 10, 11]], "line2": [[2, 3], [3, 4], [8, 9], [11, 8]]},
        cell_groups={"FLOOR": [4], "WALL": [5], "LOW": [6], "LEFT": [7]},
    )  # fmt: skip
    assert not split(mesh, "mortar", ("LOW", "FLOOR"), ("LEFT", "WALL"))
