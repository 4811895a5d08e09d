"""Floating bodies: springs whose anchors follow the bodies, and the cost of a step."""

import dataclasses

import numpy as np
import pytest
from models import elastic_model, made_of, plates, supported, united, with_contact
from pairwise import first_of
from scipy.sparse import csr_array

import fastcontact as fc
from fastcontact.analysis.floating_bodies import MAX_NEWTON_ITERATIONS, FloatingBodies, PositionResponse, SoftSprings
from fastcontact.analysis.solution import Solution
from fastcontact.linear.factor_solver import CondensedProblem

DOFS = np.array([0])


def bodies_at(dofs):
    bodies = FloatingBodies.__new__(FloatingBodies)
    bodies.dofs, bodies.stiffness = dofs, 1.0
    return bodies


def solution(elongation, settled=True):
    active = np.array([True])
    wanted = active if settled else ~active
    return Solution.frictionless(np.atleast_1d(elongation), np.zeros(1), np.zeros(1), active, wanted)


def test_a_contact_problem_that_does_not_settle_is_returned():
    calls = []

    def solve_at(anchor):
        calls.append(anchor)
        return solution(1.0 - anchor[0], settled=len(calls) != 2)

    found = bodies_at(DOFS).settle(lambda anchor: solve_at(0.5 * anchor), None, DOFS, np.zeros(1), 1.0, 0.0, 0.0)
    assert not found.slack
    assert not found.solution.settled
    assert found.solution.iterations == found.positions == len(calls) == 2


def test_anchors_follow_what_contact_holds():
    """A body of stiffness 1e3 beside its springs: each solution leaves a thousandth of their forces."""
    held, load = 1e3 * np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 0.7]]), np.array([1.0, -0.5, 0.3])

    def solve_at(anchor):
        return solution(np.linalg.solve(held + np.eye(3), load - held @ anchor))

    found = bodies_at(np.arange(3)).settle(solve_at, None, np.arange(3), np.zeros(3), 1.0, 0.0, 0.0)
    assert found.slack
    assert found.positions <= 6
    np.testing.assert_allclose(found.anchor, np.linalg.solve(held, load), rtol=1e-9)


@pytest.mark.parametrize("start", [1.5, 1.7, 6.0])
def test_newton_steps_that_overshoot_are_halved(start):
    """Contact that is stiff near equilibrium and soft beyond: whole Newton steps alternate between both soft sides."""

    def response(p):
        stiff = abs(p) < 0.5
        return (p if stiff else np.sign(p) * (0.5 + 0.25 * (abs(p) - 0.5))), (1.0 if stiff else 0.25)

    slopes = []

    def solve_at(anchor):
        stretch, slope = response(anchor[0] - 0.1)
        slopes.append(slope)
        return dataclasses.replace(solution(-stretch), response=lambda: None)

    def freed(held):
        return PositionResponse(held, np.eye(1), np.array([[-slopes[-1]]]), DOFS, np.zeros((1, 1)))

    found = bodies_at(DOFS).settle(solve_at, freed, DOFS, np.array([start]), 1.0, 0.0, 0.0)
    assert found.slack
    assert found.positions <= 6
    np.testing.assert_allclose(found.anchor, [0.1], rtol=1e-12)


def test_a_body_moves_on_to_the_gap_that_stops_it():
    """A gap of a thousand times the elongation of a spring; gaps behind the body and of closed contact do not stop it."""
    gap, stiffness, calls = 1000.0, 10.0, []

    def solve_at(anchor):
        calls.append(anchor[0])
        # A spring of stiffness 1 bears the load 1, with contact of `stiffness` beside it.
        pressed = anchor[0] + 1.0 > gap
        elongation = (1.0 - stiffness * (anchor[0] - gap) * pressed) / (1.0 + stiffness * pressed)
        gaps = np.array([max(gap - anchor[0] - elongation, 0.0), 5.0, 1e-16])
        closed, none = np.array([False, False, True]), np.zeros((3, 0))
        contact = {"active": closed, "sticking": closed, "slip": none, "tangential": none}
        return dataclasses.replace(solution(elongation), gap=gaps, response=lambda: None, **contact)

    def freed(held):
        closed = calls[-1] + 1.0 > gap
        stretched = np.array([[-stiffness / (1.0 + stiffness) if closed else 0.0]])
        return PositionResponse(held, np.eye(1), stretched, DOFS, np.array([[-1.0], [1.0], [-1e-6]]))

    found = bodies_at(DOFS).settle(solve_at, freed, DOFS, np.zeros(1), 1.0, 0.0, 0.0)
    assert found.slack
    assert found.positions <= 4
    np.testing.assert_allclose(found.anchor, [gap + 1.0 / stiffness], rtol=1e-12)


