"""Output of study commands: progress on a terminal, interruptions, values of parameters."""

import argparse
import inspect
import os
import signal
import subprocess
import sys
import time

import pytest

import fastcontact as fc
from fastcontact.cli import _study, main, sweep
from fastcontact.studies.execute import Progress, StudyStatus, run_study
from fastcontact.studies.job import Run


@pytest.mark.parametrize(
    ("left", "seconds", "error", "stored", "told"),
    [
        (("level 3",), 2.0, "", False, "2/3 level 2 done, 1 left: about "),
        ((), 2.0, "no convergence", False, "2/3 level 2 failed"),
        (("level 3",), 0.0, "", True, "2/3 level 2 found in the store, 1 left: about "),
    ],
)
def test_progress_is_one_line_that_is_drawn_anew(left, seconds, error, stored, told, capsys):
    lines = StudyStatus(show=True)
    lines(Progress("level 2", 2, 3, left, seconds, error, stored))
    shown = capsys.readouterr().err
    assert shown.startswith(f"\r{told}")
    assert "\n" not in shown
    assert len(shown.rstrip()) <= 100
    lines.close()
    assert capsys.readouterr().err == "\r" + " " * 100 + "\r"


def test_what_the_store_holds_says_nothing_about_the_time_left(capsys):
    StudyStatus(show=True)(Progress("level 1", 1, 3, ("level 2", "level 3"), 0.0, "", True))
    assert capsys.readouterr().err.rstrip() == "\r1/3 level 1 found in the store"


@pytest.mark.parametrize(("store", "told"), [("runs", "with the runs in runs"), (None, "with --store DIR")])
def test_an_interrupted_study_says_how_to_go_on(store, told):
    def interrupted(**options):
        raise KeyboardInterrupt

    options = argparse.Namespace(store=store, quiet=True, executor="processes", workers=1)
    with pytest.raises(fc.FastcontactError, match=told):
        _study.run_interruptibly(options, interrupted)


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("approach=0.04,4", [0.04, 4.0]),
        ("steps=1,2", [1, 2]),
        ("tied=true,false", [True, False]),
        ("element=quad4, quad8", ["quad4", "quad8"]),
        ("approach=1:3:3", [1.0, 2.0, 3.0]),
        ("approach=0.01:1:3:log", [0.01, 0.1, 1.0]),
    ],
)
def test_values_of_a_parameter(text, values):
    name, found = sweep.parse_setting(text)
    assert name == text.split("=")[0]
    assert found == pytest.approx(values) if isinstance(values[0], float) else found == values


@pytest.mark.parametrize(
    ("command", "told"),
    [
        (["converge", "forma04a", "--levels", "50"], "reduce the number of levels to"),
        (["converge", "sphere-on-plane-3d", "--levels", "30"], "of memory, of which this machine has"),
        (["sweep", "forma04a", "--set", "material[0].E=1:2:20000000"], "a study of 20000000 runs is too large"),
        (["sweep", "forma04a", "--set", "material[0].E=1:1e400:3"], "a range is FIRST:LAST:COUNT"),
        (
            ["sweep", "forma04a", "--set", "material[0].E=1:2:5000", "--set", "material[0].nu=0.1:0.3:5000"],
            "a study of 25000000 runs is too large",
        ),
        (["sweep", "forma04a", "--set", "material[0].E=1", "--set", "material[0].E=2"], "material[0].E is given twice"),
    ],
)
def test_a_study_that_nobody_could_wait_for_is_refused_at_once(command, told, capsys):
    assert main(command) == 1
    line = capsys.readouterr().err
    assert told in line
    assert line.count("\n") == 1


WORKING = """
import os, sys, time
from fastcontact.studies.execute import process_pool

if __name__ == "__main__":
    with process_pool(2) as pool:
        print(*{pool.submit(os.getpid).result() for _ in range(20)}, flush=True)
        running = [pool.submit(time.sleep, 600) for _ in range(2)]
        time.sleep(600)
"""


