"""Keyword blocks and invalid decks: each is refused with its keyword, its line and a sentence."""

import pytest
from case_texts import FLAT
from deck_text import CONTACT, MATERIAL, NODES, STEP, WHOLE, deck_of, static_steps
from refusals import refused

import fastcontact as fc
from fastcontact.cases.decks import blocks, building
from fastcontact.errors import CaseError, FileError

SPRING = "*Element, type=SPRINGA, elset=springs\n7, 1, 11\n"
GAP = "*Node\n21, 0., 0., 3.\n*Element, type=GAPUNI, elset=gaps\n7, 15, 21\n"


def before(marker, lines, text=WHOLE):
    """The deck with lines before one that begins so."""
    assert marker in text
    return text.replace(marker, lines + marker, 1)


def instead(old, new, text=WHOLE):
    assert old in text
    return text.replace(old, new, 1)


def in_parts(of_instance="", further="", parts="*Part, name=p\n"):
    """The solids in a part, with one instance."""
    body = NODES.replace("*Heading\n two cubes\n", "")
    sections = MATERIAL[MATERIAL.index("*Solid") :]
    assembly = f"*Assembly, name=a\n*Instance, name=i, part=p\n{of_instance}*End Instance\n{further}*End Assembly\n"
    return parts + body + sections + "*End Part\n" + assembly + MATERIAL[: MATERIAL.index("*Solid")]


def with_orientation(lines):
    return before("*Material", "*Orientation, name=o\n" + lines)


def with_relation(lines, text=WHOLE):
    return before("*Boundary", lines, text)


def with_law(lines):
    return before("*Contact Pair", lines)


def with_load(lines):
    return before("*Dsload", lines)


def in_steps(*lines):
    return before("*Elastic", "*Density\n3.\n", instead(STEP, static_steps(*lines)))


def flat_load(load, kind="CPE4"):
    return before("*Cload", f"*Dload\none, {load}\n", FLAT.replace("CPE4", kind))


