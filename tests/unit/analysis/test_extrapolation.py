"""Starts of load steps: linear where the loads go on, none where they turn or jump."""

import numpy as np
import pytest

from fastcontact.analysis.extrapolation import Extrapolation


def after_two_steps(loads=(1.0, 2.0)):
    found = Extrapolation()
    for factor in loads:
        found = found.to(np.zeros(3), factor * np.arange(3.0))
        gap, force = np.array([1.0 - 0.4 * factor, 0.0, 0.0, np.inf]), np.array([0.0, factor, 1.2 - 0.5 * factor, 0.0])
        found = found.converged(factor * np.ones(3), {"c": (gap, force)})
    return found


@pytest.mark.parametrize(("factor", "expected"), [(3.0, 3.0), (2.5, 2.5), (4.0, 4.0), (9.0, 2.0), (1.0, 2.0)])
def test_displacements_go_on_with_the_loads_but_not_far_and_not_back(factor, expected):
    found = after_two_steps().to(np.zeros(3), factor * np.arange(3.0))
    assert found.displacement(2.0 * np.ones(3)) == pytest.approx(expected * np.ones(3))


def test_constraints_close_and_open_where_gaps_and_forces_change_sign():
    found = after_two_steps().to(np.zeros(3), 3.0 * np.arange(3.0))
    last = np.array([False, True, True, False])
    assert found.active("c", last).tolist() == [True, True, False, False]
    assert found.active("other", last) is last
    assert found.active("c", last[:3]).tolist() == last[:3].tolist()


def test_the_first_two_steps_start_from_the_last_state():
    found = Extrapolation().to(np.ones(2)).converged(np.ones(2), {}).to(2.0 * np.ones(2))
    u = np.ones(2)
    assert found.displacement(u) is u
