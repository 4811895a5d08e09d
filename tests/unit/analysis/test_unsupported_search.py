"""The search for the position of bodies held by contact alone: what it returns belongs together, whatever fails."""

import dataclasses

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.analysis.solution import Equilibrium
from fastcontact.analysis.unsupported_bodies import TRIALS, UnsupportedBodies, _Search

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
    bodies = UnsupportedBodies.__new__(UnsupportedBodies)
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


@pytest.mark.parametrize("force", [0.0, 1e5])
def test_slack_is_in_units_of_the_contact_forces(force):
    """Where motions drive the bodies there is no load: what round-off leaves is compared with what presses on them."""
    bodies = UnsupportedBodies.__new__(UnsupportedBodies)
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
