"""Tables and short displays of results, meshes, models, studies and pictures."""

import contextlib
import csv
import io
import math
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from matplotlib_pictures import contact_of
from models import elastic_model, pressed_spheres
from refusals import refused

import fastcontact as fc
from fastcontact._jit import compiling
from fastcontact._tools.html_table import html_table
from fastcontact.analysis.progress import Progress, StatusLine
from fastcontact.errors import CaseError, FileError, MeshError
from fastcontact.results.step import HEAD, MAX_SHOWN, ContactResult, MaterialStress, StepResult, Steps, phases
from fastcontact.results.tables import contact_table, line_table, with_column, write_csv

# Longest repr of anything [characters]: a screen.
SCREEN = 4000


@pytest.fixture(scope="module")
def model():
    return pressed_spheres(fc.generate.half_spheres(size=10.0), name="hertz & co", formulation="node_to_segment")


@pytest.fixture(scope="module")
def steps(model):
    return fc.solve(model, 3)


def test_steps_are_a_list_with_a_short_repr(steps):
    assert isinstance(steps, list)
    assert [step.index for step in steps] == [1, 2, 3]
    assert isinstance(steps[:2], Steps)
    assert [step.index for step in steps[-2:]] == [2, 3]
    text = repr(steps)
    assert text.startswith("3 steps\n")
    assert len(text.splitlines()) == 4
    assert len(text) < SCREEN
    contact = steps[-1].contact["hertz & co"]
    assert f"{float(np.linalg.norm(contact.force)):.6g}" in text
    assert f"{contact.pressure.max():.6g}" in text
    assert [s.index for s in pickle.loads(pickle.dumps(steps))] == [1, 2, 3]


def test_answers_and_estimates_show_tables(model, steps):
    answers = fc.contact_resultants(model, steps, "hertz & co")[-1]
    assert f"{answers.normal_force:.6g}" in answers._repr_html_()
    assert np.isnan(answers.centre[0])  # forces all round have no middle off the axis
    estimate = fc.estimate_error(model, steps[-1])
    assert f"{estimate.relative:.6g}" in estimate._repr_html_()
    assert f"{len(estimate.cells)} numbers, {estimate.cells.min():.6g} to" in estimate._repr_html_()


def test_a_long_analysis_shows_its_last_steps(steps):
    many = Steps([steps[0]] * (MAX_SHOWN + 9) + [steps[2]])
    assert len(many) == MAX_SHOWN + 10
    assert len(repr(many)) < 3 * SCREEN
    assert f"{MAX_SHOWN + 10} steps, 10 of them not shown" in many._repr_html_()
    assert many._repr_html_().count("<tr>") == MAX_SHOWN + 1
    first, *_, last = repr(many).splitlines()[1:]
    assert first == "  ..."
    assert "StepResult(3" in last


def test_phases_scale_all_that_vibrates(steps):
    step = replace(steps[-1], material_stress=MaterialStress(*[np.arange(2)] * 3, np.ones((2, 4))))
    back = phases(step, 2)[1]
    for name in ("displacement", "stress", "reaction", "von_mises_signed"):
        assert np.array_equal(getattr(back, name), -getattr(step, name))
    assert np.array_equal(back.material_stress.stress, -step.material_stress.stress)
    assert not back.contact


def test_components_of_forces_that_lean(steps):
    """As in half of a symmetric model, whose other half balances the component across."""
    upright = steps[-1].contact["hertz & co"].shown["force"]
    assert "(" not in upright
    assert "sum" not in upright
    leaning = replace(steps[-1].contact["hertz & co"], force=np.array([-3e5, 4e5]))
    total = f"sum of normal forces {leaning.normal_force:.6g}"  # much larger
    assert leaning.shown["force"] == f"500000 (x -300000, y 400000), {total}"


def test_one_step_and_one_contact(steps):
    step, contact = steps[-1], steps[-1].contact["hertz & co"]
    assert len(repr(step)) < 300
    assert len(repr(contact)) < 300
    closed = f"{int(contact.active.sum())} of {len(contact.points)} nodes"
    assert closed in repr(contact)
    assert f"{np.abs(step.displacement).max():.6g}" in repr(step)
    html = step._repr_html_()
    assert closed in html
    assert str(step.iterations["geometry_updates"]) in html
    assert "hertz &amp; co" in html
    assert "hertz & co" not in html
    assert len(html) < SCREEN


