"""Force-driven, displacement-driven and swapped bodies have the same result, in every formulation."""

from functools import cache

import numpy as np
import pytest
from models import elastic_model, supported
from pairwise import first_of

import fastcontact as fc

pytestmark = pytest.mark.each_value

FORMULATIONS = [
    ("node_to_segment", {}),
    ("continuous", {}),
    ("continuous", {"integration": "simpson"}),
    ("mortar", {}),
    ("mortar", {"multipliers": "dual"}),
    ("node_to_segment", {"friction": 0.2}),
    ("continuous", {"friction": 0.2}),
    ("mortar", {"friction": 0.2}),
    ("mortar", {"multipliers": "dual", "friction": 0.2}),
]


def cylinder(element, kinematics="plane_strain"):
    """Half a cylinder (a half-sphere in axisymmetry) on a block."""
    mesh = fc.generate.cylinder_on_block(element, R=50.0, size=12.0, contact_size=1.5)
    model = elastic_model(mesh, kinematics, AXIS="x", BLOCK_BOTTOM="y")
    return model, "CYLINDER_TOP", ("CONT_CYLINDER", "CONT_BLOCK"), 0.8


def sphere(element):
    """A quarter of a half-sphere on a block."""
    mesh = fc.generate.sphere_on_block(
        element, size=25.0, contact_size=4.0, contact_radius=6.0, block_size=(30.0, 30.0), growth=1.0
    )
    model = elastic_model(mesh, "3d", SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y")
    return model, "SPHERE_TOP", ("CONT_SPHERE", "CONT_BLOCK"), 1.0


def same(make, formulation, options, solver="direct", tolerance=1e-12, obstacle=None):
    """Move the top face down, then push the coupled face by the force found; compare everything."""
    results, force = [], 0.0
    for driven in (False, True):
        model, top, (secondary, primary), depth = make()
        if obstacle is None:
            model.add_contact("pair", secondary=secondary, primary=primary, formulation=formulation, **options)
        else:
            model.add_obstacle("pair", secondary=secondary, obstacle=obstacle, formulation=formulation, **options)
        if driven:
            model.couple(top, "y")
            model.add_force(top, y=-force)
        else:
            model.prescribe(top, y=-depth)
        last = fc.solve(model, fc.linear_ramp(1), linear_solver=solver, linear_tolerance=tolerance)[-1]
        results.append(last)
        force = abs(last.contact["pair"].force[1])
    moved, pushed = results
    assert np.abs(pushed.displacement - moved.displacement).max() < 1e-8 * depth
    assert np.abs(pushed.stress - moved.stress).max() < 1e-8 * np.abs(moved.stress).max()
    one, other = moved.contact["pair"], pushed.contact["pair"]
    assert np.abs(other.pressure - one.pressure).max() < 1e-8 * one.pressure_max
    assert np.array_equal(other.active, one.active)
    assert one.active.sum() > 1
    assert pushed.iterations["regularised"]["relative_to_load"] < (1e-11 if solver == "direct" else 1e-8)


@pytest.mark.parametrize(("formulation", "options"), first_of(2, FORMULATIONS))
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric"])
def test_a_cylinder_or_sphere_in_the_plane(formulation, options, kinematics):
    same(lambda: cylinder("quad4", kinematics), formulation, options)


@pytest.mark.parametrize(
    ("formulation", "options"), first_of(2, [f for f in FORMULATIONS if f[0] != "node_to_segment"])
)
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_on_quadratic_facets(formulation, options):
    same(lambda: cylinder("quad8"), formulation, options)


@pytest.mark.parametrize(
    ("formulation", "options"),
    [pytest.param(*f, marks=pytest.mark.slow) if f == ("continuous", {"friction": 0.2}) else f for f in FORMULATIONS],
)
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_a_sphere_in_space(formulation, options):
    same(lambda: sphere("hex8"), formulation, options)


@pytest.mark.parametrize(("formulation", "options"), first_of(1, [FORMULATIONS[0], FORMULATIONS[3], FORMULATIONS[4]]))
def test_with_multigrid(formulation, options):
    same(lambda: sphere("hex8"), formulation, options, solver="amg")


def alone(dim):
    """A half-cylinder or half-sphere without a block."""
    if dim == 2:
        mesh = fc.generate.quarter_disc("quad4", body="upper", R=50.0, arc_sizes=(1.5, 8.0), radial_sizes=(1.5, 8.0))
        names, secondary, top = (("A1A2", "x"),), "CONT2", "A2B2"
    else:
        mesh = fc.generate.sphere_octant("hex8", size=25.0, contact_size=4.0, contact_radius=6.0, growth=1.0)
        names, secondary, top = (("SYMMETRY_X", "x"), ("SYMMETRY_Z", "z")), "CONT_SPHERE", "SPHERE_TOP"
    model = elastic_model(mesh, "plane_strain" if dim == 2 else "3d")
    for group, axis in names:
        model.fix(group, axis)
    return model, top, (secondary, ""), 1.0


@pytest.mark.parametrize(("formulation", "options"), FORMULATIONS[:2])
@pytest.mark.parametrize("dim", [2, 3])
def test_on_a_rigid_plane(formulation, options, dim):
    plane = fc.obstacles.HalfSpace((0.0,) * dim, (0.0, 1.0, 0.0)[:dim])
    same(lambda: alone(dim), formulation, options, obstacle=plane)


@cache
def pressed(element, size, swap, multipliers="standard"):
    """Force and largest von Mises stress of a cylinder on a stiffer block."""
    model = elastic_model(fc.generate.cylinder_on_block(element, R=50.0, size=6.0, contact_size=size), "plane_strain")
    model.add_material(fc.LinearElastic(E=3000.0, nu=0.2), "BLOCK")
    supported(model, AXIS="x", BLOCK_BOTTOM="y", CYLINDER_TOP={"y": -1.0})
    sides = ("CONT_BLOCK", "CONT_CYLINDER")[:: 1 if swap else -1]
    model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar", multipliers=multipliers)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    return np.array([abs(last.contact["pair"].force[1]), last.von_mises.max()])


@pytest.mark.parametrize("multipliers", ["standard", "dual"])
@pytest.mark.parametrize("element", first_of(2, ["tri3", "quad4", "quad8"]))
def test_swapping_the_sides_of_mortar_changes_less_than_the_mesh_does(element, multipliers):
    exact = pressed("quad8", 0.15, False)
    swapped, meshed = [], []
    for size in (1.6, 0.8):
        one, other = (pressed(element, size, swap, multipliers) for swap in (False, True))
        swapped.append(np.abs(one / other - 1))
        meshed.append(max(np.abs(one / exact - 1)[1], np.abs(other / exact - 1)[1]))
        assert swapped[-1][1] < 0.2 * meshed[-1]
    assert swapped[-1].max() < 2e-3
    assert meshed[1] < 0.5 * meshed[0]


def test_swapping_the_sides_in_space():
    forces = []
    for swap in (False, True):
        mesh = fc.generate.sphere_on_block(
            "hex8", size=12.5, contact_size=2.0, contact_radius=6.0, block_size=(30.0, 30.0)
        )
        model = elastic_model(mesh, "3d", SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -0.5})
        sides = ("CONT_BLOCK", "CONT_SPHERE")[:: 1 if swap else -1]
        model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation="mortar")
        forces.append(fc.solve(model, fc.linear_ramp(1), linear_solver="direct")[-1].contact["pair"].force[1])
    assert forces[0] == pytest.approx(-forces[1], rel=2e-3)
