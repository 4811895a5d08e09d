"""Bodies against rigid obstacles: the half sphere on a plane, Hertz in a box, the flat punch, friction on a moving plane."""

import re

import numpy as np
import pytest
from models import elastic_model, united, with_obstacle
from pairwise import first_of

import fastcontact as fc

pytestmark = pytest.mark.pairwise

FORCE, PRESSURE, RADIUS = 659_773.142, 2910.4071, 10.358557


def half_sphere_on_plane(mesh, formulation, **options):
    model = elastic_model(mesh, "axisymmetric", E=20_000.0, A1A2="x", A1B1={"y": 2.0})
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0))
    return with_obstacle(model, "plane", "CONT1", plane, formulation=formulation, **options)


@pytest.mark.parametrize(("formulation", "element", "force", "pressure"), first_of(1, [
    ("continuous", "quad8", 5e-5, 1e-4), ("node_to_segment", "quad4", 2e-3, 5e-3), ("continuous", "quad4", 2e-3, 5e-3),
]))  # fmt: skip
def test_a_half_sphere_on_a_plane_reaches_the_mesh_converged_solution(formulation, element, force, pressure):
    mesh = fc.generate.quarter_disc(element, arc_sizes=(0.2, 2.0), radial_sizes=(0.2, 3.0))
    contact = fc.solve(half_sphere_on_plane(mesh, formulation), fc.linear_ramp(1))[-1].contact["plane"]
    assert abs(contact.force[1]) == pytest.approx(FORCE, rel=force)
    assert contact.pressure_max == pytest.approx(PRESSURE, rel=pressure)
    assert contact.radius[0] - 0.7 < RADIUS < contact.radius[1] + 0.7  # a facet is 0.7 long there


def test_moving_the_plane_is_moving_the_body():
    mesh = fc.generate.quarter_disc("quad4")
    held = half_sphere_on_plane(mesh, "continuous")
    moved = elastic_model(mesh, "axisymmetric", E=20_000.0, A1A2="x", A1B1="y")
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0))
    moved.add_obstacle("plane", secondary="CONT1", obstacle=plane, motion={"y": -2.0})
    one, other = (fc.solve(model, fc.linear_ramp(3))[-1] for model in (held, moved))
    assert np.abs(one.stress - other.stress).max() < 1e-9 * np.abs(one.stress).max()


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("element", ["quad4", "quad8", "tri6"])
@pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:.*are too stiff", "ignore:rotations of up to")
def test_a_corner_that_touches_alone_does_not_penetrate(element, friction):
    """A cantilever is bent by a plane at its lower corner: only there does it touch, and its force is that of the node."""
    mesh = fc.generate.block((4.0, 1.0), (8, 2), element)
    angle = np.radians(5.0)
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    plane = fc.obstacles.HalfSpace((4.0 * np.cos(angle), -4.0 * np.sin(angle)), (0.0, 1.0))
    forces = {}
    for name, options in {
        "default": {}, "gauss": {"integration": "gauss"}, "node": {"formulation": "node_to_segment"}
    }.items():  # fmt: skip
        model = elastic_model(mesh.replace(points=mesh.points @ turn.T), "plane_strain", LEFT="xy")
        model.add_obstacle("c", secondary="BOTTOM", obstacle=plane, motion={"y": 0.05}, friction=friction, **options)
        contact = fc.solve(model, fc.linear_ramp(1))[-1].contact["c"]
        assert contact.active.sum() == 1
        forces[name] = np.linalg.norm(contact.force)
    assert forces["default"] == pytest.approx(forces["node"], rel=1e-9)
    assert forces["gauss"] < 0.97 * forces["node"]


def test_facets_at_an_axis_keep_their_gauss_points():
    mesh, contacts = fc.generate.quarter_disc("quad8"), []
    for options in ({}, {"integration": "gauss"}):
        model = half_sphere_on_plane(mesh, "continuous", **options)
        contacts.append(fc.solve(model, fc.linear_ramp(1))[-1].contact["plane"])
    assert contacts[0].pressure == pytest.approx(contacts[1].pressure, abs=1e-8 * PRESSURE)


