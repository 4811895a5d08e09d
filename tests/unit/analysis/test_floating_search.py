"""The search for the position of bodies held by contact alone: what it returns belongs together, whatever fails."""

import dataclasses

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.analysis.floating_bodies import TRIALS, FloatingBodies, _Search
from fastcontact.analysis.solution import Equilibrium

DOFS = np.array([0])


def solution(elongation, settled=True):
    active = np.array([True])
    return Equilibrium(
        np.array([elongation]), np.zeros(1), np.zeros(1), active, active if settled else ~active, iterations=1
    )


def test_position_and_state_belong_together_when_no_length_will_do():
    """An elongation that grows wherever one looks: all trials are made."""
    tried = []

    def solve_at(position):
        tried.append(position.copy())
        return solution(1.0 if len(tried) == 1 else 10.0 ** len(tried))

    search = _Search(solve_at, DOFS, np.zeros(1))
    search.move(np.array([-1.0]))
    assert len(tried) == 1 + TRIALS
    np.testing.assert_array_equal(search.position, tried[-1])
    assert search.elongation[0] == 10.0 ** len(tried)


def test_the_contact_problem_that_fails_is_the_one_returned():
    """A probe that does not settle is no sign that contact does not hold the body."""
    bodies = FloatingBodies.__new__(FloatingBodies)
    bodies.dofs, bodies.stiffness = DOFS, 1.0
    calls = []

    def solve_at(position):
        calls.append(position)
        return solution(1.0 - position[0], settled=len(calls) != 2)

    found = bodies.settle(solve_at, np.zeros(1), load=1.0, noise=0.0, round_off=0.0)
    assert not found.slack
    assert not found.state.settled
    assert found.state.iterations == found.positions == len(calls)


def test_a_much_stiffer_stop_is_found():
    """Soft up to a place, a million times as stiff beyond it: steps from either side are of no use at the other."""
    tried = []

    def solve_at(position):
        tried.append(position[0])
        return solution(1e-6 * (2.0 - position[0]) if position[0] < 1.0 else 1e-6 - (position[0] - 1.0))

    search = _Search(solve_at, DOFS, np.zeros(1))
    while search.left > 1e-12:
        search.move(-search.elongation / search.differences(1e-3 * search.left)[0])
    assert search.position[0] == pytest.approx(1.0 + 1e-6, abs=1e-9)
    assert len(tried) < 60


def test_what_nothing_resists_goes_as_far_as_something_does():
    """Its spring alone would move it by the elongation, a millionth of the way to the next stop."""
    tried = []

    def solve_at(position):
        tried.append(position[0])
        return solution(1e-6 - max(position[0] - 1.0, 0.0))

    search = _Search(solve_at, DOFS, np.zeros(1))
    search.move(search.elongation)
    assert len(tried) <= 1 + TRIALS
    assert abs(search.left) <= 0.5e-6
    assert search.position[0] == pytest.approx(1.0, abs=1e-5)


def three_springs():
    """Return bodies with three springs, and a smooth problem of theirs: elongations (3,) by the position, and its calls."""
    bodies = FloatingBodies.__new__(FloatingBodies)
    bodies.dofs, bodies.stiffness = np.arange(3), 1.0
    matrix = np.array([[2.0, 0.5, 0.0], [0.5, 1.0, 0.2], [0.0, 0.2, 0.7]])
    calls = []

    def solve_at(position):
        calls.append(position)
        w = np.array([1.0, -0.5, 0.3]) - matrix @ position - 0.05 * position**3
        return dataclasses.replace(solution(0.0), u=w)

    return bodies, solve_at, calls


def test_a_derivative_is_kept_and_corrected():
    """One by differences, of three problems, is enough; with that of the last pairing none is needed."""
    bodies, solve_at, calls = three_springs()
    found = bodies.settle(solve_at, np.zeros(3), load=1.0, noise=0.0, round_off=0.0)
    assert found.slack
    assert len(calls) <= 1 + 3 + 8
    calls.clear()
    again = bodies.settle(solve_at, found.position + 1e-4, 1.0, 0.0, 0.0, found.derivative)
    assert again.slack
    np.testing.assert_allclose(again.position, found.position, rtol=0.0, atol=1e-11)
    assert len(calls) <= 6
    assert np.all(calls[1] != calls[0])  # a step: differences move one spring at a time


