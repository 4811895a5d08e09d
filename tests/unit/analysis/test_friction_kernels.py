"""Kernels of the friction solver against plain NumPy: products of rows and Lemke's pivots."""

import itertools

import numpy as np
import pytest
from scipy.sparse import csr_array

from fastcontact.analysis.friction import lemke_kernels
from fastcontact.analysis.friction.slip_directions import compliance_of_rows


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