def test_a_force_with_friction_shows_its_parts():
    model = elastic_model(fc.generate.block(), "plane_strain", E=1000.0, TOP={"x": 0.1, "y": -0.01})
    floor = fc.obstacles.HalfSpace((0.0, 0.0), (0.0, 1.0))
    model.add_obstacle("floor", secondary="BOTTOM", obstacle=floor, friction=0.25)
    contact = fc.solve(model, 1)[-1].contact["floor"]
    total, normal, tangential = contact.force_parts
    assert [total, normal, tangential] == pytest.approx(np.abs([np.linalg.norm(contact.force), *contact.force[::-1]]))
    assert tangential == pytest.approx(0.25 * normal)
    assert f"force {total:.6g} (normal {normal:.6g}, tangential {tangential:.6g})" in repr(contact)


def test_the_table_of_steps_has_a_row_a_pair(steps):
    html = steps._repr_html_()
    assert html.count("<tr>") == 1 + len(steps)
    for name in HEAD:
        assert f">{name}</th>" in html
    for step in steps:
        assert f">{step.contact['hertz & co'].pressure_max:.6g}</td>" in html


def test_a_step_without_contact_is_shown():
    block = elastic_model(fc.generate.block(), "plane_strain", E=1.0)
    left = block.mesh.group_names
    for name in left:
        if name.endswith(("BOTTOM", "TOP")):
            block.prescribe(name, x=0.0, y=0.1 if name.endswith("TOP") else 0.0)
    solved = fc.solve(block, 1)
    assert "1 steps" in repr(solved)
    assert solved._repr_html_().count("<tr>") == 2


def test_meshes_and_models(model):
    html = model.mesh._repr_html_()
    for name in model.mesh.group_names:
        assert f">{name}</td>" in html
    assert f">{model.mesh.n_points}</td>" in html
    assert ">group of line2</td>" in html
    assert ">group of points</td>" in html
    told = model._repr_html_()
    assert "axisymmetric" in told
    assert "node_to_segment" in told
    assert "hertz &amp; co" in told
    assert len(repr(model)) < SCREEN


def test_what_names_hold_is_text():
    assert "<script>" not in html_table([("<script>", 1)], ("<b>",), "<i>&")
    assert "&lt;script&gt;" in html_table([("<script>", 1)])


@pytest.mark.parametrize("name", ["pressure_profile", "deformed_shape", "axis_stress", "history", "contact_zones"])
def test_pictures_display_themselves_and_take_axes(name, model, steps):
    plt = pytest.importorskip("matplotlib.figure")
    pair = "hertz & co"
    arguments = {
        "pressure_profile": (steps[-1].contact[pair],),
        "deformed_shape": (model.mesh, steps[-1]),
        "axis_stress": (model.mesh, steps[-1], pair),
        "history": (steps, pair),
        "contact_zones": (steps, pair),
    }[name]
    png = getattr(fc.plot, name)(*arguments)._repr_png_()
    assert png.startswith(b"\x89PNG")
    from matplotlib.image import imread

    pixels = imread(io.BytesIO(png))
    assert min(pixels.shape[:2]) > 300
    assert len(np.unique(pixels[..., :3])) > 10  # not blank
    axes = plt.Figure().subplots(1, 2)
    if name == "history":
        assert getattr(fc.plot, name)(*arguments, axes=axes)[0] is axes[0]
    else:
        assert getattr(fc.plot, name)(*arguments, ax=axes[0]) is axes[0]
        assert axes[0].has_data()
        assert not axes[1].has_data()


def test_progress_is_written_where_it_is_asked_for(model, capsys):
    fc.solve(model, 2)
    assert capsys.readouterr().err == ""
    fc.solve(model, 2, progress=True)
    told = capsys.readouterr().err
    assert "step 1/2" in told
    assert "step 2/2" in told
    assert "nodes in contact" in told


