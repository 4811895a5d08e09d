# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Forward and backward substitution with the supernodal factors ``L D L.T`` of a symmetric matrix.

L (n, n) is lower triangular with a unit diagonal. It is stored by columns: column j is ``values[start[j] : start[j + 1]]``,
beginning with the diagonal. The columns ``first[s]`` to ``first[s + 1] - 1`` of supernode s have the same rows
``rows[row_start[s] : row_start[s + 1]]`` below their common diagonal block, which is full.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.decorators import interpretable_kernel, kernel, summing_kernel
from fastcontact.arrays import Array, Mask, Numbers

Offsets = NDArray[np.int64]

# Largest number of columns of L in one matrix product.
PANEL = 48


@interpretable_kernel
def copy_block(
    start: Offsets, values: Array, first: Offsets, row_start: Offsets, rows: Numbers, index: Offsets, out: Array
) -> None:
    """Copy the requested rows and columns of L to `out` (m, m), which is initially zero.

    `index` (n,) contains the index in `out` of each row and column, or -1 if it is not requested.
    """
    for s in range(len(first) - 1):
        high = first[s + 1]
        for j in range(first[s], high):
            if index[j] < 0:
                continue
            for i in range(j, high):
                if index[i] >= 0:
                    out[index[i], index[j]] = values[start[j] + i - j]
            for k in range(row_start[s], row_start[s + 1]):
                if index[rows[k]] >= 0:
                    out[index[rows[k]], index[j]] = values[start[j] + high - j + k - row_start[s]]


@interpretable_kernel
def forward(start: Offsets, values: Array, first: Offsets, row_start: Offsets, rows: Numbers, x: Array) -> None:
    """Replace x (n,) by ``L^-1 x``."""
    change = np.empty(len(x))
    for s in range(len(first) - 1):
        low, high = first[s], first[s + 1]
        below = row_start[s + 1] - row_start[s]
        j = low
        while j < high and x[j] == 0.0:  # right-hand sides are often sparse
            j += 1
        if j == high:
            continue
        change[:below] = 0.0
        for j in range(low, high):
            xj = x[j]
            entry = start[j] + 1
            for k in range(j + 1, high):
                x[k] -= values[entry] * xj
                entry += 1
            for k in range(below):
                change[k] += values[entry + k] * xj
        for k in range(below):
            x[rows[row_start[s] + k]] -= change[k]


@summing_kernel
def backward(
    start: Offsets, values: Array, first: Offsets, row_start: Offsets, rows: Numbers, prescribed: Mask, x: Array
) -> None:
    """Replace x (n,) by the solution of ``L.T y = x`` in which the entries `prescribed` (n,) keep their values.

    If entry j is prescribed, all entries in the rows of column j must be prescribed.
    """
    gathered = np.empty(len(x))
    for s in range(len(first) - 2, -1, -1):
        low, high = first[s], first[s + 1]
        j = high - 1
        while j >= low and prescribed[j]:
            j -= 1
        if j < low:
            continue
        below = row_start[s + 1] - row_start[s]
        for k in range(below):
            gathered[k] = x[rows[row_start[s] + k]]
        # Columns are processed in pairs that read the same entries of x. The last column may be single.
        while j >= low:
            single = j == low
            first_at = start[j] + 1
            second_at = first_at if single else start[j - 1] + 2
            first_sum, second_sum = 0.0, 0.0
            # The compiler vectorises loops over slices, whose entries are contiguous in memory.
            n = high - 1 - j
            a, b, x_inside = values[first_at : first_at + n], values[second_at : second_at + n], x[j + 1 : high]
            for k in range(n):
                first_sum += a[k] * x_inside[k]
                second_sum += b[k] * x_inside[k]
            a, b = values[first_at + n : first_at + n + below], values[second_at + n : second_at + n + below]
            for k in range(below):
                first_sum += a[k] * gathered[k]
                second_sum += b[k] * gathered[k]
            x[j] -= first_sum
            if not single:
                x[j - 1] -= second_sum + values[second_at - 1] * x[j]
            j -= 2


