"""Studies of any case: rigid obstacles, every generator, exact theories, limits that do not settle."""

import json

import numpy as np
import pytest
from refusals import refused

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli import main
from fastcontact.studies import quantities
from fastcontact.studies.convergence_report import sentences
from fastcontact.studies.fit import fit_limit
from fastcontact.studies.job import job_of
from fastcontact.studies.settings import RULES, combinations, make_mesh, matching_combination, recipe, settings

BALL = """kinematics = "axisymmetric"
mesh = { file = "block.med" }
material = [{ E = 1000.0, nu = 0.3 }]
support = [{ group = "SYMMETRY_X", x = 0.0 }, { group = "BOTTOM", y = 0.0 }]
ramp = { steps = 1 }
[obstacle.ball]
secondary = "CONTACT"
shape = { kind = "sphere", centre = [0.0, 10.0], R = 10.0 }
motion = { y = -0.1 }
"""
FIT = """
[study]
generator = "rings"
[study.quadrangles]
divisions_inner = [6, 14]
divisions_outer = [8, 18]
"""
COARSE = {
    "half-spheres": {"size": 16.0, "contact_size": 8.0},
    "quarter-disc": {"arc_sizes": [3.0, 6.0], "segments": 3},
    "cylinder-on-block": {"size": 25.0, "contact_size": 5.0},
    "graded-block": {"contact_size": 0.5},
    "punched-block": {"edge_size": 0.05},
    "crowned-blocks": {"contact_size": 0.5},
    "sphere-on-block": {"size": 12.0, "contact_size": 5.0},
    "sphere-octant": {"size": 12.0, "contact_size": 5.0},
}


def case_of(tmp_path, generator):
    """Return a case without supports on the mesh of a generator."""
    arguments = "\n".join(f"{key} = {value}" for key, value in COARSE.get(generator, {}).items())
    solid = generator in ("box", "sphere-on-block", "sphere-octant")
    element = "tri3" if generator == "half-spheres" else "hex8" if solid else "quad4"
    text = f'kinematics = "{"3d" if solid else "plane_strain"}"\n[mesh]\ngenerator = "{generator}"\nelement = "{element}"\n'
    path = tmp_path / "case.toml"
    path.write_text(f"{text}{arguments}\n[[material]]\nE = 1.0\nnu = 0.3\n")
    return read_case(path)


@pytest.mark.parametrize("generator", fc.generate.GENERATORS)
def test_every_generator_makes_meshes_half_as_fine(tmp_path, generator):
    case = case_of(tmp_path, generator)
    chosen = settings(case)
    sizes = [make_mesh(recipe(chosen, chosen.case_combination.element, level), case.mesh) for level in (0, 1)]
    coarse, fine = (sum(map(len, mesh.solids.values())) for mesh in sizes)
    assert coarse == sum(map(len, case.mesh.solids.values()))
    dim = case.mesh.dim
    assert 0.7 * 2**dim < fine / coarse < 1.5 * 2**dim
    assert generator in RULES


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    fc.write_mesh(
        folder / "block.med", fc.generate.graded_block("quad4", width=20.0, contact_radius=1.2, contact_size=0.3)
    )
    (folder / "ball.toml").write_text(BALL)
    return folder / "ball.toml"


def test_a_study_with_an_obstacle_measures_its_contact(ball, tmp_path):
    out = tmp_path / "out.json"
    assert main(["converge", str(ball), "--levels", "3", "--workers", "1", "--json", str(out), "-q"]) == 0
    found = json.loads(out.read_text())["quantities"]
    hertz = fc.analytic.hertz_point(E1=1000.0, nu1=0.3, R1=10.0, approach=0.1)
    assert found["force"]["limit"] == pytest.approx(hertz.force, rel=0.1)
    words = ["sweep", str(ball), "--set", "material[0].E=1000,2000", "--level", "0", "--workers", "1"]
    assert main([*words, "--json", str(out), "-q"]) == 0
    one, two = (point["force"] for point in json.loads(out.read_text())["points"])
    assert two / one == pytest.approx(2.0, rel=1e-6)


