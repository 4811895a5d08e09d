"""Swapping the two sides of a mortar contact changes results by less than the discretisation error."""

from functools import cache

import numpy as np
import pytest
from models import elastic_model, supported
from pairwise import first_of

import fastcontact as fc

pytestmark = pytest.mark.each_value


@cache
def pressed(element, size, swap, multipliers="standard"):
    """Force and largest von Mises stress of a cylinder on a stiffer block."""
    mesh = fc.generate.cylinder_on_block(element, R=50.0, size=6.0, contact_size=size)
    model = elastic_model(mesh, "plane_strain")
    model.add_material(fc.LinearElastic(E=3000.0, nu=0.2), "BLOCK")
    supported(model, AXIS="x", BLOCK_BOTTOM="y", CYLINDER_TOP={"y": -1.0})
    sides = ("CONT_BLOCK", "CONT_CYLINDER")[:: 1 if swap else -1]
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar", multipliers=multipliers)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    return np.array([abs(last.contact["pair"].force[1]), last.von_mises.max()])


@pytest.mark.parametrize("multipliers", ["standard", "dual"])
@pytest.mark.parametrize("element", first_of(2, ["tri3", "quad4", "quad8"]))
def test_swapping_the_sides_of_mortar_changes_less_than_the_mesh_does(element, multipliers):
    exact = pressed("quad8", 0.15, False)
    swapped, meshed = [], []
    for size in (1.6, 0.8):
        one, other = (pressed(element, size, swap, multipliers) for swap in (False, True))
        swapped.append(np.abs(one / other - 1))
        meshed.append(max(np.abs(one / exact - 1)[1], np.abs(other / exact - 1)[1]))
        assert swapped[-1][1] < 0.2 * meshed[-1]
    assert swapped[-1].max() < 2e-3
    assert meshed[1] < 0.5 * meshed[0]


def test_swapping_the_sides_in_space():
    forces = []
    for swap in (False, True):
        mesh = fc.generate.sphere_on_block(
            "hex8", size=12.5, contact_size=2.0, contact_radius=6.0, block_size=(30.0, 30.0)
        )
        model = elastic_model(mesh, "3d", SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -0.5})
        sides = ("CONT_BLOCK", "CONT_SPHERE")[:: 1 if swap else -1]
        model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar")
        forces.append(fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1].contact["pair"].force[1])
    assert forces[0] == pytest.approx(-forces[1], rel=2e-3)
