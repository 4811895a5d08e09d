"""Every linear solver under one test of the protocol."""

import importlib.util
import logging

import numpy as np
import pytest
from models import elastic_model
from scipy.sparse import bsr_array, csr_array, diags_array, random_array
from stepping import Stepping

import fastcontact as fc
from fastcontact.contact.configuration import Configuration
from fastcontact.linear import choice as linear
from fastcontact.linear.krylov.iterations import STORED_DIRECTIONS, ConjugateResiduals

pytestmark = pytest.mark.pairwise


@pytest.fixture(scope="module")
def problem(forma04):
    model = forma04(fc.generate.half_spheres("tri3", size=6.0))
    analysis = Stepping(model, "direct", 1e-12, fc.Criteria())
    rng = np.random.default_rng(0)
    f = np.where(analysis.system.fixed, 0.0, rng.normal(size=model.n_dofs))
    constraints = analysis.pairs["hertz"].constraints(Configuration.undeformed(model.mesh.points))
    B = constraints.B[:4].copy()
    B.data[analysis.system.fixed[B.indices]] = 0.0
    B.eliminate_zeros()
    return analysis, f, csr_array(B), rng.normal(size=4) * 1e-3


def prepared(name, analysis):
    from fastcontact.analysis.problem import near_nullspace

    solver = linear.make(name, dim=2, n_dofs=analysis.model.n_dofs, tolerance=1e-12)
    solver.prepare(analysis.system.matrix, analysis.system.unknowns_of(near_nullspace(analysis.model)))
    return solver