def test_quantities_of_checks_can_be_studied(ball):
    """Those of contact pairs as well as those of probes, in their units."""
    case = read_case(ball)
    sweep = fc.parameter_sweep(
        case, {"obstacle.ball.motion.y": [-0.1]}, quantities=["ball.force.y"], level=0, workers=1
    )
    (point,) = sweep.points
    assert abs(point.values["ball.force.y"]) == pytest.approx(point.values["force"])
    assert quantities.unit("ball.force.y", {"force": "N"}) == "N"
    quantities.check_names(case, ["ball.radius"])
    for name in ("ball.torque", "ball.force.z", "ball.moment.z"):  # it does not rotate; components of other kinematics
        refused(fc.CaseError, "unknown quantity 'ball", quantities.check_names, case, [name])
    refused(fc.CaseError, r"for example, PROBE.stress.yy and PAIR.force.x", quantities.check_names, case, ["bulge"])


def test_an_obstacle_takes_every_formulation(ball):
    chosen = settings(read_case(ball))
    every = [c.formulation for c in combinations(chosen, None, ["all"])]
    assert every == ["continuous", "mortar", "node_to_segment"]
    case = read_case(ball)
    job = job_of(case, chosen, matching_combination(chosen, None, "node-to-segment"), 0, label="", marks={}, size=0.0)
    assert job.data["obstacle"]["ball"]["formulation"] == "node_to_segment"
    assert job.data["obstacle"]["ball"]["motion"] == {"y": -0.1}


def test_a_rigid_surface_from_a_file_is_found_beside_the_case(tmp_path):
    case = tmp_path / "case.toml"
    fc.write_mesh(
        tmp_path / "block.med", fc.generate.graded_block("quad4", width=20.0, contact_radius=1.2, contact_size=0.5)
    )
    fc.write_mesh(tmp_path / "plate.med", fc.generate.block((4.0, 1.0), (4, 1), "quad4", origin=(-2.0, 0.0)))
    shape = 'shape = "mesh"\nfile = "plate.med"\ngroup = "BOTTOM"\n'
    text = BALL.replace("axisymmetric", "plane_strain").replace(
        'shape = { kind = "sphere", centre = [0.0, 10.0], R = 10.0 }\n', shape
    )
    case.write_text(text)
    assert fc.convergence_study(case, 1, workers=1).series[0].values("force")[0] > 0


def test_the_theory_counts_for_the_share_that_the_model_holds(root):
    found = quantities.comparison_values(read_case(root / "data/cases/cylinder-on-block.toml"), "line", 10_000.0)
    assert found["theory"]["force"] == pytest.approx(10_000.0)
    assert found["equal_force"]["pressure_max"] == pytest.approx(3832.9, rel=1e-4)


def test_a_formulation_that_misses_an_exact_theory_is_told_so(root, tmp_path):
    case = tmp_path / "fit.toml"
    case.write_text((root / "data/cases/press-fit.toml").read_text() + FIT)
    study = fc.convergence_study(case, 3, ["quad8"], ["continuous", "mortar"], workers=1)
    off, right = study.series
    lame = fc.analytic.press_fit_cylinders(
        E_inner=210e3, nu_inner=0.3, E_outer=70e3, nu_outer=0.33, inner_radius=20.0, interface_radius=50.0,
        outer_radius=100.0, interference=0.05,
    ).pressure  # fmt: skip
    assert off.theory["pressure_max"] == pytest.approx(lame)
    for series in (off, right):
        limit = series.limits["pressure_max"]
        told = any("does not converge to it" in text for text in sentences(series))
        assert told == (series.converges_to_theory("pressure_max") is False)
        assert told or abs(limit.value - lame) <= limit.uncertainty + 1e-4 * lame
    assert off.converges_to_theory("pressure_max") is False, "its largest pressure is 14 % off on every mesh"


@pytest.mark.parametrize(
    ("values", "settles"),
    [
        ([5.0, 3.0, 2.0, 1.5], True),
        ([5.0, 4.0, 3.9, 3.0], False),
        ([1.0, 0.0, 0.9, 0.001], False),
        ([9, 1, 1.001, 1.003], True),
    ],
)
def test_values_settle_where_the_last_change_is_small(values, settles):
    assert fit_limit(0.5 ** np.arange(4.0), values).converging is settles


@pytest.mark.slow
def test_pictures_of_a_study_show_uniform_and_shared_theories(tmp_path):
    for case in ("press-fit", "cylinder-on-block"):
        words = ["converge", case, "--levels", "1", "--workers", "1", "--png", str(tmp_path / "s.png"), "-q"]
        assert main([*words, "--html", str(tmp_path / "s.html")]) == 0
        assert (tmp_path / "s.png").read_bytes()[:4] == b"\x89PNG"
