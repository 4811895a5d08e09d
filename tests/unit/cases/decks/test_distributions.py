"""Material axes cell by cell and cohesive behaviour in decks; refusals."""

import numpy as np
import pytest
from deck_text import CONTACT, SUPPORTS, WHOLE, deck_of
from models import made_of
from refusals import refused

import fastcontact as fc
from fastcontact.cases.decks.axes import local_axes
from fastcontact.cases.decks.blocks import Location
from fastcontact.cases.decks.content import Axes

CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
NODES = "*Node\n" + "".join(
    f"{4 * level + k + 1}, {x}., {y}., {level}.\n" for level in range(4) for k, (x, y) in enumerate(CORNERS)
)
CELLS = "*Element, type=C3D8, elset=all\n" + "".join(
    f"{cell + 7}, " + ", ".join(str(4 * cell + k) for k in range(1, 9)) + "\n" for cell in range(3)
)
SETS = "*Elset, elset=middle\n8\n*Nset, nset=bottom, generate\n1, 4\n*Nset, nset=top, generate\n13, 16\n"
PLY = "*Material, name=ply\n*Elastic, type=ENGINEERING CONSTANTS\n1300., 90., 100., 0.28, 0.3, 0.4, 45., 48.,\n35.\n"
STEP = "*Boundary\nbottom, 1, 3\n*Step\n*Static\n*Boundary\ntop, 3, 3, 0.05\n*Cload\ntop, 1, 0.3\n*End Step\n"
FRAMES = {7: "0.8, 0.6, 0., -0.6, 0.8, 0.", 8: "0., 1., 1., 1., 0., 0.", 9: "1., 0., 0.2, 0., 1., 0."}
TABLE = "*Distribution Table, name=tab\ncoord3d, coord3d\n"
BY_CELL = (
    f"{TABLE}*Distribution, name=dist, location=ELEMENT, table=tab\n, {FRAMES[7]}\nmiddle, {FRAMES[8]}\n9, {FRAMES[9]}\n"
    "*Orientation, name=ori, system=RECTANGULAR\ndist\n3, 0.\n"
)
SECTION = "*Solid Section, elset=all, material=ply, orientation=ori\n,\n"


def by_sections():
    text = ""
    for cell, frame in FRAMES.items():
        text += f"*Orientation, name=o{cell}\n{frame}\n*Elset, elset=e{cell}\n{cell}\n"
        text += f"*Solid Section, elset=e{cell}, material=ply, orientation=o{cell}\n"
    return text


@pytest.fixture
def wanted(tmp_path):
    return deck_of(tmp_path, NODES + CELLS + SETS + PLY + by_sections() + STEP, "sections.inp").solve()[0]


@pytest.mark.filterwarnings("ignore:rotations of up to")
def test_axes_by_cell_are_those_of_sections(tmp_path, wanted):
    deck = deck_of(tmp_path, NODES + CELLS + SETS + PLY + BY_CELL + SECTION + STEP)
    assert len(deck.model.materials) == 1
    (step,) = deck.solve()
    assert step.displacement == pytest.approx(wanted.displacement, abs=1e-12)
    before, after = BY_CELL.split("*Orientation")  # in any order
    other = deck_of(tmp_path, NODES + CELLS + SETS + PLY + "*Orientation" + after + before + SECTION + STEP)
    assert other.solve()[0].displacement == pytest.approx(wanted.displacement, abs=1e-12)
    assert np.abs(wanted.displacement[:, 1]).max() > 1e-3  # the axes matter


@pytest.mark.filterwarnings("ignore:rotations of up to")
def test_in_a_part_with_its_instance_moved(tmp_path, wanted):
    text = "*Part, name=bar\n" + NODES + CELLS + SETS + BY_CELL + SECTION + "*End Part\n*Assembly, name=a\n"
    text += "*Instance, name=bar-1, part=bar\n5., 0., 0.\n*End Instance\n*End Assembly\n" + PLY
    steps = STEP.replace("bottom", "bar-1.bottom").replace("top", "bar-1.top")
    (step,) = deck_of(tmp_path, text + steps).solve()
    assert step.displacement == pytest.approx(wanted.displacement, abs=1e-10)
    turned = text.replace("5., 0., 0.\n", "5., 0., 0.\n5., 0., 0., 5., 0., 1., 90.\n")
    refused(fc.CaseError, r"\*ORIENTATION: axes of a part whose instance is rotated", deck_of, tmp_path, turned + steps)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (f"\n, {FRAMES[7]}", "", r"\*DISTRIBUTION: element 7 has no axes"),
        ("middle, ", "99, ", r"\*DISTRIBUTION: element 99 is not defined"),
        ("middle, ", "centre, ", r"\*DISTRIBUTION: set 'centre' is not defined"),
        ("\ndist\n", "\nother\n", r"\*ORIENTATION: distribution 'other' is not defined"),
        ("coord3d, coord3d", "Modulus, ratio", r"\*DISTRIBUTION TABLE: a distribution of MODULUS, RATIO is not"),
        ("=ELEMENT", "=NODE", r"\*DISTRIBUTION: LOCATION=NODE is not supported"),
        ("3, 0.\n", "3, 45.\n", r"\*ORIENTATION: a further rotation of the axes"),
        (FRAMES[9], "1., 0., 0., 2., 0., 0.", r"\*DISTRIBUTION: the local axes are not defined"),
        ("0., 1., 1., 1., 0., 0.", "0., 1., 1.", r"entry 5 is missing"),
    ],
)  # fmt: skip
def test_what_is_refused(tmp_path, old, new, said):
    assert BY_CELL.count(old) == 1
    with pytest.raises(fc.CaseError, match=said):
        deck_of(tmp_path, NODES + CELLS + SETS + PLY + BY_CELL.replace(old, new) + SECTION + STEP)


