"""Two equal spheres in three dimensions, pressed and loaded tangentially: partial slip of Cattaneo and Mindlin.

Poisson's ratio is 0, where slip goes along the force exactly, and like bodies do not couple pressure and shear. The model
is the half z >= 0, forces below are those of the whole. Theory is taken at the forces found.
"""

import warnings
from functools import cache

import numpy as np
import pytest
from models import elastic_model
from pairwise import first_of

import fastcontact as fc
from fastcontact.mesh.generate import merge_points, mirrored, renamed, sphere_octant, union

E, R, FRICTION = 1000.0, 50.0, 0.3
G = E / 2
RADIUS = 2.5  # of the contact, about
SIZE = RADIUS / 6  # of the facets there
PUSH, DRAW = 0.255, 0.0305  # of the far faces, the planes through the centres
ALONG = ((0, 0), (1, 0), (2, 1), (3, 0), (4, -0.5))


def half_spheres():
    """Two half-spheres that touch at the origin, the halves z >= 0; contact is looked for around it."""
    octant = sphere_octant("hex8", R=R, size=25.0, contact_size=SIZE, contact_radius=1.1 * RADIUS, growth=0.9)
    octant = renamed(octant, dict.fromkeys(("SYMMETRY_X", "POLE_SPHERE", "CENTRE", "SPHERE_SIDE")))
    quarter = merge_points(union(octant, mirrored(octant, "x")), 1e-3 * SIZE)
    upper = renamed(quarter, {"SPHERE": "UPPER", "SPHERE_TOP": "FAR_UPPER", "CONT_SPHERE": "CONT_UPPER"})
    mesh = union(mirrored(upper, "y", rename=lambda name: name.replace("UPPER", "LOWER")), upper)
    around = {}
    for group in ("CONT_LOWER", "CONT_UPPER"):
        ((kind, rows),) = mesh.split(mesh.cell_groups[group]).items()
        distance = np.hypot(*mesh.points[mesh.cells[kind][rows]][:, :, [0, 2]].transpose(2, 0, 1))
        around[group] = mesh.offsets[kind] + rows[(distance < 1.35 * RADIUS).all(axis=1)]
    return mesh.with_groups(cells=around)


def held(mesh):
    return elastic_model(mesh, "3d", E=E, nu=0.0, SYMMETRY_Z="z", FAR_LOWER="xyz")


@cache
def pressed_and_drawn():
    """Return the contact by instant."""
    model = held(half_spheres())
    model.fix("FAR_UPPER", "z")
    model.prescribe("FAR_UPPER", y=-PUSH, ramp=[(0, 0), (1, 1), (4, 1)])
    model.prescribe("FAR_UPPER", x=-DRAW, ramp=ALONG)
    model.add_contact("pair", secondary="CONT_LOWER", primary="CONT_UPPER", formulation="mortar", friction=FRICTION)
    steps = fc.solve(model, fc.Ramp((1.0, 2.0, 3.0, 4.0), ((0, 0), (4, 4))), linear_solver="direct")
    return {step.load_factor: step.contact["pair"] for step in steps}


def forces(instant):
    """Normal and tangential force, positive as they first act."""
    tangential, normal, _ = 2 * pressed_and_drawn()[instant].force
    return abs(normal), -tangential


def theory(instant):
    normal, tangential = forces(instant)
    peak = forces(min(instant, 2))[1] if instant > 1 else 0.0
    first = fc.analytic.cattaneo_mindlin_sphere(
        E1=E, nu1=0.0, R1=R, E2=E, nu2=0.0, R2=R, force=normal, friction=FRICTION, tangential_force=peak
    )
    return first if instant <= 2 else first.unloaded_to(tangential)


def moments(instant):
    """Polar moments of inertia of pressure and shear about the middle, the shear over the friction."""
    contact = pressed_and_drawn()[instant]
    r2 = (contact.coordinates[:, [0, 2]] ** 2).sum(axis=1)
    shear, pressure, _ = 2 * contact.force_vectors.T @ r2
    return abs(pressure), -shear / FRICTION


def measured_radii(instant):
    """Contact and stick radius from moments of inertia, which see more than nodes.

    That of the pressure is 2/5 F a^2; that of a first load with stick radius c is 2/5 F (a^2 - c^5/a^3).
    """
    force = forces(instant)[0]
    pressure, shear = moments(instant)
    if instant > 2:
        shear = 0.5 * (moments(2)[1] - shear)  # of the first load that, taken twice, leads back
    a2 = 2.5 * pressure / force
    return a2**0.5, (a2**1.5 * (a2 - 2.5 * shear / force)) ** 0.2


