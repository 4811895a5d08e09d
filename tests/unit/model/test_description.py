"""Descriptions and digests of a model, its axis of symmetry, reference temperature and histories."""

import logging

import numpy as np
import pytest
from models import elastic_model, supported, with_contact, with_obstacle

import fastcontact as fc
from fastcontact.model.fingerprint import differing_parts, fingerprint
from fastcontact.model.ramp import ramp_of


def blocks():
    model = fc.Model(fc.generate.block_on_block(), kinematics="plane_strain")
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3), groups=["LOWER"])
    model.add_material(fc.LinearElastic(E=2000.0, nu=0.499), groups=["UPPER"])
    return supported(model, LOWER_BOTTOM="xy", UPPER_TOP={"y": -0.1, "ramp": [(0.0, 0.0), (1.0, 1.0)]})


def test_every_part_is_told():
    model = blocks()
    model.add_pressure("UPPER_LEFT", lambda x: x[:, 1])
    model.add_traction("UPPER_RIGHT", x=3.0)
    model.add_spring("UPPER", y=2.0)
    model.couple("UPPER_TOP", "x")
    with_contact(model, "joint", "CONT_UPPER", "CONT_LOWER", formulation="mortar", friction=0.25, clearance=0.1)
    lines = model.describe().splitlines()
    assert lines[0].startswith(
        "A model in plane strain (forces are those for a depth of 1) of 73 points, 50 quad4: 146"
    )
    told = "\n".join(lines[1:])
    for text in (
        "Material: E = 1000, nu = 0.3 in 'LOWER'.",
        "Material: E = 2000, nu = 0.499 in 'UPPER', with the mean-dilatation method.",
        "Support: x = 0, y = 0 on 'LOWER_BOTTOM' (9 points).",
        "Support: y = -0.1 on 'UPPER_TOP' (7 points), with a separate history.",
        "Load: the pressure on 'UPPER_LEFT': a function of position.",
        "Load: the traction on 'UPPER_RIGHT': x = 3.",
        "Relation: couple('UPPER_TOP', 'x').",
        "Spring: on 'UPPER'.",
        "Contact 'joint': 'CONT_UPPER' (7 points) on 'CONT_LOWER', mortar, with friction 0.25 "
        "(further options: clearance).",
    ):
        assert text in told


def test_units_are_told_where_they_are_known():
    model = blocks()
    assert "Units" not in model.describe()
    model.units = {"length": "mm", "force": "-", "pressure": "MPa"}
    assert "Units: length in mm, pressure in MPa." in model.describe()


def test_what_is_missing_is_told():
    told = fc.Model(fc.generate.box(), kinematics="3d").describe()
    assert "three dimensions" in told
    assert "Material: none yet." in told
    assert "Support: none." in told
    assert "Contact: none." in told


def test_axis_obstacle_and_kinds():
    model = fc.Model(fc.generate.half_spheres(size=25.0), kinematics="axisymmetric")
    model.add_contact("glue", secondary="CONT1", primary="CONT2", kind="tied")
    model.add_obstacle("floor", secondary="A2B2", obstacle=fc.obstacles.HalfSpace((0.0, 60.0), (0.0, -1.0)))
    told = model.describe()
    assert "points on the axis, by symmetry" in told
    assert "mortar with dual multipliers, tied" in told
    assert "on a rigid obstacle, node_to_segment, without friction" in told


def test_a_number_of_steps_solves_so_many():
    model = blocks()
    model.add_contact("joint", secondary="CONT_UPPER", primary="CONT_LOWER")
    model.fix("UPPER_TOP", "x")
    by_number, by_ramp = fc.solve(model, 2), fc.solve(model, fc.linear_ramp(2))
    by_array = fc.solve(model, [0.5, 1.0])
    assert [step.load_factor for step in by_number] == [0.5, 1.0]
    for steps in (by_number, by_array):
        assert all((a.displacement == b.displacement).all() for a, b in zip(steps, by_ramp, strict=True))


def test_every_material_load_and_connection_is_told():
    mesh = fc.generate.with_reference_points(fc.generate.block(), {"REF": (0.0, 2.0)})
    model = fc.Model(mesh, "plane_strain")
    told = {
        "Material: E = (1, 2, 3), nu = (0.1, 0.1, 0.1)": fc.Orthotropic(
            (1.0, 2.0, 3.0), (0.1,) * 3, (1.0,) * 3, density=1.0
        ),
        "Material: D with the diagonal": fc.Anisotropic(np.eye(6), density=1.0),
        "nu = 0.3 in all solid cells, with incompatible modes.": fc.LinearElastic(1.0, 0.3, incompatible_modes=True),
    }
    for text, material in told.items():
        model.materials.clear()
        model.add_material(material)
        assert text in model.describe()
    model.add_temperature(5.0, reference=1.0)
    model.add_temperature(np.zeros(mesh.n_points), "BLOCK", ramp=[(0.0, 0.0), (1.0, 1.0)])
    model.add_gravity(y=-1.0)
    model.add_centrifugal(3.0)
    model.add_moment("REF", z=1.5)
    model.add_coupling("REF", "TOP")
    model.add_hydrostatic_pressure("LEFT", weight=1.0, level=2.0)
    lines = model.describe()
    for text in (
        "Temperature: 5 (reference: 1) in all solid cells.",
        "Temperature: a number for each point (reference: 0) in 'BLOCK', with a separate history.",
        "gravity",
        "Load: the centrifugal force",
        "Load: the moment on 'REF': z = 1.5.",
        "Load: the pressure on 'LEFT': a function of position.",
        "Relation: the coupling of 'REF' with 'TOP'.",
    ):
        assert text in lines, text
    assert "coupling" in model._repr_html_()


