"""The friction solver: Lemke's method, rotating frames, undetermined tractions, steps near full sliding."""

import itertools

import numpy as np
import pytest
from models import DenseCompliance, elastic_model, made_of, pressed_spheres
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import splu

import fastcontact as fc
from fastcontact.analysis import newton, step_halving
from fastcontact.analysis.friction import cone_newton, delassus, dense
from fastcontact.analysis.friction.cone_newton import aligning_rotation, compliance_of_rows, held_tangents
from fastcontact.analysis.friction.delassus import Delassus
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.pairing import normals, tangents


def unit_vectors(rng, n, dim):
    found = rng.normal(size=(n, dim))
    return found / np.linalg.norm(found, axis=1, keepdims=True)


@pytest.mark.parametrize("dim", [2, 3])
def test_tangents_complete_normals(dim):
    normal = unit_vectors(np.random.default_rng(0), 20, dim)
    np.testing.assert_allclose(normals(tangents(normal)), normal, atol=1e-15)


def operator(F):
    return Delassus(np.zeros(len(F)), F)


def componentwise(C, along):
    """The compliance C of force vectors as that of their components, which is added to an operator of zeros."""
    k, m, dim = along.shape
    F = operator(np.zeros(2 * ((1 + k) * m,)))
    rows = csr_array((m, m * dim))
    constraints = Constraints(rows, np.zeros(m), np.zeros((m, dim)), DenseCompliance(C), k * (rows,), tuple(along))
    return delassus.with_compliance(F, constraints, np.arange(m), np.arange(len(F.d))).S


@pytest.mark.parametrize("dim", [2, 3])
def test_the_compliance_of_components_is_that_of_the_vectors(dim):
    rng = np.random.default_rng(dim)
    m = 6
    A = rng.normal(size=(m, m))
    C, normal = A @ A.T, unit_vectors(rng, m, dim)
    along = np.stack(tangents(normal))
    components = rng.normal(size=(dim, m))
    vectors = components[0][:, None] * normal + np.einsum("km,kmd->md", components[1:], along)
    given = C @ vectors  # (m, dim)
    wanted = np.concatenate([[np.einsum("md,md->m", given, normal)], np.einsum("md,kmd->km", given, along)])
    np.testing.assert_allclose(componentwise(C, along) @ components.ravel(), wanted.ravel(), atol=1e-12)


def test_constraints_without_friction_keep_their_own_compliance():
    C = np.array([[2.0, 1.0], [1.0, 3.0]])
    found = componentwise(C, np.zeros((1, 2, 2)))
    np.testing.assert_array_equal(found[:2, :2], C)
    assert not found[2:].any()


def test_dropping_a_column_of_the_field_adds_what_it_represented():
    rng = np.random.default_rng(4)
    P, areas, rho = np.abs(rng.normal(size=(9, 4))), rng.uniform(0.5, 1.5, 9), 3.0

    def projection(columns):
        part = csr_array(P[:, columns])
        return Projection(part, areas, rho, splu((part.T @ diags_array(areas) @ part).tocsc()))

    everything = np.arange(9)
    Z = projection([0, 1, 2, 3]).compliance_factor(np.array([1, 3]))
    wanted = projection([0, 2]).block(everything) - projection([0, 1, 2, 3]).block(everything)
    np.testing.assert_allclose(Z @ Z.T, wanted, atol=1e-13)


def test_tangents_turn_to_the_slip_that_supports_leave():
    # Two constraints that see only y and z of two nodes, in oblique frames: each has one direction of slip.
    rng = np.random.default_rng(9)
    normal = unit_vectors(rng, 2, 3)
    R = np.zeros((6, 6))
    for part, along in enumerate([normal, *tangents(normal)]):
        for i in range(2):
            R[2 * part + i, 3 * i : 3 * i + 3] = along[i]
    A = rng.normal(size=(6, 6))
    K_inverse = A @ A.T
    held = [0, 3]
    K_inverse[held], K_inverse[:, held] = 0.0, 0.0
    F = R @ K_inverse @ R.T
    number = np.arange(6).reshape(3, 2)
    assert not len(np.flatnonzero(held_tangents(operator(F).diagonal_blocks(number))))
    Q = aligning_rotation(operator(F).diagonal_blocks(number))
    np.testing.assert_allclose((Q @ Q.T).toarray(), np.eye(6), atol=1e-15)
    np.testing.assert_array_equal(
        held_tangents(operator(F).rotated(Q).diagonal_blocks(number)), [[False, False], [True, True]]
    )
    assert aligning_rotation(operator(R @ (A @ A.T) @ R.T).diagonal_blocks(number)) is None


