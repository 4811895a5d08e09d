"""Grace project files: Grace draws them and reports the same numbers."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastcontact.errors import CaseError, FileError
from fastcontact.results.xmgrace import STYLES, Curve, escaped, round_axis, write_agr

GRACE = shutil.which("gracebat")
needs_grace = pytest.mark.skipif(GRACE is None, reason="gracebat (Debian's grace) is not installed")
X = np.linspace(0.0, 9.6, 25)
LABELS = {"title": "Pressure", "xlabel": "r [mm]", "ylabel": "p [MPa]"}


def pressure_curves() -> list[Curve]:
    theory = 2798.0 * np.sqrt(np.maximum(1 - (X / 9.0) ** 2, 0))
    return [Curve(X, theory, "Hertz"), Curve(X, 1.04 * theory, "mesh A", "symbols")]


def sets_of(text: str) -> list[np.ndarray]:
    blocks = re.findall(r"@target G0\.S\d+\n@type xy\n(.*?)&\n", text, flags=re.DOTALL)
    return [np.array([line.split() for line in block.splitlines()], float).reshape(-1, 2) for block in blocks]


def draw(path: Path, *arguments: str) -> Path:
    picture = path.with_suffix(".png")
    command = [GRACE, str(path), *arguments, "-hardcopy", "-printfile", str(picture), "-hdevice", "PNG"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0
    assert not re.search("error|unknown|invalid", done.stdout + done.stderr, flags=re.IGNORECASE), done.stderr
    return picture


def test_the_numbers_stand_in_the_file_to_the_last_bit(tmp_path: Path) -> None:
    curves = pressure_curves()
    write_agr(tmp_path / "a.agr", curves, **LABELS)
    found = sets_of((tmp_path / "a.agr").read_text("latin-1"))
    assert len(found) == 2
    for values, curve in zip(found, curves):
        np.testing.assert_array_equal(values, np.column_stack([curve.x, curve.y]))


def test_values_that_are_not_finite_are_left_out(tmp_path: Path) -> None:
    curve = Curve([0.0, 1.0, np.nan, 3.0, 4.0], [1.0, np.nan, 2.0, np.inf, 5.0], "holes")
    nothing = Curve([np.nan], [1.0], "nothing")
    write_agr(tmp_path / "a.agr", [nothing, curve], **LABELS)
    text = (tmp_path / "a.agr").read_text("latin-1")
    assert [values.tolist() for values in sets_of(text)] == [[[0.0, 1.0], [4.0, 5.0]]]
    assert "nothing" not in text


@needs_grace
def test_grace_draws_it_and_reads_the_same_numbers(tmp_path: Path) -> None:
    curves = pressure_curves()
    write_agr(tmp_path / "a.agr", curves, subtitle="h = 4 mm", **LABELS)
    picture = draw(tmp_path / "a.agr", "-saveall", str(tmp_path / "saved.agr"))
    content = picture.read_bytes()
    assert content.startswith(b"\x89PNG")
    assert len(content) > 3000
    saved = (tmp_path / "saved.agr").read_text("latin-1")
    for values, curve in zip(sets_of(saved), curves, strict=True):
        np.testing.assert_allclose(values, np.column_stack([curve.x, curve.y]), rtol=1e-7)
    for line in (
        '@    title "Pressure"', '@    subtitle "h = 4 mm"', "@    world 0, 0, 10, 3000",
        '@    xaxis  label "r [mm]"', "@    xaxis  tick major 2", "@    yaxis  tick major 500",
        '@    s0 legend  "Hertz"', "@    s0 symbol 0", "@    s1 symbol 2", "@    s1 line type 0",
        "@    legend on",
    ):  # fmt: skip
        assert line in saved, line


@needs_grace
@pytest.mark.parametrize(
    ("curves", "text"),
    [
        ([Curve([1.0], [5.0], "one point", "symbols")], "one point"),
        ([Curve([0, 1, 2], [0.0, 0.0, 0.0])], "zero"),
        ([Curve([1e-9, 2e-9], [-3e12, 4e12], "huge", "line+symbols")], "huge"),
        ([Curve([0, 1], [i, i + 1.0], f"n {i}", STYLES[i % 3]) for i in range(40)], "many"),
        ([Curve([0, 1], [1, 2], r'a "quoted" \S2\N 100 % @ # & name')], r'C:\temp "x" \xabc\f{} $y {z}'),
        ([Curve([0, 1], [1, 2], "β₁ ≥ µ·Δp, ∞, é")], "Größe Δ² ≥ β₃ 日本"),
    ],
    ids=["one point", "zero", "huge", "many", "markup", "letters"],
)
def test_grace_takes_whatever_comes(curves: list[Curve], text: str, tmp_path: Path) -> None:
    write_agr(tmp_path / "a.agr", curves, title=text, subtitle=text, xlabel=text, ylabel=text)
    picture = draw(tmp_path / "a.agr", "-saveall", str(tmp_path / "saved.agr"))
    assert len(picture.read_bytes()) > 2000
    saved = (tmp_path / "saved.agr").read_text("latin-1")
    assert f'@    title "{escaped(text)}"' in saved
    assert len(sets_of(saved)) == len(curves)


def test_text_is_shown_as_it_stands() -> None:
    assert escaped(r"a\b") == r"a\\b"
    assert escaped('"x"') == r"\"x\""
    assert escaped("two\nlines\tand\x00 more") == "two lines and? more"
    assert escaped("r² é µ") == "r² é µ"
    assert escaped("π") == r"\f{Symbol}p\f{}"
    assert escaped("a \u2212 b") == "a - b"
    assert escaped("\uff02\uff3c") == r"\"\\", "also where a letter turns into markup only here"
    assert escaped("x₁ 日") == "x1 ?"


@given(st.text())
def test_any_text_fits_one_line_of_latin_1(text: str) -> None:
    line = escaped(text)
    line.encode("latin-1")
    assert len(line.splitlines()) <= 1
    assert not re.search(r'(?<!\\)(\\\\)*"', line), "a bare quote would end the string"


@given(
    st.lists(st.floats(-1e12, 1e12).filter(lambda v: v == 0 or abs(v) > 1e-12), min_size=1, max_size=9),
    st.floats(1e-6, 1e6),
)
def test_axes_are_round_and_hold_all_values(values: list[float], scale: float) -> None:
    numbers = np.array(values) * scale
    first, last, distance = round_axis(numbers)
    slack = 1e-8 * distance
    assert first <= numbers.min() + slack
    assert last >= numbers.max() - slack
    mantissa = distance / 10.0 ** math.floor(math.log10(distance) + 1e-9)
    assert min(abs(mantissa - round_one) for round_one in (1, 2, 5, 10)) < 1e-9
    assert abs(first / distance - round(first / distance)) < 1e-6
    intervals = (last - first) / distance
    assert abs(intervals - round(intervals)) < 1e-6
    assert 3.5 < intervals < 10.5


@pytest.mark.parametrize(
    ("values", "axis"),
    [
        ([0.0, 0.3], (0.0, 0.30000000000000004, 0.05)),
        ([0.3, 9.6], (0.0, 10.0, 2.0)),
        ([-2773.5, 0.0], (-3000.0, 0.0, 500.0)),
        ([5.0], (2.0, 8.0, 1.0)),
        ([0.0], (-1.0, 1.0, 0.5)),
    ],
)
def test_axes_by_example(values: list[float], axis: tuple[float, float, float]) -> None:
    assert round_axis(values) == pytest.approx(axis, rel=1e-12)


def test_without_names_there_is_no_legend(tmp_path: Path) -> None:
    write_agr(tmp_path / "none.agr", [Curve(X, X)], **LABELS)
    assert "@    legend off" in (tmp_path / "none.agr").read_text()


def test_messages(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match=r"curve 'a': x has shape \(2,\) and y \(3,\)"):
        Curve([1, 2], [1, 2, 3], "a")
    with pytest.raises(CaseError, match="unknown curve style 'lines': did you mean 'line'"):
        Curve([1], [1], "a", "lines")
    with pytest.raises(CaseError, match="none of the 1 curves has a finite point"):
        write_agr(tmp_path / "a.agr", [Curve([np.nan], [1.0])], **LABELS)
    with pytest.raises(FileError, match="does not exist: create it"):
        write_agr(tmp_path / "nowhere" / "a.agr", pressure_curves(), **LABELS)
    assert list(tmp_path.iterdir()) == []
