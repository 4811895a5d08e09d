"""Steps one at a time: computed on request, not kept, equal to those of `solve`; a finished analysis is freed at once."""

import gc
import itertools
import warnings
import weakref

import numpy as np
import pytest
from models import elastic_model, pressed_spheres
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis import step_halving


def spheres(formulation="node_to_segment"):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3)
    return pressed_spheres(mesh, 0.5, formulation=formulation)


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_the_same_steps_as_all_at_once():
    model = spheres()
    expected = fc.solve(model, fc.linear_ramp(4))
    found = list(fc.solve_steps(model, fc.linear_ramp(4)))
    assert [step.index for step in found] == [1, 2, 3, 4]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.displacement, other.displacement)
        np.testing.assert_array_equal(one.stress, other.stress)
    assert found[-1].warnings == expected[-1].warnings


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_nothing_is_computed_before_it_is_asked_for_and_nothing_is_kept(monkeypatch):
    computed = []
    step = step_halving.load_step
    monkeypatch.setattr(step_halving, "load_step", lambda *given: (computed.append(given[2]), step(*given))[1])
    steps = fc.solve_steps(spheres(), fc.linear_ramp(4))
    assert computed == []
    kept = [weakref.ref(step) for step in itertools.islice(steps, 2)]
    assert computed == [1, 2]
    gc.collect()
    assert [reference() for reference in kept] == [None, None]


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_no_cycle_keeps_a_finished_analysis(solver, formulation):
    model = spheres(formulation)

    def solved():
        return Stepping(model, solver, 1e-10, fc.Criteria(geometry_updates=2), fc.linear_ramp(1)).step(1, 1.0).index

    solved()
    gc.collect()
    gc.disable()
    try:
        gc.set_debug(gc.DEBUG_SAVEALL)
        assert solved() == 1
        gc.collect()
        ours = [type(thing).__name__ for thing in gc.garbage if type(thing).__module__.startswith("fastcontact")]
        arrays = [thing.nbytes for thing in gc.garbage if type(thing).__name__ == "ndarray"]
    finally:
        gc.set_debug(0)
        gc.garbage.clear()
        gc.enable()
    assert not ours
    assert sum(arrays) < 10_000


# A loop of analyses shows a warning once for each line, as Python's default filter does.


def test_a_loop_shows_the_same_warning_once():
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("default")
        for _ in range(3):
            model = elastic_model(fc.generate.block_on_block(), "plane_strain", LOWER_BOTTOM="xy", UPPER_TOP="x")
            model.prescribe("UPPER_TOP", y=-2.0)
            sides = {"secondary": "CONT_UPPER", "primary": "CONT_LOWER"}
            model.add_contact("joint", **sides, friction=0.3, formulation="node_to_segment")
            fc.solve(model, 1)
    assert [str(warning.message).partition(" is ")[0] for warning in seen] == ["the largest equivalent strain"]
