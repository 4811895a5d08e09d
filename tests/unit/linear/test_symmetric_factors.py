"""Factors with the contact unknowns last, and low-rank symmetric changes of a matrix."""

import numpy as np
import pytest
from models import elastic_model
from scipy.sparse import bsr_array, csc_array, csr_array, diags_array, eye_array, kron
from scipy.sparse.linalg import splu
from stepping import Stepping

import fastcontact as fc
from fastcontact.elasticity.constrained_system import separate_supports
from fastcontact.elasticity.stiffness import stiffness
from fastcontact.linear import choice as linear
from fastcontact.linear.cholesky import symmetric_factors, triangular_kernels
from fastcontact.linear.cholesky.factorisation import fill_reducing_order
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.factor_solver import KnownLoads
from fastcontact.linear.multigrid.local_change import SymmetricChange
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.sparse_rows import scaled
from fastcontact.linear.springs import Springs

FACTORED = ["direct", "cholmod"]


def supported(n=3):
    """The stiffness of a cube that stands on its bottom, and the unknowns of its top."""
    mesh = fc.generate.box((1.0, 1.0, 1.0), (n, n, n))
    model = elastic_model(mesh, "3d", E=7.0)
    fixed = np.repeat(mesh.points[:, 2] == 0.0, 3)
    top = np.flatnonzero(np.repeat(mesh.points[:, 2] == 1.0, 3))
    return separate_supports(stiffness(mesh, "3d", *model.material_numbers()), fixed)[0], top


def prepared(name="direct", last=True):
    if name not in linear.SOLVERS:
        pytest.skip(f"{name} is not installed")
    K, top = supported()
    solver = linear.make(name, dim=3, n_dofs=K.shape[0])
    solver.prepare(K, np.empty((K.shape[0], 0)), top if last else None)
    return K, top, solver


def lower(n, density, seed):
    """A lower triangular matrix with a unit diagonal, some of whose columns share their structure."""
    rng = np.random.default_rng(seed)
    A = np.where(rng.random((n, n)) < density, rng.random((n, n)), 0.0)
    L = splu(csc_array(A + A.T + 10 * n * np.eye(n)), diag_pivot_thresh=0.0, options={"SymmetricMode": True}).L
    return csc_array(L)


def by_supernodes(L):
    """Return L as the kernels take it: rows below that neighbouring columns share, once."""
    below = [L.indices[L.indptr[j] + 1 : L.indptr[j + 1]].tolist() for j in range(L.shape[0])]
    first = [j for j in range(len(below)) if j == 0 or below[j - 1] != [j, *below[j]]]
    ends = [*first[1:], len(below)]
    rows = [below[end - 1] for end in ends]
    begin = np.concatenate([[0], np.cumsum([len(part) for part in rows])])
    return L.indptr, L.data, np.array([*first, len(below)]), begin, np.concatenate(rows).astype(np.intc)


@pytest.mark.parametrize("panel", [1, 3, 48])
@pytest.mark.parametrize(("n", "density"), [(1, 0.0), (7, 0.0), (40, 0.05), (60, 0.3), (30, 1.0)])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_solutions_together_are_those_of_numpy(n, density, seed, panel, monkeypatch):
    L, rng = lower(n, density, seed), np.random.default_rng(seed)
    d, loaded, wanted = rng.uniform(1.0, 2.0, n), rng.random(n) < 0.1, rng.random(n) < 0.2
    F = np.where(loaded[:, None], rng.normal(size=(n, 5)), 0.0)
    exact = np.linalg.solve((L.toarray() * d) @ L.toarray().T, F)
    monkeypatch.setattr(triangular_kernels, "PANEL", panel)
    solve = getattr(triangular_kernels.solve_together, "py_func", triangular_kernels.solve_together)
    for function in (solve, triangular_kernels.solve_together) if panel == 48 else (solve,):
        X = F.copy()
        function(*by_supernodes(L), d, loaded.copy(), wanted.copy(), X)
        np.testing.assert_allclose(X[wanted], exact[wanted], atol=1e-13)


