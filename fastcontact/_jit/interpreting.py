"""Kernels that run as Python for as long as they are not compiled, where that takes less time than compiling them.

A kernel that loops once or twice over a small mesh takes Python some hundredths of a second, and Numba one or two seconds.
The arithmetic is the same to the last bit: sums, products, quotients and square roots of doubles, in the order written.
"""

from __future__ import annotations

import functools
import time
from collections.abc import Callable
from types import FunctionType
from typing import Any

import numpy as np

from fastcontact._jit import compiling
from fastcontact._jit.cache import KernelFiles

# Entries of all arguments of a call, and seconds in all calls of a kernel, up to which it runs as Python: that takes 1 to 8
# microseconds an entry, and Numba 0.2 to 3 seconds a kernel.
ENTRIES, SECONDS = 200_000, 0.5
# NumPy computes with smaller types in other ones than Numba; those of a byte are compared only.
EXACT = ("float64", "int64", "int32", "uint8", "bool")


class Interpretable:
    """A kernel that Python runs for as long as it is small and no compiled version is kept.

    Parameters
    ----------
    compiled : object
        What Numba makes of the kernel.
    files : KernelFiles, optional
        Where compiled versions are kept.
    """

    def __init__(self, compiled: Any, files: KernelFiles | None) -> None:
        functools.update_wrapper(self, compiled.py_func)
        self.compiled, self.py_func, self.compile = compiled, compiled.py_func, compiled.compile
        self._files, self._spent = files, 0.0
        self._call: Callable[..., Any] = self._choose

    def __call__(self, *arguments: Any) -> Any:
        """Return what the kernel returns."""
        return self._call(*arguments)

    def _choose(self, *arguments: Any) -> Any:
        """Compute a call by Python, or this and all later ones by the compiled kernel."""
        began = time.thread_time()
        small = self._spent <= SECONDS and entries(arguments) <= ENTRIES
        if not small or self.compiled.signatures or (self._files is not None and self._files.exist()):
            self._call = self.compiled
            return self.compiled(*arguments)
        if self._spent == 0.0:
            compiling.replace()
        result = interpret(self, arguments)
        self._spent += time.thread_time() - began
        return result


def interpret(kernel: Any, arguments: tuple[Any, ...]) -> Any:
    """Return what a kernel returns, computed by Python."""
    with np.errstate(all="ignore"):  # as compiled ones, which tell nothing
        return _plain(as_python(kernel)(*map(_number, arguments)))


def entries(given: Any) -> float:
    """Return the number of entries of an array, a scalar or a tuple of these; infinite for a type that is not `EXACT`."""
    if isinstance(given, tuple):
        return float(sum(map(entries, given)))
    exact = isinstance(given, bool | int | float) or getattr(given, "dtype", "") in EXACT
    return float(np.size(given)) if exact else np.inf


@functools.cache
def as_python(kernel: Any) -> Callable[..., Any]:
    """Return the function that a kernel is compiled from; kernels that it calls are Python, too."""
    function = getattr(kernel, "py_func", kernel)
    known, code = function.__globals__, function.__code__
    parts = {name: as_python(known[name]) for name in code.co_names if hasattr(known.get(name), "py_func")}
    return FunctionType(code, {**known, **parts}, function.__name__, function.__defaults__, function.__closure__)


def _number(given: Any) -> Any:
    """Return an argument so that a division by zero gives what it does in compiled code."""
    return np.float64(given) if isinstance(given, float) else given


def _plain(result: Any) -> Any:
    """Return numbers of a result as Numba returns them."""
    if type(result) is tuple:
        return tuple(map(_plain, result))
    return result.item() if isinstance(result, np.generic) else result
