"""Kernels that run in Python as long as this takes less time than their compilation.

If a kernel loops once or twice over a small mesh, it takes some hundredths of a second in Python, whereas its compilation
takes one or two seconds. The kernel runs in Python until the total time of its calls, in this run and in earlier runs, is
about the time of a compilation. The total time is then at most about twice that of the better alternative, however many runs
follow. Results are bitwise identical, because the arithmetic consists of sums, products, quotients and square roots of
doubles in the order in which they are written.
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
from fastcontact._jit.cache import KernelFiles, cache_folder

# Limits for running a kernel in Python: number of entries of all arguments of a call, time of all calls of the kernel in one
# run [s], and time of all its calls in all runs [s]. Python takes 1 to 8 microseconds per entry. The compilation of a kernel
# takes 0.2 to 3 seconds; for most kernels, it takes less than the last limit.
MAX_ENTRIES, MAX_SECONDS, MAX_SECONDS_OF_RUNS = 200_000, 0.5, 1.0
# Name of the file, in the folder of the compiled kernels, with the time of uncompiled kernels in Python [s], by version.
TIMES_FILE = "interpreted.json"
# Types for which NumPy and Numba yield the same results. The two libraries promote smaller types differently, but types of
# one byte occur only in comparisons.
EXACT_TYPES = ("float64", "int64", "int32", "uint8", "bool")


class InterpretableKernel:
    """A kernel that runs in Python as long as its calls are small and no compiled version exists.

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
        self.files, self.seconds = files, 0.0  # time of the calls in Python [s]
        self._call: Callable[..., Any] = self._choose

    def __call__(self, *arguments: Any) -> Any:
        """Return the result of the kernel."""
        return self._call(*arguments)

    def _choose(self, *arguments: Any) -> Any:
        """Return the result of a call in Python, or compile the kernel for this call and all later ones."""
        began = time.thread_time()
        is_compiled = self.compiled.signatures or (self.files is not None and self.files.exist())
        if is_compiled or not self._is_small(arguments):
            self._call = self.compiled
            return self.compiled(*arguments)
        if self.seconds == 0.0:
            compiling.count_uncompiled()
            _interpreted.append(self)
        result = interpret(self, arguments)
        self.seconds += time.thread_time() - began
        return result

    def _is_small(self, arguments: tuple[Any, ...]) -> bool:
        """Return whether a call may run in Python: it is small, and the time so far is less than that of a compilation."""
        if self.seconds > MAX_SECONDS or n_entries(arguments) > MAX_ENTRIES:
            return False
        if _long_running or self.files is None:
            return True
        earlier = _earlier_times(self.files.folder).get(self.files.version, 0.0)
        if earlier + self.seconds > MAX_SECONDS_OF_RUNS:
            _long_running.append(self)
        return not _long_running


# Kernels that this process has run in Python, and the kernel that it compiles because of its time in earlier runs. In each
# run only one kernel is compiled for this reason, so that no single run has to compile all of them.
_interpreted: list[InterpretableKernel] = []
_long_running: list[InterpretableKernel] = []


@functools.cache
def _earlier_times(folder: Path) -> dict[str, float]:
    """Return the time [s] of kernels in Python in earlier runs, by version."""
    with contextlib.suppress(OSError, ValueError):
        content = json.loads((folder / TIMES_FILE).read_text(encoding="utf-8"))
        return {str(version): float(seconds) for version, seconds in content.items()}
    return {}


def save_times() -> None:
    """Add the times of this process to those of earlier runs. Of runs that end simultaneously, only one is counted."""
    spent = {kernel.files.version: kernel.seconds for kernel in _interpreted if kernel.files is not None}
    if spent and (folder := cache_folder()) is not None:
        _earlier_times.cache_clear()
        sums = _earlier_times(folder)
        sums |= {version: round(sums.get(version, 0.0) + seconds, 4) for version, seconds in spent.items()}
        temporary = folder / f"{TIMES_FILE}.{os.getpid()}"
        with contextlib.suppress(OSError):
            temporary.write_text(json.dumps(sums), encoding="utf-8")
            os.replace(temporary, folder / TIMES_FILE)
    _interpreted.clear()


atexit.register(save_times)


def interpret(kernel: Any, arguments: tuple[Any, ...]) -> Any:
    """Return the result of a kernel that is run in Python."""
    with np.errstate(all="ignore"):  # as in compiled kernels
        return _to_python(python_function(kernel)(*map(_to_numpy, arguments)))


def n_entries(argument: Any) -> float:
    """Return the number of entries of an array, a scalar or a tuple of these; infinite for types not in `EXACT_TYPES`."""
    if isinstance(argument, tuple):
        return float(sum(map(n_entries, argument)))
    exact = isinstance(argument, bool | int | float) or getattr(argument, "dtype", "") in EXACT_TYPES
    return float(np.size(argument)) if exact else np.inf


@functools.cache
def python_function(kernel: Any) -> Callable[..., Any]:
    """Return the Python function of a kernel, in which called kernels are replaced by their Python functions as well."""
    function = getattr(kernel, "py_func", kernel)
    names, code = function.__globals__, function.__code__
    called = {name: python_function(names[name]) for name in code.co_names if hasattr(names.get(name), "py_func")}
    return FunctionType(code, {**names, **called}, function.__name__, function.__defaults__, function.__closure__)


def _to_numpy(argument: Any) -> Any:
    """Return an argument in a type for which a division by zero has the same result as in compiled code."""
    return np.float64(argument) if isinstance(argument, float) else argument


def _to_python(result: Any) -> Any:
    """Return a result with NumPy scalars converted to Python numbers, which compiled kernels return."""
    if type(result) is tuple:
        return tuple(map(_to_python, result))
    return result.item() if isinstance(result, np.generic) else result