def test_what_is_written_beside_progress_begins_at_the_left(capsys):
    """A warning does not follow the bar on its line."""
    StatusLine(9, show=True).draw("half")
    assert capsys.readouterr().err == "\rhalf     \r"


@pytest.mark.parametrize("listening", [True, False])
def test_time_left_is_told_by_steps_for_which_nothing_was_compiled(listening, model, capsys):
    """Also on a line that does not tell of compiling itself, as on a terminal, where the command does."""
    steps, line = fc.solve(model, 3), Progress(3, show=True)
    with line if listening else contextlib.nullcontext():
        compiling.notify()
        for step in steps:
            line.step(step)
    first, *others = (text for text in capsys.readouterr().err.split("\r") if "step " in text)
    assert "left" not in first
    assert len(others) == 2
    assert all(" s left" in text for text in others)


def test_every_line_of_progress_tells_that_kernels_are_compiled(capsys):
    """Not only the first one of a process: a mesh may have needed a kernel before."""
    for _ in range(2):
        with Progress(3, show=True):
            compiling.notify()
            compiling.notify()
        assert capsys.readouterr().err.count(compiling.ANNOUNCEMENT) == 1


def test_a_result_file_shows_a_table(model, tmp_path):
    with fc.ResultWriter(tmp_path / "r.vtkhdf", model) as out:
        assert "none yet" in fc.open_results(out.path)._repr_html_()
        fc.solve(model, 2, on_step=out.write)
    results = fc.open_results(tmp_path / "r.vtkhdf")
    shown = results._repr_html_()
    for text in ("2, to load factor 1", "complete", str(results.mesh.n_points), "largest pressure", "Step 2"):
        assert text in shown
    results.close()
    assert "2, to load factor 1" in results._repr_html_()


def test_names_that_are_near_are_told(model):
    steps = fc.solve(model, 1)
    (name,) = steps[0].contact
    with pytest.raises(KeyError, match=f"unknown contact pair 'x': expected one of {name}"):
        steps[0].contact["x"]
    assert steps[0].contact.get("x") is None
    for module, wrong, right in (
        (fc, "sweep", "parameter_sweep"),
        (fc.plot, "deformed", "deformed_shape"),
        (fc.generate, "blok", "block"),
        (fc.analytic, "hertz", "hertz_point"),
        (fc.obstacles, "Spher", "Sphere"),
    ):
        refused(AttributeError, f"did you mean .*'{right}'", getattr, module, wrong)
        assert not hasattr(module, "__wrapped__")


COMPILED = """
import logging, sys
logging.basicConfig(level=logging.INFO, stream=sys.stdout, format="%(message)s")
from fastcontact._jit import compiling
from fastcontact.analysis.progress import Progress
with Progress(3, show=True):
    import numba
    import fastcontact._jit.decorators
    def double(x):
        return 2.0 * x
    double.__module__ = "fastcontact.example"
    compiled = numba.njit(double)
    assert compiled(2.0) == 4.0
    assert compiled(2) == 4
print("listeners", len(compiling.listeners))
"""


@pytest.mark.slow
def test_compiling_is_told_once(tmp_path):
    """To the log, and on the line of the progress; Numba's own functions and cached ones say nothing."""
    run = subprocess.run(
        [sys.executable, "-c", COMPILED], capture_output=True, text=True, timeout=300, check=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "0"},
    )  # fmt: skip
    assert run.stdout.count("compiling kernels") == 1, run.stdout
    assert run.stderr.count("compiling kernels") == 1, run.stderr
    assert "listeners 0" in run.stdout


# A quadratic triangle whose numbers run wild, with its inclined edge of length 5 as a line of two pieces.
POINTS = [[-3.0, 0.0], [0.0, 4.0], [0.0, 0.0], [-1.5, 0.0], [-1.5, 2.0], [0.0, 2.0]]
MESH = fc.Mesh(
    POINTS,
    {"tri6": [[0, 2, 1, 3, 5, 4]], "line3": [[0, 1, 4]]},
    {"SOLID": [0], "EDGE": [1]},
    {"A": [0], "B": [1], "BOTH": [1, 0]},
)
RANDOM = np.random.default_rng(3)


