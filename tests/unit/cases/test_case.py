"""Case files are checked completely; every mistake is one line that names the key."""

import json

import numpy as np
import pytest
from case_texts import HERTZ, UNITS, case_of, contact_pair, spheres
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli import main
from fastcontact.cli.cases import copy_case
from fastcontact.mesh.generate import block, renamed

SOLVE = '[solve]\nlinear_solver = "direct"\ngeometry_updates = 2\n'
CHECK = '[[check]]\nquantity = "C1.stress.yy"\ntheory = "hertz"\ntolerance = 0.05\n'
GOOD = spheres(10.0, 2, UNITS) + SOLVE + HERTZ + CHECK


@pytest.fixture
def write(tmp_path):
    def make(text):
        path = tmp_path / "case.toml"
        path.write_text(text)
        return path

    return make


def test_a_good_case_is_read_whole(write):
    case = read_case(write(GOOD))
    assert case.name == "case"
    assert case.ramp.instants == (0.5, 1.0)
    assert case.criteria.geometry_updates == 2
    assert case.probes == {"C1": case.mesh.point("C1")}
    assert case.theories["hertz"]["theory"].pressure_max == pytest.approx(2798.3286697)
    assert case.approach == {"hertz": 4.0}
    assert case.model.case_text == GOOD
    case.model.check()


def test_a_file_of_another_size_than_cases_have_is_not_parsed(tmp_path):
    path = tmp_path / "huge.toml"
    with open(path, "wb") as file:
        file.truncate(1 << 40)  # takes no room
    refused(fc.CaseError, r"larger than \d+ MB: put its mesh into a separate file", read_case, path)


@pytest.mark.parametrize(
    ("value", "said"), [("1e300", r"its magnitude must be at most 1e\+60"), ("1e-320", "it must be at least")]
)
def test_theories_out_of_the_range_of_numbers_are_told(value, said, write):
    with pytest.raises(fc.CaseError, match=f"'theory.hertz': approach is out of range: {said}"):
        read_case(write(GOOD.replace("approach = 4.0", f"approach = {value}")))


RINGS = """[theory.fit]
kind = "press_fit_cylinders"
E_inner = 210e3
nu_inner = 0.3
E_outer = 210e3
nu_outer = 0.3
interface_radius = 50.0
outer_radius = 100.0
interference = 0.05
"""
PAIR_OF_RINGS = contact_pair("CONT_OUTER", "CONT_INNER", name="fit")
FIT = case_of('generator = "rings"', PAIR_OF_RINGS, "plane_stress", "E = 210e3\nnu = 0.3") + RINGS


@pytest.mark.parametrize("kinematics", ["plane_strain", "plane_stress"])
def test_a_plane_theory_has_the_kinematics_of_the_case_unless_others_are_given(kinematics, write):
    def pressure(text):
        return read_case(write(text)).theories["fit"]["theory"].pressure

    of_case = pressure(FIT.replace("plane_stress", kinematics))
    constants = {f"{key}_{body}": value for body in ("inner", "outer") for key, value in (("E", 210e3), ("nu", 0.3))}
    radii = {"interface_radius": 50.0, "outer_radius": 100.0, "interference": 0.05}
    exact = fc.analytic.press_fit_cylinders(**constants, **radii, kinematics=kinematics).pressure
    assert of_case == pytest.approx(exact, rel=1e-12)
    assert pressure(FIT + f'kinematics = "{kinematics}"\n') == pytest.approx(exact, rel=1e-12)


def test_a_table_alone_sets_the_end_of_the_ramp(write):
    case = read_case(write(GOOD.replace("steps = 2", "steps = 4\ntable = [[0.0, 0.0], [2.0, 1.0]]")))
    assert case.ramp.instants == (0.5, 1.0, 1.5, 2.0)
    assert case.ramp.value(2.0) == 1.0


def test_instants_without_a_table_are_the_multipliers_as_in_python(write):
    ramp = read_case(write(GOOD.replace("steps = 2", "instants = [1.0, 1.5, 2.0]"))).ramp
    assert ramp.instants == (1.0, 1.5, 2.0)
    assert [ramp.value(instant) for instant in ramp.instants] == [1.0, 1.5, 2.0]


