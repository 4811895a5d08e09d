"""A finished analysis is freed at once: no large object waits in a reference cycle."""

import gc

import pytest
from models import elastic_model
from stepping import Stepping

import fastcontact as fc
from fastcontact.analysis.criteria import Criteria


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_no_cycle_keeps_a_finished_analysis(solver, formulation):
    mesh = fc.generate.half_spheres("quad4", arc_sizes=(3.0, 6.0), segments=3)
    model = elastic_model(mesh, "axisymmetric", E=20_000.0, A1A2="x", A2B2={"y": -0.5}, A1B1={"y": +0.5})
    model.add_contact("hertz", secondary="CONT1", primary="CONT2", formulation=formulation)

    def solved():
        analysis = Stepping(model, solver, 1e-10, Criteria(geometry_updates=2), fc.linear_ramp(1))
        return analysis.step(1, 1.0).index

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
