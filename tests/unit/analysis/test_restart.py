"""A resumed analysis ends like an uninterrupted one, and requires the same case."""

import warnings
from dataclasses import fields

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, united, with_contact, with_obstacle
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis.state import State
from fastcontact.mesh.generate import block, box

pytestmark = pytest.mark.each_value

FRICTIONLESS, FRICTION = 1e-12, 1e-10
UP_AND_DOWN = fc.Ramp((1.0, 2.0, 3.0, 4.0, 5.0), ((0.0, 0.0), (3.0, 1.0), (5.0, 0.3)))


class StoppedError(Exception):
    """What ends an analysis in the middle."""


def stopped_after(count, model, ramp, **options):
    """The steps handed over until the analysis is stopped, the last one with its restart state."""
    steps = []

    def on_step(step):
        steps.append(step)
        if len(steps) == count:
            raise StoppedError

    with pytest.raises(StoppedError):
        fc.solve(model, ramp, on_step=on_step, **options)
    return steps


def assert_same(found, expected, relative):
    """All that two steps hold, to `relative` of the largest entry of each field."""

    def close(name, one, other):
        one, other = np.asarray(one, float), np.asarray(other, float)
        assert one.shape == other.shape, name
        finite = np.isfinite(other)
        np.testing.assert_array_equal(np.isfinite(one), finite, err_msg=name)
        size = np.abs(other[finite]).max(initial=0.0)
        assert np.abs(one[finite] - other[finite]).max(initial=0.0) <= relative * size, name

    assert (found.index, found.load_factor) == (expected.index, expected.load_factor)
    for name in ("displacement", "stress", "von_mises", "von_mises_signed", "reaction"):
        close(name, getattr(found, name), getattr(expected, name))
    assert list(found.contact) == list(expected.contact)
    for pair, other in expected.contact.items():
        one = found.contact[pair]
        numbers = "gap", "pressure", "multiplier", "force_vectors", "normal", "force", "radius", "shear", "abscissa"
        for name in numbers:
            close(f"{pair}.{name}", getattr(one, name), getattr(other, name))
        for name in ("points", "active", "sticking"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)
        work = np.abs(other.force_vectors).max() * np.abs(expected.displacement).max()
        assert abs(one.dissipation - other.dissipation) <= relative * work
        if other.obstacle_displacement is not None:
            close("obstacle", one.obstacle_displacement, other.obstacle_displacement)
    for name in ("geometry_updates", "active_set_iterations", "substeps"):
        assert found.iterations.get(name) == expected.iterations.get(name), name
    assert len(found.iterations["history"]) == len(expected.iterations["history"])
    assert found.warnings == expected.warnings


