"""Compilation of kernels ahead of the run that needs them, in parallel helper processes.

`kernels.json`, which is written by ``python bench/kernels.py``, is a table of the kernels that are called by the usual kinds
of runs, with the types of their arguments, in the order of the calls. Helpers begin with the kernels that cannot run in
Python (see `interpreting`), and report which kernel they are compiling. While a helper is compiling a kernel that the run
needs, the run compiles kernels that no helper has begun, and reports them to the helpers. If there are no such kernels, it
waits. A kernel that is missing from the table, or listed with outdated types, is compiled by the run.
"""

from __future__ import annotations

import atexit
import contextlib
import importlib
import itertools
import json
import os
import subprocess
import sys
import threading
from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import types
from numba.np.numpy_support import from_dtype
from numpy import dtype

from fastcontact._jit import cache as kernel_files
from fastcontact._jit import compiling, decorators

TABLE = Path(__file__).with_name("kernels.json")
ROOT = Path(__file__).resolve().parents[2]
# Largest number of helpers of a run. Each helper needs the memory of a Python process with Numba.
MAX_HELPERS = 3
# Largest number of kernels that the run compiles without helpers, because starting helpers would take longer.
MAX_WITHOUT_HELPERS = 2
# Kinds of runs for which this process has already started helpers, so that later runs need none.
_runs_with_helpers: set[str] = set()


@cache
def table() -> dict[str, Any]:
    """Return the table ``{"kernels": [[module, name, [type, ...]], ...], "runs": {name: [[number, ...], [number, ...]]}}``.

    The number of a kernel is its index in the first list. The two lists of a run contain the numbers of the kernels that must
    be compiled and of those that may run in Python.
    """
    content: dict[str, Any] = json.loads(TABLE.read_text(encoding="utf-8"))
    return content


def required_kernels(runs: Sequence[str]) -> list[int]:
    """Return the numbers of the kernels that must be compiled for the given kinds of runs; all kinds if none is given."""
    by_run = table()["runs"]
    return list(dict.fromkeys(number for run in runs or by_run for number in by_run.get(run, [[]])[0]))


def kernel_numbers(runs: Sequence[str]) -> list[int]:
    """Return the numbers of all kernels of the given kinds of runs; those that may run in Python are last."""
    by_run = table()["runs"]
    others = [number for run in runs or by_run for number in by_run.get(run, [[], []])[1]]
    return list(dict.fromkeys([*required_kernels(runs), *others]))


def numba_type(entry: Any) -> Any:
    """Return the Numba type of an entry of the table.

    A string is a scalar in NumPy's notation, such as "f8". A list ``[scalar, dimensions]`` is a contiguous array,
    and ``[scalar, dimensions, "r"]`` is a read-only array. ``{"class": [type, ...]}`` is a named tuple, or a plain tuple if
    the name of the class is empty.
    """
    if isinstance(entry, str):
        return from_dtype(dtype(entry))
    if isinstance(entry, list):
        return types.Array(numba_type(entry[0]), entry[1], "C", readonly=len(entry) > 2)
    ((name, members),) = entry.items()
    member_types = [numba_type(member) for member in members]
    if not name:
        return types.Tuple(member_types)
    module, _, class_name = name.rpartition(".")
    named = getattr(importlib.import_module(module), class_name)
    uniform = len(set(member_types)) == 1
    if uniform:
        return types.NamedUniTuple(member_types[0], len(member_types), named)
    return types.NamedTuple(member_types, named)


def compile_kernel(number: int) -> None:
    """Compile a kernel of the table, or load it from disk."""
    module, name, signature = table()["kernels"][number]
    getattr(importlib.import_module(module), name).compile(tuple(map(numba_type, signature)))


def _is_cached(number: int) -> bool:
    """Return whether the disk cache contains a kernel of the table, for any types of arguments."""
    module, name, _ = table()["kernels"][number]
    files = kernel_files.files.get(getattr(importlib.import_module(module), name).py_func)
    return files is not None and files.exist()


def _file_name(number: int) -> str:
    """Return the beginning of the name of the cache file of a kernel of the table."""
    module, name, _ = table()["kernels"][number]
    return f"{module.rpartition('.')[2]}.{name}"


