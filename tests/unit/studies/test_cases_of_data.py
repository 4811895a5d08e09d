"""Studies of cases built from data in Python, values set by path, quantities between nodes."""

from types import SimpleNamespace

import numpy as np
import pytest
from case_texts import FLAT
from models import elastic_model
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import build_case, read_case
from fastcontact.studies.case_parameters import substitute
from fastcontact.studies.quantities import contact_radius, node_spacings, peak

DATA = {
    "kinematics": "plane_strain",
    "mesh": {"generator": "block", "size": [2.0, 1.0], "divisions": [4, 2]},
    "material": [{"E": 1000.0, "nu": 0.3}],
    "support": [{"group": "BOTTOM", "x": 0.0, "y": 0.0}],
    "obstacle": {
        "plane": {
            "secondary": "TOP",
            "shape": {"kind": "half_space", "point": [0.0, 1.0], "normal": [0.0, -1.0]},
            "motion": {"y": -0.01},
        }
    },
    "ramp": {"steps": 1},
}


def test_columns_name_contacts_and_contain_the_forces_of_bolts(tmp_path):
    mesh = fc.generate.block((2.0, 1.0), (4, 2))
    mesh = mesh.with_facet_group("CUT", lambda x: np.abs(x[:, 1] - 0.5) < 1e-9, between=True)
    fc.write_mesh(tmp_path / "bar.med", mesh)
    wall = {"secondary": "LEFT", "shape": {"kind": "half_space", "point": [0.0, 0.0], "normal": [1.0, 0.0]}}
    data = {**DATA, "mesh": {"file": "bar.med"}, "obstacle": {"upper": DATA["obstacle"]["plane"], "wall": wall}}
    data["pretension"] = [{"name": "bolt", "section": "CUT", "shortening": 0.001}]
    data["units"] = {"length": "mm", "force": "N", "pressure": "MPa"}
    theory = {"kind": "hertz_line", "E1": 1000.0, "nu1": 0.3, "R1": 1.0, "force": 1.0}
    data["theory"] = {"upper": theory, "wall": theory}
    data["study"] = {"parameters": {"soft": {"material[0].E": "value"}, "other": {"theory.wall.E1": "value"}}}
    case = build_case(data, name="bolted", folder=tmp_path)
    sweep = fc.parameter_sweep(case, {"pretension[0].shortening": [0.001, 0.002]}, workers=1)
    header, *rows = sweep.tables()[0][1]
    assert "force of 'upper' [N/mm]" in header
    bolt = fc.solve(case.model, 1)[-1].pretension["bolt"]
    assert float(rows[0][header.index("bolt.pretension_force [N/mm]")]) == pytest.approx(bolt["force"])
    assert sweep.as_dict()["contact"] == "upper"
    soft = fc.parameter_sweep(case, {"soft": [500.0, 1000.0]}, workers=1).remarks()
    assert any(text.endswith("also set keys of [theory.upper]") for text in soft)
    other = {"other": [500.0, 1000.0]}
    refused(fc.CaseError, "contact '.*'\\) do not read 'other'", fc.parameter_sweep, case, other, workers=1)


def test_a_case_of_data_can_be_studied():
    case = build_case(DATA, name="mine")
    study = fc.convergence_study(case, levels=2, workers=1)
    assert [level.n_dofs for level in study.series[0].levels] == [30, 90]
    sweep = fc.parameter_sweep(case, {"material[0].E": [1000.0, 2000.0]}, workers=1)
    soft, stiff = (point.values["force"] for point in sweep.points)
    assert stiff == pytest.approx(2.0 * soft, rel=1e-6)
    assert len(repr(study.series[0].levels)) < 2000  # profiles of nodes are no part of it
    assert "profile" not in repr(sweep.points[0])
    adaptive = fc.adaptive_study(case, "force", 0.5, max_rounds=1)
    assert adaptive.rounds[0].values["force"] == pytest.approx(soft, rel=1e-6)
    assert read_again(case.text).describe() == case.model.describe()


def read_again(text):
    import tomllib

    return build_case(tomllib.loads(text), name="again").model


