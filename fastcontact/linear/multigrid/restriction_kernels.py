# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Products with the transpose of a block matrix stored by rows.

The rows are divided into parts. Each part is summed in its own buffer, from its first to its last column; the buffers
are then added in the order of the parts, so that results do not depend on the number of threads.
"""

import numpy as np
from numba import prange

from fastcontact._jit.decorators import kernel, parallel_kernel
from fastcontact.linear.multigrid.block_products import add_row_transposed
from fastcontact.linear.multigrid.symmetric_storage_kernels import CHUNK, FIRST


@parallel_kernel
def reach(indptr, indices, ends, first, last):
    """Fill the first block column of each part and the one after its last; part p begins at row ``ends[p]``."""
    for p in prange(ends.shape[0] - 1):
        low, high = 2**30, 0
        for k in range(indptr[ends[p]], indptr[ends[p + 1]]):
            low = min(low, indices[k])
            high = max(high, indices[k] + 1)
        first[p], last[p] = min(low, high), high


@kernel
def _add_part(p, indptr, indices, data, ends, first, last, begin, x, work, rows, cols):
    n = len(cols)
    low = (begin[p] - first[p]) * n
    for e in range(begin[p] * n, (begin[p] + last[p] - first[p]) * n):
        work[e] = 0.0
    for i in range(ends[p], ends[p + 1]):
        add_row_transposed(indices, (data,), indptr[i], indptr[i + 1], i, x, work, low, rows, cols)


@kernel
def _gather(low, high, first, last, begin, work, y, cols):
    n = len(cols)
    for e in range(low * n, high * n):
        y[e] = 0.0
    for p in range(first.shape[0]):
        shift = (begin[p] - first[p]) * n
        for e in range(max(low, first[p]) * n, min(high, last[p]) * n):
            y[e] += work[shift + e]


@parallel_kernel
def multiply_transposed(indptr, indices, data, ends, first, last, begin, x, work, y, rows, cols):
    """Fill `y` (n_columns * n,) with ``P.T x``.

    Part p adds into the blocks of `work` from ``begin[p]`` on, for the columns ``first[p]`` to ``last[p] - 1``, see `reach`.
    """
    n_parts, n = ends.shape[0] - 1, y.shape[0] // len(cols)
    if n_parts == 1:
        _add_part(FIRST, indptr, indices, data, ends, first, last, begin, x, work, rows, cols)
        _gather(FIRST, n, first, last, begin, work, y, cols)
        return
    for p in prange(n_parts):
        _add_part(np.int64(p), indptr, indices, data, ends, first, last, begin, x, work, rows, cols)
    for c in prange((n + CHUNK - 1) // CHUNK):
        _gather(c * CHUNK, min(n, (c + 1) * CHUNK), first, last, begin, work, y, cols)