def check_resumed(make, ramp, relative, after=(2,), **options):
    """Stop after some steps, go on with a new model; all later steps are those of an uninterrupted analysis."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", fc.FastcontactWarning)
        whole = fc.solve(make(), ramp, **options)
        for count in after:
            again = fc.solve(make(), ramp, resume=stopped_after(count, make(), ramp, **options), **options)
            assert len(again) == len(whole)
            for found, expected in zip(again[count:], whole[count:], strict=True):
                assert_same(found, expected, relative)
    return whole


def spheres(formulation="node_to_segment", **options):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3)
    return pressed_spheres(mesh, formulation=formulation, **options)


def boxes(formulation="node_to_segment", shift=0.02, **options):
    """Two boxes, the upper one lowered and pushed aside."""
    low, up = box((10.0, 10.0, 5.0), (3, 3, 1), "hex8", (0.0, 0.0, -5.0)), box((10.0, 10.0, 5.0), (2, 2, 1))
    model = elastic_model(united(L_=low, U_=up), "3d", L_ZMIN="xyz", U_ZMAX={"x": shift, "y": 0.0, "z": -0.04})
    return with_contact(model, "pair", "U_ZMIN", "L_ZMAX", formulation=formulation, **options)


def indented(dim=2, force=True, springs=False, **options):
    """A block and a ball, driven by a force or by a motion along an arc of its own."""
    if dim == 2:
        model = fc.Model(block((2.0, 1.0), (12, 6), "quad4", origin=(-1.0, -1.0)), "plane_strain")
        top, down, bottom, held = "TOP", "y", "BOTTOM", "xy"
    else:
        model = fc.Model(box((2.0, 2.0, 1.0), (3, 3, 1), "hex8", (-1.0, -1.0, -1.0)), "3d")
        top, down, bottom, held = "ZMAX", "z", "ZMIN", "xyz"
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3))
    model.fix(bottom, held)
    if springs:
        model.add_spring(top, x=3.0)
    ball = fc.obstacles.Sphere((0.0,) * (dim - 1) + (3.0,), 3.0)
    driving = {"force": {down: -8.0}, "motion": {"x": 0.01}} if force else {"motion": {"x": 0.08, down: -0.05}}
    return with_obstacle(model, "ball", top, ball, **driving, **options)


FORMULATIONS = ("node_to_segment", "continuous", "mortar")


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_two_bodies_in_axisymmetry(formulation, friction, solver):
    def make():
        return spheres(formulation, friction=friction)

    check_resumed(make, UP_AND_DOWN, FRICTION if friction else FRICTIONLESS, linear_solver=solver)


@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("options", [{}, {"friction": 0.2}], ids=str)
@pytest.mark.parametrize(("dim", "force"), [(2, True), (2, False), (3, True), (3, False)])
def test_obstacles_that_move(dim, force, options, solver):
    def make():
        return indented(dim, force, **options)

    check_resumed(make, fc.linear_ramp(3), FRICTION if options else FRICTIONLESS, linear_solver=solver)


VARIANTS = {
    "dual mortar": {"formulation": "mortar", "multipliers": "dual"},
    "penalty": {"penalty": 1e5},
    "closed for good": {"kind": "bilateral_once_closed"},
    "tied": {"kind": "tied"},
    "clearance": {"clearance": -0.1, "clearance_ramp": ((0.0, 0.0), (5.0, 1.0))},
}


@pytest.mark.parametrize("name", VARIANTS)
def test_terms_of_a_pair(name):
    check_resumed(lambda: spheres(**VARIANTS[name]), UP_AND_DOWN, FRICTIONLESS)


@pytest.mark.parametrize("criteria", [{"geometry_updates": 1}, {"keep_pairing": True}], ids=str)
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_other_treatments_of_the_geometry(criteria, friction):
    relative = FRICTION if friction else FRICTIONLESS
    check_resumed(lambda: spheres(friction=friction), fc.linear_ramp(4), relative, criteria=fc.Criteria(**criteria))


@pytest.mark.parametrize(
    ("solver", "updates", "friction"), [("direct", 3, 0.1), pytest.param("amg", 7, 0.05, marks=pytest.mark.slow)]
)
def test_steps_cut_in_halves(solver, updates, friction):
    """The first step is cut, and the next one starts from its last part (extrapolated, with an iterative solver).

    Iterative solvers want more updates, each of which makes the residual smaller.
    """
    options = {"linear_solver": solver, "criteria": fc.Criteria(max_geometry_updates=updates, max_halvings=8)}
    whole = check_resumed(lambda: spheres(friction=friction), fc.Ramp((0.9, 1.0)), FRICTION, after=(1,), **options)
    assert any("substeps" in step.iterations for step in whole)


def test_bodies_on_springs():
    check_resumed(lambda: indented(springs=True), fc.linear_ramp(4), FRICTIONLESS)


def test_only_the_last_step_keeps_its_state_and_what_was_given_stays_as_it_is():
    first = fc.solve(spheres(), fc.Ramp((0.2, 0.4)))
    assert [step.restart is None for step in first] == [True, False]
    steps = fc.solve(spheres(), fc.Ramp((0.2, 0.4, 1.0)), resume=first)
    assert [step.restart is None for step in steps] == [True, True, False]
    assert len(first) == 2
    assert first[-1].restart is not None


def test_nothing_is_left_to_do_at_the_end_of_the_ramp():
    steps = fc.solve(spheres(), fc.linear_ramp(2))
    handed = []
    assert fc.solve(spheres(), fc.linear_ramp(2), resume=steps, on_step=handed.append) == steps
    assert not handed


def test_the_ramp_may_change_from_there_on():
    steps = fc.solve(spheres(), fc.Ramp((0.2, 0.4)))
    finer = fc.solve(spheres(), fc.Ramp((0.4 * (1 + 1e-15), 0.6, 0.8)), resume=steps)
    assert [step.load_factor for step in finer] == [0.2, 0.4, 0.6, 0.8]
    assert [step.index for step in finer] == [1, 2, 3, 4]
    back = fc.Ramp((0.4, 0.8), ((0.0, 0.0), (0.4, 0.4), (0.8, 0.0)))
    assert fc.solve(spheres(), back, resume=steps)[-1].contact["hertz"].force[1] == pytest.approx(0.0, abs=1e-6)


def test_solver_tolerances_and_limits_may_change():
    steps = fc.solve(spheres(), fc.Ramp((0.2, 0.4)), linear_solver="amg")
    again = fc.solve(spheres(), fc.Ramp((0.4, 0.8)), resume=steps, linear_solver="direct", criteria=fc.Criteria(1e-5))
    whole = fc.solve(spheres(), fc.Ramp((0.2, 0.4, 0.8)), linear_solver="direct")
    assert np.abs(again[-1].displacement - whole[-1].displacement).max() < 1e-8 * np.abs(whole[-1].displacement).max()


def test_all_that_a_step_changes_is_kept_or_set_anew():
    """A field that the state learns must be looked at here."""
    anew = {"rigid", "last_change", "wear"}  # as a step begins
    learnt = {"solver"}  # from what the solver remembers
    heat = {"rise", "instant"}  # where heat is conducted: see test_heat
    names = {"u": "obstacles"}
    names |= dict.fromkeys(("gap_round_off", "largest_force", "largest_rigid_force", "halved"), "numbers")
    of_pairs = {"elastic_slip": "elastic_slip", "obstacles": "now", "angles": "angle", "never_opening": "closed"}
    of_pairs |= {"first_contact": "first_contact", "worn": "worn", "slipped": "slipped"}
    (step,) = fc.solve(spheres(), fc.linear_ramp(1), linear_solver="amg")
    for field in fields(State):
        if field.name in of_pairs:
            assert of_pairs[field.name] in step.restart["pairs"]["hertz"]
        elif field.name not in anew | learnt | heat:
            assert names.get(field.name, field.name) in step.restart, field.name


def test_contact_that_was_lost_is_known_from_the_last_step_alone():
    """A restart from the last step says that contact was there, as the whole analysis does."""
    ramp = fc.Ramp((0.5, 1.0, 1.5), table=((0.0, 0.0), (0.5, 0.5), (1.0, -0.5), (1.5, -0.6)))
    with pytest.warns(fc.FastcontactWarning, match="has opened again at the end"):
        fc.solve(spheres(), ramp)
    shorter = fc.Ramp((0.5, 1.0), table=ramp.table)
    with pytest.warns(fc.FastcontactWarning, match="has opened again at the end"):
        steps = fc.solve(spheres(), shorter)
    with pytest.warns(fc.FastcontactWarning, match="has opened again at the end"):
        fc.solve(spheres(), ramp, resume=steps[-1:])


def test_a_strengthened_multigrid_cycle_is_remembered():
    """Bounds raised, precision changed, ties of the last solution: what a fresh solver would not know."""
    model, ramp = spheres("continuous"), fc.linear_ramp(3)
    analysis = Stepping(model, "amg", 1e-10, fc.Criteria(), ramp)
    analysis.step(1, 0.5)
    analysis.solver._make_definite(4)
    hierarchy = analysis.solver.hierarchy
    hierarchy.bounds = [1.3 * bound for bound in hierarchy.bounds]
    memory = analysis.solver.snapshot()
    other = Stepping(model, "amg", 1e-10, fc.Criteria(), ramp)
    other.solver.put_back(memory)
    assert other.solver.precision == "double"
    assert other.solver.hierarchy.bounds == analysis.solver.hierarchy.bounds
    f = np.random.default_rng(0).normal(size=other.solver.hierarchy.n)
    equations = analysis.solver._reduced.elimination
    np.testing.assert_array_equal(*(each.solver.solution(f, equations, None) for each in (analysis, other)))
