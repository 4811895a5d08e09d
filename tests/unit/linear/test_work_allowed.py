"""Estimates of condition numbers, and of the work after which a factorisation replaces multigrid."""

import numpy as np
import pytest
from pressed_blocks import pressed, solved
from scipy.sparse import csr_array
from test_grouped_pivots import mass_equations

from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledError, CoupledPivots, DependenceError, condition
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.solvers import amg


def test_multigrid_that_costs_more_than_factors_hands_over_in_time_and_says_at_which_work(monkeypatch):
    monkeypatch.setattr("fastcontact.linear.multigrid.solver.MAX_COLUMNS", 100_000)
    # The compliance of continuous contact with friction is formed from columns, a solution each.
    model = pressed("hex20", friction=0.3, n=5, formulation="continuous", penalty=100.0)
    solver, found = solved(model, "amg")
    assert solver.counters.iterations <= solver.iteration_limit + 1 + solver.replacement.counters.iterations
    assert f"{solver.iteration_limit} iterations in one load step take longer" in solver.replacement_reason
    assert f"a factorisation of {model.n_dofs} unknowns" in solver.replacement_reason
    exact = solved(model, "direct")[1]
    assert found.displacement == pytest.approx(exact.displacement, abs=1e-10 * np.abs(exact.displacement).max())
    force = exact.contact["c"].force_vectors
    assert found.contact["c"].force_vectors == pytest.approx(force, abs=1e-8 * np.abs(force).max())


def test_after_factors_took_over_solutions_are_as_accurate_as_theirs(monkeypatch):
    monkeypatch.setattr(amg, "MAX_ITERATIONS", 0)
    monkeypatch.setattr(amg, "ITERATIONS_PER_UNKNOWN", {3: 0.0})
    solver, found = solved(pressed(friction=0.3, ratio=1e-3, n=6), "amg")
    assert solver.replacement_reason
    direct, exact = solved(pressed(friction=0.3, ratio=1e-3, n=6), "direct")
    assert solver.tolerance == direct.tolerance
    assert found.displacement == pytest.approx(exact.displacement, abs=1e-11 * np.abs(exact.displacement).max())


def test_without_factors_that_fit_any_work_is_allowed(monkeypatch):
    monkeypatch.setattr(amg, "MAX_ITERATIONS", 0)
    monkeypatch.setattr(amg, "ITERATIONS_PER_UNKNOWN", {3: 0.0})
    monkeypatch.setattr(amg, "MAX_FACTORISED_DOFS", {3: 100})
    solver, _ = solved(pressed(friction=0.3, n=6), "amg")
    assert not solver.replacement_reason
    assert solver.counters.iterations > 10


def test_work_is_that_of_one_load_step_with_changes_of_the_hierarchy(monkeypatch):
    model = pressed(friction=0.3, n=6)
    solver, _ = solved(model, "amg")
    assert solver.work > solver.counters.iterations
    monkeypatch.setattr(amg, "ITERATIONS_PER_UNKNOWN", {3: 0.0})
    monkeypatch.setattr(amg, "MAX_ITERATIONS", 2 * solver.work)
    again, _ = solved(model, "amg", steps=8)
    assert again.work > again.iteration_limit
    assert not again.replacement_reason
    monkeypatch.setattr(amg, "MAX_ITERATIONS", solver.work // 2)
    assert solved(model, "amg")[0].replacement_reason


def estimated(A):
    return condition(csr_array(A), lambda b: np.linalg.solve(A, b), lambda b: np.linalg.solve(A.T, b))


def exactly(A):
    return np.abs(np.abs(np.linalg.inv(A)) @ np.abs(A)).sum(axis=1).max()


@pytest.mark.parametrize("m", [1, 2, 5, 30, 200])
def test_the_estimate_is_a_close_lower_bound_of_the_condition_number_at_any_scale_of_rows(m):
    rng = np.random.default_rng(m)
    for _ in range(20):
        A = rng.normal(size=(m, m)) * 10.0 ** rng.uniform(-3, 3, m)
        for scaled in (A, A * 10.0 ** rng.uniform(-3, 3, (m, 1))):
            assert exactly(A) / 3 <= estimated(scaled) <= exactly(A) * (1 + 1e-6)


def test_what_overflows_has_no_finite_condition():
    for wrong in (np.inf, np.nan):
        assert not np.isfinite(condition(csr_array(np.eye(3)), lambda x, w=wrong: x * w, lambda x, w=wrong: x * w))


@pytest.mark.each_value
@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("rows", [(0, 1), (70, 3), (199, 198)])
def test_forces_through_equal_rows_are_refused_though_no_pivot_is_small(parts, rows):
    B, nodes = mass_equations(200, parts)
    pivots, inverse = pivot_order.choose_pivots(B, nodes, 3)
    assert isinstance(inverse, CoupledPivots)
    F = B.toarray()
    F[rows[1]] = F[rows[0]]
    P = csr_array(csr_array(F)[:, pivots])
    assert np.linalg.matrix_rank(P.toarray()) == len(pivots) - 1
    with pytest.raises(CoupledError):
        CoupledPivots(P, pivots, 3)
    with pytest.raises(DependenceError):
        eliminate(B, np.zeros(len(pivots)), csr_array(F), nodes, 3)


def test_nearly_equal_rows_are_refused_and_others_are_not():
    B, nodes = mass_equations(200, 1)
    pivots, _ = pivot_order.choose_pivots(B, nodes, 3)
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
