"""Checks of case files: admissible comparisons, quantities of contacts, summaries with units."""

import dataclasses
import tomllib

import numpy as np
import pytest
from case_texts import case_of
from matplotlib_pictures import contact_of
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import build_case, stored_description
from fastcontact.cases.checks import Check, outcome, quantity_value, read_check
from fastcontact.cases.summary import lines, step_entry, summarise
from fastcontact.cli._results import pressure_curves
from fastcontact.studies.quantities import measure, theory_quantities

HERTZ = fc.analytic.hertz_point(E1=1000.0, nu1=0.3, R1=10.0, force=4.0)
SLIP = fc.analytic.cattaneo_mindlin_line(
    E1=1e3, nu1=0.3, R1=9.0, E2=1e3, nu2=0.3, R2=9.0, force=2.0, friction=0.5, tangential_force=0.5
)
ELLIPSE = fc.analytic.hertz_elliptical(E1=1000.0, nu1=0.3, R1x=1.0, R1y=20.0, force=4.0)
THEORIES = {
    "hertz": {"theory": HERTZ, "share": 0.25},
    **{name: {"theory": theory, "share": 1.0} for name, theory in (("slip", SLIP), ("ellipse", ELLIPSE))},
}
PROBES = {"pole": 0, "far": 3}
PAIRS = {"hertz": {}, "slip": {}}


def step():
    """Four points on the secondary side: two stick, one slips, one is open."""
    m = 4
    contact = contact_of(
        np.arange(m), np.outer(np.arange(m), [1.0, 0.0]), name="hertz", formulation="continuous",
        abscissa=np.arange(m, dtype=float), pressure=np.array([5.0, 4.0, 2.0, 0.0]),
        active=np.array([True, True, True, False]), force=np.array([0.0, 1.1]), radius=(2.0, 3.0),
        shear=np.array([[0.3, 0.4], [0, 0], [0, 0], [0, 0]]), sticking=np.array([True, True, False, False]),
    )  # fmt: skip
    stress = np.tile([-1.0, -2.0, -3.0, 0.5], (m + 1, 1))
    displacement = np.tile([0.1, -0.2], (m + 1, 1))
    von_mises = np.full(m + 1, 7.0)
    return fc.StepResult(1, 1.0, displacement, stress, von_mises, -von_mises, np.zeros((m + 1, 2)), {"hertz": contact})


def check(**entry):
    return read_check("check[0]", {"tolerance": 0.1, **entry}, {**PROBES, "inside": 4}, PAIRS, THEORIES)


@pytest.mark.parametrize(
    ("quantity", "value", "unit"),
    [
        ("pole.pressure", 5.0, "pressure"),
        ("pole.shear", 0.5, "pressure"),
        ("far.von_mises", 7.0, "pressure"),
        ("far.stress.yy", -2.0, "pressure"),
        ("far.displacement.y", -0.2, "length"),
        ("hertz.force", 1.1, "force"),
        ("hertz.pressure_max", 5.0, "pressure"),
        ("hertz.radius", 2.5, "length"),
        ("hertz.stick_radius", 1.5, "length"),
    ],
)
def test_every_quantity_is_measured_in_its_unit(quantity, value, unit):
    found = check(quantity=quantity, value=1.0)
    assert found.factor * quantity_value(found.quantity, step(), PROBES) == pytest.approx(value, rel=1e-15)
    assert found.unit == unit


def test_targets_come_from_the_theory_or_are_documented():
    assert check(quantity="pole.pressure", theory="hertz").target(HERTZ) == HERTZ.pressure_max
    assert check(quantity="pole.stress.yy", theory="hertz").target(HERTZ) == -HERTZ.pressure_max
    assert check(quantity="hertz.radius", theory="hertz").target(HERTZ) == HERTZ.radius
    mean = 0.5 * (ELLIPSE.radius_x + ELLIPSE.radius_y)  # the bounds in 3D are the semi-axes
    assert check(quantity="hertz.radius", theory="ellipse").target(ELLIPSE) == mean > 1.1 * ELLIPSE.radius
    assert "contact_radius" in theory_quantities(HERTZ)
    assert "contact_radius" not in theory_quantities(ELLIPSE)
    assert check(quantity="hertz.stick_radius", theory="slip").target(SLIP) == SLIP.stick_radius
    assert (
        check(quantity="pole.shear", theory="slip", of="normal.pressure_max").target(SLIP) == SLIP.normal.pressure_max
    )
    assert check(quantity="pole.pressure", value=3.0).target(None) == 3.0


