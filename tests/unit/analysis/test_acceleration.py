"""Anderson acceleration: as good as a Krylov method on linear maps, and insensitive to irrelevant components."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact.analysis.anderson import Anderson


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