MODEL = {
    "system of nodes": (instead("*Node\n", "*Node, system=C\n"), r"\*NODE: SYSTEM=C is not supported: give rectang"),
    "element twice": (
        before("*Nset, nset=bottom", "*Element, type=C3D8\n2, 1, 2, 3, 4, 5, 6, 7, 8\n"), "element 2 is defined twice"),
    "range that falls": (instead("1, 4\n*Nset", "4, 1\n*Nset"), "the range 4 to 1 by 1 is empty: it must ascend"),
    "surface twice": (before("*Surface, name=roof", "*Surface, name=SM\nup, S1\n"), "surface 'SM' is defined twice"),
    "load without a step": (before("*Step", "*Cload\n17, 3, 1.\n"), r"\*CLOAD: loads belong in a step"),
    "nodes in a step": (with_load("*Nset, nset=new\n1\n"), r"\*NSET: cannot be inside a step"),
    "material in a step": (with_load("*Material, name=new\n"), r"\*MATERIAL: cannot be inside a step"),
    "friction nowhere": (before("*Surface Int", "*Friction\n0.1\n"), r"\*FRICTION: belongs below \*SURFACE INTER"),
    "kinematic nowhere": (with_relation("*Kinematic\n1, 3\n"), r"\*KINEMATIC: belongs below \*COUPLING"),
    "coupling alone": (with_relation("*Coupling, ref node=1, surface=ss\n"), r"\*KINEMATIC or \*DISTRIBUTING must"),
    "coupling at the end": (
        instead(STEP, "*Coupling, ref node=1, surface=ss\n"), r"\*COUPLING: \*KINEMATIC or \*DISTRIBUTING must follow"),
    "perturbation": (instead("*Step\n", "*Step, perturbation\n"), "PERTURBATION is not supported with"),
    "step without length": (instead("*Static\n", "*Static\n1., 0.\n"), "the length of the step 0 must be positive"),
    "thickness": (FLAT.replace("material=steel\n1.", "material=steel\n0.", 1), "the thickness 0 must be positive"),
    "two thicknesses": (FLAT.replace("1.\n*Boundary", "2.\n*Boundary"), "thickness 2 after 1: plane models have one"),
    "not flat": (FLAT.replace("6, 2., 1.", "6, 2., 1., 0.5"), "CPE4 lie in the plane z = const, but z differs"),
    "two kinematics": (FLAT.replace("CPE4, elset=two", "CAX4, elset=two"), "of type CAX4 and CPE4 .* cannot be in one"),
    "include with a parameter": ("*Include, input=a.inp, more=1\n", r"\*INCLUDE: the parameter MORE is not supported"),
    "transform": (with_relation("*Transform, nset=top\n"), r"\*TRANSFORM: 0 data lines, but one is needed"),
    "transform without axes": (
        with_relation("*Transform, nset=top\n1., 0., 0., 2., 0., 0.\n*Boundary\ntop, 1\n"),
        r"the local axes are not defined at the point \[0.0, 0.0, 2.0\]"),
}  # fmt: skip
PARTS = {
    "instance of nothing": (in_parts().replace("part=p", "part=q"), "part 'q' is not defined; parts: p"),
    "instance twice": (
        in_parts(further="*Instance, name=I, part=p\n*End Instance\n"), r"\*INSTANCE: instance 'I' is defined twice"),
    "instance of three lines": (
        in_parts("0., 0., 0.\n0., 0., 0., 0., 0., 1., 0.\n1.\n"),
        "an instance has at most two data lines: a translation and a rotation"),
    "part twice": (in_parts(parts="*Part, name=P\n*End Part\n*Part, name=p\n"), "part 'p' is defined twice"),
    "nodes in an instance": (in_parts("*Node\n1, 0., 0., 0.\n"), r"\*NODE: is not supported inside an instance"),
    "supports in an instance": (in_parts("*Boundary\ntop, 1\n"), "is supported for the whole assembly only, not"),
    "set of no instance": (
        in_parts(further="*Nset, nset=all, instance=j\ntop\n") + "*Boundary\nall, 1\n" + STEP.replace("roof", "i.roof"),
        r"\*NSET: instance 'J' is not defined; instances: i"),
}  # fmt: skip
MATERIALS = {
    "elastic of another kind": (instead("*Elastic", "*Elastic, type=lamina"), "TYPE=LAMINA is not supported; expected"),
    "constants without energy": (
        instead("*Elastic\n200000., 0.", "*Elastic, type=engineering constants\n1., 1., 1., 2., 0., 0., 1., 1.,\n1."),
        r"\*ELASTIC: material 'steel': "),
    "orientation of nothing": (with_orientation(""), "a data line with six coordinates is nee"),
    "orientation twice": (
        with_orientation("1., 0., 0., 0., 1., 0.\n*Orientation, name=O\n0., 1., 0., 0., 0., 1.\n"),
        "orientation 'O' is defined twice"),
    "orientation with an origin": (
        with_orientation("1., 0., 0., 0., 1., 0., 0., 0., 1.\n"), "an origin of the axes is not supported"),
    "orientation turned further": (
        with_orientation("1., 0., 0., 0., 1., 0.\n3, 30.\n"), "a further rotation of the axes is not supported"),
    "density": (before("*Solid Section, elset=low", "*Density\n0.\n"), "the density 0 must be positive"),
}  # fmt: skip
CONTACTS = {
    "negative friction": (with_law("*Friction\n-0.1\n"), "the coefficient of friction -0.1 is negative"),
    "friction by pressure": (with_law("*Friction\n0.1, , 5.\n"), "friction that depends on pressure or temperature"),
    "slope": (with_law("*Surface Behavior, pressure-overclosure=LINEAR\n0.\n"), "the slope 0 must be positive"),
    "friction without separation": (
        with_law("*Surface Behavior, no separation\n*Friction\n0.1\n"), "friction with NO SEPARATION is not supported"),
    "clearance of nothing": (
        with_relation("*Clearance, slave=ss, master=roof, value=0.1\n"),
        "there is no contact pair of 'ss' and 'roof' above this line"),
    "clearance of a wedge": (
        with_relation("*Clearance, slave=ss, master=sm, value=0.1\n", instead("11, 0., 0., 1.", "11, 0., 0., 1.1")),
        r"\*CLEARANCE is supported between sides at a uniform distance only"),
    "adjust by a word": (instead("type=SURFACE TO", "adjust=some, type=SURFACE TO"), "set 'some' is not defined"),
    "a surface without faces": (instead("up, S1\n", ""), "surface 'ss' has no faces"),
    "an orientation that is not there": (
        with_relation("*Coupling, ref node=15, surface=roof, orientation=o\n*Kinematic\n3\n"),
        "orientation 'o' is not defined"),
    "pair of one": (instead("ss, sm\n*B", "ss\n*B"), "a contact pair needs two surfaces, the secondary and the"),
    "tie of one": (instead(CONTACT, "*Tie, name=t\nss\n"), "a tie needs two surfaces, the secondary and the primary"),
    "surface of an element that is none": (
        instead("up, S1\n", "7, S1\n", before("*Nset, nset=bottom", SPRING)),
        "element 7 is not a solid, so it has no faces"),
    "free faces of one that is none": (
        instead("up, S1\n", "7,\n", before("*Nset, nset=bottom", SPRING)), "element 7 is not a solid, so it has no faces"),
    "nodes that are no faces": (
        before("*Surface, name=roof", "*Surface, name=few, type=NODE\n15\n16\n", instead("ss, sm", "few, sm")),
        "no facet of 'few' faces 'sm'"),
}  # fmt: skip
RELATIONS = {
    "equation of none": (with_relation("*Equation\n0\n"), "an equation cannot have 0 terms"),
    "equation too short": (with_relation("*Equation\n2\n15, 1, 1.\n"), "the equation has 1 terms, 2 are announced"),
    "equation too long": (with_relation("*Equation\n1\n15, 1, 1., 16, 1, 1.\n"), "the equation has 2 terms, 1 are"),
    "equation of a rotation": (with_relation("*Equation\n1\n15, 4, 1.\n"), "component 4 of '15' is not within 1 to 3"),
    "equation of zeros": (with_relation("*Equation\n1\n15, 1, 0.\n"), "all coefficients of the equation are zero"),
    "equation of a set": (with_relation("*Equation\n1\ntop, 1, 1.\n"), "'top' has 4 nodes, but one is needed"),
    "coupling of component 7": (
        with_relation("*Coupling, ref node=15, surface=roof\n*Kinematic\n7\n"),
        "the components 7 to 7 are not within 1 to 6"),
    "rigid body of its own node": (
        with_relation("*Rigid Body, nset=alone, ref node=15\n", before("*Nset, nset=top", "*Nset, nset=alone\n15\n")),
        "'alone' contains no nodes that could follow the reference node"),
    "springs of two": (with_relation(SPRING + "*Spring, elset=springs\n\n1.\n2.\n"), "need an empty line, followed by"),
    "spring with a law": (with_relation(SPRING + "*Spring, elset=springs\n\n1., 2.\n"), "only linear springs are supp"),
    "spring of no stiffness": (with_relation(SPRING + "*Spring, elset=springs\n\n0.\n"), "the stiffness 0 must be"),
    "spring of a solid": (with_relation("*Spring, elset=up\n\n1.\n"), "element 2 is not of type SPRINGA"),
    "spring without stiffness": (with_relation(SPRING), r"element 7 of type SPRINGA has no \*SPRING"),
    "gap without a direction": (with_relation(GAP + "*Gap, elset=gaps\n1.\n"), "the direction of the gap elements is"),
    "gap of a solid": (with_relation("*Gap, elset=up\n1., 0., 0., 1.\n"), "element 2 is not of type GAPUNI"),
    "gap on one node": (
        with_relation(GAP + "*Gap, elset=gaps\n1., 0., 0., 1.\n"),
        "gap elements are supported on all nodes of whole faces only"),
}  # fmt: skip
LOADS = {
    "velocity": (instead("*Boundary", "*Boundary, type=VELOCITY"), "TYPE=VELOCITY is not supported; expected one of DISP"),
    "antisymmetry": (instead("x0, 1", "x0, XASYMM"), "XASYMM is not supported: give the components"),
    "rotation of a solid": (with_load("*Boundary\n15, 4, 4, 0.1\n"), "component 4 does not exist at nodes of this"),
    "force on component 7": (with_load("*Cload\n15, 7, 1.\n"), "a force cannot act on component 7 of this node"),
    "load of another kind": (with_load("*Dload\nup, ROTA, 1.\n"), "load ROTA is not supported; expected one of P1, P2"),
    "gravity without direction": (with_load("*Dload\nup, GRAV, 9.81\n"), "the direction of GRAV is missing"),
    "pressure on a spring": (
        with_load("*Dload\n7, P1, 1.\n").replace("*Nset, nset=bottom", SPRING + "*Nset, nset=bottom"),
        "element 7 is not a solid, so it has no faces"),
    "amplitude without values": (
        before("*Step", "*Amplitude, name=a\n0., 1., 0., 2.\n"),
        "needs pairs of time and multiplier, with ascending times"),
}  # fmt: skip
ROOF = "*Dsload\nroof, P, 1.\n"
STEPS = {
    "equal forces": (in_steps("*Cload\ntop, 3, 1.\n15, 3, 1.\n"), "1 is the second value in this step, after 1 in line"),
    "solid twice": (in_steps("*Dload\nup, BX, 1.\n2, BX, 1.\n"), "1 is the second value in this step, after 1 in"),
    "node twice": (in_steps("*Cload\ntop, 3, 1.\n").replace("\n15, 16", "\n16, 15, 16"), "'top' lists a member twice"),
    "face twice": (in_steps(ROOF).replace("roof\nup, S2\n", "roof\nup, S2\n2, S2\n"), "'roof' lists a member twice"),
    "weight of another set": (
        in_steps("*Dload\nup, GRAV, 1., 0., 0., -1.\n", "*Dload\n2, GRAV, 2., 0., 0., -2.\n"), r"GRAV acts by line \d+ on"),
    "two axes": (
        in_steps("*Dload\nup, CENTRIF, 1., 0, 0, 0, 0, 0, 1\n, CENTRIF, 1., 0, 0, 0, 1, 0, 0\n"), r"CENTRIF acts by line"),
    "new list of one keyword": (in_steps(ROOF, "*Dload, op=NEW\n"), "CalculiX replaces .* remains in Abaqus: give OP=NEW"),
    "face of two keywords": (in_steps(ROOF, "*Dload\nup, P2, 1.\n"), "CalculiX replaces the load of .*DSLOAD, which"),
    "new forces late": (in_steps("*Cload\n15, 3, 1.\n*Cload, op=NEW\n16, 3, 1.\n"), r"missing in the first \*CLOAD, line"),
    "new supports late": (in_steps("*Boundary\n15, 1\n*Boundary, op=NEW\n16, 1\n"), r"missing in the first \*BOUNDARY, line"),
    "restart": (before("*Step", "*Restart, read\n"), r"\*RESTART: READ is not supported"),
    "rubber by temperature": (
        instead("*Elastic\n200000., 0.", "*Hyperelastic, neo hooke\n1., 1., 0.\n2., 1., 9."), "has 2 constants, at one temp"),
    "weight out of the plane": (flat_load("GRAV, 1., 0., 1., 1."), "GRAV must not cause forces normal to the plane"),
    "force out of the plane": (flat_load("BZ, 1."), "BZ must not cause forces normal to the plane"),
    "axis inclined to the plane": (flat_load("CENTRIF, 1., 0., 0., 0., 0., 1., 1."), "CENTRIF must not cause forces normal"),
    "radial weight": (flat_load("GRAV, 1., 1., 0., 0.", "CAX4"), "GRAV must be along the axis of symmetry, y"),
    "eccentric axis": (flat_load("CENTRIF, 1., 1., 0., 0., 0., 1., 0.", "CAX4"), "CENTRIF must be along the axis of symm"),
}  # fmt: skip
CASES = {**MODEL, **PARTS, **MATERIALS, **CONTACTS, **RELATIONS, **LOADS, **STEPS}


