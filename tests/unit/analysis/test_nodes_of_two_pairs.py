"""Nodes shared by two node-to-segment pairs: one constraint, whose force both carry by area."""

import logging

import numpy as np
import pytest
from models import elastic_model, united, with_contact

import fastcontact as fc

pytestmark = pytest.mark.filterwarnings("ignore:.*across its radius", "ignore:.*raise its penalty")
CLEARANCE = 0.003


def pressed(pairs, element="hex8", **options):
    """A block on a larger one, whose lower side belongs to `pairs` = 1 or 2 contacts that meet along a line of nodes."""
    lower = fc.generate.box((1.4, 1.2, 0.5), (4, 3, 2), element, (-0.2, -0.1, -0.5), name="LOWER")
    mesh = united(L=lower, U=fc.generate.box((1.0, 1.0, 0.5), (4, 4, 2), element, (0.0, 0.0, 0.0), name="UPPER"))
    mesh = mesh.with_facet_group("LEFT", lambda x: (abs(x[:, 2]) < 1e-9) & (x[:, 0] < 0.5))
    bottom = mesh.cell_groups["UZMIN"]
    left = np.intersect1d(bottom, mesh.cell_groups["LEFT"])
    groups = {**mesh.cell_groups, "LEFT": left, "RIGHT": np.setdiff1d(bottom, left)}
    model = elastic_model(mesh.replace(cell_groups=groups), "3d", LZMIN="xyz", UZMAX={"x": 0.004, "y": 0.0, "z": -0.01})
    clearances = options.pop("clearances", (0.0, 0.0))
    for name, clearance in zip(["LEFT", "RIGHT"] if pairs == 2 else ["UZMIN"], clearances, strict=False):
        own = {"clearance": clearance} if clearance else {}
        with_contact(model, name, name, "LZMAX", formulation="node_to_segment", normals="facet", **options, **own)
    return model


def solved(model, solver):
    return fc.solve(model, fc.linear_ramp(2), linear_solver=solver)[-1]


def together(step):
    """Return the contact forces (n_points, 3) of all pairs on the secondary side."""
    total = np.zeros_like(step.displacement)
    for contact in step.contact.values():
        np.add.at(total, contact.points, contact.force_vectors)
    return total


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("open_side", ["LEFT", "RIGHT"])
def test_a_node_of_two_pairs_of_different_clearance_is_held_by_the_tighter_one(open_side, solver):
    clearances = (CLEARANCE, 0.0) if open_side == "LEFT" else (0.0, CLEARANCE)
    step = solved(pressed(2, clearances=clearances), solver)
    left, right = step.contact["LEFT"], step.contact["RIGHT"]
    _, mine, theirs = np.intersect1d(left.points, right.points, return_indices=True)
    loose, rows = (left, mine) if open_side == "LEFT" else (right, theirs)
    tight, held = (right, theirs) if open_side == "LEFT" else (left, mine)
    assert tight.active[held].any()
    shut = tight.active[held]
    assert loose.gap[rows[shut]] == pytest.approx(CLEARANCE, rel=1e-6)
    assert not loose.active[rows[shut]].any()
    assert not loose.force_vectors[rows[shut]].any()


@pytest.mark.each_value
@pytest.mark.parametrize("solver", ["direct", "amg"])
@pytest.mark.parametrize("overlap", [-0.001, 0.001])
def test_a_wall_at_the_same_nodes_is_no_third_of_them(overlap, solver, caplog):
    """Beside two pairs along one normal a node may have a third one along another, before or behind them."""
    steps = []
    for pairs in (1, 2):
        model = pressed(pairs)
        wall = fc.obstacles.HalfSpace(point=(0.0, overlap, 0.0), normal=(0.0, 1.0, 0.0))
        model.add_obstacle("wall", secondary="UYMIN", obstacle=wall, formulation="node_to_segment")
        with caplog.at_level(logging.INFO, "fastcontact"):
            steps.append(solved(model, solver))
    one, two = steps
    assert not any("are linearly dependent" in record.message for record in caplog.records)
    assert together(two) == pytest.approx(together(one), abs=1e-7 * np.abs(together(one)).max())
    left, right = two.contact["LEFT"], two.contact["RIGHT"]
    _, mine, theirs = np.intersect1d(left.points, right.points, return_indices=True)
    assert right.pressure[theirs] == pytest.approx(left.pressure[mine], abs=1e-7 * left.pressure.max())


def beside_a_third_body(formulation):
    """The two blocks, and a third one that the upper block touches with part of a side."""
    third = fc.generate.box((0.4, 0.4, 0.3), (2, 2, 2), "hex8", (0.3, 1.0, 0.1), name="THIRD")
    model = elastic_model(fc.generate.union(pressed(2).mesh, united(T=third)), "3d", LZMIN="xyz", TYMAX="xyz")
    model.prescribe("UZMAX", x=0.004, y=0.0, z=-0.01)
    for name in ("LEFT", "RIGHT"):
        model.add_contact(name, secondary=name, primary="LZMAX", formulation="node_to_segment", normals="facet")
    return with_contact(model, "side", "UYMAX", "TYMIN", formulation=formulation)


@pytest.mark.parametrize("formulation", ["mortar", "continuous", "node_to_segment"])
@pytest.mark.filterwarnings("ignore:.*integration points of complete facets")
def test_a_pair_that_shares_no_nodes_keeps_its_pressures(formulation):
    """Nodes of a mortar that face nothing stand for no area, by which nothing may be divided."""
    side = solved(beside_a_third_body(formulation), "direct").contact["side"]
    assert np.isfinite(side.pressure).all()
    assert 0.2 < side.pressure_max < 20.0
    assert side.force_vectors.sum(axis=0) == pytest.approx(side.force, rel=1e-12)
    assert -side.force[1] == pytest.approx(0.26, rel=0.2)


@pytest.mark.each_value
@pytest.mark.parametrize("element", ["hex8", "tet4"])
@pytest.mark.parametrize("penalty", [None, 1e5])
@pytest.mark.parametrize("solver", ["direct", "amg"])
def test_two_pairs_are_what_one_of_both_is(solver, penalty, element, caplog):
    options = {"element": element} | ({} if penalty is None else {"penalty": penalty})
    one = solved(pressed(1, **options), solver)
    with caplog.at_level(logging.INFO, "fastcontact"):
        two = solved(pressed(2, **options), solver)
    assert not any("are linearly dependent" in record.message for record in caplog.records)  # columns of the inverse
    assert together(two) == pytest.approx(together(one), abs=1e-7 * np.abs(together(one)).max())
    left, right = two.contact["LEFT"], two.contact["RIGHT"]
    common, mine, theirs = np.intersect1d(left.points, right.points, return_indices=True)
    assert len(common) == 5
    for name in ("pressure", "gap"):
        values = getattr(left, name)
        assert getattr(right, name)[theirs] == pytest.approx(values[mine], abs=1e-7 * max(np.abs(values).max(), 1e-3))
    assert (left.active[mine] == right.active[theirs]).all()
    assert left.active[mine].any()