def test_the_force_of_a_quarter_counts_four_times():
    found = outcome(check(quantity="hertz.force", theory="hertz"), step(), PROBES, THEORIES)
    assert found["value"] == pytest.approx(4.4)
    assert found["target"] == 4.0
    assert found["deviation"] == pytest.approx(0.1)
    assert check(quantity="hertz.force", theory="hertz", factor=2.0).factor == 2.0
    assert check(quantity="hertz.radius", theory="hertz").factor == 1.0


def test_a_check_passes_within_its_tolerance_only():
    for tolerance, passed in ((0.11, True), (0.09, False)):
        entry = {"quantity": "hertz.force", "theory": "hertz", "tolerance": tolerance}
        assert outcome(check(**entry), step(), PROBES, THEORIES)["passed"] is passed
    inside = check(quantity="inside.pressure", value=1.0)  # a point that is in no contact
    result = outcome(inside, step(), {**PROBES, "inside": 4}, THEORIES)
    assert np.isnan(result["value"])
    assert result["passed"] is False


def test_the_distance_to_the_mesh_converged_solution_is_told():
    better = fc.analytic.hertz_point(E1=1000.0, nu1=0.3, R1=10.0, force=4.2)
    theories = {"hertz": {**THEORIES["hertz"], "mesh_converged": better}}
    found = outcome(check(quantity="hertz.force", theory="hertz"), step(), PROBES, theories)
    assert found["distance_to_mesh_converged"] == pytest.approx(4.4 / 4.2 - 1)
    assert found["mesh_converged_deviation"] == pytest.approx(0.05)


def test_it_says_what_is_compared():
    assert check(quantity="pole.pressure", theory="hertz").description() == (
        "pole.pressure against the theory's pressure_max within 0.1"
    )
    found = Check("c", "pole.pressure", 0.1, value=2.5, source="a book")
    assert found.description() == "pole.pressure against 2.5 (a book) within 0.1"


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ({}, r"check\[0\] needs 'quantity'"),
        ({"quantity": "pole.pressure"}, "either 'theory'.* or 'value'"),
        ({"quantity": "pole.pressure", "value": 1.0, "theory": "hertz"}, "either 'theory'.* or 'value'"),
        ({"quantity": "pole.pressure", "value": 0.0}, r"check\[0\]: the value is 0, so the relative deviation is"),
        *(
            ({"quantity": "pole.pressure", "value": 1.0, name: number}, rf"check\[0\].{name} = .* must be ")
            for name, numbers in {
                "tolerance": (0, -1.0, np.nan, np.inf),
                "factor": (0, np.nan),
                "value": (np.inf, np.nan),
            }.items()
            for number in numbers
        ),
        ({"quantity": "poll.pressure", "value": 1.0}, "'poll': did you mean 'pole'"),
        ({"quantity": "pole.presure", "value": 1.0}, "did you mean 'pressure'"),
        ({"quantity": "hertz.stickradius", "value": 1.0}, "did you mean 'stick_radius'"),
        ({"quantity": "pole.pressure", "theory": "hert"}, "did you mean 'hertz'"),
        ({"quantity": "pole.pressure", "theory": "hertz", "of": "pressure_mx"}, "did you mean 'pressure_max'"),
        ({"quantity": "pole.pressure", "theory": "hertz", "of": "pressure"}, r"number of the theory in check\[0\].of"),
        ({"quantity": "pole.pressure", "theory": "slip"}, r"number of the theory in check\[0\].of 'pressure_max'"),
    ],
)
def test_wrong_checks_are_named(entry, words):
    refused(fc.CaseError, words, check, **entry)


def test_no_contact_has_no_stick_zone():
    contact = step().contact["hertz"]
    assert contact.stick_radius == (1.0, 2.0)
    object.__setattr__(contact, "sticking", np.zeros(4, bool))
    assert np.isnan(contact.stick_radius).all()


