"""Patch tests of contact on matching and non-matching meshes, and friction between faces."""

import numpy as np
import pytest
from two_bodies import blocks, held, touching

import fastcontact as fc

pytestmark = pytest.mark.pairwise

ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "quad9")


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("element", ELEMENTS)
def test_meshes_that_do_not_match_transmit_a_uniform_pressure_exactly(element, kinematics, swap):
    model = touching(held(blocks(element, upper=(4, 3)), kinematics), "mortar", swap)
    last = fc.solve(model, fc.linear_ramp(2))[-1]
    modulus = 1000.0 / (1 - 0.3**2) if kinematics == "plane_strain" else 1000.0
    expected = -modulus * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] - expected).max() < 1e-10 * abs(expected)
    assert np.abs(last.stress[:, 3]).max() < 1e-10 * abs(expected)
    assert last.contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_the_other_formulations_do_not(formulation):
    """What the mortar formulation is for: the others miss the uniform stress by several per cent."""
    model = touching(held(blocks(upper=(4, 3))), formulation, swap=True)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    expected = -1000.0 / (1 - 0.3**2) * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] / expected - 1).max() > 0.02


@pytest.mark.parametrize("letter", ["a", "b", "c"])
def test_mortar_on_the_training_case(letter, cases, forma04):
    model = forma04(fc.read_mesh(cases / f"forma04{letter}.med"), "mortar")
    contact = fc.solve(model, fc.linear_ramp(2))[-1].contact["hertz"]
    assert np.linalg.norm(contact.force) == pytest.approx(659_773.142, rel={"a": 5e-3, "b": 5e-4, "c": 1e-3}[letter])
    assert contact.pressure_max == pytest.approx(2910.4071, rel={"a": 0.03, "b": 0.01, "c": 0.005}[letter])


@pytest.mark.each_value
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize("element", ELEMENTS)
def test_matching_meshes_transmit_a_uniform_pressure_exactly(element, formulation, kinematics, swap):
    model = touching(held(blocks(element), kinematics), formulation, swap)
    last = fc.solve(model, fc.linear_ramp(2))[-1]
    modulus = 1000.0 / (1 - 0.3**2) if kinematics == "plane_strain" else 1000.0
    expected = -modulus * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] - expected).max() < 1e-10 * abs(expected)
    others = [0, 3] if kinematics == "plane_strain" else [0, 2, 3]
    assert np.abs(last.stress[:, others]).max() < 1e-10 * abs(expected)
    assert last.contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)


@pytest.mark.parametrize("integration", ["gauss", "simpson", "node"])
def test_the_continuous_pressure_is_exact_with_every_rule(integration):
    model = touching(held(blocks("quad8")), "continuous", swap=True, integration=integration)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    pressure = last.contact["pair"].pressure
    assert np.ptp(pressure) < 1e-10 * pressure.max()


def test_without_contact_bodies_move_rigidly_and_their_overlap_is_told(forma04):
    model = forma04(fc.generate.half_spheres("tri3", size=4.0), contact=False)
    with pytest.warns(fc.FastcontactWarning, match=r"interpenetrate by 3.99\d* near .*no contact is defined"):
        steps = fc.solve(model)
    assert len(steps) == 20
    assert np.abs(steps[-1].stress).max() < 1e-10 * 20_000.0
    assert np.abs(steps[-1].reaction).max() < 1e-12 * 586_080.0  # of the force that Hertz gives
