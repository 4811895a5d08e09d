"""Grouped, layered and coupled pivots: exact inverses, refused without an order."""

import numpy as np
import pressed_blocks
import pytest
from pairwise import first_of
from pressed_blocks import solved
from refusals import refused
from scipy.sparse import bsr_array, csr_array, diags_array

import fastcontact as fc
from fastcontact.analysis.problem import prepare
from fastcontact.elasticity.stiffness import rigid_modes, stiffness
from fastcontact.linear.delassus import TooManyColumnsError
from fastcontact.linear.elimination import pivot_order
from fastcontact.linear.elimination.coupled_pivots import CoupledError, CoupledPivots, block_inverse, lumped_matrix
from fastcontact.linear.elimination.elimination import Elimination, eliminate
from fastcontact.linear.elimination.pivot_order import choose_pivots, column_inverse, pivots_of_most_groups
from fastcontact.linear.solvers import amg


def grouped(rng, n=60, groups=6):
    """Rows in groups of three, each on three unknowns of its own and some that others share."""
    label = np.repeat(np.arange(groups), 3)
    rng.shuffle(label)
    B = np.zeros((len(label), n))
    for g in range(groups):
        B[np.ix_(label == g, 3 * g + np.arange(3))] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        B[np.ix_(label == g, 3 * groups + rng.choice(n - 3 * groups, 4))] = 0.25 * rng.normal(size=(3, 4))
    return csr_array(B), label


@pytest.mark.parametrize("seed", range(5))
def test_pivots_of_groups_are_their_own_and_well_conditioned(seed):
    B, label = grouped(np.random.default_rng(seed))
    pivots = pivot_order.pivots_of_groups(B, label)
    assert len(set(pivots)) == len(pivots)
    taken = np.abs(B[:, pivots].toarray()) > 0
    assert not taken[label[:, None] != label[None]].any()
    assert np.linalg.cond(B[:, pivots].toarray()) < 50
    # The first pivot of a group is its largest entry among the unknowns that no other group has.
    dense = B.toarray()
    for g in range(6):
        own = np.abs(np.where((dense[label != g] != 0).any(axis=0), 0.0, dense[label == g]))
        row, column = np.unravel_index(own.argmax(), own.shape)
        assert pivots[np.flatnonzero(label == g)[row]] == column


def test_groups_without_unknowns_of_their_own_are_told():
    B = csr_array(np.ones((2, 3)))
    assert pivot_order.pivots_of_groups(B, np.arange(2)) is None
    assert pivot_order.pivots_of_groups(B, np.zeros(2, np.intp)) is None  # two equal equations of one group
    weak = csr_array(np.array([[0.1, 0.0, 1.0], [0.0, 0.1, 1.0]]))  # no group has a pivot that is large enough
    assert pivot_order.pivots_of_groups(weak, np.arange(2)) is None
    assert pivot_order.pivots_of_nodes(weak, np.arange(2), 1) is None


def test_forces_move_along_the_rows_that_multipliers_act_through():
    rng = np.random.default_rng(3)
    B, label = grouped(rng)
    through = csr_array(B + 0.2 * csr_array(np.where(B.toarray() != 0, rng.normal(size=B.shape), 0.0)))
    tied = eliminate(B, rng.normal(size=B.shape[0]), through, label)
    x, r = rng.normal(size=(2, B.shape[1]))
    tied.complete(x, tied.offset)
    forces = r[tied.pivots].copy()
    moved = r.copy()
    tied.move_forces(moved)
    np.testing.assert_allclose(moved, r - through.T @ tied.multiplier(forces), atol=1e-12)
    assert np.abs(moved[tied.pivots]).max() < 1e-12
    assert np.abs((tied.force_weights - tied.weights).data).max() > 0.01
    symmetric = eliminate(B, np.zeros(B.shape[0]), nodes=label)
    assert symmetric.force_weights is symmetric.weights


def layered(B):
    """Return the pivots of equations that are groups of their own."""
    return pivot_order.pivots_of_groups(csr_array(B), np.arange(B.shape[0]))


def test_weak_unknowns_are_no_pivots():
    B = np.array([[0.1, 1.0, 0.0], [0.0, 1.0, 1.0]])
    assert layered(B).tolist() == [1, 2]
    B[0, 0] = 0.3
    assert layered(B).tolist() == [0, 2]