def test_axes_of_cells_from_python():
    mesh = fc.generate.box((2.0, 1.0, 1.0), (2, 1, 1), "hex8")
    turned = np.array([np.eye(3), [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]])
    model = made_of(
        mesh, "3d", fc.Orthotropic((8.0, 1.0, 1.0), (0.0,) * 3, (1.0,) * 3, axes=turned), XMIN="x", YMIN="y", ZMIN="z"
    )
    model.add_pressure("XMAX", -0.01)
    (step,) = fc.solve(model, 1)
    assert step.displacement[mesh.points_of("XMAX"), 0] == pytest.approx(0.01 / 8.0 + 0.01)
    with pytest.raises(fc.ModelError, match="not unit vectors at right angles"):
        fc.Orthotropic((8.0, 1.0, 1.0), (0.0,) * 3, (1.0,) * 3, axes=2.0 * turned)
    wrong = fc.Model(mesh, "3d")
    with pytest.raises(fc.ModelError, match="there must be one for each of its cells, 2"):
        wrong.add_material(fc.Orthotropic((8.0, 1.0, 1.0), (0.0,) * 3, (1.0,) * 3, axes=np.tile(np.eye(3), (3, 1, 1))))


K, TN, TS, GN, GS, POWER = 1000.0, 10.0, 20.0, 0.5, 1.5, 1.45
LAYER = """*Surface Interaction, name=si
*Surface Behavior, pressure-overclosure=HARD
*Cohesive Behavior, eligibility=ORIGINAL CONTACTS
1000., 1000., 1000.
*Damage Initiation, criterion={}
{}
*Damage Evolution, {}
{}
"""
STEPS = """*Step
*Static
1., 1.
*Boundary
up, 1, 1, {0}
up, 3, 3, {1}
*End Step
"""


def pulled(folder, motions, criterion="QUADS", strengths=f"{TN}, {TS}, {TS}", kind=None, energies=f"{GN}, {GS}, {GS}"):
    """Return by step the traction on the upper cube, along x and z, as its nodes move."""
    kind = kind or f"type=ENERGY, mixed mode behavior=BK, power={POWER}"
    layer = LAYER.format(criterion, strengths, kind, energies)
    head = WHOLE[: WHOLE.index("*Step\n")].replace(CONTACT[: CONTACT.index("*Contact Pair")], layer)
    head = head.replace("200000.", "1.E9").replace(
        SUPPORTS, "*Nset, nset=up\n15, 16, 17, 18\n*Boundary\nbottom, 1, 3\nup, 2\n"
    )
    deck = deck_of(folder, head + "".join(STEPS.format(*motion) for motion in motions))
    return [step.contact["ss/sm"].force[[0, 2]] for step in deck.solve() if step.load_factor == round(step.load_factor)]


def traction(sliding, opening, criterion="QUADS", mode="BK"):
    """Return the traction of a layer that was never stretched farther, its damage by the energy that remains."""
    size = np.hypot(opening, sliding)
    n, s = K * opening / TN, K * sliding / TS
    onset = size / (np.hypot(n, s) if criterion == "QUADS" else max(n, s))
    share = sliding**2 / size**2
    energy = GN + (GS - GN) * share**POWER
    if mode == "POWER LAW":
        energy = (((1 - share) / GN) ** POWER + (share / GS) ** POWER) ** (-1 / POWER)
    end = 2.0 * energy / (K * onset)
    kept = 1.0 if size < onset else max(onset * (end - size) / (size * (end - onset)), 0.0)
    return -kept * K * np.array([sliding, opening])


@pytest.mark.each_value
@pytest.mark.filterwarnings("ignore:hex8 cells are too stiff")
@pytest.mark.parametrize("criterion", ["QUADS", "MAXS"])
@pytest.mark.parametrize("mode", ["BK", "POWER LAW"])
def test_mixed_modes(tmp_path, criterion, mode):
    """Before damage, while the layer breaks, on the way back, and when it is broken."""
    path = [(0.004, 0.006), (0.03, 0.045), (0.015, 0.0225), (0.2, 0.3)]
    found = pulled(tmp_path, path, criterion, kind=f"type=ENERGY, mixed mode behavior={mode}, power={POWER}")
    whole = [traction(*motion, criterion, mode) for motion in path]
    exact = [whole[0], whole[1], whole[1] / 2.0, np.zeros(2)]
    facing = 1.0 - np.array([sliding for sliding, _ in path])[:, None]
    assert np.array(found) / facing == pytest.approx(np.array(exact), rel=1e-4, abs=1e-5)