def test_what_nothing_holds_is_not_slack():
    found = bodies_at(DOFS).settle(lambda anchor: solution(1.0), None, DOFS, np.zeros(1), 1.0, 0.0, 0.0)
    assert not found.slack
    assert found.positions == MAX_NEWTON_ITERATIONS
    np.testing.assert_array_equal(found.spring_force, [1.0])


@pytest.mark.parametrize(
    ("friction", "linear_solver", "most"),
    first_of(2, [(0.0, "direct", 25), (0.0, "amg", 25), (0.3, "direct", 100), (0.3, "amg", 25)]),
)
def test_plates_that_lie_loose_on_each_other_cost_few_solutions(friction, linear_solver, most):
    (step,) = fc.solve(plates(friction), 1, linear_solver=linear_solver)
    for name in ("c1", "c2"):
        force = step.contact[name].force
        assert abs(force[2]) == pytest.approx(490.0, rel=1e-7)
        if friction:
            np.testing.assert_allclose(np.abs(force[:2]), [49.0, 0.0], rtol=1e-6, atol=1e-5)
    assert step.iterations["active_set_iterations"] <= most


@pytest.mark.parametrize("force", [0.0, 1e5])
def test_slack_is_in_units_of_the_contact_forces(force):
    """Where motions drive the bodies there is no load: what round-off leaves is compared with what presses on them."""

    def solve_at(anchor):
        found = solution(1e-9 if anchor[0] > 0.5 else 1.0 - anchor[0])
        return dataclasses.replace(found, multiplier=np.array([force]))

    found = bodies_at(DOFS).settle(solve_at, None, DOFS, np.zeros(1), load=0.0, noise=0.0, round_off=0.0)
    assert found.slack == (force > 0.0)
    assert found.anchor[0] > 0.5


def test_soft_springs_act_as_in_a_matrix_that_contains_them():
    """Two masses joined by a spring; a stiff and a soft spring in series hold the first."""
    K, load, B, c = np.array([[2.0, -2.0], [-2.0, 2.0]]), np.array([0.3, 0.4]), csr_array([[0.2, 1.0]]), np.array([0.5])
    stiff, series = (np.linalg.inv(K + np.diag([k, 0.0])) for k in (3.0, 1.0 / (1.0 / 3.0 + 1.0 / 0.01)))
    soft = SoftSprings(CondensedProblem(stiff, stiff @ load), np.ones((2, 1)), load.sum(keepdims=True), 0.01)
    for found, expected in zip(soft.solve(B, c), CondensedProblem(series, series @ load).solve(B, c), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-11)


def carried(dim, options, angle):
    """A box on a wider one, which is driven sideways by much more than it deforms, and the matrix that turns both."""
    box = fc.generate.block if dim == 2 else fc.generate.box
    sizes, divisions = ((60.0, 20.0), (40.0, 20.0)), ((6, 2), (5, 3))
    if dim == 3:
        sizes, divisions = ((60.0, 50.0, 20.0), (40.0, 36.0, 20.0)), ((6, 5, 2), (5, 4, 2))
    corner = (8.0, 20.0) if dim == 2 else (8.0, 6.0, 20.0)
    lower = box(sizes[0], divisions[0])
    upper = box(sizes[1], divisions[1], "quad4" if dim == 2 else "hex8", corner)
    mesh, turn = united(A_=lower, B_=upper), np.eye(dim)
    turn[:: dim - 1, :: dim - 1] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    mesh = mesh.replace(points=mesh.points @ turn.T)
    low, high = ("BOTTOM", "TOP") if dim == 2 else ("ZMIN", "ZMAX")
    model = elastic_model(mesh, "plane_strain" if dim == 2 else "3d", E=210e3)
    model.add_pressure(f"B_{high}", 0.1, ramp=[(0, 0), (1, 1), (2, 1)])
    model.prescribe(f"A_{low}", **dict(zip("xyz"[:dim], 0.5 * turn[:, 0], strict=True)), ramp=[(0, 0), (1, 0), (2, 1)])
    model.add_contact("AB", secondary=f"B_{low}", primary=f"A_{high}", **{"friction": 0.3, **options})
    return model, turn