def test_solutions_together_pass_over_supernodes_that_are_not_reached():
    # An arrow: columns depend on the last one alone, which is in one supernode with the one before.
    n = 6
    L = csc_array(np.eye(n) + np.outer(np.arange(n) == n - 1, np.arange(n) < n - 1) * 0.5)
    X, loaded, wanted = np.full((n, 2), np.nan), np.arange(n) == 1, np.arange(n) == 3
    X[1], X[3:] = 1.0, 0.0
    triangular_kernels.solve_together(*by_supernodes(L), np.ones(n), loaded, wanted, X)
    np.testing.assert_allclose(X[[3, n - 1]], [[0.25] * 2, [-0.5] * 2], atol=1e-15)
    assert np.isnan(X[[0, 2]]).all()


def test_the_order_keeps_factors_as_small_as_superlu_does():
    K, _ = supported(10)
    order = fill_reducing_order(K, np.empty(0, np.intp))
    options = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}
    ours = splu(csc_array(K.tocsc()[order][:, order]), permc_spec="NATURAL", **options)
    assert ours.nnz < 1.1 * splu(K.tocsc(), permc_spec="MMD_AT_PLUS_A", **options).nnz


def test_tangents_share_an_order_with_fewer_entries():
    """An order that knows which unknowns come last leaves fewer entries; it is not sought for one matrix alone."""
    n, none = 60, np.empty((3600, 0))
    line = diags_array([2.1, -1.0, -1.0], offsets=[0, 1, -1], shape=(n, n))
    K, last = bsr_array(kron(line, eye_array(n)) + kron(eye_array(n), line), blocksize=(1, 1)), np.arange(n)
    solver = linear.make("direct", dim=2, n_dofs=n * n)
    solver.prepare(K, none, last)
    tangents = [solver.copy_for_similar_matrix() for _ in range(2)]
    for factor, tangent in enumerate(tangents, 2):
        tangent.prepare(factor * K, none, last)
        f = np.random.default_rng(3).normal(size=n * n)
        np.testing.assert_allclose(factor * tangent.factors.solve(f), solver.factors.solve(f), rtol=1e-10)
    fewer = [tangent.factors.nnz for tangent in tangents]
    assert fewer[0] == fewer[1] < 0.95 * solver.factors.nnz
    assert tangents[0]._symbolic[True] is tangents[1]._symbolic[True]


@pytest.mark.parametrize("name", FACTORED)
@pytest.mark.parametrize("last", [True, False])
def test_solutions_are_those_of_dense_algebra(name, last):
    K, _, solver = prepared(name, last)
    f = np.random.default_rng(3).normal(size=K.shape[0])
    exact = np.linalg.solve(K.toarray(), f)
    np.testing.assert_allclose(solver.factors.solve(f), exact, atol=1e-12 * np.abs(exact).max())
    assert solver.counters.setups == 1


@pytest.mark.parametrize("name", FACTORED)
@pytest.mark.parametrize("last", [True, False])
def test_entries_of_the_inverse_are_those_of_dense_algebra(name, last, monkeypatch):
    K, top, solver = prepared(name, last)
    exact = np.linalg.inv(K.toarray())
    rng = np.random.default_rng(3)
    for batch in (128, 5):
        monkeypatch.setattr(symmetric_factors, "BATCH", batch)
        for rows, columns in ((top, top[::-1]), (rng.permutation(len(exact))[:50], np.array([7])), (top, np.arange(0))):
            found = solver.factors.inverse_entries(rows, columns)
            np.testing.assert_allclose(found, exact[np.ix_(rows, columns)], atol=1e-13 * np.abs(exact).max())


