"""Results of a load step: gaps of the solved pairing, distances independent of the steps, work."""

import numpy as np
import pytest
from models import elastic_model, supported, united

import fastcontact as fc
from fastcontact.analysis.problem import prepare
from fastcontact.contact.configuration import Configuration
from fastcontact.mesh.generate import block, box

FORMULATIONS = ("node_to_segment", "continuous", "mortar")


def two_blocks(wide=2.0):
    """A small block on a wide one, whose sides have the prefixes U_ and L_."""
    mesh = united(L_=block((wide, 0.5), (7, 2), origin=(0.0, -0.5)), U_=block((1.0, 0.5), (4, 2)))
    return elastic_model(mesh, "plane_strain", L_BOTTOM="xy")


@pytest.mark.filterwarnings("ignore:the largest", "ignore:.*across its radius")
@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar"])
def test_with_a_kept_pairing_gaps_are_those_of_that_pairing(formulation):
    """A facet that turns as bodies slide: on the undeformed mesh closed nodes have no gap, on the deformed one they do."""
    model = two_blocks()
    model.prescribe("U_TOP", x=0.3, y=-0.05)
    model.add_contact("c", secondary="U_BOTTOM", primary="L_TOP", formulation=formulation)
    (step,) = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(keep_pairing=True))
    contact = step.contact["c"]
    flat = model.mesh.points[contact.points]
    top = model.mesh.points_of("L_TOP")
    ordered = top[np.argsort(model.mesh.points[top, 0])]
    beneath = np.interp(flat[:, 0], model.mesh.points[ordered, 0], step.displacement[ordered, 1])
    expected = step.displacement[contact.points, 1] - beneath
    np.testing.assert_allclose(contact.gap, expected, atol=1e-12)
    np.testing.assert_allclose(contact.normal, np.tile([0.0, 1.0], (len(flat), 1)), atol=1e-14)
    if formulation == "node_to_segment":
        assert np.abs(contact.gap[contact.active]).max() < 1e-12


@pytest.mark.filterwarnings("ignore:contact .* is lost", "ignore:.*across its radius", "ignore:the largest")
@pytest.mark.filterwarnings("ignore:the energy of these load steps")  # what it leaves springs back at once
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_closed_once_is_remembered_beside_the_other_side(formulation):
    """A block slides off the end of the other one while it is closed for good, comes back, and is pulled: it holds."""
    model = two_blocks(wide=1.5)
    model.prescribe("U_TOP", x=1.2, ramp=((0.0, 0.0), (1.0, 0.0), (2.0, 1.0), (3.0, 0.0), (4.0, 0.0)))
    model.prescribe("U_TOP", y=-0.01, ramp=((0.0, 0.0), (1.0, 1.0), (2.0, 1.0), (3.0, 1.0), (4.0, -1.0)))
    options = {"projection_tolerance": 0.0} if formulation != "mortar" else {}
    model.add_contact(
        "c", secondary="U_BOTTOM", primary="L_TOP", formulation=formulation, kind="bilateral_once_closed", **options
    )
    ramp = fc.Ramp((1.0, 2.0, 3.0, 4.0), table=((0.0, 0.0), (4.0, 4.0)))
    steps = fc.solve(model, ramp)
    first, beside, _, pulled = (step.contact["c"].active for step in steps)
    assert first.all()
    assert not beside.all()
    assert pulled.all()
    assert steps[-1].contact["c"].force[1] < 0.0


def test_linear_solutions_without_contact_are_counted():
    model = two_blocks()
    supported(model, U_TOP={"x": 0.0, "y": -0.01}, U_BOTTOM="y")
    (step,) = fc.solve(model, fc.linear_ramp(1), linear_solver="direct")
    assert step.iterations["linear_iterations"] >= 1


def test_closing_slip_is_finite_where_both_normals_are_the_same():
    """The upper block lies on its back: no direction lies between the normals of the sides, and nothing is added."""
    model = two_blocks()
    model.add_contact("c", secondary="U_BOTTOM", primary="L_TOP", formulation="node_to_segment", friction=0.3)
    model.prescribe("U_TOP", x=0.0, y=-0.01)
    pair = prepare(model, fc.linear_ramp(1), fc.Criteria()).pairs["c"]
    points = model.mesh.points
    turned = np.where(
        (points[:, 1] > 0.0)[:, None] | np.isin(np.arange(len(points)), pair.secondary.points)[:, None], 1, 0
    )
    displacement = turned * ([1.0, 0.0] - 2.0 * points)
    constraints = pair.constraints(Configuration.displaced(displacement))
    assert constraints.usable.any()
    assert np.abs(constraints.slip0).max() == 0.0


@pytest.mark.filterwarnings("ignore:.*across its radius")
def test_where_bodies_meet_first_does_not_depend_on_the_steps_before():
    """A ball that comes down at a slant meets the block where it is then, not where it was after the first step."""
    found = []
    for instants in ((0.7, 1.0), (0.1, 0.2, 0.6, 0.7, 1.0)):
        model = elastic_model(box((4.0, 2.0, 1.0), (12, 6, 2), origin=(-1.0, -1.0, -1.0)), "3d", ZMIN="xyz")
        ball = fc.obstacles.Sphere((0.0, 0.0, 2.0624), 2.0)
        model.add_obstacle("ball", secondary="ZMAX", obstacle=ball, motion={"x": 1.0, "z": -0.1})
        found.append(fc.solve(model, fc.Ramp(instants))[-1].contact["ball"])
    assert found[0].active.any()
    np.testing.assert_array_equal(found[0].abscissa, found[1].abscissa)
    place = np.abs(found[0].coordinates[np.argmin(found[0].abscissa), 0] - 0.7)
    assert place < 0.2