LOADED = (
    GOOD.split('[[support]]\ngroup = "A2B2"')[0]
    + """
[[support]]
group = "A1B1"
y = 2.0
ramp = [[0.0, 1.0], [1.0, 1.0]]
[[pressure]]
group = "D2B2"
value = 1
[[traction]]
group = "A2B2"
y = -1.0
ramp = [[0, 0], [1, 1]]
[[body_force]]
groups = "SPHHAU"
y = -1e-3
[[force]]
group = "A2B2"
y = -100.0
distribute = true
[[couple]]
group = "A2B2"
component = "y"
[[relation]]
terms = [["A2", "y", 1.0], ["B2", "y", -1.0]]
[contact.hertz]
secondary = "CONT1"
primary = "CONT2"
[ramp]
steps = 2
"""
)


def test_a_case_driven_by_loads_runs(write):
    case = read_case(write(LOADED))
    last = fc.solve(case.model, case.ramp)[-1]
    down = case.model.forces_by_ramp()
    assert last.contact["hertz"].force[1] == pytest.approx(sum(f[:, 1].sum() for f in down.values()), rel=1e-9)


PLANE = """[obstacle.plane]
secondary = "CONT1"
shape = { kind = "half_space", point = [0.0, 0.0], normal = [0.0, -1.0] }
motion = { y = -2.0 }
ramp = [[0.0, 0.0], [1.0, 1.0]]
friction = 0.1
"""
DISC = 'generator = "quarter-disc"\nsize = 10.0'
OBSTACLE = case_of(DISC, PLANE, "axisymmetric", "E = 20000.0\nnu = 0.3", A1A2="x", A1B1="y")
SURFACE_KEYS = 'shape = "mesh"\nfile = "tool.med"\ngroup = "TOOL"'
SURFACE = OBSTACLE.replace('shape = { kind = "half_space", point = [0.0, 0.0], normal = [0.0, -1.0] }', SURFACE_KEYS)


@pytest.fixture
def tool(tmp_path):
    """A plane of three lines, facing down."""
    points = [[x, 0.0] for x in (0.0, 20.0, 45.0, 60.0)]
    mesh = fc.Mesh(points, {"line2": [[0, 1], [1, 2], [2, 3]]}, cell_groups={"TOOL": [0, 1, 2]})
    fc.write_mesh(tmp_path / "tool.med", mesh)
    turned = fc.Mesh(points, {"line2": [[1, 0], [2, 1], [3, 2]]}, cell_groups={"TOOL": [0, 1, 2]})
    fc.write_mesh(tmp_path / "turned.med", turned)
    return mesh


@pytest.mark.parametrize(
    ("old", "new", "crease"),
    [
        ('group = "TOOL"\n', 'group = "TOOL"\n', 30),
        ('"tool.med"\n', '"turned.med"\nflip = true\n', 30),
        (SURFACE_KEYS, 'shape = { kind = "mesh", file = "tool.med", group = "TOOL", crease = 10 }', 10),
    ],
)
def test_a_rigid_surface_is_read_from_its_own_file(write, tool, old, new, crease):
    surface = read_case(write(SURFACE.replace(old, new))).model.contact[0].obstacle
    distance, normal = surface.distance(np.array([[30.0, -1.0]]))
    assert (distance[0], normal[0].tolist()) == (1.0, [0.0, -1.0])
    assert surface.crease == crease


def test_a_rigid_surface_that_looks_away_is_refused(write, tool):
    with pytest.raises(fc.ContactError, match=r"faces in the same direction as 'CONT1'.*reverse its normal"):
        read_case(write(SURFACE.replace('"tool.med"', '"turned.med"')))


