"""Rigid obstacles that forces drive or that rotate: torques, invariants, failures, refusals."""

import json

import numpy as np
import pytest
from case_texts import case_of
from models import elastic_model, made_of, with_obstacle
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cases.summary import lines, step_entry, summarise
from fastcontact.cli import main
from fastcontact.contact.formulations import FORMULATIONS
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide, Rotation

pytestmark = pytest.mark.each_value


def block_under_a_ball(kinematics, element="quad4", centre=3.0, **options):
    left = 0.0 if kinematics == "axisymmetric" else -1.0
    model = elastic_model(fc.generate.block((2.0, 1.0), (16, 8), element, origin=(left, -1.0)), kinematics, BOTTOM="y")
    model.fix("LEFT" if kinematics == "axisymmetric" else "BOTTOM", "x")
    return with_obstacle(model, "ball", "TOP", fc.obstacles.Sphere((0.0, centre), 3.0), **options)


def box_under_a_ball(element="hex8", **options):
    model = elastic_model(fc.generate.box((1.0, 1.0, 1.0), (6, 6, 3), element, (-0.5, -0.5, -1.0)), ZMIN="xyz")
    return with_obstacle(model, "ball", "ZMAX", fc.obstacles.Sphere((0.0, 0.0, 3.0), 3.0), **options)


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
    moved = fc.solve(block_under_a_ball(kinematics, element, motion={"y": -0.02}, formulation=formulation), 1)[-1]
    force = {"y": float(moved.contact["ball"].force[1])}
    pushed = fc.solve(block_under_a_ball(kinematics, element, force=force, formulation=formulation), 2)[-1]
    assert same(moved, pushed) < 1e-10
    assert pushed.iterations["regularised"]["relative_to_load"] < 1e-11
    assert pushed.iterations["regularised"]["springs"] == ["y of obstacle 'ball'"]


@pytest.mark.parametrize(("formulation", "element", "solver"), [
    ("node_to_segment", "hex8", "direct"), ("node_to_segment", "hex8", "amg"), ("continuous", "hex8", "direct"),
    ("mortar", "hex8", "direct"), ("mortar", "tet10", "amg"),
])  # fmt: skip
def test_a_force_does_what_its_displacement_does_in_three_dimensions(formulation, element, solver):
    moved = fc.solve(box_under_a_ball(element, motion={"z": -0.02}, formulation=formulation), 1)[-1]
    force = {"z": float(moved.contact["ball"].force[2])}
    same(moved, fc.solve(box_under_a_ball(element, force=force, formulation=formulation), 1, linear_solver=solver)[-1])


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_pushed_in_one_component_and_drawn_in_another_with_friction(formulation):
    options = {"friction": 0.3, "formulation": formulation}
    whole = fc.Criteria(friction_while_touching=1.0)  # along the step the force does not grow as the motion does
    model = block_under_a_ball("plane_strain", motion={"x": 0.01, "y": -0.02}, **options)
    moved = fc.solve(model, 1, criteria=whole)[-1]
    force = {"y": float(moved.contact["ball"].force[1])}
    model = block_under_a_ball("plane_strain", motion={"x": 0.01}, force=force, **options)
    pushed = fc.solve(model, 1, criteria=whole)[-1]
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
    surface = fc.obstacles.MeshedSurface(fc.Mesh(arc, {"line3": lines_}, {"ARC": np.arange(20)}), "ARC")
    found = []
    for shape in (surface, fc.obstacles.Sphere((0.0, 3.0), 3.0)):
        mesh = fc.generate.block((2.0, 1.0), (16, 8), "quad4", origin=(-1.0, -1.0))
        model = with_obstacle(elastic_model(mesh, BOTTOM="xy"), "ball", "TOP", shape, force={"y": -15.0})
        found.append(fc.solve(model, 1)[-1].contact["ball"].obstacle_displacement[1])
    assert found[0] == pytest.approx(found[1], rel=1e-4)


def test_a_body_that_only_obstacles_hold():
    """A loose block on a fixed floor under a pushed ball: the force goes through."""
    model = elastic_model(fc.generate.block((2.0, 1.0), (16, 8), "quad4", origin=(-1.0, -1.0)), BOTTOM="x")
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=fc.obstacles.HalfSpace((0.0, -1.0), (0.0, 1.0)))
    model.add_obstacle("ball", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 3.1), 3.0), force={"y": -10.0})
    contact = fc.solve(model, 1)[-1].contact
    assert contact["ball"].force[1] == pytest.approx(-10.0, rel=1e-10)
    assert contact["floor"].force[1] == pytest.approx(10.0, rel=1e-10)
    assert contact["ball"].obstacle_displacement[1] < -0.1
    assert contact["floor"].obstacle_displacement.tolist() == [0.0, 0.0]


