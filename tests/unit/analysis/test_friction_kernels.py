"""Kernels of the friction solver against plain NumPy: block Gauss-Seidel sweeps and Lemke's pivots."""

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_array

from fastcontact.analysis.friction import lemke_kernels, sweep_kernels
from fastcontact.analysis.friction.slip_directions import compliance_of_rows


def swept_once(F, free, mu, y):
    """One sweep, constraint by constraint, in plain NumPy."""
    y, (parts, m) = y.copy(), free.shape
    for i in range(m):

        def gaps(y):
            return free + (F @ y.ravel()).reshape(free.shape)

        stiff = max(F[a * m + i, a * m + i] for a in range(1, parts))
        y[0, i] = max(0.0, y[0, i] - gaps(y)[0, i] / F[i, i])
        t = y[1:, i] - gaps(y)[1:, i] / stiff
        limit, length = mu[i] * y[0, i], np.linalg.norm(t)
        y[1:, i] = t * (limit / length if length > limit else 1.0)
    return y


@pytest.mark.parametrize("parts", [2, 3])
def test_sweeps_against_numpy(parts):
    rng = np.random.default_rng(parts)
    m = 7
    A = rng.normal(size=(parts * m, parts * m))
    F, free, mu = A @ A.T + np.eye(parts * m), rng.normal(size=(parts, m)), rng.uniform(0.1, 1.0, m)
    y, gaps, plain = np.zeros((parts, m)), np.empty((parts, m)), np.zeros((parts, m))
    assert sweep_kernels.sweep(F, free, mu, y, gaps, 0.0, 3) == 3
    for _ in range(3):
        plain = swept_once(F, free, mu, plain)
    np.testing.assert_allclose(y, plain, atol=1e-12 * np.abs(plain).max())
    np.testing.assert_allclose(gaps, free + (F @ y.ravel()).reshape(free.shape), atol=1e-10)


def test_pivots_against_all_bases():
    rng = np.random.default_rng(0)
    for _ in range(50):
        n = 5
        A = rng.normal(size=(n, n))
        M, q, z = A @ A.T + 0.1 * np.eye(n) + (A - A.T), rng.normal(size=n), np.empty(n)
        assert lemke_kernels.pivot(M, q, z, 100) >= 0
        wanted = None
        for basis in itertools.product([False, True], repeat=n):
            on, x = np.flatnonzero(basis), np.zeros(n)
            x[on] = np.linalg.solve(M[np.ix_(on, on)], -q[on])
            if (x >= 0).all() and (M @ x + q >= -1e-12).all():
                wanted = x
        np.testing.assert_allclose(z, wanted, atol=1e-10)


def test_pivots_tell_a_problem_without_a_solution():
    z = np.ones(1)
    assert lemke_kernels.pivot(np.array([[-1.0]]), np.array([-1.0]), z, 10) < 0
    assert z[0] == 0.0
    assert lemke_kernels.pivot(np.array([[1.0]]), np.array([2.0]), z, 10) == 0
    assert z[0] == 0.0


def test_pivots_are_counted():
    n = 6
    A = np.random.default_rng(1).normal(size=(n, n))
    z = np.empty(n)
    needed = lemke_kernels.pivot(A @ A.T + np.eye(n), -np.ones(n), z, 1000)
    assert needed > 1
    assert lemke_kernels.pivot(A @ A.T + np.eye(n), -np.ones(n), z, needed - 1) < 0


def test_compliance_of_rows_against_dense_products():
    rng = np.random.default_rng(11)
    rows = tuple(csr_array(rng.normal(size=(8, 30)) * (rng.random((8, 30)) < 0.3)) for _ in range(3))
    yielding = rng.random(30)
    stack = np.stack([R.toarray() for R in rows])
    expected = np.einsum("ain,n,bin->abi", stack, yielding, stack)
    assert compliance_of_rows(rows, yielding) == pytest.approx(expected)