def test_frames_of_eliminated_slips_do_not_depend_on_the_choice_of_tangents():
    """Iterations beside a much stiffer side did: 132 to 267 of one model (`test_multigrid_counts`, hex20)."""
    rng, m = np.random.default_rng(3), 8
    normal = unit_vectors(rng, m, 3)
    one, other = tangents(normal)
    turn = rng.uniform(0.0, 2.0 * np.pi, m)[:, None]
    frames = []
    for along in ((one, other), (np.cos(turn) * one + np.sin(turn) * other, np.cos(turn) * other - np.sin(turn) * one)):
        rows = np.stack([normal, *along])
        own = np.einsum("amd,d,bmd->abm", rows, [1.0, 2.0, 3.0], rows)
        Q = aligning_rotation(own, along)
        np.testing.assert_allclose((Q @ Q.T).toarray(), np.eye(3 * m), atol=1e-15)
        frames.append((Q @ rows.reshape(3 * m, 3)).reshape(3, m, 3))
    np.testing.assert_allclose(frames[0], frames[1], atol=1e-14)
    nearest = np.argmin(np.abs(normal), axis=1)
    np.testing.assert_allclose(frames[0][1, np.arange(m), nearest], 0.0, atol=1e-14)


def test_what_does_not_settle_is_told_with_its_numbers(monkeypatch):
    monkeypatch.setattr(cone_newton, "MAX_NEWTON_ITERATIONS", 0)
    monkeypatch.setattr(dense, "LARGEST", 0)
    mesh = fc.generate.block_on_block(divisions_lower=(6, 2), divisions_upper=(3, 3))
    model = elastic_model(mesh, "plane_strain", LOWER_BOTTOM="xy", UPPER_TOP={"x": 1e-3, "y": -1e-4})
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", friction=0.3)
    with pytest.raises(fc.ConvergenceError, match=r"with friction did not converge .* of the largest force\..*0\.3"):
        fc.solve(model, fc.linear_ramp(1))


def spheres(friction=0.0):
    return pressed_spheres(
        fc.generate.half_spheres("tri3", size=8.0), name="pair", formulation="node_to_segment", friction=friction
    )


def pressed(criteria, steps):
    return fc.solve(spheres(), fc.linear_ramp(steps), criteria=criteria)


def test_a_kept_pairing_forgets_the_steps_and_a_new_one_does_not():
    kept = [pressed(fc.Criteria(keep_pairing=True), steps)[-1].displacement for steps in (1, 5)]
    renewed = [pressed(fc.Criteria(geometry_updates=0), steps)[-1].displacement for steps in (1, 5)]
    size = np.abs(kept[0]).max()
    assert np.abs(kept[0] - kept[1]).max() < 1e-12 * size
    assert np.abs(kept[0] - renewed[0]).max() < 1e-12 * size  # the first pairing is that of the undeformed bodies
    assert np.abs(renewed[0] - renewed[1]).max() > 1e-6 * size


@pytest.mark.filterwarnings("ignore:.*inclined to the smooth surface")
def test_a_kept_pairing_serves_friction_through_steps():
    model = spheres(friction=0.02)
    (along,) = model.bind(model.contact[0]).constraints(Configuration.undeformed(model.mesh.points)).directions
    normal, slid = normals([along]), 0
    for step in fc.solve(model, fc.linear_ramp(5), criteria=fc.Criteria(keep_pairing=True)):
        contact = step.contact["pair"]
        assert step.iterations["geometry_updates"] == 0
        n, t = (np.einsum("nd,nd->n", contact.force_vectors, frame) for frame in (normal, along))
        size = 1e-12 * n.max()
        assert n.min() >= -size
        assert (np.abs(t) <= 0.02 * n + size).all()
        sliding = contact.active & ~contact.sticking
        np.testing.assert_allclose(np.abs(t[sliding]), 0.02 * n[sliding], rtol=1e-9)
        slid += sliding.sum()
    assert slid  # the frames of the undeformed bodies lean


