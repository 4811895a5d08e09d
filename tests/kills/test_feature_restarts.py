"""After a kill, every feature with a history resumes with the bits of an uninterrupted run, in every array."""

import json
from pathlib import Path

import feature_cases
import killing
import numpy as np
import pytest

import fastcontact as fc
from fastcontact.cases.case import read_case

pytestmark = pytest.mark.filterwarnings("ignore::fastcontact.FastcontactWarning")


def write(case, path, parts=None, stop=None):
    """Solve a case into a file, and its first `stop` steps into the file `parts` as well, abandoned there as by a kill."""
    out = fc.ResultWriter(path, case.model, resume=stop is None)
    killed = fc.ResultWriter(parts, case.model) if stop else None
    steps = fc.solve_steps(
        case.model, case.ramp, criteria=case.criteria, linear_solver=case.linear_solver, resume=out.done
    )
    for step in steps:
        out.write(case.finished(step))
        if stop is not None and step.index <= stop:
            killed.write(case.finished(step))
        if step.index == stop:
            killed._committed.exclusive = False  # nothing more reaches the file
            killed._file.close()
            killed._committed.close()
            killed._lock.release()
    out.close()


def plain(value):
    """Return what JSON makes of a value."""
    return json.loads(json.dumps(value, default=lambda array: np.asarray(array).tolist()))


@pytest.mark.parametrize("stop", [3, *(pytest.param(stop, marks=pytest.mark.slow) for stop in (1, 5))])
@pytest.mark.parametrize("name", feature_cases.CASES)
def test_a_killed_run_goes_on_with_the_same_bits(name: str, stop: int, tmp_path: Path):
    case = read_case(feature_cases.written(name, tmp_path))
    whole, parts = tmp_path / "whole.vtkhdf", tmp_path / "parts.vtkhdf"
    write(case, whole, parts, stop)
    write(read_case(feature_cases.written(name, tmp_path)), parts)
    assert killing.differing(whole, parts) == []
    with fc.open_results(whole) as one, fc.open_results(parts) as other:
        assert len(one) == len(other) == 6
        for step, again in zip(one, other, strict=True):
            assert (step.index, step.load_factor, step.warnings) == (again.index, again.load_factor, again.warnings)
            assert plain(step.iterations) == plain(again.iterations)
