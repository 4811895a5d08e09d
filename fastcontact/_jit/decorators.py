"""Decorators that compile kernels with a disk cache and strict floating-point arithmetic, and the number of threads.

Kernels are compiled at their first call, never at import. If there is no writable folder for the cache, they are compiled in
every process, and a line in the log states this.
"""

from __future__ import annotations

import gc
import logging
import os
from collections.abc import Callable
from typing import Any

from fastcontact._jit import environment  # isort: skip # noqa: F401 (before Numba)
import numba
from numba.core import event

from fastcontact._jit import cache, compiling, interpreting

log = logging.getLogger("fastcontact")

# No fast-math flags: operations are executed as written, without fused multiply-add. A kernel that is called by other kernels
# exists in several copies, one compiled separately and one inside each caller, with different optimisations. Which copy runs
# depends on the kernels that were compiled or loaded before. Only without flags are the results of all copies bitwise
# identical.
AS_WRITTEN: set[str] = set()
# Flags that permit vectorised sums, for kernels of which only one copy exists, because they neither call other kernels nor
# are called by them.
ANY_ORDER = {"contract", "reassoc"}

_cache_reported = False


class _Compilations(event.Listener):  # type: ignore[misc]
    """Listener for compilations of kernels; Numba raises no event for kernels that are read from the cache.

    Garbage collection is suspended during a compilation, because 60 collections would take a tenth of its time.
    """

    depth = 0  # nesting depth: the compilation of a kernel includes those of the kernels that it calls
    was_collecting = True

    def on_start(self, raised_event: Any) -> None:
        """Notify listeners and suspend garbage collection."""
        if getattr(raised_event.data["dispatcher"], "__module__", "").startswith("fastcontact."):
            compiling.notify()
            if self.depth == 0:
                self.was_collecting = gc.isenabled()
                gc.disable()
            self.depth += 1

    def on_end(self, raised_event: Any) -> None:
        """Resume garbage collection."""
        if getattr(raised_event.data["dispatcher"], "__module__", "").startswith("fastcontact."):
            self.depth -= 1
            if self.depth == 0 and self.was_collecting:
                gc.enable()


event.register("numba:compile", _Compilations())
# Set by NUMBA_NUM_THREADS, otherwise the number of processors.
_threads = int(getattr(numba.config, "NUMBA_NUM_THREADS", 1))


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` in nopython mode at its first call, with the disk cache if it is available."""
    return _compile(function)


def interpretable_kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` like `kernel`, but run small calls in Python until it is compiled, with bitwise identical results.

    The function may contain only sums, products, quotients and square roots, since powers and array sums have different
    round-off in NumPy. Other kernels cannot call it, since the returned object is not a Numba dispatcher.
    """
    dispatcher = kernel(function)
    return interpreting.InterpretableKernel(dispatcher, cache.files.get(function)) if jit_enabled() else dispatcher


def summing_kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` like `kernel`, with long sums of products vectorised in the same order in every run.

    The last bits of results may differ between processors, as with BLAS. The function must neither call other kernels nor be
    called by them.
    """
    return _compile(function, fastmath=ANY_ORDER)


def inlined_kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` like `kernel`, for parts of hot loops: Numba inlines the code at each call."""
    return _compile(function, inline="always")


def innermost_kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` like `kernel`, for innermost loops: LLVM inlines the machine code at each call.

    Small arrays then stay in registers, whereas `inlined_kernel` leaves them in memory.
    """
    return _compile(function, forceinline=True)


def _compile(function: Callable[..., Any], fastmath: set[str] = AS_WRITTEN, **inlining: Any) -> Any:
    options: dict[str, Any] = {"fastmath": fastmath, "nogil": True, "error_model": "numpy"}
    options["no_cfunc_wrapper"] = True  # without the entry point for C, which is not used
    options |= inlining
    dispatcher = numba.njit(**options)(function)
    # The flags are sorted, because the order of a set is arbitrary.
    reason = cache.attach_cache(dispatcher, function, repr(options | {"fastmath": sorted(fastmath)}))
    global _cache_reported
    if reason and not _cache_reported:
        _cache_reported = True
        log.info("%s (set NUMBA_CACHE_DIR to a folder of your own): compiling in every process", reason)
    return dispatcher


if hasattr(os, "register_at_fork"):  # the helpers of the parent do not report to a child
    os.register_at_fork(after_in_child=compiling.waiters.clear)


def jit_enabled() -> bool:
    """Return whether kernels are compiled in this process, that is, unless NUMBA_DISABLE_JIT is set."""
    return not getattr(numba.config, "DISABLE_JIT", False)


def set_threads(count: int) -> None:
    """Set the number of threads that kernels use in this process."""
    global _threads
    _threads = count


def threads() -> int:
    """Return the number of threads that kernels use in this process."""
    return _threads
