"""Friction with eliminated constraints: grouped pivots, nonsymmetric rows, iteration and results."""

import numpy as np
import pytest
from models import elastic_model, united, with_contact
from scipy.sparse import csr_array, vstack
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis.friction import eliminated
from fastcontact.contact.configuration import Configuration
from fastcontact.linear.multigrid import solver
from fastcontact.linear.protocol import FrictionTerms
from fastcontact.linear.solvers import amg
from fastcontact.linear.springs import Springs

BOTH = {"secondary": "CONT_SPHERE", "primary": "CONT_BLOCK"}


def rubbing(formulation="node_to_segment", mu=0.3):
    """A part of a sphere pressed on a block and then pushed along it: it sticks here and slides there."""
    mesh = fc.generate.sphere_on_block("hex8", R=20.0, size=8.0, contact_size=1.2, contact_radius=6.0, growth=1.0)
    model = elastic_model(mesh, "3d", E=20_000.0, BLOCK_BOTTOM="xyz")
    model.prescribe("SPHERE_TOP", y=-0.6, z=0.0, ramp=[(0, 0), (0.5, 1), (1, 1)])
    model.prescribe("SPHERE_TOP", x=0.5, ramp=[(0, 0), (0.5, 0), (1, 1)])
    return with_contact(model, "pair", **BOTH, formulation=formulation, friction=mu)


def small_blocks(mu=0.3):
    """Pressed, then dragged along both axes: sliding turns."""
    lower, upper = fc.generate.box(divisions=(3, 3, 2)), fc.generate.box(divisions=(2, 2, 2), origin=(0.0, 0.0, 1.0))
    model = elastic_model(united(L_=lower, U_=upper), "3d", L_ZMIN="xyz")
    model.prescribe("U_ZMAX", z=-1e-2, ramp=[(0, 0), (0.5, 1), (1, 1)])
    model.prescribe("U_ZMAX", x=2e-2, y=8e-3, ramp=[(0, 0), (0.5, 0.1), (1, 1)])
    return with_contact(model, "pair", "U_ZMIN", "L_ZMAX", formulation="node_to_segment", friction=mu)


def test_small_blocks_slide_in_any_direction():
    exact, found = (fc.solve(small_blocks(), fc.linear_ramp(4), linear_solver=name)[-1] for name in ("direct", "amg"))
    assert np.abs(found.displacement - exact.displacement).max() < 1e-8 * 2e-2
    assert not found.contact["pair"].sticking.all()


@pytest.mark.parametrize(
    ("formulation", "mu"),
    [("mortar", 0.7), *(pytest.param(f, 0.1, marks=pytest.mark.slow) for f in ("node_to_segment", "mortar"))],
)
def test_elimination_and_compliance_agree_and_no_column_is_asked_for(formulation, mu):
    model = rubbing(formulation, mu)
    exact = fc.solve(model, fc.linear_ramp(6), linear_solver="direct")
    analysis = Stepping(model, "amg", 1e-10, fc.Criteria(), fc.linear_ramp(6))
    slid = 0
    for index, (one, instant) in enumerate(zip(exact, analysis.ramp.instants, strict=True), start=1):
        a, b = one.contact["pair"], analysis.step(index, instant).contact["pair"]
        largest = np.abs(a.force_vectors).max()
        assert np.abs(a.force_vectors - b.force_vectors).max() < 1e-6 * largest
        np.testing.assert_array_equal(
            a.sticking & (a.multiplier > 1e-6 * largest), b.sticking & (b.multiplier > 1e-6 * largest)
        )
        slid += int((b.active & ~b.sticking).sum())
    assert slid > 5
    assert analysis.solver.columns.requests == []


def test_what_fails_on_eliminated_constraints_is_solved_on_their_compliance(monkeypatch, caplog):
    def failing(*_):
        raise fc.ConvergenceError("the iteration on eliminated constraints did not converge")

    monkeypatch.setattr(eliminated, "solve", failing)
    monkeypatch.setattr(amg, "MAX_ITERATIONS", 100_000)  # columns of multigrid, not of factors
    caplog.set_level("INFO", "fastcontact")
    model = small_blocks()
    one, other = (fc.solve(model, fc.linear_ramp(2), linear_solver=name)[-1] for name in ("direct", "amg"))
    assert "did not converge; the compliance is formed instead" in caplog.text
    assert np.abs(one.displacement - other.displacement).max() < 1e-7 * np.abs(one.displacement).max()


def test_nonsymmetric_equations_with_springs_against_a_dense_solution():
    analysis = Stepping(rubbing(), "amg", 1e-12, fc.Criteria())
    solver, n = analysis.solver, analysis.model.n_dofs
    rng = np.random.default_rng(5)
    f = np.where(analysis.system.free, rng.normal(size=n), 0.0)
    constraints = analysis.pairs["pair"].constraints(Configuration.undeformed(analysis.model.mesh.points))
    near = np.argsort(constraints.gap0)[:4]
    normal, first, second = (
        analysis.system.rows(rows[near], np.zeros(4), np.zeros(n))[0] for rows in (constraints.B, *constraints.tangents)
    )
    through, c = csr_array(normal + 0.3 * first), 1e-3 * rng.normal(size=4)
    springs = Springs(second, np.full(4, 50.0))
    push = -0.2 * np.asarray(second.T @ np.ones(4))
    u, multiplier = solver.load(f).solve_nonsymmetric(
        normal, c, np.arange(4), np.zeros(n), 1e-12, FrictionTerms(through, springs, push)
    )
    out = analysis.system.matrix @ u + 50.0 * second.T @ (second @ u) - f - push - through.T @ multiplier
    assert np.abs(normal @ u - c).max() < 1e-12
    assert np.abs(out).max() < 1e-8 * np.abs(f).max()


