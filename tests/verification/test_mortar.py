"""Mortar contact: the patch test on non-matching meshes."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc

pytestmark = pytest.mark.pairwise

ELEMENTS = ("tri3", "tri6", "quad4", "quad8", "quad9")


def two_blocks(element, kinematics, swap, upper_element=None, width=None, **options):
    lower = fc.generate.block_on_block(
        divisions_lower=(3, 2), divisions_upper=(4, 3), element=element, **({} if width is None else width)
    )
    model = elastic_model(lower, kinematics)
    for side in ("LOWER", "UPPER"):
        model.fix(f"{side}_LEFT", "x")
    model.fix("LOWER_BOTTOM", "y")
    model.prescribe("UPPER_TOP", y=-0.02)
    sides = ("CONT_UPPER", "CONT_LOWER") if swap else ("CONT_LOWER", "CONT_UPPER")
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar", **options)
    return model


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
@pytest.mark.parametrize("element", ELEMENTS)
def test_meshes_that_do_not_match_transmit_a_uniform_pressure_exactly(element, kinematics, swap):
    model = two_blocks(element, kinematics, swap)
    last = fc.solve(model, fc.linear_ramp(2))[-1]
    modulus = 1000.0 / (1 - 0.3**2) if kinematics == "plane_strain" else 1000.0
    expected = -modulus * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] - expected).max() < 1e-10 * abs(expected)
    assert np.abs(last.stress[:, 3]).max() < 1e-10 * abs(expected)
    assert last.contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_the_other_formulations_do_not(formulation):
    """What the mortar formulation is for: the others miss the uniform stress by several per cent."""
    model = two_blocks("quad4", "plane_strain", False)
    model.contact.clear()
    model.add_contact("pair", secondary="CONT_LOWER", primary="CONT_UPPER", formulation=formulation)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    expected = -1000.0 / (1 - 0.3**2) * 0.02 / np.ptp(model.mesh.points[:, 1])
    assert np.abs(last.stress[:, 1] / expected - 1).max() > 0.02


@pytest.mark.parametrize("letter", ["a", "b", "c"])
def test_mortar_on_the_training_case(letter, cases, forma04):
    model = forma04(fc.read_mesh(cases / f"forma04{letter}.med"), "mortar")
    contact = fc.solve(model, fc.linear_ramp(2))[-1].contact["hertz"]
    assert np.linalg.norm(contact.force) == pytest.approx(659_773.142, rel={"a": 5e-3, "b": 5e-4, "c": 1e-3}[letter])
    assert contact.pressure_max == pytest.approx(2910.4071, rel={"a": 0.03, "b": 0.01, "c": 0.005}[letter])
