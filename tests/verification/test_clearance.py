"""Clearance and interference: the option has the effect of moving the bodies."""

import numpy as np
import pytest
from models import elastic_model
from pairwise import first_of
from two_bodies import blocks, boxes, held, touching

import fastcontact as fc

pytestmark = pytest.mark.each_value

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
LAST = fc.linear_ramp(1)


def difference(one, other):
    """How much two results differ, in their largest displacement and stress."""
    moved = np.abs(one.displacement - other.displacement).max() / np.abs(other.displacement).max()
    return max(moved, np.abs(one.stress - other.stress).max() / np.abs(other.stress).max())


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_clearance_is_a_body_moved_away(formulation, kinematics, swap):
    make = boxes if kinematics == "3d" else blocks
    moved = touching(held(make(apart=0.005), kinematics, 0.025), formulation, swap)
    clear = touching(held(make(), kinematics, 0.025), formulation, swap, clearance=0.005)
    one, other = (fc.solve(model, LAST)[-1] for model in (clear, moved))
    assert difference(one, other) < 1e-12
    assert one.contact["pair"].pressure == pytest.approx(other.contact["pair"].pressure, rel=1e-12)
    assert np.abs(one.contact["pair"].gap).max() < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_an_interference_presses_bodies_that_nothing_moves(formulation):
    model = touching(held(blocks(), approach=0.0), formulation, clearance=-0.02)
    pushed = touching(held(blocks(), approach=0.02), formulation)
    one, other = (fc.solve(m, LAST)[-1] for m in (model, pushed))
    assert np.abs(one.stress - other.stress).max() < 1e-12 * np.abs(other.stress).max()
    assert one.contact["pair"].pressure == pytest.approx(1000.0 / 0.91 * 0.02 / 10.0, rel=1e-12)


@pytest.mark.parametrize("kinematics", ["plane_strain", "3d"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_clearances_of_both_sides_add_up(formulation, kinematics):
    mesh = boxes() if kinematics == "3d" else blocks()
    models = [
        touching(held(mesh, kinematics), formulation, clearance=lambda x: 0.01 + 0 * x[:, 0], clearance_primary=-0.004),
        touching(held(mesh, kinematics), formulation, clearance=0.006),
    ]
    assert difference(*(fc.solve(model, LAST)[-1] for model in models)) < 1e-12


@pytest.mark.parametrize("formulation", first_of(1, FORMULATIONS))
def test_a_function_of_position_is_a_profile(formulation):
    """A wedge-shaped clearance is a tilted body, and the primary side's profile counts where it is faced."""

    def wedge(x):
        return 0.001 * x[:, 0]

    lower = blocks(lower=(6, 3), upper=(6, 3))
    tilted = lower.points.copy()
    upper = lower.points_of("UPPER")
    tilted[upper, 1] += 0.001 * tilted[upper, 0]
    options = {"projection_tolerance": 0.5}
    moved = touching(held(lower.replace(points=tilted)), formulation, **options)
    one = fc.solve(touching(held(lower), formulation, clearance=wedge, **options), LAST)[-1]
    two = fc.solve(touching(held(lower), formulation, clearance_primary=wedge, **options), LAST)[-1]
    exact = fc.solve(moved, LAST)[-1]
    assert 0 < np.abs(exact.contact["pair"].pressure).min() < 0.9 * exact.contact["pair"].pressure.max()
    # The tilt itself turns normals by 1e-3 and stretches the body by as much.
    assert difference(one, exact) < 5e-3
    assert difference(one, two) < 2e-3


def test_an_interference_may_grow_over_the_load_steps():
    ramp = [(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)]
    model = touching(held(blocks(), approach=0.0), "mortar", clearance=-0.02, clearance_ramp=ramp)
    steps = fc.solve(model, fc.Ramp((0.5, 1.0, 1.5, 2.0), ((0.0, 0.0), (2.0, 0.0))))
    largest = [step.contact["pair"].pressure_max for step in steps]
    assert largest[:3] == pytest.approx(np.array([0.5, 1.0, 0.5]) * 1000.0 / 0.91 * 0.02 / 10.0, rel=1e-12)
    assert largest[3] == pytest.approx(0.0, abs=1e-12 * largest[1])


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_an_obstacle_may_stand_off(formulation):
    forces = []
    for height, options in ((0.004, {}), (0.0, {"clearance": 0.004})):
        model = elastic_model(fc.generate.block((10.0, 5.0), (4, 2), "quad4"), "plane_strain", LEFT="x")
        model.prescribe("TOP", y=-0.02)
        floor = fc.obstacles.HalfSpace((0.0, -height), (0.0, 1.0))
        model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, formulation=formulation, **options)
        contact = fc.solve(model, LAST)[-1].contact["floor"]
        forces.append(contact.force[1])
        assert np.abs(contact.gap).max() < 1e-12
    assert forces[1] == pytest.approx(forces[0], rel=1e-12)
    assert forces[1] == pytest.approx(1000.0 / 0.91 * 0.016 / 5.0 * 10.0, rel=1e-12)
