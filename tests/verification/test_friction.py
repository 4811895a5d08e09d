"""Coulomb friction: stick, slip, partial slip of Cattaneo and Mindlin, residual tractions."""

import warnings

import numpy as np
import pytest
from models import elastic_model
from pairwise import first_of

import fastcontact as fc

FORMULATIONS = ("node_to_segment", "continuous", "mortar")


def pressed_block(formulation, friction, push, steps=4, nu=0.0):
    """A block pressed on a wide one and pushed sideways by its rigid top."""
    mesh = fc.generate.block_on_block(divisions_lower=(6, 2), divisions_upper=(3, 3), element="quad4")
    model = elastic_model(mesh, "plane_strain", nu=nu, LOWER_BOTTOM="xy")
    model.prescribe("UPPER_TOP", x=push, y=-1e-4)
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


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_tractions_stay_on_or_inside_the_cone(formulation):
    for step in pressed_block(formulation, 0.3, 4e-5, nu=0.3):
        contact = step.contact["pair"]
        if formulation == "node_to_segment":
            shear = np.linalg.norm(contact.shear, axis=1)
            assert (shear <= 0.3 * contact.pressure * (1 + 1e-9) + 1e-9 * contact.pressure_max).all()
            sliding = contact.active & ~contact.sticking
            assert shear[sliding] == pytest.approx(0.3 * contact.pressure[sliding], rel=1e-9)


def pressed_and_drawn(friction=0.3, nu=0.49):
    """A large block pressed against a rigid parabola, then drawn sideways.

    Nearly incompressible, so that pressure and shear are hardly coupled; large, or its own bulging would draw along the
    contact. Returns the steps at full pressure: before, half-way along and at the end of the sideways motion.
    """
    block = fc.generate.block((2.0, 1.0), (120, 48), "quad8", origin=(-1.0, -1.0))  # quad4 would lock
    graded = np.sign(block.points) * np.sinh(8.0 * np.abs(block.points)) / np.sinh(8.0) * 60.0
    model = elastic_model(block.replace(points=graded), "plane_strain", nu=nu)
    model.prescribe("BOTTOM", y=0.09, ramp=[(0, 0), (1, 1), (2, 1)])
    model.prescribe("BOTTOM", x=0.03, ramp=[(0, 0), (1, 0), (2, 1)])
    model.add_obstacle(
        "pair", secondary="TOP", obstacle=fc.obstacles.paraboloid(10.0), formulation="continuous", friction=friction
    )
    return fc.solve(model, fc.Ramp((0.5, 1.0, 1.5, 2.0), ((0, 0), (2, 2))))[1:]


def test_partial_slip_after_cattaneo_and_mindlin():
    for step in pressed_and_drawn()[1:]:
        contact = step.contact["pair"]
        Q, P = np.abs(contact.force)
        bodies = {"E1": 1000.0, "nu1": 0.49, "R1": np.inf, "R2": 10.0, "force": P}
        normal = fc.analytic.hertz_line(**bodies)
        with warnings.catch_warnings():  # of the little coupling that nu = 0.49 leaves
            warnings.simplefilter("ignore", fc.FastcontactWarning)
            theory = fc.analytic.cattaneo_mindlin_line(**bodies, friction=0.3, tangential_force=Q)
        x = contact.coordinates[:, 0]
        # What coupling there is acts oppositely left and right: the means of both sides are free of it.
        stick, slip = contact.active & contact.sticking, contact.active & ~contact.sticking
        edges = [np.abs(x[side]).max() for side in (stick & (x < 0), stick & (x > 0))]
        facet = 0.036  # the length of the facets near the edge of the stick zone
        assert np.mean(edges) == pytest.approx(theory.stick_radius, abs=facet)
        assert slip.any()
        near_edge = np.abs(np.abs(x) - theory.stick_radius) < 2 * facet  # the theory's traction has a vertical tangent
        inner = (np.abs(x) < 0.85 * normal.radius) & ~near_edge
        shear = np.abs(0.5 * (contact.shear[:, 0] + contact.shear[::-1, 0]))[inner]
        assert np.abs(shear - theory.traction(x[inner])).max() < 0.05 * 0.3 * normal.pressure_max
        assert contact.dissipation > 0
