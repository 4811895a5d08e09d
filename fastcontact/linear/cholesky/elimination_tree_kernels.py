# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Structure of the Cholesky factor of a sparse symmetric matrix: elimination tree, column counts, supernodes.

The matrix A (n, n) is given by columns, with both triangles: ``start`` (n + 1,) and ``rows`` (nnz,). In its elimination tree,
the parent of a column is the row of the first entry below the diagonal in this column of the factor, -1 for roots (Liu,
1990).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel
from fastcontact.arrays import Array, Mask, Numbers

Offsets = NDArray[np.int64]


@interpretable_kernel
def parents(start: Numbers, rows: Numbers, parent: Numbers) -> None:
    """Fill `parent` (n,) with the elimination tree."""
    n = len(parent)
    ancestor = np.full(n, -1, np.int32)  # like the parent, but with path compression
    for j in range(n):
        parent[j] = -1
        for k in range(start[j], start[j + 1]):
            i = rows[k]
            while i != -1 and i < j:
                above = ancestor[i]
                ancestor[i] = j
                if above == -1:
                    parent[i] = j
                i = above


@interpretable_kernel
def postordered(parent: Numbers, order: Numbers) -> None:
    """Fill `order` (n,) with a postorder: columns of each subtree are contiguous, with children before their parent."""
    n, count = len(parent), 0
    first, sibling, stack = np.full(n, -1, np.int32), np.full(n, -1, np.int32), np.empty(n, np.int32)
    for j in range(n - 1, -1, -1):
        if parent[j] != -1:
            sibling[j] = first[parent[j]]
            first[parent[j]] = j
    for root in range(n):
        if parent[root] != -1:
            continue
        stack[0], top = root, 0
        while top >= 0:
            child = first[stack[top]]
            if child == -1:
                order[count] = stack[top]
                count += 1
                top -= 1
            else:
                first[stack[top]] = sibling[child]
                top += 1
                stack[top] = child


@interpretable_kernel
def counts(start: Numbers, rows: Numbers, parent: Numbers, order: Numbers, count: Numbers) -> None:
    """Fill `count` (n,) with the number of entries of each column of the factor, including the diagonal.

    `order` (n,) is the result of `postordered`. The algorithm counts leaves of row subtrees (Gilbert, Ng and Peyton, 1994).
    """
    n = len(parent)
    first, farthest, last = np.full(n, -1, np.int32), np.full(n, -1, np.int32), np.full(n, -1, np.int32)
    ancestor = np.arange(n).astype(np.int32)
    for k in range(n):
        j = order[k]
        count[j] = 1 if first[j] == -1 else 0
        while j != -1 and first[j] == -1:
            first[j] = k
            j = parent[j]
    for k in range(n):
        j = order[k]
        if parent[j] != -1:
            count[parent[j]] -= 1
        for at in range(start[j], start[j + 1]):
            i = rows[at]
            if i <= j or first[j] <= farthest[i]:
                continue
            # Column j is a leaf of the subtree of row i; its common path with the previous leaf counts once.
            farthest[i] = first[j]
            before, last[i] = last[i], j
            count[j] += 1
            if before != -1:
                count[_root(before, ancestor)] -= 1
        if parent[j] != -1:
            ancestor[j] = parent[j]
    for j in range(n):
        if parent[j] != -1:
            count[parent[j]] += count[j]


@inlined_kernel
def _root(j: int, ancestor: Numbers) -> int:
    """Return the root of the set of j, with path compression."""
    root = j
    while root != ancestor[root]:
        root = ancestor[root]
    while j != root:
        above = ancestor[j]
        ancestor[j] = root
        j = above
    return root


@interpretable_kernel
def supernodes(
    parent: Numbers, count: Numbers, given: Mask, widths: Offsets, shares: Array, first: Offsets, below: Offsets
) -> int:
    """Find supernodes, which are sequences of columns with nearly the same rows below them; return their number.

    Parameters
    ----------
    parent, count : ndarray of int (n,)
        Tree, and number of entries of each column, for columns numbered in postorder.
    given : ndarray of bool (n,)
        Marked columns, which do not share supernodes with columns that are not marked.
    widths : ndarray (k,), shares : ndarray (k + 1,)
        Adjacent supernodes are merged if the fraction of explicit zeros in the result is at most ``shares[i]``, i the
        first of the ascending `widths` not smaller than the width of the result. The last share applies to all wider ones.
    first, below : ndarray of int (n + 1,)
        Filled with the first column of each supernode, followed by n, and with the number of rows below each supernode.
    """
    n, top = len(parent), -1
    entries = np.empty(n, np.int64)
    for j in range(n + 1):
        continues = 0 < j < n and parent[j - 1] == j and count[j - 1] == count[j] + 1 and given[j - 1] == given[j]
        if not continues:
            if top >= 0:
                top = _merged(parent, given, widths, shares, first, below, entries, top, j)
            top += 1
            first[top] = j
            if j < n:
                entries[top] = 0
        if j < n:
            entries[top] += count[j]
            below[top] = count[j] - 1
    return top


@inlined_kernel
def _merged(
    parent: Numbers, given: Mask, widths: Offsets, shares: Array, first: Offsets, below: Offsets, entries: Offsets,
    top: int, end: int,
) -> int:  # fmt: skip
    """Merge the supernode `top`, which ends before column `end`, with its predecessors as long as this adds few zeros."""
    while top > 0 and first[top] <= parent[first[top] - 1] < end and given[first[top] - 1] == given[first[top]]:
        width = end - first[top - 1]
        all_entries = width * (width + 1) // 2 + width * below[top]
        k = 0
        while k < len(widths) and width > widths[k]:
            k += 1
        if all_entries - entries[top - 1] - entries[top] > shares[k] * all_entries:
            break
        entries[top - 1] += entries[top]
        below[top - 1] = below[top]
        top -= 1
    return top


@interpretable_kernel
def rows_below(
    start: Numbers, rows: Numbers, order: Numbers, position: Numbers, parent: Numbers, first: Offsets, row_start: Offsets,
    row_indices: Numbers,
) -> None:  # fmt: skip
    """Fill `row_indices` with the rows below each supernode s in ascending order, from ``row_start[s]``.

    The matrix has its original numbering. In all other arrays columns are numbered in postorder: column k of the factor is
    column ``order[k]`` of the matrix, and `position` is the inverse of `order`.
    """
    n, count = len(order), len(first) - 1
    members, last_row, at = np.empty(n, np.int32), np.full(count, -1, np.int32), row_start[:count].copy()
    for s in range(count):
        members[first[s] : first[s + 1]] = s
    for i in range(n):
        # From each entry of the row, follow the tree to a supernode that was visited before, or to the diagonal.
        for k in range(start[order[i]], start[order[i] + 1]):
            j = position[rows[k]]
            if j >= i:
                continue
            s = members[j]
            while s != members[i] and last_row[s] != i:
                last_row[s] = i
                row_indices[at[s]] = i
                at[s] += 1
                s = members[parent[first[s + 1] - 1]]
