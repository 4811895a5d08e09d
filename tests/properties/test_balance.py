"""Forces balance, and what touches neither overlaps nor pulls: gap >= 0, pressure >= 0, product 0, friction in its cone."""

import mechanics
import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from problems import E, analysis_of, carried, examples, recipes

import fastcontact as fc

# Over the largest force, gap or product of both; found: 3e-13 for forces, 1e-11 for gaps and multipliers.
BALANCE, COMPLEMENTARITY = 1e-10, 1e-9
SPACE = st.sampled_from([("plane_strain", "plane_stress", "axisymmetric"), ("3d",)])


def solved(recipe):
    """The analysis after its one step, and the step; problems that do not converge are none of this file's."""
    analysis = analysis_of(recipe.job())
    try:
        step = analysis.step(1, 1.0)
    except fc.ConvergenceError:
        assume(False)
    assume(carried(step, recipe))
    return analysis, step


def check_balance(recipe, analysis, step):
    balance, sizes = mechanics.out_of_balance(analysis.model, step, 1.0)
    assert balance < BALANCE
    given_back, _ = mechanics.given_back(analysis.model, step, sizes, "pair 0")
    assert given_back < BALANCE
    contact = analysis.settled.force.reshape(-1, recipe.dim)
    size = np.abs(analysis.K @ step.displacement.ravel()).max()
    assert np.abs(contact - mechanics.contact_forces(analysis.model, step)).max() < BALANCE * size
    # Reactions act where supports are, contact forces on the two sides of the contact.
    mesh, names = analysis.model.mesh, recipe.names
    supported = np.concatenate([mesh.points_of(group) for group, _ in recipe.supports()])
    assert not np.delete(step.reaction, supported, axis=0).any()
    sides = [mesh.points_of(names[side]) for side in ("secondary", "primary")]
    assert not np.delete(contact, np.concatenate(sides), axis=0).any()
    # What one body feels the other one gives back; about an axis, forces along the radius do so along the circle.
    axes = [1] if recipe.kinematics == "axisymmetric" else list(range(recipe.dim))
    found = step.contact["pair 0"]
    given_back = contact[sides[0]].sum(axis=0)[axes]
    assert np.abs(given_back - found.force[axes]).max() < BALANCE * size
    assert np.abs(found.force_vectors.sum(axis=0) - found.force)[axes].max() < BALANCE * size
    for body in ("upper", "lower"):
        own = mesh.points_of(names[body])
        assert np.abs((contact + step.reaction)[own][:, axes].sum(axis=0)).max() < BALANCE * size


def check_complementarity(recipe, analysis, step):
    state, constraints = analysis.settled.solution, analysis.settled.constraints
    length = np.abs(step.displacement).max()
    sizes = mechanics.Sizes(length, np.abs(state.multiplier).max())
    assert max(mechanics.complementarity(analysis.settled, sizes)) <= COMPLEMENTARITY
    usable = np.diff(constraints.B.indptr) > 0
    assert not state.multiplier[~usable].any()
    # The gap that the solver speaks of is that of the displacements; the compliance of friction turns with its tangents.
    if not constraints.tangents or constraints.compliance is None:
        gap = constraints.gap0 + constraints.B @ step.displacement.ravel()
        if constraints.normal_compliance is not None:
            gap += constraints.normal_compliance.apply(state.multiplier)
        assert np.abs(gap - state.gap)[usable].max() <= COMPLEMENTARITY * length
    found = step.contact["pair 0"]
    assert found.pressure.min() >= -COMPLEMENTARITY * found.pressure_max
    assert found.pressure_max < 100 * E * 10.0 ** max(recipe.contrast, 0.0)


def check_friction(recipe, analysis, step):
    """Friction stays in its cone and acts against the slip."""
    state = analysis.settled.solution
    length, force = np.abs(step.displacement).max(), np.abs(state.multiplier).max()
    bound = recipe.friction * state.multiplier
    rubbing = np.linalg.norm(state.tangential, axis=1)
    assert max(mechanics.friction(analysis.settled, mechanics.Sizes(length, force))) <= COMPLEMENTARITY
    slip = np.linalg.norm(state.slip, axis=1)
    inside = rubbing < bound - 1e-6 * force
    assert slip[inside].max(initial=0.0) <= 1e-7 * length
    # Where it slides, force and slip are opposite: their product is that of their sizes.
    work = -np.einsum("mk,mk->m", state.tangential, state.slip)
    slides = state.multiplier > 1e-6 * force
    assert np.abs(work - bound * slip)[slides].max(initial=0.0) <= COMPLEMENTARITY * force * length
    assert step.contact["pair 0"].dissipation >= -COMPLEMENTARITY * force * length


@examples(80)
@given(
    recipe=recipes() | recipes(friction=True) | recipes(kinematics=("3d",)) | recipes(kinematics=("3d",), friction=True)
)
def test_forces_balance_and_what_touches_neither_overlaps_nor_pulls(recipe):
    analysis, step = solved(recipe)
    check_balance(recipe, analysis, step)
    check_complementarity(recipe, analysis, step)
    if recipe.friction:
        check_friction(recipe, analysis, step)
