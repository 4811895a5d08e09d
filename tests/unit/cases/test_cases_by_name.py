"""The ready-made cases: found by name, listed, copied, and each within its stated tolerances."""

import json
import re
import tomllib

import numpy as np
import pytest
from commands import output_of
from pairwise import first_of

import fastcontact as fc
from fastcontact.cases.case import case_path, read_case, ready_made_case, ready_made_cases
from fastcontact.cli import main

NAMES = list(ready_made_cases())
# The training case on the project's own meshes: how far from Hertz, beyond what code_aster allows on its meshes.
BY_LITTLE = {"forma04a": 0.01296, "forma04b": 0.03111, "forma04c": 0.05339}


def test_the_cases_that_are_promised_are_there():
    assert set(NAMES) >= {
        "sphere-on-plane-3d", "cylinder-on-block", "press-fit", "flat-punch", "cattaneo-mindlin", "force-driven-sphere",
    }  # fmt: skip


@pytest.mark.parametrize("name", NAMES)
def test_every_ready_case_says_what_it_shows_and_what_to_expect(name):
    text = ready_made_case(name).read_text(encoding="utf-8")
    comment = re.match(r"(#.*\n)+", text)
    assert comment
    assert "Expect " in comment.group()
    data = tomllib.loads(text)
    assert data["title"]
    assert data["check"]
    assert all(check["tolerance"] <= 0.1 for check in data["check"])


@pytest.mark.parametrize("name", NAMES)
def test_every_ready_case_passes_its_checks(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["run", name, "--json", "summary.json"]) == 0
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["checks"]
    missed = [check for check in summary["checks"] if not check["passed"]]
    printed = capsys.readouterr()
    if name in BY_LITTLE:
        (check,) = missed
        assert abs(check["deviation"]) == pytest.approx(BY_LITTLE[name], rel=0.01)
    else:
        assert missed == []
        assert "NOT within" not in printed.out
    assert ("warning" in printed.err) == (name == "forma04-no-contact")
    assert (tmp_path / f"{name}.vtkhdf").exists()


def test_the_list_names_every_case_with_what_it_is_and_checks(capsys):
    printed = output_of(capsys, ["cases"])
    for name in NAMES:
        assert f"{name}: {tomllib.loads(ready_made_case(name).read_text())['title']}\n" in printed
    assert "axisymmetric, 3168 tri3, 20 load steps" in printed
    assert "checks pair.stick_radius against the theory's stick_radius within 0.02" in printed


def test_a_case_is_printed_as_it_stands(capsys):
    assert output_of(capsys, ["cases", "press-fit"]) == ready_made_case("press-fit").read_text(encoding="utf-8")


def test_a_case_is_copied_with_its_mesh_and_runs_there(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert "mine.toml, forma04a.med" in output_of(capsys, ["cases", "--copy", "forma04-no-contact", "-o", "mine.toml"])
    assert main(["run", "mine.toml", "-q"]) == 0
    assert main(["cases", "--copy", "press-fit"]) == 0
    assert (tmp_path / "press-fit.toml").read_text() == ready_made_case("press-fit").read_text()
    capsys.readouterr()
    assert "already exists" in output_of(capsys, ["cases", "--copy", "press-fit"], 1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "presfit"], "did you mean 'press-fit'"),
        (["cases", "flatpunch"], "did you mean 'flat-punch'"),
        (["cases", "--copy", "flatpunch"], "did you mean 'flat-punch'"),
        (["cases", "press-fit", "--copy", "press-fit"], "not both"),
        (["cases", "-o", "x.toml"], "needs --copy NAME"),
    ],
)
def test_wrong_names_are_one_line(arguments, message, capsys):
    error = output_of(capsys, arguments, 1)
    assert message in error
    assert error.count("\n") == 1


def test_a_file_goes_before_a_ready_case(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "press-fit").write_text("not a case")
    assert case_path("press-fit").read_text() == "not a case"
    assert case_path("press-fit.toml").name == "press-fit.toml"


@pytest.mark.parametrize("name", first_of(1, ["flat-punch", "press-fit"]))
def test_theories_without_a_curve_leave_pictures_of_the_computed_alone(name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", name, "-q", "-o", "r.vtkhdf", "--plot", "run.png"]) == 0
    assert main(["profile", "r.vtkhdf", "-q", "--png", "profile.png", "--csv", "profile.csv"]) == 0
    assert main(["plot", "r.vtkhdf", "-q", "--history", "--png", "history.png"]) == 0
    for picture in ("run.png", "profile.png", "history.png"):
        assert (tmp_path / picture).read_bytes()[:4] == b"\x89PNG"
    assert "Hertz" not in (tmp_path / "profile.csv").read_text().splitlines()[0]


def test_half_a_contact_is_drawn_with_the_theory_of_the_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["run", "cylinder-on-block", "-q", "-o", "r.vtkhdf"]) == 0
    assert main(["profile", "r.vtkhdf", "-q", "--csv", "p.csv"]) == 0
    table = np.genfromtxt(tmp_path / "p.csv", delimiter=",", names=True)
    hertz = fc.analytic.hertz_line(E1=210e3, nu1=0.3, R1=50.0, E2=210e3, nu2=0.3, force=20_000.0)
    assert table["pressure_Hertz_equal_force"][0] == pytest.approx(hertz.pressure_max, rel=1e-3)


def test_a_wheel_carries_the_cases_and_their_meshes(root):
    project = tomllib.loads((root / "pyproject.toml").read_text())
    carried = project["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    assert carried["data/cases"] == "fastcontact/data/cases"
    for name in NAMES:
        mesh = tomllib.loads(ready_made_case(name).read_text())["mesh"]
        if "file" in mesh:
            assert (root / "data/cases" / mesh["file"]).resolve().parent == root / "data/meshes"
            assert carried["data/meshes"] == "fastcontact/data/meshes"


def test_the_path_of_a_ready_case_tells_its_name_where_there_is_no_such_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(fc.CaseError, match="not exist; the ready-made case of this name needs no path: 'forma04a'"):
        read_case("data/cases/forma04a.toml")
