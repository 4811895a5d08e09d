"""The coverage check finds uncovered lines and branches, and requires a reason for each."""

import importlib.util
import tomllib

import pytest


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
    listed = tomllib.loads(covered.LISTED.read_text(encoding="utf-8"))
    for entry in listed.get("uncovered", []):
        text = (root / entry["file"]).read_text(encoding="utf-8")
        assert entry["reason"].strip(), entry
        assert entry.get("function", "").split(".")[-1] in text, entry
        assert all(line.removeprefix("branch: ") in text for line in entry.get("lines", ())), entry
    for test in (*listed["tests"]["compiled"], *listed["tests"]["interpreted"]):
        path, _, name = test.partition("::")
        assert (root / path).exists(), path
        assert not name or f"def {name.partition('[')[0]}(" in (root / path).read_text(encoding="utf-8"), test
