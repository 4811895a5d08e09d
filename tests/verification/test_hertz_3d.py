"""Point contact in three dimensions compared with Hertz at equal force: spheres and ellipsoids.

A quarter of every body is meshed. Radii are taken from first moments of the contact force: under Hertz's pressure its
mean distance from an axis of the ellipse is 3/8 of the semi-axis.
"""

import numpy as np
import pytest
from models import elastic_model, with_obstacle

import fastcontact as fc

E, NU = 1000.0, 0.3
slow = pytest.mark.slow


def measured(contact, vertical):
    """Force of the four quarters, pressure at the pole, semi-axes, and pressure of the ellipsoid that fits best.

    The fit (in the mean square over the ellipse) weighs nodal forces with Hertz's shape, whose square has the integral
    pi a b / 8 over a quarter. It is for six-node facets, whose corners no force belongs to: pressures there are noisy.
    """
    push = contact.force_vectors[:, vertical] * np.sign(contact.force[vertical])
    across = np.abs(np.delete(contact.coordinates, vertical, axis=1))
    semi_axes = push @ across / push.sum() / 0.375
    inside = np.maximum(1 - ((across / semi_axes) ** 2).sum(axis=1), 0.0)
    fitted = push @ np.sqrt(inside) / (np.pi * semi_axes.prod() / 8)
    return 4 * push.sum(), contact.pressure[np.argmax(inside)], semi_axes, fitted


def errors(contact, vertical, R_x, R_y, fit=False):
    """Relative errors of the largest pressure and of both semi-axes, at equal force."""
    force, pressure, semi_axes, fitted = measured(contact, vertical)
    theory = fc.analytic.hertz_elliptical(E1=E, nu1=NU, R1x=R_x, R1y=R_y, force=force)
    expected = np.array([theory.pressure_max, theory.radius_x, theory.radius_y])
    return np.array([fitted if fit else pressure, *semi_axes]) / expected - 1


def sphere_on_plane(element, formulation, size, growth=0.4, far=None):
    """Contact of an elastic half-sphere of radius 1 pressed on a rigid plane; the contact is 0.1 wide."""
    mesh = fc.generate.sphere_octant(
        element, R=1.0, contact_size=0.1 * size, contact_radius=0.13, growth=growth, size=far
    )
    model = elastic_model(mesh, "3d", E=E, nu=NU, SYMMETRY_X="x", SYMMETRY_Z="z", SPHERE_TOP={"y": -0.01})
    plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0, 0.0))
    model.add_obstacle("hertz", secondary="CONT_SPHERE", obstacle=plane, formulation=formulation)
    return fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1].contact["hertz"]


def block_under_paraboloid(element, formulation, size, R_y=200.0, growth=0.4):
    """Contact of an elastic block under a rigid paraboloid of radii 100 and `R_y`, 8 contact radii wide and deep."""
    theory = fc.analytic.hertz_elliptical(E1=E, nu1=NU, R1x=100.0, R1y=R_y, force=1.0)
    a, b = theory.radius_x, theory.radius_y
    mesh = fc.generate.graded_block(
        element, width=8 * b, contact_radius=1.25 * a, contact_radius_y=1.25 * b, contact_size=size * a, growth=growth
    )
    model = elastic_model(mesh, "3d", E=E, nu=NU, SYMMETRY_X="x", SYMMETRY_Y="y", BOTTOM="z")
    curvature = np.array([1 / 100.0, 1 / R_y])
    paraboloid = fc.obstacles.Height(lambda x: (0.5 * x**2 @ curvature, x * curvature), "above")
    with_obstacle(model, "hertz", "CONTACT", paraboloid, motion={"z": -theory.approach}, formulation=formulation)
    return fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1].contact["hertz"]


@pytest.mark.parametrize(
    ("element", "formulation", "size", "fit"),
    [
        ("hex8", "node_to_segment", 0.25, False),
        pytest.param("hex8", "node_to_segment", 0.18, False, marks=slow),
        pytest.param("hex8", "continuous", 0.17, False, marks=slow),
        pytest.param("tet10", "continuous", 0.4, True, marks=slow),
    ],
)
def test_a_sphere_on_a_rigid_plane_is_hertz_at_equal_force(element, formulation, size, fit):
    """A half-sphere with 4 to 6 edges over the contact radius, a tenth of its own: 9 800 unknowns with 4."""
    options = {"growth": 0.6, "far": 0.5} if element == "tet10" else {}
    assert np.abs(errors(sphere_on_plane(element, formulation, size, **options), 1, 1.0, 1.0, fit)).max() < 0.01


