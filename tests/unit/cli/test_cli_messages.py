"""Messages of commands about numbers and texts that cannot be drawn: one line, no traceback."""

import os
import shutil
import sys

import matplotlib as mpl
import pytest
from case_texts import spheres

from fastcontact.cli import main

mpl.use("Agg")


@pytest.fixture
def results(solved_case, tmp_path):
    shutil.copy(solved_case / "old.vtkhdf", tmp_path / "old.vtkhdf")
    return tmp_path / "old.vtkhdf"


@pytest.mark.parametrize("scale", ["nan", "-inf", "1e308", "-1e40"])
def test_a_scale_that_cannot_be_drawn(results, scale, capsys):
    picture = results.with_name("a.png")
    assert main(["plot", str(results), f"--scale={scale}", "--png", str(picture)]) == 1
    assert capsys.readouterr().err == (
        f"error: scale = {float(scale):g} must be a finite number, and not so large that nothing can be drawn\n"
    )
    assert not picture.exists()


@pytest.mark.parametrize("scale", ["0", "-1", "1e6"])
def test_a_scale_that_can(results, scale):
    assert main(["plot", str(results), f"--scale={scale}", "--png", str(results.with_name("a.png")), "-q"]) == 0


def test_characters_that_the_font_of_a_picture_lacks_are_told_in_a_line(solved_case, tmp_path, capsys):
    shutil.copytree(solved_case, tmp_path / "case")
    case = tmp_path / "case" / "case.toml"
    case.write_text(case.read_text(encoding="utf-8").replace('title = "', 'title = "\u65e5\u672c '), encoding="utf-8")
    picture = tmp_path / "a.png"
    assert main(["run", str(case), "-o", str(tmp_path / "a.vtkhdf"), "--plot", str(picture), "-q"]) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "Glyph" in line]
    assert [line.partition(": ")[0] for line in lines] == ["warning", "warning"]
    assert sys.modules["matplotlib"] is mpl
    assert picture.exists()


CASE = spheres(10.0, 1)


def test_a_case_file_is_told(tmp_path, capsys):
    path = tmp_path / "a.toml"
    path.write_text(CASE)
    assert main(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert "hertz" in said
    assert "CONT1" in said


def test_what_is_written_otherwise_is_told(tmp_path, capsys):
    path = tmp_path / "a.toml"
    path.write_text(CASE.replace("[[material]]", "[material]"))
    assert main(["run", str(path), "-o", str(tmp_path / "a.vtkhdf")]) == 1
    assert "write [[material]] in place of [material]" in capsys.readouterr().err
    path.write_text(CASE)
    assert main(["sweep", str(path), "--set", "friction=0.1,0.2", "--json", str(tmp_path / "a.json")]) == 1
    assert capsys.readouterr().err == "error: 'friction' belongs to a pair: write contact.hertz.friction\n"
    assert main(["sweep", str(path), "--set", "material.E=1,2", "--json", str(tmp_path / "a.json")]) == 1
    assert capsys.readouterr().err == "error: 'material.E' needs the number of a table before 'E', such as [0]\n"
    assert main(["mesh", "block", "--size", "2,1", "-o", str(tmp_path / "a.med")]) == 1
    assert "--size: expected 2 arguments, separated by blanks;" in capsys.readouterr().err


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_case_from_a_pipe_is_told(tmp_path, capsys):
    os.mkfifo(tmp_path / "a.toml")
    for case in (str(tmp_path / "a.toml"), "-"):
        assert main(["run", case, "-o", str(tmp_path / "a.vtkhdf")]) == 1
        assert "is a pipe or a terminal, and a case is read more than once" in capsys.readouterr().err


def test_warnings_take_one_line(tmp_path, capsys):
    assert main(["mesh", "box", "-o", str(tmp_path / "a.stl")]) == 1
    warned, refused = capsys.readouterr().err.splitlines()
    assert warned.startswith("warning: stl files have no named groups")
    assert refused.startswith("error: ")
