"""Bounds of the contact radius in 3D."""

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc

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
