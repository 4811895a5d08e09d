"""Partial slip: tables, balance of forces, the friction law, unloading, and the block."""

import itertools
import math

import numpy as np
import pytest
from models import reference
from scipy.integrate import quad

import fastcontact as fc

REFERENCE = reference("cattaneo_mindlin")
LIKE = {"E1": 1e5, "nu1": 0.3, "R1": 10.0, "E2": 1e5, "nu2": 0.3, "R2": 30.0, "friction": 0.4}


def line(load, force=500.0):
    return fc.analytic.cattaneo_mindlin_line(**LIKE, force=force, tangential_force=load * 0.4 * force)


def sphere(load, force=500.0):
    return fc.analytic.cattaneo_mindlin_sphere(**LIKE, force=force, tangential_force=load * 0.4 * force)


@pytest.mark.parametrize("row", REFERENCE["line"]["rows"])
def test_line_matches_table(row):
    contact = line(row[0])
    assert contact.stick_radius / contact.normal.radius == pytest.approx(row[1], rel=1e-13)


@pytest.mark.parametrize("row", REFERENCE["sphere"]["rows"])
def test_sphere_matches_table(row):
    contact = sphere(row[0])
    assert contact.stick_radius / contact.normal.radius == pytest.approx(row[1], rel=1e-13)
    unit = 3.0 * 0.4 * 500.0 / (16.0 * contact.normal.radius * contact.G_star)
    assert contact.tangential_displacement / unit == pytest.approx(row[2], rel=1e-12)


def integral(function, contact, *inner):
    """Integral over 0..a, split where the traction has kinks."""
    a = contact.normal.radius
    ends = [0.0, *sorted(c for c in inner if 0.0 < c < a), a]
    return sum(quad(function, low, high, epsabs=0.0, epsrel=1e-9)[0] for low, high in itertools.pairwise(ends))


@pytest.mark.parametrize("down", [0.6, 0.0, -0.3, -0.6])
def test_tractions_carry_the_tangential_force(down):
    for contact, first, measure in [
        (line(0.6), 0.4**0.5, lambda r: 2.0),
        (sphere(0.6), 0.4 ** (1 / 3), lambda r: 2.0 * math.pi * r),
    ]:
        a, limit = contact.normal.radius, 0.4 * contact.normal.force
        contact = contact.unloaded_to(down * limit)
        total = integral(
            lambda r: float(contact.traction(r)) * measure(r),  # noqa: B023
            contact,
            first * a,
            contact.stick_radius,
        )
        assert total == pytest.approx(down * limit, abs=1e-7 * limit)


def test_friction_law_holds_while_loading_and_unloading():
    r = np.linspace(0.0, 1.0, 200)
    for contact in (line(0.7), sphere(0.7)):
        a, p = contact.normal.radius, contact.normal.pressure(r * contact.normal.radius)
        q = contact.traction(r * a)
        slipping = r * a > contact.stick_radius
        np.testing.assert_allclose(q[slipping], 0.4 * p[slipping], rtol=1e-12)
        assert (np.abs(q) <= 0.4 * p * (1.0 + 1e-12)).all()
        back = contact.unloaded_to(-0.2 * 0.4 * contact.normal.force)
        q = back.traction(r * a)
        slipping = r * a > back.stick_radius
        assert slipping.any()
        np.testing.assert_allclose(q[slipping], -0.4 * p[slipping], rtol=1e-11)
        assert (np.abs(q) <= 0.4 * p * (1.0 + 1e-12)).all()


def test_line_sticks_in_the_middle_and_slips_as_the_half_plane_says():
    contact = line(0.6)
    a, c = contact.normal.radius, contact.stick_radius

    def spread(x):
        """Principal value of the integral of q(s)/(x - s)."""
        q = float(contact.traction(x))
        points = [-c, c, x]
        regular = quad(lambda s: (float(contact.traction(s)) - q) / (x - s), -a, a, points=points, limit=400)[0]
        return regular + q * math.log((a + x) / (a - x))

    unit = contact.normal.pressure_max * 0.4
    for x in (0.1 * c, 0.5 * c, 0.9 * c):
        assert spread(x) == pytest.approx(0.0, abs=1e-6 * unit)
    for x in (0.5 * (a + c), 0.8 * a + 0.2 * c):
        h = 1e-4 * a
        slope = float(contact.slip(x + h) - contact.slip(x - h)) / (2.0 * h)
        assert slope == pytest.approx(2.0 / (math.pi * contact.normal.E_star) * spread(x), rel=1e-5)
    assert contact.slip(0.99 * c) == 0.0
    assert contact.slip(1.01 * a) == 0.0


