"""Other modes: threads, interpreted kernels, children of multiprocessing, the oldest releases of dependencies."""

import json
import re
import tomllib

import pytest
from numba import __version__ as version
from pairwise import first_of
from starting import ROOT, finished, start


@pytest.mark.parametrize("runs", first_of(1, ["friction yielding", "plane stretched solid"]))
def test_one_and_two_threads_find_the_same_bits(runs):
    threads = [dict.fromkeys(("NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS"), n) for n in "12"]
    if version.startswith("0.60"):  # it may link the parts of a kernel otherwise in the process that compiles it
        finished(start("whole_runs.py", *runs.split()))
    found = [json.loads(finished(start("whole_runs.py", *runs.split(), **environment))[0]) for environment in threads]
    assert found[0] == found[1]
    assert all(size > 0.0 for run in found[0].values() for size in run["sizes"])


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


def test_oldest_releases_tested_are_the_lower_bounds():
    with (ROOT / "pyproject.toml").open("rb") as file:
        needed = tomllib.load(file)["project"]["dependencies"]
    bounds = dict(re.fullmatch(r"([\w-]+)>=([\d.]+)", need).groups() for need in needed)
    lines = (ROOT / ".ci" / "oldest.txt").read_text(encoding="utf-8").splitlines()
    tested = dict(line.split("==") for line in lines if not line.startswith("#"))
    assert tested.keys() == bounds.keys()
    for name, release in tested.items():
        bound = bounds[name].split(".")
        assert release.split(".")[: len(bound)] == bound, name
        assert not any(int(part) for part in release.split(".")[len(bound) :]), f"{name}: name the whole release"