@pytest.mark.parametrize("name", FACTORED)
def test_contact_takes_its_compliance_and_all_displacements_from_the_factors(name):
    K, top, solver = prepared(name)
    exact = np.linalg.inv(K.toarray())
    np.testing.assert_allclose(
        solver.columns.delassus(csr_array(np.eye(K.shape[0])[top])),
        exact[np.ix_(top, top)],
        atol=1e-13 * np.abs(exact).max(),
    )
    force = np.zeros(K.shape[0])
    force[top[5:9]] = [1.0, -2.0, 0.5, 3.0]
    f = np.random.default_rng(4).normal(size=K.shape[0])
    loaded, u = solver.load(f), exact @ (f + force)
    before, near = solver.counters.iterations, loaded.condensed().full_solution(force[top])
    assert solver.counters.iterations == before
    np.testing.assert_allclose(near, u[top], atol=1e-12 * np.abs(u).max())
    np.testing.assert_allclose(loaded.full_solution(force), u, atol=1e-12 * np.abs(u).max())
    assert solver.counters.iterations == before + 1


@pytest.mark.parametrize("name", FACTORED)
def test_without_contact_there_is_nothing_to_condense_to(name):
    K, _, solver = prepared(name)
    solver.prepare(K, np.empty((K.shape[0], 0)), np.empty(0, np.intp))
    f = np.random.default_rng(3).normal(size=K.shape[0])
    assert not solver.condenses
    loaded = solver.load(f)
    assert loaded.condensed() is loaded
    np.testing.assert_allclose(K @ solver.load(f).full_solution(np.zeros(len(f))), f, atol=1e-12)


def test_forces_elsewhere_cost_a_solution():
    K, _, solver = prepared()
    force = np.random.default_rng(4).normal(size=K.shape[0])
    np.testing.assert_allclose(K @ solver.load(np.zeros(K.shape[0])).full_solution(force), force, atol=1e-12)


@pytest.mark.parametrize("last", [True, False])
def test_no_further_forces_cost_no_solution(last):
    K, _, solver = prepared(last=last)
    f, none = np.random.default_rng(4).normal(size=K.shape[0]), np.zeros(K.shape[0])
    loaded, before = solver.load(f), solver.counters.iterations
    for _ in range(2):
        u = loaded.full_solution(none)
        np.testing.assert_allclose(K @ u, f, atol=1e-12)
        u[:] = np.nan  # a copy
    assert solver.counters.iterations == before


def test_loads_that_others_combine_to_cost_nothing():
    A = np.diag(np.arange(1.0, 9.0))
    solved = []

    def solve(f):
        solved.append(f)
        return np.linalg.solve(A, f)

    known, (f, g) = KnownLoads(8), np.random.default_rng(5).normal(size=(2, 8))
    for load in (f, 0.3 * f, g, 2.0 * f - 0.1 * g, 0.0 * f):
        np.testing.assert_allclose(A @ known.solution(load, solve), load, atol=1e-14)
    assert len(solved) == 2
    other = KnownLoads(8)
    other.put_back(known.snapshot(), solve)
    solved.clear()
    np.testing.assert_array_equal(other.solution(f + g, solve), known.solution(f + g, solve))
    assert not solved


def test_only_a_few_loads_are_kept():
    known, rng = KnownLoads(20), np.random.default_rng(6)
    for _ in range(7):
        known.solution(rng.normal(size=20), lambda f: f)
    assert len(known.snapshot()) == 4


def test_a_ramp_costs_one_factorisation_and_a_solution_a_step(forma04):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(2.0, 4.0), radial_sizes=(2.0, 6.0), segments=5)
    analysis = Stepping(forma04(mesh), "direct", 1e-10, fc.Criteria(), fc.linear_ramp(5))
    assert min(analysis.step(k, k / 5).iterations["geometry_updates"] for k in range(1, 6)) >= 2
    assert analysis.solver.counters.setups == 1
    # One for the loads of all steps, and one for what each step's contact forces do inside the bodies.
    assert analysis.solver.counters.iterations == 1 + 5


N_NODES, N_COARSE = 150, 20


def sparse(shape, density, rng):
    return csr_array(rng.normal(size=shape) * (rng.random(shape) < density))