@pytest.mark.parametrize("angle", [0.0, 0.5])
@pytest.mark.parametrize(
    ("dim", "options"),
    [
        (2, {}), (2, {"formulation": "node_to_segment"}), (2, {"formulation": "continuous"}), (2, {"friction": 0.9}),
        (2, {"multipliers": "standard"}), (3, {}),
    ],
)  # fmt: skip
def test_a_box_rides_on_a_driven_one(dim, options, angle):
    """Friction carries a box that nothing else holds: it moves as far as the box below, and no shear remains."""
    model, turn = carried(dim, options, angle)
    step = fc.solve(model, [1.0, 2.0])[-1]
    moved = step.displacement[model.mesh.points_of(f"B_{'TOP' if dim == 2 else 'ZMAX'}")] @ turn[:, 0]
    np.testing.assert_allclose(moved, 0.5, atol=1e-4)
    force = step.contact["AB"].force @ turn
    assert np.abs(force[:-1]).max() < 1e-8 * force[-1]


WIDTHS = np.array([120.0, 100.0, 80.0, 60.0])


def stack(dim, weakest, angle, options):
    """Boxes A to D under gravity, A driven sideways and back, D held, and the matrix that turns all; see `WIDTHS`."""
    make, rest, element = (fc.generate.block, (20.0,), "quad4") if dim == 2 else (fc.generate.box, (40.0, 20.0), "hex8")
    boxes, turn = {}, np.eye(dim)
    for i, (body, width) in enumerate(zip("ABCD", WIDTHS, strict=True)):
        corner = (-width / 2, *(0.0,) * (dim - 2), 20.0 * i)
        boxes[f"{body}_"] = make((width, *rest), (8 - i, *(2,) * (dim - 1)), element, corner)
    turn[:: dim - 1, :: dim - 1] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    mesh = united(**boxes)
    mesh = mesh.replace(points=mesh.points @ turn.T)
    low, high, side = ("BOTTOM", "TOP", "RIGHT") if dim == 2 else ("ZMIN", "ZMAX", "XMAX")
    model = made_of(mesh, "plane_strain" if dim == 2 else "3d", fc.LinearElastic(E=50.0, nu=0.3, density=1e-9))
    model.add_gravity(**dict(zip("xyz", -1e4 * turn[:, -1], strict=False)), ramp=[(0, 0), (1, 1), (4, 1)])
    drive = dict(zip("xyz", 5.0 * turn[:, 0], strict=False))
    supported(model, **{f"A_{low}": {**drive, "ramp": [(0, 0), (1, 0), (2, 1), (4, -1)]}, f"D_{side}": "normal"})
    for i, (below, above) in enumerate(("AB", "BC", "CD")):
        friction = (30.0 if i == weakest else 36.0) / WIDTHS[i + 1 :].sum()
        with_contact(model, below + above, f"{above}_{low}", f"{below}_{high}", friction=friction, **options)
    return model, turn


@pytest.mark.parametrize(
    ("dim", "weakest", "angle", "options"),
    [
        (2, 0, 0.0, {}),
        (2, 1, 0.5, {}),
        (2, 2, 0.0, {"formulation": "continuous"}),
        (2, 2, 0.0, {"formulation": "node_to_segment"}),
        (3, 1, 0.5, {}),
    ],
)
def test_a_driven_stack_slides_where_friction_is_least(dim, weakest, angle, options):
    model, turn = stack(dim, weakest, angle, options)
    weights = 2e-4 * WIDTHS * (1.0 if dim == 2 else 40.0)
    for step in fc.solve(model, [1.0, 2.0, 4.0])[1:]:
        drive = 5.0 if step.load_factor == 2.0 else -5.0
        for i, body in enumerate("ABCD"):
            top = model.mesh.points_of(f"{body}_{'TOP' if dim == 2 else 'ZMAX'}")
            moved = (step.displacement[top] @ turn[:, 0]).mean()
            assert abs(moved - drive * (i <= weakest)) < 2e-3
        for i, contact in enumerate(step.contact.values()):
            force = (contact.force @ turn)[[0, -1]]
            np.testing.assert_allclose(force, [np.sign(drive) * 0.5 * weights[-1], weights[i + 1 :].sum()], rtol=1e-3)


