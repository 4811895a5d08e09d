"""A study of synthetic runs with known limits and model errors: tables, sentences, pictures, reports."""

import json
import re

import numpy as np
import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli import main
from fastcontact.studies import runs as convergence
from fastcontact.studies import settings as levels
from fastcontact.studies.convergence_report import limit_rows
from fastcontact.studies.settings import combinations, settings

FORCE, PRESSURE = 600_000.0, 2900.0  # of theory
LIMITS = {"force": 1.1 * FORCE, "pressure_max": 1.04 * PRESSURE, "C1.stress.yy": -2800.0}


def made_up(level, order=2.0, theory=True, reference=None, broken=False):
    """What a run of this level gives; `broken` ones say why they failed instead."""
    if broken:
        return {"error": "the contact geometry did not converge", "kind": "ConvergenceError", "seconds": 1.0}
    h = 0.5**level
    values = {name: limit * (1.0 + 0.1 * h**order) for name, limit in LIMITS.items()}
    r = np.linspace(0.0, 9.0, 10)
    return {
        "h": h, "n_dofs": 100 * 4**level, "values": values, "seconds": 2.0, "warnings": [],
        "profile": {"r": r.tolist(), "pressure": (PRESSURE * np.sqrt(1.0 - (r / 9.0) ** 2)).tolist()},
        "theory": {"force": FORCE, "pressure_max": PRESSURE} if theory else {}, "reference": reference or {},
    }  # fmt: skip


@pytest.fixture(scope="module")
def case(root):
    return read_case(root / "data/cases/forma04c.toml")


def gathered(case, results, elements=("quad8",), wanted=("C1.stress.yy",)):
    """The study of these results, one list of levels an element."""
    chosen = settings(case)
    members = combinations(chosen, elements, ["continuous"])
    jobs = [convergence.level_job(case, chosen, member, k) for member in members for k in range(len(results[0]))]
    return convergence.study_of_runs(case, jobs, [one for levels in results for one in levels], wanted)


@pytest.fixture(scope="module")
def found(case):
    levels = range(5)
    return gathered(case, [[made_up(k, reference={"force": LIMITS["force"]}) for k in levels]])


def test_limits_and_model_errors_are_those_put_in(found):
    told = json.loads(json.dumps(found.as_dict()))
    for name, model in (("force", 0.1), ("pressure_max", 0.04)):
        entry = told["quantities"][name]
        assert entry["limit"] == pytest.approx(LIMITS[name], rel=2e-5)
        assert abs(entry["limit"] - LIMITS[name]) <= entry["uncertainty"]
        assert entry["order"] == pytest.approx(2.0, abs=0.05)
        assert entry["model_error"] == pytest.approx(model, abs=2e-5)
        # Model and mesh error add up to what the finest mesh differs from theory.
        finest = found.best.finest.values[name] / found.best.theory[name] - 1.0
        assert entry["model_error"] + entry["mesh_error"] == pytest.approx(finest, abs=1e-12)
    assert told["quantities"]["force"]["reference_in_error_bar"]
    assert told["quantities"]["C1.stress.yy"]["theory"] is None
    assert told["failed_combinations"] == {}
    # The theory of the case, at the limit of the force.
    at_force = found.theory.at_force(told["quantities"]["force"]["limit"]).pressure_max
    assert told["equal_force"]["pressure_max"]["theory"] == pytest.approx(at_force, rel=1e-12)


def test_a_row_for_every_level(found):
    table = found.table()
    assert table["level"].tolist() == [0, 1, 2, 3, 4]
    assert table["element"].tolist() == ["quad8"] * 5
    assert table["force_error"] == pytest.approx(0.1 * 0.25 ** np.arange(5), abs=2e-5)
    assert table["force_order"][1:] == pytest.approx(2.0, abs=0.05)
    assert table["force_from_theory"] == pytest.approx(1.1 * (1.0 + 0.1 * 0.25 ** np.arange(5)) - 1.0)
    assert "C1.stress.yy_from_theory" not in table.dtype.names  # no theory knows it


def test_tables_and_sentences(found):
    text = "\n".join(found.lines())
    assert "model error" in text
    assert "+9.999 %" in text or "+10.000 %" in text
    assert "inside the error bar" in text
    assert "at equal force" in text


