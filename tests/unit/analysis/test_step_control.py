"""Halved load steps and substeps: the same end as with prescribed steps, larger after few iterations."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, supported, with_contact, with_obstacle
from pairwise import first_of
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis import geometry_loop, step_halving
from fastcontact.analysis.convergence_messages import geometry_not_converged
from fastcontact.analysis.problem import prepare
from fastcontact.mesh.generate import block

FEW = 3  # geometry updates: too few for the whole load, enough for a part of it


def spheres(friction=0.3, **options):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3)
    return pressed_spheres(mesh, **{"formulation": "node_to_segment", "friction": friction, **options})


def analysis_of(steps=1, friction=0.3, **criteria):
    return Stepping(spheres(friction), "direct", 1e-10, fc.Criteria(**criteria), fc.linear_ramp(steps))


def close(found, expected, relative=1e-10):
    np.testing.assert_allclose(found, expected, rtol=0, atol=relative * np.abs(expected).max())


def test_a_step_that_fails_whole_ends_as_if_its_parts_had_been_asked_for():
    with pytest.raises(fc.ConvergenceError, match="did not converge in 3 updates"):
        analysis_of(friction=0.1, max_geometry_updates=FEW).step(1, 1.0)
    handed, model = [], spheres(friction=0.1)
    criteria = fc.Criteria(max_geometry_updates=FEW)
    (step,) = fc.solve(model, fc.linear_ramp(1), linear_solver="direct", criteria=criteria, on_step=handed.append)
    assert [(each.index, each.load_factor) for each in handed] == [(1, 1.0)]
    ends = step.iterations["substeps"]
    assert len(ends) > 1
    assert ends[-1] == 1.0
    parts = fc.solve(model, fc.Ramp(tuple(ends)), linear_solver="direct", criteria=fc.Criteria())
    close(step.displacement, parts[-1].displacement)
    found, expected = step.contact["hertz"], parts[-1].contact["hertz"]
    close(found.pressure, expected.pressure)
    close(found.shear, expected.shear)
    np.testing.assert_array_equal(found.sticking, expected.sticking)
    work = sum(part.contact["hertz"].dissipation for part in parts)
    assert found.dissipation == pytest.approx(work, rel=1e-8, abs=1e-12 * abs(found.force[1]))
    loads = sum(part.contact["hertz"].sliding_load for part in parts)
    assert found.sliding_load == pytest.approx(loads, rel=1e-6, abs=1e-9 * loads.max())
    assert step.iterations["linear_iterations"] >= 0
    assert len(step.iterations["history"]) > step.iterations["geometry_updates"] >= len(ends)


def test_a_step_that_cannot_converge_says_how_often_it_was_cut():
    handed = []
    criteria = fc.Criteria(max_geometry_updates=2, max_halvings=2)
    with pytest.raises(fc.ConvergenceError, match=r"step 1 was halved 2 times, .* 0 to 0\.25 fails") as caught:
        fc.solve(spheres(), fc.linear_ramp(1), linear_solver="direct", criteria=criteria, on_step=handed.append)
    assert not handed
    assert caught.value.__cause__ is None  # the same words are told once
    assert caught.value.__suppress_context__
    assert caught.value.__traceback__ is not None
    assert len(caught.value.history) == 3
    assert all(entry["displacement_change"] > 0 for entry in caught.value.history)


def test_progress_tells_that_a_step_is_cut(capsys):
    limits = {"max_active_set_iterations": 2, "geometry_updates": 0}
    model = spheres(friction=0.0)
    fc.solve(model, fc.linear_ramp(1), linear_solver="direct", criteria=fc.Criteria(**limits), progress=True)
    told = [text.strip() for text in capsys.readouterr().err.split("\r")]
    assert "step 1/1 does not converge, halved: 0 to 1" in told
    assert not step_halving.listeners


def told_for(changes):
    """The message for two pairs, of which the second one moves more."""
    mesh = block((1.0, 1.0), (1, 1))
    side = SimpleNamespace(points=np.arange(4))
    options = SimpleNamespace(cohesion=None, kind="unilateral")
    pair = SimpleNamespace(secondary=side, primary=side, normals="averaged", multipliers="dual", options=options)
    still = SimpleNamespace(**vars(pair) | {"secondary": SimpleNamespace(points=np.arange(2))})
    model, criteria = SimpleNamespace(mesh=mesh), fc.Criteria()
    problem = SimpleNamespace(model=model, criteria=criteria, shape=(4, 2), pairs={"still": still, "joint": pair})
    history = [{"displacement_change": change, "active": 3} for change in changes]
    return geometry_not_converged(problem, history, np.arange(8.0), 60)


@pytest.mark.parametrize(
    ("changes", "words", "enough"),
    [
        ([1e-2 * 0.5**k for k in range(20)], "Use more updates (Criteria.max_geometry_updates), multipliers", "2e-08"),
        ([0.1, *[1.2e-4, 0.9e-4] * 10], "These changes do not decrease. Use multipliers", "1e-04"),
    ],
)
def test_the_remedy_follows_from_how_the_geometry_moves(changes, words, enough):
    told = told_for(changes)
    assert words in told
    assert "multipliers=\"standard\" for contact 'joint'" in told
    assert f" or accept changes of that size (Criteria.geometry, which is 1e-11, above {enough})" in told


def test_remedies_that_do_not_exist_are_not_named():
    """Criteria above 1 % are refused; changes that wander fall at times."""
    told = told_for([0.2, 0.03, *[0.2, 0.4, 0.1, 0.03] * 10])
    assert "Criteria.geometry," not in told
    assert "more updates" not in told
    assert told.endswith(" or a fixed number of updates (Criteria.geometry_updates)")


def driven(**options):
    model = elastic_model(block((2.0, 1.0), (16, 8), "quad4", origin=(-1.0, -1.0)), "plane_strain", BOTTOM="xy")
    return with_obstacle(model, "ball", "TOP", fc.obstacles.Sphere((0.0, 3.0), 3.0), friction=0.2, **options)


def floating():
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3)
    model = elastic_model(mesh, "axisymmetric", E=20_000.0, A1A2="x", A1B1="y")
    model.add_force("A2B2", y=-3e5)
    model.couple("A2B2", "y")
    return with_contact(model, "hertz", "CONT1", "CONT2")


MODELS = {
    "floating": floating,
    "once closed": lambda: spheres(friction=0.0, kind="bilateral_once_closed"),
    "friction": spheres,
    "motion": lambda: driven(motion={"y": -0.05, "x": 0.02}),
    "force": lambda: driven(force={"y": -15.0}),
}


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("name", first_of(3, list(MODELS)))
def test_a_failed_step_leaves_no_trace(name, solver):
    analyses = [Stepping(MODELS[name](), solver, 1e-10, fc.Criteria(), fc.linear_ramp(4)) for _ in range(2)]
    for analysis in analyses:
        for index in (1, 2, 3):
            analysis.step(index, index / 4)
    disturbed, undisturbed = analyses
    generous, strict = disturbed.problem, fc.Criteria(max_geometry_updates=0, max_halvings=1)
    disturbed.problem = replace(generous, criteria=strict)
    with pytest.raises(fc.ConvergenceError):
        disturbed.advance(4, 0.75, 1.0)
    disturbed.problem = generous
    step, expected = disturbed.step(4, 1.0), undisturbed.step(4, 1.0)
    np.testing.assert_array_equal(step.displacement, expected.displacement)
    for pair, contact in step.contact.items():
        np.testing.assert_array_equal(contact.pressure, expected.contact[pair].pressure)
        np.testing.assert_array_equal(contact.shear, expected.contact[pair].shear)
    assert step.iterations == expected.iterations


def test_parts_that_converged_before_one_failed_are_taken_back():
    model = spheres(friction=0.1)
    analysis = Stepping(model, "direct", 1e-10, fc.Criteria(max_geometry_updates=2, max_halvings=5), fc.linear_ramp(1))
    with pytest.raises(fc.ConvergenceError, match=r"the part from 0\.59375 to 0\.625 fails"):
        analysis.advance(1, 0.0, 1.0)
    assert not analysis.u.any()
    analysis.problem = replace(analysis.problem, criteria=fc.Criteria())
    (expected,) = fc.solve(model, fc.linear_ramp(1), linear_solver="direct")
    step = analysis.step(1, 1.0)
    np.testing.assert_array_equal(step.displacement, expected.displacement)
    assert step.iterations == expected.iterations


def test_a_step_that_fails_says_which_one_it_is():
    criteria = fc.Criteria(max_active_set_iterations=1, max_halvings=0)
    message = (
        r"the active set did not converge in 1 iterations: 4 constraints still change, at points .* of contact 'hertz'\. Use "
        r"more iterations \(max_active_set_iterations\) \(step 1 from 0 to 0\.5; more load steps may help\)$"
    )
    with pytest.raises(fc.ConvergenceError, match=message) as caught:
        fc.solve(spheres(friction=0.0), fc.linear_ramp(2), linear_solver="direct", criteria=criteria)
    (entry,) = caught.value.history
    assert entry["settled"] is False
    assert len(entry["nodes"]["hertz"]) == 4


def test_what_fails_inside_a_pairing_is_told_with_the_pairings_before_it(monkeypatch):
    """A linear solver that gives up knows of no pairings; the history of the step does."""
    analysis = analysis_of(max_halvings=0)
    solve, calls = geometry_loop.solve_inequalities, []

    def failing(*arguments):
        calls.append(1)
        if len(calls) == 3:
            raise fc.ConvergenceError("conjugate gradients stand still")
        return solve(*arguments)

    monkeypatch.setattr(geometry_loop, "solve_inequalities", failing)
    with pytest.raises(fc.ConvergenceError, match=r"still \(step 1 from 0 to 1; more load steps may help\)$") as caught:
        analysis.advance(1, 0.0, 1.0)
    assert [entry["settled"] for entry in caught.value.history] == [True, True]


def problem():
    model = fc.Model(fc.generate.block((1.0, 1.0), (1, 1)), "plane_strain", strain="finite")
    model.add_material(fc.NeoHookean(E=1.0, nu=0.3))
    supported(model, BOTTOM="xy", TOP={"y": -0.1})
    return prepare(model, fc.linear_ramp(2), fc.Criteria())


def test_sizes_are_kept_and_grow(monkeypatch: pytest.MonkeyPatch) -> None:
    solved, tried = step_halving.load_step, []

    def load_step(problem, state, index, instant):
        span = instant - tried[-1][1] if tried and tried[-1][2] else instant - state_at
        converges = span <= largest + 1e-12
        tried.append((span, instant if converges else (tried[-1][1] if tried else state_at), True))
        if not converges:
            raise fc.ConvergenceError("too far")
        end, result = solved(problem, state, index, instant)
        return end, replace(result, iterations={**result.iterations, "history": [{}] * iterations})

    monkeypatch.setattr(step_halving, "load_step", load_step)
    prepared = problem()
    state_at, largest, iterations = 0.0, 0.125, 15  # many iterations: no larger part is tried
    state, step = step_halving.advance(prepared, prepared.initial_state(), 1, 0.0, 0.5)
    assert step.iterations["substeps"] == pytest.approx([0.125, 0.25, 0.375, 0.5])
    assert [span for span, *_ in tried] == pytest.approx([0.5, 0.25, 0.125, 0.125, 0.125, 0.125])
    assert state.halved == 2
    assert step_halving.State.from_dict(state.to_dict(8), state.u.reshape(-1, 2), frozenset()).halved == 2
    # In the next step parts begin as small; few iterations let them grow, up to the whole step.
    tried.clear()
    state_at, largest, iterations = 0.5, 1.0, 4
    state, step = step_halving.advance(prepared, state, 2, 0.5, 1.0)
    assert step.iterations["substeps"] == pytest.approx([0.625, 0.75, 1.0])
    assert state.halved == 0
    tried.clear()
    state_at = 1.0
    _, step = step_halving.advance(prepared, state, 3, 1.0, 1.5)
    assert "substeps" not in step.iterations


@pytest.mark.parametrize(
    ("strain", "friction", "end", "halved"),
    [("finite", 0.25, 0.3, True), ("finite", 0.25, 0.9, False), ("small", 0.5, 0.9, False)],
)
def test_a_beam_that_passes_a_disc_in_one_step_does_not_stick_to_it(strain, friction, end, halved):
    """The equilibrium of a jammed beam exists, too, with a force of up to 1200."""
    element, n = ("quad8", (3, 34)) if strain == "small" else ("quad4", (2, 12))
    beam = block((1.5, 17.0), n, element, (0.0, -17.0)).merged_groups("SIDE", ["LEFT", "BOTTOM"])
    model = elastic_model(beam, "plane_stress", E=2600.0, nu=0.38, strain=strain, TOP={"x": 0.0, "y": -9.0})
    model.add_obstacle("c", secondary="SIDE", obstacle=fc.obstacles.Sphere((-0.7, -20.0), 0.5), friction=friction)
    with pytest.warns(fc.FastcontactWarning, match="never closed"):
        (step,) = fc.solve(model, [end])
    assert not step.contact["c"].force.any()
    assert ("substeps" in step.iterations) == halved
