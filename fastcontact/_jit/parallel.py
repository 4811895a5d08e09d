"""Deterministic multithreading, whose results do not depend on the number of threads.

Compiled loops release the global interpreter lock, so that Python threads run them in parallel. Each thread computes separate
rows of a matrix or separate cells, and nothing is summed across threads.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache, wraps
from typing import Any, ParamSpec, TypeVar

from fastcontact._jit import decorators
from fastcontact.arrays import AnyArray

Result = TypeVar("Result")
Item = TypeVar("Item")
Parameters = ParamSpec("Parameters")
# Largest amount of work that a single thread completes sooner than several threads, since waking them takes 0.03 ms. Work is
# counted in nodes; a node takes about ten nanoseconds.
SINGLE_THREAD_WORK = 80_000
# Default number of nodes of a cell.
NODES_PER_CELL = 4
# Largest number of threads.
MAX_THREADS = 255


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the thread pool of this process, whose threads are created on demand and then reused."""
    return ThreadPoolExecutor(MAX_THREADS, "fastcontact")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not survive a fork


def parallel_map(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Result]:
    """Return the results of a function for all items: this thread computes the first one, other threads one each."""
    if len(items) == 1:
        return [function(items[0])]
    futures = [_pool().submit(function, item) for item in items[1:]]
    try:
        first = function(items[0])
    finally:
        wait(futures)  # also after an error, because other threads still use the arguments of this call
    return [first, *(future.result() for future in futures)]


def parallel_for(kernel: Any, count: int, work: float, *arguments: Any) -> None:
    """Call ``kernel(low, high, *arguments)`` for ranges that together cover 0 to `count`, each in a separate thread.

    `work` is the work per row or cell, see `portions`. It is 0 for rows that must be computed in order.
    """
    if count * work <= SINGLE_THREAD_WORK:
        kernel(0, count, *arguments)
    else:
        parallel_map(lambda portion: kernel(*portion, *arguments), portions(count, work))


@cache
def _thread_controller() -> Any:
    """Return the controller of the threads of numerical libraries."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def on_one_blas_thread(function: Callable[Parameters, Result]) -> Callable[Parameters, Result]:
    """Limit BLAS to one thread while a function runs.

    More threads would only busy-wait between the small calls of a contact iteration. Moreover, the number of threads
    would determine the order of summation, on which the round-off errors of results depend.
    """

    @wraps(function)
    def limited(*args: Parameters.args, **kwargs: Parameters.kwargs) -> Result:
        with _thread_controller().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def read_only(array: AnyArray) -> AnyArray:
    """Return a read-only view of an array, for kernels that are compiled for the read-only arrays of meshes."""
    view = array.view()
    view.flags.writeable = False
    return view


def portions(count: int, work: float = NODES_PER_CELL) -> list[tuple[int, int]]:
    """Return ranges of nearly equal size that cover 0 to `count`: one per thread, or a single one for little work.

    `work` is the work per cell, counted in nodes; a node takes about ten nanoseconds.
    """
    if count * work <= SINGLE_THREAD_WORK:
        return [(0, count)]
    n = min(decorators.threads(), MAX_THREADS, count)
    return list(itertools.pairwise(count * k // n for k in range(n + 1)))
