"""Rare mistakes are reported as clearly as those of the catalogue."""

import inspect
import re

import arguments
import pytest
import rare_files
import rare_inside
import rare_models
import rare_studies
from test_mistakes import case_text, folder, refused  # noqa: F401 (a fixture)

CALLS = [*arguments.CALLS, *rare_models.MISTAKES, *rare_studies.CALLS, *rare_files.CALLS, *rare_inside.CALLS]


@pytest.mark.parametrize(("make", "kind", "pattern"), [c[1:] for c in CALLS], ids=[c[0] for c in CALLS])
def test_calls(make, kind, pattern, monkeypatch, tmp_path):
    """Some are given a folder, or a means to change modules, by name."""
    monkeypatch.chdir(tmp_path)
    offered = {"folder": tmp_path, "patch": monkeypatch}
    with pytest.raises(kind) as caught:
        make(**{name: offered[name] for name in inspect.signature(make).parameters})
    monkeypatch.undo()
    assert type(caught.value) is kind
    assert re.search(pattern, str(caught.value)), str(caught.value)


@pytest.mark.parametrize(
    ("old", "new", "pattern"), [c[1:] for c in rare_studies.CASES], ids=[c[0] for c in rare_studies.CASES]
)
def test_case_files(folder, capsys, old, new, pattern):  # noqa: F811
    text = case_text()
    assert old in text
    (folder / "case.toml").write_text(text.replace(old, new, 1))
    refused(capsys, ["converge", "case.toml", "--levels", "1", "--workers", "1"], pattern)


@pytest.mark.parametrize(
    ("arguments", "pattern"), [c[1:] for c in rare_studies.COMMANDS], ids=[c[0] for c in rare_studies.COMMANDS]
)
def test_commands(folder, capsys, arguments, pattern):  # noqa: F811
    (folder / "case.toml").write_text(case_text())
    refused(capsys, arguments, pattern)