def test_a_guess_does_not_leave_the_gap_of_a_soft_constraint_open():
    F, free = np.diag([1.0, 1e7, 1.0, 1.0]), np.array([[-1.0, -1e-3], [0.1, 0.0]])
    guess = np.array([[1.0, 1e-10 * (1.0 - 1e-7)], [-0.1, 0.0]])
    forces = dense.solve(operator(F), free, np.array([0.3, 0.3]), np.ones(2, bool), guess)
    assert forces.settled
    np.testing.assert_allclose(forces.gaps[0], 0.0, atol=1e-14)


def test_components_without_friction_need_no_rows():
    rng, m = np.random.default_rng(6), 8
    A, mu = rng.normal(size=(3 * m, 3 * m)), np.array(4 * [0.0, 0.4])
    free = np.vstack([rng.normal(0.0, 4.0, m), np.where(mu > 0.0, rng.normal(size=(2, m)), 0.0)])
    components = np.flatnonzero(np.vstack([np.ones(m), mu, mu]))
    given, F = np.ix_(components, components), np.eye(3 * m)
    F[given] = (A @ A.T)[given]
    whole = dense.solve(operator(F), free, mu, free[0] < 0.0)
    part = dense.solve(operator(F[given]), free, mu, free[0] < 0.0, components=components)
    assert part.settled
    assert 2 < part.closed.sum() < m
    np.testing.assert_allclose(part.y, whole.y, atol=1e-12 * np.abs(whole.y).max())
    np.testing.assert_allclose(part.gaps.ravel()[components], whole.gaps.ravel()[components], atol=1e-11)


