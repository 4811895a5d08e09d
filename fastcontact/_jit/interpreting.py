"""Kernels that run as Python for as long as they are not compiled, where that takes less time than compiling them.

A kernel that loops once or twice over a small mesh takes Python some hundredths of a second, and Numba one or two seconds.
The arithmetic is the same to the last bit: sums, products, quotients and square roots of doubles, in the order written.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import cache
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


def until_compiled(kernel: Any) -> Any:
    """Let Python run a kernel where it is small and no compiled version is kept; return the kernel."""
    compiled, spent = kernel._compile_for_args, 0.0

    def choose(*arguments: Any) -> Callable[..., Any]:
        """Return what computes a call, as Numba's dispatcher asks where it has no compiled version."""
        if spent > SECONDS or entries(arguments) > ENTRIES or _kept(kernel, arguments):
            return compiled(*arguments)  # type: ignore[no-any-return]
        compiling.replace()
        return timed

    def timed(*arguments: Any) -> Any:
        nonlocal spent
        began = time.thread_time()
        result = interpret(kernel, arguments)
        spent += time.thread_time() - began
        return result

    kernel._compile_for_args, kernel.interpretable = choose, True
    return kernel


def interpret(kernel: Any, arguments: tuple[Any, ...]) -> Any:
    """Return what a kernel returns, computed by Python."""
    with np.errstate(all="ignore"):  # as compiled ones, which tell nothing
        return _plain(as_python(kernel)(*map(_number, arguments)))


def entries(arguments: Any) -> float:
    """Return the number of entries of arrays and scalars; infinite where there is a type that NumPy computes otherwise."""
    total = 0.0
    for given in arguments:
        if isinstance(given, tuple):
            total += entries(given)
        else:
            exact = isinstance(given, bool | int | float) or getattr(given, "dtype", "") in EXACT
            total += np.size(given) if exact else np.inf
    return total


@cache
def as_python(kernel: Any) -> Callable[..., Any]:
    """Return the function that a kernel is compiled from; kernels that it calls are Python, too."""
    function = getattr(kernel, "py_func", kernel)
    known, code = function.__globals__, function.__code__
    parts = {name: as_python(known[name]) for name in code.co_names if hasattr(known.get(name), "py_func")}
    return FunctionType(code, {**known, **parts}, function.__name__, function.__defaults__, function.__closure__)


def _kept(kernel: Any, arguments: tuple[Any, ...]) -> bool:
    """Return whether there is a file of the compiled kernel for these arguments."""
    files = getattr(kernel._cache, "_cache_file", None)
    if not isinstance(files, KernelFiles):
        return False
    types = tuple(kernel.typeof_pyval(given) for given in arguments)
    return files.has(kernel._cache._index_key(types, kernel.targetctx.codegen()))


def _number(given: Any) -> Any:
    """Return an argument so that a division by zero gives what it does in compiled code."""
    return np.float64(given) if isinstance(given, float) else given


def _plain(result: Any) -> Any:
    """Return numbers of a result as Numba returns them."""
    if type(result) is tuple:
        return tuple(map(_plain, result))
    return result.item() if isinstance(result, np.generic) else result