@pytest.mark.parametrize(("length", "pressure"), [(1e-3, 1e6), (1e6, 1e-6)])
def test_units_do_not_matter(length, pressure):
    def solved(length, pressure):
        mesh = fc.generate.block((2.0, 1.0), (8, 4), "quad4", origin=(-1.0, -1.0))
        model = elastic_model(mesh.replace(points=mesh.points * length), E=1000.0 * pressure, BOTTOM="xy")
        ball = fc.obstacles.Sphere((0.0, 3.0 * length), 3.0 * length)
        model.add_obstacle("ball", secondary="TOP", obstacle=ball, force={"y": -15.0 * pressure * length})
        return fc.solve(model, 1)[-1]

    one, other = solved(1.0, 1.0), solved(length, pressure)
    assert np.abs(other.displacement / length - one.displacement).max() < 1e-9 * np.abs(one.displacement).max()
    moved = [step.contact["ball"].obstacle_displacement[1] for step in (one, other)]
    assert moved[1] / length == pytest.approx(moved[0], rel=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"force": {"y": 9.0}}, fc.ConvergenceError, r"no contact stops them \(obstacle 'ball': translation along y"),
        ({"force": {"y": -9.0}, "ramp": [(0, 1), (1, -1)]}, fc.ConvergenceError, r"'ball': translation along y"),
        ({"force": {"y": 0.0}}, fc.ModelError, r"not restrained: obstacle 'ball': translation along y"),
        ({"force": {"y": float("nan")}}, fc.ModelError, r"force y on obstacle 'ball'"),
        ({"force": {"z": -9.0}}, fc.ModelError, r"the force on obstacle 'ball'"),
    ],
)
def test_forces_that_cannot_be_are_told(options, error, message):
    with pytest.raises(error, match=message):
        fc.solve(block_under_a_ball("plane_strain", **options), 4)


PLANE = """[obstacle.plane]
secondary = "CONT1"
shape = { kind = "half_space", point = [0.0, 0.0], normal = [0.0, -1.0] }
force = { y = -2.0e5 }
"""
STEEL = "E = 20000.0\nnu = 0.3"
CASE = case_of('generator = "quarter-disc"', PLANE, "axisymmetric", STEEL, "steps = 2", A1A2="x", A1B1="y")


def test_from_case_file_to_result_file(tmp_path):
    (tmp_path / "case.toml").write_text(CASE)
    case = read_case(tmp_path / "case.toml")
    with fc.ResultWriter(tmp_path / "r.vtkhdf", case.model) as out:
        steps = fc.solve(case.model, case.ramp, on_step=out.write)
    contact = steps[-1].contact["plane"]
    moved = elastic_model(fc.generate.quarter_disc(), "axisymmetric", E=20_000.0, A1A2="x", A1B1="y")
    plane = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, -1.0))
    down = {"y": float(contact.obstacle_displacement[1])}
    moved.add_obstacle("plane", secondary="CONT1", obstacle=plane, motion=down)
    assert fc.solve(moved, 1)[-1].contact["plane"].force[1] == pytest.approx(-2.0e5, rel=1e-8)
    summary = json.loads(json.dumps(summarise(case, steps[-1], [step_entry(step) for step in steps], {}, [])))
    assert summary["contact"]["plane"]["obstacle_displacement"] == contact.obstacle_displacement.tolist()
    assert any("obstacle 'plane' is displaced by (0, -" in line for line in lines(summary))
    with fc.open_results(tmp_path / "r.vtkhdf") as results:
        for step, stored in zip(steps, results, strict=True):
            place = stored.contact["plane"].obstacle_displacement
            assert place.tolist() == step.contact["plane"].obstacle_displacement.tolist()


FRICTION, RADIUS = 0.3, 10.0
PRESS, PRESS_AND_TURN = [(0.0, 0.0), (1.0, 1.0), (9.0, 1.0)], [(0.0, 0.0), (1.0, 0.0), (9.0, 1.0)]