def nodes_in_layers(rng, corners=40, middles=60):
    """Equations of nodes, three each: those of corners on themselves, those of middles also on two corners; all on others."""
    n, equation = corners + middles, np.linalg.qr(rng.normal(size=(corners + middles, 3, 3)))[0]
    B = np.zeros((3 * n, 3 * n + 30))
    for node in range(n):
        own = slice(3 * node, 3 * node + 3)
        B[own, own] = equation[node]
        for other in rng.choice(corners, 2, replace=False) if node >= corners else ():
            B[own, 3 * other : 3 * other + 3] = 0.5 * equation[node]
        B[own, 3 * n + rng.choice(30, 4, replace=False)] = 0.25 * rng.normal(size=(3, 4))
    order = rng.permutation(3 * n)
    return csr_array(B[order]), np.repeat(np.arange(n), 3)[order]


@pytest.mark.parametrize("seed", range(3))
def test_nodes_in_layers_have_a_sparse_inverse(seed):
    B, nodes = nodes_in_layers(np.random.default_rng(seed))
    assert layered(B) is None  # three equations of a node share its three unknowns
    assert pivot_order.pivots_of_groups(B, nodes, layers=1) is None
    pivots, inverse = choose_pivots(B, nodes, 3)
    assert np.array_equal(pivots, pivot_order.pivots_of_groups(B, nodes))
    P = B[:, pivots].toarray()
    assert inverse.solve(P) == pytest.approx(np.eye(len(P)), abs=1e-10)
    assert inverse.matrix.nnz < 12 * len(P)
    # Forces act through other rows of the same pattern.
    through = B + csr_array((0.1 * np.cos(np.arange(B.nnz)) * B.data, B.indices, B.indptr), shape=B.shape)
    inverse = column_inverse(csr_array(through), pivots, 3)
    assert inverse.solve(through[:, pivots].toarray()) == pytest.approx(np.eye(len(P)), abs=1e-9)
    assert inverse.matrix.nnz < 12 * len(P)


def test_a_chain_of_more_layers_is_no_sum_of_few_products():
    m = 80
    B = csr_array(np.eye(m) + 0.5 * np.eye(m, k=1))
    inverse = column_inverse(B, np.arange(m), 1)
    assert isinstance(inverse, CoupledPivots)
    assert inverse.solve(B @ np.ones(m)) == pytest.approx(np.ones(m))


def held_along_a_line(n):
    """Equations of n nodes in a row, two each: gaps with an own unknown, and slips that only move three nodes opposite."""
    B = np.zeros((2 * n, n + 2 * (n + 2)))
    for i in range(n):
        B[2 * i, i] = 1.0
        B[2 * i, n + i : n + i + 3] = -0.2, -0.6, -0.2
        B[2 * i + 1, 2 * n + 2 + i : 2 * n + 5 + i] = -0.25, -0.5, -0.25
    return csr_array(B), np.repeat(np.arange(n), 2)


@pytest.mark.parametrize("n", first_of(1, [20, 300]))
def test_equations_without_unknowns_of_their_own_leave_those_of_the_others_alone(n):
    """Slips of nodes that a support holds, but not what they stick to."""
    B, nodes = held_along_a_line(n)
    assert pivot_order.pivots_of_groups(B, nodes) is None
    gaps, slips = np.arange(0, 2 * n, 2), np.arange(1, 2 * n, 2)
    pivots = pivots_of_most_groups(B, nodes)
    assert (pivots[gaps] < 2 * n + 2).all()
    assert (pivots[slips] >= 2 * n + 2).all()
    pivots, inverse = choose_pivots(B, nodes, 1)
    assert inverse.solve(B[:, pivots].toarray()) == pytest.approx(np.eye(2 * n), abs=1e-8)


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
    assert lumped_matrix(P, pivots, 3).toarray() == pytest.approx(
        np.array([[3.0, 0.1, 0.0], [0.5, 3.0, 0.0], [0.0, 0.0, 3.0]])
    )