def test_two_levels_have_no_limit_and_say_so(case):
    study = gathered(case, [[made_up(0), made_up(1)]])
    assert not study.best.limits
    text = "\n".join(study.lines())
    assert "no limits: 2 levels were solved, but an extrapolated limit needs three" in text
    assert study.as_dict()["quantities"]["force"]["limit"] is None
    assert np.isnan(study.best.orders("force")).all()
    study.figure()
    assert "<td>-</td>" in study.html()


def test_what_failed_is_told_and_the_rest_shown(case):
    good, poor = [made_up(k) for k in range(4)], [made_up(k, broken=k != 1) for k in range(4)]
    study = gathered(case, [good, poor, [made_up(k, broken=True) for k in range(4)]], ("quad8", "quad4", "tri6"))
    assert study.best.combination.element == "quad8"
    text = "\n".join(study.lines())
    for told in ("level 0 failed: the contact geometry did not converge", "quad8 continuous", "tri6 continuous failed"):
        assert told in text
    assert len(study.as_dict()["failed_combinations"]) == 1
    assert len(study.series[1].failed) == 3
    assert study.html().count("class='failed'") >= 2
    assert study.table()["element"].tolist() == ["quad8"] * 4 + ["quad4"]


def test_a_quantity_that_nothing_gives_is_named(case):
    with pytest.raises(fc.CaseError, match=r"'C1.stres.yy'.*C1.stress.yy"):
        gathered(case, [[made_up(k) for k in range(3)]], wanted=("C1.stres.yy",))


def test_without_theory_the_mesh_error_is_all_there_is(case):
    study = gathered(case, [[made_up(k, theory=False) for k in range(4)]])
    entry = study.as_dict()["quantities"]["force"]
    assert entry["model_error"] is None
    assert entry["mesh_error"] == pytest.approx(0.1 * 0.25**3, abs=3e-4)
    assert "the mesh error of the contact force is" in "\n".join(study.lines())


def test_errors_relative_to_a_limit_near_zero_are_absolute(case):
    """The relative L2 norm of a pressure error is a relative error already; a stress may vanish in the limit."""
    levels = [made_up(k) for k in range(4)]
    for k, level in enumerate(levels):
        level["values"] |= {"pressure_error": 0.001 + 0.1 * 0.25**k, "C1.stress.xy": 8.0 * 0.25**k}
    study = gathered(case, [levels], wanted=("C1.stress.yy", "C1.stress.xy"))
    header, *rows = limit_rows(study.best, {})
    errors = {row[0]: row[header.index("mesh error")] for row in rows}
    assert float(errors["error of the pressure, relative L2 norm [1]"]) == pytest.approx(0.1 / 64.0, rel=0.2)
    assert float(errors["C1.stress.xy"]) == pytest.approx(8.0 / 64.0, rel=0.2)
    assert errors["C1.stress.yy"].endswith(" %")


def test_a_mesh_that_agrees_with_theory_by_chance_is_told(case):
    """The limit is 4 % above theory, and coarse meshes come from below: one lies on the theory by chance."""
    levels = [made_up(k) for k in range(5)]
    for k, level in enumerate(levels):
        level["values"]["pressure_max"] = 1.04 * PRESSURE * (1.0 - 0.16 * 0.25**k)
    text = "\n".join(gathered(case, [levels]).lines())
    assert "the agreement does not prove that the mesh is fine enough" in text
    assert "Level 1 " in text


def test_values_that_are_not_monotonic_support_no_model_error(case):
    levels = [made_up(k) for k in range(4)]
    for level, value in zip(levels, [0.99935, 1.00091, 1.001, 1.00066], strict=True):
        level["values"]["force"] = value * FORCE
    study = gathered(case, [levels])
    (told,) = (line for line in study.lines() if "contact force differs" in line)
    assert "observed orders 2.3, -0.42, 4.5" in told
    assert "no model error is stated" in told
    quantities = study.as_dict()["quantities"]
    assert quantities["force"]["model_error"] is None
    assert quantities["pressure_max"]["model_error"] == pytest.approx(0.04, abs=1e-3)


@pytest.mark.parametrize(
    ("values", "converging"),
    [
        ([1.00009935, 1.0000994, 1.0000993], True),  # agree, but their changes grow
        ([1.01, 1.02, 1.03], False),  # change monotonically, but not less and less
    ],
)
def test_sentences_on_model_error_and_convergence_do_not_contradict_each_other(case, values, converging):
    levels = [made_up(k) for k in range(3)]
    for level, value in zip(levels, values, strict=True):
        level["values"]["force"] = value * FORCE
    study = gathered(case, [levels])
    entry, text = study.as_dict()["quantities"]["force"], "\n".join(study.lines())
    assert entry["converging"] == converging
    assert ("The contact force does not converge" in text) != converging
    assert ("contact force differs from theory by +0.010 %. Of that, +0.009" in text) == converging
    assert ("Its values do not converge" in text) != converging
    if converging:
        assert entry["uncertainty"] >= np.ptp(values) * FORCE
    else:
        assert entry["model_error"] is None


