"""Prescribed temperatures refer to the reference temperature of the model."""

import pytest

import fastcontact as fc


@pytest.mark.parametrize(("options", "rise"), [({}, 60.0), ({"reference": 0.0}, 80.0)])
def test_a_free_block_expands_by_the_rise_over_the_reference(options, rise):
    model = fc.Model(fc.generate.block(), kinematics="plane_stress", reference_temperature=20.0)
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3, expansion=1e-5))
    model.fix("LEFT", "x")
    model.fix("BOTTOM", "y")
    model.add_temperature(80.0, **options)
    assert fc.solve(model, 1)[-1].displacement.max() == pytest.approx(1e-5 * rise, rel=1e-9)
