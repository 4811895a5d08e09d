"""Bilateral contact: no separation, and frictionless sliding."""

import numpy as np
import pytest
from models import elastic_model
from two_bodies import blocks, boxes, held, touching

import fastcontact as fc

pytestmark = pytest.mark.each_value

FORMULATIONS = ("node_to_segment", "continuous", "mortar")
MODULUS = {"plane_strain": 1000.0 / 0.91, "axisymmetric": 1000.0, "3d": 1000.0}
# Pressed by the first step, pulled by the second.
PRESS_AND_PULL = fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, -1.0)))


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("kinematics", ["plane_strain", "axisymmetric", "3d"])
@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_uniform_tension_passes(formulation, kinematics, swap):
    apart = formulation == "mortar"  # the only one that meshes which do not match pass exactly
    mesh = (
        boxes(upper=(3, 2, 2) if apart else (2, 3, 2)) if kinematics == "3d" else blocks(upper=(4 if apart else 3, 2))
    )
    model = touching(held(mesh, kinematics, -0.02), formulation, swap, kind="bilateral")
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    axis, expected = (2 if kinematics == "3d" else 1), MODULUS[kinematics] * 0.002
    assert np.abs(last.stress[:, axis] - expected).max() < 1e-10 * expected
    assert last.contact["pair"].active.all()
    assert last.contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)
    assert np.abs(last.contact["pair"].gap).max() < 1e-12


@pytest.mark.parametrize("formulation", FORMULATIONS)
def test_a_bilateral_pair_slides_without_resistance(formulation):
    model = elastic_model(blocks(upper=(4, 2)), "plane_strain", LOWER_BOTTOM="xy", UPPER_TOP={"x": 0.5, "y": 0.0})
    touching(model, formulation, kind="bilateral", projection_tolerance=0.5)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    upper = model.mesh.points_of("UPPER")
    assert np.abs(last.displacement[upper] - [0.5, 0.0]).max() < 1e-12
    assert np.abs(last.stress).max() < 1e-9


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("make", [blocks, boxes])
@pytest.mark.filterwarnings("ignore:contact .* has opened again at the end")
def test_once_closed_means_closed_in_a_load_step_before(make, formulation, swap):
    mesh = make()
    kinematics = "3d" if mesh.dim == 3 else "plane_strain"
    axis, expected = mesh.dim - 1, MODULUS[kinematics] * 0.002
    pulled = {}
    for kind in ("unilateral", "bilateral_once_closed"):
        model = touching(held(mesh, kinematics, 0.02), formulation, swap, kind=kind)
        steps = fc.solve(model, PRESS_AND_PULL)
        assert np.abs(steps[0].stress[:, axis] + expected).max() < 1e-10 * expected
        pulled[kind] = steps[1]
    assert np.abs(pulled["unilateral"].stress).max() < 1e-10 * expected
    assert not pulled["unilateral"].contact["pair"].active.any()
    assert np.abs(pulled["bilateral_once_closed"].stress[:, axis] - expected).max() < 1e-10 * expected
    assert pulled["bilateral_once_closed"].contact["pair"].active.all()
    assert pulled["bilateral_once_closed"].contact["pair"].pressure == pytest.approx(-expected, rel=1e-10)


@pytest.mark.filterwarnings(
    "ignore:nodes alternated between two facets"
)  # opposite nodes, of which facets bend outwards
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar"])
def test_once_closed_leaves_the_rest_free(formulation, forma04):
    """Two half-spheres, pressed, then pulled: they hang on what had been closed, the rest opens wider."""
    mesh = fc.generate.half_spheres("tri3", size=5.0)
    model = forma04(mesh, formulation, kind="bilateral_once_closed")
    pressed, pulled = fc.solve(model, fc.Ramp((1.0, 2.0), ((0.0, 0.0), (1.0, 0.5), (2.0, -0.1))))
    before, after = pressed.contact["hertz"], pulled.contact["hertz"]
    assert before.force[1] * after.force[1] < 0
    assert 0 < after.active.sum() < len(after.active)
    near = after.coordinates[:, 0] < before.radius[0] - 2.0
    assert np.abs(after.gap[near]).max() < 0.02 * after.gap[np.isfinite(after.gap)].max()
    assert after.pressure[after.active].min() < 0
    assert not after.pressure[~after.active].any()


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_an_obstacle_may_be_a_guide(formulation):
    model = elastic_model(fc.generate.block((10.0, 5.0), (4, 2), "quad4"), "plane_strain", LEFT="x", TOP={"y": 0.01})
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, formulation=formulation, kind="bilateral")
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    assert np.abs(last.stress[:, 1] / (MODULUS["plane_strain"] * 0.002) - 1).max() < 1e-10
    assert last.contact["floor"].force[1] < 0


def test_a_body_may_hang_on_a_bilateral_pair():
    """Nothing but the contact holds the upper block up."""
    model = elastic_model(blocks(upper=(4, 3)), "plane_strain")
    for side in ("LOWER", "UPPER"):
        model.fix(f"{side}_LEFT", "x")
    model.fix("LOWER_BOTTOM", "y")
    model.add_traction("UPPER_TOP", y=2.0)
    touching(model, "mortar", kind="bilateral")
    last = fc.solve(model, fc.linear_ramp(2))[-1]
    assert np.abs(last.stress[:, 1] - 2.0).max() < 1e-9
    assert last.iterations["regularised"]["relative_to_load"] < 1e-9


@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("make", [blocks, boxes])
@pytest.mark.parametrize(("options", "expected"), [
    ({"kind": "tied"}, -1.0), ({"kind": "bilateral"}, -1.0), ({"clearance": 0.005}, 0.75),
    ({"clearance_primary": -0.01}, 1.5),
], ids=str)  # fmt: skip
def test_dual_multipliers_keep_the_same_terms(make, options, expected, swap):
    mesh = make(upper=(4, 3) if make is blocks else (3, 2, 2))
    kinematics = "3d" if mesh.dim == 3 else "plane_strain"
    approach = -0.02 if "kind" in options else 0.02
    model = touching(held(mesh, kinematics, approach), "mortar", swap, multipliers="dual", **options)
    last = fc.solve(model, fc.linear_ramp(1))[-1]
    pressure = expected * MODULUS[kinematics] * 0.002
    assert np.abs(last.stress[:, mesh.dim - 1] + pressure).max() < 1e-10 * abs(pressure)
    assert last.contact["pair"].pressure == pytest.approx(pressure, rel=1e-10)


@pytest.mark.parametrize("multipliers", ["standard", "dual"])
@pytest.mark.parametrize(
    "options", [{"kind": "tied"}, {"kind": "bilateral"}, {"kind": "bilateral_once_closed"}], ids=str
)
def test_multigrid_finds_the_same(options, multipliers):
    """Equations that always hold go through elimination or compliance like constraints that are closed."""
    model = held(boxes(upper=(3, 2, 2)), "3d", 0.02)
    touching(model, "mortar", multipliers=multipliers, **options)
    one, other = (fc.solve(model, PRESS_AND_PULL, linear_solver=name)[-1] for name in ("amg", "direct"))
    assert np.abs(one.displacement - other.displacement).max() < 1e-8 * np.abs(other.displacement).max()
    assert one.contact["pair"].pressure == pytest.approx(-2.0, rel=1e-7)