@pytest.mark.parametrize("what", CASES)
def test_it_is_refused(what, tmp_path):
    text, said = CASES[what]
    refused(fc.CaseError, rf"^deck\.inp, line \d+, .*{said}", deck_of, tmp_path, text)


def test_a_deck_without_solids(tmp_path):
    with pytest.raises(fc.CaseError, match="the deck has no solid elements"):
        deck_of(tmp_path, "*Node\n1, 0., 0., 0.\n*Boundary\n1, 1\n" + STEP.replace("*Dsload\nroof, P, 100.\n", ""))


def test_what_was_changed_is_read_as_it_was(tmp_path):
    assert deck_of(tmp_path, WHOLE).model.contact
    assert deck_of(tmp_path, FLAT).model.kinematics == "plane_strain"
    whole = (
        in_parts(further="*Nset, nset=held, instance=i\nbottom\n")
        + "*Boundary\nheld, 1, 3\n"
        + STEP.replace("roof", "i.roof")
    )
    assert len(deck_of(tmp_path, whole).points_of("held")) == 4


def test_histories_with_too_many_corners(tmp_path, monkeypatch):
    monkeypatch.setattr(building, "LONGEST_RAMP", 2)
    amplitude = "*Amplitude, name=up\n0., 0., 0.2, 1., 0.4, 0.5, 1., 1.\n"
    text = amplitude + instead("*Cload\n", "*Cload, amplitude=up\n", FLAT)
    with pytest.raises(fc.CaseError, match=r"^deck\.inp, line \d+, .*the histories have \d+ corners, more than 2"):
        deck_of(tmp_path, text).model.check(fc.linear_ramp(1))


