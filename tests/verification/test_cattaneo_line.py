"""Two equal cylinders in plane strain, pressed and loaded tangentially: partial slip, reversal, residual tractions.

The bodies mirror each other, so pressure and shear are not coupled, and Cattaneo's solution is exact for half-planes.
"""

from functools import cache

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc

E, NU, R, FRICTION = 1000.0, 0.3, 500.0, 0.4
PUSH, DRAW = 0.0085, 0.0045  # of the far faces; the contact is 0.98 wide on both sides
# Instants: pressed; drawn along twice; drawn back until hardly a force is left; drawn the other way.
ALONG = ((0, 0), (1, 0), (2, 0.3), (3, 0.7), (4, 0.007), (5, -0.35))
# Formulation, element, length of its facets.
WAYS = [("node_to_segment", "quad4", 0.0125), ("continuous", "quad4", 0.05), ("mortar", "quad4", 0.05)]
every_way = pytest.mark.parametrize("way", WAYS, ids=lambda way: way[0])


@cache
def pressed_and_drawn(formulation, element, size):
    """Return by instant the contact, with the slip of its nodes and how far the bodies were drawn."""
    mesh = fc.generate.crowned_blocks(element, R=R, contact_size=size)
    model = elastic_model(mesh, "plane_strain", E=E, nu=NU, FAR_LOWER="xy")
    model.prescribe("FAR_UPPER", y=-PUSH, ramp=[(0, 0), (1, 1), (5, 1)])
    model.prescribe("FAR_UPPER", x=-DRAW, ramp=ALONG)
    model.add_contact("pair", secondary="CONT_LOWER", primary="CONT_UPPER", formulation=formulation, friction=FRICTION)
    found = {}
    for step in fc.solve(model, fc.Ramp((1.0, 2.0, 3.0, 4.0, 5.0), ((0, 0), (5, 5)))):
        points = step.contact["pair"].points
        # Nodes of the bodies match, and the upper ones follow the lower ones.
        slip = step.displacement[points, 0] - step.displacement[points + mesh.n_points // 2, 0]
        found[step.load_factor] = step.contact["pair"], slip
    return found


def drawn(instant):
    return DRAW * np.interp(instant, *np.transpose(ALONG))


def theory(formulation, element, size, instant):
    """Cattaneo's contact under the forces found at an instant, and at the peak before it."""
    contact, _ = pressed_and_drawn(formulation, element, size)[instant]
    peak, _ = pressed_and_drawn(formulation, element, size)[min(instant, 3)]
    first = fc.analytic.cattaneo_mindlin_line(
        E1=E, nu1=NU, R1=R, E2=E, nu2=NU, R2=R, force=-contact.force[1],
        friction=FRICTION, tangential_force=abs(peak.force[0]),
    )  # fmt: skip
    return first if instant <= 3 else first.unloaded_to(-contact.force[0])


@every_way
def test_pressing_alone_is_hertz_and_brings_no_shear(way):
    contact, slip = pressed_and_drawn(*way)[1]
    normal = theory(*way, 1).normal
    assert contact.pressure_max == pytest.approx(normal.pressure_max, rel=5e-3)
    assert contact.radius[0] - way[2] < normal.radius < contact.radius[1] + way[2]
    inside = np.abs(contact.coordinates[:, 0]) < normal.radius - 2 * way[2]  # the facets at the edge tilt
    assert np.abs(contact.shear[inside]).max() < 2e-3 * normal.pressure_max
    assert contact.sticking[contact.active].all()
    assert np.abs(slip[inside]).max() < 1e-5 * PUSH


def moment(way, instant):
    """Moments of inertia of pressure and shear about the middle, the shear over the coefficient of friction."""
    contact, _ = pressed_and_drawn(*way)[instant]
    x = contact.coordinates[:, 0]
    shear, pressure = contact.force_vectors.T @ x**2
    return -pressure, -shear / FRICTION


def measured_stick_radius(way, instant):
    """Stick radius from moments of inertia, which see more than the node where sticking ends.

    That of the pressure is P a^2/4; that of a first load with stick zone c is P (a^2 - c^4/a^2)/4 over the friction.
    """
    force = -pressed_and_drawn(*way)[instant][0].force[1]
    pressure, shear = moment(way, instant)
    if instant > 3:
        shear = 0.5 * (moment(way, 3)[1] - shear)  # of the first load that, taken twice, leads back
    a2 = 4 * pressure / force
    return (a2**2 - 4 * a2 * shear / force) ** 0.25


@every_way
@pytest.mark.parametrize("instant", [2, 3, 4, 5])
def test_stick_radius(way, instant):
    exact = theory(*way, instant).stick_radius
    assert measured_stick_radius(way, instant) == pytest.approx(exact, rel=0.01)
    contact, _ = pressed_and_drawn(*way)[instant]
    x, stick = contact.coordinates[:, 0], contact.active & contact.sticking
    assert (contact.active & ~stick).any()
    for last in (-x[stick].min(), x[stick].max()):  # of the nodes that stick; the next one beyond slips
        assert last - 0.5 * way[2] < exact < last + 1.5 * way[2]


@every_way
@pytest.mark.parametrize("instant", [2, 3, 4, 5])
def test_tractions_and_slip(way, instant):
    """Also those that stay behind when the force has gone, and those of the way back."""
    contact, slip = pressed_and_drawn(*way)[instant]
    exact = theory(*way, instant)
    x, a = contact.coordinates[:, 0], exact.normal.radius
    edges = np.array([theory(*way, 3).stick_radius, exact.stick_radius, a])  # there tangents are vertical
    away = np.abs(np.abs(x)[:, None] - edges).min(axis=1) > 2.5 * way[2]
    shear, limit = -contact.shear[:, 0], FRICTION * exact.normal.pressure_max
    assert np.abs(shear - exact.traction(x))[away].max() < 0.02 * limit
    assert np.abs(shear).max() > 0.3 * limit
    middle = np.argmin(np.abs(x))
    largest = theory(*way, 3).slip(theory(*way, 3).normal.radius)
    inside = np.abs(x) < a
    assert np.abs(slip - slip[middle] - exact.slip(x))[inside].max() < 0.01 * largest


@every_way
def test_no_force_leaves_tractions_of_both_signs(way):
    contact, _ = pressed_and_drawn(*way)[4]
    limit = FRICTION * theory(*way, 4).normal.pressure_max
    assert abs(contact.force[0]) < 0.01 * FRICTION * abs(contact.force[1])
    assert (-contact.shear[:, 0]).max() > 0.2 * limit
    assert (-contact.shear[:, 0]).min() < -0.4 * limit


@every_way
def test_tangential_displacement_grows_by_slip(way):
    """Between two loads, so that the elastic part, which depends on the size of the bodies, drops out."""
    one, two = theory(*way, 2), theory(*way, 3)
    ratio = two.tangential_force / one.tangential_force
    found = drawn(3) - ratio * drawn(2)
    assert found == pytest.approx(two.slip_displacement - ratio * one.slip_displacement, rel=0.01)


@every_way
def test_dissipated_work_is_that_of_the_theory(way):
    """Friction times pressure times slip, over the zone that slips: its traction stays while the slip grows."""
    exact = theory(*way, 3)
    x = np.linspace(-exact.normal.radius, exact.normal.radius, 20_001)
    work = np.trapezoid(FRICTION * exact.normal.pressure(x) * exact.slip(x), x)
    found = sum(pressed_and_drawn(*way)[instant][0].dissipation for instant in (1, 2, 3))
    assert found == pytest.approx(work, rel=0.01)
