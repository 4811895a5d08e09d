"""Compliant constraints with multigrid: springs, eliminated violations, cost of contact with a penalty."""

from functools import cache

import numpy as np
import pytest
from models import elastic_model, with_obstacle
from pairwise import first_of
from pressed_blocks import assert_agree, box, pressed, solved
from scipy.sparse import bsr_array, csr_array, diags_array

import fastcontact as fc
from fastcontact.linear.multigrid import loaded
from fastcontact.linear.protocol import FrictionTerms
from fastcontact.linear.solvers.amg import Amg
from fastcontact.linear.springs import Springs

pytestmark = pytest.mark.each_value

# Of the diagonal of K, at its softest end and at its stiffest: the springs here are from 1e-6 to 1e8 times as stiff.
SOFTNESS = {"soft": (1e2, 1e6), "stiff": (1e-8, 1e-2), "mixed": (1e-8, 1e6)}


def equations(fixed, m=12, seed=1):
    """Return rows (m, n) with an unknown each of their own and three that they share."""
    rng, B = np.random.default_rng(seed), np.zeros((m, len(fixed)))
    free = rng.permutation(np.flatnonzero(~fixed))
    for i in range(m):
        B[i, free[i]] = 1.0
        B[i, free[m + rng.permutation(8)[:3]]] = -rng.random(3)
    return csr_array(B), rng.normal(size=m)


def prepared(K, modes, precision="single"):
    solver = Amg(1e-11, precision)
    solver.prepare(K, modes)
    return solver


def exactly(K, f, B, c, C, F=None, S=None):
    """Solve the whole system of displacements and multipliers at once, in a dense matrix."""
    F, K = B if F is None else F, K.toarray() + (0.0 if S is None else S)
    n = len(f)
    whole = np.block([[K, -F.toarray().T], [B.toarray(), np.diag(C)]])
    # Columns of multipliers in units of displacements: stiff springs are no trouble of this matrix then.
    found = np.linalg.solve(whole, np.concatenate([f, c]))
    return found[:n], found[n:]


@pytest.mark.parametrize("kind", SOFTNESS)
@pytest.mark.parametrize("rigid", [False, True])
def test_equations_give_way_as_much_as_they_should(kind, rigid):
    K, modes, fixed = box()
    B, c = equations(fixed)
    low, high = SOFTNESS[kind]
    C = np.geomspace(low, high, len(c))
    if rigid:
        C[::3] = 0.0
    f = np.where(fixed, 0.0, np.random.default_rng(5).normal(size=len(fixed)))
    solver = prepared(K, modes)
    u, multiplier = solver.load(f).solve(B, c, C)
    expected, forces = exactly(K, f, B, c, C)
    assert u == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert multiplier == pytest.approx(forces, abs=1e-9 * np.abs(forces).max())
    assert not solver.columns.requests
    # The same from a start where some of the equations held, without any more at the solution itself.
    before = solver.counters.iterations
    assert solver.load(f).solve(B, c, C, guess=u)[0] == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert solver.counters.iterations - before <= 4
    # What the hierarchy was changed for is taken back.
    assert np.abs(K @ solver.load(f).solve(B[:0], c[:0])[0] - f).max() < 1e-9 * np.abs(f).max()


@pytest.mark.parametrize("kind", SOFTNESS)
def test_multipliers_may_act_through_other_rows_than_those_that_give_way(kind):
    K, modes, fixed = box()
    (B, c), (other, _), (R, _) = equations(fixed), equations(fixed, seed=2), equations(fixed, 5, seed=3)
    C = np.geomspace(*SOFTNESS[kind], len(c))
    C[1] = 0.0
    F = csr_array(B + 0.1 * other)
    springs = Springs(R, np.linspace(0.5, 2.0, 5))
    f, pushed = np.where(fixed, 0.0, np.random.default_rng(6).normal(size=(2, len(fixed))))
    solver, nodes = prepared(K, modes), np.arange(len(c))
    terms = FrictionTerms(F, springs, pushed)
    u, multiplier = solver.load(f).solve_nonsymmetric(B, c, nodes, np.zeros(len(f)), 0.0, terms, C)
    S = (R.T @ diags_array(springs.stiffness) @ R).toarray()
    expected, forces = exactly(K, f + pushed, B, c, C, F, S)
    assert u == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert multiplier == pytest.approx(forces, abs=1e-9 * np.abs(forces).max())


def test_equations_that_give_way_may_repeat_each_other():
    K, modes, fixed = box()
    B, c = equations(fixed, 6)
    B, c = csr_array(B[[0, 0, 1, 2, 3, 4, 5]]), c[[0, 0, 1, 2, 3, 4, 5]]
    C = np.full(7, 1e-3)
    f = np.where(fixed, 0.0, 1.0)
    solver = prepared(K, modes)
    u, multiplier = solver.load(f).solve(B, c, C)
    expected, forces = exactly(K, f, B, c, C)
    assert not solver.columns.requests
    assert u == pytest.approx(expected, abs=1e-8 * np.abs(expected).max())
    assert multiplier == pytest.approx(forces, abs=1e-7 * np.abs(forces).max())
    # Rigid ones that do have no multipliers of their own: their compliance is formed.
    C[:2] = 0.0
    u, multiplier = solver.load(f).solve(B, c, C)
    assert solver.columns.requests
    assert np.abs(B @ u + C * multiplier - c).max() < 1e-9


