"""Kernels that run in Python while they are not compiled, if that takes less time than their compilation.

Python takes some hundredths of a second for a kernel that loops once or twice over a small mesh, and its compilation takes
one or two seconds. The kernel runs in Python until the time spent on it, in this run and earlier ones, is about that of a
compilation. Whatever runs follow, this takes at most about twice the time of the better choice. Results are bitwise
identical, because the arithmetic consists of sums, products, quotients and square roots of doubles in the order written.
"""

from __future__ import annotations

import atexit
import contextlib
import functools
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from types import FunctionType
from typing import Any

import numpy as np

from fastcontact._jit import compiling
from fastcontact._jit.cache import KernelFiles

# Limits for Python: number of entries of all arguments of a call, time [s] of all calls of a kernel in one run, and time [s]
# in all runs. Python takes 1 to 8 microseconds per entry. The compilation of a kernel takes 0.2 to 3 seconds, for most
# kernels less than the last limit.
ENTRIES, SECONDS, SECONDS_OF_RUNS = 200_000, 0.5, 1.0
# File beside the compiled kernels: seconds that Python has spent on uncompiled ones, by version.
SPENT = "interpreted.json"
# Types for which NumPy and Numba agree. They promote smaller types differently; those of one byte are only compared.
EXACT = ("float64", "int64", "int32", "uint8", "bool")


class Interpretable:
    """A kernel that runs in Python while calls are small and no compiled version exists.

    Parameters
    ----------
    compiled : object
        The Numba dispatcher of the kernel.
    files : KernelFiles, optional
        Files of the compiled versions.
    """

    def __init__(self, compiled: Any, files: KernelFiles | None) -> None:
        functools.update_wrapper(self, compiled.py_func)
        self.compiled, self.py_func, self.compile = compiled, compiled.py_func, compiled.compile
        self._files, self._spent = files, 0.0
        self._call: Callable[..., Any] = self._choose

    def __call__(self, *arguments: Any) -> Any:
        """Return the result of the kernel."""
        return self._call(*arguments)

    def _choose(self, *arguments: Any) -> Any:
        """Compute a call in Python, or this and all later calls with the compiled kernel."""
        began = time.thread_time()
        is_compiled = self.compiled.signatures or (self._files is not None and self._files.exist())
        if is_compiled or not self._is_small(arguments):
            self._call = self.compiled
            return self.compiled(*arguments)
        if self._spent == 0.0:
            compiling.count_missing()
            _interpreted.append(self)
        result = interpret(self, arguments)
        self._spent += time.thread_time() - began
        return result

    def _is_small(self, arguments: tuple[Any, ...]) -> bool:
        """Return whether a call may run in Python: the time spent so far is less than that of a compilation."""
        if self._spent > SECONDS or entries(arguments) > ENTRIES:
            return False
        if _due or self._files is None:
            return True
        earlier = _spent_before(self._files.folder).get(self._files.version, 0.0)
        _due.extend([self] if earlier + self._spent > SECONDS_OF_RUNS else [])
        return not _due

    @property
    def spent(self) -> tuple[Path, str, float] | None:
        """Folder, version, and seconds spent in Python in this process; None for a kernel that is not cached."""
        return None if self._files is None else (self._files.folder, self._files.version, self._spent)


# Kernels that this process has run in Python, and the kernel that it compiles because of the time in earlier runs. Only one
# kernel per run is compiled for this reason, so that no run has to compile all of them.
_interpreted: list[Interpretable] = []
_due: list[Interpretable] = []


@functools.cache
def _spent_before(folder: Path) -> dict[str, float]:
    """Return the seconds spent in Python on kernels in earlier runs, by version."""
    with contextlib.suppress(OSError, ValueError):
        content = json.loads((folder / SPENT).read_text(encoding="utf-8"))
        return {str(version): float(seconds) for version, seconds in content.items()}
    return {}


def note_spent() -> None:
    """Add the seconds of this process to those of earlier runs; of runs that end simultaneously only one is counted."""
    spent = [kernel.spent for kernel in _interpreted if kernel.spent is not None]
    for folder in {folder for folder, _, _ in spent}:
        _spent_before.cache_clear()
        sums = dict(_spent_before(folder))
        for _, version, seconds in (entry for entry in spent if entry[0] == folder):
            sums[version] = round(sums.get(version, 0.0) + seconds, 4)
        temporary = folder / f"{SPENT}.{os.getpid()}"
        with contextlib.suppress(OSError):
            temporary.write_text(json.dumps(sums), encoding="utf-8")
            os.replace(temporary, folder / SPENT)
    _interpreted.clear()


atexit.register(note_spent)


def interpret(kernel: Any, arguments: tuple[Any, ...]) -> Any:
    """Return the result of a kernel, computed in Python."""
    with np.errstate(all="ignore"):  # as in compiled kernels
        return _plain(as_python(kernel)(*map(_number, arguments)))


def entries(argument: Any) -> float:
    """Return the number of entries of an array, a scalar or a tuple of these; infinite for a type that is not `EXACT`."""
    if isinstance(argument, tuple):
        return float(sum(map(entries, argument)))
    exact = isinstance(argument, bool | int | float) or getattr(argument, "dtype", "") in EXACT
    return float(np.size(argument)) if exact else np.inf


@functools.cache
def as_python(kernel: Any) -> Callable[..., Any]:
    """Return the Python function of a kernel, in which the kernels that it calls are replaced by Python functions as well."""
    function = getattr(kernel, "py_func", kernel)
    names, code = function.__globals__, function.__code__
    called = {name: as_python(names[name]) for name in code.co_names if hasattr(names.get(name), "py_func")}
    return FunctionType(code, {**names, **called}, function.__name__, function.__defaults__, function.__closure__)


def _number(argument: Any) -> Any:
    """Return an argument in a type whose division by zero gives the same result as in compiled code."""
    return np.float64(argument) if isinstance(argument, float) else argument


def _plain(result: Any) -> Any:
    """Return a result with NumPy scalars converted to Python numbers, which compiled kernels return."""
    if type(result) is tuple:
        return tuple(map(_plain, result))
    return result.item() if isinstance(result, np.generic) else result
