"""Supports that drive contact nodes into the other side give a warning, in every formulation."""

import warnings

import numpy as np
import pytest
from models import elastic_model, supported

import fastcontact as fc
from fastcontact.mesh.generate import block, block_on_block, box
from fastcontact.model.model_warnings import model_warnings
from fastcontact.model.ramp import Ramp

FORMULATIONS = ["node_to_segment", "continuous", "mortar"]


def floor(dim, height=0.0):
    return fc.obstacles.HalfSpace((0.0,) * (dim - 1) + (height,), (0.0,) * (dim - 1) + (1.0,))


def told(model, ramp=None):
    return [text for text in model_warnings(model, ramp or fc.linear_ramp(1)) if text.startswith("supports push")]


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
@pytest.mark.parametrize(
    ("mesh", "kinematics", "side"),
    [
        (block((1.0, 1.0), (2, 2)), "plane_strain", "BOTTOM"),
        (block((1.0, 1.0), (2, 2)), "axisymmetric", "BOTTOM"),
        (box((1.0, 1.0, 1.0), (1, 1, 1)), "3d", "ZMIN"),
    ],
)
def test_a_side_pushed_into_a_floor_is_refused(mesh, kinematics, side, formulation):
    model = elastic_model(mesh, kinematics)
    up = "yz"[mesh.dim - 2]
    model.prescribe(side, **{up: -0.1})
    model.fix("LEFT" if mesh.dim == 2 else "XMIN", "x")
    model.add_obstacle("floor", secondary=side, obstacle=floor(mesh.dim), formulation=formulation)
    n = len(mesh.points_of(side))
    with pytest.raises(
        fc.ModelError, match=rf"supports push {n} of the {n} nodes of '{side}' into the rigid .* by up to 0\.1 "
    ):
        model.check()


@pytest.mark.each_value
@pytest.mark.parametrize("formulation", FORMULATIONS)
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("sides", [("CONT_UPPER", "CONT_LOWER"), ("CONT_LOWER", "CONT_UPPER")])
def test_both_sides_prescribed(sides, friction, formulation):
    def pressed(by):
        model = elastic_model(block_on_block(), CONT_LOWER="xy", CONT_UPPER="x")
        model.prescribe("CONT_UPPER", y=-by)
        model.add_contact("pair", secondary=sides[0], primary=sides[1], formulation=formulation, friction=friction)
        return model

    with pytest.raises(
        fc.ModelError, match=rf"nodes of '{sides[0]}' into '{sides[1]}', contact 'pair', by up to 0\.02 "
    ):
        pressed(0.02).check()
    pressed(-0.02).check()  # apart, and as they lie
    pressed(0.0).check()


def shifted(by, mesh=None, **options):
    """A block moved by `by` into a wall at its left, by its top alone."""
    model = elastic_model(mesh or block((1.0, 1.0), (3, 4)), TOP={"x": -by, "y": 0.0})
    wall = fc.obstacles.HalfSpace((0.0, 0.0), (1.0, 0.0))
    model.add_obstacle("wall", secondary="LEFT", obstacle=wall, **options)
    model.check()
    return model


@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous"])
def test_a_single_node_gives_a_warning_with_number_and_place(formulation):
    model = shifted(0.01, formulation=formulation)
    corner = model.mesh.point("TOP_LEFT")
    (text,) = told(model)
    assert "supports push 1 of the 5 nodes of 'LEFT' into the rigid obstacle" in text
    assert f"by up to 0.01 (point {corner} at (0, 1), instant 1)" in text
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        (step,) = fc.solve(model, fc.linear_ramp(1))
    assert text in {str(w.message) for w in caught}
    assert text in step.warnings


def test_what_helps():
    assert not told(shifted(0.01, excluded=["TOP_LEFT"]))
    assert not told(shifted(0.01, penalty=1e5, formulation="node_to_segment"))
    assert not told(shifted(-0.01))


