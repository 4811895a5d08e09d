"""Sweeps: numbers, tables and files, the store, failures that do not end the others."""

import csv
import json
import re

import numpy as np
import pytest
from refusals import refused

import fastcontact as fc
from fastcontact.cli import main
from fastcontact.studies.report import Report
from fastcontact.studies.sweep_report import parameter_label


@pytest.fixture(scope="module")
def sweep(case):
    return fc.parameter_sweep(case, {"approach": (0.004, 0.04, 0.4, 4.0)}, level=2, workers=1)


def test_hertz_is_the_limit_of_a_small_approach(sweep):
    ratios = [point.ratio("pressure_max") for point in sweep.points]
    assert ratios == sorted(ratios)
    # 0.09 % of model error at 0.004 mm (a / R = 0.006), and 0.03 % of the mesh.
    assert ratios[0] == pytest.approx(1.0, abs=2e-3)
    # The mesh-converged solution, by a method of its own (see the theory finite_half_spheres).
    for point in sweep.points:
        assert point.ratio("force", "reference") == pytest.approx(1.0, abs=2e-3)
        assert point.ratio("pressure_max", "reference") == pytest.approx(1.0, abs=2e-3)
    assert sweep.points[-1].ratio("pressure_max", "equal_force") == pytest.approx(1.0, abs=2e-3)


def test_two_parameters_are_combined_the_last_one_fastest(case):
    found = fc.parameter_sweep(case, {"material[0].E": (1e4, 2e4), "approach": (0.4, 4.0)}, level=0, workers=1)
    assert [tuple(point.parameters.values()) for point in found.points] == [(1e4, 0.4), (1e4, 4), (2e4, 0.4), (2e4, 4)]
    soft, stiff = found.points[1], found.points[3]
    # Both materials of the case are one entry: the force is proportional to the modulus.
    assert stiff.values["force"] == pytest.approx(2 * soft.values["force"], rel=1e-9)
    table = found.table()
    assert list(table["approach"]) == [0.4, 4.0, 0.4, 4.0]
    np.testing.assert_allclose(table["force"], [point.values["force"] for point in found.points])


def test_the_command_writes_what_it_shows_and_runs_nothing_twice(case, tmp_path, capsys):
    files = {name: tmp_path / f"sweep.{name}" for name in ("json", "csv", "png", "html")}
    options = [text for name, path in files.items() for text in (f"--{name}", str(path))]
    arguments = ["sweep", str(case), "--set", "approach=0.4:4:2:log", "--level", "0", "--workers", "1"]
    arguments += ["--store", str(tmp_path / "store")]
    assert main([*arguments, *options]) == 0
    shown = capsys.readouterr().out
    points = json.loads(files["json"].read_text())["points"]
    assert [point["parameters"]["approach"] for point in points] == pytest.approx([0.4, 4.0])
    assert f"{points[1]['force']:.7g}" in shown
    assert files["png"].read_bytes()[:4] == b"\x89PNG"
    assert "data:image/png;base64" in files["html"].read_text()
    assert files["csv"].read_text().splitlines()[0].lstrip("# ").startswith("approach")
    kept = sorted(path.stat().st_mtime_ns for path in (tmp_path / "store").iterdir())
    assert main([*arguments, "--json", str(files["json"]), "-q"]) == 0
    assert sorted(path.stat().st_mtime_ns for path in (tmp_path / "store").iterdir()) == kept
    assert json.loads(files["json"].read_text())["points"] == points


def test_a_failed_point_is_told_and_the_others_go_on(case, capsys, tmp_path):
    table = tmp_path / "table.csv"
    arguments = ["sweep", str(case), "--set", "material[0].nu=0.3,0.6", "--level", "0", "--workers", "1"]
    assert main([*arguments, "--csv", str(table)]) == 2
    solved, failed = csv.DictReader(table.open())
    assert (failed["material[0].nu"], failed["force"], solved["failed"]) == ("0.59999999999999998", "nan", "")
    assert "nu = 0.6" in failed["failed"]
    assert float(solved["force"]) > 0.0
    shown = capsys.readouterr()
    assert "material[0].nu = 0.6 failed: " in shown.out
    assert "0.6" in shown.err
    assert "0.3" in shown.out


