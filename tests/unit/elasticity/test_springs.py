"""Springs and supports: exact solutions, reactions, elimination from the matrix, messages."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from models import elastic_model, supported
from scipy.sparse import bsr_array

import fastcontact as fc
from fastcontact.elasticity.constrained_system import separate_supports

E, WIDTH, HEIGHT, PRESSURE = 1000.0, 2.0, 3.0, 10.0


def block_on_springs(stiffness=50.0, kinematics="plane_strain", element="quad4"):
    """One element wide, so that equal springs at both bottom corners bear a uniform pressure uniformly."""
    model = elastic_model(fc.generate.block((WIDTH, HEIGHT), (1, 3), element), kinematics, E=E, nu=0.0)
    model.add_pressure("TOP", PRESSURE)
    model.add_spring("BOTTOM_LEFT", y=stiffness)
    model.add_spring("BOTTOM_RIGHT", y=stiffness)
    return model


def last(model, **options):
    return fc.solve(model, fc.linear_ramp(1), **options)[-1]


def test_a_block_on_springs_settles_by_load_over_stiffness_and_reactions_hold_the_springs():
    model = block_on_springs()
    model.fix("LEFT", "x")
    step = last(model)
    bottom, top = (model.mesh.points_of(group) for group in ("BOTTOM", "TOP"))
    settled = PRESSURE * WIDTH / 100.0
    np.testing.assert_allclose(step.displacement[bottom, 1], -settled, rtol=1e-13)
    np.testing.assert_allclose(step.displacement[top, 1], -settled - PRESSURE * HEIGHT / E, rtol=1e-13)
    np.testing.assert_allclose(step.stress[:, 1], -PRESSURE, rtol=1e-12)
    np.testing.assert_allclose(step.reaction.sum(axis=0), [0.0, PRESSURE * WIDTH], atol=1e-11)
    np.testing.assert_allclose(step.reaction[bottom, 1], 0.5 * PRESSURE * WIDTH, rtol=1e-12)
    np.testing.assert_allclose([s.tension(step.displacement) for s in model.springs], -0.5 * PRESSURE * WIDTH)
    other = last(model, linear_solver="amg", linear_tolerance=1e-12)
    assert np.abs(step.displacement - other.displacement).max() < 1e-10 * np.abs(step.displacement).max()


def test_a_support_beside_a_spring_bears_the_rest():
    model = block_on_springs()
    supported(model, LEFT="x", BOTTOM_LEFT={"y": -0.1}, BOTTOM_RIGHT={"y": -0.1})
    step = last(model)
    np.testing.assert_allclose(step.reaction[:, 1].sum(), PRESSURE * WIDTH, rtol=1e-12)  # of which springs bear 10


def test_springs_alone_hold_a_body():
    model = block_on_springs()
    model.add_spring("BOTTOM_LEFT", x=1.0)
    step = last(model)
    np.testing.assert_allclose(step.displacement[model.mesh.points_of("BOTTOM"), 1], -0.2, rtol=1e-12)
    assert np.abs(step.displacement[:, 0]).max() < 1e-10


def test_stiffness_is_that_of_the_full_circle():
    model = elastic_model(fc.generate.block((WIDTH, HEIGHT), (4, 3)), "axisymmetric", E=E, nu=0.0)
    model.couple("BOTTOM", "y")
    model.add_spring("BOTTOM_LEFT", y=70.0)
    model.fix("LEFT", "x")
    model.add_pressure("TOP", PRESSURE)
    settled = PRESSURE * np.pi * WIDTH**2 / 70.0
    np.testing.assert_allclose(last(model).displacement[model.mesh.points_of("BOTTOM"), 1], -settled, rtol=1e-12)


@pytest.mark.parametrize("kind", ["axial", "y"])
def test_two_blocks_joined_by_springs_hang_in_series(kind):
    mesh = fc.generate.block_on_block(
        size_lower=(WIDTH, 1.0), size_upper=(WIDTH, 1.0), divisions_lower=(1, 2), divisions_upper=(1, 2)
    )
    apart = mesh.points.copy()
    apart[mesh.points_of("UPPER"), 1] += 0.5
    model = elastic_model(mesh.replace(points=apart), "plane_strain", E=E, nu=0.0, LOWER_BOTTOM="xy", UPPER_LEFT="x")
    model.add_traction("UPPER_TOP", y=PRESSURE)
    for lower, upper in (("LOWER_TOP_LEFT", "UPPER_BOTTOM_LEFT"), ("LOWER_TOP_RIGHT", "UPPER_BOTTOM_RIGHT")):
        model.add_spring(lower, upper, **{kind: 40.0})
    step = last(model)
    pull = PRESSURE * WIDTH
    np.testing.assert_allclose(
        step.displacement[model.mesh.points_of("UPPER_TOP"), 1], 2 * PRESSURE / E + pull / 80.0, rtol=1e-12
    )
    np.testing.assert_allclose([s.tension(step.displacement)[0] for s in model.springs], pull / 2, rtol=1e-11)
    np.testing.assert_allclose(step.reaction.sum(axis=0), [0.0, -pull], atol=1e-10)


def test_an_oblique_spring_resists_along_its_line_only():
    mesh = fc.generate.box((1.0, 1.0, 1.0), (1, 1, 1))
    corner = int(np.argmax(mesh.points.sum(axis=1)))
    opposite = int(np.argmin(mesh.points.sum(axis=1)))
    model = fc.Model(mesh, "3d")
    model.add_spring(opposite, corner, axial=3.0)
    (spring,) = model.springs
    along = np.zeros((mesh.n_points, 3))
    along[corner] = (0.3, 0.2, 0.1)
    np.testing.assert_allclose(spring.tension(along), 3.0 * 0.6 / np.sqrt(3.0), rtol=1e-14)
    along[corner] = (1.0, -1.0, 0.0)
    np.testing.assert_allclose(spring.tension(along), 0.0, atol=1e-15)


@pytest.mark.parametrize("dim", [2, 3])
@pytest.mark.parametrize("to_ground", [False, True])
def test_a_spring_has_one_stiffness_along_its_line_and_another_across(dim, to_ground):
    """For any displacement, the force is axial along the direction, transverse across it, whatever the axes."""
    mesh = fc.generate.box((1.0, 1.0, 1.0), (1, 1, 1)) if dim == 3 else fc.generate.block((WIDTH, HEIGHT), (1, 1))
    first, second = 0, mesh.n_points - 1
    model = fc.Model(mesh, "3d" if dim == 3 else "plane_strain")
    direction = np.array([1.0, -2.0, 0.5])[:dim]
    ends = {} if to_ground else {"to": second}
    model.add_spring(first, **ends, axial=7.0, transverse=3.0, direction=direction.tolist())
    (spring,) = model.springs
    unit = direction / np.linalg.norm(direction)
    for move in np.random.default_rng(1).normal(size=(5, dim)):
        u = np.zeros(mesh.points.shape)
        u[first] = move
        force = (spring.rows.T @ spring.tension(u)).reshape(u.shape)
        along = (move @ unit) * unit
        np.testing.assert_allclose(force[first], 7.0 * along + 3.0 * (move - along), rtol=1e-13, atol=1e-14)
        np.testing.assert_allclose(force[second], 0.0 if to_ground else -force[first], atol=1e-14)


def test_springs_of_equal_stiffness_in_all_directions_need_no_direction():
    mesh = fc.generate.block((WIDTH, HEIGHT), (1, 1))
    model = fc.Model(mesh, "plane_strain")
    model.add_spring(0, mesh.n_points - 1, axial=4.0, transverse=4.0)
    model.add_spring(0, mesh.n_points - 1, x=4.0, y=4.0)
    own, axes = ((s.rows.T @ np.diag(s.stiffness) @ s.rows.toarray()) for s in model.springs)
    np.testing.assert_allclose(own, axes, atol=1e-13)


def test_a_far_end_without_a_body_may_be_fixed_or_is_told():
    mesh = fc.generate.block((WIDTH, HEIGHT), (1, 1))
    points = np.vstack([mesh.points, [[-1.0, 0.0]]])
    mesh = mesh.replace(points=points, point_groups={**mesh.point_groups, "ANCHOR": [len(points) - 1]})

    def pulled(anchored):
        model = elastic_model(mesh, "plane_strain", E=E, nu=0.0, BOTTOM_LEFT="y", BOTTOM_RIGHT="y")
        model.add_spring("ANCHOR", "BOTTOM_LEFT", axial=5.0)
        model.add_force("BOTTOM_LEFT", x=2.0, distribute=False)
        if anchored:
            model.fix("ANCHOR", "xy")
        return model

    step = last(pulled(True))
    assert step.displacement[mesh.point("BOTTOM_LEFT"), 0] == pytest.approx(0.4, rel=1e-12)
    assert step.reaction[mesh.point("ANCHOR"), 0] == pytest.approx(-2.0, rel=1e-12)
    with pytest.raises(fc.ModelError, match="not restrained"):
        pulled(False).check()


def test_a_spring_shares_the_load_with_a_contact():
    # Pushed 0.2 down onto a plane 0.1 below, the springs bear 0.1 each way and the contact the rest.
    model = elastic_model(fc.generate.block((WIDTH, HEIGHT), (1, 3)), "plane_strain", E=E, nu=0.0, LEFT="x")
    model.prescribe("TOP", y=-0.2)
    model.add_spring("BOTTOM_LEFT", y=50.0)
    model.add_spring("BOTTOM_RIGHT", y=50.0)
    plane = fc.obstacles.HalfSpace((0.0, -0.1), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=plane, formulation="node_to_segment")
    step = last(model)
    total = E * 0.1 / HEIGHT * WIDTH
    assert step.contact["floor"].force[1] == pytest.approx(total - 100.0 * 0.1, rel=1e-10)


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress", "axisymmetric"])
def test_the_stiffness_of_the_ground_has_no_limit(kinematics):
    """It adds to the diagonal alone: a spring of any stiffness is a support."""
    held, hung = block_on_springs(1e30, kinematics), block_on_springs(1.0, kinematics)
    hung.springs.clear()
    supported(hung, BOTTOM_LEFT="y", BOTTOM_RIGHT="y")
    for model in (held, hung):
        model.fix("LEFT", "x")
    np.testing.assert_allclose(last(held).displacement, last(hung).displacement, rtol=1e-10, atol=1e-15)


@pytest.mark.parametrize("how", ["oblique", "points", "groups", "axial"])
def test_springs_that_cost_digits_are_told_and_those_that_leave_none_refused(how):
    def model(stiffness):
        found = block_on_springs(element="quad8")  # which bends without a word
        found.fix("LEFT", "x")
        if how == "oblique":
            found.add_spring("TOP_RIGHT", axial=stiffness, direction=(1.0, 2.0))
        elif how == "points":
            found.add_spring("TOP_RIGHT", "BOTTOM_RIGHT", y=stiffness)
        elif how == "axial":
            found.add_spring("TOP_RIGHT", "BOTTOM_LEFT", axial=stiffness)
        else:
            found.add_spring("TOP", "BOTTOM", y=stiffness)
        return found

    assert not last(model(10.0 * E)).warnings
    with pytest.warns(fc.FastcontactWarning, match=r"times as stiff as the body .* lose up to \d+ of 16 digits"):
        step = last(model(1e7 * E))
    assert len(step.warnings) == 1  # the result file keeps it
    with pytest.warns(fc.FastcontactWarning, match="times as stiff"), contextlib.suppress(fc.ConvergenceError):
        last(model(1e9 * E))  # told before round-off keeps forces out of balance
    for stiffness, left in ((1e13 * E, r"only \d of 16 correct digits"), (1e30 * E, "no correct digit")):
        with pytest.raises(fc.ModelError, match=f"the spring .* times as stiff .*: results would have {left}; use"):
            last(model(stiffness))


def matrix(rng, n, size):
    """Symmetric with blocks, some of them missing, on the diagonal, too; some numbers are zero."""
    there = np.triu(rng.random((n, n)) < 0.4)
    there |= there.T
    full = rng.normal(size=(n * size, n * size)) * (rng.random((n * size, n * size)) < 0.8)
    full = np.kron(there, np.ones((size, size))) * (full + full.T)
    return bsr_array(full, blocksize=(size, size)), full


@pytest.mark.parametrize("size", [2, 3])
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 7), share=st.sampled_from([0.0, 0.3, 1.0]))
def test_the_parts_make_the_whole(size, seed, n, share):
    rng = np.random.default_rng(seed)
    K, full = matrix(rng, n, size)
    fixed = rng.random(n * size) < share
    left, taken = separate_supports(K, fixed)
    expected = full.copy()
    expected[fixed], expected[:, fixed] = 0.0, 0.0
    diagonal = full.diagonal()
    np.fill_diagonal(expected, np.where(fixed & (diagonal <= 0), diagonal.max(initial=1.0), diagonal))
    assert np.array_equal(left.toarray(), expected)
    np.testing.assert_allclose(taken.toarray(), full - expected, rtol=0, atol=1e-15 * np.abs(full).max(initial=1.0))
    assert np.count_nonzero(taken.data) == taken.nnz
    assert taken.has_canonical_format
    assert {taken.indices.dtype, taken.indptr.dtype} == {np.dtype(np.int32)}
    assert np.count_nonzero(np.repeat(np.arange(n), np.diff(left.indptr)) == left.indices) == n
