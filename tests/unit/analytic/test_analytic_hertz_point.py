"""Hertz contact of spheres compared with tables, integrals, limits and the equations of elasticity."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import assert_largest, derivative, reference

from fastcontact.analytic import hertz_point

REFERENCE = reference("hertz_point")
STEEL = {"E1": 210_000.0, "nu1": 0.3, "R1": 20.0}


def table(name):
    return np.array(REFERENCE[name]["rows"])


@pytest.fixture
def unit():
    """Contact with a = 2 and p0 = 1 on a body with nu = 0.3."""
    return hertz_point(E1=1.0, nu1=0.3, R1=2.0 * 2.0 / (0.91 * math.pi), radius=2.0)


def test_half_spheres_of_the_training_case():
    case = REFERENCE["half_spheres_R50"]
    hertz = hertz_point(
        E1=case["E"], nu1=case["nu"], R1=case["R1"], E2=case["E"], nu2=case["nu"], R2=case["R2"], approach=4.0
    )
    assert hertz.E_star == pytest.approx(case["E_star"], rel=1e-14)
    assert hertz.radius == pytest.approx(case["radius"], rel=1e-14)
    assert hertz.pressure_max == pytest.approx(case["pressure_max"], rel=1e-14)
    assert hertz.force == pytest.approx(case["force"], rel=1e-14)


def test_stress_on_axis_matches_table(unit):
    rows = table("axis_nu_0.3")
    stress = unit.stress_on_axis(rows[:, 0] * unit.radius)
    np.testing.assert_allclose(stress[:, 0], rows[:, 1], atol=1e-14)
    np.testing.assert_allclose(stress[:, 2], rows[:, 1], atol=1e-14)
    np.testing.assert_allclose(stress[:, 1], rows[:, 2], atol=1e-14)
    np.testing.assert_allclose(stress[:, 3], 0.0, atol=1e-15)
    np.testing.assert_allclose(unit.von_mises(0.0, -rows[:, 0] * unit.radius), rows[:, 3], atol=1e-14)


def test_von_mises_maximum_matches_table(unit):
    for nu, value, _, depth in table("von_mises_maximum"):
        found = unit.von_mises_maximum(nu)
        assert found.value == pytest.approx(value, abs=1e-14)
        assert found.depth / unit.radius == pytest.approx(depth, abs=2e-8)


@pytest.mark.parametrize("nu", [-0.3, 0.0, 0.3, 0.5])
def test_von_mises_maximum_is_the_largest_anywhere(unit, nu):
    assert_largest(unit, nu)


def test_very_auxetic_body_is_stressed_most_at_the_edge(unit):
    assert unit.von_mises(unit.radius, 0.0, -0.6) > 1.05 * unit.von_mises_maximum(-0.6).value


def test_surface_outside_matches_table(unit):
    rows = table("surface_outside_nu_0.3")
    r = rows[:, 0] * unit.radius
    stress = unit.surface_stress(r)
    np.testing.assert_allclose(stress[:, 0], rows[:, 1], atol=1e-14)
    np.testing.assert_allclose(stress[:, 2], -rows[:, 1], atol=1e-14)
    np.testing.assert_allclose(unit.surface_displacement(r)[:, 1] / (0.91 * unit.radius), rows[:, 2], rtol=1e-13)


def test_surface_inside_follows_the_textbook(unit):
    r = np.linspace(0.05, 0.999, 40) * unit.radius
    x = 1.0 - (r / unit.radius) ** 2
    hoop = (1.0 - 0.6) / 3.0 * (unit.radius / r) ** 2 * (1.0 - x**1.5)
    stress, u = unit.surface_stress(r), unit.surface_displacement(r)
    np.testing.assert_allclose(stress[:, 0], hoop - np.sqrt(x), atol=1e-12)
    np.testing.assert_allclose(stress[:, 2], -hoop - 0.6 * np.sqrt(x), atol=1e-12)
    np.testing.assert_allclose(stress[:, 1], -unit.pressure(r), atol=1e-14)
    np.testing.assert_allclose(u[:, 0], -(1.3 * 0.4) / 3.0 * unit.radius**2 / r * (1.0 - x**1.5), rtol=1e-10)
    np.testing.assert_allclose(u[:, 1], -0.91 * math.pi / (4.0 * unit.radius) * (2.0 * unit.radius**2 - r**2))


def test_surfaces_of_both_bodies_close_the_gap():
    hertz = hertz_point(**STEEL, E2=70_000.0, nu2=0.33, R2=50.0, force=1_000.0)
    r = np.linspace(0.0, 3.0, 61) * hertz.radius
    sunk = -hertz.surface_displacement(r)[:, 1] - hertz.surface_displacement(r, body=2)[:, 1]
    gap = r**2 / (2.0 * hertz.R_effective) - hertz.approach + sunk
    inside = r <= hertz.radius
    np.testing.assert_allclose(gap[inside] / hertz.approach, 0.0, atol=1e-14)
    assert (gap[r > 1.001 * hertz.radius] > 0.0).all()


def test_pressure_integrates_to_the_force(unit):
    r, weight = np.polynomial.legendre.leggauss(60)
    theta = 0.25 * math.pi * (r + 1.0)  # r = a sin(theta) makes the integrand smooth
    r = unit.radius * np.sin(theta)
    integral = (0.25 * math.pi * weight * unit.pressure(r) * 2.0 * math.pi * r * unit.radius * np.cos(theta)).sum()
    assert integral == pytest.approx(unit.force, rel=1e-13)
    assert unit.pressure(1.01 * unit.radius) == 0.0


@pytest.mark.parametrize("point", [(0.3, -0.2), (1.0, -1.0), (2.4, -0.3), (3.0, -5.0), (12.0, -15.0)])
@pytest.mark.parametrize("nu", [-0.4, 0.0, 0.3, 0.5])
def test_field_is_in_equilibrium_and_follows_hooke(point, nu):
    E = 3.0
    hertz = hertz_point(E1=E, nu1=nu, R1=5.0, radius=2.0)
    point, h = np.array(point), 2e-3
    rr, zz, tt, rz = hertz.stress(*point)
    d_r = derivative(hertz.stress, point, np.array([h, 0.0]))
    d_z = derivative(hertz.stress, point, np.array([0.0, h]))
    scale = hertz.pressure_max
    assert d_r[0] + d_z[3] + (rr - tt) / point[0] == pytest.approx(0.0, abs=1e-8 * scale)
    assert d_r[3] + d_z[1] + rz / point[0] == pytest.approx(0.0, abs=1e-8 * scale)

    u = hertz.displacement(*point)
    u_r = derivative(hertz.displacement, point, np.array([h, 0.0]))
    u_z = derivative(hertz.displacement, point, np.array([0.0, h]))
    trace = rr + zz + tt
    strain = [((1.0 + nu) * s - nu * trace) / E for s in (rr, zz, tt)]
    np.testing.assert_allclose([u_r[0], u_z[1], u[0] / point[0]], strain, atol=1e-9 * scale)
    assert u_r[1] + u_z[0] == pytest.approx(2.0 * (1.0 + nu) / E * rz, abs=1e-9 * scale)


def test_far_field_is_that_of_a_point_force(unit):
    r, z = 3e4, -4e4  # distance 5e4
    F, nu, rho = unit.force, 0.3, 5e4
    u_z = -(1.0 + nu) * F / (2.0 * math.pi) * (z**2 / rho**3 + 2.0 * (1.0 - nu) / rho)
    zz = -3.0 * F * 4e4**3 / (2.0 * math.pi * rho**5)
    assert unit.displacement(r, z)[1] == pytest.approx(u_z, rel=1e-7)
    assert unit.stress(r, z)[1] == pytest.approx(zz, rel=1e-7)


def test_displacement_is_zero_on_the_axis_and_finite_at_the_edge(unit):
    assert unit.displacement(0.0, -1.0)[0] == 0.0
    np.testing.assert_allclose(unit.stress(unit.radius, 0.0), [0.4 / 3.0, 0.0, -0.4 / 3.0, 0.0], atol=1e-15)


positive = st.floats(1e-3, 1e3)


@given(E=positive, nu=st.floats(-0.9, 0.5), R1=positive, R2=positive, force=positive)
def test_every_load_quantity_leads_back_to_the_force(E, nu, R1, R2, force):
    bodies = {"E1": E, "nu1": nu, "R1": R1, "E2": 3.0 * E, "nu2": 0.1, "R2": R2}
    hertz = hertz_point(**bodies, force=force)
    for name in ("approach", "radius", "pressure_max"):
        again = hertz_point(**bodies, **{name: getattr(hertz, name)})
        assert getattr(again, name) == getattr(hertz, name)
        assert again.force == pytest.approx(force, rel=1e-12)
    assert hertz.at_approach(2.0 * hertz.approach).at_force(force).approach == pytest.approx(hertz.approach)


@given(E=positive, R=positive, force=positive)
def test_units_do_not_matter(E, R, force):
    small = hertz_point(E1=E, nu1=0.3, R1=R, force=force)
    big = hertz_point(E1=E * 1e6, nu1=0.3, R1=R * 1e-3, force=force)  # N, mm, MPa to N, m, Pa
    assert big.radius == pytest.approx(small.radius * 1e-3, rel=1e-12)
    assert big.pressure_max == pytest.approx(small.pressure_max * 1e6, rel=1e-12)
    r, z = 0.7 * small.radius, -0.4 * small.radius
    np.testing.assert_allclose(big.stress(r * 1e-3, z * 1e-3), small.stress(r, z) * 1e6, rtol=1e-11)
    np.testing.assert_allclose(big.displacement(r * 1e-3, z * 1e-3), small.displacement(r, z) * 1e-3, rtol=1e-11)


def test_arrays_keep_their_shape(unit):
    r = np.zeros((2, 3))
    assert unit.pressure(r).shape == (2, 3)
    assert unit.stress(r, -1.0).shape == (2, 3, 4)
    assert unit.displacement(1.0, np.zeros(5)).shape == (5, 2)
    assert unit.surface_stress([0.0, 1.0]).shape == (2, 4)