def drawn(sweep):
    """The axes of the figure of a sweep by title, with all curves by label."""
    found = {}
    for ax in sweep.figure().axes:
        found[ax.get_title()] = ax
    return found


def curves(ax):
    return {line.get_label(): (np.array(line.get_xdata()), np.array(line.get_ydata())) for line in ax.lines}


def test_theory_is_a_curve_between_the_points_and_axes_are_of_one_kind(sweep):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    axes = drawn(sweep)
    x, force = curves(axes["contact force"])["theory at equal approach"]
    assert len(x) > 20
    # Hertz: F = 4/3 E* sqrt(R) d^1.5 with E* = E / (2 (1 - nu^2)) and R = 25.
    np.testing.assert_allclose(force, 4 / 3 * 2e4 / (2 * 0.91) * 5.0 * x**1.5, rtol=1e-12)
    assert {(ax.get_xscale(), ax.get_yscale()) for name, ax in axes.items() if "ratio" not in name} == {("log", "log")}
    assert axes["contact force"].get_xlabel() == "approach [mm]"
    assert axes["largest pressure"].get_ylabel() == "largest pressure [MPa]"
    np.testing.assert_allclose(
        curves(axes["contact force: ratio to theory"])["to theory at equal approach"][1],
        [point.ratio("force") for point in sweep.points],
    )


@pytest.mark.slow
def test_a_theory_that_the_parameter_does_not_change_is_told(case):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    found = fc.parameter_sweep(case, {"material[0].E": (1e4, 2e4), "approach": (0.4, 4.0)}, level=0, workers=1)
    ax = drawn(found)["contact force"]
    assert ax.get_xlabel() == "Young's modulus of material 1 [MPa]"
    assert "theory at equal approach\n(the same for every material[0].E)" in curves(ax)
    assert (ax.get_xscale(), ax.get_yscale()) == ("linear", "linear")
    turned = fc.parameter_sweep(case, {"approach": (0.4, 0.8), "material[0].E": (1e4, 2e4)}, level=0, workers=1)
    lines = drawn(turned)["contact force"].lines
    name = "theory at equal approach\n(the same for every material[0].E)"
    # Theories that coincide are one black curve.
    assert [line.get_label() for line in lines] == ["material[0].E = 10000", name, "material[0].E = 20000"]
    assert lines[1].get_color() == "black"
    assert len(turned.theories) == 2
    for sweep in (found, turned):
        assert set(sweep.table()["theory_independent_of"]) == {"material[0].E"}
        assert sweep.as_dict()["theory_independent_of"] == ["material[0].E"]


def test_where_a_theory_is_not_defined_there_is_no_curve(case):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    found = fc.parameter_sweep(case, {"theory.hertz.nu1": (0.6, 0.3)}, level=0, workers=1)
    assert not found.failed
    assert found.points[0].values.items() < found.points[1].values.items()  # without errors of the pressure
    assert found.points[0].theory == {}
    assert any("there is no theory here: 'theory.hertz'" in text for text in found.remarks())
    assert [curve.values for curve in found.theories] == [{}]
    line = curves(drawn(found)["contact force"])["theory at equal approach"]
    assert line[1] == pytest.approx([np.nan, found.points[1].theory["force"]], nan_ok=True)


def test_a_quantity_without_theory_has_no_ratio(root):
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    found = fc.parameter_sweep(
        root / "data/cases/cattaneo-mindlin.toml", {"material[0].E": (1e3, 2e3)}, level=0, workers=1
    )
    assert found.units["force"] == "N/mm"
    texts = [text.get_text() for ax in found.figure().axes for text in ax.texts]
    assert "no theoretical value of the contact force" in texts
    force = drawn(found)["contact force"]
    low, high = force.get_ylim()
    assert high - low > 0.1 * high  # round-off is no trend
    assert "theory" not in curves(force)


