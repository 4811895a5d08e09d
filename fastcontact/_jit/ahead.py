"""Kernels compiled ahead of the run that needs them, side by side in processes of their own.

`kernels.json` tells which kernels the usual kinds of runs call, with the types of their arguments, in the order of the calls;
``python bench/kernels.py`` makes it. Helpers begin at its end while the run compiles from its beginning, and finds on disk
what they have done. Of a kernel that the table lacks, or knows otherwise than it is, comes no more than a compilation in the
run.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import json
import multiprocessing
import os
import subprocess
import sys
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core import types
from numba.np.numpy_support import from_dtype
from numpy import dtype

from fastcontact._jit import cache as kernel_files
from fastcontact._jit import compiling

TABLE = Path(__file__).with_name("kernels.json")
ROOT = Path(__file__).resolve().parents[2]
# Helpers of a run, each as large as Python with Numba.
MOST = 3
# Kernels compiled by a process before it gets help: a single new one is no reason to start others.
ALONE = 4
# Kinds of runs that this process has had help with: later runs of these find their kernels.
_helped: set[str] = set()


@cache
def table() -> dict[str, Any]:
    """Return ``{"kernels": [[module, name, [type, ...]], ...], "runs": {name: [number of a kernel, ...]}}``."""
    read: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    return read


def kernels_of(runs: Sequence[str]) -> list[int]:
    """Return the numbers of the kernels that some kinds of runs call, of all kinds if none are named."""
    known = table()["runs"]
    return sorted({number for run in runs or known for number in known.get(run, [])})


def numba_type(given: Any) -> Any:
    """Return the Numba type that an entry of the table tells.

    A string is a scalar, as NumPy writes its kind and bytes; a list ``[scalar, dimensions]`` a contiguous array that may be
    written, one with a third item "r" one that may not; ``{"class": [type, ...]}`` a named tuple, and a plain one where the
    class is empty.
    """
    if isinstance(given, str):
        return from_dtype(dtype(given))
    if isinstance(given, list):
        return types.Array(numba_type(given[0]), given[1], "C", readonly=len(given) > 2)
    ((name, members),) = given.items()
    inside = [numba_type(member) for member in members]
    if not name:
        return types.Tuple(inside)
    module, _, of = name.rpartition(".")
    named = getattr(importlib.import_module(module), of)
    same = len(set(inside)) == 1
    return types.NamedUniTuple(inside[0], len(inside), named) if same else types.NamedTuple(inside, named)


def compile_kernel(number: int) -> None:
    """Compile a kernel of the table, or find it on disk."""
    module, name, given = table()["kernels"][number]
    getattr(importlib.import_module(module), name).compile(tuple(map(numba_type, given)))


def start(runs: Sequence[str], helpers: int, output: int = subprocess.DEVNULL) -> list[subprocess.Popen[bytes]]:
    """Start processes that share the kernels of some kinds of runs; each writes a line to `output` for each kernel done."""
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", __name__, str(helpers)]
    started = [
        subprocess.Popen(
            [*command, str(first), *runs], stdin=subprocess.DEVNULL, stdout=output, stderr=subprocess.DEVNULL,
            env={**os.environ, "PYTHONPATH": path},
        )
        for first in range(helpers)
    ]  # fmt: skip
    atexit.register(_end, started)
    return started


def _end(processes: list[subprocess.Popen[bytes]]) -> None:
    """End helpers that are still at work; what they have compiled is complete."""
    for process in processes:
        process.terminate()
        process.wait()


def expect(runs: Sequence[str]) -> None:
    """Let helpers compile what some kinds of runs need as soon as this process compiles more than a few kernels.

    Not in a process that works for another one, nor where threads are limited to one, kernels are not kept, or the
    interpreter is part of another program.
    """
    new, helpers = [run for run in runs if run not in _helped], min(numba.get_num_threads() - 1, MOST)
    python = Path(sys.executable or "").stem.startswith("python")
    if not new or helpers < 1 or multiprocessing.parent_process() is not None or not python or not kernel_files.kept:
        return

    def begin() -> None:
        if compiling.count > ALONE and begin in compiling.helpers:
            compiling.helpers.remove(begin)
            _helped.update(new)
            with contextlib.suppress(OSError):  # the run compiles alone
                start(new, helpers)

    compiling.helpers[:] = [begin]
    begin()


def main(arguments: Sequence[str]) -> None:
    """Compile every `n`-th kernel of some kinds of runs, from the last on: what a helper does."""
    n, first, *runs = arguments
    for number in kernels_of(runs)[::-1][int(first) :: int(n)]:
        with contextlib.suppress(Exception):  # the run will tell, if it needs the kernel
            compile_kernel(number)
        print(number, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