@kernel
def solve_together(
    start: Offsets, values: Array, first: Offsets, row_start: Offsets, rows: Numbers, d: Array, loaded: Mask, required: Mask,
    X: Array,
) -> None:  # fmt: skip
    """Replace the rows `required` of X (n, k) by those of ``(L D L.T)^-1 X``, for all k columns simultaneously.

    Only the rows `loaded` (n,) of X may have nonzero entries, and d (n,) is the diagonal of D. The forward substitution skips
    supernodes that are not affected by the rows `loaded`, and the backward substitution skips those that do not affect the
    rows `required` (n,); see `_affected_supernodes`. Both masks are overwritten, and the other rows of X are undefined
    afterwards.
    """
    max_rows = 0
    for s in range(len(first) - 1):
        max_rows = max(max_rows, first[s + 1] - first[s] + row_start[s + 1] - row_start[s])
    panel, below = np.empty(PANEL * max_rows), np.empty(max_rows, np.int64)
    panel_rows, product = np.empty((max_rows, X.shape[1])), np.empty((PANEL, X.shape[1]))
    affected = _affected_supernodes(first, row_start, rows, loaded)
    for s in range(len(affected)):
        for low in range(first[s], first[s + 1] if affected[s] else first[s], PANEL):
            high = min(low + PANEL, first[s + 1])
            for j in range(low, high):
                for i in range(j + 1, high):
                    X[i] -= values[start[j] + i - j] * X[j]
            size = _pack(start, values, low, high, first[s + 1], rows[row_start[s] : row_start[s + 1]], panel, below)
            np.dot(panel[: (high - low) * size].reshape(high - low, size).T, X[low:high], panel_rows[:size])
            for k in range(size):
                X[below[k]] -= panel_rows[k]
    affected = _affected_supernodes(first, row_start, rows, required)
    for s in range(len(affected) - 1, -1, -1):
        for high in range(first[s + 1], first[s] if affected[s] else first[s + 1], -PANEL):
            low = max(high - PANEL, first[s])
            size = _pack(start, values, low, high, first[s + 1], rows[row_start[s] : row_start[s + 1]], panel, below)
            for k in range(size):
                panel_rows[k] = X[below[k]]
            np.dot(panel[: (high - low) * size].reshape(high - low, size), panel_rows[:size], product[: high - low])
            for j in range(high - 1, low - 1, -1):
                X[j] = X[j] / d[j] - product[j - low]
                for i in range(j + 1, high):
                    X[j] -= values[start[j] + i - j] * X[i]


@kernel
def _affected_supernodes(first: Offsets, row_start: Offsets, rows: Numbers, marked: Mask) -> Mask:
    """Return which supernodes (n_supernodes,) contain `marked` columns (n,), or have descendants that do.

    Descendants and ancestors refer to the elimination tree. All ancestors of marked columns are marked as well.
    """
    affected = np.zeros(len(first) - 1, np.bool_)
    for s in range(len(affected)):
        affected[s] = marked[first[s] : first[s + 1]].any()
        if affected[s]:
            for k in range(row_start[s], row_start[s + 1]):
                marked[rows[k]] = True
    return affected


@kernel
def _pack(
    start: Offsets, values: Array, low: int, high: int, end: int, rows_below: Numbers, panel: Array, below: Offsets
) -> int:
    """Copy columns `low` to ``high - 1`` of L, from row `high` on, to `panel` one after the other; return their length.

    The row numbers are written to `below`. They are `high` to ``end - 1`` in the same supernode, followed by `rows_below`.
    """
    size = end - high + len(rows_below)
    for j in range(low, high):
        for k in range(size):
            panel[(j - low) * size + k] = values[start[j] + high - j + k]
    for k in range(size):
        below[k] = high + k if high + k < end else rows_below[high + k - end]
    return size