@pytest.mark.parametrize(
    "study",
    [
        lambda case: fc.convergence_study(case, 2),
        lambda case: fc.parameter_sweep(case, {"material[0].E": [1.0, 2.0]}),
        lambda case: fc.adaptive_study(case, "force"),
    ],
)
def test_what_is_no_case_file_is_refused(study, tmp_path):
    (tmp_path / "plate.inp").write_text(FLAT)
    with pytest.raises(
        fc.CaseError, match="'plate' is an input deck: studies change the mesh and the values of a case file"
    ):
        study(read_case(tmp_path / "plate.inp"))


def test_a_maximum_on_the_axis_is_that_of_a_quartic_along_it():
    mesh = fc.generate.block((1.0, 2.0), (4, 60))
    x, y = mesh.points.T
    value, where = peak(mesh, 3.0 - 2.0 * (y - 0.917) ** 2 + (y - 0.917) ** 4 - x**2, axisymmetric=True)
    assert value == pytest.approx(3.0, rel=1e-12)
    assert where == pytest.approx([0.0, 0.917], abs=1e-9)


@pytest.mark.parametrize("axisymmetric", [True, False])
def test_with_few_nodes_a_parabola_through_the_neighbours_does(axisymmetric):
    mesh = fc.generate.block((1.0, 2.0), (4, 8))
    x, y = mesh.points.T
    x0 = 0.0 if axisymmetric else 0.55
    value, where = peak(mesh, 3.0 - (y - 0.9) ** 2 - (x - x0) ** 2, axisymmetric)
    assert value == pytest.approx(3.0, rel=1e-12)
    assert where == pytest.approx([x0, 0.9], abs=1e-12)


def test_where_no_vertex_is_near_the_node_itself_is_taken():
    mesh = fc.generate.block((1.0, 2.0), (4, 8))
    values = mesh.points @ [1.0, 2.0]  # largest in a corner
    value, where = peak(mesh, values, axisymmetric=False)
    assert value == 5.0
    assert where.tolist() == [1.0, 2.0]


@pytest.mark.parametrize(("element", "distance"), [("quad4", 0.5), ("quad8", 0.25)])
def test_quantities_that_are_positions_of_nodes_are_known_to_half_their_distance(element, distance):
    mesh = fc.generate.block((1.0, 2.0), (4, 4), element)
    values = mesh.points @ [1.0, 2.0]
    pair = SimpleNamespace(radius=(1.0, 1.2), stick_radius=(np.nan, np.nan))
    far = SimpleNamespace(radius=(1.0, np.inf), stick_radius=(0.4, 0.5))
    step = SimpleNamespace(contact={"c": pair, "far": far}, von_mises=values)
    found = node_spacings(step, "c", {"von_mises_max": values.max(), "contact_radius": 1.1}, mesh)
    expected = {"c.radius": 0.1, "contact_radius": 0.1, "far.stick_radius": 0.05, "von_mises_depth": 0.5 * distance}
    assert found == pytest.approx(expected)
    # Interpolated values.
    found = node_spacings(step, "c", {"von_mises_max": 1.01 * values.max(), "contact_radius": 1.13}, mesh)
    assert found == pytest.approx({"c.radius": 0.1, "far.stick_radius": 0.05})


def contact(pressure, radius, r=None):
    r = np.linspace(0.0, 1.0, len(pressure)) if r is None else r
    pressure = np.asarray(pressure, float)
    return SimpleNamespace(radius=radius, across=r, active=pressure > 0, pressure=pressure, is_ring=False)


def test_the_radius_is_where_the_pressure_of_hertz_ends():
    r = np.linspace(0.0, 1.0, 41)
    pressure = np.sqrt(np.maximum(1.0 - (r / 0.718) ** 2, 0.0))
    assert contact_radius(contact(pressure, (0.7, 0.725), r)) == pytest.approx(0.718, rel=1e-12)


