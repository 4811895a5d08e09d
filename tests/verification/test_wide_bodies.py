"""Contacts much smaller than the bodies: facets far away are much longer than those in contact."""

import numpy as np
import pytest
from graded import graded_block, lines
from models import elastic_model

import fastcontact as fc


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
