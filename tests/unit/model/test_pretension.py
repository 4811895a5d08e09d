"""Pretension sections: refusals, case files, results."""

import json

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact.cases.case import build_case
from fastcontact.cli._main import main
from fastcontact.model.fingerprint import different, fingerprint


def bar(cut=True):
    mesh = fc.generate.block((1.0, 2.0), (2, 4))
    mesh = mesh.with_facet_group("CUT", lambda x: np.abs(x[:, 1] - 1.0) < 1e-9, between=True)
    model = elastic_model(fc.generate.cut(mesh, "CUT") if cut else mesh, "plane_stress")
    for end in ("TOP", "BOTTOM"):
        model.fix(end, "xy")
    return model


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "pretension 'bolt' needs either a force or a shortening"),
        ({"force": 1.0, "shortening": 1.0}, "needs either a force or a shortening"),
        ({"shortening": 1.0, "locked_from": 1.0}, "locked_from belongs to a force"),
        ({"force": np.inf}, "the force of pretension 'bolt' is inf"),
        ({"force": 1.0, "opposite": "CUT"}, "share point 2: both sides need separate nodes"),
        ({"force": 1.0, "opposite": "TOP"}, "lies .* from the nearest node of 'TOP'"),
        ({"force": 1.0, "normal": (0.0, 0.0)}, "the normal .* must be 2 numbers, not all zero"),
    ],
)
def test_what_is_refused(options, said):
    with pytest.raises(fc.ModelError, match=said):
        bar().add_pretension("bolt", "CUT", **options)


def test_a_mesh_that_is_not_cut_and_names_given_twice():
    with pytest.raises(fc.ModelError, match=r"the mesh is not cut along 'CUT'.*fc\.generate\.cut\(mesh, 'CUT'\)"):
        bar(cut=False).add_pretension("bolt", "CUT", force=1.0)
    model = bar()
    model.add_pretension("bolt", "CUT", force=1.0)
    with pytest.raises(fc.ModelError, match="there is already a pretension 'bolt'"):
        model.add_pretension("bolt", "CUT", force=1.0)


def test_a_bent_section_needs_a_normal():
    model = bar()
    points = np.array(model.mesh.points)
    points[[7, 16], 1] += 0.1
    model.mesh = model.mesh.replace(points=points)
    with pytest.raises(fc.ModelError, match="determine no plane: give its normal"):
        model.add_pretension("bolt", "CUT", force=1.0)
    model.add_pretension("bolt", "CUT", force=1.0, normal=(0.0, 2.0))
    (step,) = fc.solve(model, 1)
    assert step.pretension["bolt"]["force"] == pytest.approx(1.0)


def test_a_lock_is_the_end_of_a_step():
    model = bar()
    model.add_pretension("bolt", "CUT", force=1.0, locked_from=0.7)
    with pytest.raises(fc.ModelError, match=r"is locked from 0\.7, but no load step ends there: .* such as 0\.5"):
        fc.solve(model, [0.5, 1.0])


def test_the_lock_counts_in_the_fingerprint():
    prints = []
    for begin in (None, 1.0, 2.0):
        model = bar()
        model.add_pretension("bolt", "CUT", force=1.0, locked_from=begin)
        prints.append(fingerprint(model))
    assert (
        different(prints[0], prints[1]) == different(prints[1], prints[2]) == ["the loads", "the pretension sections"]
    )


def test_a_run_goes_on_before_at_and_after_the_lock():
    model = bar()
    model.add_pretension("bolt", "CUT", force=1.0, locked_from=1.0, ramp=[(0.0, 0.0), (1.0, 1.0), (2.0, 0.0)])
    whole = fc.solve(model, [0.5, 1.0, 1.5, 2.0])
    assert [step.pretension["bolt"]["force"] for step in whole] == pytest.approx([0.5, 1.0, 1.0, 1.0])
    for done in (1, 2, 3):
        resumed = fc.solve(model, [0.5, 1.0, 1.5, 2.0], resume=fc.solve(model, [0.5, 1.0, 1.5, 2.0][:done]))
        assert resumed[-1].displacement == pytest.approx(whole[-1].displacement, rel=1e-13, abs=1e-18)


CASE = """title = "bolt"
kinematics = "plane_stress"
[mesh]
file = "bar.med"
[[material]]
E = 1000.0
nu = 0.3
[[support]]
group = "TOP"
x = 0.0
y = 0.0
[[support]]
group = "BOTTOM"
x = 0.0
y = 0.0
[[pretension]]
name = "bolt"
section = "CUT"
force = 3.0
locked_from = 1.0
[ramp]
instants = [1.0, 2.0]
table = [[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]
"""


def test_a_case_file_cuts_its_mesh_and_the_summary_tells(tmp_path, capsys):
    fc.write_mesh(tmp_path / "bar.med", bar(cut=False).mesh)
    (tmp_path / "bolt.toml").write_text(CASE)
    out, summary = str(tmp_path / "bolt.vtkhdf"), str(tmp_path / "s.json")
    assert main(["run", str(tmp_path / "bolt.toml"), "-o", out, "--json", summary]) == 0
    assert "pretension 'bolt': force 3, shortened by 0.0058" in capsys.readouterr().out
    steps = json.loads((tmp_path / "s.json").read_text())["steps"]
    assert [step["pretension"]["bolt"]["force"] for step in steps] == pytest.approx([3.0, 3.0])
    kept = fc.open_results(tmp_path / "bolt.vtkhdf")
    assert [step.pretension["bolt"]["force"] for step in kept] == pytest.approx([3.0, 3.0])


def test_a_case_names_the_section_that_is_missing():
    data = {
        "kinematics": "plane_stress",
        "mesh": {"generator": "box"},
        "material": [{"E": 1.0, "nu": 0.0}],
        "pretension": [{"name": "bolt", "section": "NONE", "force": 1.0}],
    }
    with pytest.raises(fc.FastcontactError, match=r"pretension\[0\]: unknown group of cells 'NONE'"):
        build_case(data, name="bolt", mesh=bar(cut=False).mesh)
