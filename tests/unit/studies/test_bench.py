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


def test_the_table_of_robustness_by_numbers_of_unknowns():
    robustness = suite("subjects").load("robustness")
    for divisions in (12, 20, 40):
        model = robustness.blocks(divisions)
        assert robustness.divisions_of(model.n_dofs) == divisions
    meshes = [text for text, _ in robustness.variations(40) if text.startswith("mesh")]
    assert meshes == ["mesh 40", "mesh 40"]


def test_the_table_tells_what_failed():
    failed = {"varied": "nu 0.5", "friction": 0.0, "n_dofs": 12, "failed": "no way"}
    assert suite("subjects").load("robustness").lines([failed])[1].endswith("failed: no way")


def test_the_serial_part_of_walls_on_some_threads():
    amdahl = suite("subjects").load("threads").amdahl
    assert amdahl([1, 2, 4], [1.0 + 8.0, 1.0 + 4.0, 1.0 + 2.0]) == pytest.approx((1.0, 8.0))
    assert amdahl([1, 2, 4], [1.0, 2.0, 3.0]) == (2.0, 0.0)  # slower with each thread
    assert amdahl([1, 2], [3.0, 1.0]) == pytest.approx((0.0, 2.8))  # more than twice as fast
    assert amdahl([1], [3.0]) == (3.0, 0.0)


def test_what_a_function_calls_outside_of_the_package_is_its_own():
    """Own times by function and caller, as Python's profiler keeps them."""
    ours, other, outer = ("/x/fastcontact/a/b.py", 1, "f"), ("/x/fastcontact/c.py", 1, "g"), ("/y/library.py", 1, "h")
    inner, main_ = ("~", 0, "<built-in>"), ("/y/main.py", 1, "main")
    stats = {
        main_: (1, 1, 0.5, 9.0, {}),
        ours: (1, 1, 1.0, 5.0, {main_: (1, 1, 1.0, 5.0)}),
        other: (1, 1, 2.0, 3.0, {main_: (1, 1, 2.0, 3.0)}),
        outer: (4, 4, 4.0, 4.4, {ours: (3, 3, 3.0, 3.3), other: (1, 1, 1.0, 1.1)}),
        inner: (4, 4, 0.4, 0.4, {outer: (4, 4, 0.4, 0.4)}),
    }
    found = suite("subjects").load("threads").stages(stats)
    assert found == pytest.approx({"a/b.py/f": 1.0 + 3.0 + 0.3, "c.py/g": 2.0 + 1.0 + 0.1, "other": 0.5})


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
