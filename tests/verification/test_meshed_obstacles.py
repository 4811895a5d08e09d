"""Rigid meshed surfaces as obstacles: equal to the exact shapes up to their discretisation."""

import numpy as np
import pytest
from models import elastic_model
from pairwise import first_of

import fastcontact as fc
from fastcontact import obstacles
from fastcontact.mesh.generate import block, box, quarter_disc, sphere_octant, union
from fastcontact.mesh.mesh import Mesh


def lines(points, element, group="TOOL"):
    """A mesh of lines from point to point, normals to the right of their direction."""
    step = 1 if element == "line2" else 2
    k = np.arange(0, len(points) - step, step)
    cells = np.column_stack([k, k + step] + ([k + 1] if step == 2 else []))
    return Mesh(points, {element: cells}, cell_groups={group: np.arange(len(cells))})


def half_sphere(obstacle, formulation="continuous", element="quad4"):
    model = elastic_model(quarter_disc(element), "axisymmetric", E=20_000.0, A1A2="x", A1B1={"y": 2.0})
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
    mesh = block((8.0, 4.0), (32, 16), "quad8", origin=(0.0, -4.0))
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
    ball = sphere_octant("hex8", R=2.0, size=0.8, contact_size=0.12, contact_radius=0.4)
    tool = box((2.5, 1.0, 2.5), (3, 1, 4), facet, (0.0, -1.0, 0.0))

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
    ball = sphere_octant("hex20", R=2.0, size=0.8, contact_size=0.3, contact_radius=0.5)
    ball = ball.merged_groups("BALL", ("CONT_SPHERE", "SPHERE_SIDE"))
    body = box((2.0, 1.0, 2.0), (12, 4, 12), "hex8", (0.0, -1.0, 0.0))

    def pressed(obstacle):
        model = elastic_model(body, "3d", XMIN="x", ZMIN="z", YMIN="y")
        model.add_obstacle("ball", secondary="YMAX", obstacle=obstacle, motion={"y": -0.05})
        return fc.solve(model, fc.linear_ramp(1))[-1].contact["ball"]

    meshed, exact = pressed(obstacles.MeshedSurface(ball, "BALL")), pressed(obstacles.Sphere((0.0, 2.0, 0.0), 2.0))
    assert meshed.force[1] == pytest.approx(exact.force[1], rel=2e-3)
    assert meshed.active.sum() == exact.active.sum()


def test_a_rigid_surface_may_be_part_of_the_models_own_mesh():
    body = block((1.0, 1.0), (4, 4), "quad4")
    tool = lines(np.array([[-0.5, 1.02], [0.5, 1.0], [1.5, 1.02]]), "line2")
    mesh = union(body, tool)
    model = elastic_model(mesh, "plane_strain", BOTTOM="xy")
    surface = obstacles.MeshedSurface(mesh, "TOOL")
    model.add_obstacle("tool", secondary="TOP", obstacle=surface, motion={"y": -0.02}, formulation="node_to_segment")
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    contact = last.contact["tool"]
    assert contact.active[np.argmin(np.abs(contact.coordinates[:, 0] - 0.5))]
    assert contact.force[1] < 0
    moved = contact.coordinates + last.displacement[contact.points]
    assert (surface.distance(moved - [0.0, -0.02])[0] > -1e-12).all()
