"""The benchmark suite runs at its smallest size, and its files hold what they promise."""

import json

import pytest

from fastcontact.cli import main
from fastcontact.cli.bench import suite

SUBJECTS = {"assembly", "contact", "io", "linear", "recovery", "search", "startup", "study"}


TABLES = {"robustness"}


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


def test_the_table_tells_what_failed():
    failed = {"varied": "nu 0.5", "friction": 0.0, "n_dofs": 12, "failed": "no way"}
    assert suite("subjects").load("robustness").lines([failed])[1].endswith("failed: no way")


@pytest.mark.parametrize("name", sorted(SUBJECTS))
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


@pytest.mark.parametrize("problem", ["sphere-on-block", "forma04c", "pressed-blocks", "pushed-blocks"])
def test_contact_in_detail(problem, tmp_path):
    path = tmp_path / "contact.json"
    assert main(["bench", "contact", "--problem", problem, "--dofs", "1500", "--json", str(path), "-q"]) == 0
    found = json.loads(path.read_text())
    two_dimensions = {"superlu"} if problem == "forma04c" else set()
    measured = {"problem", "n_dofs", "linear", "cold_step", "twenty_steps", "from_assembly", "peak_bytes", "threads"}
    assert set(found) == measured | two_dimensions
    assert set(found["linear"]) == {"cpu_s", "iterations", "setup_cpu_s"}
    assert set(found["cold_step"]) == {"cpu_s", "ratio_to_linear"}
    assert set(found["from_assembly"]) == {"linear_cpu_s", "cold_step_cpu_s", "ratio_to_linear"}
    assert set(found["twenty_steps"]) == {"cpu_s", "ratio_to_linear", "setups", "linear_iterations"}
    assert 750 < found["n_dofs"] < 4000
    assert found["linear"]["setup_cpu_s"] < found["linear"]["cpu_s"]
    assert found["twenty_steps"]["linear_iterations"] > found["linear"]["iterations"]


def test_comparison_with_a_stored_run(tmp_path, capsys):
    path = str(tmp_path / "run.json")
    main(["bench", "search", "--smallest", "--json", path])
    assert main(["bench", "search", "--smallest", "--compare", path]) == 0
    assert "to stored" in capsys.readouterr().out


def test_scaling_pictures(tmp_path):
    pytest.importorskip("matplotlib")
    assert main(["bench", "search", "--sizes", "100", "900", "--png", str(tmp_path / "png"), "-q"]) == 0
    assert (tmp_path / "png" / "search.png").stat().st_size > 1000


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
