"""Multigrid compared with NumPy and SciPy: kernels, set-up, constraints; bits, bytes and allocations."""

import logging
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from pairwise import first_of
from pressed_blocks import box
from scipy.sparse import bsr_array, csr_array, diags_array, eye_array

import fastcontact as fc
from fastcontact._jit import parallel
from fastcontact._jit.decorators import set_threads, threads
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.krylov import krylov_kernels
from fastcontact.linear.krylov.iterations import ConjugateGradients
from fastcontact.linear.multigrid import cycle_kernels
from fastcontact.linear.multigrid import matrix as matrices
from fastcontact.linear.multigrid.constrained_hierarchy import ConstrainedHierarchy
from fastcontact.linear.multigrid.hierarchy import Hierarchy, column_pattern, galerkin_product, graph
from fastcontact.linear.multigrid.level import CoarseLevel, chebyshev
from fastcontact.linear.multigrid.matrix import BlockMatrix
from fastcontact.linear.solvers.amg import Amg
from fastcontact.linear.solvers.pyamg import Pyamg
from fastcontact.linear.springs import Springs


def problem(divisions=(7, 6, 5)):
    """Return stiffness, rigid modes and a load of a box held at one side."""
    K, modes, fixed = box(divisions, E=1000.0)
    return K, modes, np.where(fixed, 0.0, np.random.default_rng(0).normal(size=len(fixed))), fixed


def matrix_of(K):
    size = K.blocksize
    return BlockMatrix(K.indptr, K.indices, K.data.reshape(-1), (0,) * size[0], (0,) * size[1])


def scipy_of(A):
    m, n = len(A.rows), len(A.cols)
    width = n * (int(A.indices.max(initial=-1)) + 1)
    return bsr_array((A.data.reshape(-1, m, n), A.indices, A.indptr), shape=(m * (len(A.indptr) - 1), width))


def random_blocks(m, n, rows=40, columns=30, dtype=float, seed=0):
    rng = np.random.default_rng(seed)
    pattern = csr_array((rng.random((rows, columns)) < 0.2).astype(float))
    data = rng.normal(size=(len(pattern.indices), m, n)).astype(dtype)
    indices, indptr = pattern.indices.astype(np.int32), pattern.indptr.astype(np.int32)
    return bsr_array((data, indices, indptr), shape=(rows * m, columns * n)), rng


@pytest.mark.parametrize(
    ("dtype", "m", "n"),  # by default those that whole runs compile
    first_of(4, [(np.float32, 3, 6), (np.float64, 3, 3), (np.float32, 6, 6), (np.float32, 2, 3)])
    + [pytest.param(dtype, m, n, marks=pytest.mark.slow) for dtype in (np.float32, np.float64)
       for m, n in ((2, 2), (6, 3), (1, 1), (2, 1))],
)  # fmt: skip
def test_products_are_those_of_scipy(dtype, m, n):
    A, rng = random_blocks(m, n, dtype=dtype)
    x, z = rng.normal(size=A.shape[1]).astype(dtype), rng.normal(size=A.shape[0]).astype(dtype)
    y = np.full(A.shape[0], np.nan, dtype)
    own = matrix_of(A)
    own.multiply(x, y)
    close = 50 * np.finfo(dtype).eps * np.abs(A @ x).max()
    assert np.abs(y - A @ x).max() < close
    own.combine(-1.0, x, 1.0, z, z)
    assert np.abs(z + y).max() != 0.0
    again = z + y
    own.combine(1.0, x, 1.0, z, z)
    assert np.abs(z - again).max() < close


