"""A warning tells where the rotations of a thin body matter, and only there."""

import warnings

import numpy as np
import pytest

import fastcontact as fc

RADIUS, THICKNESS, FRICTION, SLACK = 40.0, 0.8, 0.25, 8.0


def belt(strain):
    """Return the tension at the end of a belt that is drawn over a quarter of a pulley by a twentieth of its radius."""
    strip = fc.generate.block((1.0, THICKNESS), (60, 1), "quad8")
    angle, radius = (1.0 - strip.points[:, 0]) * np.pi / 2, RADIUS + strip.points[:, 1]
    mesh = strip.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    model = fc.Model(mesh, kinematics="plane_strain", strain=strain)
    model.add_material(fc.LinearElastic(E=3000.0, nu=0.4))
    model.add_traction("LEFT", x=-SLACK / THICKNESS)
    model.prescribe("RIGHT", y=-2.0)
    pulley = fc.obstacles.Sphere((0.0, 0.0), RADIUS)
    model.add_obstacle("pulley", secondary="BOTTOM", obstacle=pulley, friction=FRICTION, formulation="node_to_segment")
    return -fc.solve(model, 6)[-1].reaction[mesh.points_of("RIGHT"), 1].sum()


def test_a_belt_drawn_far_needs_finite_strains():
    """With small strains the tension is too small, by about the ratio that the warning states (Euler and Eytelwein)."""
    theory = SLACK * np.exp(FRICTION * np.pi / 2)
    with pytest.warns(fc.FastcontactWarning, match=r"of up to 0\.049 radian matter in body 'BLOCK': .* 2\d% of"):
        linear = belt("small")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert belt("finite") == pytest.approx(theory, rel=0.02)  # bending lifts the ends
    assert linear < 0.95 * theory


@pytest.mark.parametrize("kinematics", ["plane_stress", "axisymmetric"])
def test_bending_stresses_do_no_work_on_neglected_strains(kinematics):
    """A slender bar or thin ring bends by twice its thickness, which linear kinematics describe well."""
    mesh = fc.generate.block((20.0, 0.5), (40, 2), "quad8", origin=(1000.0, 0.0))
    model = fc.Model(mesh, kinematics=kinematics)
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix("LEFT", "xy")
    model.prescribe("RIGHT", y=-1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        fc.solve(model, 1)