def read(folder, text, name="a.inp"):
    (folder / name).write_text(text, encoding="utf-8")
    return list(blocks.read_blocks(folder / name))


def test_a_block_has_keyword_parameters_and_lines(tmp_path):
    (found,) = read(tmp_path, '** comment\n*contact\tpair , Type = "a, b",\n  small sliding\n1,\t2,\n** no\n 3\n\n')
    assert found.keyword == "CONTACT PAIR"
    assert found.parameters == {"TYPE": "a, b", "SMALL SLIDING": None}
    assert [row.entries for row in found.rows] == [("1", "2"), ("3",)]
    assert [row.location.line for row in found.rows] == [4, 6]
    assert found.rows[0].continued
    assert str(found.location) == "a.inp, line 2, *CONTACT PAIR"


def test_a_keyword_does_not_continue_into_another(tmp_path):
    found = read(tmp_path, "*Step, nlgeom,\n** no\n\u00a0*Static,\n1.\n")
    assert [(block.keyword, block.location.line) for block in found] == [("STEP", 1), ("STATIC", 3)]
    assert found[1].parameters == {"1.": None}


def test_names_in_quotation_marks_keep_commas(tmp_path):
    (found,) = read(tmp_path, '*Cload\n"Upper, Plate-1".1, 1, 0.\n')
    assert found.rows[0].entries == ('"Upper, Plate-1".1', "1", "0.")


