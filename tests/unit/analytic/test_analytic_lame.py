"""Thick shells, press fits and the pin in a hole: tables, equilibrium, Hooke's law, balance, continuity."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import reference

from fastcontact.analytic import (
    hertz_line,
    persson_limit_angle,
    persson_pin,
    press_fit_cylinders,
    press_fit_spheres,
    thick_cylinder,
    thick_sphere,
)

REFERENCE = reference("press_fit")
NAMES = ("inner_radius", "interface_radius", "outer_radius", "E_inner", "nu_inner", "E_outer", "nu_outer")


def arguments(row):
    return {**dict(zip(NAMES, row)), "interference": row[7]}


@pytest.mark.parametrize("row", REFERENCE["cylinders"]["rows"])
def test_cylinders_match_table(row):
    fit = press_fit_cylinders(**arguments(row), kinematics=f"plane_{row[8]}")
    assert fit.pressure == pytest.approx(row[9], rel=1e-13)
    assert fit.outer.hoop_stress(row[1]) == pytest.approx(row[10], rel=1e-13)
    assert fit.inner.hoop_stress(row[1]) == pytest.approx(row[11], rel=1e-13)


@pytest.mark.parametrize("row", REFERENCE["spheres"]["rows"])
def test_spheres_match_table(row):
    assert press_fit_spheres(**arguments(row)).pressure == pytest.approx(row[8], rel=1e-13)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "sphere"])
@pytest.mark.parametrize("bore", [0.0, 20.0])
def test_fit_closes_the_interference(kinematics, bore):
    row = {**arguments([bore, 30.0, 45.0, 2e5, 0.3, 7e4, 0.33, 0.02])}
    fit = press_fit_spheres(**row) if kinematics == "sphere" else press_fit_cylinders(**row, kinematics=kinematics)
    b = fit.interface_radius
    assert fit.outer.displacement(b) - fit.inner.displacement(b) == pytest.approx(0.02, rel=1e-12)
    assert fit.inner.radial_stress(b) == pytest.approx(-fit.pressure, rel=1e-13)
    assert fit.outer.radial_stress(b) == pytest.approx(-fit.pressure, rel=1e-13)
    assert fit.outer.radial_stress(45.0) == pytest.approx(0.0, abs=1e-12 * fit.pressure)
    if bore:
        assert fit.inner.radial_stress(bore) == pytest.approx(0.0, abs=1e-12 * fit.pressure)


def make(kinematics, **loads):
    shell = {"E": 3.0, "nu": 0.3, "inner_radius": 1.0, "outer_radius": 2.5, **loads}
    return thick_sphere(**shell) if kinematics == "sphere" else thick_cylinder(**shell, kinematics=kinematics)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "sphere"])
def test_shell_is_in_equilibrium_and_follows_hooke(kinematics):
    shell = make(kinematics, inner_pressure=0.4, outer_pressure=0.1)
    r, h = np.linspace(1.1, 2.4, 9), 1e-3
    radial, hoop = shell.radial_stress(r), shell.hoop_stress(r)

    def slope(function):
        return (function(r - 2 * h) - 8 * function(r - h) + 8 * function(r + h) - function(r + 2 * h)) / (12 * h)

    factor = 2.0 if kinematics == "sphere" else 1.0
    np.testing.assert_allclose(slope(shell.radial_stress) + factor * (radial - hoop) / r, 0.0, atol=1e-10)
    third = hoop if kinematics == "sphere" else shell.axial_stress(r)
    np.testing.assert_allclose(slope(shell.displacement), (radial - 0.3 * (hoop + third)) / 3.0, atol=1e-10)
    np.testing.assert_allclose(shell.displacement(r) / r, (hoop - 0.3 * (radial + third)) / 3.0, atol=1e-14)
    if kinematics == "plane_strain":
        np.testing.assert_allclose(third, 0.3 * (radial + hoop), atol=1e-15)
    assert shell.radial_stress(1.0) == pytest.approx(-0.4, rel=1e-14)
    assert shell.radial_stress(2.5) == pytest.approx(-0.1, rel=1e-14)


def test_solid_body_is_uniform():
    solid = thick_cylinder(E=1.0, nu=0.2, inner_radius=0.0, outer_radius=2.0, outer_pressure=0.5)
    np.testing.assert_array_equal(solid.hoop_stress([0.0, 1.0, 2.0]), [-0.5, -0.5, -0.5])
    assert solid.displacement(0.0) == 0.0


PIN = reference("persson_pin")


@pytest.mark.parametrize("row", PIN["rows"])
def test_matches_table(row):
    pin = persson_pin(E=1000.0, R=2.0, clearance=0.01, contact_angle=row[0])
    assert 1000.0 * 0.01 / pin.force == pytest.approx(row[1], rel=1e-11)
    assert pin.pressure_max * 2.0 / pin.force == pytest.approx(row[2], rel=1e-13)


@pytest.mark.parametrize("angle", [10.0, 45.0, 80.0])
def test_pressure_carries_the_force(angle):
    pin = persson_pin(E=1.0, R=3.0, clearance=0.01, contact_angle=angle)
    n = 400
    s = (np.arange(n) + 0.5) * math.pi / n - 0.5 * math.pi  # phi = angle sin(s): smooth and periodic
    phi = angle * np.sin(s)
    weight = np.radians(angle) * np.cos(s) * math.pi / n * 3.0
    assert (pin.pressure(phi) * np.cos(np.radians(phi)) * weight).sum() == pytest.approx(pin.force, rel=1e-9)
    assert pin.pressure(1.001 * angle) == 0.0


@pytest.mark.parametrize("angle", [15.0, 40.0, 70.0, None])
def test_pin_and_plate_fit_over_the_contact(angle):
    """Harmonic n of the pressure opens the fit by (4/E) n/(n^2 - 1) R (Michell 1899), n = 0 by (2/E) R.

    What is left in the contact must be the clearance and a rigid shift, -clearance + shift cos(phi).
    """
    E, R, clearance = 10.0, 1.0, 1e-3
    pin = persson_pin(E=E, R=R, clearance=clearance, contact_angle=angle) if angle else persson_pin(
        E=E, R=R, clearance=0.0, force=1.0
    )  # fmt: skip
    n_points = 1 << 16
    phi = np.degrees(np.arange(n_points) * 2.0 * math.pi / n_points)
    phi[phi > 180.0] -= 360.0
    pressure = np.where(np.abs(phi) < pin.contact_angle, pin.pressure(np.clip(phi, -179.0, 179.0)), 0.0)
    harmonics = np.fft.rfft(pressure) / n_points
    n = np.arange(len(harmonics), dtype=float)
    compliance = np.zeros_like(n)
    compliance[0], compliance[2:] = 2.0 / E, 4.0 / E * n[2:] / (n[2:] ** 2 - 1.0)
    opening = np.fft.irfft(harmonics * compliance, n_points) * n_points * R
    inside = np.abs(phi) < 0.98 * pin.contact_angle
    basis = np.column_stack([-np.ones(inside.sum()), np.cos(np.radians(phi[inside]))])
    fitted, *_ = np.linalg.lstsq(basis, opening[inside], rcond=None)
    scale = np.ptp(opening)
    assert fitted[0] == pytest.approx(pin.clearance, abs=1e-5 * scale)
    np.testing.assert_allclose(basis @ fitted, opening[inside], atol=1e-6 * scale)


def test_light_load_is_hertz():
    pin = persson_pin(E=1000.0, R=10.0, clearance=0.1, contact_angle=0.1)
    relative = 10.0 * 9.9 / 0.1
    line = hertz_line(E1=1000.0, nu1=0.0, E2=1000.0, R1=relative, force=pin.force)
    assert line.half_width == pytest.approx(pin.radius, rel=0.01)  # R^2 or R (R - clearance): 1 % here
    assert line.pressure_max == pytest.approx(pin.pressure_max, rel=0.01)


def test_fit_without_clearance_has_one_angle():
    light = persson_pin(E=1.0, R=1.0, clearance=0.0, force=1e-3)
    heavy = persson_pin(E=1.0, R=1.0, clearance=0.0, force=1.0)
    assert light.contact_angle == heavy.contact_angle == persson_limit_angle()
    assert heavy.pressure_max == pytest.approx(1e3 * light.pressure_max, rel=1e-13)
    assert 80.0 < persson_limit_angle() < 90.0


@given(force=st.floats(1e-6, 1e3), R=st.floats(1e-2, 1e3))
def test_angle_and_force_are_inverse_and_units_do_not_matter(force, R):
    pin = persson_pin(E=10.0, R=R, clearance=0.01 * R, force=force * R)
    assert persson_pin(E=10.0, R=1.0, clearance=0.01, force=force).contact_angle == pytest.approx(
        pin.contact_angle, rel=1e-10
    )
    again = persson_pin(E=10.0, R=R, clearance=0.01 * R, contact_angle=pin.contact_angle)
    assert again.force == pytest.approx(force * R, rel=1e-7)


def test_plane_strain_is_stiffer():
    strain = persson_pin(E=0.91, nu=0.3, R=1.0, clearance=0.01, force=0.01, kinematics="plane_strain")
    stress = persson_pin(E=1.0, R=1.0, clearance=0.01, force=0.01)
    assert strain.contact_angle == pytest.approx(stress.contact_angle, rel=1e-12)
