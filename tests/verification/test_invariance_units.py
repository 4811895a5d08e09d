"""The unit system has no effect: SI, mm-N-MPa and nanometre units give the same result with the same iterations."""

from dataclasses import replace

import numpy as np
import pytest
from images import Image, ball, cylinder, differences, discs, floating, floating_ball, iterations, on_plane, solved

pytestmark = pytest.mark.pairwise

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
# From millimetres and megapascals: metres and pascals; nanometres and nanonewtons; far off.
UNITS = {"si": (1e-3, 1e6), "nanometres": (1e6, 1e-3), "far off": (1e-12, 1e12)}
IMAGES = {name: Image(length=length, pressure=pressure) for name, (length, pressure) in UNITS.items()}


def in_the_plane():
    for formulation in FORMULATIONS:
        yield f"discs {formulation}", discs(formulation)
        yield f"cylinder {formulation}", cylinder(formulation)
        yield f"cylinder with friction {formulation}", cylinder(formulation, friction=0.3)
        yield f"floating {formulation}", floating(formulation)
        yield f"floating with friction {formulation}", floating(formulation, friction=0.3)
        yield f"clearance {formulation}", cylinder(formulation, clearance=-0.2)
        yield f"tied {formulation}", floating(formulation, kind="tied")
    yield "dual", cylinder("mortar", multipliers="dual")
    yield "dual with friction", cylinder("mortar", multipliers="dual", friction=0.3)
    yield "quadratic", cylinder("mortar", "quad8")
    yield "triangles", discs("continuous", "tri6")
    for formulation in FORMULATIONS[:2]:
        yield f"penalty {formulation}", cylinder(formulation, penalty=1e5)
        yield f"plane {formulation}", on_plane(2, formulation=formulation, friction=0.3)


def in_space():
    for formulation in FORMULATIONS:
        yield f"ball {formulation}", ball(formulation)
        yield f"ball with friction {formulation}", ball(formulation, friction=0.3)
        yield f"floating {formulation}", floating_ball(formulation)
    yield "dual", ball("mortar", multipliers="dual")
    yield "tetrahedra", ball("mortar", "tet4")
    yield "plane", on_plane(3, formulation="node_to_segment", friction=0.3)


PLANE, SPACE = dict(in_the_plane()), dict(in_space())
LONG = [name for name in SPACE if "friction" in name and "node" not in name]


def stays(job, image, original):
    found, one, other = differences(job, image, original)
    assert max(found.values()) < 1e-9, max(found, key=found.get)
    assert iterations(other) == iterations(one)
    assert sum(int(contact.active.sum()) for contact in one.contact.values()) > 0


def in_units(jobs, units):
    """Give problems and units, by default one for every third problem, in turn; the last ones, those far off, most often."""
    for i, name in enumerate(jobs):
        for j, unit in enumerate(units):
            default = name not in LONG and i % 3 == 0 and j == min(i // 3 % (len(units) + 1), len(units) - 1)
            yield pytest.param(name, unit, marks=() if default else pytest.mark.slow)


@pytest.mark.parametrize(("name", "unit"), [*in_units(PLANE, list(UNITS))])
def test_units_make_no_difference_in_the_plane(name, unit):
    stays(PLANE[name], IMAGES[unit], solved(PLANE[name], Image())[0])


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize(("name", "unit"), [*in_units(SPACE, list(UNITS)[:2])])
def test_units_make_no_difference_in_space(name, unit, solver):
    job = replace(SPACE[name], solver=solver, tolerance=1e-10)
    stays(job, IMAGES[unit], solved(job, Image())[0])


def test_sliding_and_sticking_occur_in_these_problems():
    """So that what is compared above is not trivial."""
    for job in (cylinder("mortar", friction=0.3), ball("mortar", friction=0.3), on_plane(3, friction=0.3)):
        (contact,) = solved(job, Image())[0].contact.values()
        assert (contact.active & ~contact.sticking).any()
        assert contact.dissipation > 0
        assert (~contact.active).any()
    (contact,) = solved(ball("node_to_segment", friction=0.3), Image())[0].contact.values()
    assert np.any(contact.active & contact.sticking)
    assert np.any(contact.active & ~contact.sticking)