def symmetric_blocks(size, rng):
    """Return a symmetric matrix of blocks, and the same as an array."""
    near = rng.random((N_NODES, N_NODES)) < 0.05
    near |= near.T | np.eye(N_NODES, dtype=bool)
    dense = rng.normal(size=2 * (N_NODES * size,))
    dense = (dense + dense.T) * np.kron(near, np.ones((size, size)))
    dense *= np.outer(*2 * (rng.random(len(dense)) < 0.9,))  # supported unknowns
    A = bsr_array(csr_array(dense), blocksize=(size, size))
    A.sort_indices()
    blocks = (0,) * size
    return BlockMatrix(A.indptr.astype(np.int32), A.indices.astype(np.int32), A.data.ravel(), blocks, blocks), dense


def prolongator(size, width, rng):
    near = rng.random((N_NODES, N_COARSE)) < 0.2
    near[:, -1] |= ~near.any(axis=1)
    pattern = csr_array(near.astype(float))
    data = rng.normal(size=(pattern.nnz, size, width)).astype(np.float32)
    P = bsr_array((data, pattern.indices, pattern.indptr), shape=(N_NODES * size, N_COARSE * width))
    dense = P.toarray().astype(float)
    return BlockMatrix(P.indptr, P.indices, P.data.ravel(), (0,) * size, (0,) * width), dense


def equations(size, rng, m=130):
    """Return an elimination of m unknowns, and the matrix T (n, n) with ``u = T u``."""
    n = N_NODES * size
    pivots = rng.permutation(n)[:m]
    dense = rng.normal(size=(m, n)) * (rng.random((m, n)) < 0.02)
    dense[:, pivots] = 0.0
    T = np.eye(n)
    T[pivots] = dense
    W = csr_array(dense)
    return Elimination(pivots, W, np.zeros(m), W), T


def changes(size, rng):
    """Return the change by equations, that by springs, and both as arrays."""
    A, dense = symmetric_blocks(size, rng)
    elimination, T = equations(size, rng)
    R, stiffness = sparse((70, N_NODES * size), 0.03, rng), rng.random(70)
    ours = (
        SymmetricChange.of_equations(A, elimination.pivots, elimination.weights),
        SymmetricChange.of_springs(Springs(R, stiffness), size),
    )
    return ours, (T.T @ dense @ T - dense, R.T @ (stiffness[:, None] * R.toarray()))


@pytest.mark.parametrize("number", [0, 1])
@pytest.mark.parametrize(("size", "width"), [(3, 6), (2, 3)])
def test_changes_on_the_finest_and_the_next_coarser_level(size, width, number):
    rng = np.random.default_rng(3 * size + number)
    ours, expected = changes(size, rng)
    change, expected = ours[number], expected[number]
    largest = np.abs(expected).max()
    assert np.abs(change.matrix().toarray() - expected).max() < 1e-12 * largest
    P, dense = prolongator(size, width, rng)
    coarse = change.galerkin_product(P).padded(np.arange(N_COARSE)).toarray()
    assert np.abs(coarse - dense.T @ expected @ dense).max() < 1e-12 * np.abs(coarse).max()
    diagonal = change.diagonal()
    blocks = expected.reshape(N_NODES, size, N_NODES, size)[diagonal.nodes, :, diagonal.nodes]
    assert np.abs(diagonal.diagonal().reshape(blocks.shape) - blocks).max() < 1e-12 * largest
    beyond = np.setdiff1d(np.arange(N_NODES), diagonal.nodes)
    assert not expected.reshape(N_NODES, size, N_NODES, size)[beyond, :, beyond].any()


def test_scaled_rows_leave_the_matrix_as_it_is():
    rng = np.random.default_rng(5)
    R, factor = sparse((9, 12), 0.4, rng), rng.normal(size=9)
    kept = R.toarray()
    factor[2:5] = 0.0
    some = scaled(R, factor)
    assert some.toarray() == pytest.approx(factor[:, None] * kept)
    assert not np.diff(some.indptr)[2:5].any()
    assert np.array_equal(R.toarray(), kept)
