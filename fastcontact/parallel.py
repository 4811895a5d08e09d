"""Work shared by threads, with the same bits whatever their number.

Compiled loops release the interpreter, so plain threads run them side by side. Each has its own rows of a matrix, or its
own cells; nothing is added across threads.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from fastcontact import _jit

Result = TypeVar("Result")
# With fewer cells the start of threads costs more than they save.
WORTHWHILE = 20_000


def shared(work: Callable[[tuple[int, int]], Result], ranges: Sequence[tuple[int, int]]) -> list[Result]:
    """Return the results of `work` on every range, each in a thread of its own."""
    if len(ranges) == 1:
        return [work(ranges[0])]
    with ThreadPoolExecutor(len(ranges)) as pool:
        return list(pool.map(work, ranges))


def portions(count: int) -> list[tuple[int, int]]:
    """Return ranges of nearly equal size that cover 0 to `count`: one a thread, or one for little work."""
    n = _jit.threads() if count >= WORTHWHILE else 1
    ends = np.linspace(0, count, n + 1).astype(int).tolist()
    return list(itertools.pairwise(ends))


def ranges(indptr: NDArray[Any], count: int) -> list[tuple[int, int]]:
    """Return ranges of a sparse matrix's entries that hold whole rows: one a thread, or one for fewer cells."""
    n = _jit.threads() if count >= WORTHWHILE else 1
    rows = np.linspace(0, len(indptr) - 1, n + 1).astype(int)
    ends = np.asarray(indptr)[rows].tolist()
    return list(itertools.pairwise(ends))
