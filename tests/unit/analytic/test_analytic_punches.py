"""Rigid punches and the receding layer: tables, integrals, balance, limits."""

import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import reference
from pairwise import first_of
from scipy.integrate import quad
from scipy.special import ellipk, ellipkm1

from fastcontact.analytic import (
    _receding,
    bonded_stiffness_ratio,
    cone_punch,
    flat_punch,
    flat_punch_2d,
    hertz_point,
    paraboloid_punch,
    power_law_punch,
    receding_layer,
    spence_stick_ratio,
)

FOLDER = Path(__file__).parents[3] / "data/reference"
AXISYMMETRIC = json.loads((FOLDER / "punches_axisymmetric.json").read_text())
PLANE = json.loads((FOLDER / "punch_2d.json").read_text())
SOLID = {"E": 3.0, "nu": 0.3}


@pytest.mark.parametrize("row", AXISYMMETRIC["power_law"]["rows"])
def test_power_law_matches_table(row):
    n, depth, force = row
    punch = power_law_punch(**SOLID, coefficient=0.2, exponent=n, radius=1.5)
    assert punch.approach / (0.2 * 1.5**n) == pytest.approx(depth, rel=1e-13)
    assert punch.force / (2.0 * punch.E_star * 1.5 * punch.approach) == pytest.approx(force, rel=1e-13)


@pytest.mark.parametrize("row", AXISYMMETRIC["bonded_flat"]["rows"])
def test_bonded_stiffness_matches_table(row):
    assert bonded_stiffness_ratio(row[0]) == pytest.approx(row[1], rel=1e-12)
    free = flat_punch(E=2.0, nu=row[0], radius=1.5, approach=0.1)
    bonded = flat_punch(E=2.0, nu=row[0], radius=1.5, approach=0.1, bonded=True)
    assert bonded.force / free.force == pytest.approx(row[1], rel=1e-12)


def test_bonded_stiffness_of_an_incompressible_body():
    assert bonded_stiffness_ratio(0.5) == 1.0
    assert bonded_stiffness_ratio(0.5 - 1e-9) == pytest.approx(1.0, abs=1e-8)


def carried(punch):
    """Force of the pressure; r = a sin(theta)^2 weakens the singularities at both ends."""

    def integrand(theta):
        r = punch.radius * math.sin(theta) ** 2
        slope = 2.0 * punch.radius * math.sin(theta) * math.cos(theta)
        return float(punch.pressure(r)) * 2.0 * math.pi * r * slope

    return quad(integrand, 0.0, 0.5 * math.pi, epsrel=1e-10)[0]


def sunk(punch, r):
    """Normal displacement of the surface at r under the pressure: Boussinesq's rings."""

    def ring(s):
        total = r + s
        return 4.0 / (math.pi * punch.E_star) * float(punch.pressure(s)) * s / total * ellipkm1(((r - s) / total) ** 2)

    ends = [0.0, r, punch.radius] if r < punch.radius else [0.0, punch.radius]
    return -sum(quad(ring, low, high, limit=200)[0] for low, high in itertools.pairwise(ends))


@pytest.mark.parametrize("exponent", [0.5, 1.0, 2.0, 3.5, 8.0])
def test_power_law_pressure_does_what_the_punch_imposes(exponent):
    punch = power_law_punch(**SOLID, coefficient=0.2, exponent=exponent, force=0.3)
    assert carried(punch) == pytest.approx(0.3, rel=1e-8)
    for ratio in (0.3, 0.8, 1.2, 3.0):
        r = ratio * punch.radius
        assert punch.normal_displacement(r) == pytest.approx(sunk(punch, r), rel=1e-6)
    inside = 0.6 * punch.radius
    assert -punch.normal_displacement(inside) == pytest.approx(punch.approach - 0.2 * inside**exponent)
    a = punch.radius
    assert punch.normal_displacement(a * (1 + 1e-12)) == pytest.approx(float(punch.normal_displacement(a)), rel=1e-5)


def test_flat_punch():
    punch = flat_punch(**SOLID, radius=2.0, force=0.7)
    assert carried(punch) == pytest.approx(0.7, rel=1e-8)
    assert punch.stiffness == pytest.approx(2.0 * 3.0 / 0.91 * 2.0, rel=1e-14)
    assert punch.normal_displacement(1.0) == pytest.approx(-punch.approach, rel=1e-14)
    assert punch.normal_displacement(4.0) == pytest.approx(-punch.approach / 3.0, rel=1e-14)
    assert math.isinf(punch.pressure(2.0))
    assert punch.pressure(2.1) == 0.0