@pytest.mark.parametrize(
    ("pressure", "bracket", "radius"),
    [
        ([0.0] * 5, (np.nan, np.nan), np.nan),  # open
        ([1.0] * 5, (1.0, np.inf), np.nan),  # closed to its end
        ([1.0, 0.5, 0.0, 0.0, 0.0], (0.25, 0.5), 0.375),  # too few nodes for a line
        ([1.0, 1.0, 1.1, 1.1, 1.2, 1.4, 1.8, 3.0, 0.0], (0.875, 1.0), 1.0),  # a punch
    ],
)
def test_where_there_is_no_edge_to_fit_the_bracket_answers(pressure, bracket, radius):
    assert contact_radius(contact(pressure, bracket)) == pytest.approx(radius, nan_ok=True)


PARSED = {
    "material": [{"E": 1.0, "nu": 0.3}, {"E": 2.0, "nu": 0.2}],
    "contact": {"pair": {"friction": 0.1}},
    "mesh": {"arc_sizes": [1.0, 2.0]},
}
LINKED = {
    "size": {"mesh.arc_sizes[0]": "0.5*value^2", "mesh.arc_sizes[1]": "value", "contact.pair.friction": "-1e-1*value"}
}


def linked(parameters):
    return PARSED | {"study": {"parameters": parameters}}


@pytest.mark.parametrize(
    ("path", "value", "where"),
    [
        ("material[1].E", 7.0, lambda data: data["material"][1]["E"]),
        ("contact.pair.friction", 0.4, lambda data: data["contact"]["pair"]["friction"]),
        ("contact.pair.formulation", "mortar", lambda data: data["contact"]["pair"]["formulation"]),
        ("mesh.arc_sizes[0]", 3.0, lambda data: data["mesh"]["arc_sizes"][0]),
    ],
)
def test_a_path_sets_one_value_and_leaves_the_case_alone(path, value, where):
    assert where(substitute(PARSED, {path: value})) == value
    assert PARSED["material"][1]["E"] == 2.0
    assert PARSED["mesh"]["arc_sizes"] == [1.0, 2.0]
    assert "formulation" not in PARSED["contact"]["pair"]


def test_a_name_sets_several_paths_by_their_laws():
    found = substitute(linked(LINKED), {"size": 3.0})
    assert found["mesh"]["arc_sizes"] == [4.5, 3.0]
    assert found["contact"]["pair"]["friction"] == pytest.approx(-0.3)


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("sise", "'size'"),
        ("material[2].E", r"\[2\].*case has 2"),
        ("contact.pear.friction", "'pair'"),
        ("mesh.arc_sizes", "name a single value"),
        ("contact.pair", "name a single value"),
        ("material.E", r"the number of a table before 'E', such as \[0\]"),
        ("material[0].E.x", "unknown entry"),
        ("a..b", "not a path"),
        ("material[x].E", "not a path"),
    ],
)
def test_a_wrong_path_is_told(path, words):
    refused(fc.CaseError, words, substitute, linked(LINKED), {path: 1.0})


@pytest.mark.parametrize("law", ["2*valve", "value+1", "__import__('os')", 3.0, "value^x"])
def test_a_law_is_a_power_of_the_value_and_nothing_else(law):
    refused(fc.CaseError, r"a\*value\^p", substitute, linked({"n": {"contact.pair.friction": law}}), {"n": 2.0})


def test_a_power_of_a_negative_number_is_refused():
    with pytest.raises(fc.CaseError, match=r"cannot be evaluated for -2\.0"):
        substitute(linked({"n": {"contact.pair.friction": "value^0.5"}}), {"n": -2.0})


def test_a_ring_has_two_edges_and_no_contact_radius():
    model = elastic_model(fc.generate.block((2.0, 1.0), (20, 8)), "axisymmetric", BOTTOM="y")
    model.add_obstacle("torus", secondary="TOP", obstacle=fc.obstacles.Sphere((1.0, 2.0), 1.0), motion={"y": -0.02})
    contact = fc.solve(model, 1)[-1].contact["torus"]
    assert contact.is_ring
    assert "contact radius ring from 0.9 to 1.15" in repr(contact)
    assert np.isnan(contact_radius(contact))
