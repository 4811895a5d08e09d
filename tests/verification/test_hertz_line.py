"""Line contact in plane strain and Hertz at equal force: a rigid cylinder on a block, a half-cylinder on a plane."""

import numpy as np
import pytest
from graded import graded_block, lines
from models import elastic_model, made_of, with_obstacle

import fastcontact as fc

E, NU, R = 1000.0, 0.3, 100.0


def measured(contact, radius_of):
    """Force of both halves, pressure at the pole, and half-width from the first moment of the pressure.

    Under Hertz's pressure the mean distance of the force from the middle is 4 / (3 pi) of the half-width.
    """
    push = contact.force_vectors[:, 1] * np.sign(contact.force[1])
    distance = np.abs(contact.coordinates[:, 0])
    return 2 * push.sum(), contact.pressure[np.argmin(distance)], radius_of(push @ distance / push.sum())


def against_hertz(element, formulation, size):
    """Relative errors of pressure and half-width of a block under a parabola, in half-widths of 1 about; growth 0.3."""
    mesh = fc.generate.graded_block(element, width=20.0, contact_radius=1.25, contact_size=size, growth=0.3)
    model = elastic_model(mesh, "plane_strain", E=E, nu=NU, SYMMETRY_X="x", BOTTOM="y")
    with_obstacle(model, "hertz", "CONTACT", fc.obstacles.paraboloid(R), motion={"y": -0.025}, formulation=formulation)
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["hertz"]
    force, pressure, half_width = measured(contact, lambda mean: 0.75 * np.pi * mean)
    theory = fc.analytic.hertz_line(E1=E, nu1=NU, R1=R, force=force)
    inner, outer = contact.radius
    assert inner - size < theory.radius < outer + size
    return abs(pressure / theory.pressure_max - 1), abs(half_width / theory.radius - 1)


@pytest.mark.parametrize(("element", "formulation", "size", "bound"), [
    ("quad4", "node_to_segment", 0.1, 3e-3),
    ("quad4", "continuous", 0.1, 3e-3),
    ("quad8", "continuous", 0.2, 1e-3),
    ("quad9", "continuous", 0.2, 1e-3),
    ("tri6", "continuous", 0.1, 5e-3),
])  # fmt: skip
def test_a_rigid_cylinder_on_a_block_is_hertz_at_equal_force(element, formulation, size, bound):
    """What is left of quadratic elements, 4e-4, is the block of 20 half-widths that stands for a half-plane."""
    assert max(against_hertz(element, formulation, size)) < bound


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_a_cylinder_driven_by_its_force_on_an_elastic_block(formulation):
    """Two bodies of different stiffness; contact carries the force given, pressure and half-width are Hertz's."""
    bodies = {"E1": 1000.0, "nu1": 0.3, "E2": 4000.0, "nu2": 0.2}
    theory = fc.analytic.hertz_line(**bodies, R1=50.0, radius=2.0)
    mesh = fc.generate.cylinder_on_block("quad8", R=50.0, size=8.0, contact_size=0.25)
    materials = {"CYLINDER": fc.LinearElastic(E=1000.0, nu=0.3), "BLOCK": fc.LinearElastic(E=4000.0, nu=0.2)}
    model = made_of(mesh, "plane_strain", materials, AXIS="x", BLOCK_BOTTOM="y")
    model.couple("CYLINDER_TOP", "y")
    model.add_force("CYLINDER_TOP", y=-theory.force / 2)
    model.add_contact("hertz", secondary="CONT_CYLINDER", primary="CONT_BLOCK", formulation=formulation)
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["hertz"]
    force, pressure, half_width = measured(contact, lambda mean: 0.75 * np.pi * mean)
    assert force == pytest.approx(theory.force, rel=1e-8)
    if formulation != "node_to_segment":  # which oscillates on quadratic facets
        assert pressure == pytest.approx(theory.pressure_max, rel=0.01)
    assert half_width == pytest.approx(theory.radius, rel=0.01)


# Contacts much smaller than the bodies: facets far away are much longer than those in contact.


def pressed(width, kinematics, element, **options):
    """Return the contact of a ball or cylinder of radius 10 with a layer whose upper edge has facets of 0.04 to 1.6."""
    mesh = graded_block(lines(0.04, 1.6, width, 1.3), -lines(0.08, 0.4, 10.0, 1.4)[::-1], element)
    model = elastic_model(mesh, kinematics, BOTTOM="xy", LEFT="x")
    ball = fc.obstacles.Sphere((0.0, 10.0), 10.0)
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, motion={"y": -0.0175}, **options)
    step = fc.solve(model, 1)[-1]
    return step, step.contact["ball"]


@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize(
    "options", [{}, {"formulation": "mortar"}, {"friction": 0.3, "formulation": "node_to_segment"}]
)
@pytest.mark.parametrize(("kinematics", "widths"), [("axisymmetric", (30.0, 90.0)), ("plane_strain", (300.0, 3000.0))])
def test_pressures_do_not_depend_on_the_length_of_facets_far_away(kinematics, widths, element, options):
    (_, narrow), (step, wide) = (pressed(width, kinematics, element, **options) for width in widths)
    n = int(narrow.active.sum())
    assert n == wide.active.sum() > 5
    assert np.abs(wide.pressure[:n] - narrow.pressure[:n]).max() < 2e-3 * narrow.pressure_max
    assert np.abs(wide.shear[:n] - narrow.shear[:n]).max() < 2e-3 * narrow.pressure_max
    assert np.allclose(wide.radius, narrow.radius, rtol=1e-9)
    assert not any("across its radius" in text for text in step.warnings)
