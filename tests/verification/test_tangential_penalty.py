"""Tangential penalty: elastic slip of shear over penalty, accumulated over steps; sliding beyond the limit."""

import numpy as np
import pytest
from models import elastic_model, supported
from two_bodies import YOUNG, blocks, boxes

import fastcontact as fc
from fastcontact.analysis.criteria import Criteria

pytestmark = pytest.mark.each_value

EVERY = [("node_to_segment", {}), ("continuous", {}), ("mortar", {}), ("mortar", {"multipliers": "dual"})]
each = pytest.mark.parametrize(("formulation", "options"), EVERY, ids=["node", "continuous", "mortar", "dual"])
PRESS, STIFFNESS, MU = 0.05, 300.0, 0.3
# Pressed in the first step, then pushed sideways: 1 at the instant 3, back to 0 at 5.
SIDEWAYS = [(0.0, 0.0), (1.0, 0.0), (3.0, 1.0), (5.0, 0.0)]


def sheared(formulation, sideways, dim=2, penalty=STIFFNESS, **options):
    """The upper block is pressed on the lower one and moved along x; both have nu = 0."""
    mesh = boxes() if dim == 3 else blocks()
    model = elastic_model(mesh, "3d" if dim == 3 else "plane_strain", E=YOUNG, nu=0.0)
    top, bottom, up = ("U_ZMAX", "L_ZMIN", "z") if dim == 3 else ("UPPER_TOP", "LOWER_BOTTOM", "y")
    for axis in "xyz"[:dim]:
        model.fix(bottom, axis)
    if dim == 3:
        model.fix(top, "y")
    model.prescribe(top, ramp=[(0, 0), (1, 1), (5, 1)], **{up: -PRESS})
    model.prescribe(top, ramp=SIDEWAYS, x=sideways)
    groups = ("U_ZMIN", "L_ZMAX") if dim == 3 else ("CONT_UPPER", "CONT_LOWER")
    model.add_contact(
        "pair", secondary=groups[0], primary=groups[1], formulation=formulation, friction=MU,
        **({} if penalty is None else {"tangential_penalty": penalty}), **options,
    )  # fmt: skip
    return model


def solved(model, ramp=(1.0, 2.0, 3.0, 4.0, 5.0), **options):
    criteria = Criteria(keep_pairing=True)  # the sides stay flat and opposite to each other
    return fc.solve(model, fc.Ramp(ramp, ((0.0, 0.0), (5.0, 1.0))), criteria=criteria, **options)


def slip_of(model, step):
    """Relative displacement along x of the nodes that lie opposite to each other on matching meshes (m,)."""
    contact, points = step.contact["pair"], model.mesh.points
    opposite = [
        next(p for p in contact.primary_points if np.allclose(points[p], points[node])) for node in contact.points
    ]
    return step.displacement[contact.points, 0] - step.displacement[opposite, 0]


def areas_of(model):
    """Areas of the secondary nodes (m,), of a uniform pressure on another model."""
    probe = solved(sheared("node_to_segment", 0.0, model.mesh.dim), (1.0,))[-1].contact["pair"]
    return probe.points, probe.force_vectors[:, -1] / (YOUNG * PRESS / 10.0)


@each
@pytest.mark.parametrize("dim", [2, 3])
def test_the_shear_of_what_sticks_is_the_penalty_times_its_slip(formulation, options, dim):
    model = sheared(formulation, 0.004, dim, **options)
    points, areas = areas_of(model)
    for step in solved(model)[1:4]:
        contact = step.contact["pair"]
        assert contact.sticking.all()
        assert abs(contact.dissipation) < 1e-12
        slip = slip_of(model, step)
        assert np.abs(slip).min() > 1e-4
        order = np.argsort(contact.points)
        np.testing.assert_array_equal(contact.points[order], np.sort(points))
        total = -STIFFNESS * (areas[np.argsort(points)] * slip[order]).sum()
        assert contact.force[0] == pytest.approx(total, rel=1e-9 if formulation != "mortar" else 2e-3)
        if formulation == "node_to_segment":
            shear = contact.force_vectors[order, 0] / areas[np.argsort(points)]
            np.testing.assert_allclose(shear, -STIFFNESS * slip[order], rtol=1e-9)


