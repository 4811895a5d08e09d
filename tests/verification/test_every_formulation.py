"""One test for every contact formulation; every new formulation must pass it."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.contact.formulations import FORMULATIONS

EVERY = pytest.mark.parametrize("formulation", FORMULATIONS)


def pressed(formulation, *, push=0.02, swap=False):
    """Two blocks with matching meshes, the upper one pushed down."""
    mesh = fc.generate.block_on_block(divisions_lower=(4, 2), divisions_upper=(4, 2))
    model = elastic_model(mesh, "plane_strain", nu=0.0, LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.0, "y": -push})
    sides = ("CONT_LOWER", "CONT_UPPER") if swap else ("CONT_UPPER", "CONT_LOWER")
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation=formulation)
    return fc.solve(model, fc.linear_ramp(2))[-1]


@EVERY
@pytest.mark.parametrize("swap", [False, True])
def test_a_uniform_pressure_passes_between_matching_meshes(formulation, swap):
    last = pressed(formulation, swap=swap)
    contact = last.contact["pair"]
    assert np.abs(last.stress[:, 1] + 2.0).max() < 1e-10 * 2.0
    assert contact.pressure == pytest.approx(2.0, rel=1e-10)
    assert contact.active.all()
    assert np.abs(contact.gap).max() < 1e-12
    assert np.abs(contact.force[1]) == pytest.approx(20.0, rel=1e-10)
    assert contact.force_vectors.sum(axis=0) == pytest.approx(contact.force, abs=1e-9)


@EVERY
@pytest.mark.filterwarnings("ignore:contact .* never closed")
def test_bodies_drawn_apart_carry_nothing(formulation):
    last = pressed(formulation, push=-0.02)
    contact = last.contact["pair"]
    assert not contact.active.any()
    assert not contact.pressure.any()
    assert contact.gap == pytest.approx(0.02, rel=1e-9)
    assert np.abs(last.stress).max() < 1e-12 * 1000.0


@EVERY
def test_forces_balance_on_meshes_that_do_not_match(formulation, forma04):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(1.0, 6.0), segments=5)
    last = fc.solve(forma04(mesh, formulation), fc.linear_ramp(2))[-1]
    push = last.contact["hertz"].force[1]
    top = last.reaction[mesh.points_of("A2B2"), 1].sum()
    bottom = last.reaction[mesh.points_of("A1B1"), 1].sum()
    assert top == pytest.approx(-bottom, rel=1e-9)
    assert abs(push) == pytest.approx(abs(top), rel=1e-9)
    assert abs(push) == pytest.approx(659_773.0, rel=0.01)
