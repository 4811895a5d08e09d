"""Deterministic multithreading: results do not depend on the number of threads.

Compiled loops release the interpreter lock, so that plain threads run them in parallel. Each thread has its own rows of a
matrix, or its own cells; there are no sums across threads.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache, wraps
from typing import Any, ParamSpec, TypeVar

import numpy as np

from fastcontact._jit import decorators
from fastcontact.arrays import AnyArray

Result = TypeVar("Result")
Part = TypeVar("Part")
Given = ParamSpec("Given")
# With fewer cells, of this number of nodes, threads cost more to start than they save.
WORTHWHILE, NODES = 20_000, 4
MOST = 255


def shared(work: Callable[[Part], Result], parts: Sequence[Part]) -> list[Result]:
    """Return the results of `work` on every part: the first runs in this thread, the others in one new thread each."""
    if len(parts) == 1:
        return [work(parts[0])]
    with ThreadPoolExecutor(len(parts) - 1) as pool:
        others = pool.map(work, parts[1:])
        return [work(parts[0]), *others]


@lru_cache(maxsize=1)
def _libraries() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()


def on_one_blas_thread(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Limit BLAS to one thread while a function runs: further threads spin between the small calls of a contact iteration.

    Besides, the number of threads determines the order of summation, and thus the last bits of a result.
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


def portions(count: int, nodes: int = NODES) -> list[tuple[int, int]]:
    """Return ranges of nearly equal size that cover 0 to `count`: one per thread, or a single one for little work.

    The work for each of the `count` cells grows with its number of `nodes`.
    """
    if count * nodes < WORTHWHILE * NODES:
        return [(0, count)]
    ends = np.linspace(0, count, min(decorators.threads(), MOST) + 1).astype(int).tolist()
    return list(itertools.pairwise(ends))
