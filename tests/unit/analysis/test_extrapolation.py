"""Initial guess of load steps, and Anderson acceleration of the geometry loop."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact.analysis.anderson import Anderson
from fastcontact.analysis.extrapolation import Extrapolation


def after_two_steps(loads=(1.0, 2.0)):
    found = Extrapolation()
    for factor in loads:
        found = found.to_loads(np.zeros(3), factor * np.arange(3.0))
        gap, force = np.array([1.0 - 0.4 * factor, 0.0, 0.0, np.inf]), np.array([0.0, factor, 1.2 - 0.5 * factor, 0.0])
        found = found.after(factor * np.ones(3), {"c": (gap, force)})
    return found


@pytest.mark.parametrize(("factor", "expected"), [(3.0, 3.0), (2.5, 2.5), (4.0, 4.0), (9.0, 2.0), (1.0, 2.0)])
def test_displacements_go_on_with_the_loads_but_not_far_and_not_back(factor, expected):
    found = after_two_steps().to_loads(np.zeros(3), factor * np.arange(3.0))
    assert found.predicted(2.0 * np.ones(3), degree=1) == pytest.approx(expected * np.ones(3))


def test_the_middle_of_a_step_is_on_a_parabola_or_on_a_line():
    begin, end = 4.0 * np.ones(3), 9.0 * np.ones(3)
    found = after_two_steps().to_loads(np.zeros(3), 4.0 * np.arange(3.0))  # u = 1 at -1, 4 at 0 and 9 at 2
    assert found.midway(begin, end) == pytest.approx((4.0 + 17.0 / 6.0 - 1.0 / 6.0) * np.ones(3))
    assert found.to_loads(np.zeros(3), 0.0 * np.arange(3.0)).midway(begin, end) == pytest.approx(6.5 * np.ones(3))


def test_constraints_close_and_open_where_gaps_and_forces_change_sign():
    found = after_two_steps().to_loads(np.zeros(3), 3.0 * np.arange(3.0))
    last = np.array([False, True, True, False])
    assert found.active("c", last).tolist() == [True, True, False, False]
    assert found.active("other", last) is last
    assert found.active("c", last[:3]).tolist() == last[:3].tolist()


def test_the_first_two_steps_start_from_the_last_state():
    found = Extrapolation().to_loads(np.ones(2)).after(np.ones(2), {}).to_loads(2.0 * np.ones(2))
    u = np.ones(2)
    assert found.predicted(u, degree=1) is u


def test_displacements_and_forces_are_each_compared_with_their_own():
    """A step moved by forces, then steps moved by supports: lengths are not subtracted from forces."""
    found = Extrapolation()
    for lift, force in ((0.0, 1e6), (1e-3, 1e6)):
        found = found.to_loads(np.full(2, lift), np.full(2, force)).after(np.ones(2), {})
    found = found.to_loads(np.full(2, 3e-3), np.full(2, 1e6))
    assert found.ratio == pytest.approx(2.0)
    constant = Extrapolation()
    for force in (1.0, 2.0):
        constant = constant.to_loads(np.ones(2), np.full(2, force)).after(np.ones(2), {})
    assert constant.to_loads(np.ones(2), np.full(2, 2.5)).ratio == pytest.approx(0.5)


def test_what_a_file_keeps_is_what_was_there_and_earlier_files_tell_less():
    found = after_two_steps()
    u, loads = found.states[-1][0], (np.zeros(3), 3.0 * np.arange(3.0))
    assert Extrapolation.from_dict(found.to_dict(), u).to_loads(*loads).ratio == found.to_loads(*loads).ratio == 1.0
    kept = found.to_dict()
    kept["loads"] = [parts[1] for parts in kept["loads"]]
    assert Extrapolation.from_dict(kept, u).to_loads(*loads).ratio == 0.0


def on_a_curve(loads, path):
    found = Extrapolation()
    for factor in loads:
        found = found.to_loads(np.full(2, factor)).after(path(factor), {}, curved=True)
    return found


@pytest.mark.parametrize("loads", [(1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (1.0, 1.5, 2.5, 3.0, 3.5, 4.5)])
def test_a_smooth_path_is_continued_by_polynomials_of_ascending_degree(loads):
    def path(factor):
        return np.array([1.0 + factor + 0.5 * factor**3, -(factor**2)])

    early = on_a_curve(loads[:2], path).to_loads(np.full(2, loads[2]))
    assert np.array_equal(early.predicted(path(loads[1])), early.predicted(path(loads[1]), degree=1))  # a line
    end = loads[-1] + 0.5
    found = on_a_curve(loads, path).to_loads(np.full(2, end))
    assert found.predicted(path(loads[-1])) == pytest.approx(path(end), rel=1e-13)
    assert found.predicted(path(loads[-1]), degree=1) != pytest.approx(path(end), rel=1e-2)
    again = Extrapolation.from_dict(on_a_curve(loads, path).to_dict(), path(loads[-1])).to_loads(np.full(2, end))
    assert np.array_equal(again.predicted(path(loads[-1])), found.predicted(path(loads[-1])))


def test_the_degree_does_not_grow_where_a_path_is_not_smooth():
    zigzag = on_a_curve(range(1, 8), lambda factor: np.full(2, factor + 0.3 * (factor % 2))).to_loads(np.full(2, 8.0))
    assert zigzag.degree == 1
    assert zigzag.predicted(np.full(2, 7.3)) == pytest.approx(np.full(2, 8.6))


def test_a_kinked_path_is_continued_along_a_line():
    found = on_a_curve((1.0, 2.0, 3.0, 4.0), lambda f: np.full(2, f - (f > 2.0))).to_loads(np.full(2, 5.0))
    assert found.predicted(np.full(2, 3.0)) == pytest.approx(np.full(2, 4.0))


def iterations(G, x, depth, where, tolerance=1e-12, limit=200):
    accelerated = Anderson(depth, where)
    for count in range(1, limit + 1):
        image = G(x)
        if np.abs(image - x).max() <= tolerance:
            return count, image
        x = accelerated.mixed(x, image)
    raise AssertionError("no fixed point found")


@given(st.integers(0, 10_000), st.integers(1, 4))
@settings(max_examples=50, deadline=None)
def test_a_linear_map_of_low_rank_is_solved_in_as_many_steps_as_its_rank_and_three(seed, rank):
    random = np.random.default_rng(seed)
    Q = np.linalg.qr(random.standard_normal((20, rank)))[0]
    A = Q @ np.diag(random.uniform(-0.9, 0.9, rank)) @ Q.T
    b = random.standard_normal(20)
    count, x = iterations(lambda v: A @ v + b, np.zeros(20), rank, np.arange(20), tolerance=1e-9)
    assert count <= rank + 3
    np.testing.assert_allclose(x, np.linalg.solve(np.eye(20) - A, b), atol=1e-7)


def test_a_slow_contraction_takes_fewer_steps_than_plain_iteration():
    rates = np.linspace(0.0, 0.5, 30)
    b = np.ones(30)
    plain, _ = iterations(lambda v: rates * v + b, np.zeros(30), 0, np.arange(30))
    mixed, x = iterations(lambda v: rates * v + b, np.zeros(30), 5, np.arange(30))
    assert mixed <= 0.55 * plain
    np.testing.assert_allclose(x, b / (1 - rates), rtol=1e-11)


def test_components_that_do_not_count_follow_the_others():
    def G(v):
        return np.array([0.5 * v[0] + 1.0, 3.0 * v[0]])

    x = np.zeros(2)
    accelerated = Anderson(2, np.array([0]))
    for _ in range(4):
        x = accelerated.mixed(x, G(x))
    np.testing.assert_allclose(x, [2.0, 6.0], rtol=1e-12)


def test_after_a_restart_the_next_iterate_is_the_image():
    accelerated = Anderson(3, np.arange(2))
    accelerated.mixed(np.zeros(2), np.ones(2))
    accelerated.restart()
    np.testing.assert_array_equal(accelerated.mixed(np.ones(2), np.array([1.5, 1.5])), [1.5, 1.5])
