"""Adaptive meshes: the requested accuracy with few unknowns; files; refusals."""

import json

import numpy as np
import pytest
from pairwise import first_of

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.errors import CaseError


@pytest.fixture(scope="module")
def case(root):
    return root / "data/cases/forma04c.toml"


@pytest.mark.parametrize(
    ("name", "element", "formulation", "most"),
    first_of(
        2,
        [
            ("forma04c", "quad8", "continuous", 8_000),
            ("forma04b", "tri6", "continuous", 8_000),
            ("forma04c", "quad4", "node_to_segment", 10_000),
            ("forma04a", "tri3", "node_to_segment", 10_000),
        ],
    ),
)
def test_the_largest_pressure_within_a_thousandth_unattended(root, name, element, formulation, most):
    case = root / f"data/cases/{name}.toml"
    study = fc.adaptive_study(case, "pressure_max", 1e-3, element=element, formulation=formulation)
    assert study.reached
    # Of the mesh-converged solution, found by another method. Uniform refinement of linear cells takes 86 000 and more.
    assert study.rounds[-1].true_error("pressure_max") <= 1e-3
    assert study.rounds[-1].n_dofs <= most
    assert study.effectivity() >= 1.0


def test_the_force_too(case):
    study = fc.adaptive_study(case, "force", 1e-3)
    assert study.reached
    ((caption, rows),) = study.tables()
    assert str(caption) in study._repr_html_()
    assert len(rows) == 1 + len(study.rounds)
    assert study.rounds[-1].true_error("force") <= 1e-3


def test_the_command_writes_what_it_shows(case, tmp_path, capsys):
    files = {name: tmp_path / f"adaptive.{name}" for name in ("json", "csv", "png", "html")}
    options = [text for name, path in files.items() for text in (f"--{name}", str(path))]
    result = tmp_path / "last.vtkhdf"
    assert main(["converge", str(case), "--adaptive", "--tolerance", "0.01", "-o", str(result), *options]) == 0
    shown = capsys.readouterr().out
    study = json.loads(files["json"].read_text())
    assert study["reached"]
    assert f"{study['value']:.8g}" in shown
    assert files["png"].read_bytes()[:4] == b"\x89PNG"
    assert "data:image/png;base64" in files["html"].read_text()
    last = fc.open_results(result)[-1]
    model = fc.open_results(result).mesh
    cells = last.cell_fields["error"]
    assert len(cells) == sum(map(len, model.solids.values())) == study["rounds"][-1]["n_cells"]
    assert np.linalg.norm(cells) > 0


def test_not_reached_is_said_and_is_exit_code_two(case, capsys):
    arguments = ["converge", str(case), "--adaptive", "--tolerance", "1e-6", "--max-dofs", "4000"]
    assert main(arguments) == 2
    assert "NOT within the 1e-06 requested" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"quantity": "presure_max"}, "'pressure_max'"),
        ({"tolerance": 0.0}, "between 0 and 1"),
        ({"element": "quad5"}, "unknown element"),
    ],
)
def test_what_is_wrong_is_told(case, options, words):
    with pytest.raises(CaseError, match=words):
        fc.adaptive_study(case, **options)