def test_the_share_of_a_contact_lies_between_nothing_and_all_of_it():
    theory = {"kind": "hertz_point", "E1": 1.0, "nu1": 0.3, "R1": 1.0, "force": 1.0}
    for share in (0.0, 1.5):
        with pytest.raises(fc.CaseError, match=r"theory.a.share = .* 0.25 for a quarter"):
            stored_description({"contact": {"a": {}}, "theory": {"a": {**theory, "share": share}}})
    with pytest.raises(fc.CaseError, match="share"):
        stored_description({"contact": {"a": {}}, "theory": {"a": {**theory, "share": "half"}}})
    assert (
        stored_description({"contact": {"a": {}}, "theory": {"a": {**theory, "share": 0.5}}})["theories"]["a"][
            "theory"
        ].force
        == 1.0
    )


# A drum that is pressed on a block and turns, with friction and wear: a mesh maker with lists, in a case file.
DRIVEN = """[obstacle.drum]
secondary = "TOP"
shape = { kind = "sphere", centre = [0.0, 5.0], R = 5.0 }
motion = { y = -0.1 }
rotation = { angle = 0.1, centre = [0.0, 5.0], ramp = [[0.0, 0.0], [1.0, 1.0]] }
friction = 0.2
wear = 1e-5
"""
BLOCK = 'generator = "block"\nsize = [8.0, 2.0]\ndivisions = [24, 6]\norigin = [-4.0, -2.0]'
DRUM = case_of(BLOCK, DRIVEN, ramp="instants = [0.5, 1.0]", BOTTOM="xy")
UNITS = '[units]\nlength = "mm"\nforce = "N"\npressure = "MPa"\n'
QUANTITIES = ("torque", "force.x", "force.y", "moment.z", "wear_max", "force", "pressure_max", "radius")


def checks(values):
    entries = [
        f'[[check]]\nquantity = "drum.{what}"\nvalue = {value!r}\ntolerance = 1e-9\n' for what, value in values.items()
    ]
    return "\n".join(entries)


@pytest.fixture(scope="module")
def steps():
    case = build_case(tomllib.loads(DRUM), name="drum")
    return fc.solve(case.model, case.ramp)


def summary(text, steps):
    case = build_case(tomllib.loads(text), name="drum")
    return summarise(case, steps[-1], [step_entry(step) for step in steps], {}, [])


def test_a_mesh_maker_with_lists_makes_the_mesh_of_a_case(steps):
    mesh = build_case(tomllib.loads(DRUM), name="drum").mesh
    assert mesh.points.tobytes() == fc.generate.block((8.0, 2.0), (24, 6), origin=(-4.0, -2.0)).points.tobytes()


def test_every_quantity_of_a_pair_can_be_checked(steps):
    found = summary(DRUM + checks(dict.fromkeys(QUANTITIES, 1.0)), steps)["checks"]
    value = {check["quantity"].removeprefix("drum."): check["value"] for check in found}
    contact = steps[-1].contact["drum"]
    assert all(np.isfinite(list(value.values())))
    assert value["torque"] == contact.torque
    # All of it slides: the torque is that of the friction on its radius, the force's components follow from the cone.
    assert abs(value["torque"]) == pytest.approx(0.2 * abs(value["force.y"]) * 5.0, rel=0.02)
    assert abs(value["force.x"]) == pytest.approx(0.2 * abs(value["force.y"]), rel=0.02)
    assert value["force"] == pytest.approx(np.hypot(value["force.x"], value["force.y"]), rel=1e-12)
    assert value["moment.z"] == fc.contact_moment(contact)[0]
    assert value["wear_max"] == contact.wear.max() > 0.0
    again = summary(DRUM + checks(value), steps)["checks"]
    assert all(check["passed"] for check in again)
    assert [check["unit"] for check in again] == [
        *("moment", "force", "force", "moment", "length", "force", "pressure", "length")
    ]


@pytest.mark.parametrize(
    ("old", "new", "quantity", "message"),
    [
        ("rotation = {", "# {", "torque", "'drum' has no torque: only an obstacle with a 'rotation' has one"),
        ("wear = 1e-5", "", "wear_max", "'drum' has no wear_max: only a contact with the option 'wear' has one"),
        ("", "", "moment.x", "unknown quantity in check.0. 'moment.x'"),
        ("", "", "force.z", "unknown quantity in check.0. 'force.z'"),
        ("", "", "torqe", "did you mean 'torque'"),
    ],
)
def test_what_a_pair_does_not_have_is_told(old, new, quantity, message):
    text = DRUM.replace(old, new, 1) + checks({quantity: 1.0})
    refused(fc.CaseError, message, build_case, tomllib.loads(text), name="drum")


