"""Deterministic multithreading: results do not depend on the number of threads.

Compiled loops release the interpreter lock, so that plain threads run them in parallel. Each thread has its own rows of a
matrix, or its own cells; there are no sums across threads.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache, lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

from fastcontact._jit import decorators
from fastcontact.arrays import AnyArray

Result = TypeVar("Result")
Part = TypeVar("Part")
Given = ParamSpec("Given")
# Work up to which waking other threads (0.03 ms) costs more than they save, and the default number of nodes of a cell.
WORTHWHILE, NODES = 80_000, 4
MOST = 255


@cache
def _pool() -> ThreadPoolExecutor:
    """Return the threads of this process, which are created as they are needed and then kept."""
    return ThreadPoolExecutor(MOST, "fastcontact")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)  # threads do not survive a fork


def shared(work: Callable[[Part], Result], parts: Sequence[Part]) -> list[Result]:
    """Return the results of `work` on every part: the first runs in this thread, the others in one more thread each."""
    if len(parts) == 1:
        return [work(parts[0])]
    others = [_pool().submit(work, part) for part in parts[1:]]
    try:
        first = work(parts[0])
    finally:
        wait(others)  # they use the arguments of this call
    return [first, *(other.result() for other in others)]


def spread(kernel: Any, count: int, work: float, *arguments: Any) -> None:
    """Call ``kernel(low, high, *arguments)`` for ranges that together cover 0 to `count`, each in a thread.

    `work` is the work per row or cell, see `portions`; 0 for rows that must be computed in order.
    """
    if count * work <= WORTHWHILE:
        kernel(0, count, *arguments)
    else:
        shared(lambda portion: kernel(*portion, *arguments), portions(count, work))


@lru_cache(maxsize=1)
def _libraries() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def on_one_blas_thread(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Limit BLAS to one thread while a function runs.

    Further threads spin between the small calls of a contact iteration. The number of threads also determines the order of
    summation, and thus the last bits of a result.
    """

    @wraps(function)
    def limited(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        with _libraries().limit(limits=1, user_api="blas"):
            return function(*args, **kwargs)

    return limited


def read_only(numbers: AnyArray) -> AnyArray:
    """Return a view that cannot be written, as the arrays of a mesh are: kernels are compiled for either kind."""
    view = numbers.view()
    view.flags.writeable = False
    return view


def portions(count: int, work: float = NODES) -> list[tuple[int, int]]:
    """Return ranges of nearly equal size that cover 0 to `count`: one per thread, or a single one for little work.

    `work` is the work per cell, counted in nodes; a node takes some ten nanoseconds.
    """
    if count * work <= WORTHWHILE:
        return [(0, count)]
    n = min(decorators.threads(), MOST, count)
    return list(itertools.pairwise(count * k // n for k in range(n + 1)))
