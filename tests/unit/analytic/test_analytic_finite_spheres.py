"""Finite-body solution of two half spheres: table, interpolation, relation to Hertz."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import reference

from fastcontact.analytic import finite_half_spheres, finite_spheres
from fastcontact.errors import ModelError

REFERENCE = reference("finite_half_spheres")
QUANTITIES = ("force", "pressure_max", "radius")


@pytest.mark.parametrize("row", REFERENCE["degree_8_to_10"]["rows"])
def test_reproduces_the_precise_rows(row):
    spheres = finite_half_spheres(row[0])
    np.testing.assert_allclose([getattr(spheres, name) for name in QUANTITIES], row[1:], rtol=1e-12)


@pytest.mark.parametrize("row", REFERENCE["degree_4"]["rows"])
def test_two_independent_computations_agree(row):
    spheres = finite_half_spheres(row[0])
    found = np.array([getattr(spheres, name) for name in QUANTITIES])
    resolved = slice(0, 2) if row[0] == 0.002 else slice(0, 3)
    np.testing.assert_allclose(found[resolved], row[1:][resolved], rtol=3e-6)


def test_leaving_out_a_row_bounds_the_error_of_interpolation():
    table = finite_spheres._table()
    errors = {}
    for i in range(1, len(table) - 1):
        found = finite_spheres._interpolated(np.delete(table, i, axis=0), table[i, 0])
        errors[table[i, 0]] = np.abs(np.array(found) / table[i, 1:] - 1.0)
    worst = np.max(list(errors.values()), axis=0)
    large = np.max([error for x, error in errors.items() if x > 0.0079], axis=0)
    assert (worst < [2e-5, 2e-5, 4e-5]).all(), worst
    assert (large < [4e-6, 4e-6, 1e-5]).all(), large
    assert (worst > 1e-7).all()  # else the rows would not have been left out


def test_hertz_at_equal_force_and_at_equal_approach():
    spheres = finite_half_spheres(4.0)
    assert spheres.force / spheres.hertz.force == pytest.approx(1.12574, abs=1e-5)
    assert spheres.hertz.pressure_max == pytest.approx(2798.32867, rel=1e-8)
    equal_force = spheres.hertz.at_force(spheres.force)
    assert abs(spheres.pressure_max / equal_force.pressure_max - 1.0) < 3e-4
    assert abs(spheres.radius / equal_force.radius - 1.0) < 5e-3


def test_small_loads_tend_to_hertz():
    ratios = [finite_half_spheres(h) for h in (0.5, 0.05, 0.005)]
    excess = [s.force / s.hertz.force - 1.0 for s in ratios]
    assert excess[0] > 2.5 * excess[1] > 6.0 * excess[2] > 0.0


@given(approach=st.floats(4.001e-5, 0.0799), R=st.floats(1e-2, 1e2), E=st.floats(1e-2, 1e12))
def test_scales_with_radius_and_modulus(approach, R, E):
    one = finite_half_spheres(approach, R=1.0, E=1.0)
    other = finite_half_spheres(approach * R, R=R, E=E)
    assert other.force == pytest.approx(one.force * E * R**2, rel=1e-12)
    assert other.pressure_max == pytest.approx(one.pressure_max * E, rel=1e-12)
    assert other.radius == pytest.approx(one.radius * R, rel=1e-12)
    assert other.at_approach(other.approach).force == other.force


def test_grows_smoothly():
    approach = np.geomspace(0.002, 4.0, 80)
    force = np.array([finite_half_spheres(float(h)).force for h in approach])
    exponent = np.diff(np.log(force)) / np.diff(np.log(approach))
    assert (exponent > 1.5).all()
    assert (exponent < 1.57).all()
    # The exponent itself grows, without the waves of a bad interpolation.
    assert (np.diff(exponent) > 0.0).all()
    assert np.abs(np.diff(exponent, 2)).max() < 4e-4


@pytest.mark.parametrize("approach", [0.0019, 4.1])
def test_range_of_the_table_is_kept(approach):
    with pytest.raises(ModelError, match=r"runs from 4e-05 to 0\.08"):
        finite_half_spheres(approach)