def test_an_iterate_is_left_where_its_monitor_says_so_with_forces_of_all_equations():
    K, modes, fixed = box()
    B, c = equations(fixed)
    C, f, seen = np.geomspace(1e-8, 1e6, len(c)), np.where(fixed, 0.0, 1.0), []

    def watch(u, multiplier, error):
        seen.append((u.copy(), multiplier.copy(), error))
        return len(seen) == 2

    u, multiplier = prepared(K, modes).load(f).solve(B, c, C, monitor=watch)
    assert len(seen) == 2
    assert np.array_equal(u, seen[1][0])
    assert np.array_equal(multiplier, seen[1][1])
    exact = exactly(K, f, B, c, C)[1]
    assert np.abs(multiplier - exact).max() < np.abs(seen[0][1] - exact).max()


def on_wall(friction=0.0, n=8, **options):
    mesh = fc.generate.box((1.0, 1.0, 0.5), (n, n, n // 2), "hex8")
    model = elastic_model(mesh, "3d", E=1.0, ZMAX={"x": 0.004 if friction else 0.0, "y": 0.0, "z": -0.01})
    wall = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    return with_obstacle(model, "c", "ZMIN", wall, friction=friction, **options)


@cache
def exact_iterations(friction, **options):
    """Return the iterations of pressed blocks without a penalty."""
    return solved(pressed(friction=friction, **options), "amg")[0].counters.iterations


DUAL = {"formulation": "mortar", "multipliers": "dual"}


# A cell is 0.1 wide: Young's modulus over that is 10.
@pytest.mark.parametrize("friction", first_of(1, [0.3, 0.0]))
def test_iterations_do_not_grow_with_the_penalty(friction):
    exact = exact_iterations(friction, **DUAL)
    for penalty in (1.0, 100.0, 1e7) if friction else (30.0, 300.0, 1e4):
        assert_agree(pressed(friction=friction, penalty=penalty, **DUAL), 2 * exact)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize(
    "options",
    [
        {"formulation": "node_to_segment"}, {"formulation": "mortar", "multipliers": "standard"},
        {**DUAL, "curvature": 0.02}, {**DUAL, "ratio": 100.0}, {**DUAL, "element": "tet4"},
        {**DUAL, "element": "tet10", "n": 5},
    ],
    ids=["node", "standard", "curved", "stiff primary", "tet4", "tet10"],
)  # fmt: skip
@pytest.mark.parametrize("penalty", [20.0, 1e4])
def test_any_formulation_and_element_takes_a_penalty(options, friction, penalty):
    exact = exact_iterations(friction, **options)
    assert_agree(pressed(friction=friction, penalty=penalty, **options), 2 * exact)


@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("penalty", [10.0, 1e4])
def test_a_penalty_against_a_wall(friction, penalty):
    exact = solved(on_wall(friction), "amg")[0].counters.iterations
    assert_agree(on_wall(friction, penalty=penalty), 2 * exact)


def test_a_tangential_penalty_costs_no_columns():
    exact = exact_iterations(0.3, **DUAL)
    for tangential, penalty in ((1.0, {}), (100.0, {"penalty": 100.0}), (1e5, {})):
        assert_agree(pressed(friction=0.3, tangential_penalty=tangential, **penalty, **DUAL), 2 * exact)


@pytest.mark.parametrize("friction", first_of(1, [0.3, 0.0]))
def test_a_pair_with_a_penalty_beside_one_without(friction):
    model = pressed(friction=friction, penalty=100.0, **DUAL)
    wall = fc.obstacles.HalfSpace((1.001, 0.0, 0.0), (-1.0, 0.0, 0.0))
    model.add_obstacle("wall", secondary="U_XMAX", obstacle=wall, formulation="node_to_segment", friction=friction)
    solver, _ = solved(model, "amg")
    assert not solver.replacement_reason
    assert_agree(model, 100)


def test_springs_that_are_far_too_stiff_for_the_cycle_are_eliminated(monkeypatch):
    eliminated = solved(pressed(penalty=1e4, **DUAL), "amg")[0].counters.iterations
    monkeypatch.setattr(loaded, "LARGEST_STIFFNESS_RATIO", np.inf)
    assert solved(pressed(penalty=1e4, **DUAL), "amg")[0].counters.iterations > 3 * eliminated


@pytest.mark.parametrize("kind", ["K", "K of one level"])
def test_springs_alone_precondition_the_matrix_that_they_are_part_of(kind):
    K, modes, fixed = box() if kind == "K" else box((2, 2, 2))
    B, c = equations(fixed, 6)
    f = np.where(fixed, 0.0, 1.0)
    solver = prepared(K, modes, "double")
    u = solver.load(f).solve(B, c, np.full(6, 2.0))[0]
    S = B.T @ diags_array(np.full(6, 0.5)) @ B
    assert np.abs(bsr_array(K + S) @ u - f - B.T @ (0.5 * c)).max() < 1e-9
    assert solver.counters.iterations <= 30
