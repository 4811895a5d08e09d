"""Run commands on a disk that fails at one call after the other, with the library of `disk.c` preloaded.

Arguments: folder to work in, folder of the files to start from, number of faults a command (0: at every call), commands as
JSON. Then all writes are short once, which is no fault. Each command runs in a child of its own, on a fresh copy of the
files. Prints one JSON line a fault: command, call, error, whether it is the only one, the file of the call, exit code or
minus the signal, what was printed as error, the names of the files left, and what is wrong with them. A lock is held by
the operating system, so that a command may go on without the text of its file; what it leaves then has the same contents
as without a fault.
The children come from a parent that has run no kernel, since threads do not survive a fork.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import importlib
import json
import os
import shutil
import sys
from pathlib import Path

import h5py
import numpy as np

from fastcontact.cli import main

# Children have what all commands import; none of it runs a kernel.
NEEDED = "analysis.run", "cases.case", "results.reader", "results.writer", "mesh.files.mesh_files", "mesh.generate"
for needed in NEEDED:
    importlib.import_module(f"fastcontact.{needed}")
with contextlib.suppress(ImportError):
    importlib.import_module("matplotlib.pyplot")

DISK = ctypes.CDLL(None)
DISK.disk_failed.restype = ctypes.c_char_p
ERRORS = (errno.EIO, errno.ENOSPC)
SHORT = 0


def run(command: list[str], work: Path, source: Path, call: int, error: int, once: bool) -> dict[str, object]:
    """Run a command in a child and return what came of it; `call` -1 lets nothing fail."""
    folder = work / "files"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(source, folder)
    said, counts = work / "said.txt", work / "calls.txt"
    child = os.fork()
    if child == 0:
        os.chdir(folder)
        os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), 2)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        DISK.disk_fails(os.fsencode(folder), call, error, once)
        code = main(command)
        counts.write_text(f"{DISK.disk_calls()} {os.path.basename(os.fsdecode(DISK.disk_failed()))}")
        os._exit(code)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    calls, _, failed = counts.read_text().partition(" ") if counts.exists() else ("0", "", "")
    return {
        "command": command,
        "call": call,
        "error": error,
        "once": once,
        "code": status,
        "said": said.read_text(),
        "files": sorted(os.listdir(folder)),
        "calls": int(calls),
        "failed": failed,
    }


def spread(total: int, count: int) -> list[int]:
    """Return `count` calls of `total`, the first and the last among them; all of them for 0."""
    if not count or count >= total:
        return list(range(total))
    return sorted({round(k * (total - 1) / (count - 1)) for k in range(count)})


def main_loop() -> None:
    work, source, count = Path(sys.argv[1]), Path(sys.argv[2]), int(sys.argv[3])
    for command in json.loads(sys.argv[4]):
        whole = run(command, work, source, -1, 0, False)
        print(json.dumps(whole), flush=True)
        shutil.rmtree(work / "whole", ignore_errors=True)
        shutil.copytree(work / "files", work / "whole")
        for number, call in enumerate(spread(int(str(whole["calls"])), count)):
            (work / "calls.txt").unlink(missing_ok=True)
            found = run(command, work, source, call, ERRORS[number % 2], bool(number % 3))
            found["harmless"] = bool(found["once"]) and str(found["failed"]).endswith(".lock")
            found["intact"] = intact(work / "files", source)
            if found["harmless"]:
                found["intact"] += apart(work / "files", work / "whole")
            print(json.dumps(found), flush=True)
        found = run(command, work, source, 0, SHORT, False)
        found["harmless"] = True
        found["intact"] = intact(work / "files", source) + apart(work / "files", work / "whole")
        print(json.dumps(found), flush=True)


def intact(folder: Path, source: Path) -> list[str]:
    """Return what is wrong with the files that a command has left: inputs changed, results that cannot be read."""
    from fastcontact.results.reader import open_results

    wrong = [f"{path.name} is gone" for path in source.iterdir() if not (folder / path.name).exists()]
    for path in folder.iterdir():
        old = source / path.name
        if path.name.startswith("."):
            wrong.append(f"{path.name} was left")
        elif old.exists() and path.read_bytes() == old.read_bytes():
            continue
        elif path.suffix == ".vtkhdf":
            try:
                with open_results(path) as results:
                    [step.displacement for step in results]
            except Exception as error:
                wrong.append(f"{path.name}: {error}")
        elif not path.stat().st_size:
            wrong.append(f"{path.name} is empty")
    return wrong


def contents(path: Path) -> object:
    """Return what a file holds: the arrays of results, all but the times of a summary, else its bytes."""
    if path.suffix == ".json":
        return {key: value for key, value in json.loads(path.read_text()).items() if key != "timings"}
    if path.suffix != ".vtkhdf":
        return path.read_bytes()
    arrays: dict[str, bytes] = {}

    def keep(name: str, item: object) -> None:
        if isinstance(item, h5py.Dataset):
            arrays[name] = np.asarray(item[()]).tobytes()

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return arrays


def apart(folder: Path, whole: Path) -> list[str]:
    """Return the names of the files that are not what they are without a fault."""
    names = {path.name for path in (*folder.iterdir(), *whole.iterdir())}
    alike = {
        name
        for name in names
        if (folder / name).exists() and (whole / name).exists() and contents(folder / name) == contents(whole / name)
    }
    return [f"{name} is not what it is without a fault" for name in sorted(names - alike)]


if __name__ == "__main__":
    main_loop()
