"""`fastcontact run` and `run --resume` on failures: one line, the right exit code, no damage."""

import importlib.util
import os
import shutil

import numpy as np
import pytest
from test_cli import CASE

import fastcontact as fc
from fastcontact.analysis.progress import Progress
from fastcontact.cli import main

DOUBT = "warning: contact 'hertz' has only 3 elements across its radius"
STEPS = 6


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The case file, and the steps of a run that nothing disturbed."""
    folder = tmp_path_factory.mktemp("resume")
    case = folder / "small.toml"
    case.write_text(CASE.replace("steps = 3", f"steps = {STEPS}"))
    assert main(["run", str(case), "-q", "-o", str(folder / "whole.vtkhdf")]) == 0
    return case, list(fc.open_results(folder / "whole.vtkhdf"))


@pytest.fixture
def path(tmp_path):
    return tmp_path / "run.vtkhdf"


def run(case, path, *options):
    return main(["run", str(case), "-q", "-o", str(path), *options])


@pytest.fixture(scope="module")
def begun(whole, tmp_path_factory):
    """The file of a run that was interrupted after two steps."""
    path = tmp_path_factory.mktemp("begun") / "run.vtkhdf"
    with pytest.MonkeyPatch.context() as patch:
        assert stopped(whole[0], path, patch) == 130
    return path


def only_line(told: str) -> str:
    """The one line of an error, apart from warnings."""
    (line,) = [line for line in told.splitlines() if not line.startswith(DOUBT)]
    return line


def stopped(case, path, monkeypatch, after=2, act=None) -> int:
    """Run until something happens after some steps; from the keyboard unless told otherwise."""
    write = fc.ResultWriter.write

    def disturbed(self, step):
        write(self, step)
        if step.index == after:
            if act is None:
                raise KeyboardInterrupt
            act()

    with monkeypatch.context() as patch:
        patch.setattr(fc.ResultWriter, "write", disturbed)
        return run(case, path)


def assert_same(path, steps):
    with fc.open_results(path) as results:
        assert results.complete == (len(results) == STEPS)
        for found, expected in zip(results, steps, strict=True):
            np.testing.assert_array_equal(found.displacement, expected.displacement)
            np.testing.assert_array_equal(found.stress, expected.stress)


# ------------------------------------------------------------------------------------------------ resuming


def test_an_interrupted_run_goes_on_and_a_complete_one_stays(whole, path, capsys, monkeypatch):
    case, steps = whole
    assert stopped(case, path, monkeypatch) == 130
    assert_same(path, steps[:2])
    summary = path.with_name("summary.json")
    assert main(["run", str(case), "-o", str(path), "--resume", "--json", str(summary)]) == 0
    captured = capsys.readouterr()
    assert f"wrote {path} (resumed after step 2), {summary}" in captured.out
    assert captured.err.count(DOUBT) == 1
    assert_same(path, steps)
    before = path.read_bytes()
    assert main(["run", str(case), "-o", str(path), "--resume"]) == 0
    captured = capsys.readouterr()
    assert f"{path} was already complete with {STEPS} steps, so no step was solved" in captured.out
    assert captured.err.count(DOUBT) == 1
    assert path.read_bytes() == before


def test_a_resumed_run_tells_that_its_steps_are_others(whole, path, capsys, tmp_path):
    case, _ = whole
    run(case, path)
    other = tmp_path / "other.toml"
    other.write_text(case.read_text().replace(f"steps = {STEPS}", f"steps = {STEPS + 1}"))
    assert main(["run", str(other), "-o", str(path), "--resume"]) == 0
    assert (
        f"contains {STEPS} steps, but the case now has {STEPS + 1}: those in the file are kept"
        in capsys.readouterr().err
    )


def test_without_resume_a_run_begins_anew(whole, begun, path):
    case, steps = whole
    shutil.copy(begun, path)
    assert run(case, path) == 0
    assert_same(path, steps)


CHANGED = {
    "material": ("nu = 0.3\n[[", "nu = 0.31\n[[", "the materials"),
    "support": ("y = -2.0", "y = -2.1", "the supports"),
    "contact": ('primary = "CONT2"', 'primary = "CONT2"\nfriction = 0.1', "contact 'hertz'"),
    "ramp": ("steps = 6", "steps = 6\nend = 2.0\ntable = [[0.0, 0.0], [2.0, 1.0]]", "the load history up to 0.333333"),
    "solve": ("[probes]", "[solve]\ngeometry_updates = 2\n[probes]", "the option geometry_updates"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_a_case_that_was_changed_since_is_refused(name, whole, begun, path, capsys):
    old, new, what = CHANGED[name]
    case, _ = whole
    shutil.copy(begun, path)
    before, text = path.read_bytes(), case.read_text()
    assert text.count(old) == 1
    changed = path.with_name("changed.toml")
    changed.write_text(text.replace(old, new))
    assert run(changed, path, "--resume") == 1
    assert only_line(capsys.readouterr().err) == (
        f"error: '{path}' cannot be resumed: the steps so far belong to another case; changed since: {what}. Continue with "
        "the model for which they were computed, or start anew without resuming"
    )
    assert path.read_bytes() == before


def test_what_does_not_change_the_answer_may_change(whole, begun, path):
    """A title, a probe, a check, the order of the supports, a limit."""
    case, steps = whole
    shutil.copy(begun, path)
    text = case.read_text().replace("small spheres", "still small").replace("tolerance = 0.2", "tolerance = 0.3")
    parts = text.split("[[support]]")
    contact = parts[3].index("[contact")
    parts[3], parts[1] = parts[1] + parts[3][contact:], parts[3][:contact]
    text = "[[support]]".join(parts).replace("[probes]", "[solve]\nmax_geometry_updates = 70\n[probes]")
    changed = path.with_name("changed.toml")
    changed.write_text(text)
    assert run(changed, path, "--resume") == 0
    results = fc.open_results(path)
    assert "still small" in results.case_text
    largest = np.abs(steps[-1].displacement).max()
    assert np.abs(results[-1].displacement - steps[-1].displacement).max() <= 1e-12 * largest


# ---------------------------------------------------------------------------------------------- accidents


def test_a_file_that_is_replaced_stops_the_run(whole, path, capsys, monkeypatch):
    case, _ = whole

    def replace():
        other = path.with_name("mine")
        other.write_text("mine")
        os.replace(other, path)

    assert stopped(case, path, monkeypatch, act=replace) == 1
    assert "moved or replaced after 2 steps" in only_line(capsys.readouterr().err)
    assert path.read_text() == "mine"
    assert run(case, path, "--resume") == 1
    assert only_line(capsys.readouterr().err).startswith(f"error: '{path}' is not an HDF5 file: name a result file")
    assert path.read_text() == "mine"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_no_result_file(whole, path, capsys):
    """Stands for devices, too, which a writer that went wrong must not come near."""
    os.mkfifo(path)
    for extra in ([], ["--resume"]):
        assert run(whole[0], path, *extra) == 1
        assert only_line(capsys.readouterr().err) == f"error: '{path}' is a device or a pipe: name a regular file"
    assert path.is_fifo()


@pytest.mark.skipif(importlib.util.find_spec("resource") is None, reason="needs resource limits")
@pytest.mark.parametrize("extra", [pytest.param([], marks=pytest.mark.slow), ["--resume"]], ids=["anew", "resumed"])
def test_a_disk_that_is_full_stops_the_run(extra, whole, path, capsys, monkeypatch):
    """Simulated by a limit for the size of files."""
    import resource

    case, steps = whole
    stopped(case, path, monkeypatch, after=1)
    capsys.readouterr()
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    # Room for a step or two.
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 30_000, limits[1]))
    try:
        assert run(case, path, *extra) == 1
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    n_steps = len(fc.open_results(path))
    assert 1 <= n_steps < STEPS
    assert only_line(capsys.readouterr().err) == (
        f"error: '{path}' cannot be written at step {n_steps + 1} (File too large); {n_steps} steps are complete: check "
        "the disk space and the permissions of the folder"
    )
    assert_same(path, steps[:n_steps])
    assert run(case, path, "--resume") == 0
    assert_same(path, steps)


def test_a_full_disk_stops_the_run_before_anything_is_replaced(whole, small_disk, capsys):
    case, steps = whole
    path = small_disk / "run.vtkhdf"
    shutil.copy(case.with_name("whole.vtkhdf"), path)
    before = path.read_bytes()
    with open(small_disk / "other", "wb") as other:
        other.write(bytes(shutil.disk_usage(small_disk).free))
    assert run(case, path) == 1
    assert only_line(capsys.readouterr().err) == (
        f"error: '{path}' cannot be written (No space left on device): check the disk space and the permissions of the folder"
    )
    assert path.read_bytes() == before
    assert_same(path, steps)
    assert sorted(os.listdir(small_disk)) == ["other", path.name]


def test_the_progress_of_a_resumed_run_counts_what_it_solves(whole, capsys, monkeypatch):
    """Two of six steps were there; the third took a second, so that three seconds are left."""
    seconds = iter((10.0, 11.0, 12.0))
    monkeypatch.setattr("fastcontact.analysis.progress.time.perf_counter", lambda: next(seconds))
    progress = Progress(STEPS, show=True, done=2)
    progress.step(whole[1][2])
    assert f"step 3/{STEPS}, " in (told := capsys.readouterr().err)
    assert "nodes in contact, 3 s left" in told
    progress.step(whole[1][3], complete=0)  # computed, but nothing is written yet
    assert capsys.readouterr().err == ""
    progress.close()
    assert capsys.readouterr().err.strip() == ""
    quiet = Progress(STEPS, show=False)
    quiet.step(whole[1][2])
    quiet.close()
    assert capsys.readouterr().err == ""
