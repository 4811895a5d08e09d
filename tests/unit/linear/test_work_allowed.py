"""A factorisation replaces multigrid once a load step has taken more work than it would."""

import numpy as np
import pytest
from pressed_blocks import pressed

import fastcontact as fc
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import prepare
from fastcontact.linear.solvers import amg


def solved(model, name, steps=1):
    """Return the solver and the last result."""
    problem = prepare(model, fc.linear_ramp(steps), fc.Criteria(), linear_solver=name)
    state = problem.initial_state()
    for index in range(steps):
        state, result = load_step(problem, state, index + 1, (index + 1) / steps)
    return problem.solver, result


def columns_with_friction():
    """Continuous contact with friction, whose compliance multigrid forms from columns, a solution each."""
    return pressed("hex20", friction=0.3, n=5, formulation="continuous", penalty=100.0)


def test_multigrid_that_costs_more_than_factors_hands_over_in_time_and_says_at_which_work(monkeypatch):
    monkeypatch.setattr("fastcontact.linear.multigrid.solver.MOST_COLUMNS", 100_000)
    model = columns_with_friction()
    solver, found = solved(model, "amg")
    assert solver.counters.iterations <= solver.affordable + 1 + solver.instead.counters.iterations
    assert f"the work of {solver.affordable} iterations in one load step" in solver.gave_up
    assert f"a factorisation of {model.n_dofs} unknowns" in solver.gave_up
    exact = solved(model, "direct")[1]
    assert found.displacement == pytest.approx(exact.displacement, abs=1e-10 * np.abs(exact.displacement).max())
    force = exact.contact["c"].force_vectors
    assert found.contact["c"].force_vectors == pytest.approx(force, abs=1e-8 * np.abs(force).max())


def test_after_factors_took_over_solutions_are_as_accurate_as_theirs(monkeypatch):
    monkeypatch.setattr(amg, "COST", 0)
    monkeypatch.setattr(amg, "COST_OF_UNKNOWN", {3: 0.0})
    solver, found = solved(pressed(friction=0.3, ratio=1e-3, n=6), "amg")
    assert solver.gave_up
    direct, exact = solved(pressed(friction=0.3, ratio=1e-3, n=6), "direct")
    assert solver.tolerance == direct.tolerance
    assert found.displacement == pytest.approx(exact.displacement, abs=1e-11 * np.abs(exact.displacement).max())


def test_without_factors_that_fit_any_work_is_allowed(monkeypatch):
    monkeypatch.setattr(amg, "COST", 0)
    monkeypatch.setattr(amg, "COST_OF_UNKNOWN", {3: 0.0})
    monkeypatch.setattr(amg, "AFFORDABLE", {3: 100})
    solver, _ = solved(pressed(friction=0.3, n=6), "amg")
    assert not solver.gave_up
    assert solver.counters.iterations > 10


def test_work_is_that_of_one_load_step_with_changes_of_the_hierarchy(monkeypatch):
    model = pressed(friction=0.3, n=6)
    solver, _ = solved(model, "amg")
    assert solver.work > solver.counters.iterations
    monkeypatch.setattr(amg, "COST_OF_UNKNOWN", {3: 0.0})
    monkeypatch.setattr(amg, "COST", 2 * solver.work)
    again, _ = solved(model, "amg", steps=8)
    assert again.work > again.affordable
    assert not again.gave_up
    monkeypatch.setattr(amg, "COST", solver.work // 2)
    assert solved(model, "amg")[0].gave_up
