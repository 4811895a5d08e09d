"""Coulomb friction: stick, slip, partial slip of Cattaneo and Mindlin, a ring in a groove."""

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, united, with_contact, with_obstacle
from pairwise import first_of

import fastcontact as fc

FORMULATIONS = ("node_to_segment", "continuous", "mortar")


def pressed_block(formulation, friction, push, steps=4, nu=0.0):
    """A block pressed on a wide one and pushed sideways by its rigid top."""
    mesh = fc.generate.block_on_block(divisions_lower=(6, 2), divisions_upper=(3, 3), element="quad4")
    model = elastic_model(mesh, "plane_strain", nu=nu, LOWER_BOTTOM="xy", UPPER_TOP={"x": push, "y": -1e-4})
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation, friction=friction)
    return fc.solve(model, fc.linear_ramp(steps))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_block_pushed_far_slides_on_the_cone(formulation):
    steps = pressed_block(formulation, 0.3, 1e-3)
    contact = steps[-1].contact["pair"]
    assert contact.slip[:, 0] == pytest.approx(contact.slip_total[:, 0] / 4, rel=2e-3)  # the load is proportional
    assert contact.slip_total[:, 0] == pytest.approx(9e-4, rel=0.03)  # a tenth of the push shears the bodies
    np.testing.assert_array_equal(contact.slip_total, np.sum([s.contact["pair"].slip for s in steps], axis=0))
    assert not contact.sticking.any()
    assert abs(contact.force[0] / contact.force[1]) == pytest.approx(0.3, rel=2e-3)  # the facets tilt a little
    assert contact.dissipation > 0


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_block_pushed_a_little_sticks_and_dissipates_nothing(formulation):
    contact = pressed_block(formulation, 0.9, 2e-6)[-1].contact["pair"]
    assert contact.sticking[contact.active].all()
    assert contact.dissipation == pytest.approx(0.0, abs=1e-16)
    assert not contact.slip_total.any()


@pytest.mark.parametrize("formulation", first_of(1, FORMULATIONS))
def test_no_friction_and_a_zero_coefficient_are_the_same(formulation):
    one = pressed_block(formulation, 0.0, 1e-4)[-1]
    other = pressed_block(formulation, 1e-12, 1e-4)[-1]
    assert np.abs(one.stress - other.stress).max() < 1e-9 * np.abs(one.stress).max()


def pressed_cube(element, friction, push):
    """Return the contact of a body on one with other facets, its multipliers linear between corners, pushed sideways."""
    linear = {"hex20": "hex20", "tet10": "tet4"}[element]
    lower = fc.generate.box((4.0, 4.0, 2.0), (4, 4, 2), linear, name="LOWER")
    upper = fc.generate.box((4.0, 4.0, 2.0), (3, 3, 2), linear, (0.0, 0.0, 2.0), name="UPPER")
    if element == "tet10":
        lower, upper = map(fc.generate.to_quadratic, (lower, upper))
    mesh = united(LOWER_=lower, UPPER_=upper)
    model = elastic_model(mesh, LOWER_ZMIN="xyz", UPPER_ZMAX={"x": push, "y": 0.0, "z": -0.01})
    model.add_contact("pair", secondary="UPPER_ZMIN", primary="LOWER_ZMAX", friction=friction, multipliers="standard")
    return fc.solve(model, 1)[-1].contact["pair"]


@pytest.mark.parametrize("element", ["hex20", "tet10"])
def test_mid_side_nodes_without_multipliers_stick_like_the_corners(element):
    contact = pressed_cube(element, 3.0, 0.0)
    assert contact.active.all()
    assert contact.sticking.all()
    assert not contact.slip.any()


@pytest.mark.parametrize("push", [0.008, 0.1])
def test_mid_side_nodes_slide_between_corners_of_which_one_slides(push):
    contact = pressed_cube("hex20", 0.3, push)
    grid = np.round(contact.coordinates[:, :2] * 1.5, 6)  # corners have even numbers
    middle = (grid % 2 == 1).any(axis=1)
    sticks = {tuple(place): stick for place, stick in zip(grid, contact.sticking, strict=True)}
    assert contact.active.all()
    assert middle.sum() == 24
    for place, stick in zip(grid[middle], contact.sticking[middle], strict=True):
        half = place % 2
        assert stick == (sticks[tuple(place - half)] and sticks[tuple(place + half)])
    assert 0 < contact.sticking[middle].sum() < 24 if push < 0.01 else not contact.sticking.any()
    assert (np.linalg.norm(contact.slip, axis=1) > 0.0)[~contact.sticking].all()
    assert not contact.slip[contact.sticking].any()


