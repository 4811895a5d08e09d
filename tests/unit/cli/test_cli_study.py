"""What commands of studies say on the way: progress on a terminal, interruptions, values of parameters."""

import argparse

import pytest

from fastcontact.cli import _study, sweep
from fastcontact.cli._progress import Runs
from fastcontact.studies.execute import Progress


@pytest.mark.parametrize(
    ("left", "seconds", "error", "stored", "told"),
    [
        (("level 3",), 2.0, "", False, "2/3 level 2 done, 1 left: about "),
        ((), 2.0, "no convergence", False, "2/3 level 2 failed"),
        (("level 3",), 0.0, "", True, "2/3 level 2 found in the store, 1 left: about "),
    ],
)
def test_progress_is_one_line_that_is_drawn_anew(left, seconds, error, stored, told, capsys):
    lines = Runs(show=True)
    lines(Progress("level 2", 2, 3, left, seconds, error, stored))
    shown = capsys.readouterr().err
    assert shown.startswith(f"\r{told}")
    assert "\n" not in shown
    assert len(shown.rstrip()) <= 100
    lines.close()
    assert capsys.readouterr().err == "\r" + " " * 100 + "\r"


def test_what_the_store_holds_says_nothing_about_the_time_left(capsys):
    Runs(show=True)(Progress("level 1", 1, 3, ("level 2", "level 3"), 0.0, "", True))
    assert capsys.readouterr().err.rstrip() == "\r1/3 level 1 found in the store"


def test_nothing_is_drawn_where_nobody_looks(capsys):
    lines = Runs(show=False)
    lines(Progress("level 1", 1, 3, ("level 2", "level 3"), 1.0, "", False))
    lines.close()
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(("store", "told"), [("runs", "with the runs in runs"), (None, "with --store DIR")])
def test_an_interrupted_study_says_how_to_go_on(store, told):
    assert told in _study.stopped(argparse.Namespace(store=store))


@pytest.mark.parametrize(
    ("text", "values"),
    [
        ("approach=0.04,4", [0.04, 4.0]),
        ("steps=1,2", [1, 2]),
        ("tied=true,false", [True, False]),
        ("element=quad4, quad8", ["quad4", "quad8"]),
        ("approach=1:3:3", [1.0, 2.0, 3.0]),
        ("approach=0.01:1:3:log", [0.01, 0.1, 1.0]),
    ],
)
def test_values_of_a_parameter(text, values):
    name, found = sweep.values(text)
    assert name == text.split("=")[0]
    assert found == pytest.approx(values) if isinstance(values[0], float) else found == values
