"""The active-set solver compared with enumeration of all active sets, with every linear solver."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import DenseCompliance
from scipy.sparse import bsr_array, csr_array

from fastcontact.analysis import active_set
from fastcontact.analysis.solution import Accuracy
from fastcontact.contact.constraints import Constraints
from fastcontact.linear import choice as linear


def enumerate_solutions(K, f, B, gap0, C):
    """Return the multipliers of the only active set that satisfies all inequalities."""
    delassus, free = B @ np.linalg.solve(K, B.T) + C, gap0 + B @ np.linalg.solve(K, f)
    m = len(gap0)
    for size in range(m + 1):
        for rows in itertools.combinations(range(m), size):
            rows = list(rows)
            multiplier = np.zeros(m)
            multiplier[rows] = np.linalg.solve(delassus[np.ix_(rows, rows)], -free[rows])
            if (multiplier >= -1e-12).all() and (free + delassus @ multiplier >= -1e-10).all():
                return multiplier
    raise AssertionError("a strictly convex problem has a solution")


def random_problem(seed, n=8, m=5):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    return A @ A.T + np.eye(n), rng.normal(size=n), rng.normal(size=(m, n)), rng.normal(size=m), rng


def solve(K, f, B, gap0, C=None, start=None, solver="direct", **options):
    loaded = linear.make(solver, dim=2, n_dofs=len(f), tolerance=1e-13)
    loaded.prepare(bsr_array(K, blocksize=(2, 2)), np.ones((len(f), 1)))
    constraints = Constraints(csr_array(B), gap0, np.zeros((len(gap0), 2)), C)
    begin = np.zeros(len(gap0), bool) if start is None else start
    return active_set.solve(loaded.load(f), constraints, begin, Accuracy(gap=1e-12, **options))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000), soft=st.booleans(), start=st.integers(0, 31))
def test_every_start_ends_in_the_enumerated_solution(seed, soft, start):
    K, f, B, gap0, rng = random_problem(seed)
    half = rng.normal(size=(5, 2))
    C = half @ half.T if soft else np.zeros((5, 5))
    begin = np.array([bool(start >> k & 1) for k in range(5)])
    state = solve(K, f, B, gap0, DenseCompliance(C) if soft else None, begin)
    assert state.settled
    assert state.multiplier == pytest.approx(enumerate_solutions(K, f, B, gap0, C), abs=1e-8)
    assert np.abs(K @ state.u - f - B.T @ state.multiplier).max() < 1e-9
    assert np.abs(state.gap * state.multiplier).max() < 1e-9


def test_sets_that_recur_are_left_by_the_least_index():
    """Changing all wrong constraints at once, from an empty set, comes back to a set after six solutions."""
    B = np.array([[-2.0, -2.0, -2.0, -1.0], [2.0, 0.0, -1.0, 2.0], [-3.0, -2.0, -1.0, -2.0], [1.0, -1.0, 0.0, 3.0]])
    K, f, gap0 = np.eye(4), np.zeros(4), np.array([-8.0, -8.0, -2.0, -3.0])
    state = solve(K, f, B, gap0)
    assert state.settled
    assert state.iterations > 6
    assert state.multiplier == pytest.approx(enumerate_solutions(K, f, B, gap0, np.zeros((4, 4))), abs=1e-8)


@pytest.mark.parametrize("solver", linear.SOLVERS)
def test_every_linear_solver_gives_the_same_state(solver):
    K, f, B, gap0, _ = random_problem(3)
    state = solve(K, f, B, gap0, solver=solver)
    assert state.multiplier == pytest.approx(enumerate_solutions(K, f, B, gap0, np.zeros((5, 5))), abs=1e-8)


def test_rows_that_repeat_each_other_do_no_harm():
    K, f, B, gap0, _ = random_problem(3)
    twice = np.vstack([B, B[:1]])
    state = solve(K, f, twice, np.append(gap0, gap0[0]), start=np.ones(6, bool))
    single = solve(K, f, B, gap0)
    assert state.u == pytest.approx(single.u, abs=1e-10)


def test_an_unusable_constraint_stays_open():
    K, f, _, gap0, _ = random_problem(3)
    loaded = linear.make("direct", dim=2, n_dofs=8)
    loaded.prepare(bsr_array(K, blocksize=(2, 2)), np.ones((8, 1)))
    constraints = Constraints(csr_array((5, 8)), gap0, np.zeros((5, 2)))
    state = active_set.solve(loaded.load(f), constraints, np.ones(5, bool), Accuracy(gap=1e-12))
    assert state.u == pytest.approx(np.linalg.solve(K, f))
    assert not state.multiplier.any()


def test_a_limit_of_iterations_returns_an_unsettled_state():
    for seed in range(50):
        K, f, B, gap0, _ = random_problem(seed)
        if not solve(K, f, B, gap0, max_iterations=1).settled:
            return
    raise AssertionError("no problem needed a second iteration")
