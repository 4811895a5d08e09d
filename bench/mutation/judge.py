"""Run chosen tests in a forked process, which has the big libraries loaded already but nothing of the package.

It has a home and a folder for temporary files of its own.
"""

from __future__ import annotations

import importlib
import json
import os
import resource
import signal
import sys
import tempfile
import time
from pathlib import Path

import pytest

# Loaded once; every mutant's process is forked from here.
LIBRARIES = (
    "numpy",
    "scipy.sparse.linalg",
    "scipy.spatial",
    "scipy.linalg",
    "scipy.optimize",
    "numba",
    "h5py",
    "hypothesis",
)
MEMORY = 12 << 30


class Chosen:
    """Leaves the chosen tests only, in their order, and writes which of them did not pass."""

    def __init__(self, tests: list[str], failed: Path) -> None:
        self.order = {test: place for place, test in enumerate(tests)}
        self.passed: set[str] = set()
        self.failed = failed

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note what passed."""
        if report.when == "call" and report.passed:
            self.passed.add(report.nodeid)

    def pytest_sessionfinish(self) -> None:
        """Write the others."""
        self.failed.write_text(json.dumps([test for test in self.order if test not in self.passed]), encoding="utf-8")

    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        """Choose."""
        items[:] = sorted((item for item in items if item.nodeid in self.order), key=lambda i: self.order[i.nodeid])


def load() -> None:
    """Load the big libraries."""
    for name in LIBRARIES:
        importlib.import_module(name)


def failing(tree: Path, tests: list[str], log: Path) -> list[str]:
    """Return the tests that do not pass, run to the last."""
    verdict(tree, tests, 3600.0, log, first_only=False)
    return list(json.loads((tree.parent / "own" / "failed.json").read_text(encoding="utf-8")))


def verdict(tree: Path, tests: list[str], limit: float, log: Path, first_only: bool = True) -> str:
    """Return ``"survived"``, ``"killed"``, ``"crashed"`` or ``"hung"`` for the package in `tree` under tests."""
    child = os.fork()
    if child == 0:
        code = 99  # of a process that did not come to its tests
        try:
            code = _run(tree, tests, log, first_only)
        finally:
            os._exit(code)
    deadline = time.monotonic() + limit
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return {0: "survived", 1: "killed", 2: "killed"}.get(os.waitstatus_to_exitcode(status), "crashed")
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)  # its own group, see below
    os.waitpid(child, 0)
    return "hung"


def _run(tree: Path, tests: list[str], log: Path, first_only: bool) -> int:
    os.setpgid(0, 0)
    out = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(out, 1)
    os.dup2(out, 2)
    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    own = tree.parent / "own"
    own.mkdir(exist_ok=True)
    os.chdir(tree)
    os.environ |= {"PYTHONPATH": str(tree), "HOME": str(own), "TMPDIR": str(own)}
    tempfile.tempdir = None
    sys.path.insert(0, str(tree))
    files = list(dict.fromkeys(test.partition("::")[0] for test in tests))
    options = [
        "-o",
        "addopts=",
        "-p",
        "no:cacheprovider",
        "-p",
        "no:xdist",
        "-q",
        "--tb=line",
        "-m",
        "",
        *["-x"] * first_only,
    ]
    code = pytest.main([*options, *files], plugins=[Chosen(tests, own / "failed.json")])
    sys.stdout.flush()
    return int(code)
