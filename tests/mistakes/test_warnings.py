"""A doubtful result gives a warning with a number: on screen, in the summary, in the result file and in Python."""

import json
import re
import warnings

import doubtful
import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case
from fastcontact.cli import main

ALSO = re.compile(
    "cells are too stiff|contact 'pair' has only .* across its radius|the largest (rotation|equivalent strain)"
)


@pytest.fixture(params=doubtful.DOUBTS, ids=lambda doubt: doubt.name)
def doubt(request, tmp_path, monkeypatch):
    """A doubtful case, with its files in the current folder."""
    monkeypatch.chdir(tmp_path)
    fc.write_mesh("doubtful.med", request.param.mesh())
    (tmp_path / "case.toml").write_text(request.param.case)
    return request.param


def said(doubt, texts):
    """Check that the warnings are those of the case, each once; coarse models may give those of accuracy too."""
    assert len(set(texts)) == len(texts)
    found = [next((text for text in texts if re.search(pattern, text)), None) for pattern in doubt.patterns]
    assert None not in found, texts
    assert all(ALSO.search(text) for text in texts if text not in found), texts
    assert all(re.search(r"\d", text) and "\n" not in text for text in texts)


@pytest.mark.parametrize("doubt", doubtful.DOUBTS[::5], ids=lambda doubt: doubt.name, indirect=True)
def test_a_doubt_is_on_screen_in_the_summary_and_in_the_file(doubt, capsys):
    """Every fifth: which warnings there are is the same in the library, see below."""
    with warnings.catch_warnings(record=True) as elsewhere:
        warnings.simplefilter("always")
        assert main(["run", "case.toml", "-o", "run.vtkhdf", "--json", "run.json"]) == 0
    assert not [w for w in elsewhere if w.category is fc.FastcontactWarning]
    shown = capsys.readouterr().err.splitlines()
    texts = [line.removeprefix("warning: ") for line in shown if line.startswith("warning: ")]
    said(doubt, texts)
    with open("run.json", encoding="utf-8") as file:
        assert json.load(file)["warnings"] == texts
    with fc.open_results("run.vtkhdf") as results:
        assert sorted(results.warnings) == sorted(texts)
        assert sorted({*results[0].warnings, *results[-1].warnings}) == sorted(texts)


def test_a_doubt_is_a_warning_of_the_library_and_in_its_results(doubt):
    case = read_case("case.toml")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        steps = fc.solve(case.model, case.ramp, criteria=case.criteria)
    texts = [str(w.message) for w in caught if w.category is fc.FastcontactWarning]
    said(doubt, texts)
    assert [text for step in steps for text in step.warnings] == texts
    assert all(w.filename == __file__ for w in caught if w.category is fc.FastcontactWarning)
