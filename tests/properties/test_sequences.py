"""Any sequence of active sets ends in a solution or in the corresponding error, within its limits."""

from contextlib import nullcontext
from unittest.mock import patch

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from images import Image, model_of
from problems import analysis_of, examples, recipes
from scipy.sparse import bsr_array, csr_array

import fastcontact as fc
from fastcontact.analysis import active_set, geometry_loop
from fastcontact.analysis.solution import Accuracy
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.linear import choice as linear

SPACE = {"kinematics": ("3d",)}


def ended(work):
    """Return what `work` returns and nothing, or nothing and what its error says; its history is there and finite."""
    try:
        return work(), ""
    except fc.ConvergenceError as error:
        said, history = str(error), error.history
    assert all(np.isfinite(entry["displacement_change"]) for entry in history)
    return None, said


@examples(100)
@given(
    n=st.integers(1, 12), m=st.integers(1, 16), seed=st.integers(0, 2**32 - 1), spread=st.floats(0, 4),
    solver=st.sampled_from(["direct", "amg"]), repeated=st.booleans(), limit=st.integers(1, 200),
)  # fmt: skip
def test_any_problem_from_any_set_ends(n, m, seed, spread, solver, repeated, limit):
    """Stiffnesses over several decades, rows that repeat others, sets at random: settled, or the limit is reached.

    Murty's rule visits no set twice, so that 2^m sets are the bound where rows are independent.
    """
    random = np.random.default_rng(seed)
    A = random.normal(size=(2 * n, 2 * n)) * 10.0 ** random.uniform(-spread / 2, spread / 2, (2 * n, 1))
    K = A.T @ A + 10.0**-spread * np.eye(2 * n)
    m = min(m, 2 * n)
    B, gap0, f = random.normal(size=(m, 2 * n)), random.normal(size=m), random.normal(size=2 * n)
    if repeated and m > 1:
        B[-1], gap0[-1] = B[0], gap0[0]
    start = random.random(m) < 0.5
    if repeated:
        start[-1] = False
    made = linear.make(solver, dim=2, n_dofs=2 * n, tolerance=1e-12)
    made.prepare(bsr_array(K, blocksize=(2, 2)), np.ones((2 * n, 1)))
    state, said = ended(
        lambda: active_set.solve(
            made.load(f), Constraints(csr_array(B), gap0, np.zeros((m, 2))), start, Accuracy(gap=1e-10, max_iterations=limit)
        )
    )  # fmt: skip
    if state is None:
        assert solver == "amg"
        assert "conjugate gradients" in said or (repeated and "are linearly dependent" in said)
        return
    assert state.iterations <= limit
    assert state.settled or state.iterations == limit
    if limit == 200 and not repeated:
        assert state.settled
    if state.settled:
        # Linearly dependent equations are solved on their Delassus operator, column by column to the solver's tolerance.
        unit = made.tolerance if repeated and solver == "amg" else 1e-14
        rounding = max(1e-9, unit * np.linalg.cond(K))
        assert (state.multiplier >= -1e-9 * np.abs(state.multiplier).max(initial=0.0)).all()
        assert (state.gap >= -rounding * max(1.0, np.abs(state.u).max())).all()


@examples(60)
@given(
    recipe=recipes() | recipes(friction=True) | recipes(**SPACE) | recipes(friction=True, **SPACE),
    seed=st.integers(0, 2**32 - 1), share=st.floats(0, 1), solver=st.sampled_from(["direct", "amg"]),
)  # fmt: skip
def test_a_contact_from_any_set_ends_in_the_same_state(recipe, seed, share, solver):
    random = np.random.default_rng(seed)
    found = []
    for begin in (None, share):
        analysis = analysis_of(recipe.job(), solver=solver, keep_pairing=True)
        if begin is not None:
            (pair,) = analysis.pairs.values()
            rows = len(pair.constraints(Configuration.displaced(np.zeros_like(analysis.displacement))).gap0)
            started = patch.object(geometry_loop, "initially_active", lambda *_, rows=rows: random.random(rows) < share)
        else:
            started = nullcontext()
        with started:
            step, said = ended(lambda analysis=analysis: analysis.step(1, 1.0))
        if step is None:
            assert "did not converge" in said or "conjugate gradients" in said
            return
        found.append(step)
        assert analysis.settled.solution.settled
        assert all(entry["active_set_iterations"] <= 200 for entry in found[-1].iterations["history"])
    one, other = found
    if not recipe.friction:  # with it, there may be several solutions
        size = np.abs(one.displacement).max()
        assert np.abs(one.displacement - other.displacement).max() < (1e-8 if solver == "direct" else 1e-6) * size


@examples(15)
@given(
    recipe=recipes(crown=0.03) | recipes(crown=0.03, friction=True), updates=st.integers(1, 6), sets=st.integers(1, 3)
)
def test_limits_are_kept(recipe, updates, sets):
    """With hardly any iterations allowed, every problem ends in a solution or in the error that names the limit."""
    model = model_of(recipe.job(), Image())[0]
    criteria = fc.Criteria(max_geometry_updates=updates, max_active_set_iterations=sets, max_halvings=1)
    steps, said = ended(lambda: fc.solve(model, fc.linear_ramp(1), criteria=criteria, linear_solver="direct"))
    if steps is None:
        assert "did not converge" in said
        return
    (step,) = steps
    assert step.iterations["geometry_updates"] <= len(step.iterations.get("substeps", (1,))) * updates
