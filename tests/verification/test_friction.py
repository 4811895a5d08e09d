"""Coulomb friction: stick, slip, partial slip of Cattaneo and Mindlin, a ring in a groove."""

import numpy as np
import pytest
from models import elastic_model
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
