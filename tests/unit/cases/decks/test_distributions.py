"""Material axes cell by cell in decks: equal to sections with their own axes; parts; refusals."""

import numpy as np
import pytest
from deck_text import deck_of

import fastcontact as fc

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


def test_axes_by_cell_are_those_of_sections(tmp_path, wanted):
    deck = deck_of(tmp_path, NODES + CELLS + SETS + PLY + BY_CELL + SECTION + STEP)
    assert len(deck.model.materials) == 1
    (step,) = deck.solve()
    assert step.displacement == pytest.approx(wanted.displacement, abs=1e-12)
    before, after = BY_CELL.split("*Orientation")  # in any order
    other = deck_of(tmp_path, NODES + CELLS + SETS + PLY + "*Orientation" + after + before + SECTION + STEP)
    assert other.solve()[0].displacement == pytest.approx(wanted.displacement, abs=1e-12)
    assert np.abs(wanted.displacement[:, 1]).max() > 1e-3  # the axes matter


def test_in_a_part_with_its_instance_moved(tmp_path, wanted):
    text = "*Part, name=bar\n" + NODES + CELLS + SETS + BY_CELL + SECTION + "*End Part\n*Assembly, name=a\n"
    text += "*Instance, name=bar-1, part=bar\n5., 0., 0.\n*End Instance\n*End Assembly\n" + PLY
    steps = STEP.replace("bottom", "bar-1.bottom").replace("top", "bar-1.top")
    (step,) = deck_of(tmp_path, text + steps).solve()
    assert step.displacement == pytest.approx(wanted.displacement, abs=1e-10)
    turned = text.replace("5., 0., 0.\n", "5., 0., 0.\n5., 0., 0., 5., 0., 1., 90.\n")
    with pytest.raises(fc.CaseError, match=r"\*ORIENTATION: axes of a part whose instance is rotated"):
        deck_of(tmp_path, turned + steps)


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
    model = fc.Model(mesh, "3d")
    model.add_material(fc.Orthotropic((8.0, 1.0, 1.0), (0.0,) * 3, (1.0,) * 3, axes=turned))
    model.fix("XMIN", "x")
    model.fix("YMIN", "y")
    model.fix("ZMIN", "z")
    model.add_pressure("XMAX", -0.01)
    (step,) = fc.solve(model, 1)
    assert step.displacement[mesh.points_of("XMAX"), 0] == pytest.approx(0.01 / 8.0 + 0.01)
    with pytest.raises(fc.ModelError, match="not unit vectors at right angles"):
        fc.Orthotropic((8.0, 1.0, 1.0), (0.0,) * 3, (1.0,) * 3, axes=2.0 * turned)
    wrong = fc.Model(mesh, "3d")
    with pytest.raises(fc.ModelError, match="there must be one for each of its cells, 2"):
        wrong.add_material(fc.Orthotropic((8.0, 1.0, 1.0), (0.0,) * 3, (1.0,) * 3, axes=np.tile(np.eye(3), (3, 1, 1))))