@pytest.mark.parametrize(("text", "value"), [("1.D5", 1e5), ("-2", -2.0), (".5E-3", 5e-4), ("1d0", 1.0)])
def test_numbers_as_fortran_writes_them(tmp_path, text, value):
    (found,) = read(tmp_path, f"*Elastic\n{text}\n")
    assert found.rows[0].number(0) == value


@pytest.mark.parametrize("text", ["O.3", "nan", "inf", "1e999", "1_0", "0x1", "--1"])
def test_what_is_no_number_is_told_with_its_line(tmp_path, text):
    (found,) = read(tmp_path, f"*Elastic\n1.\n{text}\n")
    refused(CaseError, r"a\.inp, line 3, \*ELASTIC: .* is not a (usable )?number", found.rows[1].number, 0)


def test_included_files_stand_in_place_with_their_own_lines(tmp_path):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "mesh.inc").write_text("*Node\n1, 0.\n", encoding="utf-8")
    found = read(tmp_path, "*Heading\n*Include, input=sub/mesh.inc\n*Step\n")
    places = ["a.inp, line 1, *HEADING", "sub/mesh.inc, line 1, *NODE", "a.inp, line 3, *STEP"]
    assert [str(block.location) for block in found] == places


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("/etc/os-release", "outside the folder"), ("../x.inc", "outside the folder"), ("none.inc", "not found"),
        ("a.inp", "includes itself"), ("link.inc", "outside the folder"), ("x\0y", "not a file name"),
    ],
)  # fmt: skip
def test_files_elsewhere_are_not_read(tmp_path, given, said):
    folder = tmp_path / "deck"
    folder.mkdir()
    (tmp_path / "secret.inc").write_text("secret", encoding="utf-8")
    (folder / "link.inc").symlink_to(tmp_path / "secret.inc")
    with pytest.raises(CaseError, match=rf"a\.inp, line 2, \*INCLUDE: .*{said}") as caught:
        read(folder, f"*Heading\n*Include, input={given}\n")
    assert "secret," not in str(caught.value)


def test_files_that_include_each_other_are_refused(tmp_path):
    (tmp_path / "b.inc").write_text("*Include, input=a.inp\n", encoding="utf-8")
    with pytest.raises(CaseError, match=r"b\.inc, line 1, \*INCLUDE: the deck includes itself"):
        read(tmp_path, "*Include, input=b.inc\n")


def test_a_tree_of_included_files_does_not_grow_for_ever(tmp_path):
    for level in range(12):
        (tmp_path / f"{level}.inc").write_text(f"*Include, input={level + 1}.inc\n" * 8, encoding="utf-8")
    (tmp_path / "12.inc").write_text("*Heading\n", encoding="utf-8")
    refused(FileError, "MiB or 200 files", read, tmp_path, "*Include, input=0.inc\n")


def test_data_before_any_keyword_is_refused(tmp_path):
    refused(CaseError, r"line 1, .*before any keyword", read, tmp_path, "1, 2, 3\n*Node\n")


def test_a_parameter_that_stands_there_twice_is_refused(tmp_path):
    refused(CaseError, "NSET is given twice", read, tmp_path, "*Node, nset=a, NSET=b\n")
