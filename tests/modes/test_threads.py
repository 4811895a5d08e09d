"""Whole runs have the same bits with one and two threads, of kernels and of BLAS."""

import json

import pytest
from numba import __version__ as version
from pairwise import first_of
from starting import finished, start


@pytest.mark.parametrize("runs", first_of(1, ["friction yielding", "plane stretched solid"]))
def test_one_and_two_threads_find_the_same_bits(runs):
    threads = [dict.fromkeys(("NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), n) for n in "12"]
    if version.startswith("0.60"):  # it may link the parts of a kernel otherwise in the process that compiles it
        finished(start("whole_runs.py", *runs.split()))
    found = [json.loads(finished(start("whole_runs.py", *runs.split(), **environment))[0]) for environment in threads]
    assert found[0] == found[1]
    assert all(size > 0.0 for run in found[0].values() for size in run["sizes"])
