# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Structure of the Cholesky factor of a sparse symmetric matrix: elimination tree, column counts, supernodes.

The matrix A (n, n) is given by columns, with both triangles: ``start`` (n + 1,) and ``rows`` (nnz,). In its elimination tree,
the parent of a column is the row of the first entry below the diagonal in this column of the factor. Roots have the parent -1
(Liu, 1990).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel
from fastcontact.arrays import Array, Mask, Numbers

Offsets = NDArray[np.int64]


@interpretable_kernel
def tree_and_counts(start: Numbers, rows: Numbers, parent: Numbers, count: Numbers) -> None:
    """Fill `parent` (n,) with the elimination tree, and `count` (n,) with the number of entries of each column of the factor.

    The entries of row i of the factor are in the columns on the paths in the tree from the entries of row i of A to i (Davis,
    2006, section 4.5). The number of entries of a column includes the diagonal.
    """
    visited = np.empty(len(parent), np.int32)  # for each column, the last row whose paths contain it
    for i in range(len(parent)):
        parent[i], count[i], visited[i] = -1, 1, i
        for k in range(start[i], start[i + 1]):
            j = rows[k]
            while j < i and visited[j] != i:
                if parent[j] == -1:
                    parent[j] = i
                count[j] += 1
                visited[j] = i
                j = parent[j]


@interpretable_kernel
def postorder_positions(parent: Numbers, position: Numbers) -> None:
    """Fill `position` (n,) with positions in a postorder: the columns of each subtree are contiguous, with its root last."""
    n = len(parent)
    # Columns of a subtree that have no position yet get positions below `end` of its root. The last entry is for the roots.
    size, end = np.ones(n, np.int32), np.empty(n + 1, np.int32)
    for j in range(n):
        if parent[j] != -1:
            size[parent[j]] += size[j]
    end[n] = n
    for j in range(n - 1, -1, -1):
        parent_or_n = parent[j] if parent[j] != -1 else n
        position[j] = end[j] = end[parent_or_n] - 1
        end[parent_or_n] -= size[j]


@interpretable_kernel
def supernodes(
    parent: Numbers, count: Numbers, marked: Mask, widths: Offsets, shares: Array, first: Offsets, n_below: Offsets
) -> int:
    """Find supernodes, which are sequences of columns with nearly the same rows below them, and return their number.

    Parameters
    ----------
    parent, count : ndarray of int (n,)
        Tree, and number of entries of each column, for columns numbered in postorder.
    marked : ndarray of bool (n,)
        Marked columns, which do not share supernodes with columns that are not marked.
    widths : ndarray (k,), shares : ndarray (k + 1,)
        Adjacent supernodes are merged if the fraction of explicit zeros in the result is at most ``shares[i]``, where
        ``widths[i]`` is the first of the ascending `widths` that is not smaller than the width of the result. The last share
        applies to all wider supernodes.
    first, n_below : ndarray of int (n + 1,)
        The first column of each supernode, followed by n, and the number of rows below each supernode; filled here.
    """
    n, top = len(parent), -1
    entries = np.empty(n, np.int64)  # of each supernode, without explicit zeros
    for j in range(n + 1):
        connected = 0 < j < n and parent[j - 1] == j and count[j - 1] == count[j] + 1 and marked[j - 1] == marked[j]
        if not connected:
            if top >= 0:
                top = _merge(parent, marked, widths, shares, first, n_below, entries, top, j)
            top += 1
            first[top] = j
            if j < n:
                entries[top] = 0
        if j < n:
            entries[top] += count[j]
            n_below[top] = count[j] - 1
    return top


@inlined_kernel
def _merge(
    parent: Numbers, marked: Mask, widths: Offsets, shares: Array, first: Offsets, n_below: Offsets, entries: Offsets,
    top: int, end: int,
) -> int:  # fmt: skip
    """Merge the supernode `top`, which ends before column `end`, with its predecessors while this adds few zeros."""
    while top > 0 and first[top] <= parent[first[top] - 1] < end and marked[first[top] - 1] == marked[first[top]]:
        width = end - first[top - 1]
        all_entries = width * (width + 1) // 2 + width * n_below[top]
        k = 0
        while k < len(widths) and width > widths[k]:
            k += 1
        if all_entries - entries[top - 1] - entries[top] > shares[k] * all_entries:
            break
        entries[top - 1] += entries[top]
        n_below[top - 1] = n_below[top]
        top -= 1
    return top


@interpretable_kernel
def rows_below(
    start: Numbers, rows: Numbers, order: Numbers, position: Numbers, parent: Numbers, first: Offsets, row_start: Offsets,
    row_indices: Numbers,
) -> None:  # fmt: skip
    """Fill `row_indices` with the rows below each supernode s in ascending order, beginning at ``row_start[s]``.

    The matrix has its original numbering. In all other arrays columns are numbered in postorder: column k of the factor is
    column ``order[k]`` of the matrix, and `position` is the inverse of `order`.
    """
    n, count = len(order), len(first) - 1
    supernode_of, last_row, next_entry = np.empty(n, np.int32), np.full(count, -1, np.int32), row_start[:count].copy()
    for s in range(count):
        supernode_of[first[s] : first[s + 1]] = s
    for i in range(n):
        # From each entry of the row, follow the tree to a supernode that was visited before, or to the diagonal.
        for k in range(start[order[i]], start[order[i] + 1]):
            j = position[rows[k]]
            if j >= i:
                continue
            s = supernode_of[j]
            while s != supernode_of[i] and last_row[s] != i:
                last_row[s] = i
                row_indices[next_entry[s]] = i
                next_entry[s] += 1
                s = supernode_of[parent[first[s + 1] - 1]]
