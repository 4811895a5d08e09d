"""Torques, moments, components and wear of contacts in checks; summaries with units."""

import tomllib

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.cases.case import build_case
from fastcontact.cases.summary import lines, of_step, summarise

# A drum that is pressed on a block and turns, with friction and wear: a mesh maker with lists, in a case file.
DRUM = """
kinematics = "plane_strain"
[mesh]
generator = "block"
size = [8.0, 2.0]
divisions = [24, 6]
origin = [-4.0, -2.0]
[[material]]
E = 1000.0
nu = 0.3
[[support]]
group = "BOTTOM"
x = 0.0
y = 0.0
[obstacle.drum]
secondary = "TOP"
shape = { kind = "sphere", centre = [0.0, 5.0], R = 5.0 }
motion = { y = -0.1 }
rotation = { angle = 0.1, centre = [0.0, 5.0], ramp = [[0.0, 0.0], [1.0, 1.0]] }
friction = 0.2
wear = 1e-5
[ramp]
instants = [0.5, 1.0]
"""
UNITS = """
[units]
length = "mm"
force = "N"
pressure = "MPa"
"""
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
    return summarise(case, steps[-1], [of_step(step) for step in steps], {}, [])


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
    with pytest.raises(fc.CaseError, match=message):
        build_case(tomllib.loads(text), name="drum")


def test_moments_of_circles_are_refused():
    text = (
        'kinematics = "axisymmetric"\n[mesh]\ngenerator = "quarter-disc"\nsize = 10.0\n[[material]]\nE = 1.0\nnu = 0.3\n'
        '[obstacle.plane]\nsecondary = "CONT1"\nshape = { kind = "half_space", point = [0, 0], normal = [0, -1] }\n'
        '[[check]]\nquantity = "plane.moment.z"\nvalue = 1.0\ntolerance = 0.1\n'
    )
    with pytest.raises(fc.CaseError, match=r"unknown quantity in check.0. 'moment.z'"):
        build_case(tomllib.loads(text), name="plane")


def test_units_are_named_where_they_are_known_and_nothing_where_not(steps):
    asked = checks({"torque": -1.0, "force": 1.0})
    known, unknown = (lines(summary(DRUM + units + asked, steps)) for units in (UNITS, ""))
    for text in (" N/mm, largest pressure ", " MPa, half-width ", "N mm/mm", " mm\n", "worn by up to "):
        assert text in "\n".join(known)
    told = "\n".join(unknown)
    for dash in (" - ", " -,", " -\n", "- -", "[-]", "  is "):
        assert dash not in told, told
    assert [line.split()[0] for line in known] == [line.split()[0] for line in unknown]
    dashes = UNITS.replace('"mm"', '"-"').replace('"N"', '"-"').replace('"MPa"', '"-"')
    assert lines(summary(DRUM + dashes + asked, steps)) == unknown
