"""Steps one at a time: computed on request, not kept, equal to those of `solve`."""

import gc
import itertools
import weakref

import numpy as np
import pytest
from models import supported

import fastcontact as fc
from fastcontact.analysis import step_halving


@pytest.fixture
def model():
    found = fc.Model(fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3), "axisymmetric")
    found.add_material(fc.LinearElastic(E=20_000.0, nu=0.3))
    supported(found, A1A2="x", A2B2={"y": -0.5}, A1B1={"y": +0.5})
    found.add_contact("hertz", secondary="CONT1", primary="CONT2", formulation="node_to_segment")
    return found


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_the_same_steps_as_all_at_once(model):
    expected = fc.solve(model, fc.linear_ramp(4))
    found = list(fc.solve_steps(model, fc.linear_ramp(4)))
    assert [step.index for step in found] == [1, 2, 3, 4]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_array_equal(one.displacement, other.displacement)
        np.testing.assert_array_equal(one.stress, other.stress)
    assert found[-1].warnings == expected[-1].warnings


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_nothing_is_computed_before_it_is_asked_for_and_nothing_is_kept(model, monkeypatch):
    computed = []
    step = step_halving.load_step
    monkeypatch.setattr(step_halving, "load_step", lambda *given: (computed.append(given[2]), step(*given))[1])
    steps = fc.solve_steps(model, fc.linear_ramp(4))
    assert computed == []
    kept = [weakref.ref(step) for step in itertools.islice(steps, 2)]
    assert computed == [1, 2]
    gc.collect()
    assert [reference() for reference in kept] == [None, None]