@pytest.mark.parametrize("size", [1, 2, 3, 6])
def test_a_chebyshev_step_is_block_jacobi_with_memory(size):
    rng = np.random.default_rng(1)
    n = 1500
    blocks = rng.normal(size=(n, size, size))
    blocks = blocks @ blocks.transpose(0, 2, 1) + np.eye(size)
    inverse = np.empty(blocks.size)
    cycle_kernels.invert_blocks(blocks.ravel(), size, inverse)
    expected = np.linalg.inv(blocks)
    assert np.abs(inverse.reshape(expected.shape) - expected).max() < 1e-10 * np.abs(expected).max()
    r, d, x = (rng.normal(size=n * size) for _ in range(3))
    step = np.einsum("nij,nj->ni", expected, r.reshape(n, size)).ravel()
    d1, x1 = d.copy(), x.copy()
    cycle_kernels.relax(0, n, inverse, r, 0.3, 0.7, d1, x1, (0,) * size, False)
    assert d1 == pytest.approx(0.3 * d + 0.7 * step, abs=1e-9)
    assert x1 == pytest.approx(x + d1, abs=1e-9)
    d2, x2 = np.full_like(d, np.nan), np.full_like(x, np.nan)
    cycle_kernels.relax(0, n, inverse, r, 0.0, 0.7, d2, x2, (0,) * size, True)
    assert x2 == pytest.approx(0.7 * step, abs=1e-9)
    assert np.array_equal(d2, x2)


def test_blocks_are_inverted_past_unknowns_without_stiffness():
    block = np.diag([2.0, 0.0, 4.0])
    out = np.empty(9)
    cycle_kernels.invert_blocks(block.ravel(), 3, out)
    assert out.reshape(3, 3) == pytest.approx(np.diag([0.5, 0.0, 0.25]))


@pytest.mark.parametrize("n", [7, 1600])
def test_the_coarsest_level_is_solved_and_idle_unknowns_stay_at_zero(n):
    rng = np.random.default_rng(2)
    off = rng.random(n - 1)
    A = diags_array([3.0 + rng.random(n), off, off], offsets=[0, 1, -1]).tolil()
    A[4, :] = 0.0
    A[:, 4] = 0.0
    A = A.tocsc()
    b, x = rng.normal(size=n), np.empty(n)
    b[4] = 0.0
    coarse = CoarseLevel(A)
    coarse.solve(b, x)
    assert np.abs(A @ x - b).max() < 1e-12
    assert x[4] == 0.0
    change = diags_array(np.r_[1.0, np.zeros(n - 1)]).tocsc()
    coarse.factorise(change)
    coarse.solve(b, x)
    assert np.abs((A + change) @ x - b).max() < 1e-12
    coarse.factorise(None)
    coarse.solve(b, x)
    assert np.abs(A @ x - b).max() < 1e-12


def test_vectors_are_scaled_in_the_precision_of_the_result():
    a, single = np.random.default_rng(3).normal(size=4100), np.empty(4100, np.float32)
    krylov_kernels.scaled(0, len(a), 2.0, a, single)
    assert np.array_equal(single, (2.0 * a).astype(np.float32))


def test_galerkin_products_and_prolongators_are_those_of_scipy():
    K, modes, _, _ = problem((9, 8, 8))
    hierarchy = Hierarchy(matrix_of(K), modes)
    assert len(hierarchy.levels) >= 2
    top, below = hierarchy.levels[:2]
    P = scipy_of(top.P)
    expected = (P.T @ K @ P).toarray()
    assert np.abs(scipy_of(below.A).toarray() - expected).max() < 1e-12 * np.abs(expected).max()
    x, y = np.random.default_rng(0).normal(size=P.shape[0]), np.full(P.shape[1], np.nan)
    top.R.multiply(x, y)
    assert np.abs(y - P.T @ x).max() < 1e-13 * np.abs(P.T @ x).max()


def test_the_graph_is_that_of_blocks_with_a_number():
    A, rng = random_blocks(2, 2, 700, 700)
    A.data[rng.random(len(A.data)) < 0.3] = 0.0
    A.data[::5, 0, :] = 0.0
    own = matrix_of(A)
    there = np.zeros((700, 700), bool)
    rows = np.repeat(np.arange(700), np.diff(A.indptr))
    there[rows, A.indices] = (A.data != 0.0).any(axis=(1, 2)) & (A.indices != rows)
    near = graph(own)
    assert near.has_sorted_indices
    np.testing.assert_array_equal(near.toarray() > 0, there | there.T)


