"""Decorators of kernels: disk cache, strict floating-point arithmetic, threads.

Kernels compile at their first call, never at import. Where no folder is writable for the cache, they compile
in every process instead, and one line in the log says so.
"""

from __future__ import annotations

import contextlib
import gc
import logging
import os
from collections.abc import Callable
from typing import Any

from fastcontact._jit import environment  # isort: skip # noqa: F401 (before Numba)
import numba
from numba.core import event

from fastcontact._jit import cache, compiling, interpreting
from fastcontact.errors import FastcontactError

log = logging.getLogger("fastcontact")

# Arithmetic is done as written, products and sums not fused to one rounding either. A kernel that others call is compiled
# once by itself and once as a part of each of them, and optimised differently there; which of the copies runs depends on
# what was compiled or loaded before. Only where each operation has one result do all of them give the same bits.
AS_WRITTEN: set[str] = set()
# What vectors may do in a kernel that neither calls another nor is called by one: of that there is one copy.
ANY_ORDER = {"contract", "reassoc"}

_cache_reported = False


class _Compilations(event.Listener):  # type: ignore[misc]
    """Hears of kernels of this package that are compiled; Numba tells nothing of those that it reads from the cache.

    Garbage is collected after a kernel, not 60 times within it, which takes a tenth of the time that Numba does.
    """

    depth = 0  # a kernel compiles those that it calls
    collects = True

    def on_start(self, found: Any) -> None:
        """Tell those who wait, and hold garbage collection back."""
        if getattr(found.data["dispatcher"], "__module__", "").startswith("fastcontact."):
            compiling.notify()
            if self.depth == 0:
                self.collects = gc.isenabled()
                gc.disable()
            self.depth += 1

    def on_end(self, found: Any) -> None:
        """Collect garbage again as before."""
        if getattr(found.data["dispatcher"], "__module__", "").startswith("fastcontact."):
            self.depth -= 1
            if self.depth == 0 and self.collects:
                gc.enable()


event.register("numba:compile", _Compilations())
_forked_without_threads = False


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` lazily in nopython mode, with the disk cache where one can be had."""
    return _compile(function, parallel=False)


def interpretable_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`; where it is small and not compiled yet, Python runs it, to the same bits.

    For sums, products, quotients and square roots alone: powers and sums of arrays are other ones in NumPy. Only for kernels
    that no other one calls, as it is no kernel to Numba.
    """
    dispatcher = kernel(function)
    return interpreting.Interpretable(dispatcher, cache.files.get(function)) if compiled() else dispatcher


def parallel_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, with `prange` loops spread over threads; iterations must write disjoint memory.

    With NUMBA_BOUNDSCHECK=1 the loops run in one thread: Numba checks no index inside parallel ones.
    """
    return _compile(function, parallel=not getattr(numba.config, "BOUNDSCHECK", None))


def summing_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, for long sums of products, which vectors take in an order of their own: the same in every run.

    Only where the last bits may differ between processors, as they do in BLAS, and no other kernel calls it, or is called.
    """
    return _compile(function, parallel=False, fastmath=ANY_ORDER)


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, for parts of hot loops: Numba puts the code in the place of each call."""
    return _compile(function, parallel=False, inline="always")


def innermost_kernel(function: Callable[..., Any]) -> Any:
    """Like `kernel`, for what the innermost loops call: LLVM puts the machine code in the place of each call.

    Small arrays then stay in registers, where `inlined_kernel` leaves them in memory.
    """
    return _compile(function, parallel=False, forceinline=True)


def _compile(function: Callable[..., Any], parallel: bool, fastmath: set[str] = AS_WRITTEN, **inlining: Any) -> Any:
    options: dict[str, Any] = {"fastmath": fastmath, "parallel": parallel, "nogil": True, "error_model": "numpy"}
    options["no_cfunc_wrapper"] = True  # a second entry for C, which nobody calls
    options |= inlining
    try:
        cached = numba.njit(cache=True, **options)(function)
        reason = cache.keep(cached, function, repr(options | {"fastmath": sorted(fastmath)}))  # a set has any order
        if not reason:
            return cached
    except RuntimeError as error:  # numba: "cannot cache function ...: no locator available for file ..."
        if "cannot cache" not in str(error):
            raise
        reason = "no writable folder for compiled kernels"
    global _cache_reported
    if not _cache_reported:
        _cache_reported = True
        log.info("%s (set NUMBA_CACHE_DIR to one of your own): compiling in every process", reason)
    return numba.njit(cache=False, **options)(function)


def _notice_fork() -> None:
    global _forked_without_threads
    with contextlib.suppress(ValueError):  # no parallel kernel was loaded yet: the child starts threads of its own
        _forked_without_threads = numba.threading_layer() == "omp" and compiled()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_notice_fork)
    os.register_at_fork(after_in_child=compiling.waiters.clear)  # nothing in a child hears of its parent's helpers


def check_threads() -> None:
    """Refuse parallel kernels where they would end the process: in a child forked after their threads had started.

    The threads of GNU's OpenMP do not survive a fork; its library ends such a child without an exception, and a process
    pool then waits for ever.
    """
    if _forked_without_threads:
        raise FastcontactError(
            "this process was forked after its parent had started the threads of the compiled kernels, and those do not "
            "survive a fork: start processes by multiprocessing's 'spawn' or 'forkserver', or set "
            "NUMBA_THREADING_LAYER=workqueue"
        )


def compiled() -> bool:
    """Return whether kernels are compiled in this process: not where NUMBA_DISABLE_JIT is set."""
    return not getattr(numba.config, "DISABLE_JIT", False)


def set_threads(count: int) -> None:
    """Set the number of threads that parallel kernels use in this process."""
    numba.set_num_threads(count)


def threads() -> int:
    """Return the number of threads that parallel kernels use in this process."""
    return int(numba.get_num_threads())
