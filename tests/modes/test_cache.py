"""Cache of compiled kernels: read-only folders, and two processes that write at once."""

import json
import os
import shutil
import sys
from pathlib import Path

import pytest
from starting import ROOT, finished, obeying_permissions, start

MESSAGE = "no writable folder for compiled kernels"
linux = pytest.mark.skipif(sys.platform != "linux", reason="taking a right from a process is done Linux's way here")


@pytest.fixture
def installed(tmp_path):
    """The package where nothing may be written, and an empty home where nothing may be written either."""
    place, home = tmp_path / "installed", tmp_path / "home"
    shutil.copytree(ROOT / "fastcontact", place / "fastcontact", ignore=shutil.ignore_patterns("__pycache__"))
    home.mkdir()
    folders = [home, *(Path(folder) for folder, _, _ in os.walk(place))]
    for folder in folders:
        folder.chmod(0o555)
    yield {"PYTHONPATH": str(place), "HOME": str(home), "XDG_CACHE_HOME": None, "NUMBA_CACHE_DIR": None}
    for folder in folders:
        folder.chmod(0o755)


def calls(**environment):
    output, log = finished(start("two_kernels.py", before=obeying_permissions, **environment))
    return json.loads(output), log


@linux
@pytest.mark.parametrize("asked", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_read_only_install_compiles_in_every_process_and_says_so_once(asked, installed, tmp_path):
    folder = tmp_path / "cache"
    folder.mkdir()
    folder.chmod(0o555)
    found, log = calls(**installed | ({"NUMBA_CACHE_DIR": str(folder / "deeper")} if asked else {}))
    assert found == {"right": True, "hits": 0, "misses": 2}
    assert log.count(MESSAGE) == 1, log
    assert not list(folder.iterdir())


@pytest.mark.slow
@linux
def test_a_read_only_install_keeps_kernels_where_it_is_told(installed, tmp_path):
    environment = installed | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    for expected in ({"right": True, "hits": 0, "misses": 2}, {"right": True, "hits": 2, "misses": 0}):
        found, log = calls(**environment)
        assert found == expected
        assert MESSAGE not in log


@pytest.mark.slow
def test_processes_that_compile_at_once_leave_a_good_cache(tmp_path):
    environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    at_once = [start("two_kernels.py", **environment) for _ in range(2)]
    assert all(json.loads(finished(process)[0])["right"] for process in at_once)
    output, _ = finished(start("two_kernels.py", **environment))
    assert json.loads(output) == {"right": True, "hits": 2, "misses": 0}