def start(
    runs: Sequence[str], n_helpers: int, output: int = subprocess.PIPE, errors: int = subprocess.DEVNULL
) -> list[subprocess.Popen[str]]:
    """Start helper processes that share the compilation of the kernels of the given kinds of runs.

    Each helper writes the numbers of the kernels that it begins to `output`, and the reasons for failures to `errors`.
    """
    path = os.pathsep.join([str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", __name__, str(n_helpers)]
    started = [
        subprocess.Popen(
            [*command, str(first), *runs], stdin=subprocess.PIPE, stdout=output, stderr=errors, text=True,
            env={**os.environ, "PYTHONPATH": path},
        )
        for first in range(n_helpers)
    ]  # fmt: skip
    atexit.register(_terminate, started)
    return started


def _terminate(processes: list[subprocess.Popen[str]]) -> None:
    """Terminate helpers that are still running. The files of the kernels that they have compiled are complete."""
    for process in processes:
        process.terminate()
        process.wait()


class Helpers:
    """Helper processes of a run, the kernels that they are compiling, and the kernels that no process has begun.

    Parameters
    ----------
    runs : sequence of str
        Kinds of runs.
    processes : list of subprocess.Popen
        Result of `start`.
    """

    def __init__(self, runs: Sequence[str], processes: list[subprocess.Popen[str]]) -> None:
        self._processes, self._not_begun, self._required = processes, kernel_numbers(runs), required_kernels(runs)
        self._current: dict[int, int] = {}  # kernel being compiled by each helper
        self._changed = threading.Condition()
        for number in range(len(processes)):
            threading.Thread(target=self._listen, args=(number,), daemon=True).start()

    def _listen(self, number: int) -> None:
        """Record the reports of a helper until it ends."""
        lines = self._processes[number].stdout
        for line in lines or ():
            self._record(number, int(line))
        self._record(number, None)

    def _record(self, helper: int, kernel: int | None) -> None:
        """Record the kernel that a helper has begun, or None for a helper that has ended."""
        with self._changed:
            self._current.pop(helper, None)
            if kernel is not None:
                self._current[helper] = kernel
                self._not_begun = [number for number in self._not_begun if number != kernel]
            self._changed.notify_all()

    def wait(self, name: str) -> bool:
        """Wait while helpers compile kernels called `name`; return whether a helper was compiling such a kernel.

        In the meantime, this process compiles kernels that no helper has begun. A kernel called `name` that no helper has
        begun is reported to the helpers, which then skip it.
        """
        with self._changed:
            in_progress = [(helper, kernel) for helper, kernel in self._current.items() if _file_name(kernel) == name]
        for helper, kernel in in_progress:
            compiling.announce()
            while self._current.get(helper) == kernel and self._compile_next():
                pass
            with self._changed:
                while self._current.get(helper) == kernel:
                    self._changed.wait()
        if not in_progress:
            self._claim([number for number in self._not_begun if _file_name(number) == name])
        return bool(in_progress)

    def _compile_next(self) -> bool:
        """Compile a required kernel that no helper has begun; return whether there was one."""
        numbers = [number for number in self._not_begun if number in self._required][:1]
        self._claim(numbers)
        for number in numbers:
            compile_kernel(number)
        return bool(numbers)

    def _claim(self, numbers: list[int]) -> None:
        """Report to the helpers which kernels this process compiles."""
        with self._changed:
            self._not_begun = [number for number in self._not_begun if number not in numbers]
        for process, number in itertools.product(self._processes, numbers):
            with contextlib.suppress(OSError):  # the helper has ended
                print(number, file=process.stdin, flush=True)


def request_helpers(runs: Sequence[str]) -> None:
    """Start helpers for the given kinds of runs as soon as more than MAX_WITHOUT_HELPERS kernels have to be compiled.

    Helpers are started only if one of the missing kernels cannot run in Python. There are no helpers in worker processes,
    with a single thread, without a kernel cache, or if the interpreter is embedded in another program.
    """
    new_runs = [run for run in runs if run not in _runs_with_helpers]
    n_helpers = min(decorators.threads() - 1, MAX_HELPERS)
    is_python = Path(sys.executable or "").stem.startswith("python")
    if not new_runs or n_helpers < 1 or compiling.in_worker() or not is_python or not kernel_files.files:
        return

    def start_helpers() -> None:
        if compiling.count > MAX_WITHOUT_HELPERS and start_helpers in compiling.helper_requests:
            compiling.helper_requests.remove(start_helpers)
            _runs_with_helpers.update(new_runs)
            if all(map(_is_cached, required_kernels(new_runs))):  # the other kernels may run in Python
                return
            with contextlib.suppress(OSError):  # without helpers, the run compiles all kernels
                compiling.waiters.append(Helpers(new_runs, start(new_runs, n_helpers)).wait)

    compiling.helper_requests[:] = [start_helpers]
    start_helpers()


def main(arguments: Sequence[str]) -> int:
    """Compile, as a helper, every `n`-th kernel of the given kinds of runs, and return the number of failures.

    Kernels whose numbers are read from standard input are skipped.
    """
    n, first, *runs = arguments
    compiled_elsewhere: set[int] = set()
    n_failures = 0
    threading.Thread(target=lambda: compiled_elsewhere.update(map(int, sys.stdin)), daemon=True).start()
    for number in kernel_numbers(runs)[int(first) :: int(n)]:
        print(number, flush=True)
        if number not in compiled_elsewhere:
            try:
                compile_kernel(number)
            except Exception as error:  # the run reports the failure if it needs the kernel
                n_failures += 1
                reason = f"{_file_name(number)}: {type(error).__name__}: {error}"
                print(reason.split("\n")[0], file=sys.stderr, flush=True)
    return n_failures


if __name__ == "__main__":
    os._exit(min(main(sys.argv[1:]), 1))  # a normal exit would wait for the thread that reads standard input
