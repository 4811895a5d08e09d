"""Force-driven rigid obstacles: equal to displacement-driven ones; failures."""

import json

import h5py
import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact import obstacles
from fastcontact.cases.case import read_case
from fastcontact.cases.summary import lines, of_step, summarise
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.mesh.generate import block, box, quarter_disc

pytestmark = pytest.mark.each_value


def block_under_a_ball(kinematics, element="quad4", centre=3.0, **options):
    left = 0.0 if kinematics == "axisymmetric" else -1.0
    model = elastic_model(block((2.0, 1.0), (16, 8), element, origin=(left, -1.0)), kinematics, BOTTOM="y")
    model.fix("LEFT" if kinematics == "axisymmetric" else "BOTTOM", "x")
    model.add_obstacle("ball", secondary="TOP", obstacle=obstacles.Sphere((0.0, centre), 3.0), **options)
    return model


def box_under_a_ball(element="hex8", **options):
    model = elastic_model(box((1.0, 1.0, 1.0), (6, 6, 3), element, (-0.5, -0.5, -1.0)), "3d", ZMIN="xyz")
    model.add_obstacle("ball", secondary="ZMAX", obstacle=obstacles.Sphere((0.0, 0.0, 3.0), 3.0), **options)
    return model


def same(moved, pushed, tolerance=1e-8):
    """Compare steps and return the largest relative difference of displacements, forces, pressures, places."""
    one, other = moved.contact["ball"], pushed.contact["ball"]
    pairs = [(moved.displacement, pushed.displacement), (moved.stress, pushed.stress), (one.force, other.force),
             (one.pressure, other.pressure), (one.obstacle_displacement, other.obstacle_displacement)]  # fmt: skip
    found = max(float(np.abs(a - b).max() / np.abs(a).max()) for a, b in pairs)
    assert found < tolerance
    assert np.array_equal(one.active, other.active)
    return found


@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("element", ["quad4", "quad8"])
@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
def test_a_force_does_what_its_displacement_does(kinematics, element, formulation):
    moved = fc.solve(
        block_under_a_ball(kinematics, element, motion={"y": -0.02}, formulation=formulation), fc.linear_ramp(1)
    )[-1]
    force = {"y": float(moved.contact["ball"].force[1])}
    pushed = fc.solve(block_under_a_ball(kinematics, element, force=force, formulation=formulation), fc.linear_ramp(2))[
        -1
    ]
    assert same(moved, pushed) < 1e-10
    assert pushed.iterations["regularised"]["relative_to_load"] < 1e-11
    assert pushed.iterations["regularised"]["springs"] == ["y of obstacle 'ball'"]


@pytest.mark.parametrize(("formulation", "element", "solver"), [
    ("node_to_segment", "hex8", "direct"), ("node_to_segment", "hex8", "amg"), ("continuous", "hex8", "direct"),
    ("mortar", "hex8", "direct"), ("mortar", "tet10", "amg"),
])  # fmt: skip
def test_a_force_does_what_its_displacement_does_in_three_dimensions(formulation, element, solver):
    moved = fc.solve(box_under_a_ball(element, motion={"z": -0.02}, formulation=formulation), fc.linear_ramp(1))[-1]
    force = {"z": float(moved.contact["ball"].force[2])}
    model = box_under_a_ball(element, force=force, formulation=formulation)
    same(moved, fc.solve(model, fc.linear_ramp(1), linear_solver=solver)[-1])


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_pushed_in_one_component_and_drawn_in_another_with_friction(formulation):
    options = {"friction": 0.3, "formulation": formulation}
    whole = fc.Criteria(friction_while_touching=1.0)  # along the step the force does not grow as the motion does
    model = block_under_a_ball("plane_strain", motion={"x": 0.01, "y": -0.02}, **options)
    moved = fc.solve(model, fc.linear_ramp(1), criteria=whole)[-1]
    force = {"y": float(moved.contact["ball"].force[1])}
    model = block_under_a_ball("plane_strain", motion={"x": 0.01}, force=force, **options)
    pushed = fc.solve(model, fc.linear_ramp(1), criteria=whole)[-1]
    same(moved, pushed)
    assert pushed.contact["ball"].obstacle_displacement[0] == 0.01
    assert pushed.contact["ball"].dissipation == pytest.approx(moved.contact["ball"].dissipation, rel=1e-8)
    assert pushed.contact["ball"].dissipation > 0