def squeezed(element, nu, mu, **options):
    """Return the last step of a ring that the upper wall squeezes before pressure pushes it to the inner wall."""
    mesh = fc.generate.block((4.0, 4.0), (4, 4), element, origin=(20.0, 0.0))
    model = elastic_model(mesh, "axisymmetric", E=10.0, nu=nu)
    plane = fc.obstacles.HalfSpace
    down = {"motion": {"y": -0.1}, "ramp": [(0, 0), (1, 1), (2, 1)]}
    walls = {
        "top": ("TOP", plane((0.0, 4.0), (0.0, -1.0)), down),
        "bottom": ("BOTTOM", plane((0.0, 0.0), (0.0, 1.0)), {}),
        "wall": ("LEFT", plane((20.0, 0.0), (1.0, 0.0)), {}),
    }
    for name, (group, obstacle, motion) in walls.items():
        model.add_obstacle(name, secondary=group, obstacle=obstacle, friction=mu, **motion, **options)
    model.add_pressure("RIGHT", 0.2, ramp=[(0, 0), (1, 0), (2, 1)])
    return fc.solve(model, [1.0, 2.0])[-1]


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")  # five nodes a side
@pytest.mark.parametrize("nu", [0.3, 0.4995])
@pytest.mark.parametrize(("element", "mu", "formulation"), [
    ("quad8", 0.1, "continuous"), ("quad8", 0.3, "continuous"), ("quad4", 0.1, "node_to_segment"),
    ("quad8", 0.1, "node_to_segment"), ("quad8", 0.3, "mortar"),
])  # fmt: skip
def test_corner_nodes_of_walls_with_friction_settle(element, mu, formulation, nu):
    """The walls balance each other along the axis, and friction is in its cone."""
    step = squeezed(element, nu, mu, formulation=formulation)
    top, bottom, wall = (step.contact[name] for name in ("top", "bottom", "wall"))
    size = abs(top.force[1])
    # What the walls above and below do not share is the friction of the inner wall.
    assert top.force[1] + bottom.force[1] + wall.force[1] == pytest.approx(0.0, abs=1e-6 * size)
    for contact, normal in ((top, 1), (bottom, 1), (wall, 0)):
        along, across = (
            np.abs(contact.force_vectors[:, 1 - normal]).sum(),
            np.abs(contact.force_vectors[:, normal]).sum(),
        )
        assert along <= mu * across * (1 + 1e-3)


def test_points_that_do_not_touch_are_not_part_of_the_dense_system():
    """Two cylinders on a strip of 1600 facets: all of its points would exceed the limit of constraints with friction."""

    def rolled(mesh, group):
        model = elastic_model(mesh, BOTTOM="xy")
        for name, x in (("left", 100.0), ("right", 300.0)):
            roller = fc.obstacles.Sphere((x, 6.0), 5.0)
            motion = {"x": 0.01, "y": -0.02}
            with_obstacle(model, name, group, roller, motion=motion, friction=0.3, formulation="continuous")
        return fc.solve(model, 2)[-1].contact

    mesh = fc.generate.block((400.0, 1.0), (1600, 4))
    near = mesh.with_facet_group("NEAR", lambda x: (x[:, 1] > 0.999) & (np.abs(np.abs(x[:, 0] - 200.0) - 100.0) < 3.0))
    whole, part = rolled(mesh, "TOP"), rolled(near, "NEAR")
    for name, contact in part.items():
        assert contact.force[1] < 0.0
        assert np.abs(whole[name].force - contact.force).max() < 1e-9 * np.abs(contact.force).max()