@pytest.mark.parametrize("down", [0.6, 0.2, -0.5])
def test_displacement_by_slip_is_what_the_slip_does_to_a_strip_that_sticks(down):
    """By reciprocity: the mean of the slip, weighted by the tractions under a strip that sticks throughout."""
    contact = line(0.6).unloaded_to(down * 0.4 * 500.0)
    a = contact.normal.radius
    kinks = [math.asin(0.4**0.5), math.asin(contact.stick_radius / a)]
    weighted = quad(
        lambda angle: float(contact.slip(a * math.sin(angle))) / math.pi, 0.0, math.pi / 2, points=kinks, epsabs=1e-16
    )[0]
    assert contact.slip_displacement == pytest.approx(2.0 * weighted, rel=1e-8)


def test_displacement_by_slip_without_force_and_at_sliding():
    assert line(0.0).slip_displacement == 0.0
    n = line(1.0).normal
    assert line(1.0).slip_displacement == pytest.approx(0.4 * n.force / (math.pi * n.E_star), rel=1e-14)


def test_slip_of_full_sliding_starts_at_the_centre():
    contact = line(1.0)
    assert contact.stick_radius == 0.0
    a, n = contact.normal.radius, contact.normal
    assert float(contact.slip(a)) == pytest.approx(0.4 * n.pressure_max * a / n.E_star, rel=1e-14)


def test_sphere_displacement_is_that_of_its_traction_at_the_centre():
    contact = sphere(0.8)  # Cerruti at r = 0: (2 - nu)/(2 G) times the integral of q over r, for each body
    q = integral(lambda r: float(contact.traction(r)), contact, contact.stick_radius)
    assert contact.tangential_displacement == pytest.approx(0.5 / contact.G_star * q, rel=1e-8)


def test_small_tangential_loads_see_mindlins_stiffness():
    contact = sphere(1e-6)
    stiffness = contact.tangential_force / contact.tangential_displacement
    assert stiffness == pytest.approx(8.0 * contact.normal.radius * contact.G_star, rel=1e-6)
    shear = 1e5 / 2.6
    assert contact.G_star == pytest.approx(0.5 * shear / 1.7, rel=1e-14)


def test_loop_closes_and_its_area_is_the_dissipation():
    contact = sphere(0.9)
    peak = contact.tangential_force
    assert contact.unloaded_to(-peak).tangential_displacement == pytest.approx(-contact.tangential_displacement)
    np.testing.assert_allclose(
        contact.unloaded_to(-peak).traction([0.0, 0.1, 0.2]), -contact.traction([0.0, 0.1, 0.2]), rtol=1e-12
    )
    # Unloading and reloading paths are images of each other, so the loop has twice the even part's area.
    path = quad(lambda T: contact.unloaded_to(T).tangential_displacement, -peak, peak, epsrel=1e-11)[0]
    assert contact.dissipation_per_cycle == pytest.approx(2.0 * path, rel=1e-8)


def test_unlike_materials_raise_a_warning_with_the_number():
    with pytest.warns(fc.FastcontactWarning, match=r"beta is 0\.2857"):
        fc.analytic.cattaneo_mindlin_line(E1=1.0, nu1=0.3, R1=1.0, friction=0.3, force=1e-3, tangential_force=0.0)


def test_block_sticks_then_slides():
    block = {"E": 2.6, "nu": 0.3, "height": 2.0, "pressure": 0.1, "friction": 0.5}  # G = 1, limit 0.05
    stuck = fc.analytic.block_sliding(**block, displacement=0.06)
    assert (stuck.sliding, stuck.slip, stuck.dissipation) == (False, 0.0, 0.0)
    assert stuck.shear_traction == pytest.approx(0.03, rel=1e-14)
    sliding = fc.analytic.block_sliding(**block, displacement=0.3)
    assert sliding.sliding
    assert sliding.shear_traction == pytest.approx(0.05, rel=1e-14)
    assert sliding.slip == pytest.approx(0.2, rel=1e-14)
    assert sliding.dissipation == pytest.approx(0.01, rel=1e-14)
    assert fc.analytic.block_sliding(**block, displacement=0.1).slip == pytest.approx(0.0, abs=1e-15)
    with pytest.raises(fc.ModelError, match="displacement is -1"):
        fc.analytic.block_sliding(**block, displacement=-1.0)
