# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Products with the transpose of a block matrix stored by rows.

The rows are divided into parts. Each part is summed in its own buffer, from its first to its last column; the buffers
are then added in the order of the parts, so that results do not depend on the number of threads.
"""

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.block_products import add_row_transposed


@kernel
def reach(indptr, indices, ends, first, last):
    """Fill the first block column of each part and the one after its last; part p begins at row ``ends[p]``."""
    for p in range(ends.shape[0] - 1):
        low, high = 2**30, 0
        for k in range(indptr[ends[p]], indptr[ends[p + 1]]):
            low = min(low, indices[k])
            high = max(high, indices[k] + 1)
        first[p], last[p] = min(low, high), high


@kernel
def add_parts(low, high, indptr, indices, data, ends, first, last, begin, x, work, rows, cols):
    """Fill the buffers of parts `low` to ``high - 1`` with products of their rows with x.

    The buffer of part p consists of the blocks of `work` from ``begin[p]`` on, for the columns ``first[p]`` to
    ``last[p] - 1``, see `reach`.
    """
    n = len(cols)
    for p in range(low, high):
        shift = (begin[p] - first[p]) * n
        for e in range(begin[p] * n, (begin[p] + last[p] - first[p]) * n):
            work[e] = 0.0
        for i in range(ends[p], ends[p + 1]):
            add_row_transposed(indices, (data,), indptr[i], indptr[i + 1], i, x, work, shift, rows, cols)


@kernel
def gather(low, high, first, last, begin, work, y, cols):
    """Fill blocks `low` to ``high - 1`` of `y` (n_columns * n,) with the sums of the buffers of `add_parts`."""
    n = len(cols)
    for e in range(low * n, high * n):
        y[e] = 0.0
    for p in range(first.shape[0]):
        shift = (begin[p] - first[p]) * n
        for e in range(max(low, first[p]) * n, min(high, last[p]) * n):
            y[e] += work[shift + e]
