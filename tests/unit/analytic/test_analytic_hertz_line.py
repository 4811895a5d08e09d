"""Hertz contact of cylinders compared with tables, integrals and the equations of elasticity."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import assert_largest, derivative, reference

from fastcontact.analytic import hertz_line

pytestmark = pytest.mark.pairwise

REFERENCE = reference("hertz_line")


@pytest.fixture
def unit():
    """Contact with b = 2 and p0 = 1 on a body with nu = 0.3."""
    return hertz_line(E1=1.0, nu1=0.3, R1=1.0 / 0.91, radius=2.0)


def test_nafems_roller():
    case = REFERENCE["nafems_cylinder"]
    roller = hertz_line(
        E1=case["E1"], nu1=case["nu1"], R1=case["R1"], E2=case["E2"], nu2=case["nu2"], force=case["force"]
    )
    assert roller.half_width == pytest.approx(case["half_width"], rel=1e-14)
    assert roller.pressure_max == pytest.approx(case["pressure_max"], rel=1e-14)


def test_stress_on_axis_matches_table(unit):
    rows = np.array(REFERENCE["axis"]["rows"])
    stress = unit.stress_on_axis(rows[:, 0] * unit.radius)
    np.testing.assert_allclose(stress[:, 0], rows[:, 1], atol=1e-14)
    np.testing.assert_allclose(stress[:, 1], rows[:, 2], atol=1e-14)
    np.testing.assert_allclose(stress[:, 2], 0.3 * (rows[:, 1] + rows[:, 2]), atol=1e-14)


def test_von_mises_maximum_matches_table(unit):
    for nu, value, depth in REFERENCE["von_mises_maximum"]["rows"]:
        found = unit.von_mises_maximum(nu)
        assert found.value == pytest.approx(value, abs=1e-10)
        assert found.depth / unit.radius == pytest.approx(depth, abs=1e-7)


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.19, 0.2, 0.3, 0.5])
def test_von_mises_maximum_is_the_largest_anywhere(unit, nu):
    assert_largest(unit, nu)


def test_largest_shear_on_axis(unit):
    case = REFERENCE["largest_shear"]
    stress = unit.stress_on_axis(np.linspace(0.7, 0.9, 2001) * unit.radius)
    shear = 0.5 * np.abs(stress[:, 0] - stress[:, 1])
    assert shear.max() == pytest.approx(case["value"], abs=5e-6)
    assert np.linspace(0.7, 0.9, 2001)[shear.argmax()] == pytest.approx(case["depth/b"], abs=1e-4)


def test_surface_stress_is_the_pressure(unit):
    x = np.linspace(-2.0, 2.0, 81) * unit.radius
    stress = unit.surface_stress(x)
    np.testing.assert_allclose(stress[:, 0], -unit.pressure(x), atol=1e-14)
    np.testing.assert_allclose(stress[:, 1], -unit.pressure(x), atol=1e-14)
    np.testing.assert_allclose(stress[:, 2], -0.6 * unit.pressure(x), atol=1e-14)
    np.testing.assert_allclose(stress[:, 3], 0.0, atol=1e-14)


def test_surfaces_of_both_bodies_close_the_gap():
    hertz = hertz_line(E1=1e5, nu1=0.3, R1=10.0, E2=3e5, nu2=0.2, R2=40.0, force=1e3)
    x = np.linspace(-3.0, 3.0, 121) * hertz.radius
    sunk = -hertz.surface_displacement(x)[:, 1] - hertz.surface_displacement(x, body=2)[:, 1]
    gap = x**2 / (2.0 * hertz.R_effective) + sunk
    scale = hertz.radius**2 / hertz.R_effective
    np.testing.assert_allclose(gap[np.abs(x) <= hertz.radius] / scale, 0.0, atol=1e-14)
    assert (gap[np.abs(x) > 1.001 * hertz.radius] > 0.0).all()


def test_pressure_integrates_to_the_force(unit):
    theta = (np.arange(50) + 0.5) * math.pi / 50 - 0.5 * math.pi
    integral = (unit.pressure(unit.radius * np.sin(theta)) * unit.radius * np.cos(theta)).mean() * math.pi
    assert integral == pytest.approx(unit.force, rel=1e-13)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
@pytest.mark.parametrize("point", [(0.3, -0.2), (-1.0, -1.0), (2.4, -0.3), (-3.0, -5.0), (12.0, -15.0)])
@pytest.mark.parametrize("nu", [-0.4, 0.0, 0.3, 0.49])
def test_field_is_in_equilibrium_and_follows_hooke(point, nu, kinematics):
    E, h = 3.0, 2e-3
    hertz = hertz_line(E1=E, nu1=nu, R1=5.0, radius=2.0, kinematics=kinematics)
    point = np.array(point)
    xx, yy, zz, xy = hertz.stress(*point)
    d_x = derivative(hertz.stress, point, np.array([h, 0.0]))
    d_y = derivative(hertz.stress, point, np.array([0.0, h]))
    scale = hertz.pressure_max
    assert d_x[0] + d_y[3] == pytest.approx(0.0, abs=1e-8 * scale)
    assert d_x[3] + d_y[1] == pytest.approx(0.0, abs=1e-8 * scale)

    u_x = derivative(hertz.displacement, point, np.array([h, 0.0]))
    u_y = derivative(hertz.displacement, point, np.array([0.0, h]))
    strain = [(xx - nu * (yy + zz)) / E, (yy - nu * (xx + zz)) / E]
    np.testing.assert_allclose([u_x[0], u_y[1]], strain, atol=1e-9 * scale)
    assert u_x[1] + u_y[0] == pytest.approx(2.0 * (1.0 + nu) / E * xy, abs=1e-9 * scale)
    out_of_plane = (zz - nu * (xx + yy)) / E if kinematics == "plane_strain" else zz
    assert out_of_plane == pytest.approx(0.0, abs=1e-14 * scale)


def test_far_stress_is_that_of_a_line_force(unit):
    x, y, rho2 = 3e4, -4e4, 25e8
    factor = 2.0 * unit.force * y / (math.pi * rho2**2)
    np.testing.assert_allclose(unit.stress(x, y)[[0, 1, 3]], factor * np.array([x * x, y * y, x * y]), rtol=1e-7)


def test_field_is_symmetric(unit):
    x, y = np.array([0.3, 2.0, 5.0]), np.array([0.0, -0.0, -1.0])
    np.testing.assert_allclose(unit.displacement(-x, y), unit.displacement(x, y) * [-1.0, 1.0], atol=1e-15)
    np.testing.assert_allclose(unit.stress(-x, y), unit.stress(x, y) * [1.0, 1.0, 1.0, -1.0], atol=1e-15)


def test_thin_discs_are_softer_than_long_cylinders():
    strain = hertz_line(E1=1e5, nu1=0.3, R1=10.0, force=100.0)
    stress = hertz_line(E1=1e5, nu1=0.3, R1=10.0, force=100.0, kinematics="plane_stress")
    assert stress.half_width / strain.half_width == pytest.approx(math.sqrt(1.0 / 0.91), rel=1e-14)


positive = st.floats(1e-3, 1e3)


@given(E=positive, nu=st.floats(-0.9, 0.5), R=positive, force=positive)
def test_every_load_quantity_leads_back_to_the_force(E, nu, R, force):
    bodies = {"E1": E, "nu1": nu, "R1": R, "E2": 3.0 * E, "nu2": 0.1}
    hertz = hertz_line(**bodies, force=force)
    for name in ("radius", "pressure_max"):
        assert hertz_line(**bodies, **{name: getattr(hertz, name)}).force == pytest.approx(force, rel=1e-12)
    assert hertz.at_force(4.0 * force).radius == pytest.approx(2.0 * hertz.radius, rel=1e-12)