@pytest.mark.parametrize("name", linear.SOLVERS)
@pytest.mark.parametrize("compliance", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("diagonal", [True, False])
def test_equations_hold_and_forces_balance(name, problem, compliance, diagonal):
    analysis, f, B, c = problem
    C = np.diag([1.0, 2.0, 3.0, 4.0]) * compliance
    given = (np.diagonal(C) if diagonal else C) if compliance else None
    u, multiplier = prepared(name, analysis).load(f).solve(B, c, given)
    free = ~analysis.system.fixed
    out = (analysis.K @ u - f - B.T @ multiplier)[free]
    assert np.abs(B @ u + C @ multiplier - c).max() < 1e-9 * np.abs(u).max()
    assert np.abs(out).max() < 1e-9 * np.abs(f).max()
    assert np.abs(u[~free]).max() == 0.0


@pytest.mark.parametrize("name", linear.SOLVERS)
def test_no_equations_is_a_plain_solution_and_the_solver_describes_itself(name, problem):
    analysis, f, B, _ = problem
    solver = prepared(name, analysis)
    u, multiplier = solver.load(f).solve(B[:0], np.empty(0))
    assert len(multiplier) == 0
    assert np.abs((analysis.K @ u - f)[~analysis.system.fixed]).max() < 1e-9 * np.abs(f).max()
    assert solver.counters.setups == 1
    assert solver.counters.iterations >= 1
    assert type(solver).__name__ in repr(solver)
    if not solver.iterative:
        assert solver.improve(2.0)
        np.testing.assert_array_equal(solver.load(f).solve(B[:0], np.empty(0))[0], solver.refined_solution(f))


def test_auto_chooses_by_dimension_and_size():
    assert linear.make("auto", dim=2, n_dofs=1000).name == "direct"
    assert linear.make("auto", dim=3, n_dofs=1_000_000).name == "amg"
    assert linear.make("auto", dim=3, n_dofs=40_000).name == "amg"
    assert linear.make("auto", dim=3, n_dofs=40_000, has_quadratic_cells=True).name == "direct"
    assert linear.make("auto", dim=3, n_dofs=60_000, has_quadratic_cells=True).name == "amg"
    assert linear.make("auto", dim=2, n_dofs=2_000_000).name == "direct"
    assert linear.make("auto", dim=2, n_dofs=4_000_000).name == "amg"
    assert linear.make("auto", dim=3, n_dofs=140_000, needs_columns=True).name == "direct"
    assert linear.make("auto", dim=3, n_dofs=160_000, needs_columns=True).name == "amg"


@pytest.mark.parametrize(
    ("options", "solver"),
    [
        ({"formulation": "node_to_segment"}, "amg"), ({"formulation": "node_to_segment", "friction": 0.3}, "amg"),
        ({"formulation": "mortar", "multipliers": "dual"}, "amg"),
        ({"formulation": "mortar", "multipliers": "dual", "penalty": 1e6}, "amg"),
        ({"formulation": "node_to_segment", "friction": 0.3, "penalty": 1e6, "tangential_penalty": 1e5}, "amg"),
        ({"formulation": "mortar"}, "direct"),  # in the plane a pressure field, which gives way
        ({"formulation": "continuous"}, "direct"),
    ],
)  # fmt: skip
def test_auto_looks_at_what_the_contact_asks_of_a_solver(options, solver, monkeypatch):
    monkeypatch.setattr(linear, "MAX_DIRECT_DOFS", {2: 100, 3: 100})
    model = elastic_model(fc.generate.block_on_block("quad4"), "plane_strain", E=1.0, LOWER_BOTTOM="xy")
    model.prescribe("UPPER_TOP", x=0.0, y=-1e-3)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", **options)
    assert Stepping(model, "auto", 1e-10, fc.Criteria()).solver.name == solver


@pytest.mark.parametrize(
    ("element", "name"), [("hex8", "amg"), ("hex20", "direct"), ("tet4", "amg"), ("tet10", "direct")]
)
def test_auto_looks_at_the_order_of_cells(element, name):
    divisions = {"hex8": 17, "tet4": 17, "hex20": 11, "tet10": 9}[element]
    model = elastic_model(fc.generate.box((1.0, 1.0, 1.0), (divisions,) * 3, element), "3d", E=1.0, ZMIN="xyz")
    assert Stepping(model, "auto", 1e-10, fc.Criteria()).solver.name == name
    assert 15_000 < 3 * model.mesh.n_points < 25_000


def test_auto_says_why(caplog):
    with caplog.at_level(logging.INFO, logger="fastcontact"):
        linear.make("auto", dim=3, n_dofs=60_000)
    assert "linear solver: amg, for 60000 unknowns in 3D a factorisation costs more than multigrid" in caplog.text


@pytest.mark.parametrize(("name", "package", "extra"), [("cholmod", "kvxopt", "cholmod")])
def test_optional_direct_solvers_agree_or_say_what_they_need(name, package, extra, problem):
    if importlib.util.find_spec(package) is None:
        assert name not in linear.SOLVERS
        with pytest.raises(
            fc.ModelError, match=rf"{name}' needs the package {package}: pip install 'fastcontact\[{extra}\]'"
        ):
            linear.make(name, dim=2, n_dofs=10)
        pytest.skip(f"{package} is not installed: only the message was checked")
    analysis, f, B, c = problem
    u, multiplier = prepared(name, analysis).load(f).solve(B, c)
    v, expected = prepared("direct", analysis).load(f).solve(B, c)
    assert np.abs(u - v).max() < 1e-11 * np.abs(v).max()
    assert np.abs(multiplier - expected).max() < 1e-10 * np.abs(expected).max()


@pytest.mark.parametrize("name", [name for name in linear.SOLVERS if name not in ("amg", "pyamg")])
@pytest.mark.parametrize("last", [None, np.array([2, 3])])
def test_a_singular_matrix_is_refused(name, last):
    solver = linear.make(name, dim=2, n_dofs=4)
    K = bsr_array(np.kron([[1.0, -1.0], [-1.0, 1.0]], np.eye(2)), blocksize=(2, 2))
    with pytest.raises(fc.ModelError, match="singular: support the rigid-body motions"):
        solver.prepare(K, np.ones((4, 1)), last)


@pytest.mark.parametrize("name", ["direct", "amg", "pyamg"])
def test_a_solver_says_that_it_is_not_prepared(name):
    assert "not prepared" in repr(linear.make(name, dim=2, n_dofs=10, tolerance=1e-8))


def conjugate_residuals(A, f, most, scale=1.0):
    """Solve A x = f, preconditioned by a factor; return the iteration and the norms of all residuals, which never grow."""
    iteration = ConjugateResiduals(len(f))
    iteration.r[:] = f
    iteration.start()
    norms = [iteration.norm]
    while iteration.norm > 1e-10 * norms[0] and len(norms) <= most:
        assert iteration.step(lambda p, q: np.copyto(q, A @ p), lambda r, norm, z: np.copyto(z, scale * r))
        norms.append(iteration.norm)
    assert iteration.norm <= 1e-10 * norms[0]
    assert (np.diff(norms) <= 1e-12).all()
    return iteration, norms


@pytest.mark.parametrize(
    "n", [2, 7, STORED_DIRECTIONS - 2, 3 * STORED_DIRECTIONS]
)  # the last: more steps than directions
@pytest.mark.parametrize("turned", [0.0, 1e-9, 1e-3])
def test_conjugate_residuals_progress_where_the_image_of_the_residual_is_orthogonal_to_it(n, turned):
    """The matrix passes every unknown on to the next one; a small diagonal lets the residual turn slowly, too."""
    A, f = np.roll(np.eye(n), 1, axis=0) + turned * np.eye(n), np.eye(n)[0]
    iteration, _ = conjugate_residuals(A, f, 2 * n)
    assert np.abs(f - A @ iteration.x).max() < 1e-9


@pytest.mark.parametrize("n", [30, 5000])
def test_conjugate_residuals_solve_nonsymmetric_equations(n):
    rng = np.random.default_rng(n)
    skew = random_array((n, n), density=min(1.0, 5 / n), random_state=rng)
    A, f = csr_array(skew - skew.T) + diags_array(np.linspace(1, 3, n)), rng.normal(size=n)
    iteration, norms = conjugate_residuals(A, f, 200, scale=0.5)
    assert len(norms) < 100
    assert np.abs(A @ iteration.x - f).max() < 1e-8
    assert iteration.nbytes <= (4 + 2 * STORED_DIRECTIONS) * 8 * n + 8 * (n // 4096 + 1)
    iteration.r[:] = 0.0
    iteration.start()
    assert not iteration.step(lambda p, q: np.copyto(q, A @ p), lambda r, norm, z: np.copyto(z, r))  # nowhere to go