def step_result(number: int, names: tuple[str, ...] = ("c",), mesh: fc.Mesh = MESH) -> StepResult:
    n, dim = mesh.n_points, mesh.dim
    stress = RANDOM.normal(size=(n, 4 if dim == 2 else 6))
    contact = {name: contact_result(name, number + 1, mesh) for name in names}
    found = RANDOM.normal(size=(n, dim)), stress, np.abs(stress[:, 0]), stress[:, 0], np.zeros((n, dim)), contact
    return StepResult(number + 1, (number + 1) / 4, *found)


def contact_result(name: str, m: int, mesh: fc.Mesh = MESH) -> ContactResult:
    points = np.array([0, 4, 1, 2], np.int32)[:m]
    return contact_of(
        points, mesh.points[points], name=name, formulation="node_to_segment", abscissa=2.5 * np.arange(m),
        gap=RANDOM.normal(size=m), pressure=np.arange(m) * 100.0, multiplier=RANDOM.normal(size=m),
        force_vectors=RANDOM.normal(size=(m, mesh.dim)), active=np.arange(m) % 2 == 0,
        force=np.arange(mesh.dim) + 10.0 * m, radius=(float(m), m + 0.5),
    )  # fmt: skip


def test_contact_table() -> None:
    contact = step_result(2).contact["c"]
    table = contact_table(contact)
    assert table.dtype.names == (
        "point", "x", "y", "abscissa", "radius", "place", "gap", "pressure", "multiplier", "force_x", "force_y",
        "shear_x", "shear_y", "slip_x", "slip_y", "slip_total_x", "slip_total_y", "active", "sticking",
    )  # fmt: skip
    assert table["point"].tolist() == [0, 4, 1]
    assert table["x"].tolist() == [-3.0, -1.5, 0.0]
    assert table["y"].tolist() == [0.0, 2.0, 4.0]
    assert table["radius"].tolist() == [3.0, 1.5, 0.0]
    assert table["active"].tolist() == [True, False, True]
    for name in ("gap", "pressure", "multiplier", "abscissa"):
        np.testing.assert_array_equal(table[name], getattr(contact, name))
    np.testing.assert_array_equal(table["force_y"], contact.force_vectors[:, 1])


def test_contact_table_with_the_fields_of_its_step() -> None:
    step = step_result(2)
    table = contact_table(step.contact["c"], step)
    np.testing.assert_array_equal(table["displacement_y"], step.displacement[[0, 4, 1], 1])
    for column, component in enumerate(("xx", "yy", "zz", "xy")):
        np.testing.assert_array_equal(table[f"stress_{component}"], step.stress[[0, 4, 1], column])
    np.testing.assert_array_equal(table["von_mises"], step.von_mises[[0, 4, 1]])
    np.testing.assert_array_equal(table["von_mises_signed"], step.von_mises_signed[[0, 4, 1]])


def test_contact_table_without_rows() -> None:
    step = step_result(-1)
    assert len(contact_table(step.contact["c"], step)) == 0


def test_tables_in_space_measure_the_radius_from_the_y_axis() -> None:
    points, cells = [[3, 7, 4], [0, 1, 0], [-6, 0, 8.0]], {"tri3": [[0, 1, 2]], "line2": [[0, 1], [1, 2]]}
    mesh = fc.Mesh(points, cells, {"P": [1, 2]})
    step = step_result(0, (), mesh)
    table = line_table(mesh, step, "P", 0)
    np.testing.assert_allclose(table["radius"], [5.0, 0.0, 10.0], rtol=1e-15)
    assert {"z", "displacement_z", "stress_yz", "stress_xz"} <= set(table.dtype.names)
    np.testing.assert_array_equal(table["stress_xz"], step.stress[:, 5])


def test_line_table_follows_the_line() -> None:
    step = step_result(0)
    table = line_table(MESH, step, "EDGE")
    assert table["point"].tolist() == [1, 4, 0], "it starts at the end next to x = 0"
    np.testing.assert_allclose(table["abscissa"], [0.0, 2.5, 5.0], rtol=1e-15)
    np.testing.assert_array_equal(table["displacement_x"], step.displacement[[1, 4, 0], 0])
    np.testing.assert_array_equal(table["stress_zz"], step.stress[[1, 4, 0], 2])
    for start in ("A", 0):
        assert line_table(MESH, step, "EDGE", start)["point"].tolist() == [0, 4, 1]
    refused(MeshError, "did you mean 'EDGE'", line_table, MESH, step, "EGDE")


