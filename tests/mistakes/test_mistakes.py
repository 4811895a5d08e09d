"""Each invalid input ends with exit code 1 and one line that names the culprit, before any computation."""

import re
import shutil
from pathlib import Path

import pytest
from accidents import ACCIDENTS
from catalogue import CASES, COMMANDS
from spoilt import MESHES

from fastcontact.analysis import problem
from fastcontact.cli import main

DATA = Path(__file__).parents[2] / "data"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with the FORMA04 A case, spoilt copies of its mesh, and a library that must not assemble anything."""
    mesh = DATA / "meshes" / "forma04a.med"
    shutil.copy(mesh, tmp_path)
    (tmp_path / "text.med").write_text("this is no mesh\n")
    (tmp_path / "mesh.xyz").write_text("this is no mesh\n")
    (tmp_path / "empty.med").touch()
    (tmp_path / "truncated.med").write_bytes(mesh.read_bytes()[: mesh.stat().st_size // 2])
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(problem, "stiffness", lambda *_: pytest.fail("numerics started"))
    return tmp_path


def refused(capsys, arguments, pattern):
    """Run the command line and check exit code, the one line and its words."""
    code = main(arguments)
    shown = capsys.readouterr().err
    assert code == 1, shown
    assert shown.startswith("error: ")
    assert shown.count("\n") == 1, shown
    assert re.search(pattern, shown), shown


def case_text():
    return (DATA / "cases" / "forma04a.toml").read_text().replace("../meshes/", "")


def test_the_case_without_mistake_goes_on_to_the_numerics(folder):
    (folder / "case.toml").write_text(case_text())
    with pytest.raises(pytest.fail.Exception, match="numerics started"):
        main(["run", "case.toml"])


def test_the_catalogue_is_as_long_as_it_must_be_and_names_each_mistake_once():
    entries = [*CASES, *COMMANDS, *MESHES, *ACCIDENTS]
    names = [entry[0] for entry in entries]
    assert len(set(names)) == len(names) >= 100
    assert all(entry[-1] for entry in entries)


@pytest.mark.parametrize(("old", "new", "pattern"), [c[1:] for c in CASES], ids=[c[0] for c in CASES])
def test_mistakes_in_a_case_file(folder, capsys, old, new, pattern):
    text = case_text()
    assert old in text
    (folder / "case.toml").write_text(text.replace(old, new, 1))
    refused(capsys, ["run", "case.toml"], pattern)


@pytest.mark.parametrize(("arguments", "pattern"), [c[1:] for c in COMMANDS], ids=[c[0] for c in COMMANDS])
def test_mistakes_on_the_command_line(folder, capsys, arguments, pattern):
    (folder / "case.toml").write_text(case_text())
    refused(capsys, arguments, pattern)


@pytest.mark.parametrize(("write", "pattern"), [m[1:] for m in MESHES], ids=[m[0] for m in MESHES])
def test_mistakes_in_a_mesh_file(folder, capsys, write, pattern):
    write(folder / "forma04a.med", folder / "spoilt.med")
    (folder / "case.toml").write_text(case_text().replace("forma04a.med", "spoilt.med"))
    refused(capsys, ["run", "case.toml"], pattern)


@pytest.mark.parametrize(("arrange", "arguments", "pattern"), [a[1:] for a in ACCIDENTS], ids=[a[0] for a in ACCIDENTS])
def test_places_that_cannot_be_written(folder, capsys, monkeypatch, arrange, arguments, pattern):
    (folder / "case.toml").write_text(case_text())
    arrange(monkeypatch, folder)
    refused(capsys, arguments, pattern)
