"""A pad slides over a longer track, which is the secondary side: nodes enter and leave the contact in each load step."""

import numpy as np
import pytest
from models import elastic_model, united

import fastcontact as fc

FRICTION, PRESSURE, COEFFICIENT, WIDTH, FORCE = 0.2, 2.0, 1e-4, 3.0, 6.0
FORMULATIONS = {
    "dual": {}, "standard": {"formulation": "mortar", "multipliers": "standard"},
    "node_to_segment": {"formulation": "node_to_segment"}, "continuous": {"formulation": "continuous"},
}  # fmt: skip

pytestmark = [
    pytest.mark.each_value,
    pytest.mark.filterwarnings("ignore:contact 'pad' has only", "ignore:.*integration points of complete facets"),
    pytest.mark.filterwarnings("ignore:.*nodal pressures oscillate", "ignore:contact 'pad' moves along"),
    pytest.mark.filterwarnings("ignore:the energy of these load steps"),
]


def slid(count, travel, element="quad4", on_pad=False, **options):
    """Press the pad onto the track, slide it in `count` steps; return the steps and the nodes of its top."""
    dim = 3 if element.startswith("hex") else 2
    shape, bottom, top = (fc.generate.block, "BOTTOM", "TOP") if dim == 2 else (fc.generate.box, "ZMIN", "ZMAX")
    depth, across = [2.0] * (dim - 2), [4] * (dim - 2)
    low = shape((10.0, *depth, 1.0), (20, *across, 2), element, name="LOW")
    origin = (1.03, *[0.5] * (dim - 2), 1.0)
    pad = shape((WIDTH, *[1.0] * (dim - 2), 1.0), (4, *[3] * (dim - 2), 2), element, origin, name="PAD")
    mesh = united(LOW_=low, PAD_=pad)
    model = elastic_model(mesh, nu=0.0, **{f"LOW_{bottom}": "xyz"[:dim]})
    if dim == 3:
        model.fix("PAD_ZMAX", "y")
    model.prescribe(f"PAD_{top}", x=travel, ramp=[(0, 0), (1, 0), (2, 1)])
    model.couple(f"PAD_{top}", "xyz"[dim - 1])
    model.add_pressure(f"PAD_{top}", PRESSURE, ramp=[(0, 0), (1, 1), (2, 1)])
    secondary, primary = (f"LOW_{top}", f"PAD_{bottom}")[:: -1 if on_pad else 1]
    model.add_contact("pad", secondary=secondary, primary=primary, **options)
    return fc.solve(model, 1.0 + np.linspace(0.0, 1.0, count + 1)), mesh.points_of(f"PAD_{top}")


CASES = [(name, element) for name in FORMULATIONS for element in ("quad4", "quad8")]
CASES += [(name, "hex8") for name in ("dual", "node_to_segment")]


@pytest.mark.parametrize(("name", "element"), CASES)
def test_friction_and_wear_are_those_of_the_force_of_the_pad(name, element):
    """The work of friction is coefficient times force times distance, in total and in each step of half a facet."""
    count, travel = (8, 2.0) if element == "quad4" else (4, 1.0)
    options = {"friction": FRICTION, "wear": COEFFICIENT} | FORMULATIONS[name]
    steps, _ = slid(count, travel, element, **options)
    for step in steps[2:]:  # in the first step of sliding, the pad also shears
        contact = step.contact["pad"]
        assert contact.dissipation == pytest.approx(FRICTION * FORCE * travel / count, rel=1e-3)
        assert abs(contact.force[0]) == pytest.approx(FRICTION * FORCE, rel=2e-3)
        assert abs(contact.force[-1]) == pytest.approx(FORCE, rel=1e-8)
        assert (np.linalg.norm(contact.shear, axis=1) <= FRICTION * contact.pressure * (1 + 1e-9)).all()
    work = steps[-1].work
    assert work["friction_work"] == pytest.approx(FRICTION * FORCE * travel, rel=5e-3)
    assert abs(work["imbalance"]) < 5e-3 * work["friction_work"]
    assert steps[-1].contact["pad"].sliding_load.sum() > 0.0


@pytest.mark.parametrize("name", FORMULATIONS)
@pytest.mark.parametrize("count", [2, 8, 16])
def test_external_work_is_that_of_the_forces_on_the_pad(name, count):
    """Without friction: pressure times sinking, and the force that pushes the pad over the worn track."""
    steps, top = slid(count, 4.0, wear=COEFFICIENT, **FORMULATIONS[name])
    sunk = steps[0].displacement[top, 1].mean() - steps[-1].displacement[top, 1].mean()
    push = [step.reaction[top, 0].sum() for step in steps]
    supplied = FORCE * sunk + np.trapezoid(push, np.linspace(0.0, 4.0, count + 1))
    done = steps[-1].work["external_work"] - steps[0].work["external_work"]
    assert done == pytest.approx(supplied, rel=1e-3)


@pytest.mark.parametrize("friction", [None, FRICTION])
def test_wear_of_the_track_converges_with_the_steps(friction):
    """Where the complete pad has passed, the depth is k p times its width; the sum is exact for any number of steps."""
    errors, works = [], []
    for count in (4, 8, 16):
        options = {} if friction is None else {"friction": friction}
        steps, _ = slid(count, 5.0, wear=COEFFICIENT, **options)
        contact = steps[-1].contact["pad"]
        order = np.argsort(contact.coordinates[:, 0])
        x, depth = contact.coordinates[order, 0], contact.wear[order]
        assert np.trapezoid(depth, x) == pytest.approx(COEFFICIENT * FORCE * 5.0, rel=5e-3)
        passed = (x > 4.3) & (x < 5.8)
        errors.append(np.abs(depth[passed] / (COEFFICIENT * PRESSURE * WIDTH) - 1.0).max())
        works.append(steps[-1].work["wear_work"])
        assert any("moves along" in text for text in steps[-1].warnings) == (count < 16), steps[-1].warnings
    assert errors[0] < 0.1
    assert errors[2] < 0.6 * errors[1] < 0.6 * errors[0]
    np.testing.assert_allclose(works, works[2], rtol=0.04)


def test_wear_of_the_pad_does_not_depend_on_the_steps():
    depths = []
    for count in (2, 8):
        steps, _ = slid(count, 4.0, on_pad=True, wear=COEFFICIENT)
        assert not steps[-1].warnings
        depths.append(steps[-1].contact["pad"].wear)
    assert depths[0] == pytest.approx(depths[1], rel=0.05)