def test_a_crate_on_a_driven_one_settles_while_both_slide_on_the_floor():
    """Only the direction of friction restrains both crates sideways; near equilibrium the linear response is exact."""
    lower = fc.generate.box((2.0, 1.2, 0.8), (6, 4, 3), "hex8", (-1.0, -0.6, 0.0))
    upper = fc.generate.box((1.6, 1.0, 0.8), (5, 4, 3), "hex8", (-0.8, -0.5, 0.8))
    model = made_of(united(A_=lower, B_=upper), "3d", fc.LinearElastic(E=30e9, nu=0.2, density=2400.0))
    model.add_gravity(z=-9.81, ramp=[(0, 0), (1, 1), (2, 1)])
    model.prescribe("B_XMIN", x=4e-4, ramp=[(0, 0), (1, 0), (2, 1)])
    floor = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    model.add_obstacle("floor", secondary="A_ZMIN", obstacle=floor, friction=0.2)
    model.add_contact("AB", secondary="B_ZMIN", primary="A_ZMAX", friction=0.5)
    weight = 2400.0 * 9.81 * (1.92 + 1.28)
    force = fc.solve(model, [1.0, 2.0])[-1].contact["floor"].force
    np.testing.assert_allclose(force, [-0.2 * weight, 0.0, weight], rtol=1e-6, atol=1e-6 * weight)


@pytest.mark.parametrize(("divisions", "friction"), [((30, 5), None), ((60, 6), 0.1)])
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")  # of the coarse mesh
def test_a_beam_moves_with_the_roller_that_loads_it_until_the_other_roller_holds_it(divisions, friction):
    """When a node of the beam reaches the lower roller, the largest elongation grows, but the norm of both decreases."""
    model = elastic_model(fc.generate.block((60.0, 10.0), divisions, "quad8"), "plane_stress", E=2e5, LEFT="x")
    low, up = fc.obstacles.Sphere((50.0, -4.0), 4.0), fc.obstacles.Sphere((20.0, 16.0), 6.0)
    model.add_obstacle("low", secondary="BOTTOM", obstacle=low, friction=friction)
    model.add_obstacle("up", secondary="TOP", obstacle=up, friction=friction, force={"y": -100.0})
    contact = fc.solve(model, 1)[-1].contact
    np.testing.assert_allclose([contact[name].force[1] for name in ("low", "up")], [100.0, -100.0], rtol=1e-6)


@pytest.mark.parametrize(("angle", "stiffness"), first_of(2, [(-12.0, 5e3), (-3.0, 5e5), (12.0, 5e3), (-12.0, 5e5)]))
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_a_crate_slides_on_a_driven_incline_until_a_spring_holds_it(angle, stiffness):
    """Base driven along an incline of `angle` (positive: downwards); the spring acts along x, and only contact along y."""
    base = fc.generate.block((0.6, 0.08), (24, 3), "quad4", (-0.3, -0.08))
    crate = fc.generate.block((0.2, 0.12), (10, 6), "quad4", (-0.1, 0.0))
    mesh, slope = fc.generate.transformed(united(A_=base, B_=crate), rotate=-angle), np.radians(angle)
    model = made_of(mesh, "plane_strain", fc.LinearElastic(E=1e8, nu=0.3, density=600.0))
    model.add_gravity(y=-9.81, ramp=[(0, 0), (1, 1), (2, 1)])
    top = mesh.points_of("B_TOP")
    model.add_spring("B_TOP", x=stiffness / len(top))
    model.prescribe("A_BOTTOM", x=0.05 * np.cos(slope), y=-0.05 * np.sin(slope), ramp=[(0, 0), (1, 0), (2, 1)])
    model.add_contact("AB", secondary="B_BOTTOM", primary="A_TOP", friction=0.4)
    step = fc.solve(model, [1.0, 2.0])[-1]
    force = stiffness * step.displacement[top, 0].mean()
    weight = 600.0 * 9.81 * 0.2 * 0.12  # a pressure of 1e-5 times Young's modulus, which turns the normals
    np.testing.assert_allclose(force, weight * np.tan(slope + np.arctan(0.4)), rtol=1e-5)