MISTAKES = {
    GOOD: [
        ('generator = "half-spheres"', 'generator = "half-sphere"', r"mesh.generator 'half-sphere'.*'half-spheres'"),
        ('generator = "half-spheres"\n', "", r"either the key 'file' or the key 'generator'"),
        ("size = 10.0", "sise = 10.0", r"'mesh.sise': did you mean 'mesh.size'"),
        ("x = 0.0", "x = true", r"'support\[0\].x' must be a number or a list .*, not the bool True"),
        ('group = "A1A2"\n', "", r"support\[0\] needs 'group'"),
        ("steps = 2", "steps = 2\ninstants = [1.0]", r"either 'instants', or 'steps'"),
        ("steps = 2", "steps = 2\ntable = [[0.0, 0.0, 1.0]]", r"list of pairs"),
        ("approach = 4.0", "approach = -4.0", r"theory.hertz"),
        ("E = 20000.0\nnu", "groups = [3]\nE = 20000.0\nnu", r"'material\[0\].groups' must be a list of strings or"),
        ('primary = "CONT2"', 'primary = "CONT2"\nformulation = 3', r"'contact.hertz.formulation' must be a string"),
        (
            '"CONT2"',
            '"CONT2"\nsurface_smoothing = 0',
            r"'contact.hertz.surface_smoothing' must be true or false, not 0",
        ),
        ("nu = 0.3", "nu = 0.3\nincompatible_modes = 1", r"'material\[0\].incompatible_modes' must be true or false"),
        ("geometry_updates = 2", "keep_pairing = 1", r"'solve.keep_pairing' must be true or false, not 1"),
    ],
    LOADED: [
        ("distribute = true", "distribute = 1", r"'force\[0\].distribute' must be true or false, not 1"),
        ("ramp = [[0.0, 1.0], [1.0, 1.0]]", "ramp = [[0.0]]", r"'support\[0\].ramp' must be|'support\[1\].ramp' must"),
        ('component = "y"\n', "", r"couple\[0\] needs 'component'"),
        ('["A2", "y", 1.0]', '["A2", "y"]', r"'relation\[0\].terms' must be a list of"),
        ("[[couple]]", "[couple]", r"write \[\[couple\]\] in place of \[couple\]"),
    ],
    OBSTACLE: [
        ('secondary = "CONT1"\n', "", r"obstacle.plane needs 'secondary'"),
        ("half_space", "half_spaces", r"did you mean 'half_space'"),
        ('"half_space"', '"sphere", hollow = 1', r"'obstacle.plane.shape.hollow' must be true or false, not 1"),
        ("normal =", "normals =", r"'obstacle.plane.shape.normals'"),
        (", normal = [0.0, -1.0]", "", r"'obstacle.plane.shape' needs 'normal'"),
        ("y = -2.0 }", 'y = "down" }', r"'obstacle.plane.motion' must be a table of numbers by name"),
    ],
    SURFACE: [
        ('group = "TOOL"\n', "", r"'obstacle.plane.shape' needs 'group'"),
        ('"TOOL"', '"TOOLS"', r"unknown group of cells 'TOOLS': did you mean 'TOOL'"),
        ('"mesh"', '"mash"', r"unknown obstacle.plane.shape.kind 'mash': did you mean 'mesh'"),
        ('file = "tool.med"\n', "", r"unknown group of cells 'TOOL'"),
        ('"tool.med"', '"tol.med"', r"tol.med"),
    ],
}


ALL = [(text, *mistake) for text, given in MISTAKES.items() for mistake in given]


@pytest.mark.parametrize(("text", "old", "new", "message"), ALL, ids=[mistake[-1] for mistake in ALL])
def test_mistakes_name_the_key(write, tool, text, old, new, message):
    """Those in the file of a rigid surface are no mistakes of the case."""
    assert old in text
    with pytest.raises(fc.FastcontactError if text == SURFACE else fc.CaseError, match=message):
        read_case(write(text.replace(old, new, 1)))


