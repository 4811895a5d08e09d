"""Elliptical Hertz contact compared with a table, integrals and limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import reference

from fastcontact.analytic import hertz_elliptical, hertz_line, hertz_point

REFERENCE = reference("hertz_elliptical")


@pytest.mark.parametrize("row", REFERENCE["rows"])
def test_matches_table(row):
    ratio, long, short, axes, pressure, approach = row
    circle = hertz_point(E1=1.0, nu1=0.0, R1=1.0, force=1.0)
    hertz = hertz_elliptical(E1=1.0, nu1=0.0, R1x=math.sqrt(ratio), R1y=1.0 / math.sqrt(ratio), force=1.0)
    assert hertz.radius_x / circle.radius == pytest.approx(long, rel=1e-13)
    assert hertz.radius_y / circle.radius == pytest.approx(short, rel=1e-13)
    assert hertz.radius_y / hertz.radius_x == pytest.approx(axes, rel=1e-13)
    assert hertz.pressure_max / circle.pressure_max == pytest.approx(pressure, rel=1e-13)
    assert hertz.approach / circle.approach == pytest.approx(approach, rel=1e-13)


def surface_displacement(hertz, x, y):
    """Sum of both surfaces' sinking under the pressure, by rays through (x, y): exact along each ray.

    Along a ray the pressure is the root of a quadratic c - 2 b s - q s^2, whose integral over the whole chord is
    pi/2 (c + b^2/q)/sqrt(q).
    """
    angle = (np.arange(400) + 0.5) * math.pi / 400
    ax, ay = np.cos(angle) / hertz.radius_x, np.sin(angle) / hertz.radius_y
    q = ax**2 + ay**2
    b = x * ax / hertz.radius_x + y * ay / hertz.radius_y
    c = 1.0 - (x / hertz.radius_x) ** 2 - (y / hertz.radius_y) ** 2
    chords = 0.5 * math.pi * (c + b**2 / q) / np.sqrt(q)
    return hertz.pressure_max * chords.mean() / hertz.E_star


def test_surfaces_close_the_gap():
    hertz = hertz_elliptical(E1=2.0, nu1=0.3, R1x=3.0, R1y=20.0, E2=5.0, nu2=0.1, R2y=50.0, force=0.1)
    for x, y in [(0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.4, -0.7)]:
        px, py = x * hertz.radius_x, y * hertz.radius_y
        gap = px**2 / (2.0 * hertz.R_x) + py**2 / (2.0 * hertz.R_y) - hertz.approach
        assert gap + surface_displacement(hertz, px, py) == pytest.approx(0.0, abs=1e-13 * hertz.approach)


def test_pressure_integrates_to_the_force():
    hertz = hertz_elliptical(E1=1.0, nu1=0.3, R1x=1.0, R1y=7.0, force=1e-3)
    x, weight = np.polynomial.legendre.leggauss(40)
    theta = 0.25 * math.pi * (x + 1.0)
    angle = np.arange(32) * 2.0 * math.pi / 32
    rho = np.sin(theta)[:, None]
    p = hertz.pressure(hertz.radius_x * rho * np.cos(angle), hertz.radius_y * rho * np.sin(angle))
    radial = 0.25 * math.pi * weight * np.sin(theta) * np.cos(theta)
    integral = hertz.radius_x * hertz.radius_y * 2.0 * math.pi * (radial @ p.mean(axis=1))
    assert integral == pytest.approx(hertz.force, rel=1e-12)
    assert hertz.pressure(1.01 * hertz.radius_x) == 0.0


def test_circle_is_the_point_contact():
    bodies = {"E1": 2e5, "nu1": 0.3, "E2": 7e4, "nu2": 0.33}
    point = hertz_point(**bodies, R1=10.0, R2=30.0, approach=0.01)
    circle = hertz_elliptical(**bodies, R1x=10.0, R1y=10.0, R2x=30.0, R2y=30.0, approach=0.01)
    assert circle.radius_x == circle.radius_y == pytest.approx(point.radius, rel=1e-14)
    assert circle.force == pytest.approx(point.force, rel=1e-14)
    assert circle.pressure_max == pytest.approx(point.pressure_max, rel=1e-14)


def test_nearly_a_circle_is_continuous():
    almost = hertz_elliptical(E1=1.0, nu1=0.0, R1x=1.0 + 1e-9, R1y=1.0, force=1.0)
    assert almost.radius_x / almost.radius_y == pytest.approx(1.0 + 1e-9 * 2.0 / 3.0, abs=1e-12)


def test_very_long_ellipse_is_locally_a_line_contact():
    long = hertz_elliptical(E1=1.0, nu1=0.0, R1x=1.0, R1y=1e8, force=1e-6)
    line = hertz_line(E1=1.0, nu1=0.0, R1=1.0, radius=long.radius_x)
    assert line.pressure_max == pytest.approx(long.pressure_max, rel=1e-3)


positive = st.floats(1e-2, 1e2)


@given(Rx=positive, Ry=positive, force=positive)
def test_load_quantities_and_directions(Rx, Ry, force):
    bodies = {"E1": 10.0, "nu1": 0.2}
    hertz = hertz_elliptical(**bodies, R1x=Rx, R1y=Ry, force=force)
    for name in ("approach", "pressure_max"):
        again = hertz_elliptical(**bodies, R1x=Rx, R1y=Ry, **{name: getattr(hertz, name)})
        assert again.force == pytest.approx(force, rel=1e-11)
    turned = hertz_elliptical(**bodies, R1x=Ry, R1y=Rx, force=force)
    assert (turned.radius_y, turned.radius_x) == (hertz.radius_x, hertz.radius_y)
    assert (hertz.radius_x >= hertz.radius_y) == (Rx >= Ry)
    scaled = hertz_elliptical(E1=10.0e6, nu1=0.2, R1x=Rx * 1e-3, R1y=Ry * 1e-3, force=force)  # mm to m
    assert scaled.radius_x == pytest.approx(hertz.radius_x * 1e-3, rel=1e-12)
    assert scaled.approach == pytest.approx(hertz.approach * 1e-3, rel=1e-12)


def test_the_same_contact_at_another_force_or_approach():
    hertz = hertz_elliptical(E1=1.0, nu1=0.3, R1x=2.0, R1y=1.0, force=1e-3)
    other = hertz.at_force(8e-3)
    assert other.radius == pytest.approx(math.sqrt(other.radius_x * other.radius_y), rel=1e-15)
    assert other.radius == pytest.approx(2.0 * hertz.radius, rel=1e-13)
    assert hertz.at_approach(other.approach).force == pytest.approx(8e-3, rel=1e-13)