def test_an_obstacle_comes_from_afar_and_leaves_again():
    """Balance at every step of a load cycle; loading and unloading are the same without friction."""
    cycle = fc.Ramp((0.5, 1.0, 1.5), ((0, 0), (1, 1), (2, 0)))
    steps = fc.solve(block_under_a_ball("axisymmetric", centre=4.0, force={"y": -9.0}), cycle)
    places = [step.contact["ball"].obstacle_displacement[1] for step in steps]
    forces = [step.contact["ball"].force[1] for step in steps]
    assert forces == pytest.approx([-4.5, -9.0, -4.5], rel=1e-10)
    assert places[0] < -1.0
    assert places[1] < places[0]
    assert places[2] == pytest.approx(places[0], rel=1e-9)


def test_a_meshed_surface_can_be_driven():
    angle = np.linspace(-0.6, 0.6, 41)
    arc = np.column_stack([3 * np.sin(angle), 3 - 3 * np.cos(angle)])
    lines_ = np.column_stack([np.arange(0, 40, 2), np.arange(2, 41, 2), np.arange(1, 41, 2)])
    surface = obstacles.MeshedSurface(fc.Mesh(arc, {"line3": lines_}, {"ARC": np.arange(20)}), "ARC")
    found = []
    for shape in (surface, obstacles.Sphere((0.0, 3.0), 3.0)):
        mesh = block((2.0, 1.0), (16, 8), "quad4", origin=(-1.0, -1.0))
        model = elastic_model(mesh, "plane_strain", BOTTOM="xy")
        model.add_obstacle("ball", secondary="TOP", obstacle=shape, force={"y": -15.0})
        found.append(fc.solve(model, fc.linear_ramp(1))[-1].contact["ball"].obstacle_displacement[1])
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_a_body_that_only_obstacles_hold():
    """A loose block on a fixed floor under a pushed ball: the force goes through."""
    model = elastic_model(block((2.0, 1.0), (16, 8), "quad4", origin=(-1.0, -1.0)), "plane_strain", BOTTOM="x")
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=obstacles.HalfSpace((0.0, -1.0), (0.0, 1.0)))
    ball = obstacles.Sphere((0.0, 3.1), 3.0)
    model.add_obstacle("ball", secondary="TOP", obstacle=ball, force={"y": -10.0})
    contact = fc.solve(model, fc.linear_ramp(1))[-1].contact
    assert contact["ball"].force[1] == pytest.approx(-10.0, rel=1e-10)
    assert contact["floor"].force[1] == pytest.approx(10.0, rel=1e-10)
    assert contact["ball"].obstacle_displacement[1] < -0.1
    assert contact["floor"].obstacle_displacement.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("length", "pressure"), [(1e-3, 1e6), (1e6, 1e-6)])
def test_units_do_not_matter(length, pressure):
    def solved(length, pressure):
        mesh = block((2.0, 1.0), (8, 4), "quad4", origin=(-1.0, -1.0))
        model = elastic_model(mesh.replace(points=mesh.points * length), "plane_strain", E=1000.0 * pressure)
        model.fix("BOTTOM", "xy")
        ball = obstacles.Sphere((0.0, 3.0 * length), 3.0 * length)
        model.add_obstacle("ball", secondary="TOP", obstacle=ball, force={"y": -15.0 * pressure * length})
        return fc.solve(model, fc.linear_ramp(1))[-1]

    one, other = solved(1.0, 1.0), solved(length, pressure)
    assert np.abs(other.displacement / length - one.displacement).max() < 1e-9 * np.abs(one.displacement).max()
    moved = [step.contact["ball"].obstacle_displacement[1] for step in (one, other)]
    assert moved[1] / length == pytest.approx(moved[0], rel=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"force": {"y": 9.0}}, fc.ConvergenceError, r"no contact stops them \(obstacle 'ball': translation along y"),
        (
            {"force": {"y": -9.0}, "ramp": [(0, 1), (1, -1)]},
            fc.ConvergenceError,
            r"obstacle 'ball': translation along y",
        ),
        ({"force": {"y": 0.0}}, fc.ModelError, r"not supported: obstacle 'ball': translation along y"),
        ({"force": {"y": float("nan")}}, fc.ModelError, r"force y on obstacle 'ball'"),
        ({"force": {"z": -9.0}}, fc.ModelError, r"the force on obstacle 'ball'"),
    ],
)
def test_forces_that_cannot_be_are_told(options, error, message):
    with pytest.raises(error, match=message):
        fc.solve(block_under_a_ball("plane_strain", **options), fc.linear_ramp(4))