def pressed_blocks(beside, driven):
    """Return two blocks, pressed and sheared, cut by a plane of symmetry, or `beside` a rigid plane without friction.

    The upper block is `driven` or loaded.
    """
    lower = fc.generate.box((2.0, 2.0, 1.0), (4, 4, 2))
    upper = fc.generate.box((1.0, 1.0, 0.5), (3, 3, 2), origin=(0.5, 0.0, 1.0))
    mesh = fc.generate.union(lower, fc.generate.renamed(upper, lambda name: f"upper {name}"))
    model = elastic_model(mesh, "3d", E=1000.0, nu=0.3, YMIN="y", **{"upper YMIN": "y"})
    if driven:
        model.prescribe("upper ZMAX", z=-0.01, x=0.004)
    else:
        model.add_traction("upper ZMAX", z=-5.0, x=0.8)
    formulation = "mortar" if beside else "continuous"
    model.add_contact("joint", secondary="upper ZMIN", primary="ZMAX", friction=0.3, formulation=formulation)
    if beside:
        plane = fc.obstacles.HalfSpace((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
        model.add_obstacle("plane", secondary="ZMIN", obstacle=plane, formulation="continuous")
        model.fix("XMIN", "x")
    else:
        model.fix("ZMIN", "xyz")
    return model


@pytest.mark.filterwarnings("ignore:.*oscillate from node to node")
@pytest.mark.parametrize(("beside", "driven"), [(False, True), (True, True), (False, False)])
def test_pressure_fields_are_solved_as_with_the_whole_matrix(beside, driven, monkeypatch):
    model, operators, inner = pressed_blocks(beside, driven), [], delassus.of_rows
    monkeypatch.setattr(delassus, "of_rows", lambda *system: operators.append(inner(*system)) or operators[-1])
    (factored,) = fc.solve(model, 1)
    is_factored = [F.U is not None for _, F in operators]
    # A block that contact alone holds is first solved on soft springs, with the whole matrix.
    assert all(is_factored) if driven and not beside else any(is_factored)
    monkeypatch.setattr(delassus, "of_rows", lambda loaded, R, _: inner(loaded, R, False))
    (whole,) = fc.solve(model, 1)
    for name, contact in whole.contact.items():
        found, size = factored.contact[name], np.abs(contact.force_vectors).max()
        np.testing.assert_allclose(found.force_vectors, contact.force_vectors, atol=1e-10 * size)
        np.testing.assert_array_equal(found.sticking, contact.sticking)
    count = [
        sum(pairing["active_set_iterations"] for pairing in step.iterations["history"]) for step in (factored, whole)
    ]
    assert count[0] <= count[1]


def test_pivots_against_all_bases():
    rng = np.random.default_rng(0)
    for _ in range(50):
        n = 5
        A = rng.normal(size=(n, n))
        M, q = A @ A.T + 0.1 * np.eye(n) + (A - A.T), rng.normal(size=n)
        z, count = dense.lemke(M, q, 100)
        assert count == 0 or (count > 1 and dense.lemke(M, q, count - 1)[0] is None)
        wanted = None
        for basis in itertools.product([False, True], repeat=n):
            on, x = np.flatnonzero(basis), np.zeros(n)
            x[on] = np.linalg.solve(M[np.ix_(on, on)], -q[on])
            if (x >= 0).all() and (M @ x + q >= -1e-12).all():
                wanted = x
        np.testing.assert_allclose(z, wanted, atol=1e-10)


def test_pivots_tell_a_problem_without_a_solution():
    assert dense.lemke(np.array([[-1.0]]), np.array([-1.0]), 10)[0] is None
    z, count = dense.lemke(np.array([[1.0]]), np.array([2.0]), 10)
    assert (z.tolist(), count) == ([0.0], 0)


def test_compliance_of_rows_against_dense_products():
    rng = np.random.default_rng(11)
    rows = tuple(csr_array(rng.normal(size=(8, 30)) * (rng.random((8, 30)) < 0.3)) for _ in range(3))
    yielding = rng.random(30)
    stack = np.stack([R.toarray() for R in rows])
    assert compliance_of_rows(rows, yielding) == pytest.approx(np.einsum("ain,n,bin->abi", stack, yielding, stack))


@pytest.mark.parametrize(
    ("push", "told"), [(0.58, "at its beginning, contact uses 97% of its frictional capacity"), (0.3, "")]
)
def test_the_message_states_how_much_friction_is_used(monkeypatch, push, told):
    """A block under the pressure 0.3 on a plane with the friction 0.3 slides at a push of 0.18 on its side."""
    model = fc.Model(fc.generate.block((2.0, 1.0), (8, 4)), kinematics="plane_strain", strain="finite")
    model.add_material(fc.NeoHookean(E=1e4, nu=0.45))
    model.add_pressure("TOP", 0.3, ramp=[(0.0, 0.0), (1.0, 1.0), (3.0, 1.0)])
    model.add_traction("LEFT", x=0.3, ramp=[(0.0, 0.0), (1.0, 0.0), (2.0, push), (3.0, push)])
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=0.3)
    load_step = step_halving.load_step

    def failing(problem, state, index, end):
        if end == 3.0:
            raise fc.ConvergenceError("no equilibrium", [], smaller_steps_help=False)
        return load_step(problem, state, index, end)

    monkeypatch.setattr(step_halving, "load_step", failing)
    with pytest.raises(fc.ConvergenceError, match="no equilibrium") as failed:
        fc.solve(model, [1.0, 2.0, 3.0])
    assert told in str(failed.value)
    assert bool(told) == ("frictional capacity" in str(failed.value))


def test_a_verdict_about_a_diverged_iterate_does_not_end_the_analysis(monkeypatch):
    """An iterate far from equilibrium may seem to lie beyond the friction cone; a smaller step is tried."""
    mesh, law = fc.generate.block((2.0, 1.0), (8, 4)), fc.NeoHookean(E=1e4, nu=0.45)
    model = made_of(mesh, "plane_strain", law, strain="finite", BOTTOM="xy")
    model.add_pressure("TOP", 500.0)
    solved, calls = newton._Newton._solve, []

    def diverging(self, u, changes):
        calls.append(len(changes))
        if len(calls) == 2:
            raise fc.ConvergenceError("friction cannot hold it", smaller_steps_help=False)
        return solved(self, u, changes)

    monkeypatch.setattr(newton._Newton, "_solve", diverging)
    step = fc.solve(model, 1)[-1]
    assert calls[:3] == [1, 2, 1]
    assert step.iterations["substeps"][-1] == 1.0
