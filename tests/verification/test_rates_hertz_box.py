"""Rates of convergence for Hertz in a box: exact fields with the regularity of contact, and no model error.

Expected orders: the energy of the error h for linear and h^(3/2) for quadratic elements, whatever their order, since
the displacement has 5/2 derivatives only; its mean square h^2 (Drouet and Hild, 2015). Rates are fitted over at least
four meshes, for the edge of the contact stands in another place of a cell on each.
"""

from functools import cache

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc

FULL = {"plane_strain": 2.0, "plane_stress": 2.0, "axisymmetric": 1.0, "3d": 4.0}  # the models are halves and quarters
slow = pytest.mark.slow


def pressed(kinematics, element, n, formulation, options, radius):
    box = fc.analytic.hertz_box(kinematics=kinematics, radius=radius)
    if kinematics == "3d":
        mesh = fc.generate.box((1.0, 1.0, 1.0), (n, n, n), element, origin=(0.0, 0.0, -1.0))
        top, held, symmetry = "ZMAX", ("XMAX", "YMAX", "ZMIN"), (("XMIN", "x"), ("YMIN", "y"))
    else:
        mesh = fc.generate.block((1.0, 1.0), (n, n), element, origin=(0.0, -1.0))
        top, held, symmetry = "TOP", ("RIGHT", "BOTTOM"), (("LEFT", "x"),)
    mesh = mesh.with_groups(points={"HELD": np.concatenate([mesh.points_of(side) for side in held])})
    model = elastic_model(mesh, kinematics, E=box.E, nu=box.nu)
    for side, component in symmetry:
        model.fix(side, component)
    for axis in range(mesh.dim):
        model.prescribe("HELD", **{"xyz"[axis]: lambda points, axis=axis: box.displacement(points)[:, axis]})
    model.add_obstacle("bowl", secondary=top, obstacle=box, formulation=formulation, **dict(options))
    return model, box


@cache
def errors(kinematics, element, n, formulation="continuous", options=(), radius=0.5123):
    """Relative errors: energy norm, L2 of displacements, pressure at the centre, force."""
    model, box = pressed(kinematics, element, n, formulation, options, radius)
    last = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(geometry_updates=0))[-1]
    norms = fc.error_against(box, model, last.displacement)
    contact = last.contact["bowl"]
    centre = np.argmin(np.linalg.norm(contact.coordinates[:, :-1], axis=1))
    force = FULL[kinematics] * abs(contact.force[-1]) / box.force
    return (
        norms.relative_energy, norms.relative_displacement, abs(contact.pressure[centre] / box.pressure_max - 1),
        abs(force - 1),
    )  # fmt: skip


def order(sizes, values):
    """Fitted order of values over cells of size 1/n."""
    return -np.polyfit(np.log(sizes), np.log(values), 1)[0]


LINEAR = ("tri3", "quad4", "tet4", "hex8")
# Radius of the contact in three dimensions, for a mesh that is fine enough for the asymptotic rates of linear elements.
WIDE = 0.9123
# Sizes of the cells and absolute bounds on the finest mesh, energy and L2; about a tenth above what was measured.
CASES = [
    ("plane_strain", "quad4", "continuous", (8, 16, 32, 64), (0.0155, 6.6e-5)),
    ("plane_strain", "quad4", "node_to_segment", (8, 16, 32, 64), (0.0155, 8.0e-5)),
    ("plane_strain", "tri3", "continuous", (8, 16, 32, 64), (0.022, 1.2e-4)),
    ("plane_strain", "quad8", "continuous", (4, 8, 16, 32), (0.0021, 2.5e-5)),
    ("plane_strain", "quad9", "continuous", (4, 8, 16, 32), (0.0020, 2.2e-5)),
    ("plane_strain", "tri6", "continuous", (4, 8, 16, 32), (0.0030, 2.5e-5)),
    ("plane_stress", "quad4", "continuous", (8, 16, 32, 64), (0.0150, 6.1e-5)),
    ("axisymmetric", "quad4", "continuous", (8, 16, 32, 64), (0.0215, 6.9e-5)),
    ("axisymmetric", "quad4", "node_to_segment", (8, 16, 32, 64), (0.0215, 5.6e-5)),
    ("axisymmetric", "tri3", "continuous", (8, 16, 32, 64), (0.0310, 1.3e-4)),
    ("axisymmetric", "quad8", "continuous", (4, 8, 16, 32), (0.0038, 3.0e-5)),
    ("axisymmetric", "quad9", "continuous", (4, 8, 16, 32), (0.0036, 2.6e-5)),
    ("axisymmetric", "tri6", "continuous", (4, 8, 16, 32), (0.0054, 3.1e-5)),
    ("3d", "hex27", "continuous", (3, 4, 5, 6), (0.0420, 5.8e-4)),
    pytest.param("3d", "hex20", "continuous", (3, 4, 6, 8), (0.0310, 3.5e-4), marks=slow),
    pytest.param("3d", "tet10", "continuous", (3, 4, 6, 8), (0.0480, 5.5e-4), marks=slow),
    pytest.param("3d", "hex8", "node_to_segment", (12, 16, 24, 32), (0.0445, 2.6e-4), marks=slow),
    pytest.param("3d", "tet4", "node_to_segment", (20, 28, 36, 44), (0.0600, 4.0e-4), marks=slow),
]


