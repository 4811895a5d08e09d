"""Without a support the axis of an axisymmetric model remains closed, and the description says so."""

import logging

import pytest
from models import elastic_model, supported

import fastcontact as fc
from fastcontact.mesh.generate import block, half_spheres


def spheres(mesh, held, **contact):
    model = elastic_model(mesh, "axisymmetric", E=20_000.0)
    if held:
        model.fix("A1A2", "x")
    supported(model, A2B2={"y": -0.2}, A1B1={"y": 0.2})
    model.add_contact("c", secondary="CONT1", primary="CONT2", **contact)
    return fc.solve(model, fc.linear_ramp(1))[-1]


@pytest.mark.each_value
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar", None])
@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6"])
def test_results_are_those_of_the_model_whose_axis_is_held(element, formulation):
    sizes = {"size": 16.0} if element.startswith("tri") else {"arc_sizes": (8.0, 16.0), "radial_sizes": (8.0, 16.0)}
    mesh = half_spheres(element, **sizes)
    if element == "tri6" and formulation == "node_to_segment":
        pytest.skip("node-to-segment refuses facets whose corner nodes carry no pressure")
    free, held = (spheres(mesh, held, formulation=formulation) for held in (False, True))
    assert (free.displacement == held.displacement).all()
    assert (free.reaction == held.reaction).all()
    assert (free.displacement[mesh.points_of("A1A2"), 0] == 0.0).all()
    assert (free.contact["c"].pressure == held.contact["c"].pressure).all()


def cylinder(inner=0.0):
    return elastic_model(block((1.0, 1.0), (2, 2), origin=(inner, 0.0)), "axisymmetric", BOTTOM="y")


def test_one_line_says_which_nodes_are_held(caplog):
    with caplog.at_level(logging.INFO, "fastcontact"):
        cylinder().check()
    assert [r.message for r in caplog.records] == [
        "axis of symmetry: x is held at zero at 3 nodes with x = 0 (first: point 0)"
    ]
    caplog.clear()
    held = cylinder()
    held.fix("LEFT", "x")
    ring = cylinder(inner=0.1)
    with caplog.at_level(logging.INFO, "fastcontact"):
        held.check()
        ring.check()
    assert not caplog.records


def test_a_disc_under_pressure_on_its_rim_is_lame():
    """Without a hole the radial displacement is linear: u = -p r (1 - nu) / E under plane stress."""
    model = cylinder()
    model.add_pressure("RIGHT", 10.0)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    radius = model.mesh.points[:, 0]
    assert step.displacement[:, 0] == pytest.approx(-10.0 * radius * 0.7 / 1000.0, abs=1e-12)


def test_a_hole_opens_under_pressure():
    model = cylinder(inner=0.1)
    model.add_pressure("LEFT", 10.0)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert (step.displacement[model.mesh.points_of("LEFT"), 0] > 0.0).all()


def test_nodes_of_single_precision_are_on_the_axis_and_others_not():
    points = cylinder().mesh.points.copy()
    left = cylinder().mesh.points_of("LEFT")
    points[left[0], 0], points[left[1], 0] = 4e-8, 1e-3
    model = fc.Model(cylinder().mesh.replace(points=points), "axisymmetric")
    assert model.axis_nodes.tolist() == [left[0], left[2]]
    plane = fc.Model(cylinder().mesh, "plane_strain")
    assert not len(plane.axis_nodes)


def test_a_support_that_moves_the_axis_is_refused():
    model = cylinder()
    model.prescribe("TOP", x=0.1)
    with pytest.raises(fc.ModelError, match=r"x = 0.1 is prescribed at point 2 on the axis of symmetry"):
        model.check()


def test_a_function_of_the_radius_that_vanishes_on_the_axis_is_not():
    model = cylinder()
    model.prescribe("TOP", x=lambda points: 0.1 * (points[:, 0] + 1e-12))
    model.check()
    fixed, values = model.prescribed()
    corner = model.mesh.point("TOP_LEFT")
    assert fixed[corner, 0]
    assert values[corner, 0] == 0.0


def test_a_relation_that_moves_the_axis_is_refused():
    model = cylinder()
    model.relate([("TOP_LEFT", "x", 1.0)], 0.1)
    with pytest.raises(fc.ModelError, match="contradicts"):
        model.check()


def test_a_radial_traction_on_the_axis_goes_into_it():
    """Facets that reach the axis carry the traction; at r = 0 nothing moves."""
    model = cylinder()
    model.add_traction("TOP", x=1.0)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert not step.displacement[model.mesh.points_of("LEFT"), 0].any()
    assert step.displacement[model.mesh.point("TOP_RIGHT"), 0] > 0.0