CASE = """
kinematics = "axisymmetric"
[mesh]
generator = "quarter-disc"
[[material]]
E = 20000.0
nu = 0.3
[[support]]
group = "A1A2"
x = 0.0
[[support]]
group = "A1B1"
y = 0.0
[obstacle.plane]
secondary = "CONT1"
shape = { kind = "half_space", point = [0.0, 0.0], normal = [0.0, -1.0] }
force = { y = -2.0e5 }
[ramp]
steps = 2
"""


def test_from_case_file_to_result_file(tmp_path):
    (tmp_path / "case.toml").write_text(CASE)
    case = read_case(tmp_path / "case.toml")
    with fc.ResultWriter(tmp_path / "r.vtkhdf", case.model) as out:
        steps = fc.solve(case.model, case.ramp, on_step=out.write)
    contact = steps[-1].contact["plane"]
    moved = elastic_model(quarter_disc(), "axisymmetric", E=20_000.0, A1A2="x", A1B1="y")
    plane = obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0))
    down = {"y": float(contact.obstacle_displacement[1])}
    moved.add_obstacle("plane", secondary="CONT1", obstacle=plane, motion=down)
    there = fc.solve(moved, fc.linear_ramp(1))[-1].contact["plane"]
    assert there.force[1] == pytest.approx(-2.0e5, rel=1e-8)
    summary = json.loads(json.dumps(summarise(case, steps[-1], [of_step(step) for step in steps], {}, [])))
    assert summary["contact"]["plane"]["obstacle_displacement"] == contact.obstacle_displacement.tolist()
    assert any("obstacle 'plane' is displaced by (0, -" in line for line in lines(summary))
    with fc.open_results(tmp_path / "r.vtkhdf") as results:
        for step, stored in zip(steps, results, strict=True):
            place = stored.contact["plane"].obstacle_displacement
            assert place.tolist() == step.contact["plane"].obstacle_displacement.tolist()


def test_files_without_the_place_of_obstacles_are_still_read(tmp_path):
    with fc.ResultWriter(
        tmp_path / "r.vtkhdf", model := block_under_a_ball("plane_strain", motion={"y": -0.01})
    ) as out:
        fc.solve(model, fc.linear_ramp(1), on_step=out.write)
    with h5py.File(tmp_path / "r.vtkhdf", "r+") as file:
        pair = file["fastcontact/contact/0"]
        table = pair["steps"][()]
        names = [name for name in table.dtype.names if name != "obstacle_displacement"]
        del pair["steps"]
        old = np.zeros(len(table), [(name, table.dtype[name]) for name in names])
        for name in names:
            old[name] = table[name]
        pair["steps"] = old
    contact = fc.open_results(tmp_path / "r.vtkhdf")[-1].contact["ball"]
    assert contact.obstacle_displacement is None
    assert contact.force[1] < 0


def test_a_force_in_a_case_file_is_checked(tmp_path):
    (tmp_path / "case.toml").write_text(CASE.replace("{ y = -2.0e5 }", '{ y = "down" }'))
    with pytest.raises(fc.CaseError, match=r"'obstacle.plane.force.y' must be of type"):
        read_case(tmp_path / "case.toml")
