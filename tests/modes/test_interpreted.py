"""NUMBA_DISABLE_JIT=1: interpreted kernels give the same numbers."""

import json

import pytest
from starting import finished, start

# The preconditioner works in single precision, and conjugate gradients stop at a residual of 1e-10.
CLOSE = {"plane": 1e-11, "friction": 1e-11, "small": 1e-9}


@pytest.fixture(scope="module")
def found():
    """The answers of both modes, compiled and interpreted."""
    return [json.loads(finished(start("whole_runs.py", *CLOSE, NUMBA_DISABLE_JIT=mode))[0]) for mode in "01"]


@pytest.mark.slow
@pytest.mark.parametrize("run", CLOSE)
def test_interpreted_kernels_find_the_numbers_of_compiled_ones(run, found):
    compiled, interpreted = found
    assert interpreted[run]["sizes"] == pytest.approx(compiled[run]["sizes"], rel=CLOSE[run], abs=0.0)
