"""Rigid meshed surfaces as obstacles, and weighted gaps against rigid obstacles: equal to exact solutions."""

import numpy as np
import pytest
from models import elastic_model, with_obstacle
from pairwise import first_of

import fastcontact as fc
from fastcontact import obstacles


def lines(points, element, group="TOOL"):
    """A mesh of lines from point to point, normals to the right of their direction."""
    step = 1 if element == "line2" else 2
    k = np.arange(0, len(points) - step, step)
    cells = np.column_stack([k, k + step] + ([k + 1] if step == 2 else []))
    return fc.Mesh(points, {element: cells}, cell_groups={group: np.arange(len(cells))})


def half_sphere(obstacle, formulation="continuous", element="quad4"):
    model = elastic_model(fc.generate.quarter_disc(element), "axisymmetric", E=20_000.0, A1A2="x", A1B1={"y": 2.0})
    model.add_obstacle("tool", secondary="CONT1", obstacle=obstacle, formulation=formulation)
    return fc.solve(model, fc.linear_ramp(2))[-1]


@pytest.mark.parametrize(
    ("formulation", "element", "facet"),
    first_of(
        1, [("continuous", "quad8", "line2"), ("continuous", "quad4", "line3"), ("node_to_segment", "tri3", "line2")]
    ),
)
def test_a_meshed_plane_is_a_plane(formulation, element, facet):
    x = np.linspace(0.0, 60.0, 41) + 0.2 * np.sin(np.arange(41) * np.pi / 2)  # facets of several lengths
    plane = lines(np.column_stack([x, np.zeros(41)]), facet)
    meshed = half_sphere(obstacles.MeshedSurface(plane, "TOOL"), formulation, element)
    exact = half_sphere(obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0)), formulation, element)
    assert np.abs(meshed.stress - exact.stress).max() < 1e-10 * np.abs(exact.stress).max()
    assert meshed.contact["tool"].force == pytest.approx(exact.contact["tool"].force, rel=1e-11)


def pressed_block(obstacle, formulation="continuous"):
    mesh = fc.generate.block((8.0, 4.0), (32, 16), "quad8", origin=(0.0, -4.0))
    model = elastic_model(mesh, "axisymmetric", LEFT="x", BOTTOM="y")
    model.add_obstacle("ball", secondary="TOP", obstacle=obstacle, motion={"y": -0.1}, formulation=formulation)
    return fc.solve(model, fc.linear_ramp(2))[-1].contact["ball"]


def test_a_meshed_ball_becomes_a_ball_as_its_facets_shrink():
    exact = pressed_block(obstacles.Sphere((0.0, 10.0), 10.0))
    errors = []
    for n in (8, 16):
        angle = np.linspace(0.0, 0.5 * np.pi, 2 * n + 1)
        arc = np.column_stack([10 * np.sin(angle), 10 - 10 * np.cos(angle)])
        found = pressed_block(obstacles.MeshedSurface(lines(arc, "line3"), "TOOL"))
        errors.append(abs(found.force[1] / exact.force[1] - 1))
        assert np.abs(found.pressure - exact.pressure).max() < 0.02 * exact.pressure_max
    assert errors[0] < 5e-4
    assert errors[1] < 0.2 * errors[0]


@pytest.mark.parametrize("facet", first_of(1, ["hex8", "tet4", "hex20"]))
def test_a_meshed_plane_in_three_dimensions_is_a_plane(facet):
    ball = fc.generate.sphere_octant("hex8", R=2.0, size=0.8, contact_size=0.12, contact_radius=0.4)
    tool = fc.generate.box((2.5, 1.0, 2.5), (3, 1, 4), facet, (0.0, -1.0, 0.0))

    def pressed(obstacle):
        model = elastic_model(ball, "3d", SYMMETRY_X="x", SYMMETRY_Z="z", SPHERE_TOP={"y": -0.04})
        model.add_obstacle("floor", secondary="CONT_SPHERE", obstacle=obstacle)
        return fc.solve(model, fc.linear_ramp(1))[-1]

    meshed = pressed(obstacles.MeshedSurface(tool, "YMAX"))
    exact = pressed(obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0, 0.0)))
    assert exact.contact["floor"].active.sum() > 3
    assert np.abs(meshed.displacement - exact.displacement).max() < 1e-10 * np.abs(exact.displacement).max()


