"""Constraints of corners of quadratic facets, eliminated along functions that are linear on facets."""

import numpy as np
import pytest
from scipy.sparse import csr_array, eye_array, kron
from test_coupled_pivots import check_beside_dual, pressed, solved

import fastcontact as fc
from fastcontact.analysis.problem import prepare
from fastcontact.linear.elimination import elimination_kernels
from fastcontact.linear.elimination.basis_transformation import BasisTransformation, eliminated
from fastcontact.linear.elimination.elimination import eliminate

SIZE = 3
# Of a quadratic line: its linear functions times its quadratic ones, integrated; ends first, then the mid node.
MASS = np.array([[1 / 6, 0.0, 1 / 3], [0.0, 1 / 6, 1 / 3]])


def quadratic_line(n, parts, fixed=(), seed=0):
    """Return equations of the n + 1 corners of a line of quadratic facets against linear ones, and the corners' functions.

    Nodes are the corners, then the mid nodes, then those of the other side; the equations of a corner are `parts` directions.
    """
    rng = np.random.default_rng(seed)
    directions = np.linalg.qr(np.eye(3) + 0.2 * rng.normal(size=(n + 1, 3, 3)))[0]
    own, across, functions = np.zeros((n + 1, 2 * n + 1)), np.zeros((n + 1, n + 1)), np.zeros((3 * n + 2, 3 * n + 2))
    for facet in range(n):
        ends = [facet, facet + 1]
        own[np.ix_(ends, [*ends, n + 1 + facet])] += MASS
        across[np.ix_(ends, ends)] += [[1 / 3, 1 / 6], [1 / 6, 1 / 3]]
        functions[n + 1 + facet, ends] = 0.5
    weights = np.hstack([own, -across]) / own.sum(axis=1)[:, None]
    rows = [weights[i][:, None] * directions[i, :, a] for a in range(parts) for i in range(n + 1)]
    B = np.array([row.ravel() for row in rows])
    B[:, list(fixed)] = 0.0
    return csr_array(B), np.tile(np.arange(n + 1), parts), csr_array(kron(csr_array(functions), eye_array(SIZE)))