class Bowl:
    """The obstacle of the manufactured problem: its gap is measured along y, at the reference position."""

    def __init__(self, height):
        self.height = height

    def distance(self, points):
        normal = np.zeros_like(points)
        normal[:, 1] = -1.0
        return self.height(points[:, 0]) - points[:, 1], normal


def hertz_box(element, n, kinematics="plane_strain"):
    """The manufactured problem: exact displacements on all sides but the top, a rigid parabola above it."""
    box = fc.analytic.hertz_box(kinematics=kinematics, E=1000.0, nu=0.3, radius=0.5123, pressure_max=50.0)
    mesh = fc.generate.block((1.0, 1.0), (n, n), element, origin=(0.0, -1.0))
    model = elastic_model(mesh, kinematics, LEFT="x")
    for side in ("RIGHT", "BOTTOM"):
        for k, axis in enumerate("xy"):
            if (side, axis) != ("BOTTOM", "x"):
                model.prescribe(side, **{axis: lambda x, k=k: box.displacement(x)[:, k]})
    model.mesh = mesh.with_groups(points={"REST": np.setdiff1d(mesh.points_of("BOTTOM"), mesh.points_of("LEFT"))})
    model.prescribe("REST", x=lambda x: box.displacement(x)[:, 0])
    model.add_obstacle("bowl", secondary="TOP", obstacle=Bowl(box.obstacle))
    return model, box


def test_a_flat_punch_leaves_the_surface_beside_it_free():
    mesh = fc.generate.block((4.0, 4.0), (32, 32), "quad4", origin=(0.0, -4.0))
    model = elastic_model(mesh, "axisymmetric", LEFT="x", BOTTOM="y")
    punch = fc.obstacles.FlatPunch(0.5)
    model.add_obstacle("punch", secondary="TOP", obstacle=punch, motion={"y": -0.01}, formulation="node_to_segment")
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    contact = last.contact["punch"]
    beneath = contact.coordinates[:, 0] <= 0.5
    assert contact.active.tolist() == beneath.tolist()
    assert last.displacement[contact.points[beneath], 1] == pytest.approx(-0.01, rel=1e-12)
    half_space = fc.analytic.flat_punch(E=1000.0, nu=0.3, radius=0.5, approach=0.01).force
    assert half_space < abs(contact.force[1]) < 1.4 * half_space  # a finite block is stiffer, the mesh too


def test_a_clearance_is_not_a_penetration_beside_the_facets():
    model = elastic_model(
        fc.generate.block((50.0, 2.0), (50, 2), "quad8"), "plane_strain", E=200e3, LEFT="x", RIGHT="xy"
    )
    model.add_pressure("TOP", 5.0)
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, clearance=0.5)
    step = fc.solve(model, 1)[-1]
    assert step.contact["floor"].normal_force > 100.0
    assert not [text for text in step.warnings if "too large for such a peak" not in text]  # where the strip lifts off


def test_a_plane_drawn_along_drags_by_friction():
    model = elastic_model(fc.generate.block((1.0, 1.0), (4, 4), "quad4"), "plane_strain", nu=0.0, TOP="xy")
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("plane", secondary="BOTTOM", obstacle=plane, motion={"x": 0.01, "y": 1e-3}, friction=0.2)
    contact = fc.solve(model, fc.linear_ramp(5))[-1].contact["plane"]
    assert contact.force[0] / contact.force[1] == pytest.approx(0.2, rel=1e-9)
    assert contact.dissipation > 0


def test_wrong_obstacles_are_refused():
    model = elastic_model(fc.generate.block((1.0, 1.0), (2, 2), "quad4"), "plane_strain", E=1.0)
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    with pytest.raises(fc.ModelError, match="motion of obstacle 'p'"):
        model.add_obstacle("p", secondary="BOTTOM", obstacle=plane, motion={"z": 1.0})
    with pytest.raises(fc.ContactError, match="2 finite numbers"):
        model.add_obstacle("p", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 1.0)))


