"""A step from the same state gives the same bits and counts, after any other step and in another problem."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from models import elastic_model, pressed_spheres, supported, with_contact, with_obstacle

import fastcontact as fc
from fastcontact.analysis import restart
from fastcontact.analysis.load_step import load_step
from fastcontact.analysis.problem import prepare

pytestmark = pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")
RAMP = fc.linear_ramp(4)
ELASTIC = fc.LinearElastic(E=20_000.0, nu=0.3)
PLASTIC = fc.ElasticPlastic(E=20_000.0, nu=0.3, yield_stress=400.0, hardening=[(0.0, 400.0), (0.1, 600.0)])


def spheres(material=ELASTIC, strain="small", **options):
    return pressed_spheres(fc.generate.half_spheres(size=8.0), material=material, strain=strain, **options)


def lying_block(**options):
    """Return a block that a pressure presses on another one, held by contact alone along y."""
    model = elastic_model(fc.generate.block_on_block("quad4"), "plane_strain", LOWER_BOTTOM="xy", UPPER_LEFT="x")
    model.add_pressure("UPPER_TOP", 5.0)
    return with_contact(model, "seam", "CONT_UPPER", "CONT_LOWER", **options)


def pressed_disc():
    """Return a block into which a force presses a rigid disc."""
    model = elastic_model(fc.generate.block((4.0, 1.0), (16, 4)), "plane_strain", BOTTOM="xy")
    disc = fc.obstacles.Sphere((2.0, 3.0), R=2.0)
    return with_obstacle(model, "disc", "TOP", disc, force={"y": -3.0}, motion={"x": 0.0}, friction=0.3)


def sphere_on_block(element="hex8", **options):
    model = elastic_model(fc.generate.sphere_on_block(element, size=25.0, contact_size=4.0), "3d", E=20_000.0)
    supported(model, SYMMETRY_X="x", SYMMETRY_Z="z", BLOCK_BOTTOM="y", SPHERE_TOP={"y": -1.0})
    return with_contact(model, "hertz", "CONT_SPHERE", "CONT_BLOCK", **options)


CASES = {
    "mortar": spheres,
    "mortar, friction": lambda: spheres(friction=0.3),
    "node_to_segment, friction": lambda: spheres(formulation="node_to_segment", friction=0.2),
    "continuous": lambda: spheres(formulation="continuous"),
    "plastic, friction": lambda: spheres(PLASTIC, friction=0.1),
    "plastic, finite strain, friction": lambda: spheres(PLASTIC, "finite", friction=0.1),
    "finite strain": lambda: spheres(fc.NeoHookean(E=20_000.0, nu=0.3), "finite"),
    "held by contact": lying_block,
    "held by contact, friction": lambda: lying_block(friction=0.3),
    "pressed obstacle, friction": pressed_disc,
    "space, friction": lambda: sphere_on_block(friction=0.2),
    "space, continuous": lambda: sphere_on_block(formulation="continuous"),
    "space, standard multipliers": lambda: sphere_on_block("tet10", formulation="mortar", multipliers="standard"),
}


# Multigrid keeps most: most cases with it by default; with factors, and pyamg, which keep columns and a tolerance, some.
PLASTICITY = "plastic, friction"
BY_DEFAULT = {
    "direct": [PLASTICITY, "mortar, friction", "held by contact, friction"],
    "amg": [case for case in CASES if case not in (PLASTICITY, "mortar", "held by contact", "space, continuous")],
    "pyamg": ["mortar, friction"],
}
COMBINATIONS = [
    pytest.param(case, solver, marks=() if case in chosen else pytest.mark.slow)
    for solver, chosen in BY_DEFAULT.items()
    for case in CASES
]


@pytest.mark.parametrize(("case", "linear_solver"), COMBINATIONS)
def test_the_same_step_from_the_same_state_gives_the_same_bits_and_counts(case, linear_solver):
    model = CASES[case]()
    problem = prepare(model, RAMP, fc.Criteria(), linear_solver=linear_solver)
    states, results = [problem.initial_state()], []
    for index in (1, 2):
        state, result = load_step(problem, states[-1], index, RAMP.instants[index - 1])
        states.append(state)
        results.append(result)
    for index in (2, 1):
        assert_same(load_step(problem, states[index - 1], index, RAMP.instants[index - 1])[1], results[index - 1])
    other = prepare(model, RAMP, fc.Criteria(), linear_solver=linear_solver)
    saved = replace(results[0], restart=restart.restart_data(problem, states[1], {}))
    state = restart.put_back(other, saved, frozenset(name for name, pair in saved.contact.items() if pair.active.any()))
    for same in (state, pickle.loads(pickle.dumps(states[1]))):  # as another process receives it: data, and no solver
        assert_same(load_step(other, same, 2, RAMP.instants[1])[1], results[1])


def assert_same(result, expected):
    np.testing.assert_array_equal(result.displacement, expected.displacement)
    for name, pair in expected.contact.items():
        np.testing.assert_array_equal(result.contact[name].pressure, pair.pressure)
    counts = {key: value for key, value in expected.iterations.items() if key != "seconds"}
    assert {key: result.iterations[key] for key in counts} == counts


def test_multigrid_that_was_given_up_is_taken_up_again():
    problem = prepare(spheres(), RAMP, fc.Criteria(), linear_solver="amg")
    state, _ = load_step(problem, problem.initial_state(), 1, 0.25)
    _, expected = load_step(problem, state, 2, 0.5)
    factors = problem.solver._factorise("for want of patience")
    later, _ = load_step(problem, replace(state, solver=problem.solver.snapshot()), 2, 0.5)
    assert problem.solver.replacement is factors
    assert_same(load_step(problem, state, 2, 0.5)[1], expected)
    assert problem.solver.replacement is None
    assert not problem.solver.replacement_reason
    assert problem.solver.tolerance == 1e-10
    load_step(problem, later, 3, 0.75)
    assert problem.solver.replacement is factors