@each
def test_it_lets_go_of_what_it_took_up(formulation, options):
    """Back where it was pushed from, nothing is left: slip within stick is elastic."""
    pressed, *_, back = solved(sheared(formulation, 0.004, **options))
    np.testing.assert_allclose(back.displacement, pressed.displacement, atol=1e-12)
    assert abs(back.contact["pair"].force[0]) < 1e-9 * back.contact["pair"].force[1]


@each
def test_many_steps_end_as_one(formulation, options):
    model = sheared(formulation, 0.004, **options)
    one, many = solved(model, (1.0, 3.0))[-1], solved(model, (1.0, 1.3, 1.5, 2.2, 2.9, 3.0))[-1]
    np.testing.assert_allclose(one.displacement, many.displacement, atol=1e-12)


@each
def test_beyond_the_limit_it_slides_at_the_limit(formulation, options):
    contact = solved(sheared(formulation, 0.2, **options))[2].contact["pair"]
    assert not contact.sticking.any()
    assert contact.force[0] == pytest.approx(-MU * contact.force[1], rel=1e-9)
    assert contact.dissipation > 0


@each
def test_a_stiff_one_is_none(formulation, options):
    exact = solved(sheared(formulation, 0.004, penalty=None, **options))[2]
    errors = [
        np.abs(
            solved(sheared(formulation, 0.004, penalty=penalty, **options))[2].displacement - exact.displacement
        ).max()
        for penalty in (1e5, 1e6)
    ]
    assert errors[1] < 2e-6
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.05)


def test_it_may_vary_along_the_surface():
    def penalty(positions):
        return STIFFNESS * (1.0 + positions[:, 0] / 10.0)

    model = sheared("node_to_segment", 0.004, penalty=penalty)
    step = solved(model)[2]
    contact, (points, areas) = step.contact["pair"], areas_of(model)
    np.testing.assert_array_equal(contact.points, points)
    shear = contact.force_vectors[:, 0] / areas
    np.testing.assert_allclose(shear, -penalty(contact.coordinates) * slip_of(model, step), rtol=1e-9)


def test_supported_nodes_shear_it_too():
    """Where supports move the contact nodes themselves, their slip is known and the shear follows from it."""
    model = sheared("node_to_segment", 0.0)
    model.supports = [
        support for support in model.supports if support.component != 0 or support.group == "LOWER_BOTTOM"
    ]
    supported(model, UPPER={"ramp": SIDEWAYS, "x": 0.004}, LOWER="x")
    contact = solved(model)[2].contact["pair"]
    np.testing.assert_allclose(contact.shear[:, 0], -STIFFNESS * 0.004, rtol=1e-9)


@pytest.mark.parametrize("formulation", ["node_to_segment", "mortar"])
def test_a_run_that_goes_on_knows_what_it_took_up(formulation):
    model = sheared(formulation, 0.004)
    whole = solved(model)
    kept = []

    class StoppedError(Exception):
        pass

    def stop(step):
        kept.append(step)
        if len(kept) == 2:
            raise StoppedError

    with pytest.raises(StoppedError):
        solved(model, on_step=stop)
    resumed = solved(sheared(formulation, 0.004), resume=kept)
    np.testing.assert_array_equal(resumed[-1].displacement, whole[-1].displacement)
    np.testing.assert_array_equal(resumed[2].contact["pair"].shear, whole[2].contact["pair"].shear)


def test_tractions_of_earlier_files_continue_as_slips():
    """Restart data of earlier versions hold the tangential tractions in place of the elastic slips."""
    model = sheared("node_to_segment", 0.02)
    whole = solved(model)
    begun = solved(model, (1.0, 2.0))
    pair = begun[-1].restart["pairs"]["pair"]
    positions, slips = pair.pop("elastic_slip")
    pair["traction"] = [positions, slips * STIFFNESS]
    resumed = solved(model, resume=begun)
    assert abs(resumed[-1].displacement - whole[-1].displacement).max() < 1e-12