def test_cone_has_its_closed_form():
    cone = cone_punch(**SOLID, slope_angle=5.0, approach=0.01)
    assert cone_punch(**SOLID, slope=math.tan(math.radians(5.0)), approach=0.01).force == pytest.approx(cone.force)
    slope = math.tan(math.radians(5.0))
    assert cone.approach == pytest.approx(0.5 * math.pi * cone.radius * slope, rel=1e-14)
    assert cone.force == pytest.approx(2.0 / math.pi * cone.E_star * 0.01**2 / slope, rel=1e-13)
    r = np.array([0.01, 0.3, 0.9]) * cone.radius
    np.testing.assert_allclose(cone.pressure(r), 0.5 * cone.E_star * slope * np.arccosh(cone.radius / r), rtol=1e-12)
    assert math.isinf(cone.pressure(0.0))
    assert math.isinf(cone.pressure_max)


def test_paraboloid_is_hertz():
    punch = paraboloid_punch(**SOLID, R=5.0, force=0.01)
    hertz = hertz_point(E1=3.0, nu1=0.3, R1=5.0, force=0.01)
    for name in ("radius", "approach", "pressure_max"):
        assert getattr(punch, name) == pytest.approx(getattr(hertz, name), rel=1e-13)
    r = np.linspace(0.0, 3.0, 50) * hertz.radius
    np.testing.assert_allclose(punch.pressure(r), hertz.pressure(r), atol=1e-13)
    np.testing.assert_allclose(punch.normal_displacement(r), hertz.surface_displacement(r)[:, 1], rtol=1e-12)


@given(exponent=st.floats(0.3, 10.0), force=st.floats(1e-3, 1e3))
def test_power_law_round_trips_and_work(exponent, force):
    solid = {**SOLID, "coefficient": 0.3, "exponent": exponent}
    punch = power_law_punch(**solid, force=force)
    for name in ("approach", "radius"):
        assert power_law_punch(**solid, **{name: getattr(punch, name)}).force == pytest.approx(force, rel=1e-10)
    # A deeper contact of the same force law: dF/d(approach) = 2 E* a (Barber and Billings 1990).
    step = 1e-4 * punch.approach
    assert punch.at_force(2.0 * force).at_force(force).radius == pytest.approx(punch.radius, rel=1e-12)
    forces = [punch.at_approach(punch.approach + k * step).force for k in (-1, 1)]
    assert (forces[1] - forces[0]) / (2.0 * step) == pytest.approx(2.0 * punch.E_star * punch.radius, rel=1e-6)
    big = power_law_punch(
        E=3e6, nu=0.3, coefficient=0.3 * 1e-3 ** (1.0 - exponent), exponent=exponent, force=force
    )  # N, mm, MPa to N, m, Pa
    assert big.radius * 1e3 == pytest.approx(punch.radius, rel=1e-10)


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.5])
@pytest.mark.parametrize("bonded", [False, True])
def test_plane_punch_satisfies_the_equations_of_the_half_plane(nu, bonded):
    """With x = a tanh(w) the tractions are smooth; sums at odd half steps give principal values."""
    punch = flat_punch_2d(nu=nu, half_width=2.0, force=3.0, bonded=bonded)
    h = 0.05
    beta = (1.0 - 2.0 * nu) / (2.0 * (1.0 - nu)) if bonded else 0.0
    for w0 in (0.0, 0.4, -1.0):
        w = w0 + h * (np.arange(-300, 300) + 0.5)
        w = w[np.abs(w) < 13.0]  # beyond, 1 - tanh(w)^2 is lost in rounding
        x, x0 = 2.0 * np.tanh(w), 2.0 * math.tanh(w0)
        jacobian = 2.0 / np.cosh(w) ** 2 * h
        p, q = punch.pressure(x) * jacobian, punch.shear(x) * jacobian
        assert p.sum() == pytest.approx(3.0, rel=1e-4)
        assert (p / (x0 - x)).sum() / math.pi == pytest.approx(beta * punch.shear(x0), abs=1e-4)
        assert (q / (x0 - x)).sum() / math.pi == pytest.approx(-beta * punch.pressure(x0), abs=1e-4)


def test_plane_punch_at_its_edges():
    punch = flat_punch_2d(nu=0.2, half_width=2.0, force=3.0)
    assert punch.radius == 2.0
    np.testing.assert_array_equal(punch.pressure([-2.0, 2.0, 2.5]), [math.inf, math.inf, 0.0])
    np.testing.assert_array_equal(punch.shear([-2.0, 0.5, 2.5]), [0.0, 0.0, 0.0])
    assert punch.pressure(0.0) == pytest.approx(3.0 / (2.0 * math.pi), rel=1e-14)