def test_the_position_of_a_node_is_known_to_half_the_distance_between_nodes(case):
    """Nested meshes share the node with the largest stress, whose position never changes."""
    levels = [made_up(k) for k in range(3)]
    for k, level in enumerate(levels):
        level["values"]["von_mises_depth"], level["spacings"] = 0.27, {"von_mises_depth": 0.04 * 0.5**k}
    study = gathered(case, [levels])
    assert study.as_dict()["quantities"]["von_mises_depth"]["uncertainty"] == 0.01
    (row,) = (row for row in limit_rows(study.best, {}) if row[0].startswith("depth"))
    assert "0.01 (node spacing)" in row
    assert "+0.000 %" not in row


@pytest.fixture(scope="module")
def on_a_mesh_file(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    fc.write_mesh(folder / "coarse.med", fc.generate.half_spheres("tri3", size=15.0))
    path = folder / "coarse.toml"
    path.write_text(
        'kinematics = "axisymmetric"\n[mesh]\nfile = "coarse.med"\n[[material]]\nE = 20000.0\nnu = 0.3\n'
        '[[support]]\ngroup = "A1A2"\nx = 0.0\n[[support]]\ngroup = "A2B2"\ny = -2.0\n'
        '[[support]]\ngroup = "A1B1"\ny = 2.0\n[contact.c]\nsecondary = "CONT1"\nprimary = "CONT2"\n[ramp]\nsteps = 1\n'
    )
    return path


@pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")
def test_a_mesh_file_is_refined_with_its_arcs_round(on_a_mesh_file, tmp_path, capsys):
    told = tmp_path / "study.json"
    arguments = ["converge", str(on_a_mesh_file), "--levels", "2", "--elements", "tri3,tri6", "--workers", "1"]
    assert main([*arguments, "--formulations", "continuous", "--json", str(told)]) == 0
    linear, quadratic = json.loads(told.read_text())["combinations"]
    for series in (linear, quadratic):
        coarse, fine = series["levels"]
        assert 3.0 < fine["n_dofs"] / coarse["n_dofs"] < 4.0
        assert fine["h"] == pytest.approx(0.5 * coarse["h"], rel=0.05)
    # Mid nodes are the corners of the next level.
    assert quadratic["levels"][0]["n_dofs"] == linear["levels"][1]["n_dofs"]
    force = [series["levels"][1]["force"] for series in (linear, quadratic)]
    assert force[0] == pytest.approx(force[1], rel=0.2)
    assert "no limits: 2 levels were solved" in capsys.readouterr().out


def test_corners_of_a_quadratic_mesh_file_make_a_linear_study(on_a_mesh_file):
    mesh = fc.generate.half_spheres("tri6", size=15.0)
    case = read_case(on_a_mesh_file)
    for element, kinds in (("tri3", {"tri3"}), ("tri6", {"tri6"}), (None, {"tri6"})):
        made = levels.make_mesh(levels.recipe(settings(case), element, 1), mesh)
        assert set(made.solids) == kinds
        assert len(made.cells[kinds.pop()]) == 4 * len(mesh.cells["tri6"])


def test_the_report_stands_alone_and_says_everything(root):
    study = fc.convergence_study(root / "data/cases/forma04c.toml", levels=3, workers=1)
    names = [str(series.combination) for series in study.series]
    captions = [caption for caption, _ in study.tables()]
    assert captions[:-1] == [caption for name in names for caption in (name, f"{name}: limits")]
    assert study._repr_html_().count("<tr") == sum(len(rows) for _, rows in study.tables())
    page, text = study.html(), "\n".join(study.lines())
    assert not re.search(r"(src|href)=['\"](?!data:)", page)
    assert "http" not in page
    assert page.count("<img") == page.count("data:image/png;base64,") == 1
    for caption, rows in study.tables():
        assert f"<caption>{caption}</caption>" in page
        assert f"\n{caption}\n" in text
        assert all(f">{cell}<" in page.replace("&plusmn;", "+-") for row in rows for cell in row)
        assert {len(row) for row in rows} == {len(rows[0])}