@pytest.mark.filterwarnings("ignore:contact 'open' never closed")
@pytest.mark.parametrize("formulation", ["continuous", "mortar"])
def test_a_pair_that_stays_open_does_not_change_the_others(formulation):
    """Pressure fields couple constraints; where none of them may close, nothing of the coupling may be left."""
    box, block = fc.generate.box, ((1.0, 1.0, 1.0), (3, 3, 2))
    blocks = {"A_": box(*block, origin=(0.0, 0.0, 1.0)), "B_": box(*block, origin=(2.0, 0.0, 1.1))}
    mesh = united(L_=box((3.0, 1.0, 1.0), (6, 2, 2)), **blocks)
    steps = []
    for with_open_pair in (False, True):
        model = elastic_model(mesh, L_ZMIN="xyz", B_ZMAX="xyz", A_ZMAX={"z": -0.01, "x": 0.001, "y": 0.0})
        if with_open_pair:
            options = {"multipliers": "standard"} if formulation == "mortar" else {}
            with_contact(model, "open", "B_ZMIN", "L_ZMAX", formulation=formulation, friction=0.3, **options)
        model.add_contact("closed", secondary="A_ZMIN", primary="L_ZMAX", formulation="mortar", friction=0.3)
        steps.append(fc.solve(model, 2)[-1])
    alone, beside = steps
    assert np.abs(beside.displacement - alone.displacement).max() < 1e-9 * np.abs(alone.displacement).max()
    assert beside.contact["closed"].force == pytest.approx(alone.contact["closed"].force, rel=1e-9)
    assert not beside.contact["open"].active.any()


# Nodes that alternate between two facets: the equilibrium at their common edge is found.


def spheres(**options):
    mesh = fc.generate.half_spheres(element="quad8", segments=16)
    return fc.solve(pressed_spheres(mesh, 1.0, formulation="node_to_segment", **options), 1)[-1]


def test_the_force_between_spheres_is_that_of_averaged_normals():
    with pytest.warns(fc.FastcontactWarning, match=r"alternated between two facets .* by \d\.\de-0\d of its largest"):
        faceted = spheres(normals="facet")
    averaged = spheres(normals="averaged")
    assert "rounded" in faceted.iterations["history"][-1]
    assert "rounded" not in averaged.iterations["history"][-1]
    assert faceted.contact["hertz"].force[1] == pytest.approx(averaged.contact["hertz"].force[1], rel=1e-7)
    assert faceted.contact["hertz"].pressure_max == pytest.approx(averaged.contact["hertz"].pressure_max, rel=1e-4)


def pressed(element, cells, swapped, friction):
    """A round block pressed on a hollow one, by node-to-segment contact with the normals of facets."""
    parts = {}
    for name, size, count, bend in (("LOW", 1.4, cells[0], 0.08), ("UP", 1.0, cells[1], 0.1)):
        lower = name == "LOW"
        mesh = fc.generate.box(
            (size, size, 0.7), (count, count, 2), element, (-size / 2, -size / 2, -0.7 if lower else 0.0), name=name
        )
        points = np.array(mesh.points)
        share = (points[:, 2] + 0.7) / 0.7 if lower else 1.0
        points[:, 2] += bend * share * (points[:, :2] ** 2).sum(axis=1)
        parts[f"{name}_"] = mesh.replace(points=points)
    model = elastic_model(united(**parts), "3d", LOW_ZMIN="xyz", UP_ZMAX={"x": 0.0, "y": 0.0, "z": -0.02})
    sides = ("LOW_ZMAX", "UP_ZMIN") if swapped else ("UP_ZMIN", "LOW_ZMAX")
    with_contact(model, "pair", sides[0], sides[1], formulation="node_to_segment", normals="facet", friction=friction)
    return fc.solve(model, 1)[-1]


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")  # coarse facets deviate from their arcs
@pytest.mark.parametrize("swapped", [False, True])
@pytest.mark.parametrize(("element", "cells", "friction"), [
    ("hex8", (6, 4), 0.0), ("hex8", (4, 6), 0.3), ("tet4", (5, 5), 0.0), ("tet4", (6, 4), 0.3),
])  # fmt: skip
def test_equilibrium_is_found_in_space(element, cells, friction, swapped):
    step = pressed(element, cells, swapped, friction)
    contact = step.contact["pair"]
    sizes = np.linalg.norm(contact.force)
    assert contact.active.any()
    # Both sides have the same force, which the supports of the lower block carry.
    assert np.abs(contact.force_vectors.sum(axis=0) + contact.primary_force_vectors.sum(axis=0)).max() < 1e-8 * sizes
    assert np.abs(step.reaction.sum(axis=0)).max() < 1e-7 * sizes
    assert contact.gap[contact.active] == pytest.approx(0.0, abs=2e-3 * 0.02)
