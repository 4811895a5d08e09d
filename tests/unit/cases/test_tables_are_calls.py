"""A table of a case file makes the model that the call of the same name makes."""

import math

import pytest

import fastcontact as fc
from fastcontact.cases.case import build_case
from fastcontact.model.fingerprint import fingerprint

BASE = {
    "kinematics": "plane_strain",
    "mesh": {"generator": "block"},
    "material": [{"E": 1e3, "nu": 0.3, "density": 2.0}],
}
RAMP = [[0.0, 0.0], [1.0, 1.0], [3.0, 2.0]]
TURN = {"angle": -0.5, "centre": [0.0, 5.0], "ramp": RAMP}
ALONG_X = {"along": "x", "table": [[0, 0], [2, 1e-3]]}
BALL = {"kind": "sphere", "centre": [1.0, 6.0], "R": 5.0}
OF_CONTACT = {
    "secondary": "TOP",
    "motion": {"y": -0.02},
    "ramp": RAMP,
    "friction": 0.3,
    "wear": 2e-5,
    "clearance": 0.003,
}
AXES = {"origin": [-1.0, -1.0, 0.0]}
CENTRE = fc.CylindricalAxes(**AXES)
OF_SPRING = {"axial": 20.0, "transverse": 2.0}
FORCE = {"at": [0.5, 2.5], "weighting": "quadratic", "radius": 2.0}


# Each row: the kind of table, its keys, and the call.
@pytest.mark.parametrize(
    ("kind", "keys", "call"),
    [
        ("support", {"group": "LEFT", "x": 0.25, "rotation": TURN}, lambda m: m.prescribe("LEFT", x=0.25, rotation=TURN)),
        ("support", {"group": "LEFT", "normal": 0.1}, lambda m: m.prescribe("LEFT", normal=0.1)),
        ("support", {"group": "LEFT", "x": 0, "axes": [1.0, 1.0]}, lambda m: m.prescribe("LEFT", x=0.0, axes=(1.0, 1.0))),
        ("support", {"group": "LEFT", "y": 0.1, "axes": AXES}, lambda m: m.prescribe("LEFT", y=0.1, axes=CENTRE)),
        ("pressure", {"group": "TOP", "value": 1}, lambda m: m.add_pressure("TOP", 1.0)),
        ("traction", {"group": "TOP", "y": -1.0, "ramp": RAMP}, lambda m: m.add_traction("TOP", y=-1.0, ramp=RAMP)),
        ("body_force", {"groups": "BLOCK", "y": -1e-3}, lambda m: m.add_body_force("BLOCK", y=-1e-3)),
        ("relation", {"terms": [["TOP_LEFT", "y", 1.0], ["TOP_RIGHT", "y", -1.0]]},
         lambda m: m.relate([("TOP_LEFT", "y", 1.0), ("TOP_RIGHT", "y", -1.0)])),
        ("gravity", {"y": -3.0}, lambda m: m.add_gravity(y=-3.0)),
        ("centrifugal", {"speed": 2.0, "origin": [-1.0, 0.5], "ramp": RAMP},
         lambda m: m.add_centrifugal(2.0, origin=(-1.0, 0.5), ramp=RAMP)),
        ("temperature", {"value": 120.0, "reference": 20.0}, lambda m: m.add_temperature(120.0, reference=20.0)),
        ("initial_stress", {"xx": 5.0}, lambda m: m.add_initial_stress(xx=5.0)),
        ("initial_strain", {"groups": "BLOCK", "xx": ALONG_X, "axes": AXES, "ramp": RAMP},
         lambda m: m.add_initial_strain("BLOCK", xx=fc.Tabulated(**ALONG_X), axes=CENTRE, ramp=RAMP)),
        ("force", {"group": "TOP", "y": -1.0, **FORCE}, lambda m: m.add_force("TOP", y=-1.0, **FORCE)),
        ("moment", {"group": "REF", "z": 5.0}, lambda m: m.add_moment("REF", z=5.0)),
        ("hydrostatic_pressure", {"group": "TOP", "weight": 0.001, "level": 2.0, "axis": "y"},
         lambda m: m.add_hydrostatic_pressure("TOP", weight=0.001, level=2.0, axis="y")),
        ("couple", {"group": "TOP", "component": "normal"}, lambda m: m.couple("TOP", "normal")),
        ("group_relation",
         {"first": "LEFT", "second": "RIGHT", "component": "x", "coefficients": [2.0, -1.0], "value": 0.02},
         lambda m: m.relate_groups("LEFT", "RIGHT", "x", coefficients=(2.0, -1.0), value=0.02)),
        ("periodicity", {"first": "LEFT", "second": "RIGHT", "x": 0.01, "ramp": RAMP},
         lambda m: m.add_periodicity("LEFT", "RIGHT", x=0.01, ramp=RAMP)),
        ("spring", {"group": "RIGHT", "direction": [1.0, 1.0], **OF_SPRING},
         lambda m: m.add_spring("RIGHT", direction=(1.0, 1.0), **OF_SPRING)),
        ("spring", {"group": "LEFT", "to": "RIGHT", "translation": [2.0, 0.0], **OF_SPRING},
         lambda m: m.add_spring("LEFT", "RIGHT", translation=(2.0, 0.0), **OF_SPRING)),
    ],
)  # fmt: skip
def test_an_entry_of_a_list(kind, keys, call):
    assert_equal({kind: [keys]}, call)