@pytest.mark.parametrize("row", PLANE["stick"]["rows"])
def test_stick_ratio_matches_table(row):
    nu, friction, beta, ratio, *coupled = row
    found = spence_stick_ratio(nu=nu, friction=friction)
    assert found == pytest.approx(ratio, rel=1e-11)
    assert ellipk(1.0 - found**2) / ellipk(found**2) == pytest.approx(beta / friction, rel=1e-9)
    # The boundary elements, with coupling, stick less far: by at most 0.19 of the half-width.
    assert 0.0 < found - coupled[1] < 0.19


def test_stick_ratio_has_its_limits():
    assert spence_stick_ratio(nu=0.5, friction=0.1) == 1.0
    assert spence_stick_ratio(nu=0.3, friction=100.0) == pytest.approx(1.0, abs=1e-15)
    assert spence_stick_ratio(nu=0.0, friction=0.01) < 1e-10
    assert spence_stick_ratio(nu=0.0, friction=1e-4) == 0.0
    ratios = [spence_stick_ratio(nu=0.3, friction=f) for f in (0.1, 0.2, 0.4, 0.8)]
    assert ratios == sorted(ratios)


REFERENCE = reference("receding_layer")


def layer(ratio, load, **more):
    """Layer of modulus `ratio` times that of the half-plane, plane stress for plain moduli."""
    half_plane = {"E2": 1.0 / ratio} if ratio else {}
    unit = {"E1": 1.0, "nu1": 0.0, "thickness": 1.0, "force": 1.0, **half_plane, **more}
    return receding_layer(**unit, load_half_width=load)


@pytest.mark.parametrize("row", REFERENCE["rows"])
def test_matches_table(row):
    ratio, load, half_width, pressure = row
    contact = layer(ratio, load)
    error = 2e-7 if ratio == 10.0 else 5e-9
    assert contact.half_width == pytest.approx(half_width, abs=error)
    assert contact.pressure_max == pytest.approx(pressure, abs=error)


@pytest.mark.parametrize(("ratio", "load"), [(0.0, 0.0), (1.0, 0.5), (10.0, 3.0), (100.0, 0.0)])
def test_pressure_carries_the_force_and_vanishes_at_the_edge(ratio, load):
    contact = layer(ratio, load)
    theta = (np.arange(500) + 0.5) * math.pi / 500
    x = contact.half_width * np.cos(theta)
    integral = (contact.pressure(x) * contact.half_width * np.sin(theta)).mean() * math.pi
    assert integral == pytest.approx(1.0, rel=1e-5)
    assert (contact.pressure(x) > 0.0).all()
    assert contact.pressure(contact.half_width) == pytest.approx(0.0, abs=1e-10)
    assert contact.pressure(1.1 * contact.half_width) == 0.0
    edge = contact.pressure(contact.half_width * (1.0 - np.array([1e-4, 4e-4])))
    assert edge[1] / edge[0] == pytest.approx(2.0, rel=1e-2)  # grows with the root of the distance


@pytest.mark.parametrize(("ratio", "load"), first_of(1, [(0.0, 10.0), (100.0, 1.0)]))
def test_series_is_long_enough(ratio, load, monkeypatch):
    found = layer(ratio, load)
    monkeypatch.setattr(_receding, "_TERMS", 160)
    longer = layer(ratio, load)
    assert found.series != longer.series
    assert found.half_width == pytest.approx(longer.half_width, rel=2e-6)
    assert found.pressure_max == pytest.approx(longer.pressure_max, rel=2e-6)


def test_wide_load_goes_straight_through():
    np.testing.assert_allclose(layer(0.5, 8.0).pressure([0.0, 2.0, 4.0]), 1.0 / 16.0, rtol=2e-3)


def test_plane_strain_counts_with_plane_strain_moduli():
    strain = layer(2.0, 0.0, nu1=0.3, nu2=0.2, kinematics="plane_strain")
    assert strain.half_width == pytest.approx(layer(2.0 * 0.96 / 0.91, 0.0).half_width, rel=1e-12)


@settings(max_examples=25)
@given(force=st.floats(1e-3, 1e6), h=st.floats(1e-3, 1e3))
def test_width_does_not_depend_on_force_and_scales_with_thickness(force, h):
    one = layer(1.0, 0.5)
    other = layer(1.0, 0.5 * h, thickness=h, force=force)
    assert other.half_width == pytest.approx(one.half_width * h, rel=1e-10)
    assert other.pressure_max == pytest.approx(one.pressure_max * force / h, rel=1e-9)
