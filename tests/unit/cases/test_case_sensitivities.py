"""Sensitivities in case files: summary, text output, refusals before numerics."""

import json

import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli import main

CASE = """
kinematics = "plane_strain"
[mesh]
generator = "block-on-block"
size_lower = [4.0, 2.0]
size_upper = [2.2, 1.5]
divisions_lower = [6, 3]
divisions_upper = [4, 2]
shift = 0.83
[[material]]
groups = "LOWER"
E = 1000.0
nu = 0.3
[[material]]
groups = "UPPER"
E = 3000.0
nu = 0.2
[[support]]
group = "LOWER_BOTTOM"
x = 0.0
y = 0.0
[[support]]
group = "UPPER_TOP"
x = 0.0
y = -0.05
[contact.c]
secondary = "CONT_UPPER"
primary = "CONT_LOWER"
{}
[ramp]
steps = 1
"""
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
    (folder / "case.toml").write_text(CASE.format(options) + asked)
    return folder / "case.toml"


def test_they_are_in_the_summary(folder, capsys):
    asked = ASKED.replace("UPPER_LEFT_BOTTOM", "UPPER_TOP_LEFT")
    written(folder, asked)
    assert main(["run", "case.toml", "--json", "summary.json"]) == 0
    assert "sensitivities of contact_force c y, now " in capsys.readouterr().out
    force, height = json.loads((folder / "summary.json").read_text())["sensitivities"]
    value = {tuple(own["by"]): own["value"] for own in force["derivatives"]}
    # All displacements are prescribed: forces go with the moduli.
    assert 1000.0 * value["E", "LOWER"] + 3000.0 * value["E", 1] == pytest.approx(force["value"], rel=1e-8)
    assert value["prescribed", "UPPER_TOP", "y"] == pytest.approx(force["value"], rel=0.05)
    assert height["value"] == pytest.approx(-0.05)
    assert height["derivatives"][0]["value"] == pytest.approx(0.0, abs=1e-15)
    assert main(["run", "case.toml", "--resume"]) == 0
    assert "sensitivities of contact_force c y, now " in capsys.readouterr().out


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
    with pytest.raises(fc.FastcontactError, match=message):
        read_case(written(folder, asked))