def on_half_space(x, z):
    """Displacement along x of the surface of a half-space, beyond the traction sqrt(1 - r^2/a^2) along x within r < a.

    Cerruti's point load (Johnson 1985, eq. 3.75), summed. Returns also the force.
    """
    angle, weight = np.polynomial.legendre.leggauss(20)
    r, around = RADIUS * np.sin((angle + 1) * np.pi / 4), np.arange(64) * np.pi / 32
    ring = weight * np.pi / 4 * RADIUS * np.cos((angle + 1) * np.pi / 4) * r * np.sqrt(1 - (r / RADIUS) ** 2)
    load = np.repeat(ring * np.pi / 32, 64)
    apart = [p[:, None] - np.outer(r, f(around)).ravel() for p, f in ((x, np.cos), (z, np.sin))]
    distance = np.hypot(*apart)
    return (1 / distance) @ load / (2 * np.pi * G), load.sum()


@cache
def excess_compliance():
    """How much more than a half-space each body gives under a tangential force, from a solution without contact."""
    mesh = half_spheres()
    model = held(mesh)
    model.fix("FAR_UPPER", "xyz")
    model.add_traction("CONT_UPPER", x=lambda X: np.sqrt(np.maximum(1 - (X[:, 0] ** 2 + X[:, 2] ** 2) / RADIUS**2, 0)))
    points = mesh.points_of("CONT_UPPER")
    with warnings.catch_warnings():  # the root of the traction at the edge is no polynomial
        warnings.filterwarnings("ignore", "the traction on 'CONT_UPPER' varies within", fc.FastcontactWarning)
        found = fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1].displacement[points, 0]
    x, _, z = mesh.points[points].T
    beyond = np.hypot(x, z) > 1.15 * RADIUS
    expected, force = on_half_space(x[beyond], z[beyond])
    return np.mean(found[beyond] - expected) / force


def test_pressing_alone_is_hertz_and_brings_no_shear():
    contact, normal = pressed_and_drawn()[1], theory(1).normal
    assert contact.pressure_max == pytest.approx(normal.pressure_max, rel=0.01)
    assert measured_radii(1)[0] == pytest.approx(normal.radius, rel=0.01)
    assert contact.sticking[contact.active].all()
    assert abs(forces(1)[1]) < 1e-6 * forces(1)[0]


@pytest.mark.parametrize("instant", [2, 3, 4])
def test_stick_radius(instant):
    """While loading, when the bodies are back where they were, and drawn the other way."""
    exact = theory(instant).stick_radius
    assert measured_radii(instant)[1] == pytest.approx(exact, rel=0.01)
    contact = pressed_and_drawn()[instant]
    assert contact.stick_radius[0] < exact < contact.stick_radius[1]
    assert (contact.active & ~contact.sticking).any()


@pytest.mark.parametrize("instant", first_of(1, [2, 3, 4]))
def test_tangential_displacement(instant):
    """Of distant points of two half-spaces: less what the bodies, which are none, give more than those."""
    drawn = DRAW * np.interp(instant, *np.transpose(ALONG))
    found = drawn - 2 * excess_compliance() * forces(instant)[1]
    assert found == pytest.approx(theory(instant).tangential_displacement, abs=0.01 * theory(2).tangential_displacement)


@pytest.mark.parametrize("instant", [2, 3, 4])
def test_tractions(instant):
    """In the middle; further out, where they are steep, nodes stand too far apart, and moments tell more.

    When hardly a force is left, tractions of both signs stay behind.
    """
    contact, exact = pressed_and_drawn()[instant], theory(instant)
    r = np.hypot(contact.coordinates[:, 0], contact.coordinates[:, 2])
    middle = r < theory(2).stick_radius - 2.5 * SIZE
    limit = FRICTION * exact.normal.pressure_max
    assert middle.sum() > 10
    assert np.abs(-contact.shear[:, 0] - exact.traction(r))[middle].max() < 0.08 * limit
    assert np.abs(contact.shear[:, 2])[middle].max() < 0.08 * limit
    if instant == 3:
        assert abs(forces(3)[1]) < 0.05 * FRICTION * forces(3)[0]
        assert (-contact.shear[:, 0]).max() > 0.05 * limit
        assert (-contact.shear[:, 0]).min() < -0.2 * limit


def test_dissipated_work_of_the_first_load():
    """A quarter of that of a whole cycle: its two ways are twice as long each. The slip zone is 1.2 facets wide."""
    found = 2 * pressed_and_drawn()[2].dissipation
    assert found == pytest.approx(theory(2).dissipation_per_cycle / 4, rel=0.1)