def graded_box(divisions):
    """A box of 6 by 6 by 3 below z = 0, with cells that grow away from the origin."""
    mesh = fc.generate.box((2.0, 2.0, 1.0), (divisions, divisions, divisions // 2), origin=(-1.0, -1.0, -1.0))
    return mesh.replace(points=3.0 * np.sign(mesh.points) * np.abs(mesh.points) ** 1.6)


def twisted_ball(formulation, divisions=8, angle=0.4, friction=FRICTION, **driving):
    """A rigid ball pressed on a box and then twisted about the vertical through its centre; by default pressed by 0.1."""
    model = elastic_model(graded_box(divisions), ZMIN="xyz")
    rotation = {"angle": angle, "centre": (0.0, 0.0, RADIUS), "axis": (0.0, 0.0, 2.0), "ramp": PRESS_AND_TURN}
    model.add_obstacle(
        "ball", secondary="ZMAX", obstacle=fc.obstacles.Sphere((0.0, 0.0, RADIUS), RADIUS), rotation=rotation,
        friction=friction, formulation=formulation, ramp=PRESS, **(driving or {"motion": {"z": -0.1}}),
    )  # fmt: skip
    return model


def normal_forces(contact):
    return np.einsum("nd,nd->n", contact.force_vectors, contact.normal)


PUSHED = {"force": {"z": -240.0}}


@pytest.mark.parametrize(
    ("formulation", "driving"),
    [
        ("node_to_segment", {}), ("node_to_segment", PUSHED),
        *(pytest.param("continuous", driving, marks=pytest.mark.slow) for driving in ({}, PUSHED)),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore:contact 'ball' has only")
def test_a_twisted_ball_slides_with_the_torque_of_full_slip(formulation, driving):
    """Full slip: the integral of mu p r, of Hertz's pressures 3 pi mu P a / 16 (Lubkin, J. Appl. Mech. 18, 1951)."""
    steps = fc.solve(twisted_ball(formulation, **driving), [1.0, 5.0, 7.0, 9.0])
    contacts = [step.contact["ball"] for step in steps]
    assert contacts[0].torque == pytest.approx(0.0, abs=1e-9)
    assert [contact.obstacle_angle for contact in contacts] == pytest.approx([0.0, 0.2, 0.3, 0.4])
    last = contacts[-1]
    radius = np.linalg.norm((last.coordinates + steps[-1].displacement[last.points])[:, :2], axis=1)
    full_slip = FRICTION * normal_forces(last) @ radius
    # Nodes stand for the area around them: the force of a continuous contact lies farther in than its nodes, on average.
    assert last.torque == pytest.approx(full_slip, rel=5e-3 if formulation == "node_to_segment" else 0.06)
    if driving:
        assert last.force[2] == pytest.approx(-240.0, rel=1e-8)
    # On boxes of 8, 14 and 20 such cells a continuous contact lacks 4.6, 3.3 and 2.3 %.
    hertz = fc.analytic.hertz_point(E1=1000.0, nu1=0.3, R1=np.inf, R2=RADIUS, force=-last.force[2])
    assert last.torque == pytest.approx(3.0 * np.pi / 16.0 * FRICTION * -last.force[2] * hertz.radius, rel=0.06)
    # Sliding steadily, the ball puts in the work of friction: torque times angle (0.6, 0.1 and 0.03 % on the three boxes).
    assert last.dissipation == pytest.approx(last.torque * 0.1, rel=1e-3 if formulation == "node_to_segment" else 8e-3)


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.filterwarnings("ignore:contact 'ball' has only")
def test_without_friction_a_ball_may_turn_as_it_likes(formulation):
    still, turned = fc.solve(twisted_ball(formulation, friction=0.0, angle=50.0), [1.0, 9.0])
    assert turned.displacement == pytest.approx(still.displacement, abs=1e-9)
    assert turned.contact["ball"].torque == pytest.approx(0.0, abs=1e-9)
    assert turned.contact["ball"].obstacle_angle == 50.0


def spun_disc(
    formulation="continuous", *, angle=-0.5, motion=(0.0, -0.02), friction=FRICTION, element="quad4", turned=False
):
    """A rigid disc of radius 5 above a block, pressed, then spun and moved; `turned`: all of it by 90 degrees."""
    mesh = fc.generate.block((4.0, 2.0), (24, 8), element, (-2.0, -2.0))
    flip = np.array([[0.0, 1.0], [-1.0, 0.0]]) if turned else np.eye(2)
    model = elastic_model(mesh.replace(points=mesh.points @ flip), BOTTOM="xy")
    centre = np.array([0.0, 5.0]) @ flip
    along, down = np.array([motion[0], 0.0]) @ flip, np.array([0.0, motion[1]]) @ flip
    together = dict(zip("xy", (along + down).tolist(), strict=True))
    rotation = {"angle": angle, "centre": centre, "ramp": PRESS_AND_TURN}
    model.add_obstacle(
        "disc", secondary="TOP", obstacle=fc.obstacles.Sphere(tuple(centre), 5.0), motion=together, rotation=rotation,
        friction=friction, formulation=formulation, ramp=PRESS,
    )  # fmt: skip
    return model


@pytest.mark.parametrize(
    ("formulation", "element"), [("node_to_segment", "quad4"), ("continuous", "quad4"), ("continuous", "quad8")]
)
def test_a_spun_disc_slides_everywhere(formulation, element):
    """All points of it have the same arm, its radius: the torque of full slip is mu P R, with every law of pressure."""
    contact = fc.solve(spun_disc(formulation, element=element), [1.0, 5.0, 9.0])[-1].contact["disc"]
    assert contact.torque == pytest.approx(-FRICTION * 5.0 * normal_forces(contact).sum(), rel=2e-3)
    assert contact.dissipation == pytest.approx(-contact.torque * 0.25, rel=2e-3)
    # The disc turns clockwise and drags the surface below it to the left.
    assert contact.force[0] == pytest.approx(-FRICTION * normal_forces(contact).sum(), rel=0.02)


def test_a_spun_disc_and_its_block_turned_by_a_right_angle():
    upright, turned = (fc.solve(spun_disc(turned=turned), [1.0, 9.0])[-1] for turned in (False, True))
    flip = np.array([[0.0, 1.0], [-1.0, 0.0]])
    assert turned.displacement == pytest.approx(upright.displacement @ flip, abs=1e-8)
    assert turned.contact["disc"].torque == pytest.approx(upright.contact["disc"].torque, rel=1e-6)


@pytest.mark.filterwarnings("ignore:.*begins with a penetration")  # which presses it
def test_a_disc_that_rolls_hardly_needs_a_torque():
    """Rolling, places of the disc and of the block meet without sliding, but for what pressure strains the block along it.

    That is little where the block hardly changes its volume. A disc that is dragged needs mu P R not to turn.
    """
    parts = []
    for rolling in (1.0, 0.0):
        law = fc.LinearElastic(E=1000.0, nu=0.48, volumetric="mean_dilatation")
        model = made_of(fc.generate.block((4.0, 2.0), (24, 8), origin=(-2.0, -2.0)), "plane_strain", law, BOTTOM="xy")
        centre = (-0.2, 5.0 - 0.02)
        model.add_obstacle(
            "disc", secondary="TOP", obstacle=fc.obstacles.Sphere(centre, 5.0), motion={"x": 0.4}, friction=FRICTION,
            rotation={"angle": -0.4 / 5.0 * rolling, "centre": centre},
        )  # fmt: skip
        contact = fc.solve(model, 20)[-1].contact["disc"]
        parts.append(contact.torque / (FRICTION * normal_forces(contact).sum() * 5.0))
    rolled, dragged = parts
    assert dragged == pytest.approx(1.0, rel=2e-3)
    assert abs(rolled) < 0.05


def test_a_driven_wheel_rolls_on_by_its_arc():
    """Pushed down by a force, free to move along, and turned: it goes on by radius times angle, but for a little creep."""
    model = spun_disc()
    model.contact.clear()
    model.add_obstacle(
        "disc", secondary="TOP", obstacle=fc.obstacles.Sphere((0.0, 5.0), 5.0), force={"x": 0.0, "y": -15.0}, ramp=PRESS,
        rotation={"angle": -0.04, "centre": (0.0, 5.0), "ramp": PRESS_AND_TURN}, friction=FRICTION,
    )  # fmt: skip
    contact = fc.solve(model, np.linspace(1.0, 9.0, 17))[-1].contact["disc"]
    assert contact.force == pytest.approx([0.0, -15.0], abs=1e-6)
    assert contact.obstacle_displacement[0] == pytest.approx(0.04 * 5.0, rel=0.01)
    assert abs(contact.torque) < 0.01 * FRICTION * 15.0 * 5.0


def test_a_turn_about_a_far_centre_is_a_translation():
    far, way = 1e7, 0.3
    found = []
    for rotation in ({"angle": way / far, "centre": (0.0, far), "ramp": PRESS_AND_TURN}, None):
        model = elastic_model(fc.generate.block((4.0, 2.0), (8, 4)), BOTTOM="xy")
        plane = fc.obstacles.HalfSpace((0.0, 2.0), (0.0, -1.0))
        if rotation is None:
            with_obstacle(model, "plane", "TOP", plane, motion={"x": way}, friction=0.5, ramp=PRESS_AND_TURN)
            model.contact[-1].options["clearance"] = -0.02
        else:
            with_obstacle(model, "plane", "TOP", plane, rotation=rotation, friction=0.5, clearance=-0.02)
        found.append(fc.solve(model, [1.0, 3.0, 9.0])[-1])
    turned, moved = found
    assert turned.displacement == pytest.approx(moved.displacement, abs=1e-6)
    assert turned.contact["plane"].force == pytest.approx(moved.contact["plane"].force, rel=1e-4)


def tool(angle):
    """A wavy rigid surface of lines above a block, turned by `angle` about (0.5, 3)."""
    x = np.linspace(-3.0, 3.0, 61)
    points = np.column_stack([x, 2.35 + 0.1 * np.cos(2.0 * x) - 0.05 * x])
    turn = Rotation((0.5, 3.0), (0.0, 0.0, 1.0), 1.0).matrix(angle)
    points = (points - [0.5, 3.0]) @ turn.T + [0.5, 3.0]
    lines = np.column_stack([np.arange(60), np.arange(1, 61)])
    surface = fc.Mesh(points, {"line2": lines}, cell_groups={"TOOL": np.arange(60)})
    return fc.obstacles.MeshedSurface(surface, "TOOL")


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_turned_tool_presses_as_one_made_so(formulation):
    """Without friction only the last place counts: a tool turned by the analysis and one that is drawn turned."""
    found = []
    for made, turned in ((0.0, 0.12), (0.12, 0.0)):
        model = elastic_model(fc.generate.block((4.0, 2.0), (20, 8), origin=(-2.0, 0.0)), BOTTOM="xy")
        rotation = {"angle": turned, "centre": (0.5, 3.0)}
        with_obstacle(model, "tool", "TOP", tool(made), rotation=rotation, motion={"y": -0.2}, formulation=formulation)
        found.append(fc.solve(model, 1)[-1])
    assert found[0].contact["tool"].active.any()
    assert found[0].displacement == pytest.approx(found[1].displacement, abs=1e-8)
    assert found[0].contact["tool"].torque == pytest.approx(found[1].contact["tool"].torque, rel=1e-6)


@pytest.mark.parametrize("dim", [2, 3])
def test_slip_is_zero_where_a_point_sticks_and_the_arc_where_it_stands_still(dim):
    axis = (0.0, 0.0, 1.0) if dim == 2 else (1.0, -2.0, 0.5)
    rotation = Rotation((0.3, -0.2, 0.7)[:dim], axis, 1.0)
    side = RigidSide(fc.obstacles.Sphere((0.0,) * dim, 1.0), np.zeros(dim), rotation)
    then, now = Pose(np.full(dim, 0.1), 0.4), Pose(np.array([0.3, -0.2, 0.5])[:dim], 1.1)
    before, centre = np.random.default_rng(1).normal(size=(5, dim)), np.array(rotation.centre)
    stuck = (before - centre - then.displacement) @ rotation.matrix(0.7).T + centre + now.displacement
    moved = now.displacement - then.displacement
    assert stuck - before == pytest.approx(side.rigid_motion(stuck, before, now, then), abs=1e-12)
    # A point that only goes along with the axis stands still on the way of the turn: the surface passes it along an arc.
    carried = side.rigid_motion(before + moved, before, now, then) - moved
    arm = before - centre - then.displacement
    unit = np.array(axis) / np.linalg.norm(axis)
    across = np.cross(np.pad(unit, (0, 3 - len(unit))), np.pad(arm, ((0, 0), (0, 3 - dim))))[:, :dim]
    assert carried == pytest.approx(0.7 * across, abs=1e-12)


def test_wear_of_a_spun_disc_is_pressure_times_the_arc():
    model = spun_disc()
    steps = fc.solve(model, [1.0, 5.0, 9.0])
    depth = fc.wear(model, steps, "disc", 1e-6)
    contacts = [step.contact["disc"] for step in steps]
    sliding = contacts[1].active & contacts[2].active & ~contacts[2].sticking
    assert sliding.any()
    expected = 1e-6 * 0.5 * (contacts[1].pressure + contacts[2].pressure) * 5.0 * 0.25
    assert (depth[2] - depth[1])[sliding] == pytest.approx(expected[sliding], rel=2e-3)


def test_an_analysis_goes_on_from_its_file_in_the_middle_of_a_turn(tmp_path):
    model = spun_disc()
    whole = fc.solve(model, [1.0, 3.0, 5.0])
    with fc.ResultWriter(tmp_path / "turn.vtkhdf", model) as out:
        fc.solve(model, [1.0, 3.0], on_step=out.write)
    stored = list(fc.open_results(tmp_path / "turn.vtkhdf"))
    assert stored[-1].contact["disc"].torque == whole[1].contact["disc"].torque
    assert stored[-1].contact["disc"].obstacle_angle == whole[1].contact["disc"].obstacle_angle == -0.125
    again = list(fc.solve_steps(model, [1.0, 3.0, 5.0], resume=stored))
    assert again[-1].displacement == pytest.approx(whole[-1].displacement, abs=1e-10)


REFUSED = {
    "needs 'centre'": {"angle": 1.0},
    "needs 'angle'": {"centre": (0.0, 0.0)},
    "in 2D rotations are about z": {"angle": 1.0, "centre": (0.0, 0.0), "axis": (0, 0, 1)},
    "did you mean 'centre'": {"angle": 1.0, "center": (0.0, 0.0)},
    "not a finite number": {"angle": float("nan"), "centre": (0.0, 0.0)},
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_rotation_that_makes_no_sense_is_refused(message):
    model = fc.Model(fc.generate.block(), "plane_strain")
    ball = fc.obstacles.Sphere((0.5, 3.0), 2.0)
    with pytest.raises(fc.ModelError, match=message):
        model.add_obstacle("ball", secondary="TOP", obstacle=ball, rotation=REFUSED[message])


def test_an_axis_without_length_and_too_large_turns_are_refused():
    model = twisted_ball("node_to_segment", angle=4.0)
    refused(fc.ModelError, r"rotates by 2 rad in the step .* 5, .* at least 2 steps", fc.solve, model, [1.0, 5.0, 9.0])
    with pytest.raises(fc.ModelError, match="has no length"):
        model.add_obstacle(
            "other", secondary="ZMAX", obstacle=fc.obstacles.Sphere((0.0, 0.0, 3.0), 1.0),
            rotation={"angle": 1.0, "centre": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 0.0)},
        )  # fmt: skip


def test_a_case_file_turns_an_obstacle(tmp_path, capsys):
    text = """
title = "A spun disc"
kinematics = "plane_strain"
mesh = { file = "block.med" }
material = [{ E = 1000.0, nu = 0.3 }]
support = [{ group = "BOTTOM", x = 0.0, y = 0.0 }]
ramp = { instants = [1.0, 2.0, 3.0], table = [[0.0, 0.0], [3.0, 3.0]] }
[obstacle.disc]
secondary = "TOP"
shape = { kind = "sphere", centre = [0.0, 5.0], R = 5.0 }
motion = { y = -0.02 }
ramp = [[0.0, 0.0], [1.0, 1.0], [3.0, 1.0]]
rotation = { angle = -0.5, centre = [0.0, 5.0], ramp = [[0.0, 0.0], [1.0, 0.0], [3.0, 1.0]] }
friction = 0.3
"""
    fc.write_mesh(tmp_path / "block.med", fc.generate.block((4.0, 2.0), (16, 6), origin=(-2.0, -2.0)))
    path = tmp_path / "disc.toml"
    path.write_text(text, encoding="utf-8")
    case = read_case(path)
    contact = fc.solve(case.model, case.ramp, criteria=case.criteria)[-1].contact["disc"]
    assert contact.torque == pytest.approx(-0.3 * 5.0 * normal_forces(contact).sum(), rel=5e-3)
    assert main(["run", str(path), "--json", str(tmp_path / "disc.json")]) == 0
    told = json.loads((tmp_path / "disc.json").read_text(encoding="utf-8"))["contact"]["disc"]
    assert told["torque"] == pytest.approx(contact.torque)
    assert told["obstacle_angle"] == -0.5
    assert "obstacle 'disc' has turned by -0.5 rad, with a torque of" in capsys.readouterr().out
    path.write_text(text.replace("angle = -0.5", "angel = -0.5"), encoding="utf-8")
    refused(
        fc.ModelError, r"unknown key of the rotation of obstacle 'disc' 'angel': did you mean 'angle'", read_case, path
    )
