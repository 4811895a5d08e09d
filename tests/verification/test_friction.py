"""Coulomb friction: stick, slip, partial slip after Cattaneo and Mindlin, residual tractions."""

import numpy as np
import pytest

import fastcontact as fc

FORMULATIONS = ("node_to_segment", "continuous", "mortar")


def pressed_block(formulation, friction, push, steps=4, nu=0.0):
    """A block pressed on a wide one and pushed sideways by its rigid top."""
    mesh = fc.generate.block_on_block(divisions_lower=(6, 2), divisions_upper=(3, 3), element="quad4")
    model = fc.Model(mesh, "plane_strain")
    model.add_material(fc.LinearElastic(E=1000.0, nu=nu))
    model.fix("LOWER_BOTTOM", "xy")
    model.prescribe("UPPER_TOP", x=push, y=-1e-4)
    model.add_contact(
        "pair", secondary="CONT_UPPER", primary="CONT_LOWER", formulation=formulation, friction=friction
    )
    return fc.solve(model, fc.linear_ramp(steps))


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_block_pushed_far_slides_on_the_cone(formulation):
    contact = pressed_block(formulation, 0.3, 1e-3)[-1].contact["pair"]
    assert not contact.sticking.any()
    assert abs(contact.force[0] / contact.force[1]) == pytest.approx(0.3, rel=2e-3)  # the facets tilt a little
    assert contact.dissipation > 0


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_block_pushed_a_little_sticks_and_dissipates_nothing(formulation):
    contact = pressed_block(formulation, 0.9, 2e-6)[-1].contact["pair"]
    assert contact.sticking[contact.active].all()
    assert contact.dissipation == pytest.approx(0.0, abs=1e-16)


@pytest.mark.parametrize("formulation", FORMULATIONS)
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


def test_multigrid_solves_friction_too():
    mesh = fc.generate.block_on_block(divisions_lower=(6, 2), divisions_upper=(3, 3), element="quad4")
    results = []
    for solver in ("direct", "amg"):
        model = fc.Model(mesh, "plane_strain")
        model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
        model.fix("LOWER_BOTTOM", "xy")
        model.prescribe("UPPER_TOP", x=2e-5, y=-1e-4)
        model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.3)
        results.append(fc.solve(model, fc.linear_ramp(2), linear_solver=solver, linear_tolerance=1e-12)[-1])
    one, other = results
    assert np.abs(one.stress - other.stress).max() < 1e-7 * np.abs(one.stress).max()
