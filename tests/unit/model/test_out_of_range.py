"""Numbers whose squares overflow are refused by name before any computation."""

import warnings

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc

SIZES = [1e61, 1e160, 1e308, 10**400, -1e300]


def spheres(y=-0.1, E=20_000.0):
    model = elastic_model(fc.generate.half_spheres("tri3", size=12.0), "axisymmetric", E=E, A1A2="x", A1B1="y")
    model.prescribe("A2B2", y=y)
    return model


def everywhere(value):
    return lambda x: np.full(len(x), float(value))


WAYS = {
    "displacement": lambda v: spheres(y=v),
    "displacement as a function": lambda v: fc.solve(spheres(y=everywhere(v)), 1),
    "pressure": lambda v: spheres().add_pressure("D1B1", v),
    "force": lambda v: spheres().add_force("A2B2", y=v),
    "clearance": lambda v: spheres().add_contact("pair", secondary="CONT1", primary="CONT2", clearance=v),
    "penalty": lambda v: spheres().add_contact("pair", secondary="CONT1", primary="CONT2", penalty=v),
    "ramp": lambda v: fc.solve(spheres(), [[0.0, 0.0], [1.0, v]]),
    "load factors": lambda v: fc.solve(spheres(), [abs(v)]),
}


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("way", WAYS)
def test_a_number_out_of_range_is_refused_by_its_name(way, size):
    if size == 10**400 and way == "displacement as a function":
        pytest.skip("no function of arrays returns it")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(fc.FastcontactError, match=r"out of range|must be|must hold") as caught:
            WAYS[way](size)
    assert len(str(caught.value)) < 400
    assert "not finite" not in str(caught.value)


@pytest.mark.parametrize("E", [1e61, 1e308, 10**400, 1e-61, 1e-320])
def test_a_modulus_out_of_range(E):
    with pytest.raises(fc.ModelError, match=r"out of range: it must lie between 1e-60 and 1e\+60|must be a number"):
        fc.LinearElastic(E=E, nu=0.3)


@pytest.mark.parametrize(("y", "E"), [(-1e-60, 1.0), (-1e50, 1e-40), (-0.1, 1e50), (-1e55, 1e55)])
def test_within_the_range_results_are_those_of_other_units(y, E):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fc.FastcontactWarning)
        found, expected = (fc.solve(spheres(*given), 1)[-1] for given in ((y, E), (-1.0, 1.0)))
    np.testing.assert_allclose(found.displacement / -y, expected.displacement, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.stress / (-y * E), expected.stress, rtol=1e-9, atol=1e-12)


def test_whole_numbers_of_any_length_are_refused():
    with pytest.raises(fc.ModelError, match="the argument steps of linear_ramp must be a whole number"):
        fc.linear_ramp(10**400)
    with pytest.raises(fc.ModelError, match="must be a number"):
        fc.linear_ramp(2, 10**400)
