"""Short displays of results, meshes, models, studies and pictures in notebooks and terminals."""

import contextlib
import io
import os
import pickle
import subprocess
import sys

import numpy as np
import pytest
from models import elastic_model

import fastcontact as fc
from fastcontact._jit import compiling
from fastcontact._tools.html_table import html_table
from fastcontact.analysis.progress import Progress, StatusLine
from fastcontact.results.steps import HEAD, SHOWN, Steps

# Longest repr of anything [characters]: a screen.
SCREEN = 4000


@pytest.fixture(scope="module")
def model():
    found = elastic_model(fc.generate.half_spheres(size=10.0), "axisymmetric", E=20_000.0, A1A2="x", A2B2={"y": -2.0})
    found.prescribe("A1B1", y=2.0)
    found.add_contact("hertz & co", secondary="CONT1", primary="CONT2", formulation="node_to_segment")
    return found


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
    many = Steps([steps[0]] * (SHOWN + 9) + [steps[2]])
    assert len(many) == SHOWN + 10
    assert len(repr(many)) < 3 * SCREEN
    assert f"{SHOWN + 10} steps, 10 of them not shown" in many._repr_html_()
    assert many._repr_html_().count("<tr>") == SHOWN + 1
    assert "StepResult(3" in repr(many)


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
    drawn = getattr(fc.plot, name)(*arguments)
    png = drawn._repr_png_()
    assert png.startswith(b"\x89PNG")
    from matplotlib.image import imread

    pixels = imread(io.BytesIO(png))
    assert min(pixels.shape[:2]) > 300
    assert len(np.unique(pixels[..., :3])) > 10  # not blank
    own = plt.Figure()
    axes = own.subplots(1, 2)
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
        assert capsys.readouterr().err.count(compiling.TEXT) == 1


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
    with pytest.raises(KeyError, match=f"unknown contact pair 'x': known are {name}"):
        steps[0].contact["x"]
    assert steps[0].contact.get("x") is None
    for module, wrong, right in (
        (fc, "sweep", "parameter_sweep"),
        (fc.plot, "deformed", "deformed_shape"),
        (fc.generate, "blok", "block"),
        (fc.analytic, "hertz", "hertz_point"),
        (fc.obstacles, "Spher", "Sphere"),
    ):
        with pytest.raises(AttributeError, match=f"did you mean .*'{right}'"):
            getattr(module, wrong)
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