BLOCKS = """generator = "block-on-block"
size_lower = [4.0, 2.0]
size_upper = [2.2, 1.5]
divisions_lower = [6, 3]
divisions_upper = [4, 2]
shift = 0.83"""
UPPER = '[[material]]\ngroups = "UPPER"\nE = 3000.0\nnu = 0.2\n'
ASKED = """
[[sensitivity]]
quantity = ["contact_force", "c", "y"]
by = [["E", "LOWER"], ["E", 1], ["prescribed", "UPPER_TOP", "y"]]
[[sensitivity]]
quantity = ["displacement", "UPPER_LEFT_BOTTOM", "y"]
by = [["E", "LOWER"]]
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(folder, asked, options=""):
    held = {"LOWER_BOTTOM": "xy", "UPPER_TOP": {"x": 0.0, "y": -0.05}}
    tables = UPPER + contact_pair(options=options, name="c") + asked
    (folder / "case.toml").write_text(
        case_of(BLOCKS, tables, material='groups = "LOWER"\nE = 1000.0\nnu = 0.3', **held)
    )
    return folder / "case.toml"


def test_they_are_in_the_summary(folder, capsys):
    written(folder, ASKED.replace("UPPER_LEFT_BOTTOM", "UPPER_TOP_LEFT"))
    assert main(["run", "case.toml", "--json", "summary.json"]) == 0
    assert "sensitivities of contact_force c y (value " in capsys.readouterr().out
    force, height = json.loads((folder / "summary.json").read_text())["sensitivities"]
    value = {tuple(own["by"]): own["value"] for own in force["derivatives"]}
    # All displacements are prescribed: forces go with the moduli.
    assert 1000.0 * value["E", "LOWER"] + 3000.0 * value["E", 1] == pytest.approx(force["value"], rel=1e-8)
    assert value["prescribed", "UPPER_TOP", "y"] == pytest.approx(force["value"], rel=0.05)
    assert height["value"] == pytest.approx(-0.05)
    assert height["derivatives"][0]["value"] == pytest.approx(0.0, abs=1e-15)
    assert main(["run", "case.toml", "--resume"]) == 0
    assert "sensitivities of contact_force c y (value " in capsys.readouterr().out


def test_what_has_none_says_why(folder, capsys):
    path = written(folder, ASKED.replace("UPPER_LEFT_BOTTOM", "UPPER_TOP_LEFT"), "friction = 0.3")
    assert main(["run", str(path)]) == 0
    assert "no sensitivities of contact_force c y: contact 'c' has friction" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        (ASKED, "unknown group 'UPPER_LEFT_BOTTOM'"),
        ("[[sensitivity]]\nby = []\n", r"sensitivity\[0\] needs 'quantity'"),
        ("[[sensitivity]]\nquantity = ['pressure_max', 'c']\nby = ['E', 0]\n", "'by' a list of lists"),
        ("[[sensitivity]]\nquantity = ['pressure_max', 'c']\nby = [['E', 1.5]]\n", "'by' a list of lists"),
        ("[[sensitivity]]\nquantity = ['pressure_max', 'd']\nby = []\n", r"sensitivity\[0\]: unknown contact pair 'd'"),
        ("[[sensitivity]]\nquantity = ['pressure_max', 'c']\nby = [['E', 7]]\n", "unknown material '7'"),
        ("[[sensitivity]]\nquantity = ['pressure_max', 'c']\nfor = []\n", "unknown key"),
    ],
)
def test_what_is_refused_before_numerics(folder, asked, message):
    refused(fc.FastcontactError, message, read_case, written(folder, asked))


@pytest.mark.parametrize(
    ("files", "words"),
    [
        ('["lower.med", "upper.med"]', None),
        ('["lower.med", "again.med"]', "'lower.med' and 'again.med' both have a group 'LOWER_\\w+': rename one of"),
        ("[]", "'mesh.file' must be a path or a list of paths"),
        ('["lower.med", 3]', "'mesh.file' must be a path or a list of paths"),
    ],
)
def test_several_mesh_files_are_joined(files, words, write, tmp_path):
    lower = renamed(block((1.0, 1.0), (2, 2)), lambda group: f"LOWER_{group}")
    upper = renamed(block((1.0, 1.0), (2, 2), origin=(0.0, 1.0)), lambda group: f"UPPER_{group}")
    for name, mesh in (("lower", lower), ("upper", upper), ("again", lower)):
        fc.write_mesh(tmp_path / f"{name}.med", mesh)
    text = (
        f'kinematics = "plane_strain"\n[mesh]\nfile = {files}\n[[material]]\nE = 1000.0\nnu = 0.0\n'
        '[[support]]\ngroup = "LOWER_BOTTOM"\nx = 0.0\ny = 0.0\n[[support]]\ngroup = "UPPER_LEFT"\nx = 0.0\n'
        '[[pressure]]\ngroup = "UPPER_TOP"\nvalue = 2.0\n'
        '[contact.joint]\nsecondary = "UPPER_BOTTOM"\nprimary = "LOWER_TOP"\n[ramp]\nsteps = 1\n'
    )
    path = write(text)
    if words:
        refused(fc.CaseError, words, read_case, path)
        return
    case = read_case(path)
    assert case.mesh.n_points == lower.n_points + upper.n_points
    assert fc.solve(case.model, case.ramp)[-1].contact["joint"].pressure == pytest.approx(2.0)
    (tmp_path / "copy").mkdir()
    copied = copy_case(path, tmp_path / "copy/c.toml")
    assert [file.name for file in copied] == ["c.toml", "lower.med", "upper.med"]
    assert read_case(copied[0]).mesh.n_points == case.mesh.n_points