@pytest.mark.parametrize("evolution", [("type=DISPLACEMENT", "0.09"), ("type=ENERGY, softening=LINEAR", "0.5")])
def test_pure_opening(tmp_path, evolution):
    """Of one strength, 10: broken at an opening of 0.1, 0.09 beyond that of the largest traction."""
    found = pulled(tmp_path, [(0.0, 0.055)], "QUADS", "10., 10., 10.", *evolution)
    assert found[0][1] == pytest.approx(-5.0, rel=1e-4)


def test_without_stiffness_and_damage_the_sides_are_tied(tmp_path):
    text = WHOLE.replace("name=si\n", "name=si\n*Cohesive Behavior\n", 1).replace("roof, P, 100.", "roof, P, -100.")
    deck = deck_of(tmp_path, text)
    assert deck.model.contact[0].options["kind"] == "tied"
    assert deck.solve()[0].contact["ss/sm"].force[2] == pytest.approx(-100.0, rel=1e-9)


WHOLE_LAYER = LAYER.format("QUADS", "1., 2., 2.", "type=ENERGY, mixed mode behavior=BK, power=2.", "1., 2., 2.")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("1000., 1000., 1000.", "1000., 10., 10.", r"\*COHESIVE BEHAVIOR: a layer must have the same stiffness"),
        ("criterion=QUADS", "criterion=MAXE", r"\*DAMAGE INITIATION: CRITERION=MAXE is not supported"),
        ("\n1., 2., 2.\n*Damage", "\n1., 2., 3.\n*Damage", r"\*DAMAGE INITIATION: the strengths along both shear"),
        ("power=2.", "softening=EXPONENTIAL", r"\*DAMAGE EVOLUTION: SOFTENING=EXPONENTIAL"),
        ("*Damage Initiation, criterion=QUADS\n1., 2., 2.\n", "", "INITIATION and .DAMAGE EVOLUTION are both needed"),
        (", power=2.", "", r"\*DAMAGE EVOLUTION: the parameter POWER is missing"),
        ("type=ENERGY, mixed mode behavior=BK, power=2.", "type=DISPLACEMENT", r"QUADS and equal strengths"),
        ("*Cohesive Behavior, eligibility=ORIGINAL CONTACTS\n1000., 1000., 1000.\n", "", r"has no \*COHESIVE BEHAVIOR"),
        ("*Surface Behavior", "*Friction\n0.3\n*Surface Behavior", r"BEHAVIOR: a cohesive layer excludes \*FRICTION"),
        ("eligibility=ORIGINAL CONTACTS", "repeated contacts", r"the parameter REPEATED CONTACTS"),
        ("1000., 1000., 1000.", "0.1, 0.1, 0.1", r"line 52.*would fail before its traction decreases"),
    ],
)  # fmt: skip
def test_what_is_refused_of_cohesive(tmp_path, old, new, said):
    assert WHOLE_LAYER.count(old) == 1
    text = WHOLE.replace(CONTACT[: CONTACT.index("*Contact Pair")], WHOLE_LAYER.replace(old, new))
    refused(fc.FastcontactError, said, deck_of, tmp_path, text)


def test_sides_that_are_apart_are_refused(tmp_path):
    text = WHOLE.replace(CONTACT[: CONTACT.index("*Contact Pair")], WHOLE_LAYER)
    text = "\n".join(line[:-2] + "1.1" if line[:3] in ("11,", "12,", "13,", "14,") and line.endswith(" 1.") else line
                     for line in text.split("\n"))  # fmt: skip
    refused(fc.CaseError, r"\*CONTACT PAIR: a cohesive layer between sides that are 0.1 apart", deck_of, tmp_path, text)


def test_damage_of_a_material_is_none_of_a_layer(tmp_path):
    text = WHOLE.replace("200000., 0.\n", "200000., 0.\n*Damage Initiation, criterion=QUADS\n1., 2., 2.\n")
    refused(fc.CaseError, "material 'steel': damage is supported for cohesive layers only", deck_of, tmp_path, text)


@pytest.mark.parametrize("cylindrical", [False, True])
@pytest.mark.parametrize("length", [1e-6, 1.0, 1e6])
def test_local_axes_do_not_depend_on_the_distance_of_their_points(length, cylindrical):
    points = (0.0, 0.0, 0.0, 0.0, 0.0, length) if cylindrical else (0.0, length, 0.0, -length, 0.0, 0.0)
    axes = Axes(Location("", 1, "ORIENTATION"), "turned", cylindrical, points)
    np.testing.assert_allclose(
        local_axes(axes, np.array([0.0, length, length])), [[0, 1, 0], [-1, 0, 0], [0, 0, 1]], atol=1e-12
    )
