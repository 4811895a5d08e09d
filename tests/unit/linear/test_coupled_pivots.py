"""Constraints that share unknowns: pivots are factorised, and no column of the inverse is computed."""

import numpy as np
import pressed_blocks
import pytest
from scipy.sparse import bsr_array, csr_array, diags_array

import fastcontact as fc
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import prepare
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.errors import ConvergenceError
from fastcontact.linear.delassus import TooManyColumnsError
from fastcontact.linear.elimination import elimination_kernels
from fastcontact.linear.elimination.coupled_pivots import CoupledError, CoupledPivots, block_inverse, lumped
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.linear.solvers import amg


def mass_equations(m, parts=3, seed=0):
    """Return equations of m nodes on a line: the gap to other nodes, weighted by a mass matrix, along any directions."""
    rng = np.random.default_rng(seed)
    nodes, rows = np.tile(np.arange(m), parts), np.zeros((parts * m, 3 * 2 * m))
    directions = np.linalg.qr(np.eye(3) + 0.2 * rng.normal(size=(m, 3, 3)))[0]
    for a in range(parts):
        for i in range(m):
            for j, weight in ((i - 1, 1 / 6), (i, 2 / 3), (i + 1, 1 / 6)):
                j = min(max(j, 0), m - 1)
                rows[a * m + i, 3 * j : 3 * j + 3] += weight * directions[i, :, a]
                rows[a * m + i, 3 * (m + j) : 3 * (m + j) + 3] -= weight * directions[i, :, a]
    return csr_array(rows), nodes


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("nonsymmetric", [False, True])
def test_coupled_equations_hold_and_forces_do_the_same_work(parts, nonsymmetric):
    B, nodes = mass_equations(80, parts)
    rng = np.random.default_rng(1)
    c, u = rng.normal(size=B.shape[0]), rng.normal(size=B.shape[1])
    F = csr_array(B + 0.2 * mass_equations(80, parts, seed=5)[0]) if nonsymmetric else B
    found = eliminate(B, c, F if nonsymmetric else None, nodes, 3)
    assert found.coupled
    assert set(found.pivots // 3) <= set(range(80))  # each pivot is its node's own
    found.complete(u, found.offset)
    assert np.abs(B @ u - c).max() < 1e-12 * np.abs(u).max()
    # Forces that multipliers can balance are moved to nothing, and the multipliers come back.
    multiplier = rng.normal(size=B.shape[0])
    total = F.T @ multiplier
    assert found.multiplier(total[found.pivots]) == pytest.approx(multiplier, abs=1e-10)
    found.move_forces(total)
    assert np.abs(total).max() < 1e-12 * np.abs(multiplier).max()


def test_sparse_weights_move_translations_exactly_and_stay_sparse():
    B, nodes = mass_equations(200, 3)
    found = eliminate(B, np.zeros(B.shape[0]), None, nodes, 3)
    sparse = found.with_sparse_weights()
    for direction in np.eye(3):
        u = np.tile(direction, 400)
        assert sparse.weights @ u == pytest.approx(direction[found.pivots % 3], abs=1e-12)
    assert sparse.weights.nnz < 40 * B.shape[0]
    full = found.full_weights()
    u = np.sin(np.arange(B.shape[1]) / 60.0)
    assert np.abs(sparse.weights @ u - full @ u).max() < 0.02


def test_a_hierarchy_of_one_level_is_exact_under_equations():
    mesh = fc.generate.box((1.0, 1.0, 1.0), (3, 3, 3))
    moduli = np.asarray([fc.LinearElastic(E=1.0, nu=0.3).moduli("3d")])
    K = stiffness(mesh, "3d", moduli, {"hex8": np.zeros(27, np.int64)})
    K = bsr_array((K + diags_array(np.full(K.shape[0], 0.1))).tobsr((3, 3)))
    rng = np.random.default_rng(3)
    B = np.zeros((3, K.shape[0]))
    B[0, [0, 30]], B[1, [4, 40, 80]], B[2, [9, 30]] = (1.0, -1.0), (1.0, -0.5, -0.5), (1.0, 2.0)
    f, c = rng.normal(size=K.shape[0]), rng.normal(size=3)
    solver = amg.Amg(1e-10)
    solver.prepare(K.copy(), rigid_modes(mesh.points, "3d"))
    assert len(solver.hierarchy.levels) == 1
    u, multiplier = solver.load(f).solve(csr_array(B), c)
    expected = np.linalg.solve(np.block([[K.toarray(), -B.T], [B, np.zeros((3, 3))]]), np.r_[f, c])
    assert np.r_[u, multiplier] == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
    assert solver.counters.iterations <= 4


def test_blocks_of_any_size_and_order_are_inverted_together():
    rng = np.random.default_rng(2)
    sizes = [3, 1, 2, 3, 5, 1]
    A = np.zeros((sum(sizes),) * 2)
    for first, k in zip(np.cumsum([0, *sizes]), sizes, strict=False):
        A[first : first + k, first : first + k] = rng.normal(size=(k, k)) + 3 * np.eye(k)
    order = rng.permutation(len(A))
    A = A[np.ix_(order, order)]
    assert block_inverse(csr_array(A)).toarray() == pytest.approx(np.linalg.inv(A), abs=1e-12)


def test_lumped_entries_are_those_of_the_direction_of_each_pivot():
    P = csr_array(np.array([[2.0, 0.1, 1.0], [0.2, 3.0, 0.3], [1.0, 0.0, 2.0]]))
    pivots = np.array([0, 1, 3])  # components 0 and 1 of node 0, component 0 of node 1
    assert lumped(P, pivots, 3).toarray() == pytest.approx(
        np.array([[3.0, 0.1, 0.0], [0.5, 3.0, 0.0], [0.0, 0.0, 3.0]])
    )


def test_columns_that_cancel_or_repeat_each_other_are_refused():
    m = 100
    cancel = csr_array(np.eye(m) - np.roll(np.eye(m), 1, axis=1))
    repeated = np.eye(m)
    repeated[1] = repeated[0]
    for P in (cancel, csr_array(repeated + 0.2)):
        with pytest.raises(ConvergenceError):
            CoupledPivots(P, 3 * np.arange(m), 3)
    assert "dual" in str(CoupledError())


def pressed(n, element="hex8", friction=0.0, **options):
    """Return two blocks that do not match, pressed together over the whole interface, by mortar unless told otherwise."""
    return pressed_blocks.pressed(element, friction, n=n, along=0.002, **{"formulation": "mortar", **options})


def solved(model, name):
    problem = prepare(model, fc.linear_ramp(1), fc.Criteria(), linear_solver=name)
    return problem.solver, load_step(problem, problem.initial_state(), 1, 1.0)[1].contact["c"]


def check_beside_dual(n, element, friction, most):
    """Standard multipliers cost multigrid at most so many times what dual ones do, and give what factors give."""
    model = pressed(n, element, friction, multipliers="standard")
    solver, found = solved(model, "amg")
    assert not solver.gave_up
    assert not solver.columns.asked
    dual = solved(pressed(n, element, friction, multipliers="dual"), "amg")[0]
    assert solver.counters.iterations <= most * dual.counters.iterations
    factors = solved(model, "direct")[1]
    assert found.pressure == pytest.approx(factors.pressure, abs=1e-5 * factors.pressure.max())
    assert found.force == pytest.approx(factors.force, abs=1e-6 * np.abs(factors.force).max())


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_kernels_take_weights_of_pivots_themselves(kind):
    rng = np.random.default_rng(7)
    n, pivots = 12, np.array([3, 7, 1, 10])
    W = csr_array(np.where(rng.uniform(size=(4, n)) < 0.6, rng.normal(size=(4, n)), 0.0).astype(kind))
    T = np.eye(n)
    T[pivots] = W.toarray()
    x, r = rng.normal(size=n).astype(kind), rng.normal(size=n).astype(kind)
    of_W, close = (W.indptr, W.indices, W.data), 1e-5 if kind == np.float32 else 1e-13
    moved = r.copy()
    elimination_kernels.move_forces(pivots, *of_W, moved)
    assert moved == pytest.approx(T.T @ r, abs=close)
    completed = x.copy()
    elimination_kernels.complete(pivots, *of_W, completed)
    assert completed == pytest.approx(T @ x, abs=close)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_standard_multipliers_over_a_whole_interface_cost_multigrid_what_dual_ones_do(friction):
    check_beside_dual(10, "hex8", friction, 2.0)


@pytest.mark.parametrize(
    ("options", "element"),
    [
        ({"formulation": "continuous", "friction": 0.3}, "hex8"), ({"multipliers": "standard"}, "tet10"),
    ],
)  # fmt: skip
def test_constraints_that_cannot_be_eliminated_go_to_factors_and_not_through_many_columns(
    options, element, monkeypatch
):
    monkeypatch.setattr("fastcontact.linear.multigrid.solver.MOST_COLUMNS", 20)
    monkeypatch.setattr("fastcontact.linear.elimination.pivot_order.LARGEST_BLOCK", 8)
    monkeypatch.setattr("fastcontact.linear.elimination.pivot_order.FULL_UP_TO", 8)
    model = pressed(5, element, **options)
    solver, found = solved(model, "amg")
    assert "columns of the inverse stiffness" in solver.gave_up
    assert "dual" in solver.gave_up
    assert found.force == pytest.approx(solved(model, "direct")[1].force, abs=1e-9)
    monkeypatch.setattr(amg, "AFFORDABLE", {3: 100})
    with pytest.raises(TooManyColumnsError, match="direct solver"):
        solved(model, "amg")


def test_auto_knows_which_constraints_multigrid_cannot_eliminate():
    solver = {options: prepare(pressed(20, **dict(options)), fc.linear_ramp(1), fc.Criteria()).solver.name for options in (
        (("multipliers", "standard"),), (("multipliers", "dual"),), (("multipliers", "dual"), ("penalty", 100.0)),
        (("formulation", "continuous"),), (("formulation", "continuous"), ("penalty", 100.0)),
        (("formulation", "continuous"), ("friction", 0.3)),
    )}  # fmt: skip
    assert list(solver.values()) == ["amg", "amg", "amg", "amg", "amg", "direct"]


@pytest.mark.parametrize(("solver", "friction"), [("direct", 0.0), ("direct", 0.3), ("amg", 0.3)])
def test_a_full_compliance_that_would_take_hours_is_refused_with_the_alternative(solver, friction, monkeypatch):
    model = pressed(5, formulation="continuous", friction=friction)
    monkeypatch.setattr("fastcontact.linear.delassus.MOST_ROWS", 100)
    monkeypatch.setattr("fastcontact.analysis.friction.solve.MOST_ROWS_WITH_FRICTION", 100)
    expected = r"full compliance of \d+ constraints, .*GB .*formulation=\"mortar\" with multipliers=\"dual\""
    with pytest.raises(fc.ContactError, match=expected):
        solved(model, solver)
