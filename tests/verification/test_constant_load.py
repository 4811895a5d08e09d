"""Load steps with constant load: forces and displacements do not change, also with friction."""

import numpy as np
import pytest
from two_bodies import blocks, boxes, touching

import fastcontact as fc

RAMP = fc.Ramp((0.5, 1.0, 2.0, 3.0, 4.0), ((0.0, 0.0), (1.0, 1.0), (9.0, 1.0)))
FORMULATIONS = [
    {"formulation": "continuous"},
    {"formulation": "mortar", "multipliers": "standard"},
    {"formulation": "mortar", "multipliers": "dual"},
    {"formulation": "node_to_segment"},
    {"formulation": "continuous", "tangential_penalty": 2e4},
]


def changes(model, name, first=1):
    """By how much tangential forces change in the steps after the load has come to rest, over the largest force."""
    steps = fc.solve(model, RAMP)
    shear = [step.contact[name].force_vectors for step in steps[first:]]
    assert np.abs(steps[first].contact[name].shear).max() > 0.05 * steps[first].contact[name].pressure.max()
    return max(np.abs(later - shear[0]).max() / np.abs(shear[0]).max() for later in shear[1:])


@pytest.mark.each_value
@pytest.mark.parametrize("elements", ["tri3", "quad4", "quad8"])
@pytest.mark.parametrize("options", [FORMULATIONS[i] for i in (0, 2, 3, 4)], ids=str)
def test_ball_on_block(elements, options):
    mesh = fc.generate.graded_block(elements, width=10.0, depth=10.0, contact_radius=1.2, contact_size=0.2)
    model = fc.Model(mesh, kinematics="axisymmetric")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("SYMMETRY_X", "x")
    model.fix("BOTTOM", "xy")
    ball = fc.obstacles.Sphere(centre=(0, 10.0), R=10.0)
    model.add_obstacle("ball", secondary="CONTACT", obstacle=ball, motion={"y": -0.1}, friction=0.3, **options)
    assert changes(model, "ball") < 1e-4


@pytest.mark.each_value
@pytest.mark.parametrize("options", FORMULATIONS, ids=str)
@pytest.mark.parametrize("elements", ["quad4", "tri6", "hex8"])
def test_stiff_body_on_soft_one(elements, options):
    """Pressed on each other and pulled along, so that some parts of the sides slide and others stick."""
    space = elements == "hex8"
    mesh = boxes(elements, (3, 2, 2), (4, 3, 2)) if space else blocks(elements, (8, 4), (6, 3))
    model = fc.Model(mesh, "3d" if space else "plane_strain")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    below, above = ("L_ZMIN", "U_ZMAX") if space else ("LOWER_BOTTOM", "UPPER_TOP")
    model.add_material(fc.LinearElastic(E=5000.0, nu=0.1), "U_BOX" if space else "UPPER")
    model.fix(below, "xyz" if space else "xy")
    model.prescribe(above, **{"z" if space else "y": -0.2, "x": 0.05, **({"y": 0.0} if space else {})})
    touching(model, friction=0.3, **options)
    assert changes(model, "pair") < 1e-4