def test_moments_of_circles_are_refused():
    tables = (
        '[obstacle.plane]\nsecondary = "CONT1"\nshape = { kind = "half_space", point = [0, 0], normal = [0, -1] }\n'
        '[[check]]\nquantity = "plane.moment.z"\nvalue = 1.0\ntolerance = 0.1\n'
    )
    text = case_of('generator = "quarter-disc"\nsize = 10.0', tables, "axisymmetric")
    refused(fc.CaseError, r"unknown quantity in check.0. 'moment.z'", build_case, tomllib.loads(text), name="plane")


def test_units_are_named_where_they_are_known_and_nothing_where_not(steps):
    asked = checks({"torque": -1.0, "force": 1.0})
    known, unknown = (lines(summary(DRUM + units + asked, steps)) for units in (UNITS, ""))
    told = " N/mm (normal ", " N/mm), largest pressure ", " MPa, half-width ", "N mm/mm", " mm\n", "worn by up to "
    for text in told:
        assert text in "\n".join(known)
    text = "\n".join(unknown)
    for dash in (" - ", " -,", " -\n", "- -", "[-]", "  is "):
        assert dash not in text, text
    assert [line.split()[0] for line in known] == [line.split()[0] for line in unknown]
    dashes = UNITS.replace('"mm"', '"-"').replace('"N"', '"-"').replace('"MPa"', '"-"')
    assert lines(summary(DRUM + dashes + asked, steps)) == unknown


# A quarter of a block under a rigid sphere; the force on the whole is 200.
QUARTER = case_of(
    'generator = "graded-block"\nelement = "hex8"\nwidth = 8.0\ncontact_radius = 1.3\ncontact_size = 0.4\ngrowth = 1.0',
    """[obstacle.ball]
secondary = "CONTACT"
shape = { kind = "sphere", centre = [0.0, 0.0, 10.0], R = 10.0 }
force = { z = -50.0 }
[theory]
ball = { kind = "hertz_point", E1 = 1000.0, nu1 = 0.3, R1 = 10.0, force = 200.0, share = 0.25 }
[[check]]
quantity = "ball.force"
theory = "ball"
tolerance = 1e-9
""", "3d", BOTTOM="z", SYMMETRY_X="x", SYMMETRY_Y="y",
)  # fmt: skip


@pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")
def test_the_force_of_a_quarter_excludes_the_part_that_symmetry_balances(tmp_path):
    case = build_case(tomllib.loads(QUARTER), name="ball")
    with fc.ResultWriter(tmp_path / "a.vtkhdf", case.model) as out:
        last = fc.solve(case.model, case.ramp, on_step=out.write)[-1]
    contact = last.contact["ball"]
    np.testing.assert_allclose(contact.direction, [0.0, 0.0, -1.0], atol=1e-12)
    assert np.linalg.norm(contact.force) > 50.05  # the balanced part of a quarter
    assert contact.force_against_theory(1.0) == np.linalg.norm(contact.force)
    told = summarise(case, last, [], {}, [])
    assert told["checks"][0]["value"] == pytest.approx(200.0, rel=1e-9)
    assert told["theory"]["ball"]["equal_force"]["force"] == pytest.approx(200.0, rel=1e-9)
    ellipse = dataclasses.replace(case, checks=[], theories={"ball": {"theory": ELLIPSE, "share": 0.25}})
    compared = summarise(ellipse, last, [], {}, [])["theory"]["ball"]["equal_approach"]
    assert compared["radius"] == 0.5 * (ELLIPSE.radius_x + ELLIPSE.radius_y)
    assert measure(case, last, "ball")["force"] == pytest.approx(50.0, rel=1e-9)
    upper = fc.plot.history([last], "ball", share=0.25)[0]
    assert upper.lines[0].get_ydata() == pytest.approx([50.0], rel=1e-9)
    with fc.open_results(tmp_path / "a.vtkhdf") as results:
        stored = results[0].contact["ball"]
    (hertz,) = pressure_curves(case.theories["ball"], stored).values()
    assert hertz.force == pytest.approx(200.0, rel=1e-9)