@pytest.mark.parametrize(
    ("element", "formulation", "size", "growth", "fit"),
    [
        ("hex8", "node_to_segment", 0.18, 0.4, False),
        ("hex20", "continuous", 0.5, 0.6, False),
        pytest.param("hex8", "continuous", 0.18, 0.4, False, marks=slow),
        pytest.param("tet10", "continuous", 0.5, 0.6, True, marks=slow),
        pytest.param("hex20", "continuous", 0.3, 0.6, False, marks=slow),
    ],
)
def test_an_elliptical_contact_is_hertz_at_equal_force(element, formulation, size, growth, fit):
    """Radii 1 : 2, semi-axes 1 : 1.58; 9 000 to 15 000 unknowns."""
    contact = block_under_paraboloid(element, formulation, size, growth=growth)
    assert np.abs(errors(contact, 2, 100.0, 200.0, fit)).max() < 0.01


def test_a_rigid_sphere_on_a_block_of_tetrahedra_is_hertz_at_equal_force():
    contact = block_under_paraboloid("tet10", "continuous", 0.5, R_y=100.0, growth=0.6)
    assert np.abs(errors(contact, 2, 100.0, 100.0, fit=True)).max() < 0.01


# Bounds of the contact radius in 3D.

FORCE = 60.0


def pressed(element: str, size: float, obstacle, top, formulation: str | None) -> fc.ContactResult:
    """Return the contact of an obstacle with a quarter of a block, whose top `top` (n, 2) -> (n,) lowers."""
    mesh = fc.generate.graded_block(element, width=16.0, contact_radius=1.3, contact_size=size, growth=0.6)
    x, y, z = mesh.points.T
    depth = -z.min()
    mesh = mesh.replace(points=np.column_stack([x, y, z - top(x) * (z + depth) / depth]))
    model = elastic_model(mesh, "3d", SYMMETRY_X="x", SYMMETRY_Y="y", BOTTOM="z")
    options = {} if formulation is None else {"formulation": formulation}
    model.add_obstacle("pair", secondary="CONTACT", obstacle=obstacle, force={"z": -FORCE / 4.0}, **options)
    return fc.solve(model, 1, linear_solver="direct")[-1].contact["pair"]


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
@pytest.mark.parametrize(
    ("element", "size", "formulation"),
    [("hex8", 0.25, None), ("hex8", 0.2, "mortar"), ("hex8", 0.2, "continuous"), ("hex20", 0.4, None),
     ("hex20", 0.4, "mortar"), ("tet10", 0.4, None)],
)  # fmt: skip
def test_the_radius_of_a_circle_is_between_the_bounds(element: str, size: float, formulation: str | None) -> None:
    sphere = fc.obstacles.Sphere((0.0, 0.0, 20.0), 20.0)
    low, high = pressed(element, size, sphere, np.zeros_like, formulation).radius
    exact = fc.analytic.hertz_point(E1=1000.0, nu1=0.3, R1=20.0, force=FORCE).radius
    assert low < exact < high
    assert high - low < 2.5 * size
    assert 0.5 * (low + high) == pytest.approx(exact, rel=0.1)


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
@pytest.mark.parametrize("formulation", [None, "mortar", "continuous"])
def test_both_semi_axes_of_an_ellipse_are_between_the_bounds(formulation: str | None) -> None:
    """The block is a part of a cylinder of radius 40 along y."""
    cylinder = fc.obstacles.Cylinder(point=(0.0, 0.0, 20.0), axis=(1.0, 0.0, 0.0), R=20.0)
    contact = pressed("hex8", 0.2, cylinder, lambda x: 40.0 - np.sqrt(1600.0 - x**2), formulation)
    exact = fc.analytic.hertz_elliptical(E1=1000.0, nu1=0.3, R1x=np.inf, R1y=20.0, R2x=40.0, R2y=np.inf, force=FORCE)
    axes = sorted([exact.radius_x, exact.radius_y])
    assert contact.radius[0] < axes[0]
    assert axes[1] < contact.radius[1]
