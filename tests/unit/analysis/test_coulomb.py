"""Contact and Coulomb friction on a dense compliance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fastcontact.analysis.friction import cone_newton, dense
from fastcontact.analysis.friction.delassus import Delassus


def residual(F, free, mu, y):
    """The largest residual of the projection equations over the largest force, each constraint in its own units."""
    unit = 1.0 / np.diag(F)[: free.shape[1]]
    trial = y - unit * (free + (F @ y.ravel()).reshape(free.shape))
    n, t = np.maximum(trial[0], 0.0), trial[1:]
    length = np.linalg.norm(t, axis=0)
    t = np.where(length > mu * n, t * mu * n / np.where(length > 0, length, 1.0), t)
    return np.abs(y - np.vstack([n, t])).max() / max(np.abs(y).max(), 1e-300)


def compliance(rng, size):
    """A random positive definite matrix: well conditioned, or with eigenvalues over four decades."""
    A = rng.normal(size=(size, size))
    if rng.random() < 0.5:
        return A @ A.T / size + 10.0 ** rng.uniform(-4, 0) * np.eye(size)
    Q = np.linalg.qr(A)[0]
    return Q @ np.diag(10.0 ** rng.uniform(-3, 1, size)) @ Q.T


def problem(rng, most_friction):
    m, k = rng.integers(1, 13), rng.integers(1, 3)
    F = compliance(rng, (1 + k) * m)
    free = rng.normal(size=(1 + k, m))
    free[0] -= rng.uniform(0, 2)
    mu = np.full(m, 10.0 ** rng.uniform(-2, np.log10(most_friction)))
    if rng.random() < 0.5:
        mu *= rng.uniform(0, 1, m) * (rng.random(m) < 0.8)  # some have no friction
    return 10.0 ** rng.uniform(-6, 6) * F, 10.0 ** rng.uniform(-6, 6) * free, mu


def solved(F, free, mu, closed=None):
    return dense.solve(Delassus(np.zeros(len(F)), F), free, mu, np.zeros(len(mu), bool) if closed is None else closed)


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([1.0, 30.0]))
def test_every_positive_definite_compliance_is_solved(seed, most_friction):
    rng = np.random.default_rng(seed)
    for _ in range(50):
        F, free, mu = problem(rng, most_friction)
        found = solved(F, free, mu)
        assert found.settled
        assert residual(F, free, mu, found.y) <= 1e-9


@pytest.mark.parametrize("tangential", [0.25, 1.0, -2.0])
def test_one_constraint_by_hand(tangential):
    # n = 2 closes the gap of -4; up to 0.5 * 2 the tangential force stops the slip, beyond the rest slides on.
    found = solved(np.diag([2.0, 0.5]), np.array([[-4.0], [tangential]]), np.array([0.5]))
    t = -np.clip(tangential / 0.5, -1.0, 1.0)
    np.testing.assert_allclose(found.y.ravel(), [2.0, t], rtol=1e-14)
    np.testing.assert_allclose(found.gaps.ravel(), [0.0, tangential + 0.5 * t], atol=1e-14)
    assert found.closed.all()
    assert found.sticking[0] == (abs(tangential) < 0.5)


def test_nothing_closed_is_no_force():
    found = solved(np.eye(4), np.array([[1.0, 2.0], [5.0, -5.0]]), np.ones(2))
    assert found.settled
    assert not found.y.any()
    assert not found.closed.any()
    assert solved(np.empty((0, 0)), np.empty((2, 0)), np.empty(0)).settled


def test_units_do_not_matter():
    rng = np.random.default_rng(11)
    F, free = compliance(rng, 24), rng.normal(size=(3, 8))
    one, other = solved(F, free, np.full(8, 0.7)), solved(1e-15 * F, 1e9 * free, np.full(8, 0.7))
    np.testing.assert_allclose(1e-24 * other.y, one.y, rtol=1e-9, atol=1e-12 * np.abs(one.y).max())
    assert one.iterations == other.iterations


def test_the_start_does_not_matter_where_the_solution_is_unique():
    rng = np.random.default_rng(17)
    for _ in range(50):
        F, free, mu = problem(rng, 0.1)
        F[: len(mu), : len(mu)] += 2 * np.linalg.norm(F, 2) * np.eye(len(mu))
        starts = [np.zeros(len(mu), bool), np.ones(len(mu), bool), rng.random(len(mu)) < 0.5]
        first, *others = [solved(F, free, mu, start) for start in starts]
        for other in others:
            np.testing.assert_allclose(other.y, first.y, atol=1e-9 * np.abs(first.y).max())


def test_constraints_that_repeat_each_other_share_the_force():
    F, free = compliance(np.random.default_rng(2), 2), np.array([[-1.0], [0.1]])
    twice = np.kron(F, np.ones((2, 2)))
    one, both = solved(F, free, np.array([0.3])), solved(twice, np.repeat(free, 2, axis=1), np.full(2, 0.3))
    assert both.settled
    np.testing.assert_allclose(both.y.sum(axis=1), one.y[:, 0], rtol=1e-9)


def test_the_second_method_solves_where_newton_does_not(monkeypatch):
    monkeypatch.setattr(cone_newton, "MAX_NEWTON_ITERATIONS", 1)
    rng = np.random.default_rng(23)
    for _ in range(100):
        m = rng.integers(1, 9)
        F, free, mu = compliance(rng, 2 * m), rng.normal(size=(2, m)) - [[1.0], [0.0]], np.full(m, 2.0)
        found = solved(F, free, mu)
        assert found.settled
        assert residual(F, free, mu, found.y) <= 1e-9


def test_a_jam_without_a_solution_is_told():
    # A wedge without stiffness of its own: closing the gap by n and t = mu n opens it again for mu > 1 only.
    F, free = np.array([[1.0, -1.0], [-1.0, 1.0]]), np.array([[-1.0], [0.0]])
    found = solved(F, free, np.array([2.0]))
    assert not found.settled
    assert found.residual > 1e-6
    assert solved(F + 1e-3 * np.eye(2), free, np.array([2.0])).settled  # any stiffness restores one