def test_rigid_motions_of_a_free_body_are_interpolated_without_error():
    mesh = fc.generate.box((1.0, 1.1, 0.9), (8, 7, 7))
    moduli = np.asarray([fc.LinearElastic(E=1000.0, nu=0.3).moduli("3d")])
    K = stiffness(mesh, "3d", moduli, {"hex8": np.zeros(len(mesh.cells["hex8"]), np.int64)})
    modes = rigid_modes(mesh.points, "3d")
    P = scipy_of(Hierarchy(matrix_of(K), modes).levels[0].P)
    coarse = np.linalg.lstsq(P.toarray(), modes, rcond=None)[0]
    assert np.abs(P @ coarse - modes).max() < 1e-10


def test_a_galerkin_product_of_other_blocks():
    A, _ = random_blocks(2, 2, 40, 40)
    A = bsr_array((A + A.T).tobsr((2, 2)))
    A.sort_indices()
    P, _ = random_blocks(2, 3, 40, 12, seed=5)
    own = matrix_of(P)
    result = galerkin_product(matrix_of(A), own, column_pattern(own, 12))
    expected = (P.T @ A @ P).toarray()
    assert np.abs(scipy_of(result).toarray() - expected).max() < 1e-12 * np.abs(expected).max()


def test_the_spectrum_is_bounded_and_chebyshev_stays_small_on_its_upper_part():
    K, modes, _, _ = problem()
    level = Hierarchy(matrix_of(K), modes).levels[0]
    inverse = bsr_array(
        (level.inverse_diagonal.reshape(-1, 3, 3), np.arange(level.n // 3), np.arange(level.n // 3 + 1))
    )
    factor = np.linalg.cholesky(inverse.toarray())
    exact = np.linalg.eigvalsh(factor.T @ (K @ factor)).max()
    assert level.largest_eigenvalue() <= exact * (1 + 1e-10)
    assert exact <= level.bound
    for degree in (1, 2, 3):
        values = np.linspace(level.bound / 24, level.bound, 50)
        error, step = np.ones_like(values), np.zeros_like(values)
        for first, second in chebyshev(level.bound, degree):
            step = first * step + second * values * error
            error = error - step
        assert np.abs(error).max() < 1.0
        assert np.abs(error).max() == pytest.approx(np.abs(error[-1]), rel=1e-6)


def eliminated(B, n):
    """Return T of an elimination as a matrix."""
    elimination = eliminate(B, np.zeros(B.shape[0]))
    keep = np.ones(n)
    keep[elimination.pivots] = 0.0
    spread = csr_array(
        (np.ones(B.shape[0]), (elimination.pivots, np.arange(B.shape[0]))), shape=(n, B.shape[0])
    )  # fmt: skip
    return elimination, diags_array(keep).tocsr() + spread @ elimination.weights


def contact_rows(fixed, count=6):
    """Return rows on single unknowns and four others, like those of nodes facing quadrangles."""
    rng = np.random.default_rng(4)
    free = rng.permutation(np.flatnonzero(~fixed))
    B = np.zeros((count, len(fixed)))
    for row in range(count):
        own, others = free[row], free[count + 3 * row : count + 3 * row + 4]
        B[row, own], B[row, others] = 1.0, -rng.random(4) / 2
    return csr_array(B)


def springs_on(elimination, fixed):
    """Return springs on pivots, on what they follow and on others."""
    rng = np.random.default_rng(8)
    others = rng.permutation(np.flatnonzero(~fixed))[:3]
    R = np.zeros((3, len(fixed)))
    for row, (pivot, other) in enumerate(zip(elimination.pivots[:3], others, strict=True)):
        R[row, [pivot, other, *elimination.weights[[row]].indices[:2]]] = rng.normal(size=4)
    return Springs(csr_array(R), 100.0 * rng.random(3))


@pytest.mark.parametrize(("equations", "sprung"), [(True, False), (True, True), (False, True)])
def test_equations_and_springs_change_the_levels_to_those_of_the_eliminated_matrix_and_back(equations, sprung):
    K, modes, _, fixed = problem((9, 8, 8))
    hierarchy = Hierarchy(matrix_of(K), modes)
    constrained = ConstrainedHierarchy(hierarchy, matrix_of(K))
    elimination, T = eliminated(contact_rows(fixed), len(fixed))
    before = [level.inverse_diagonal.copy() for level in hierarchy.levels]
    bounds = [level.bound for level in hierarchy.levels]
    springs = springs_on(elimination, fixed) if sprung else None
    if not equations:
        elimination, T = eliminate(csr_array((0, len(fixed))), np.empty(0)), eye_array(len(fixed), format="csr")
    constrained.constrain(elimination if equations else None, springs)
    A, top = T.T @ K @ T, hierarchy.levels[0]
    if springs is not None:
        A = A + T.T @ springs.rows.T @ diags_array(springs.stiffness) @ springs.rows @ T
    A = A.tocsr()
    x = T @ np.random.default_rng(6).normal(size=len(fixed))
    r = np.empty(len(fixed))
    top.subtract_product(x, np.zeros(len(fixed)), r)
    assert np.abs(r + A @ x).max() < 1e-11 * np.abs(A @ x).max()
    blocks = np.stack([A[3 * i : 3 * i + 3, 3 * i : 3 * i + 3].toarray() for i in range(len(fixed) // 3)])
    expected = np.linalg.pinv(blocks, rcond=1e-10, hermitian=True)
    assert np.abs(top.inverse_diagonal.reshape(-1, 3, 3) - expected).max() < 1e-9 * np.abs(expected).max()
    keep = np.ones(len(fixed))
    keep[elimination.pivots] = 0.0
    W = diags_array(keep) @ scipy_of(top.P)
    for level in hierarchy.levels[1:]:
        A = W.T @ A @ W
        x = np.random.default_rng(6).normal(size=level.n)
        if level.P is None:
            b, found = A @ x, np.empty(level.n)
            hierarchy.coarse.solve(b, found)
            assert np.abs(A @ found - b).max() < 1e-9 * np.abs(b).max()
        else:
            r = np.empty(level.n)
            level.subtract_product(x, np.zeros(level.n), r)
            assert np.abs(r + A @ x).max() < 1e-11 * np.abs(A @ x).max()
            W = scipy_of(level.P)
    constrained.constrain(None)
    assert all(np.array_equal(level.inverse_diagonal, old) for level, old in zip(hierarchy.levels, before, strict=True))
    assert [level.bound for level in hierarchy.levels] == bounds
    assert all(level.springs is None for level in hierarchy.levels)


def test_springs_on_one_level_are_part_of_its_factors():
    K, modes, _, fixed = problem((2, 2, 2))
    hierarchy = Hierarchy(matrix_of(K), modes)
    assert len(hierarchy.levels) == 1
    elimination, T = eliminated(contact_rows(fixed, 3), len(fixed))
    springs = springs_on(elimination, fixed)
    ConstrainedHierarchy(hierarchy, matrix_of(K)).constrain(elimination, springs)
    A = T.T @ (K + springs.rows.T @ diags_array(springs.stiffness) @ springs.rows) @ T
    b, found = A @ np.random.default_rng(3).normal(size=len(fixed)), np.empty(len(fixed))
    hierarchy.coarse.solve(b, found)
    assert np.abs(A @ found - b).max() < 1e-9 * np.abs(b).max()


def test_springs_are_kept_and_told_apart():
    rng = np.random.default_rng(2)
    springs = Springs(csr_array(rng.normal(size=(4, 9)) * (rng.random((4, 9)) < 0.6)), 1.0 + rng.random(4))
    again = Springs.from_dict(springs.to_dict(), 9)
    u, r, expected = rng.normal(size=9), np.zeros(9), springs.rows.toarray()
    again.subtract_forces(u, r, 2.0)
    assert r == pytest.approx(-2.0 * expected.T @ (springs.stiffness * (expected @ u)))
    assert springs.is_similar(again)
    assert not springs.is_similar(None)
    assert not springs.is_similar(Springs(springs.rows[:3], springs.stiffness[:3]))
    assert springs.is_similar(springs.scaled(1.2))
    assert not springs.is_similar(springs.scaled(3.0))


def test_springs_side_by_side_may_push_along_other_rows():
    rng = np.random.default_rng(3)
    R, S, F = (csr_array(rng.normal(size=(k, 9)) * (rng.random((k, 9)) < 0.6)) for k in (4, 3, 4))
    u, one, other = rng.normal(size=9), 1.0 + rng.random(4), 1.0 + rng.random(3)
    for through in (None, F):
        r = np.zeros(9)
        Springs(R, one, through).joined(Springs(S, other)).subtract_forces(u, r, 0.5)
        pushed = R if through is None else through
        assert r == pytest.approx(-0.5 * (pushed.T @ (one * (R @ u)) + S.T @ (other * (S @ u))))
    assert Springs(R, one).joined(None).rows is R


def test_rows_subtracted_from_others():
    rows = 200
    A, rng = random_blocks(3, 3, rows, 40)
    numbers, x, y = rng.permutation(rows).astype(np.int32), rng.normal(size=120), rng.normal(size=3 * rows)
    expected = y.reshape(-1, 3).copy()
    expected[numbers] -= (A @ x).reshape(-1, 3)
    cycle_kernels.subtract_rows(0, rows, numbers, A.indptr, A.indices, (A.data.ravel(),), x, y, (0, 0, 0))
    assert y == pytest.approx(expected.ravel())


def test_many_coupled_equations_are_assigned_unknowns():
    rng = np.random.default_rng(8)
    B = csr_array((rng.random((450, 900)) < 0.01) * rng.normal(size=(450, 900)) + np.eye(450, 900, 3))
    kept = B.toarray()
    elimination = eliminate(B, np.ones(450))
    assert np.array_equal(B.toarray(), kept)  # untouched
    u = rng.normal(size=900)
    elimination.complete(u, elimination.offset)
    assert np.abs(B @ u - 1.0).max() < 1e-8 * np.abs(u).max()


def prepared(precision="single", scale=1.0, divisions=(12, 11, 10)):
    K, modes, f, fixed = problem(divisions)
    solver = Amg(1e-10, precision)
    solver.prepare(bsr_array((scale * K.data, K.indices, K.indptr), shape=K.shape), modes)
    return solver, scale * f, fixed


def test_coarser_levels_serve_for_a_matrix_that_differs_little():
    solver, f, fixed = prepared()
    before, (K, modes, _, _) = solver.load(f).solve(contact_rows(fixed), np.full(6, 1e-3))[0], problem((12, 11, 10))
    hierarchy, near = solver.hierarchy, solver.copy_for_similar_matrix()
    near.prepare(K * 1.3, modes)
    assert all(one.A is other.A for one, other in zip(near.hierarchy.levels[1:], hierarchy.levels[1:], strict=True))
    u = near.load(f).solve(contact_rows(fixed)[:0], np.empty(0))[0]
    assert np.abs(1.3 * (K @ u) - f).max() < 1e-8 * np.abs(f).max()
    again = solver.load(f).solve(contact_rows(fixed), np.full(6, 1e-3))[0]
    assert np.abs(again - before).max() < 1e-8 * np.abs(before).max()  # the solver itself has not changed


def test_a_matrix_that_differs_much_gets_its_own_hierarchy_and_so_do_all_later_ones():
    solver, f, fixed = prepared()
    K, modes, _, _ = problem((12, 11, 10))
    stiff = np.where(np.arange(len(f) // 3) % 7 < 3, 100.0, 1.0).repeat(3)
    other = bsr_array((diags_array(stiff) @ csr_array(K) @ diags_array(stiff)).tobsr((3, 3)))
    other.sort_indices()
    snapshot, near = solver.snapshot(), solver.copy_for_similar_matrix()
    near.prepare(other.copy(), modes)
    u = near.load(f).solve(contact_rows(fixed)[:0], np.empty(0))[0]
    assert np.abs(other @ u - f).max() < 1e-8 * np.abs(f).max()
    later = solver.copy_for_similar_matrix()
    later.prepare(K.copy(), modes)
    assert near.hierarchy.levels[1].A is not solver.hierarchy.levels[1].A
    assert later.hierarchy.levels[1].A is not solver.hierarchy.levels[1].A
    solver.put_back(snapshot)
    later = solver.copy_for_similar_matrix()
    later.prepare(K.copy(), modes)
    assert later.hierarchy.levels[1].A is solver.hierarchy.levels[1].A


@pytest.mark.parametrize("equations", first_of(1, [0, 6]))
def test_pyamg_finds_the_same_and_takes_as_many_iterations(equations):
    solver, f, fixed = prepared()
    K, modes, _, _ = problem((12, 11, 10))
    oracle = Pyamg(1e-10)
    oracle.prepare(K, modes)
    B, c = contact_rows(fixed, 6)[:equations], np.full(equations, 1e-3)
    (u, multiplier), (v, expected) = (each.load(f).solve(B, c) for each in (solver, oracle))
    assert np.abs(u - v).max() < 1e-8 * np.abs(v).max()
    assert np.abs(multiplier - expected).max(initial=0.0) < 1e-7 * np.abs(K @ v).max()
    assert solver.counters.iterations <= oracle.counters.iterations + 3


def test_bits_do_not_depend_on_the_number_of_threads(monkeypatch):
    found = []
    before = threads()
    monkeypatch.setattr(parallel, "SINGLE_THREAD_WORK", 1000)
    monkeypatch.setattr(matrices, "MIN_ROWS", 64)
    for count in (1, 2, 3):
        set_threads(count)
        solver, f, fixed = prepared()
        u, multiplier = solver.load(f).solve(contact_rows(fixed), np.full(6, 1e-3))
        found.append((u.tobytes(), multiplier.tobytes(), solver.counters.iterations))
    set_threads(before)
    assert found[0] == found[1] == found[2]


def test_going_on_under_other_equations_is_starting_there():
    solver, f, fixed = prepared()
    loaded, K = solver.load(f), problem((12, 11, 10))[0]
    first, second = contact_rows(fixed), contact_rows(fixed, 9)
    u, _ = loaded.solve(first, np.full(6, 1e-3))
    made = solver.counters.iterations
    for B, c in ((second, np.full(9, 2e-3)), (second[:4], np.zeros(4)), (second[:0], np.zeros(0))):
        u, multiplier = loaded.solve(B, c, guess=u)
        residual = K @ u - f - B.T @ multiplier
        assert np.abs(residual).max() < 1e-8 * np.abs(f).max()
        assert np.abs(B @ u - c).max(initial=0.0) < 1e-12
    again, _ = solver.load(f).solve(second[:0], np.zeros(0), guess=u)
    assert np.abs(again - u).max() < 1e-8 * np.abs(u).max()
    assert solver.counters.iterations > made


def test_both_precisions_agree_and_single_takes_half_the_memory():
    (single, f, _), (double, _, _) = prepared(), prepared("double")
    zero = np.zeros(len(f))
    u, v = single.load(f).full_solution(zero), double.load(f).full_solution(zero)
    assert np.abs(u - v).max() < 1e-8 * np.abs(v).max()
    assert abs(single.counters.iterations - double.counters.iterations) <= 1
    assert single.hierarchy.nbytes < 0.62 * double.hierarchy.nbytes
    assert "single precision" in repr(single)
    assert "levels, unknowns 5148 -> " in repr(single)
    assert "operator complexity 1." in repr(single)
    assert "MB" in repr(single)


@pytest.mark.parametrize("compliance", [None, np.full(6, 1e-3)], ids=["exact", "soft"])
def test_the_loop_allocates_nothing_that_grows_with_the_problem(compliance):
    solver, f, fixed = prepared(divisions=(16, 14, 12))
    elimination = replace(eliminate(contact_rows(fixed), np.full(6, 1e-3)), compliance=compliance)
    solver.solution(f, elimination, None)  # compiles
    solver.constrain(elimination)
    solver._start(solver._cg, f)
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    tracemalloc.reset_peak()
    for _ in range(5):
        assert solver._cg.step(solver._reduced.multiply, solver.precondition)
    peak = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    assert peak < len(f)  # bytes: less than an eighth of one vector


def test_memory_is_what_the_levels_hold():
    solver, f, _ = prepared()
    top = solver.hierarchy.levels[0]
    nodes, stored = len(f) // 3, len(top.A.storage[2])
    # Stored blocks with their columns, the pattern of all, where rows of both begin, and where upper triangles do.
    assert top.A.nbytes == 4 * (9 * stored + stored + len(top.A.indices) + 2 * (nodes + 1) + nodes)
    assert stored < 0.56 * len(top.A.indices)  # two parts
    assert solver.hierarchy.nbytes < 3.0 * top.A.nbytes  # small problems pay relatively more for prolongators
    assert solver.nbytes == pytest.approx(solver.hierarchy.nbytes + 5 * 8 * len(f), rel=1e-3)


def test_a_bound_that_is_too_low_is_noticed_and_raised(caplog):
    solver, f, _ = prepared()
    for level in solver.hierarchy.levels:
        level.bound *= 0.3
    solver.hierarchy._bounds_without_equations = [level.bound for level in solver.hierarchy.levels]
    solver.hierarchy.set_bounds()
    with caplog.at_level(logging.INFO, logger="fastcontact"):
        u = solver.load(f).full_solution(np.zeros(len(f)))
    assert np.abs(problem((12, 11, 10))[0] @ u - f).max() < 1e-8 * np.abs(f).max()


@pytest.mark.parametrize("coupled", [False, True])
def test_eliminated_equations_hold_for_any_unknowns(coupled):
    rng = np.random.default_rng(7)
    B = rng.normal(size=(5, 20)) * (rng.random((5, 20)) < 0.6)
    if not coupled:
        B[:, :5] = np.diag([2.0, -3.0, 4.0, 5.0, -6.0])
    c, kept = rng.normal(size=5), csr_array(B)
    elimination = eliminate(kept, c)
    assert np.array_equal(kept.toarray(), B)  # untouched
    u = rng.normal(size=20)
    elimination.complete(u, elimination.offset)
    assert B @ u == pytest.approx(c, abs=1e-12)
    multiplier = rng.normal(size=5)
    assert elimination.multiplier((B.T @ multiplier)[elimination.pivots]) == pytest.approx(multiplier)
    # Forces at the pivots are moved so that they do the same work.
    force, motion = rng.normal(size=20), rng.normal(size=20)
    elimination.complete(motion)
    work = force @ motion
    elimination.move_forces(force)
    assert force @ motion == pytest.approx(work)
    assert not force[elimination.pivots].any()
    assert not np.isin(elimination.pivots, elimination.weights.indices).any()
    if not coupled:
        assert elimination.pivots.tolist() == [0, 1, 2, 3, 4]


def test_conjugate_gradients_finish_on_a_small_matrix():
    rng = np.random.default_rng(9)
    half = rng.normal(size=(8, 8))
    A = half @ half.T + np.eye(8)
    b = rng.normal(size=8)
    cg = ConjugateGradients(8)
    cg.r[:] = b
    cg.start()
    diagonal = np.diag(A)
    for _ in range(8):
        assert cg.step(lambda p, q: np.matmul(A, p, out=q), lambda r, norm, z: np.divide(r, diagonal, out=z))
    assert A @ cg.x == pytest.approx(b, abs=1e-8)
    assert cg.norm < 1e-8
