"""Path dependence and independence: force over approach, states without history, work."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from problems import FORMULATIONS, Blocks, analysis_of, carried, examples, recipes

import fastcontact as fc

# Over the largest displacement, force or work.
SAME, BALANCE = 1e-8, 1e-9
LEVELS = st.lists(st.integers(0, 10), min_size=1, max_size=4)
SPACE = {"kinematics": ("3d",)}


def along(recipe: Blocks, levels: list[float], **criteria):
    """Return the analysis and its steps at some parts of the whole load, one after the other."""
    table = [(0.0, 0.0), *((float(k + 1), float(level)) for k, level in enumerate(levels))]
    analysis = analysis_of(recipe.job(), fc.Ramp(tuple(t for t, _ in table[1:]), tuple(table)), **criteria)
    steps = []
    try:
        for k in range(len(levels)):
            steps.append(analysis.step(k + 1, float(k + 1)))
    except fc.ConvergenceError:
        assume(False)
    return analysis, steps


def moved(analysis, step, before=None):
    """Work of the supports' present forces on their motion since `before` [energy]."""
    change = step.displacement if before is None else step.displacement - before.displacement
    return float((step.reaction * change).sum())


@examples(25)
@given(recipe=recipes() | recipes(**SPACE), levels=st.lists(st.integers(1, 10), min_size=2, max_size=4, unique=True))
def test_the_force_grows_with_the_approach(recipe, levels):
    """Exactly: for a fixed pairing the energy is convex in the load, so that (F2 - F1)(d2 - d1) >= 0 (Rockafellar, 1970)."""
    levels = [level / 10 for level in sorted(levels)]
    _, steps = along(recipe, levels, keep_pairing=True)
    top = steps[-1].displacement
    forces = [float((step.reaction * top).sum()) for step in steps]
    assume(carried(steps[-1], recipe))
    assert (np.diff(forces) >= -BALANCE * np.abs(forces).max()).all()


@examples(25)
@given(recipe=recipes() | recipes(**SPACE), levels=LEVELS)
def test_without_friction_and_for_one_pairing_the_path_leaves_no_trace(recipe, levels):
    _, steps = along(recipe, [*(level / 10 for level in levels), 1.0], keep_pairing=True)
    _, (straight,) = along(recipe, [1.0], keep_pairing=True)
    assert np.abs(steps[-1].displacement - straight.displacement).max() < SAME * np.abs(straight.displacement).max()
    if carried(straight, recipe):
        assert np.abs(steps[-1].reaction - straight.reaction).max() < SAME * np.abs(straight.reaction).max()


@examples(30)
@given(
    recipe=recipes(friction=True, formulation=FORMULATIONS[0]) | recipes(friction=True, formulation=FORMULATIONS[3])
    | recipes(friction=True, formulation=FORMULATIONS[0], **SPACE),
    levels=LEVELS,
)  # fmt: skip
def test_work_is_strain_energy_and_friction(recipe, levels):
    """Work of the loads at the end of a step = change of the strain energy, half that of the increment, what friction
    takes, and what forces at the end of the step would have done on the way there: through gaps that were open, and
    along the part of the slip that comes from the turning of the gap.
    """
    levels = [*(level / 10 for level in levels), 1.0]
    table = ((0.0, 0.0), *((float(k + 1), float(level)) for k, level in enumerate(levels)))
    analysis = analysis_of(recipe.job(), fc.Ramp(tuple(t for t, _ in table[1:]), table), keep_pairing=True)
    K, before, u, energy, lost = analysis.K, None, np.zeros(analysis.model.n_dofs), 0.0, 0.0
    for k in range(len(levels)):
        try:
            step = analysis.step(k + 1, float(k + 1))
        except fc.ConvergenceError:
            assume(False)
        now = step.displacement.ravel()
        state, constraints, change = analysis.settled.solution, analysis.settled.constraints, now - u
        opened = constraints.gap0 + constraints.B @ u
        turned = float((state.tangential * constraints.slip0.T).sum())
        new = 0.5 * now @ (K @ now)
        scale = recipe.stiffest * np.abs(now).max() ** 2
        assert step.contact["pair 0"].dissipation >= -BALANCE * scale
        taken = -float((state.tangential * state.slip).sum())  # by the forces at the end of the step, as all here
        work = moved(analysis, step, before)
        found = new - energy + 0.5 * change @ (K @ change) + taken + turned + state.multiplier @ opened
        assert abs(work - found) <= BALANCE * scale
        before, u, energy, lost = step, now, new, lost + step.contact["pair 0"].dissipation
    assert lost >= -BALANCE * scale
