"""A study that is killed continues where it stopped, and runs nothing twice."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

from fastcontact.cli import main


@pytest.mark.skipif(os.name != "posix", reason="needs SIGKILL")
def test_a_killed_sweep_redoes_no_finished_run(root, tmp_path):
    store, target = tmp_path / "store", tmp_path / "sweep.json"
    command = [sys.executable, "-m", "fastcontact", "sweep", str(root / "data/cases/forma04c.toml")]
    command += ["--set", "approach=0.1:4:8", "--level", "0", "--workers", "2", "--store", str(store), "-q"]
    command += ["--json", str(target)]
    first = subprocess.Popen(command, start_new_session=True)
    deadline = time.monotonic() + 120
    while len(finished(store)) < 3 and first.poll() is None and time.monotonic() < deadline:
        time.sleep(0.005)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    kept = finished(store)
    assert len(kept) >= 3
    assert not target.exists() or len(kept) == 8
    assert main([*command[3:], "--workers", "1"]) == 0
    after = finished(store)
    assert len(after) == 8
    assert {name: after[name] for name in kept} == kept
    points = json.loads(target.read_text())["points"]
    forces = [point["force"] for point in points]
    assert len(forces) == 8
    assert forces == sorted(forces)


def finished(store):
    """Whole results in a store, with the instant they were written; names with a dot are still being written."""
    return {path.name: path.stat().st_mtime_ns for path in store.glob("[!.]*.json")} if store.is_dir() else {}