def spheres(mesh, held, **contact):
    model = elastic_model(mesh, "axisymmetric", E=20_000.0)
    if held:
        model.fix("A1A2", "x")
    supported(model, A2B2={"y": -0.2}, A1B1={"y": 0.2})
    model.add_contact("c", secondary="CONT1", primary="CONT2", **contact)
    return fc.solve(model, fc.linear_ramp(1))[-1]


@pytest.mark.each_value
@pytest.mark.parametrize("formulation", ["node_to_segment", "continuous", "mortar", None])
@pytest.mark.parametrize("element", ["tri3", "quad4", "tri6"])
def test_results_are_those_of_the_model_whose_axis_is_held(element, formulation):
    sizes = {"size": 16.0} if element.startswith("tri") else {"arc_sizes": (8.0, 16.0), "radial_sizes": (8.0, 16.0)}
    mesh = fc.generate.half_spheres(element, **sizes)
    if element == "tri6" and formulation == "node_to_segment":
        pytest.skip("node-to-segment refuses facets whose corner nodes carry no pressure")
    free, held = (spheres(mesh, held, formulation=formulation) for held in (False, True))
    assert (free.displacement == held.displacement).all()
    assert (free.reaction == held.reaction).all()
    assert (free.displacement[mesh.points_of("A1A2"), 0] == 0.0).all()
    assert (free.contact["c"].pressure == held.contact["c"].pressure).all()


def cylinder(inner=0.0):
    return elastic_model(fc.generate.block((1.0, 1.0), (2, 2), origin=(inner, 0.0)), "axisymmetric", BOTTOM="y")


def test_one_line_says_which_nodes_are_held(caplog):
    with caplog.at_level(logging.INFO, "fastcontact"):
        cylinder().check()
    assert [r.message for r in caplog.records] == [
        "axis of symmetry: x is fixed at 3 nodes with x = 0 (first: point 0)"
    ]
    caplog.clear()
    held = cylinder()
    held.fix("LEFT", "x")
    ring = cylinder(inner=0.1)
    with caplog.at_level(logging.INFO, "fastcontact"):
        held.check()
        ring.check()
    assert not caplog.records


def test_nodes_of_single_precision_are_on_the_axis_and_others_not():
    points = cylinder().mesh.points.copy()
    left = cylinder().mesh.points_of("LEFT")
    points[left[0], 0], points[left[1], 0] = 4e-8, 1e-3
    assert fc.Model(cylinder().mesh.replace(points=points), "axisymmetric").axis_nodes.tolist() == [left[0], left[2]]
    assert not len(fc.Model(cylinder().mesh, "plane_strain").axis_nodes)


def test_a_function_of_the_radius_that_vanishes_on_the_axis_is_not():
    model = cylinder()
    model.prescribe("TOP", x=lambda points: 0.1 * (points[:, 0] + 1e-12))
    model.check()
    fixed, values = model.prescribed()
    corner = model.mesh.point("TOP_LEFT")
    assert fixed[corner, 0]
    assert values[corner, 0] == 0.0


def test_a_relation_that_moves_the_axis_is_refused():
    model = cylinder()
    model.relate([("TOP_LEFT", "x", 1.0)], 0.1)
    with pytest.raises(fc.ModelError, match="contradicts"):
        model.check()


def test_a_radial_traction_on_the_axis_goes_into_it():
    """Facets that reach the axis carry the traction; at r = 0 nothing moves."""
    model = cylinder()
    model.add_traction("TOP", x=1.0)
    (step,) = fc.solve(model, fc.linear_ramp(1))
    assert not step.displacement[model.mesh.points_of("LEFT"), 0].any()
    assert step.displacement[model.mesh.point("TOP_RIGHT"), 0] > 0.0


@pytest.mark.parametrize(("options", "rise"), [({}, 60.0), ({"reference": 0.0}, 80.0)])
def test_a_free_block_expands_by_the_rise_over_the_reference(options, rise):
    model = fc.Model(fc.generate.block(), kinematics="plane_stress", reference_temperature=20.0)
    model.add_material(fc.LinearElastic(E=1000.0, nu=0.3, expansion=1e-5))
    supported(model, LEFT="x", BOTTOM="y")
    model.add_temperature(80.0, **options)
    assert fc.solve(model, 1)[-1].displacement.max() == pytest.approx(1e-5 * rise, rel=1e-9)


