"""What a command says of numbers and texts that cannot be drawn: one line, no traceback."""

import shutil
import sys

import matplotlib as mpl
import pytest

from fastcontact.cli import main

mpl.use("Agg")


@pytest.fixture
def results(solved_case, tmp_path):
    shutil.copy(solved_case / "old.vtkhdf", tmp_path / "old.vtkhdf")
    return tmp_path / "old.vtkhdf"


@pytest.mark.parametrize("scale", ["nan", "inf", "-inf", "1e308", "1e400", "1e200", "-1e40"])
def test_a_scale_that_cannot_be_drawn(results, scale, capsys):
    picture = results.with_name("a.png")
    assert main(["plot", str(results), f"--scale={scale}", "--png", str(picture)]) == 1
    assert capsys.readouterr().err == (
        f"error: scale = {float(scale):g} must be a finite number, and not so large that nothing can be drawn\n"
    )
    assert not picture.exists()


@pytest.mark.parametrize("scale", ["0", "-1", "100", "1e6"])
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
