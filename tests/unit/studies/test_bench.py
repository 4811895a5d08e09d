"""The benchmark suite runs at its smallest size, and its files are complete."""

import json

import pytest

from fastcontact.cli import main
from fastcontact.cli.bench import suite

SUBJECTS = {"assembly", "contact", "io", "linear", "recovery", "search", "startup", "study"}
TABLES = {"robustness", "threads"}
SLOW = pytest.mark.slow


def test_all_subjects_are_there():
    assert set(suite("subjects").names()) == SUBJECTS | TABLES


def test_the_table_of_robustness(tmp_path, capsys):
    path = tmp_path / "run.json"
    assert main(["bench", "robustness", "--smallest", "--json", str(path)]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
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
    assert main(["bench", "threads", "--smallest", "--json", str(path)]) == 0
    assert "serial part by Amdahl's law" in capsys.readouterr().out
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
    last = list(entry["works"].values())[-1]
    assert last["ratio"] == 1.0
    assert all(found["cpu_s"] > 0 and found["wall_s"] > 0 for found in entry["works"].values())
    assert name in capsys.readouterr().out


def test_comparison_with_a_stored_run(tmp_path, capsys):
    path = str(tmp_path / "run.json")
    main(["bench", "search", "--smallest", "--json", path])
    assert main(["bench", "search", "--smallest", "--compare", path]) == 0
    assert "to stored" in capsys.readouterr().out


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
    assert main(["bench", *words]) == 1
    assert text in capsys.readouterr().err
