"""The benchmark suite, the comparison with other programs and the coverage check run and are complete."""

import importlib.util
import json
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from commands import output_of

from fastcontact.cli import main
from fastcontact.cli.bench import suite

SUBJECTS = {"assembly", "contact", "io", "linear", "recovery", "search", "startup", "study"}
TABLES = {"robustness", "threads"}
SLOW = pytest.mark.slow


def test_all_subjects_are_there():
    assert set(suite("subjects").names()) == SUBJECTS | TABLES


def test_the_table_of_robustness(tmp_path, capsys):
    path = tmp_path / "run.json"
    head, *lines = output_of(capsys, ["bench", "robustness", "--smallest", "--json", str(path)]).splitlines()
    rows = json.loads(path.read_text())["tables"]["robustness"]
    assert len(lines) == len(rows) == 2
    assert head.split()[-3:] == ["L", "residual", "solver"]
    assert [row["friction"] for row in rows] == [0.0, 0.3]
    for row in rows:
        assert row["closed"] == row["nodes"] > 9
        assert 0.0 < row["residual"] < 1e-6
        assert row["step"]["iterations"] < 3 * row["linear"]["iterations"]


@pytest.mark.slow
def test_the_table_of_threads(tmp_path, capsys):
    path = tmp_path / "run.json"
    assert "serial part by Amdahl's law" in output_of(capsys, ["bench", "threads", "--smallest", "--json", str(path)])
    (entry,) = json.loads(path.read_text())["tables"]["threads"]
    one, two = entry["runs"]
    assert (one["threads"], two["threads"]) == (1, 2)
    assert one["efficiency"] == 1.0
    assert one["iterations"] == two["iterations"] > 0


@pytest.mark.parametrize(
    "name", [pytest.param(s, marks=SLOW if s in ("startup", "study", "contact") else ()) for s in sorted(SUBJECTS)]
)
def test_smallest_size_runs_and_is_recorded(name, tmp_path, capsys):
    path = tmp_path / "run.json"
    assert main(["bench", name, "--smallest", "--json", str(path)]) == 0
    stored = json.loads(path.read_text())
    assert {"versions", "cores", "threads"} <= set(stored["environment"])
    (entry,) = stored["results"][name]
    assert set(entry) == {"n_dofs", "peak_bytes", "works"}
    assert list(entry["works"].values())[-1]["ratio"] == 1.0
    assert all(found["cpu_s"] > 0 and found["wall_s"] > 0 for found in entry["works"].values())
    assert name in capsys.readouterr().out


def test_comparison_with_a_stored_run(tmp_path, capsys):
    path = str(tmp_path / "run.json")
    main(["bench", "search", "--smallest", "--json", path])
    assert "to stored" in output_of(capsys, ["bench", "search", "--smallest", "--compare", path])


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["serach"], "search"),
        (["search", "--dofs", "5"], "go together"),
        (["search", "--sizes", "0"], "positive"),
        (["contact", "--problem", "sphere", "--dofs", "500"], "sphere-on-block"),
        (["search", "--compare", "absent.json"], "no stored run"),
    ],
)
def test_wrong_words_get_one_line(words, text, capsys):
    assert text in output_of(capsys, ["bench", *words], 1)


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


@pytest.fixture
def covered(root):
    spec = importlib.util.spec_from_file_location("covered", root / "bench" / "covered.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def places(covered, tmp_path, monkeypatch):
    (tmp_path / "a.py").write_text(
        "def f(x):\n    if x:\n        x = 1\n    return x\ndef g(x):\n    if x:\n        return 2\n"
    )
    functions = {
        "f": {"missing_lines": [], "missing_branches": [[2, 4]]},
        "g": {"missing_lines": [7], "missing_branches": [[6, 7]]},
    }
    monkeypatch.setattr(covered, "ROOT", tmp_path)
    return list(covered.uncovered({"files": {"a.py": {"functions": functions}}}))


def test_lines_and_branches_are_found(places):
    assert places == [("a.py", "f", "branch: if x:"), ("a.py", "g", "return 2")]


def test_only_entries_with_a_reason_count(covered, places):
    entries = tomllib.loads(covered.listing(places))["uncovered"]
    assert covered.unlisted(places, entries) == places
    assert not covered.unlisted(places, [entry | {"reason": "rare"} for entry in entries])
    whole = {"file": "a.py", "function": "g", "reason": "rare"}
    assert covered.unlisted(places, [whole]) == places[:1]
    assert not covered.unlisted(places, [{"file": "a.py", "reason": "rare"}])
    assert covered.unlisted(places, [{**entries[1], "lines": ["return 3"], "reason": "rare"}]) == places


def test_the_list_is_of_lines_that_are_there(covered, root):
    listed = tomllib.loads(covered.LIST_FILE.read_text(encoding="utf-8"))
    for entry in listed.get("uncovered", []):
        text = (root / entry["file"]).read_text(encoding="utf-8")
        assert entry["reason"].strip(), entry
        assert entry.get("function", "").split(".")[-1] in text, entry
        assert all(line.removeprefix("branch: ") in text for line in entry.get("lines", ())), entry
    for test in (*listed["tests"]["compiled"], *listed["tests"]["interpreted"]):
        path, _, name = test.partition("::")
        assert (root / path).exists(), path
        assert not name or f"def {name.partition('[')[0]}(" in (root / path).read_text(encoding="utf-8"), test