def test_the_worst_instant_counts():
    model = shifted(0.0)
    model.supports.clear()
    model.fix("TOP", "y")
    model.prescribe("TOP", x=-0.01, ramp=[(0.0, 0.0), (0.5, 1.0), (1.0, 0.0)])
    (text,) = told(model, Ramp((0.25, 0.5, 1.0)))
    assert "by up to 0.01" in text
    assert "instant 0.5" in text
    assert not told(model, Ramp((1.0,)))


def test_an_obstacle_that_moves_into_held_nodes():
    model = elastic_model(box((1.0, 1.0, 1.0), (2, 2, 2)), XMIN="xyz")
    model.add_obstacle("plate", secondary="ZMIN", obstacle=floor(3), motion={"z": 0.05})
    model.check()
    (text,) = told(model)
    assert "3 of the 9 nodes of 'ZMIN'" in text
    assert "by up to 0.05" in text


def test_an_interference_between_nodes_that_are_held_on_both_sides():
    model = elastic_model(block_on_block())
    for group in ("LOWER_BOTTOM", "UPPER_TOP", "LOWER_LEFT", "UPPER_LEFT"):
        model.fix(group, "xy")
    model.add_contact("pair", secondary="CONT_LOWER", primary="CONT_UPPER", clearance=-0.02)
    (text,) = told(model)
    assert "supports push 1 of the 9 nodes of 'CONT_LOWER' into 'CONT_UPPER', contact 'pair', by up to 0.02" in text


@pytest.mark.parametrize("secondary", ["CONT_LOWER", "CONT_UPPER"])
def test_a_tool_of_prescribed_nodes_is_right(secondary):
    model = elastic_model(block_on_block(), LOWER_BOTTOM="xy", UPPER={"x": 0.0, "y": -0.02})
    primary = {"CONT_LOWER": "CONT_UPPER", "CONT_UPPER": "CONT_LOWER"}[secondary]
    model.add_contact("pair", secondary=secondary, primary=primary)
    model.check()
    assert not told(model)


def test_an_overlap_before_any_load_is_that_of_the_mesh():
    mesh = block((1.0, 1.0), (2, 2))
    model = elastic_model(mesh, BOTTOM="xy")
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor(2, 0.01))
    model.check()
    assert not told(model)


@pytest.mark.parametrize("kind", ["tied", "bilateral"])
def test_supports_that_tear_what_is_tied(kind):
    def torn(by):
        model = elastic_model(block_on_block(), CONT_LOWER="xy", CONT_UPPER="x")
        model.prescribe("CONT_UPPER", y=by)
        model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", kind=kind)
        return model

    with pytest.raises(fc.ModelError, match=r"nodes of 'CONT_UPPER' off 'CONT_LOWER', contact 'pair', by up to 0\.02 "):
        torn(0.02).check()
    torn(0.0).check()


def test_tied_sides_may_not_be_shifted_along_each_other():
    model = elastic_model(block_on_block(), CONT_LOWER="xy", CONT_UPPER="y")
    model.prescribe("CONT_UPPER", x=0.03)
    model.add_contact("pair", secondary="CONT_UPPER", primary="CONT_LOWER", kind="tied")
    with pytest.raises(fc.ModelError, match=r"off 'CONT_LOWER', contact 'pair', by up to 0\.03 "):
        model.check()


def test_relations_that_hold_nodes_inside_are_told_at_the_end():
    model = elastic_model(block((1.0, 1.0), (2, 2)))
    model.couple("BOTTOM", "y")
    supported(model, BOTTOM_LEFT={"y": -0.1}, LEFT="x")
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor(2))
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fc.solve(model, fc.linear_ramp(1))
    texts = [str(w.message) for w in caught]
    assert any("contact 'floor' carries nothing although its sides penetrate by 0.1:" in text for text in texts), texts
    assert not any("never closed" in text for text in texts)


def test_a_long_history_is_looked_at_in_some_instants():
    from fastcontact.model.prescribed_overlap import SOME, Supports

    supports = Supports(np.zeros((1, 2), bool), {}, fc.linear_ramp(1000))
    assert len(supports.instants()) == SOME
    assert supports.instants()[0] == 0.001
    assert supports.instants()[-1] == 1.0
