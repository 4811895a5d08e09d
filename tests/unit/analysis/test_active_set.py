"""Active sets and active displacements compared with enumeration and with all displacements."""

import itertools
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from models import DenseCompliance, elastic_model
from scipy.sparse import bsr_array, csr_array
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis import active_set
from fastcontact.analysis.active_dofs import ActiveDofs
from fastcontact.analysis.solution import Accuracy
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.linear import choice as linear


def enumerate_solutions(K, f, B, gap0, C):
    """Return the multipliers of the only active set that satisfies all inequalities."""
    delassus, free = B @ np.linalg.solve(K, B.T) + C, gap0 + B @ np.linalg.solve(K, f)
    m = len(gap0)
    for size in range(m + 1):
        for rows in itertools.combinations(range(m), size):
            rows = list(rows)
            multiplier = np.zeros(m)
            multiplier[rows] = np.linalg.solve(delassus[np.ix_(rows, rows)], -free[rows])
            if (multiplier >= -1e-12).all() and (free + delassus @ multiplier >= -1e-10).all():
                return multiplier
    raise AssertionError("a strictly convex problem has a solution")


def random_problem(seed, n=8, m=5):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n))
    return A @ A.T + np.eye(n), rng.normal(size=n), rng.normal(size=(m, n)), rng.normal(size=m), rng


def solve(K, f, B, gap0, C=None, start=None, solver="direct", **options):
    loaded = linear.make(solver, dim=2, n_dofs=len(f), tolerance=1e-13)
    loaded.prepare(bsr_array(K, blocksize=(2, 2)), np.ones((len(f), 1)))
    constraints = Constraints(csr_array(B), gap0, np.zeros((len(gap0), 2)), C)
    begin = np.zeros(len(gap0), bool) if start is None else start
    return active_set.solve(loaded.load(f), constraints, begin, Accuracy(gap=1e-12, **options))


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 100_000), soft=st.booleans(), start=st.integers(0, 31))
def test_every_start_ends_in_the_enumerated_solution(seed, soft, start):
    K, f, B, gap0, rng = random_problem(seed)
    half = rng.normal(size=(5, 2))
    C = half @ half.T if soft else np.zeros((5, 5))
    begin = np.array([bool(start >> k & 1) for k in range(5)])
    state = solve(K, f, B, gap0, DenseCompliance(C) if soft else None, begin)
    assert state.settled
    assert state.multiplier == pytest.approx(enumerate_solutions(K, f, B, gap0, C), abs=1e-8)
    assert np.abs(K @ state.u - f - B.T @ state.multiplier).max() < 1e-9
    assert np.abs(state.gap * state.multiplier).max() < 1e-9


def test_sets_that_recur_are_left_by_the_least_index():
    """Changing all wrong constraints at once, from an empty set, comes back to a set after six solutions."""
    B = np.array([[-2.0, -2.0, -2.0, -1.0], [2.0, 0.0, -1.0, 2.0], [-3.0, -2.0, -1.0, -2.0], [1.0, -1.0, 0.0, 3.0]])
    K, f, gap0 = np.eye(4), np.zeros(4), np.array([-8.0, -8.0, -2.0, -3.0])
    state = solve(K, f, B, gap0)
    assert state.settled
    assert state.iterations > 6
    assert state.multiplier == pytest.approx(enumerate_solutions(K, f, B, gap0, np.zeros((4, 4))), abs=1e-8)


def test_rows_that_repeat_each_other_do_no_harm():
    K, f, B, gap0, _ = random_problem(3)
    twice = np.vstack([B, B[:1]])
    state = solve(K, f, twice, np.append(gap0, gap0[0]), start=np.ones(6, bool))
    assert state.u == pytest.approx(solve(K, f, B, gap0).u, abs=1e-10)


def test_an_unusable_constraint_stays_open():
    K, f, _, gap0, _ = random_problem(3)
    loaded = linear.make("direct", dim=2, n_dofs=8)
    loaded.prepare(bsr_array(K, blocksize=(2, 2)), np.ones((8, 1)))
    constraints = Constraints(csr_array((5, 8)), gap0, np.zeros((5, 2)))
    state = active_set.solve(loaded.load(f), constraints, np.ones(5, bool), Accuracy(gap=1e-12))
    assert state.u == pytest.approx(np.linalg.solve(K, f))
    assert not state.multiplier.any()


def test_a_limit_of_iterations_returns_an_unsettled_state():
    for seed in range(50):
        K, f, B, gap0, _ = random_problem(seed)
        if not solve(K, f, B, gap0, max_iterations=1).settled:
            return
    raise AssertionError("no problem needed a second iteration")


def started(related=False, friction=0.0, name="direct"):
    if name not in linear.SOLVERS:
        pytest.skip(f"{name} is not installed")
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), radial_sizes=(3.0, 9.0), segments=3)
    model = elastic_model(mesh, "axisymmetric", E=20_000.0, A1A2="x", A1B1={"y": 2.0})
    if related:
        model.couple("CONT2", "y")
    model.prescribe("A2B2", y=-2.0)
    model.add_contact("c", secondary="CONT1", primary="CONT2", formulation="node_to_segment", friction=friction)
    return Stepping(model, name, 1e-14, fc.Criteria(geometry=1e-8), fc.linear_ramp(2))