def test_a_meshed_ball_presses_a_block_in_three_dimensions():
    """A rigid octant of quadratic facets against the exact ball."""
    ball = fc.generate.sphere_octant("hex20", R=2.0, size=0.8, contact_size=0.3, contact_radius=0.5)
    ball = ball.merged_groups("BALL", ("CONT_SPHERE", "SPHERE_SIDE"))
    body = fc.generate.box((2.0, 1.0, 2.0), (12, 4, 12), "hex8", (0.0, -1.0, 0.0))

    def pressed(obstacle):
        model = elastic_model(body, "3d", XMIN="x", ZMIN="z", YMIN="y")
        model.add_obstacle("ball", secondary="YMAX", obstacle=obstacle, motion={"y": -0.05})
        return fc.solve(model, fc.linear_ramp(1))[-1].contact["ball"]

    meshed, exact = pressed(obstacles.MeshedSurface(ball, "BALL")), pressed(obstacles.Sphere((0.0, 2.0, 0.0), 2.0))
    assert meshed.force[1] == pytest.approx(exact.force[1], rel=2e-3)
    assert meshed.active.sum() == exact.active.sum()


def test_a_rigid_surface_may_be_part_of_the_models_own_mesh():
    body = fc.generate.block((1.0, 1.0), (4, 4), "quad4")
    tool = lines(np.array([[-0.5, 1.02], [0.5, 1.0], [1.5, 1.02]]), "line2")
    mesh = fc.generate.union(body, tool)
    model = elastic_model(mesh, "plane_strain", BOTTOM="xy")
    surface = obstacles.MeshedSurface(mesh, "TOOL")
    model.add_obstacle("tool", secondary="TOP", obstacle=surface, motion={"y": -0.02}, formulation="node_to_segment")
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    contact = last.contact["tool"]
    assert contact.active[np.argmin(np.abs(contact.coordinates[:, 0] - 0.5))]
    assert contact.force[1] < 0
    moved = contact.coordinates + last.displacement[contact.points]
    assert (surface.distance(moved - [0.0, -0.02])[0] > -1e-12).all()


QUADRATIC = ["tet10", "hex20", "wedge15"]


def drawn(element, by, friction=0.3, **options):
    """A block pressed on a rigid plane and drawn along it by its top, with uniform pressure."""
    mesh = fc.generate.box((2.0, 1.0, 0.5), (3, 2, 1), element)
    model = elastic_model(mesh, "3d", nu=0.0, ZMAX={"x": by, "y": 0.0, "z": -0.01}, ZMIN={"x": by, "y": 0.0})
    plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return with_obstacle(model, "plane", "ZMIN", plane, friction=friction, **options)


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("element", [*QUADRATIC, "hex8"])
def test_uniform_pressure_and_full_friction_of_a_drawn_block(element, solver):
    contact = fc.solve(drawn(element, 0.02, formulation="mortar"), 1, linear_solver=solver)[-1].contact["plane"]
    pressure = 1000.0 * 0.01 / 0.5
    np.testing.assert_allclose(contact.pressure, pressure, rtol=1e-6)
    np.testing.assert_allclose(contact.shear, np.tile([-0.3 * pressure, 0.0, 0.0], (len(contact.shear), 1)), atol=1e-5)
    np.testing.assert_allclose(contact.force, [-0.3 * 2 * pressure, 0.0, 2 * pressure], atol=1e-5)


def under_a_ball(element, size, **options):
    mesh = fc.generate.graded_block(element, width=10.0, contact_radius=2.5, contact_size=size, size=2.5)
    model = elastic_model(mesh, "3d", E=2e5, BOTTOM="z", SYMMETRY_X="x", SYMMETRY_Y="y")
    ball = fc.obstacles.Sphere((0.0, 0.0, 50.0), 50.0)
    return with_obstacle(model, "ball", "CONTACT", ball, motion={"z": -0.1}, **options)