@pytest.mark.skipif(os.name != "posix", reason="needs signals")
@pytest.mark.parametrize("number", [pytest.param(signal.SIGTERM, marks=pytest.mark.slow), signal.SIGKILL])
def test_workers_end_with_their_parent(number, tmp_path):
    script = tmp_path / "working.py"
    script.write_text(WORKING)
    with subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as parent:
        workers = [int(word) for word in parent.stdout.readline().split()]
        assert workers
        parent.send_signal(number)
    deadline = time.monotonic() + 60
    while left := [worker for worker in workers if is_running(worker)]:
        assert time.monotonic() < deadline, f"{left} still run"
        time.sleep(0.05)


STOPPED = """
import time
from fastcontact.studies.execute import run_on_processes, process_pool
from fastcontact.studies import execute

def endless(job, threads):
    time.sleep(job)
    return {"seconds": job}

class Sized(float):
    size = 1

execute.execute_run = endless
if __name__ == "__main__":
    print("begun", flush=True)
    for _ in run_on_processes(2, [Sized(0.0), *[Sized(600.0)] * 20], [*range(21)]):
        raise KeyboardInterrupt
"""


def test_a_study_that_is_interrupted_does_not_wait_for_its_runs(tmp_path):
    script = tmp_path / "stopped.py"
    script.write_text(STOPPED)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=300, check=False)
    assert done.stdout == "begun\n"
    assert done.stderr.count("Traceback") == 1, "a thread of the pool failed, too"
    assert done.stderr.rstrip().endswith("KeyboardInterrupt")
    assert done.returncode not in (0, 1)


def test_adaptive_meshes_tell_their_warnings_as_a_run_does(tmp_path, monkeypatch, capsys):
    (tmp_path / "coarse.toml").write_text("""
kinematics = "axisymmetric"
mesh = { generator = "half-spheres", element = "tri3", size = 12.0 }
material = [{ E = 20000.0, nu = 0.3 }]
support = [{ group = "A1A2", x = 0.0 }, { group = "A2B2", y = -0.5 }, { group = "A1B1", y = 0.5 }]
ramp = { steps = 1 }
[contact.hertz]
secondary = "CONT1"
primary = "CONT2"
""")
    monkeypatch.chdir(tmp_path)
    main(
        ["converge", "coarse.toml", "--adaptive", "--tolerance", "0.009", "--max-dofs", "400", "-q", "--json", "a.json"]
    )
    told = capsys.readouterr().err.splitlines()
    assert told
    assert all(line.startswith("warning: ") for line in told), told
    assert len(set(told)) == len(told)


UNGUARDED = """
import fastcontact as fc
fc.convergence_study("forma04a", 2, ["tri3"], ["node_to_segment"], workers=2)
"""


def test_a_script_that_its_workers_would_run_anew_gets_one_error(tmp_path):
    script = tmp_path / "unguarded.py"
    script.write_text(UNGUARDED)
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 1
    assert done.stderr.count("Traceback") == 1, done.stderr
    assert "put the call of the study under if __name__ == '__main__':" in done.stderr.splitlines()[-1]


def is_running(process):
    """Return whether a process is there and no mere entry of one that has ended."""
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as file:
            return file.read().rpartition(")")[2].split()[0] != "Z"
    except (FileNotFoundError, ProcessLookupError):
        return False


class Solved(Run):
    """A run that is already solved."""

    def evaluate(self):
        return {"values": {}, "seconds": 1.0}


def test_a_study_tells_its_runs_where_it_is_asked_to(capsys):
    heard = []
    runs = [Solved(label=f"level {number}", name="case", marks={}) for number in (1, 2)]
    for show in (False, True):
        run_study(runs, "nothing", on_progress=heard.append, progress=show, workers=1)
        shown = capsys.readouterr().err
        assert bool(shown) is show
        assert ("the first runs" in shown) is show
        assert ("1/2 level 1 done, 1 left" in shown) is show
    assert [progress.label for progress in heard] == ["level 1", "level 2"] * 2
    for study in (fc.convergence_study, fc.parameter_sweep, fc.adaptive_study):
        assert inspect.signature(study).parameters["progress"].default is False
