"""The comparison with other programs: fastcontact runs, missing programs are reported, present ones agree."""

import importlib.util
import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

FOLDER = Path(__file__).resolve().parents[3] / "bench" / "peers"


def run(tmp_path, *arguments):
    """Run the comparison; return its output and its figures."""
    file = tmp_path / "figures.json"
    command = [sys.executable, str(FOLDER), *arguments, "--smallest", "--cold", "--json", str(file)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout, json.loads(file.read_text())


def module(name):
    spec = importlib.util.spec_from_file_location(f"bench_peers_{name}", FOLDER / f"{name}.py")
    loaded = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = loaded  # dataclasses look themselves up
    spec.loader.exec_module(loaded)
    return loaded


def fake(tmp_path, reaction):
    """Return an interpreter that has every module and runs a command of the shell in place of any script."""
    path = tmp_path / "python"
    path.write_text(f'#!/bin/sh\n[ "$1" = -c ] && exit 0\n{reaction}\n')
    path.chmod(0o755)
    return path


def test_peers_that_cannot_run_say_so(tmp_path):
    """One that is not there, one without the module, and one that fails."""
    bare, failing = tmp_path / "bare", fake(tmp_path, "echo matrix is singular; exit 3")
    bare.write_text("#!/bin/sh\nexit 1\n")
    bare.chmod(0o755)
    pythons = {"getfem": tmp_path / "no" / "python", "kratos": bare, "getfem-deformed": failing}
    given = [word for name, path in pythons.items() for word in ("--python", f"{name}={path}")]
    text, figures = run(tmp_path, "forma04", "--only", *pythons, *given)
    assert "GetFEM: absent (apt-get install python3-getfem)" in text
    assert figures["absent"]["getfem"] == "apt-get install python3-getfem"
    assert set(figures["absent"]) == {"getfem", "kratos"}
    assert "ended with status 3: matrix is singular" in text
    (found,) = figures["runs"]
    assert found["status"] == 3
    assert "answer" not in found


def test_a_process_beyond_its_limit_is_ended(tmp_path):
    found = module("process").measured(
        [sys.executable, "-c", "while True: pass"], threads=1, folder=tmp_path, limit_s=1
    )
    assert found["status"] in (-signal.SIGXCPU, -signal.SIGKILL)


def test_programs_stand_on_the_same_mesh():
    """The half model is the upper body of the whole one, node by node; both contact surfaces mirror each other."""
    problems = module("problems")
    whole, half = problems.forma04(1_000), problems.half(500)
    upper = np.unique(whole["cells"][whole["upper"]])
    np.testing.assert_allclose(whole["points"][upper], half["points"], atol=1e-12)
    lower = whole["points"][np.unique(whole["facets_CONT1"])]
    other = whole["points"][np.unique(whole["facets_CONT2"])]
    np.testing.assert_allclose(np.sort(lower[:, 0]), np.sort(other[:, 0]), atol=1e-12)
    np.testing.assert_allclose(whole["points"][whole["POLE"]], 0.0, atol=1e-12)


@pytest.mark.parametrize("problem", ["forma04", "half", "octant"])
def test_sizes_are_those_asked_for(problem):
    found = module("problems").PROBLEMS[problem](6_000)
    assert found["points"].size == pytest.approx(6_000, rel=0.1)