def test_a_wrong_derivative_is_replaced():
    bodies, solve_at, _ = three_springs()
    exact = bodies.settle(solve_at, np.zeros(3), 1.0, 0.0, 0.0)
    for wrong in (-1e3 * np.eye(3), np.eye(3), np.zeros((3, 3))):
        found = bodies.settle(solve_at, np.zeros(3), 1.0, 0.0, 0.0, wrong)
        assert found.slack
        np.testing.assert_allclose(found.position, exact.position, rtol=0.0, atol=1e-11)


def test_what_noise_hides_is_still_brought_down_by_a_known_derivative():
    """A load of 1 and a spring that carries 1e-6 of it, below the noise of its elongation: one solution more."""
    bodies, solve_at, _ = three_springs()
    found = bodies.settle(solve_at, np.zeros(3), 1.0, 0.0, 0.0)

    def beside_a_large_displacement(position):
        return dataclasses.replace(solve_at(position), u=np.append(solve_at(position).u, 1.0))

    nearby = found.position + 1e-6
    before = bodies.settle(beside_a_large_displacement, nearby, 1.0, 1e-5, 0.0)
    assert before.positions == 1
    after = bodies.settle(beside_a_large_displacement, nearby, 1.0, 1e-5, 0.0, found.derivative)
    assert after.positions == 2
    assert np.abs(after.spring_force).max() < 0.1 * np.abs(before.spring_force).max()


@pytest.mark.parametrize(
    ("friction", "linear_solver", "most"),
    [(0.0, "direct", 25), (0.0, "amg", 25), (0.3, "direct", 180), (0.3, "amg", 100)],
)
def test_plates_that_lie_loose_on_each_other_cost_few_solutions(friction, linear_solver, most):
    """Three plates that do not match, pressed and sheared: differences once a step, and starts from the last position."""
    sizes, divisions = ((8.0, 2.0), (6.0, 2.0), (7.0, 2.0)), ((6, 2), (5, 2), (7, 2))
    plates, z = [], 0.0
    for i, ((width, height), (n, k)) in enumerate(zip(sizes, divisions, strict=True)):
        plate = fc.generate.box((width, width, height), (n, n, k), origin=(-width / 2, -width / 2, z))
        plates.append(fc.generate.renamed(plate, {name: f"{name}{i}" for name in plate.group_names}))
        z += height
    model = fc.Model(fc.generate.union(*plates), "3d")
    for i, E in enumerate((2e5, 1e4, 7e4)):
        model.add_material(fc.LinearElastic(E, 0.3), groups=[f"BOX{i}"])
    model.fix("ZMIN0", "xyz")
    model.add_pressure("ZMAX2", 10.0)
    for i in (1, 2):
        model.add_contact(f"c{i}", secondary=f"ZMIN{i}", primary=f"ZMAX{i - 1}", friction=friction)
        if not friction:
            model.fix(f"XMIN{i}", "x")
            model.fix(f"YMIN{i}", "y")
    if friction:
        model.add_traction("ZMAX2", x=1.0)
    (step,) = fc.solve(model, 1, linear_solver=linear_solver)
    for name in ("c1", "c2"):
        force = step.contact[name].force
        assert abs(force[2]) == pytest.approx(490.0, rel=1e-7)
        if friction:
            np.testing.assert_allclose(np.abs(force[:2]), [49.0, 0.0], rtol=1e-6, atol=1e-5)
    assert step.iterations["active_set_iterations"] <= most


@pytest.mark.parametrize("force", [0.0, 1e5])
def test_slack_is_in_units_of_the_contact_forces(force):
    """Where motions drive the bodies there is no load: what round-off leaves is compared with what presses on them."""
    bodies = FloatingBodies.__new__(FloatingBodies)
    bodies.dofs, bodies.stiffness = DOFS, 1.0

    def solve_at(position):
        found = solution(1e-9 if position[0] > 0.5 else 1.0 - position[0])
        return dataclasses.replace(found, multiplier=np.array([force]))

    found = bodies.settle(solve_at, np.zeros(1), load=0.0, noise=0.0, round_off=0.0)
    assert found.slack == (force > 0.0)
    assert found.position[0] > 0.5


def test_an_unsettled_probe_is_told_as_an_active_set_that_cycles():
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3)
    model = fc.Model(mesh, "axisymmetric")
    model.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    model.fix("A1A2", "x")
    model.fix("A1B1", "y")
    model.add_force("A2B2", y=-3e5)
    model.couple("A2B2", "y")
    model.add_contact("hertz", secondary="CONT1", primary="CONT2")
    criteria = fc.Criteria(max_active_set_iterations=1, max_halvings=0)
    with pytest.raises(fc.ConvergenceError, match=r"the active set did not settle in .* constraint.* still change"):
        fc.solve(model, fc.linear_ramp(1), criteria=criteria)
