"""Thick shells and press fits: tables, equilibrium, Hooke's law, continuity."""

import numpy as np
import pytest
from models import reference

from fastcontact.analytic import press_fit_cylinders, press_fit_spheres, thick_cylinder, thick_sphere

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


@pytest.mark.parametrize(("kinematics", "factor"), [("plane_strain", 1.0), ("plane_stress", 1.0), ("sphere", 0.5)])
def test_thin_shell_follows_the_boiler_formula(kinematics, factor):
    shell = make(kinematics, outer_radius=1.0001, inner_pressure=1.0)
    assert shell.hoop_stress(1.0) == pytest.approx(factor * 1e4, rel=2e-4)


def test_solid_body_is_uniform():
    solid = thick_cylinder(E=1.0, nu=0.2, inner_radius=0.0, outer_radius=2.0, outer_pressure=0.5)
    np.testing.assert_array_equal(solid.hoop_stress([0.0, 1.0, 2.0]), [-0.5, -0.5, -0.5])
    assert solid.displacement(0.0) == 0.0