def falls_as_expected(kinematics, element, formulation, sizes, bounds, **options):
    energy, displacement = np.array([errors(kinematics, element, n, formulation, **options) for n in sizes]).T[:2]
    assert order(sizes, energy) >= (0.95 if element in LINEAR else 1.35)
    assert order(sizes, displacement) >= 1.8
    assert energy[-1] < bounds[0]
    assert displacement[-1] < bounds[1]


@pytest.mark.parametrize(("kinematics", "element", "formulation", "sizes", "bounds"), CASES)
def test_rates_on_hertz_in_a_box(kinematics, element, formulation, sizes, bounds):
    falls_as_expected(kinematics, element, formulation, sizes, bounds)


@pytest.mark.parametrize(
    ("kinematics", "element", "formulation", "options"),
    [
        ("plane_strain", "quad4", "node_to_segment", ()),
        ("plane_strain", "quad4", "continuous", (("integration", "node"),)),
        ("plane_stress", "quad4", "node_to_segment", ()),
        ("axisymmetric", "quad8", "continuous", ()),
        ("axisymmetric", "quad9", "continuous", ()),
    ],
)
def test_the_pressure_at_the_centre_is_exact_to_a_ten_thousandth(kinematics, element, formulation, options):
    """On cells of 1/64; its error falls with their square."""
    sizes = (16, 32, 64)
    pressure = [errors(kinematics, element, n, formulation, options)[2] for n in sizes]
    assert pressure[-1] < 1e-4
    assert order(sizes, pressure) > 1.8


def test_the_pressure_at_the_centre_in_three_dimensions():
    sizes = (6, 8, 12, 16)
    pressure = [errors("3d", "hex8", n, "node_to_segment", radius=WIDE)[2] for n in sizes]
    assert order(sizes, pressure) > 1.8
    assert pressure[-1] < 6e-4  # 16 times that of cells of 1/64


def test_linear_elements_miss_the_pressure_on_the_axis_to_first_order():
    """Displacements linear in the radius cannot follow r^2 at the axis, where the ring of integration vanishes.

    The force on the node of the axis is consistent with the curvature to first order only, whatever the contact
    formulation or the quadrature; a few cells further the pressure is good to second order.
    """
    sizes = (16, 32, 64)
    axis = [errors("axisymmetric", "quad4", n, "node_to_segment")[2] for n in sizes]
    assert 0.8 < order(sizes, axis) < 1.2
    assert axis[-1] < 0.009
    beside = []
    for n in sizes:
        model, box = pressed("axisymmetric", "quad4", n, "node_to_segment", (), 0.5123)
        contact = fc.solve(model, fc.linear_ramp(1), criteria=fc.Criteria(geometry_updates=0))[-1].contact["bowl"]
        at = np.argmin(np.abs(contact.coordinates[:, 0] - 0.25))
        beside.append(abs(contact.pressure[at] / box.pressure(0.25) - 1))
    assert order(sizes, beside) > 1.7
    assert beside[-1] < 2e-4


@pytest.mark.parametrize(("kinematics", "element"), [("plane_strain", "quad4"), ("axisymmetric", "quad8")])
def test_the_force_is_that_of_the_theory(kinematics, element):
    sizes = (8, 16, 32)
    force = [errors(kinematics, element, n)[3] for n in sizes]
    assert order(sizes, force) > 1.0
    assert force[-1] < 6e-4