@pytest.mark.parametrize("parts", [1, 3])
@pytest.mark.parametrize("nonsymmetric", [False, True])
@pytest.mark.parametrize("n", [8, 80])  # inverted as a block, and by factors
def test_equations_of_corners_hold_and_forces_do_the_same_work(parts, nonsymmetric, n):
    B, nodes, functions = quadratic_line(n, parts)
    rng = np.random.default_rng(1)
    c, u, r = rng.normal(size=B.shape[0]), rng.normal(size=B.shape[1]), rng.normal(size=B.shape[1])
    F = csr_array(B + 0.2 * quadratic_line(n, parts, seed=5)[0]) if nonsymmetric else None
    found = eliminated(B, c, F, nodes, SIZE, functions)
    assert isinstance(found, BasisTransformation)
    assert found.coupled == (n != 8)
    assert set(found.pivots // SIZE) == set(range(2 * n + 1))  # corners and mid nodes, nothing of the other side
    others = np.setdiff1d(np.arange(B.shape[1]), found.pivots)
    before = u.copy()
    found.complete(u, found.offset)
    assert np.abs(B @ u - c).max() < 1e-12 * np.abs(u).max()
    assert np.array_equal(u[others], before[others])
    multiplier = rng.normal(size=B.shape[0])
    total = (B if F is None else F).T @ multiplier
    assert found.multiplier(total[found.pivots]) == pytest.approx(multiplier, abs=1e-10)
    found.move_forces(total)
    assert np.abs(total).max() < 1e-12 * np.abs(multiplier).max()
    before = r.copy()
    found.move_forces(r)
    obeying = rng.normal(size=B.shape[1])
    found.complete(obeying)
    if F is None:
        assert r @ obeying == pytest.approx(before @ obeying, rel=1e-10)


def test_sparse_weights_of_corners_move_translations_exactly_stay_sparse_and_nearly_obey():
    n = 200
    B, nodes, functions = quadratic_line(n, 3)
    found = eliminated(B, np.zeros(B.shape[0]), None, nodes, SIZE, functions)
    sparse = found.with_sparse_weights()
    for direction in np.eye(SIZE):
        u = np.tile(direction, 3 * n + 2)
        assert sparse.weights @ u == pytest.approx(direction[found.pivots % SIZE], abs=1e-12)
    assert sparse.weights.nnz < 60 * len(found.pivots)
    once = np.random.default_rng(2).normal(size=B.shape[1])
    sparse.complete(once)
    twice = once.copy()
    sparse.complete(twice)
    assert twice == pytest.approx(once, abs=1e-12)  # what obeys once is left as it is
    u = np.sin(np.arange(B.shape[1]) / 60.0)
    exact = u.copy()
    found.complete(exact)
    assert np.abs(sparse.weights @ u - exact[found.pivots]).max() < 0.05
    assert found.full_weights() @ u == pytest.approx(exact[found.pivots], abs=1e-12)


def test_exact_weights_of_few_corners_serve_the_preconditioner():
    B, nodes, functions = quadratic_line(6, 3)
    found = eliminated(B, np.zeros(B.shape[0]), None, nodes, SIZE, functions)
    u = np.random.default_rng(3).normal(size=B.shape[1])
    exact, again = u.copy(), u.copy()
    found.complete(exact)
    found.with_sparse_weights().complete(again)
    assert again == pytest.approx(exact, abs=1e-12)


def test_supported_mid_nodes_do_not_move():
    n = 20
    fixed = [SIZE * (n + 1 + 4) + k for k in range(SIZE)]
    B, nodes, functions = quadratic_line(n, 3, fixed)
    u = np.random.default_rng(4).normal(size=B.shape[1])
    u[fixed] = 0.0
    found = eliminated(B, np.zeros(B.shape[0]), None, nodes, SIZE, functions)
    assert not np.isin(fixed, found.pivots).any()
    found.complete(u)
    assert np.abs(B @ u).max() < 1e-12 * np.abs(u).max()


def test_equations_without_mid_nodes_are_eliminated_by_nodal_unknowns():
    B, nodes, functions = quadratic_line(8, 1)
    elsewhere = csr_array((B.shape[1],) * 2)
    c = np.zeros(B.shape[0])
    for given in (None, elsewhere):
        found, plain = eliminated(B, c, None, nodes, SIZE, given), eliminate(B, c, None, nodes, SIZE)
        assert not isinstance(found, BasisTransformation)
        assert np.array_equal(found.pivots, plain.pivots)
    assert not isinstance(eliminated(B, c, None, None, SIZE, functions), BasisTransformation)
    assert isinstance(eliminated(B, c, None, nodes, SIZE, functions), BasisTransformation)


def test_corners_with_next_to_no_entries_are_left_to_other_ways():
    B, nodes, functions = quadratic_line(8, 1)
    weak = B.toarray()
    weak[3, SIZE * 3 : SIZE * 4] *= 1e-3
    weak[3, SIZE * (9 + 2) : SIZE * (9 + 4)] *= 1e-3  # and the mid nodes beside
    found = eliminated(csr_array(weak), np.zeros(len(weak)), None, nodes, SIZE, functions)
    assert not isinstance(found, BasisTransformation)
    u = np.random.default_rng(8).normal(size=B.shape[1])
    found.complete(u)
    assert np.abs(weak @ u).max() < 1e-10 * np.abs(u).max()


@pytest.mark.parametrize("kind", [np.float32, np.float64])
def test_kernels_take_weights_of_pivots_themselves(kind):
    rng = np.random.default_rng(7)
    n, pivots = 12, np.array([3, 7, 1, 10])
    W = csr_array(np.where(rng.uniform(size=(4, n)) < 0.6, rng.normal(size=(4, n)), 0.0).astype(kind))
    T = np.eye(n)
    T[pivots] = W.toarray()
    x, r = rng.normal(size=n).astype(kind), rng.normal(size=n).astype(kind)
    of_W, close = (W.indptr, W.indices, W.data), 1e-5 if kind == np.float32 else 1e-13
    moved, forces = r.copy(), r[pivots]
    elimination_kernels.move_forces(pivots, *of_W, moved)
    assert moved == pytest.approx(T.T @ r, abs=close)
    completed = x.copy()
    elimination_kernels.complete(pivots, *of_W, completed)
    assert completed == pytest.approx(T @ x, abs=close)
    added = r.copy()
    elimination_kernels.add_rows(*of_W, forces, added)
    assert added == pytest.approx(r + W.T @ forces, abs=close)


@pytest.mark.parametrize(
    ("element", "values"), [("tet10", {0.5}), ("hex20", {0.5}), ("hex27", {0.25, 0.5}), ("wedge15", {0.5})]
)
def test_functions_of_corners_are_those_of_linear_facets(element, values):
    model = pressed(4, element, multipliers="standard")
    pair = prepare(model, fc.linear_ramp(1), fc.Criteria(), linear_solver="amg").pairs["c"]
    functions, points = pair.basis_transformation, model.mesh.points
    assert set(np.round(functions.data, 12)) == values
    mid = np.flatnonzero(np.diff(functions.indptr))
    assert len(mid)
    assert functions[mid] @ points == pytest.approx(points[mid], abs=1e-12)
    dual = prepare(pressed(4, element, multipliers="dual"), fc.linear_ramp(1), fc.Criteria(), linear_solver="amg")
    assert dual.pairs["c"].basis_transformation is None
    assert dual.solver.basis_transformation is None


@pytest.mark.parametrize(("element", "friction"), [("tet10", 0.3), ("hex20", 0.3), ("hex27", 0.0), ("wedge15", 0.0)])
def test_standard_multipliers_on_quadratic_facets_cost_multigrid_little_more_than_dual_ones(element, friction):
    check_beside_dual(6, element, friction, 2.5)


def test_tied_quadratic_facets_with_standard_multipliers_need_no_factors():
    model = pressed(6, "tet10", kind="tied", multipliers="standard")
    solver, found = solved(model, "amg")
    assert not solver.gave_up
    assert found.force == pytest.approx(solved(model, "direct")[1].force, abs=1e-8 * np.abs(found.force).max())


def test_auto_takes_multigrid_for_standard_multipliers_on_quadratic_facets_unless_they_have_a_penalty():
    def chosen(**options):
        model = pressed(10, "tet10", multipliers="standard", **options)
        assert model.n_dofs > 15_000
        return prepare(model, fc.linear_ramp(1), fc.Criteria()).solver.name

    assert [chosen(), chosen(friction=0.3), chosen(penalty=100.0)] == ["amg", "amg", "direct"]