@pytest.mark.filterwarnings("ignore:.*deviate from their arcs")
@pytest.mark.parametrize(("element", "formulation"), [("quad8", None), ("quad4", None), ("quad8", "mortar")])
def test_a_pressure_peak_below_a_rounded_edge_that_facets_do_not_resolve_is_told(element, formulation):
    """The exact peak is 28.9 (Ciavarella, Hills, Monno 1998). The second mesh has 5 facets over the rounding in contact."""

    def rounded(x):
        beyond = np.maximum(np.abs(x) - 1.0, 0.0)
        return beyond[:, 0] ** 2 / 8.0, np.sign(x) * beyond / 4.0

    def pressed(size):
        mesh = fc.generate.graded_block(element, width=60.0, contact_radius=2.0, contact_size=size)
        model = elastic_model(mesh, "plane_strain", SYMMETRY_X="x", BOTTOM="y")
        shape = fc.obstacles.Height(rounded, side="above")
        model.add_obstacle("punch", secondary="CONTACT", obstacle=shape, force={"y": -20.0}, formulation=formulation)
        return fc.solve(model, 1)[-1].contact["punch"].pressure_max

    with pytest.warns(fc.FastcontactWarning, match="Facets are too large for such a peak, which may be wrong by"):
        pressed(0.2)
    assert pressed(0.04) == pytest.approx(28.9, rel=0.03)


@pytest.mark.parametrize("side", ["alone", "secondary", "primary"])
@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("edge", ["rounded", "inclined", "box"])
def test_a_rounded_edge_of_three_facets_is_told_and_a_corner_is_not(edge, element, side):
    """Fine meshes have peaks above 19 at the rounding of radius 1; those at corners are infinite."""
    pad = fc.generate.block((12.0, 6.0), (36, 12), element)
    beyond, depth = np.maximum(np.abs(pad.points[:, 0] - 6.0) - 5.0, 0.0), pad.points[:, 1]
    height = {"rounded": 1.0 - np.sqrt(1.0 - 0.99 * beyond**2), "inclined": 0.7 * beyond, "box": 0.0 * beyond}[edge]
    pad = pad.replace(points=pad.points + np.outer(height * (1.0 - depth / 6.0), (0.0, 1.0)))
    pad = pad.merged_groups("UNDER", ["BOTTOM", "LEFT", "RIGHT"] if edge == "box" else ["BOTTOM"])
    if side == "alone":
        model = elastic_model(pad, TOP={"x": 0.0, "y": -0.02})
        model.add_obstacle("c", secondary="UNDER", obstacle=fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0)))
    else:
        base = fc.generate.block((24.0, 8.0), (72, 16), element, origin=(-6.0, -8.0))
        model = elastic_model(united(P_=pad, B_=base), P_TOP={"x": 0.0, "y": -0.05}, B_BOTTOM="xy")
        one, other = ("P_UNDER", "B_TOP") if side == "secondary" else ("B_TOP", "P_UNDER")
        model.add_contact("c", secondary=one, primary=other)
    last = fc.solve(model, 1)[-1]
    assert last.contact["c"].pressure_max < 17.0 or edge != "rounded"
    told = [text for text in last.warnings if re.search(r"several times as large.* degrees within a facet", text)]
    assert len(told) == (edge == "rounded")


@pytest.mark.filterwarnings("ignore:.*nodal pressures oscillate", "ignore:the energy of these load steps")
def test_open_nodes_between_closed_ones_do_not_end_the_contact():
    """On quad8 cells, wear opens every corner node under a turning cylinder; the contact is nine facets wide all the same."""
    model = elastic_model(fc.generate.block((8.0, 4.0), (64, 8), "quad8", (-4.0, -4.0)), "plane_strain", BOTTOM="xy")
    turn = {"angle": 2.0, "centre": (0.0, 10.0), "ramp": [(0, 0), (1, 0), (2, 1)]}
    load = {"force": {"y": -20.0}, "ramp": [(0, 0), (1, 1), (2, 1)], "rotation": turn, "wear": 2e-4}
    model.add_obstacle("roller", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 10.0), 10.0), **load)
    last = fc.solve(model, [1.0, 1.25, 1.5, 1.75, 2.0])[-1]
    contact = last.contact["roller"]
    inside = np.abs(contact.coordinates[:, 0]) < 0.9
    assert 0 < contact.active[inside].sum() < inside.sum()
    assert not any("across its radius" in text for text in last.warnings)
