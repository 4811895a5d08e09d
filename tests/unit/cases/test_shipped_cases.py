"""Every case file of the project is complete, and its first step runs."""

from pathlib import Path

import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case

CASES = sorted((Path(__file__).resolve().parents[3] / "data" / "cases").glob("*.toml"))


@pytest.mark.filterwarnings("ignore::fastcontact.errors.FastcontactWarning")  # one case warns on purpose
@pytest.mark.parametrize("path", CASES, ids=lambda path: path.stem)
def test_the_first_step_of_every_shipped_case(path):
    case = read_case(path)
    first = fc.Ramp(case.ramp.instants[:1], case.ramp.table)
    step = fc.solve(case.model, first, criteria=case.criteria)[-1]
    for contact in step.contact.values():
        assert contact.active.any()
        assert contact.pressure_max > 0
    assert case.title
    assert set(case.units.values()) != {"-"}