def test_a_coupling_adds_its_reference_point():
    keys = {"reference": "OTHER", "group": "RIGHT", "place": [2.5, 0.5], "kind": "distributing"}
    mesh = fc.generate.with_reference_points(block(), {"OTHER": (2.5, 0.5)})
    assert_equal({"coupling": [keys]}, lambda m: m.add_coupling("OTHER", "RIGHT", kind="distributing"), mesh)


def test_an_obstacle():
    obstacle = fc.obstacles.Sphere((1.0, 6.0), 5.0)
    assert_equal(
        {"obstacle": {"ball": {"shape": BALL, "rotation": TURN, **OF_CONTACT}}},
        lambda m: m.add_obstacle("ball", obstacle=obstacle, rotation=TURN, **OF_CONTACT),
    )


@pytest.mark.parametrize(
    "options",
    [
        {"clearance": 0.005},
        {"clearance": -0.01, "clearance_ramp": RAMP},
        {"clearance_primary": 1e-3},
        {"excluded": "UPPER_LEFT", "normals": "averaged"},
        {"friction": 0.2, "frictionless": ["UPPER_LEFT"]},
        {"kind": "tied"},
        {"kind": "bilateral", "formulation": "mortar"},
        {"penalty": 1e5},
    ],
    ids=str,
)
def test_a_contact_pair(options):
    sides, mesh = {"secondary": "CONT_UPPER", "primary": "CONT_LOWER"}, fc.generate.block_on_block("quad4")
    assert_equal({"contact": {"pair": sides | options}}, lambda m: m.add_contact("pair", **sides, **options), mesh)


def test_cyclic_symmetry():
    angle = 2 * math.pi / 5
    sector = fc.generate.block((1.0, 1.0), (2, 4))
    x, y = sector.points.T
    sector = sector.replace(
        points=[[(1 + r) * math.cos(angle * t), (1 + r) * math.sin(angle * t)] for r, t in zip(x, y)]
    )
    keys = {"first": "BOTTOM", "second": "TOP", "sectors": 5}
    assert_equal({"cyclic_symmetry": [keys]}, lambda m: m.add_cyclic_symmetry("BOTTOM", "TOP", sectors=5), sector)


def block():
    return fc.generate.with_reference_points(fc.generate.block((2.0, 1.0), (4, 2), "quad4"), {"REF": (3.0, 0.5)})


def assert_equal(entries, call, mesh=None):
    """Assert that `entries` and `call` make one model, which is not the model without them."""
    found = build_case(
        BASE | entries, name="case", mesh=block() if "coupling" in entries or mesh is None else mesh
    ).model
    model = fc.Model(found.mesh if mesh is None else mesh, "plane_strain")
    model.add_material(fc.LinearElastic(1e3, 0.3, density=2.0))
    without = fingerprint(model)
    call(model)
    assert fingerprint(found) == fingerprint(model) != without
    assert [*found.describe()] == [*model.describe()]
