"""Stiffness, compliance and preconditioner are symmetric and positive, as theory requires."""

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from images import Image, model_of
from problems import FORMULATIONS, analysis_of, examples, recipes
from scipy.sparse import bsr_array, csr_array

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.linear import choice as linear
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.multigrid.solver import BOUND_FACTOR, MAX_RAISES

# Over the largest entry.
ROUNDING, SOLVED = 1e-14, 1e-9
SPACE = {"kinematics": ("3d",)}


def constrained(recipe):
    """A stiffness without its supports (n, n), near rigid motions (n, k) and contact rows (m, n)."""
    analysis = analysis_of(recipe.job())
    system, model = analysis.system, analysis.model
    constraints = analysis.pairs["pair 0"].constraints(Configuration.displaced(np.zeros_like(analysis.displacement)))
    B = system.rows(constraints.B, constraints.gap0, np.zeros(model.n_dofs))[0]
    rows = csr_array(B)[np.diff(csr_array(B).indptr) > 0]
    modes = rigid_modes(model.mesh.points, "plane_strain" if recipe.dim == 2 else "3d")
    return bsr_array(system.matrix), system.unknowns_of(modes), csr_array(rows)


@examples(40)
@given(recipe=recipes() | recipes(**SPACE))
def test_stiffness_is_symmetric_and_costs_no_energy_in_rigid_motions(recipe):
    model = model_of(recipe.job(), Image())[0]
    K = stiffness(model.mesh, model.kinematics, *model.material_numbers())
    dense = K.toarray()
    size = np.abs(dense).max()
    assert np.abs(dense - dense.T).max() <= ROUNDING * size
    modes = rigid_modes(model.mesh.points, model.kinematics)
    assert np.abs(K @ modes).max() <= 100 * ROUNDING * size * np.abs(modes).max()
    spectrum = np.linalg.eigvalsh(dense)
    assert spectrum[0] >= -1e3 * ROUNDING * spectrum[-1]


@examples(25)
@given(recipe=recipes() | recipes(**SPACE), solver=st.sampled_from(linear.SOLVERS))
def test_compliance_is_symmetric_and_positive(recipe, solver):
    K, modes, B = constrained(recipe)
    assume(B.shape[0])
    try:
        made = linear.make(solver, dim=recipe.dim, n_dofs=K.shape[0], tolerance=1e-12)
    except fc.ModelError:
        assume(False)  # not installed
    # Solvers take over the matrix that they are given.
    expected = B @ np.linalg.solve(K.toarray(), B.toarray().T)
    made.prepare(K, modes)
    _, C = made.load(np.zeros(K.shape[0])).delassus(B)
    size = np.abs(C).max()
    assert np.abs(C - C.T).max() <= SOLVED * size
    assert np.abs(C - expected).max() <= SOLVED * size
    spectrum = np.linalg.eigvalsh(0.5 * (C + C.T))
    assert spectrum[0] >= -SOLVED * spectrum[-1]


@examples(25)
@given(
    # Of the others, equations have a compliance and are not eliminated.
    recipe=st.sampled_from([FORMULATIONS[0], FORMULATIONS[3]]).flatmap(lambda one: recipes(formulation=one, **SPACE)),
    tied=st.booleans(), seed=st.integers(0, 99),
)  # fmt: skip
def test_the_multigrid_cycle_is_symmetric_and_positive(recipe, tied, seed):
    """As conjugate gradients need it: also where the equations of a contact are eliminated, if need be after the
    bounds of the smoothers have been raised, as the solver does where it notices.
    """
    K, modes, B = constrained(recipe)
    assume(B.shape[0])
    amg = linear.make("amg", dim=recipe.dim, n_dofs=K.shape[0], tolerance=1e-12, precision="double")
    amg.prepare(K, modes)
    n = K.shape[0]
    elimination = None
    if tied:
        chosen = np.random.default_rng(seed).random(B.shape[0]) < 0.6
        assume(chosen.any() and np.linalg.matrix_rank(B[chosen].toarray()) == chosen.sum())
        elimination = eliminate(csr_array(B[chosen]), np.zeros(chosen.sum()))
        amg.constrain(elimination)
    basis = np.eye(n)
    if elimination is not None:
        for column in basis.T:
            elimination.move_forces(column)
    for raised in range(MAX_RAISES + 1):
        product = basis.T @ applied(amg, basis)
        size = np.abs(product).max()
        assert np.abs(product - product.T).max() <= 1e-10 * size
        spectrum = np.linalg.eigvalsh(0.5 * (product + product.T))
        if spectrum[0] >= -1e-10 * spectrum[-1]:
            return
        assert elimination is not None  # without, the bounds of its smoothers are sure
        assert raised < MAX_RAISES
        amg.hierarchy.bounds = [BOUND_FACTOR * bound for bound in amg.hierarchy.bounds]


def applied(amg, basis):
    """Return the preconditioner times a basis (n, n)."""
    found = np.empty_like(basis)
    for j, column in enumerate(basis.T):
        z = np.empty(len(column))
        amg.precondition(np.ascontiguousarray(column), 1.0, z)
        found[:, j] = z
    return found
