"""Test harness for commands on a failing disk: build the library, run the worker, judge each fault."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent


def build(folder: Path) -> Path | None:
    """Return the library of `disk.c`, built with the C compiler of the machine; None where there is none, or no Linux."""
    compiler = shutil.which("cc") or shutil.which("gcc")
    if compiler is None or sys.platform != "linux":
        return None
    library = folder / "disk.so"
    subprocess.run([compiler, "-shared", "-fPIC", "-O1", "-o", library, HERE / "disk.c", "-ldl"], check=True)
    return library


def found(library: Path, work: Path, source: Path, commands: list[list[str]], count: int) -> list[dict[str, Any]]:
    """Return what came of each fault; see `disk_worker`."""
    environment = {**os.environ, "LD_PRELOAD": str(library), "NUMBA_NUM_THREADS": "1"}
    worker = [sys.executable, str(HERE / "disk_worker.py"), str(work), str(source), str(count), json.dumps(commands)]
    done = subprocess.run(worker, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [json.loads(line) for line in done.stdout.splitlines()]


def complaints(fault: dict[str, Any]) -> list[str]:
    """Return what is wrong with what came of a fault: a crash, silence, more than a line, files damaged or left."""
    where = f"{' '.join(fault['command'])}, call {fault['call']}, error {fault['error']}"
    wrong = [f"{where}: {text}" for text in fault.get("intact", [])]
    lines = [line for line in fault["said"].splitlines() if not line.startswith("warning: ")]
    if fault["call"] < 0 or fault["harmless"]:
        return wrong + ([f"{where}: {fault['code']} {lines}"] if fault["code"] or lines else [])
    if fault["code"] != 1:
        wrong.append(f"{where}: exit code {fault['code']}, {lines}")
    if len(lines) != 1 or not lines[0].startswith("error: "):
        wrong.append(f"{where}: printed {lines}")
    return wrong