def test_warnings_name_the_points_that_issued_them():
    runs = [(f"E = {k}", ["coarse"] + ["locks"] * (k > 1) + ["yields", "yields"] * (k == 5)) for k in range(6)]
    assert Report.warnings_of(runs) == [
        "warning: coarse", "warning (E = 2; E = 3; E = 4; 1 more): locks", "warning (E = 5): yields",
    ]  # fmt: skip


def test_parameters_in_words():
    units = {"length": "mm", "pressure": "MPa"}
    assert parameter_label("mesh.size", units) == "element size of the mesh [mm]"
    assert parameter_label("material[2].nu", units) == "Poisson's ratio of material 3 [-]"
    assert parameter_label("ramp.steps", units) == "ramp.steps"


@pytest.mark.parametrize(
    ("case", "parameter", "values", "heading"),
    [
        ("cylinder-on-block", "contact.line.formulation", ("mortar", "continuous"), "quad4 mortar, level 0; quad4 con"),
        ("sphere-on-plane", "mesh.element", ("quad8", "tri3"), "quad8 continuous, level 0; tri3 continuous, level 0"),
        ("forma04c", "strain", ("small", "finite"), "quad8 continuous, level 0"),
    ],
)
def test_values_that_are_no_numbers_have_no_curve(case, parameter, values, heading):
    found = fc.parameter_sweep(case, {parameter: values}, level=0, workers=1)
    assert found.theories == ()
    assert found.combination.startswith(heading)
    assert not any("if it should" in text for text in found.remarks())
    first, second = (point.values["pressure_max"] for point in found.points)
    assert abs(first / second - 1.0) > 1e-4
    pytest.importorskip("matplotlib", reason="pictures need matplotlib")
    assert [tick.get_text() for tick in drawn(found)["contact force"].get_xticklabels()] == list(values)


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({}, "at least one parameter"),
        ({"approach": ()}, "at least one value"),
        ({"material[0].F": (1.0,)}, "material.*'E'|unknown key"),
        ({"material": (1.0,)}, "expected one of approach, kinematics, reference_temperature, strain"),
        (
            {"kinematics": ("axisymmetric", "plane_strain")},
            "axisymmetric and plane_strain: forces are per unit thickness",
        ),
        ({"study.quadrangles.arc_sizes": (1.0,)}, r"such as study\.quadrangles\.arc_sizes\[0\]"),
        # Keys that the runs do not read.
        ({"title": ("a", "b")}, "parameter 'title'"),
        (
            {"check[0].tolerance": (0.1, 0.2)},
            r"do not read 'check\[0\]\.tolerance': leave it out, because it does not change",
        ),
        ({"mesh.generator": ("a", "b")}, r"set study\.generator or keys of \[study\.quadrangles\]"),
        ({"mesh.segments": (4, 5)}, r"quad8 continuous, level \d, contact 'hertz'\) .* keys of \[study\.quadrangles\]"),
        ({"mesh.file": ("a",)}, r"or keys of \[study\.quadrangles\]"),
        ({"mesh.element": ("quad4", "quad9")}, r"set the option 'element' \(--element\)"),
        ({"ramp.steps": (1, 5)}, r"set study\.load_steps, which replaces it"),
        ({"contact.hertz.formulation": ("mortar", "continuous")}, r"set the option 'formulation' \(--formulation\)"),
        ({"contact.hertz.normals": ("facet", "averaged"), "approach": (0.4,)}, None),
        ({"study.triangles.size": (12.0, 16.0)}, r"\(quad8 .* keys of \[study\.quadrangles\]"),
        ({"study.options.node_to_segment.normals": ("facet",)}, r"\(quad8 continuous, .* do not read 'study.options"),
        ({"support[1].y": (-0.2, -0.3), "approach": (0.4,)}, r"do not read 'support\[1\].y': .* another parameter"),
    ],
)
def test_what_is_wrong_is_told_before_anything_runs(case, parameters, words):
    if words is None:  # the key is read
        assert len(fc.parameter_sweep(case, parameters, level=0, workers=1).points) == 2
        return
    refused(fc.CaseError, words, fc.parameter_sweep, case, parameters, workers=1)