def test_an_iteration_that_does_not_end_is_told(monkeypatch):
    monkeypatch.setattr(solver, "MAX_ITERATIONS", 1)
    analysis = Stepping(rubbing(), "amg", 1e-12, fc.Criteria())
    n = analysis.model.n_dofs
    rows = csr_array((np.ones(2), ([0, 0], np.flatnonzero(analysis.system.free)[[0, 40]])), shape=(1, n))
    drag = FrictionTerms(csr_array(2.0 * rows))
    f = np.where(analysis.system.free, 1.0, 0.0)
    with pytest.raises(fc.ConvergenceError, match=r"conjugate residuals stall at .* times the tolerance after 1 step"):
        analysis.solver.load(f).solve_nonsymmetric(rows, np.zeros(1), np.zeros(1, np.int64), np.zeros(n), 1e-12, drag)


def test_where_multigrid_stalls_factors_take_over_and_say_so(monkeypatch):
    monkeypatch.setattr(solver, "MAX_ITERATIONS", 0)
    model, ramp = small_blocks(0.0), fc.linear_ramp(4)
    exact = fc.solve(model, ramp, linear_solver="direct")
    with pytest.warns(fc.FastcontactWarning, match=r"multigrid gave up .* relative residual of .* after 0 iterations"):
        found = fc.solve(model, ramp, linear_solver="amg", on_step=(states := []).append)
    assert np.abs(found[-1].displacement - exact[-1].displacement).max() < 1e-9 * np.abs(exact[-1].displacement).max()
    assert "a factorisation replaced it" in found[-1].warnings[0]
    with pytest.warns(fc.FastcontactWarning, match="multigrid gave up"):
        rest = fc.solve(model, ramp, linear_solver="amg", resume=states[:2])
    np.testing.assert_array_equal(rest[-1].displacement, found[-1].displacement)
    assert rest[-1].warnings == found[-1].warnings


def test_factors_that_took_over_solve_friction_on_its_compliance(monkeypatch):
    monkeypatch.setattr(solver, "MAX_ITERATIONS", 0)
    exact = fc.solve(small_blocks(), fc.linear_ramp(3), linear_solver="direct")[-1]
    with pytest.warns(fc.FastcontactWarning, match="multigrid gave up"):
        found = fc.solve(small_blocks(), fc.linear_ramp(3), linear_solver="amg")[-1]
    assert np.abs(found.displacement - exact.displacement).max() < 1e-8 * np.abs(exact.displacement).max()


def test_nothing_is_eliminated_once_factors_have_taken_over():
    analysis = Stepping(small_blocks(), "amg", 1e-10, fc.Criteria())
    n = analysis.model.n_dofs
    analysis.solver.give_up(solver.StallError("stalled"))
    none = csr_array((0, n))
    with pytest.raises(fc.ConvergenceError, match="the friction problem is solved with the Delassus operator"):
        analysis.solver.load(np.zeros(n)).solve_nonsymmetric(
            none, np.empty(0), np.empty(0, np.int64), np.zeros(n), 1e-10
        )
    assert "gave up" in repr(analysis.solver)


def test_constraints_that_repeat_each_other_are_solved_on_their_compliance(caplog):
    """Two contacts on the same nodes: their forces share what one alone would carry."""
    caplog.set_level("INFO", "fastcontact")
    model = small_blocks(0.0)
    once = fc.solve(model, fc.linear_ramp(1), linear_solver="amg")[-1]
    analysis = Stepping(model, "amg", 1e-10, fc.Criteria())
    constraints = analysis.pairs["pair"].constraints(Configuration.undeformed(model.mesh.points))
    rows = np.flatnonzero(once.contact["pair"].active)[:2]
    n = model.n_dofs
    B, offset = analysis.system.rows(constraints.B[rows], constraints.gap0[rows], np.zeros(n))
    f = np.where(analysis.system.free, 1.0, 0.0)
    alone, multiplier = analysis.solver.load(f).solve(B, -offset)
    twice = csr_array(vstack([B, B], format="csr"))
    both, shared = analysis.solver.load(f).solve(twice, -np.r_[offset, offset])
    assert "are linearly dependent" in caplog.text
    np.testing.assert_allclose(both, alone, atol=1e-7 * np.abs(alone).max())
    np.testing.assert_allclose(shared[:2] + shared[2:], multiplier, rtol=1e-6)


def test_slips_that_supports_and_equations_hold_leave_no_spring():
    """Nodes in the corner of two planes of symmetry slide along neither."""
    mesh = fc.generate.sphere_on_block("hex8", R=1.0, size=0.3, contact_size=0.1, contact_radius=0.2)
    model = elastic_model(mesh, "3d", E=20000.0, BLOCK_BOTTOM="xyz", SYMMETRY_X="x", SYMMETRY_Z="z")
    model.prescribe("SPHERE_TOP", y=-0.01)
    model.add_contact("pair", secondary="CONT_SPHERE", primary="CONT_BLOCK", friction=0.2)
    one, other = (fc.solve(model, fc.linear_ramp(2), linear_solver=name)[-1] for name in ("amg", "direct"))
    assert one.displacement == pytest.approx(other.displacement, abs=1e-7 * np.abs(other.displacement).max())
    assert one.contact["pair"].force == pytest.approx(other.contact["pair"].force, rel=1e-6)
