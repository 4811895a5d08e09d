"""Estimates of condition numbers compared with exact ones; singular matrices with inconspicuous factors."""

import numpy as np
import pytest
from scipy.sparse import csr_array
from test_coupled_pivots import mass_equations

from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledError, CoupledPivots, RepeatedError, condition
from fastcontact.linear.elimination.elimination import eliminate


def estimated(A):
    return condition(csr_array(A), lambda b: np.linalg.solve(A, b), lambda b: np.linalg.solve(A.T, b))


def exactly(A):
    return np.abs(np.abs(np.linalg.inv(A)) @ np.abs(A)).sum(axis=1).max()


@pytest.mark.parametrize("m", [1, 2, 5, 30, 200])
def test_the_estimate_is_a_close_lower_bound_of_the_condition_number(m):
    rng = np.random.default_rng(m)
    for _ in range(20):
        A = rng.normal(size=(m, m)) * 10.0 ** rng.uniform(-3, 3, m)
        assert exactly(A) / 3 <= estimated(A) <= exactly(A) * (1 + 1e-6)


@pytest.mark.parametrize("size", [1.0, 1e-3, 1e3])
def test_condition_numbers_do_not_depend_on_the_scale_of_rows(size):
    rng = np.random.default_rng(3)
    A = rng.normal(size=(40, 40)) + 5 * np.eye(40)
    scaled = A * (size ** rng.uniform(-1, 1, 40))[:, None]
    assert exactly(A) / 3 <= estimated(scaled) <= exactly(A) * (1 + 1e-6)


def test_what_overflows_has_no_finite_condition():
    for wrong in (np.inf, np.nan):
        assert not np.isfinite(condition(csr_array(np.eye(3)), lambda x, w=wrong: x * w, lambda x, w=wrong: x * w))


@pytest.mark.each_value
@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("rows", [(0, 1), (70, 3), (199, 198)])
def test_forces_through_equal_rows_are_refused_though_no_pivot_is_small(parts, rows):
    B, nodes = mass_equations(200, parts)
    pivots, inverse = pivot_order.chosen(B, nodes, 3)
    assert isinstance(inverse, CoupledPivots)
    F = B.toarray()
    F[rows[1]] = F[rows[0]]
    P = csr_array(csr_array(F)[:, pivots])
    assert np.linalg.matrix_rank(P.toarray()) == len(pivots) - 1
    with pytest.raises(CoupledError):
        CoupledPivots(P, pivots, 3)
    with pytest.raises(RepeatedError):
        eliminate(B, np.zeros(len(pivots)), csr_array(F), nodes, 3)


def test_nearly_equal_rows_are_refused_and_others_are_not():
    B, nodes = mass_equations(200, 1)
    pivots, _ = pivot_order.chosen(B, nodes, 3)
    for apart, refused in ((1e-9, True), (1e-1, False)):
        F = B.toarray()
        F[1] = F[0] + apart * F[1]
        P = csr_array(csr_array(F)[:, pivots])
        if refused:
            with pytest.raises(CoupledError):
                CoupledPivots(P, pivots, 3)
        else:
            b = np.cos(np.arange(200.0))
            assert P @ CoupledPivots(P, pivots, 3).solve(b) == pytest.approx(b, abs=1e-9)