def test_columns_that_cancel_or_repeat_each_other_are_refused():
    m = 100
    cancel = csr_array(np.eye(m) - np.roll(np.eye(m), 1, axis=1))
    repeated = np.eye(m)
    repeated[1] = repeated[0]
    for P in (cancel, csr_array(repeated + 0.2)):
        with pytest.raises(fc.ConvergenceError):
            CoupledPivots(P, 3 * np.arange(m), 3)
    assert "dual" in str(CoupledError())


def pressed(n, element="hex8", friction=0.0, **options):
    """Return two blocks that do not match, pressed together over the whole interface, by mortar unless told otherwise."""
    return pressed_blocks.pressed(element, friction, n=n, along=0.002, **{"formulation": "mortar", **options})


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_an_elimination_takes_weights_of_pivots_themselves(kind):
    rng = np.random.default_rng(7)
    n, pivots = 12, np.array([3, 7, 1, 10])
    W = csr_array(np.where(rng.uniform(size=(4, n)) < 0.6, rng.normal(size=(4, n)), 0.0).astype(kind))
    T = np.eye(n)
    T[pivots] = W.toarray()
    x, r = rng.normal(size=n).astype(kind), rng.normal(size=n).astype(kind)
    elimination, close = Elimination(pivots, W, np.zeros(4), W), 1e-5 if kind == np.float32 else 1e-13
    moved = r.copy()
    elimination.move_forces(moved)
    assert moved == pytest.approx(T.T @ r, abs=close)
    completed = x.copy()
    elimination.complete(completed)
    assert completed == pytest.approx(T @ x, abs=close)


@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_standard_multipliers_over_a_whole_interface_cost_multigrid_what_dual_ones_do(friction):
    solver, step = solved(pressed(10, friction=friction, multipliers="standard"), "amg")
    assert not solver.replacement_reason
    assert not solver.columns.requests
    dual = solved(pressed(10, friction=friction, multipliers="dual"), "amg")[0]
    assert solver.counters.iterations <= 2 * dual.counters.iterations
    factors = solved(pressed(10, friction=friction, multipliers="standard"), "direct")[1].contact["c"]
    found = step.contact["c"]
    assert found.pressure == pytest.approx(factors.pressure, abs=1e-5 * factors.pressure.max())
    assert found.force == pytest.approx(factors.force, abs=1e-6 * np.abs(factors.force).max())


@pytest.mark.parametrize(
    ("options", "element"),
    [
        ({"formulation": "continuous", "friction": 0.3}, "hex8"), ({"multipliers": "standard"}, "tet10"),
    ],
)  # fmt: skip
def test_constraints_that_cannot_be_eliminated_go_to_factors_and_not_through_many_columns(
    options, element, monkeypatch
):
    monkeypatch.setattr("fastcontact.linear.multigrid.solver.MAX_COLUMNS", 20)
    monkeypatch.setattr("fastcontact.linear.elimination.pivot_order.LARGEST_BLOCK", 8)
    monkeypatch.setattr("fastcontact.linear.elimination.pivot_order.LARGEST_DENSE", 8)
    model = pressed(5, element, **options)
    solver, step = solved(model, "amg")
    assert "columns of the inverse stiffness matrix" in solver.replacement_reason
    assert "dual" in solver.replacement_reason
    assert step.contact["c"].force == pytest.approx(solved(model, "direct")[1].contact["c"].force, abs=1e-9)
    monkeypatch.setattr(amg, "MAX_FACTORISED_DOFS", {3: 100})
    refused(TooManyColumnsError, "direct solver", solved, model, "amg")


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
    monkeypatch.setattr("fastcontact.linear.delassus.MAX_ROWS", 100)
    monkeypatch.setattr("fastcontact.analysis.friction.delassus.MAX_ROWS_WITH_FRICTION", 100)
    expected = r"full compliance of \d+ constraints, .*GB .*formulation=\"mortar\" with multipliers=\"dual\""
    refused(fc.ContactError, expected, solved, model, solver)


def test_one_layer_is_a_diagonal():
    pivots, inverse = choose_pivots(csr_array(np.array([[2.0, 0.0, 1.0], [0.0, -4.0, 1.0]])))
    assert pivots.tolist() == [0, 1]
    assert inverse.matrix.toarray().tolist() == [[0.5, 0.0], [0.0, -0.25]]
