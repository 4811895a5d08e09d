"""Substeps of nonlinear bodies: halved on failure, equal afterwards, larger after few iterations."""

from dataclasses import replace

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.analysis import step_halving
from fastcontact.analysis.problem import prepare
from fastcontact.errors import ConvergenceError


def problem():
    model = fc.Model(fc.generate.block((1.0, 1.0), (1, 1)), "plane_strain", strain="finite")
    model.add_material(fc.NeoHookean(E=1.0, nu=0.3))
    model.fix("BOTTOM", "xy")
    model.prescribe("TOP", y=-0.1)
    return prepare(model, fc.linear_ramp(2), fc.Criteria())


def test_sizes_are_kept_and_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    solved, tried = step_halving.load_step, []

    def load_step(problem, state, index, instant):
        span = instant - tried[-1][1] if tried and tried[-1][2] else instant - state_at
        converges = span <= largest + 1e-12
        tried.append((span, instant if converges else (tried[-1][1] if tried else state_at), True))
        if not converges:
            raise ConvergenceError("too far")
        end, result = solved(problem, state, index, instant)
        return end, replace(result, iterations={**result.iterations, "history": [{}] * iterations})

    monkeypatch.setattr(step_halving, "load_step", load_step)
    prepared = problem()
    state_at, largest, iterations = 0.0, 0.125, 15  # many iterations: no larger part is tried
    state, step = step_halving.advance(prepared, prepared.initial_state(), 1, 0.0, 0.5)
    assert step.iterations["substeps"] == pytest.approx([0.125, 0.25, 0.375, 0.5])
    assert [span for span, *_ in tried] == pytest.approx([0.5, 0.25, 0.125, 0.125, 0.125, 0.125])
    assert state.halved == 2
    assert step_halving.State.from_dict(state.to_dict(8), state.u.reshape(-1, 2), frozenset()).halved == 2
    # In the next step parts begin as small; few iterations let them grow, up to the whole step.
    tried.clear()
    state_at, largest, iterations = 0.5, 1.0, 4
    state, step = step_halving.advance(prepared, state, 2, 0.5, 1.0)
    assert step.iterations["substeps"] == pytest.approx([0.625, 0.75, 1.0])
    assert state.halved == 0
    tried.clear()
    state_at = 1.0
    _, step = step_halving.advance(prepared, state, 3, 1.0, 1.5)
    assert "substeps" not in step.iterations


def test_a_cell_that_turns_inside_out_is_told_with_its_measure() -> None:
    prepared = problem()
    u = np.zeros((4, 2))
    u[prepared.model.mesh.points_of("TOP"), 1] = -1.5
    with pytest.raises(fc.ConvergenceError, match=r"cell 0 of quad4 near \[0.5 0.5\] is inverted \(J = -0.5\)"):
        prepared.deformed(u.ravel(), prepared.initial_state(), None)
