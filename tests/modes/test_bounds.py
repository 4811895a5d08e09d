"""NUMBA_BOUNDSCHECK=1: tests of kernels with checked array indices."""

import subprocess
import sys

import pytest
from starting import ROOT, finished, start

# Each calls kernels itself, on sizes that compile in seconds rather than minutes.
KERNEL_TESTS = (
    "tests/unit/contact/test_clip.py",
    "tests/unit/analysis/test_coulomb.py",
    "tests/unit/linear/test_linear_multigrid.py",
    "tests/unit/linear/test_grouped_pivots.py",
    "tests/unit/contact/test_search.py",
    "tests/unit/linear/test_symmetric_factors.py",
)


def test_the_mode_finds_an_index_out_of_bounds(tmp_path):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_BOUNDSCHECK": "1"}
    output, _ = finished(start("out_of_bounds.py", **environment))
    assert output.split() == ["IndexError", "IndexError"]


@pytest.mark.parametrize("name", KERNEL_TESTS)
def test_named_files_of_tests_exist(name):
    assert (ROOT / name).is_file()  # pytest runs no test at all where one is missing


@pytest.mark.slow
def test_kernels_stay_within_bounds(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))  # the cache does not tell this mode from the ordinary one
    command = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "-n", "2", "--tb=short", *KERNEL_TESTS]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:]
