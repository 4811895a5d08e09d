"""Coulomb friction: stick, slip, partial slip of Cattaneo and Mindlin, residual tractions."""

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
