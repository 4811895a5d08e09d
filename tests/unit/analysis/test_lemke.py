"""Components of the friction solver: Lemke's method, and products of rows."""

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_array

from fastcontact.analysis.friction import lemke
from fastcontact.analysis.friction.slip_directions import compliance_of_rows


def test_pivots_against_all_bases():
    rng = np.random.default_rng(0)
    for _ in range(50):
        n = 5
        A = rng.normal(size=(n, n))
        M, q = A @ A.T + 0.1 * np.eye(n) + (A - A.T), rng.normal(size=n)
        z, _ = lemke.solved(M, q, 100)
        wanted = None
        for basis in itertools.product([False, True], repeat=n):
            on, x = np.flatnonzero(basis), np.zeros(n)
            x[on] = np.linalg.solve(M[np.ix_(on, on)], -q[on])
            if (x >= 0).all() and (M @ x + q >= -1e-12).all():
                wanted = x
        np.testing.assert_allclose(z, wanted, atol=1e-10)


def test_pivots_tell_a_problem_without_a_solution():
    assert lemke.solved(np.array([[-1.0]]), np.array([-1.0]), 10)[0] is None
    z, count = lemke.solved(np.array([[1.0]]), np.array([2.0]), 10)
    assert (z.tolist(), count) == ([0.0], 0)


def test_pivots_are_counted():
    n = 6
    A = np.random.default_rng(1).normal(size=(n, n))
    problem = A @ A.T + np.eye(n), -np.ones(n)
    z, needed = lemke.solved(*problem, 1000)
    assert z is not None
    assert needed > 1
    assert lemke.solved(*problem, needed - 1)[0] is None


def test_compliance_of_rows_against_dense_products():
    rng = np.random.default_rng(11)
    rows = tuple(csr_array(rng.normal(size=(8, 30)) * (rng.random((8, 30)) < 0.3)) for _ in range(3))
    yielding = rng.random(30)
    stack = np.stack([R.toarray() for R in rows])
    expected = np.einsum("ain,n,bin->abi", stack, yielding, stack)
    assert compliance_of_rows(rows, yielding) == pytest.approx(expected)