def model(pressure=lambda points: 1.0 + points[:, 0], height=3.0, order=1, stiffness=2.0, mass=1.0):
    found = elastic_model(fc.generate.block((2.0, 1.0), (6, 3), "quad4", origin=(-1.0, -1.0)), "plane_strain")
    supports = [("BOTTOM", {"y": 0.0}), ("LEFT", {"x": 0.0})][::order]
    for group, values in supports:
        found.prescribe(group, **values)
    found.add_pressure("RIGHT", pressure)
    found.add_body_force(y=-mass)
    found.add_spring("TOP", x=stiffness)
    return with_obstacle(found, "ball", "TOP", fc.obstacles.Sphere((0.0, height), height), motion={"y": -0.1})


def parts(**changes):
    return fingerprint(model(**changes), {"geometry_updates": None})


def test_the_same_case_has_the_same_digests_however_it_was_put_together():
    expected = parts()
    assert parts() == expected
    assert parts(order=-1) == expected
    assert parts(pressure=lambda points: points[:, 0] + 1.0) == expected, "a function counts by its values"
    assert all(len(digest) == 16 for digest in expected.values())


@pytest.mark.parametrize(
    ("change", "part"),
    [
        ({"pressure": lambda points: 1.0 + points[:, 1]}, "the loads"),
        ({"pressure": lambda points: np.nextafter(1.0 + points[:, 0], np.inf)}, "the loads"),
        ({"mass": 1.0 + 1e-15}, "the loads"),
        ({"height": 3.1}, "contact 'ball'"),
        ({"stiffness": 2.5}, "the springs"),
    ],
)
def test_what_changed_is_named(change, part):
    assert differing_parts(parts(), parts(**change)) == [part]


@pytest.mark.parametrize(("values", "digest"), [(100.0, "3ac392ebd97a4d4c"), (np.ones((2, 9)), "6895e0e40b806985")])
def test_digests_of_temperatures_are_those_in_files_of_earlier_versions(values, digest):
    model = elastic_model(fc.generate.block((1.0, 1.0), (2, 2)), "plane_strain")
    model.add_temperature(values, **({"times": [0.0, 1.0]} if np.ndim(values) else {}))
    assert fingerprint(model)["the temperatures"] == digest


def test_options_count():
    one, other = (fingerprint(model(), {"geometry_updates": updates}) for updates in (None, 2))
    assert differing_parts(one, other) == ["the option geometry_updates"]
    assert differing_parts(one, fingerprint(model())) == ["the option geometry_updates"]


def test_functions_that_fail_are_told_apart_by_their_names():
    """The check of the model says what is wrong with them."""

    def wrong(points):
        raise ZeroDivisionError

    def other(points):
        raise ZeroDivisionError

    assert differing_parts(parts(pressure=wrong), parts(pressure=wrong)) == []
    assert differing_parts(parts(pressure=wrong), parts(pressure=other)) == ["the loads"]


@pytest.mark.parametrize(
    ("given", "instants", "table"),
    [
        (4, (0.25, 0.5, 0.75, 1.0), ((0.0, 0.0), (1.0, 1.0))),
        (np.int64(2), (0.5, 1.0), ((0.0, 0.0), (1.0, 1.0))),
        (np.array([0.5, 0.75]), (0.5, 0.75), ((0.0, 0.0), (1.0, 1.0))),
        ([0.5, 1.0, 1.5], (0.5, 1.0, 1.5), ((0.0, 0.0), (1.5, 1.5))),
        (np.array([[0.0, 0.0], [1.0, 1.0], [2.0, 0.2]]), (1.0, 2.0), ((0.0, 0.0), (1.0, 1.0), (2.0, 0.2))),
        ([(0.0, 0.0), (1.0, 1.0)], (1.0,), ((0.0, 0.0), (1.0, 1.0))),
        (iter([0.5, 1.0]), (0.5, 1.0), ((0.0, 0.0), (1.0, 1.0))),
    ],
)
def test_numbers_and_arrays_are_ramps(given, instants, table):
    ramp = ramp_of(given)
    assert ramp.instants == instants
    assert ramp.table == table


def test_a_ramp_stays_itself_and_none_is_the_default():
    ramp = fc.Ramp((1.0,))
    assert ramp_of(ramp) is ramp
    assert ramp_of(None) == fc.linear_ramp(20)
    assert fc.Ramp(np.array([0.5, 1.0])) == fc.Ramp((0.5, 1.0))


@pytest.mark.parametrize("given", [[1.0, 0.5], [[0.0, 0.0, 0.0]], [["a", "b"]], np.zeros((2, 2, 2)), [np.nan]])
def test_what_is_no_ramp(given):
    with pytest.raises(fc.ModelError):
        ramp_of(given)