def test_a_table_with_one_column_more() -> None:
    table = contact_table(contact_result("c", 3))
    more = with_column(table, "twice", 2 * table["abscissa"])
    assert more["twice"].tolist() == [0, 5, 10]
    assert more.dtype.names == (*table.dtype.names, "twice")
    assert more["point"].tolist() == [0, 4, 1]


# --------------------------------------------------------------------------------------------------- CSV


def assert_same_table(found: np.ndarray, expected: np.ndarray) -> None:
    assert found.dtype.names == expected.dtype.names
    for name in expected.dtype.names:
        assert found[name].dtype.kind == expected[name].dtype.kind, name
        np.testing.assert_array_equal(found[name], expected[name], err_msg=name)
        if expected[name].dtype.kind == "f":
            number = ~np.isnan(expected[name])  # the sign of NaN says nothing and is not written
            assert np.signbit(found[name])[number].tolist() == np.signbit(expected[name])[number].tolist(), name


def read_csv(path: Path, kinds: np.dtype[Any]) -> tuple[np.ndarray, dict[str, str]]:
    """Return the table in a file, its columns of these kinds, and the units in its header."""
    with open(path, encoding="utf-8", newline="") as file:
        header, *rows = csv.reader(file)
    titles = [title.removesuffix("]").partition(" [") for title in header]
    assert tuple(name for name, _, _ in titles) == kinds.names
    table = np.empty(len(rows), kinds)
    for name, column in zip(kinds.names, zip(*rows)):
        table[name] = [text == "true" for text in column] if kinds[name].kind == "b" else column
    return table, {name: unit for name, _, unit in titles if unit}


def test_tables_come_back_from_csv(tmp_path: Path) -> None:
    step, path = step_result(2), tmp_path / "table.csv"
    units = {"x": "mm", "pressure": "MPa", "force_x": "N, full circle"}
    for table in (
        contact_table(step.contact["c"], step),
        line_table(MESH, step, "EDGE"),
        np.array([('1, "quoted"', 1.5), ("two", math.inf)], [("name", "U12"), ("pressure", float)]),
    ):
        of_table = {name: unit for name, unit in units.items() if name in table.dtype.names}
        write_csv(path, table, of_table)
        found, found_units = read_csv(path, table.dtype)
        assert_same_table(found, table)
        assert found_units == of_table


@settings(max_examples=60, deadline=None)
@given(values=hnp.arrays(np.float64, st.integers(1, 6), elements=st.floats(width=64)))
def test_csv_loses_no_bit(values: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.getbasetemp() / "bits.csv"
    table = np.array(list(zip(values, range(len(values)))), dtype=[("a", float), ("b", np.int64)])
    write_csv(path, table)
    assert_same_table(read_csv(path, table.dtype)[0], table)


def test_csv_is_what_the_standard_says(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    table = np.array([(1, 0.1, True, 'a "b", c')], [("n", int), ("x", float), ("active", bool), ("group", "U9")])
    write_csv(path, table, {"x": "mm"})
    assert path.read_bytes().decode("utf-8") == 'n,x [mm],active,group\r\n1,0.10000000000000001,true,"a ""b"", c"\r\n'
    with open(path, newline="") as file:
        assert next(csv.DictReader(file))["group"] == 'a "b", c'
    numbers = np.genfromtxt(path, delimiter=",", skip_header=1, usecols=(0, 1))
    assert numbers.tolist() == [1.0, 0.1]


def test_csv_messages(tmp_path: Path) -> None:
    table, path = contact_table(contact_result("c", 1)), tmp_path / "t.csv"
    refused(CaseError, "unknown column 'presure': did you mean 'pressure'", write_csv, path, table, {"presure": "MPa"})
    assert not path.exists()
    refused(FileError, "does not exist: create it", write_csv, tmp_path / "nowhere" / "t.csv", table)