@pytest.mark.parametrize(
    ("wrap", "cells", "options"),
    [(np.pi, 120, {"formulation": "node_to_segment"}), (np.pi, 60, {}), (3.3, 60, {"formulation": "mortar"})],
)
def test_a_band_slides_around_half_a_drum_that_holds_it_by_friction(wrap, cells, options):
    """On springs as stiff as the band, friction has several solutions, and none near equilibrium from other positions."""
    mesh, turn = fc.generate.block((1.0, 0.5), (cells, 1), "quad8"), 0.5
    angle, radius = turn + (1.0 - mesh.points[:, 0]) * wrap, 50.0 + mesh.points[:, 1]
    mesh = mesh.replace(points=np.column_stack([radius * np.cos(angle), radius * np.sin(angle)]))
    slack, tight = np.array([-np.sin(turn + wrap), np.cos(turn + wrap)]), np.array([np.sin(turn), -np.cos(turn)])
    model = elastic_model(mesh, "plane_strain", E=2e4)
    model.add_traction("LEFT", **dict(zip("xy", 20.0 * slack, strict=True)))
    model.prescribe("RIGHT", x=0.3, axes=tuple(tight))
    drum = fc.obstacles.Sphere((0.0, 0.0), 50.0)
    model.add_obstacle("drum", secondary="BOTTOM", obstacle=drum, friction=0.3, **options)
    step = fc.solve(model, 1)[-1]
    pull = step.reaction.sum(axis=0)
    assert pull @ tight == pytest.approx(10.0 * np.exp(0.3 * wrap), rel=0.02)  # Euler and Eytelwein
    np.testing.assert_allclose(step.contact["drum"].force + pull, -10.0 * slack, atol=1e-6)


@pytest.mark.parametrize("penalty", [100.0, 0.01])
@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")  # of the penetration
def test_a_soft_penalty_holds_a_stiff_block(penalty):
    model = elastic_model(fc.generate.block((2.0, 1.0), (6, 3), "quad4"), "plane_strain", E=2e5, LEFT="x")
    model.add_pressure("TOP", 1e-3)
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, penalty=penalty)
    np.testing.assert_allclose(-fc.solve(model, 1)[-1].displacement[:, 1], 1e-3 / penalty, rtol=1e-6, atol=1e-8)


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_a_nearly_incompressible_ring_that_friction_holds_by_few_sliding_points_settles():
    """Three walls of a groove: points that slide by round-off must not replace Newton's method."""
    mesh = fc.generate.block((4.0, 4.0), (8, 8), "quad8", (20.0, 0.0))
    model = elastic_model(mesh, "axisymmetric", E=10.0, nu=0.4995)
    lid, ramp = {"motion": {"y": -0.1}}, [(0, 0), (1, 1), (2, 1)]
    for side, point, normal, motion in (
        ("TOP", (0.0, 4.0), (0.0, -1.0), lid), ("BOTTOM", (0.0, 0.0), (0.0, 1.0), {}), ("LEFT", (20.0, 0.0), (1.0, 0.0), {}),
    ):  # fmt: skip
        wall = fc.obstacles.HalfSpace(point=point, normal=normal)
        model.add_obstacle(side.lower(), secondary=side, obstacle=wall, friction=0.3, ramp=ramp, **motion)
    model.add_pressure("RIGHT", 0.2, ramp=[(0, 0), (1, 0), (2, 1)])
    contact = fc.solve(model, [0.25 * k for k in range(1, 9)])[-1].contact
    assert abs(sum(pair.force[1] for pair in contact.values())) < 1e-6 * contact["top"].normal_force
