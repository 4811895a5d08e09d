"""A rigid flat punch on a half-plane with friction (Spence 1973): the stick zone does not depend on the load.

The stick zone is that of solutions by boundary elements in which shear changes the pressure; the formula of the
literature, which leaves that out, is up to half as large again.
"""

import numpy as np
import pytest
from graded import graded_block, lines
from models import elastic_model, reference

import fastcontact as fc

REFERENCE = reference("punch_2d")["stick"]
E, DEPTH = 1000.0, 1e-3
EXTENT = 1000.0  # of the body: its far sides are felt as 1 / EXTENT


def pressed(nu, friction, n=60, formulation="node_to_segment", steps=1):
    """Half of the body, n facets under half of the punch |x| < 1, ever shorter towards its edge."""
    beneath = np.sin(np.linspace(0.0, np.pi / 2, n + 1))
    shortest = beneath[-1] - beneath[-2]
    x = np.concatenate([beneath, 1.0 + lines(shortest, 0.0, EXTENT - 1.0, growth=1.3)[1:]])
    y = -lines(shortest, 0.0, EXTENT, growth=1.3)[::-1]
    model = elastic_model(graded_block(x, y, "quad4"), "plane_strain", E=E, nu=nu, LEFT="x", BOTTOM="y")
    model.add_obstacle(
        "punch", secondary="TOP", obstacle=fc.obstacles.FlatPunch(1.0), motion={"y": -DEPTH},
        formulation=formulation, friction=friction,
    )  # fmt: skip
    return [step.contact["punch"] for step in fc.solve(model, fc.linear_ramp(steps))]


def stick_zone(contact):
    """Last node that sticks, first one that slips."""
    x, stick = contact.coordinates[:, 0], contact.active & contact.sticking
    assert stick[x <= x[stick].max()].all()
    return x[stick].max(), x[contact.active & ~stick].min()


def in_table(row):
    """Stick zone of the finer of the two solutions by boundary elements, and half its uncertainty: one element."""
    ratio = row[REFERENCE["columns"].index("c/a coupled, 400")]
    return ratio, np.cos(np.arcsin(ratio)) * np.pi / 400


@pytest.mark.parametrize("row", REFERENCE["rows"], ids=lambda row: f"nu={row[0]}, f={row[1]}")
def test_stick_zone_is_that_of_the_coupled_table(row):
    (contact,) = pressed(row[0], row[1])
    inside, outside = stick_zone(contact)
    ratio, element = in_table(row)
    uncertain = element + 0.5 * (outside - inside)
    assert inside - uncertain <= ratio <= outside + uncertain
    formula = fc.analytic.spence_stick_ratio(nu=row[0], friction=row[1])
    if formula - ratio > 4 * uncertain:
        assert outside < formula


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_stick_zone_does_not_depend_on_the_load(formulation):
    """Nor on the number of steps; it is the same in the other formulation."""
    row = next(row for row in REFERENCE["rows"] if row[:2] == [0.2, 0.5])
    found = [stick_zone(contact) for contact in pressed(0.2, 0.5, formulation=formulation, steps=4)]
    assert len(set(found)) == 1
    ratio, element = in_table(row)
    assert found[0][0] - element <= ratio <= found[0][1] + element


def test_shear_lies_on_the_cone_outside_the_stick_zone_and_pulls_inward_everywhere():
    (contact,) = pressed(0.2, 0.5)
    x = contact.coordinates[:, 0]
    slides = contact.active & ~contact.sticking
    shear, pressure = contact.shear[:, 0], contact.pressure
    assert shear[slides] == pytest.approx(0.5 * pressure[slides], rel=1e-9)
    assert (shear[contact.active & contact.sticking & (x > 0)] > 0).all()  # on the body: it would draw together


@pytest.mark.parametrize("nu", [0.0, 0.3])
@pytest.mark.filterwarnings("ignore:the friction of contact")
def test_much_friction_bonds_the_punch(nu):
    """Muskhelishvili's tractions, but at the edge, where they would oscillate."""
    (contact,) = pressed(nu, 100.0)
    force = 2 * np.abs(contact.force[1])
    exact = fc.analytic.flat_punch_2d(nu=nu, half_width=1.0, force=force, bonded=True)
    x = contact.coordinates[:, 0]
    middle = (x > 0) & (x < 0.9)
    assert contact.sticking[middle].all()
    assert contact.pressure[middle] == pytest.approx(exact.pressure(x[middle]), rel=0.01)
    assert contact.shear[middle, 0] == pytest.approx(exact.shear(x[middle]), rel=0.02)