@pytest.mark.parametrize("element", ["tet10", "hex20"])
def test_a_ball_with_friction_is_solved_by_default(element):
    """Hertz by the force: friction raises the pressure of a block of finite size by some per cent at most."""
    model = under_a_ball(element, 0.7, friction=0.3)
    assert model.contact[0].method == "mortar with dual multipliers"
    contact = fc.solve(model, 1)[-1].contact["ball"]
    hertz = fc.analytic.hertz_point(E1=2e5, nu1=0.3, R1=np.inf, R2=50.0, force=4 * abs(contact.force[2]))
    assert contact.pressure_max == pytest.approx(hertz.pressure_max, rel=0.06)
    shear = np.linalg.norm(contact.shear, axis=1)
    assert (shear <= 0.3 * contact.pressure + 0.02 * contact.pressure_max).all()
    on_axis = np.hypot(*contact.coordinates[:, :2].T) < 1e-9
    assert shear[on_axis].max() < 1e-6 * contact.pressure_max
    for axis in (0, 1):  # in a plane of symmetry nothing slides across it
        inside = np.abs(contact.coordinates[:, axis]) < 1e-9
        assert np.abs(contact.shear[inside, axis]).max() < 0.01 * contact.pressure_max


def test_the_remedy_for_a_full_compliance_that_is_too_large_works(monkeypatch):
    monkeypatch.setattr("fastcontact.analysis.friction.delassus.MAX_ROWS_WITH_FRICTION", 50)
    refused = under_a_ball("hex20", 1.2, friction=0.3, formulation="continuous")
    with pytest.raises(
        fc.ContactError, match=r'formulation="mortar" with multipliers="dual", with linear_solver="amg"'
    ):
        fc.solve(refused, 1)
    named = under_a_ball("hex20", 1.2, friction=0.3, formulation="mortar", multipliers="dual")
    assert fc.solve(named, 1, linear_solver="amg")[-1].contact["ball"].force[2] < 0.0


@pytest.mark.parametrize(
    ("element", "kinematics"), [("quad8", "axisymmetric"), ("quad4", "plane_strain"), ("tri6", "plane_strain")]
)
def test_in_the_plane_the_force_is_that_of_the_continuous_form(element, kinematics):
    def force(**options):
        mesh = fc.generate.graded_block(element, width=10.0, contact_radius=2.5, contact_size=0.25, size=2.5)
        model = elastic_model(mesh, kinematics, E=2e5, BOTTOM="xy", SYMMETRY_X="x")
        with_obstacle(model, "ball", "CONTACT", fc.obstacles.Sphere((0.0, 50.0), 50.0), motion={"y": -0.1}, **options)
        return fc.solve(model, 1)[-1].contact["ball"].force[1]

    assert force(formulation="mortar") == pytest.approx(force(formulation="continuous"), rel=2e-3)


def test_a_turning_obstacle_drags_with_the_torque_of_full_friction():
    """A plane that turns under a square block; the error is that of the nodes' places, of second order."""
    mean_radius = (np.sqrt(2) + np.log(1 + np.sqrt(2))) / 3  # of a square of half-width 1
    off = []
    for cells in (4, 8):
        mesh = fc.generate.box((2.0, 2.0, 0.5), (cells, cells, 1), "hex20", (-1.0, -1.0, 0.0))
        model = elastic_model(mesh, "3d", nu=0.0, ZMAX={"x": 0.0, "y": 0.0, "z": -0.01}, ZMIN={"x": 0.0, "y": 0.0})
        plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        rotation = {"angle": 0.1, "centre": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
        model.add_obstacle("plane", secondary="ZMIN", obstacle=plane, friction=0.3, rotation=rotation)
        contact = fc.solve(model, 1)[-1].contact["plane"]
        off.append(abs(contact.torque) / (0.3 * 20.0 * 4.0 * mean_radius) - 1.0)
    assert abs(off[0]) < 0.035  # of which the node on the axis, whose direction is any, has 0.02
    assert abs(off[1]) < 0.012