def contact_dofs(analysis):
    """The components of the points on both sides, which are named in the model."""
    mesh = analysis.model.mesh
    points = np.union1d(mesh.points_of("CONT1"), mesh.points_of("CONT2"))
    return (points[:, None] * mesh.dim + np.arange(mesh.dim)).ravel()


@pytest.fixture(params=[False, True], ids=["supports", "relations"])
def both(request):
    analysis = started(request.param)
    everything = ActiveDofs(analysis.system, contact_dofs(analysis), np.empty(0, int))
    surfaces = analysis.dofs
    assert len(surfaces.active) < len(analysis.u)
    return analysis, everything, surfaces


def obeying(analysis, seed=1):
    """Random displacements that obey supports and relations, and what these prescribe."""
    lift = analysis.load_at(0.7).lift
    v = np.where(analysis.system.free, np.random.default_rng(seed).normal(size=len(lift)), 0.0)
    return analysis.system.displacement(v, lift), lift


def test_rows_are_those_for_all_unknowns(both):
    analysis, everything, surfaces = both
    u, lift = obeying(analysis)
    part = analysis.pairs["c"].constraints(Configuration.displaced(np.zeros((len(u) // 2, 2))))
    at_all, at_surfaces = (dofs.constraints(part, lift, 0.0 * u) for dofs in (everything, surfaces))
    B, own = at_all.B, at_surfaces.B
    np.testing.assert_array_equal(at_surfaces.gap0, at_all.gap0)
    v = analysis.system.unknowns(u, lift)
    np.testing.assert_allclose(own @ v[surfaces.unknowns], B @ v, atol=1e-14)
    np.testing.assert_array_equal(np.diff(own.indptr) > 0, np.diff(B.indptr) > 0)
    assert own.data.all()


def test_displacements_are_those_of_all(both):
    analysis, everything, surfaces = both
    u, lift = obeying(analysis)
    for dofs in (everything, surfaces):
        v = analysis.system.unknowns(u, lift)[dofs.unknowns]
        np.testing.assert_allclose(lift[dofs.active] + dofs.T @ v, u[dofs.active], atol=1e-14)
    np.testing.assert_array_equal(surfaces.active, contact_dofs(analysis))


def uncondensed(solver, f):
    """The matrix with the right-hand side f, without the choice of a condensed system."""
    loaded = type(solver).load(solver, f)
    loaded.condensed = lambda: loaded
    return loaded


@pytest.mark.each_value
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("name", ["direct", "cholmod"])
def test_steps_end_where_those_of_all_displacements_end(name, friction):
    analysis, other = started(friction=friction, name=name), started(friction=friction, name=name)
    other.problem = replace(other.problem, dofs=ActiveDofs(other.system, contact_dofs(other), np.empty(0, int)))
    other.solver.load = partial(uncondensed, other.solver)
    for index, instant in enumerate(analysis.ramp.instants, start=1):
        result, expected = analysis.step(index, instant), other.step(index, instant)
        scale = np.abs(expected.displacement).max()
        np.testing.assert_allclose(result.displacement, expected.displacement, atol=1e-8 * scale)
        assert result.iterations["geometry_updates"] == expected.iterations["geometry_updates"]
        sizes = [entry["displacement_change"] for entry in result.iterations["history"][1:]]
        same = [entry["displacement_change"] for entry in expected.iterations["history"][1:]]
        np.testing.assert_allclose(sizes, same, atol=1e-9)


def test_solvers_that_do_not_condense_find_all_displacements():
    analysis = started(name="amg")
    assert len(analysis.dofs.active) == len(analysis.u)


def test_the_condensed_problem_is_that_of_all_unknowns():
    analysis = started()
    solver, rng = analysis.solver, np.random.default_rng(3)
    n, k = len(analysis.u), len(solver.last)
    loaded = solver.load(rng.normal(size=n))
    condensed = loaded.condensed()
    assert condensed.condensed() is condensed
    dense = np.zeros((5, n))
    dense[:, solver.last] = np.where(rng.random((5, k)) < 0.2, rng.normal(size=(5, k)), 0.0)
    B, own, c, C = csr_array(dense), csr_array(dense[:, solver.last]), rng.normal(size=5), np.eye(5)
    for compliance in (None, C):
        u, multiplier = loaded.solve(B, c, compliance)
        v, same = condensed.solve(own, c, compliance)
        np.testing.assert_allclose(same, multiplier, rtol=1e-9)
        np.testing.assert_allclose(v, u[solver.last], atol=1e-10 * np.abs(u).max())
    free, none = condensed.solve(own[:0], c[:0])
    np.testing.assert_array_equal(free, loaded.solve(B[:0], c[:0])[0][solver.last])
    assert not len(none)
    for found, expected in zip(condensed.delassus(own), loaded.delassus(B), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-10 * np.abs(expected).max())
    force = rng.normal(size=k)
    near = condensed.full_solution(force)
    everywhere = np.zeros(n)
    everywhere[solver.last] = force
    np.testing.assert_allclose(near, loaded.full_solution(everywhere)[solver.last], atol=1e-10 * np.abs(near).max())