@pytest.mark.parametrize(
    ("case", "parameters", "options", "words"),
    [
        ("cylinder-on-block", {"mesh.block_size": (50, 100)}, {}, "'mesh.block_size' must be two numbers, not"),
        ("cylinder-on-block", {"mesh.element": ("quad8",)}, {"element": "quad4"}, "do not read 'mesh.element'"),
        ("forma04c", {"contact.hertz.normals": ("facet",)}, {"formulation": "node-to-segment"}, "study.options.node"),
        ("forma04-no-contact", {"mesh.file": ("other.med",)}, {}, "write a case file for each mesh"),
    ],
)
def test_what_options_and_meshes_replace_is_told(case, parameters, options, words):
    refused(fc.CaseError, words, fc.parameter_sweep, case, parameters, **options, level=0, workers=1)


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ("quantities = [3]", r"'study.quantities\[0\]' must be the name of a quantity"),
        ('parameters = { soft = ["material[0].E"] }', "'study.parameters.soft' must be a table of expressions by path"),
        ("combinations = [3]", r"'study.combinations\[0\]' must be an element and a formulation"),
        ("options = { mortar = 1 }", "'study.options.mortar' must be a table of options"),
    ],
)
def test_what_is_wrong_in_the_study_is_told_by_every_command(case, entry, words, tmp_path):
    text = re.sub(rf"(?ms)^{entry.split()[0]} = .*?\]\n", "", case.read_text())
    text = text.replace('file = "../meshes', f'file = "{case.parent.parent}/meshes').replace(
        "[study]", f"[study]\n{entry}"
    )
    (tmp_path / "case.toml").write_text(re.sub(r"(?ms)^\[study\.(?=parameters|options).*?(?=^\[|\Z)", "", text))
    refused(fc.CaseError, words, fc.parameter_sweep, tmp_path / "case.toml", {"approach": (0.4,)}, level=0, workers=1)
    refused(fc.CaseError, words, fc.convergence_study, tmp_path / "case.toml", 1, workers=1)


def test_quantities_of_the_study_are_in_the_table(case, tmp_path):
    text = case.read_text().replace('file = "../meshes', f'file = "{case.parent.parent}/meshes')
    (tmp_path / "case.toml").write_text(
        text.replace("[study]", '[study]\nquantities = ["C1.stress.yy", "von_mises_max"]')
    )
    found = fc.parameter_sweep(tmp_path / "case.toml", {"approach": (0.4,)}, level=0, workers=1)
    header, row = found.tables()[0][1]
    assert f"{found.points[0].values['C1.stress.yy']:.7g}" == row[header.index("C1.stress.yy [MPa]")]
    assert "von_mises_max [MPa]" in header


@pytest.mark.parametrize(
    "text", ["approach", "approach=", "=1,2", "approach=1:2", "approach=0:4:3:log", "approach=1:2:x"]
)
def test_the_command_says_how_values_are_written(case, text, capsys):
    assert main(["sweep", str(case), "--set", text]) == 1
    assert "for example" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("case", "values", "same"),
    [
        ("flat-punch", {"obstacle.punch.motion.y": [-0.001, -0.002]}, True),
        ("flat-punch", {"theory.punch.approach": [0.001, 0.002]}, False),
        ("force-driven-sphere", {"material[0].E": [2e4, 3e4]}, True),
        ("force-driven-sphere", {"material[0].E": [2e4, 2.001e4]}, False),
        ("forma04c", {"approach": [0.4, 4.0]}, False),
        ("forma04c", {"material[0].E": [1e4, 2e4], "approach": [0.4, 2.0]}, True),
    ],
)
def test_a_remark_tells_of_a_theory_that_stays(case, values, same):
    sweep = fc.parameter_sweep(case, values, level=0, workers=1)
    name = next(iter(values))
    assert sweep.theory_independent_of == [name] * same
    beginning = f"the theory does not depend on {name}: if it should, "
    told = [text for text in sweep.remarks() if text.startswith(beginning)]
    assert len(told) == same
    if name == "material[0].E" and same:
        assert "[study.parameters] also set keys of [theory." in told[0]
