# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Multifrontal factorisation ``L D L.T`` of a sparse symmetric positive definite matrix (Duff and Reid, 1983).

For each supernode, a dense frontal matrix is assembled from the columns of the supernode and the update matrices of its
children in the elimination tree. The columns of the supernode are eliminated in this front, and the remaining update matrix
is passed to the parent. Fronts are symmetric, and only their upper triangles are used, so that row j of a front becomes
column j of L. In subtrees in which the matrix has not changed since the last factorisation, the columns of L and the update
matrix of the root are reused.
"""

from __future__ import annotations

import numpy as np

from fastcontact._jit.decorators import innermost_kernel, interpretable_kernel, kernel
from fastcontact.arrays import Array, Numbers
from fastcontact.linear.cholesky.triangular_kernels import PANEL, Offsets

# Number of columns of L whose contributions are subtracted in one pass.
COLUMNS_PER_PASS = 4
# Smallest number of multiplications for which a matrix product is computed by BLAS.
BLAS_THRESHOLD = 20_000


@interpretable_kernel
def work_sizes(parent: Numbers, first: Offsets, row_start: Offsets) -> tuple[int, int]:
    """Return the number of entries of the largest front, and that of the stack of update matrices at its largest."""
    count = len(first) - 1
    largest_front = peak = used = top = 0
    stack_supernodes = np.empty(count, np.int64)  # supernodes whose update matrix is on the stack
    for s in range(count):
        below = row_start[s + 1] - row_start[s]
        largest_front = max(largest_front, (first[s + 1] - first[s] + below) ** 2)
        while top > 0 and first[s] <= parent[first[stack_supernodes[top - 1] + 1] - 1] < first[s + 1]:
            top -= 1
            used -= (row_start[stack_supernodes[top] + 1] - row_start[stack_supernodes[top]]) ** 2
        if below:
            stack_supernodes[top] = s
            top += 1
            used += below**2
            peak = max(peak, used)
    return largest_front, peak


@kernel
def plan(
    start: Numbers, values: Array, previous: Array, order: Numbers, supernode_parent: Offsets, first: Offsets,
    row_start: Offsets, previous_offsets: Offsets, reused_offsets: Offsets, saved_offsets: Offsets,
) -> int:  # fmt: skip
    """Plan the factorisation of a matrix with the pattern of the previous one; return the size of the updates to save.

    Parameters
    ----------
    start, order, first, row_start
        See `factorise`.
    values, previous : ndarray
        Entries of the new and of the previous matrix.
    supernode_parent : ndarray of int (n_supernodes,)
        Parent of each supernode, or -1.
    previous_offsets : ndarray of int (n_supernodes,)
        Offsets of the update matrices that were saved in the previous factorisation, or -1.
    reused_offsets : ndarray of int (n_supernodes,)
        Filled with -1 for supernodes that are factorised. In subtrees that are reused, the root is assigned the offset of
        its update matrix, and the other supernodes are assigned -2.
    saved_offsets : ndarray of int (n_supernodes,)
        Filled with the offsets of the update matrices to save, or -1. These are the update matrices of the roots of the
        largest subtrees without changes.
    """
    count, size = len(supernode_parent), 0
    changed = np.zeros(count, np.bool_)
    for s in range(count):
        for j in range(first[s], first[s + 1]):
            for k in range(start[order[j]], start[order[j] + 1]):
                changed[s] |= values[k] != previous[k]
        if changed[s] and supernode_parent[s] >= 0:
            changed[supernode_parent[s]] = True
    for s in range(count - 1, -1, -1):
        root = supernode_parent[s] < 0
        reused_offsets[s], saved_offsets[s] = -1, -1
        if not root and reused_offsets[supernode_parent[s]] != -1:
            reused_offsets[s] = -2
        elif not changed[s]:
            reused_offsets[s] = previous_offsets[s]
        if not changed[s] and (root or changed[supernode_parent[s]]):
            saved_offsets[s] = size
            size += (row_start[s + 1] - row_start[s]) ** 2
    return size


@kernel
def factorise(
    start: Numbers, rows: Numbers, values: Array, order: Numbers, position: Numbers, parent: Numbers, first: Offsets,
    row_start: Offsets, below: Numbers, sizes: tuple[int, int], column_start: Offsets,
    reused_offsets: Offsets, previous: tuple[Array, Array, Array], saved_offsets: Offsets, updates: Array, L: Array, d: Array,
) -> int:  # fmt: skip
    """Fill L and `d` (n,); return -1, or the first column whose pivot is not positive, with this pivot stored in `d`.

    Parameters
    ----------
    start, rows, values
        The matrix by columns, at least its lower triangle in the order of elimination. All other arguments are numbered in
        the postorder of `elimination_tree_kernels.postorder_positions`.
    order, position : ndarray of int (n,)
        Columns of the matrix in the order of elimination, and the inverse.
    parent : ndarray of int (n,)
        Elimination tree.
    first, row_start, below
        Supernodes and the rows below them, as in `triangular_kernels`.
    sizes : (int, int)
        See `work_sizes`.
    column_start : ndarray of int (n + 1,)
        Offsets of the columns of L.
    reused_offsets, saved_offsets : ndarray of int (n_supernodes,)
        See `plan`.
    previous : (ndarray, ndarray, ndarray)
        L, `d` and `updates` of the previous factorisation.
    updates : ndarray
        Filled with the update matrices to save.
    L : ndarray
        Filled column by column, the unit diagonal first.
    d : ndarray (n,)
        Filled with the diagonal of D.
    """
    count = len(first) - 1
    front, stack = np.empty(sizes[0]), np.empty(sizes[1])
    local, stack_supernodes = np.empty(len(order), np.int64), np.empty(count, np.int64)
    # Work arrays for a panel, for the panel multiplied by its pivots, and for the product of both.
    widest = 0
    for s in range(count):
        widest = max(widest, first[s + 1] - first[s] + row_start[s + 1] - row_start[s])
    panel, scaled_panel, product = np.empty(PANEL * widest), np.empty(PANEL * widest), np.empty(2 * PANEL * widest)
    top = used = 0
    for s in range(count):
        low, high, rows_below = first[s], first[s + 1], below[row_start[s] : row_start[s + 1]]
        m = len(rows_below)
        if reused_offsets[s] == -1:
            size = high - low + m
            F = front[: size * size].reshape(size, size)
            _gather(start, rows, values, order, position, low, high, rows_below, local, F)
            while top > 0 and low <= parent[first[stack_supernodes[top - 1] + 1] - 1] < high:
                top -= 1
                child = below[row_start[stack_supernodes[top]] : row_start[stack_supernodes[top] + 1]]
                n = len(child)
                used -= n * n
                _add(stack[used : used + n * n].reshape(n, n), child, local, F)
            failed = _eliminate_columns(F, high - low, panel, scaled_panel, product)
            if failed >= 0:
                d[low + failed] = F[failed, failed]
                return low + failed
            _store(F, low, high - low, column_start, L, d, stack[used : used + m * m].reshape(m, m))
        else:
            _copy(previous[0], column_start[low], L, column_start[low], column_start[high] - column_start[low])
            _copy(previous[1], low, d, low, high - low)
            if reused_offsets[s] == -2:
                continue
            _copy(previous[2], reused_offsets[s], stack, used, m * m)
        if saved_offsets[s] >= 0:
            _copy(stack, used, updates, saved_offsets[s], m * m)
        if m:
            stack_supernodes[top] = s
            top += 1
            used += m * m
    return -1


@kernel
def _copy(source: Array, source_start: int, target: Array, target_start: int, count: int) -> None:
    """Copy `count` entries; assigning a slice would compile its error message as well, which takes seconds."""
    for k in range(count):
        target[target_start + k] = source[source_start + k]


@kernel
def _gather(
    start: Numbers, rows: Numbers, values: Array, order: Numbers, position: Numbers, low: int, high: int, rows_below: Numbers,
    local: Offsets, F: Array,
) -> None:  # fmt: skip
    """Fill a front with the columns `low` to ``high - 1`` of the matrix, and `local` with the positions of its rows."""
    width = high - low
    for i in range(len(F)):
        F[i, i:] = 0.0
    for k in range(width):
        local[low + k] = k
    for k in range(len(rows_below)):
        local[rows_below[k]] = width + k
    for j in range(low, high):
        for k in range(start[order[j]], start[order[j] + 1]):
            i = position[rows[k]]
            if i >= j:
                F[j - low, local[i]] = values[k]


@kernel
def _store(F: Array, low: int, width: int, column_start: Offsets, L: Array, d: Array, update: Array) -> None:
    """Move the eliminated columns of a front to L and `d`, and the update matrix to `update` (m, m)."""
    size = len(F)
    for j in range(width):
        d[low + j] = F[j, j]
        at = column_start[low + j]
        L[at] = 1.0
        for k in range(j + 1, size):
            L[at + k - j] = F[j, k]
    for i in range(size - width):
        for k in range(i, size - width):
            update[i, k] = F[width + i, width + k]


@kernel
def _add(update: Array, rows: Numbers, local: Offsets, F: Array) -> None:
    """Add an `update` matrix (m, m) with the rows `rows` (m,) to the front F of the parent (extend-add operation)."""
    m = len(rows)
    for i in range(m):
        target, source = F[local[rows[i]]], update[i]
        for k in range(i, m):
            target[local[rows[k]]] += source[k]


@kernel
def _eliminate_columns(F: Array, width: int, panel: Array, scaled_panel: Array, product: Array) -> int:
    """Eliminate the first `width` columns of a front; return -1, or the first column whose pivot is not positive.

    The pivots remain on the diagonal, and the columns of L are stored to the right of the diagonal.
    """
    size = len(F)
    for begin in range(0, width, PANEL):
        end = min(begin + PANEL, width)
        for low in range(begin, end, COLUMNS_PER_PASS):
            high = min(low + COLUMNS_PER_PASS, end)
            for j in range(low, high):
                if not F[j, j] > 0.0:
                    return j
                _subtract(F, j, j + 1, j + 1, high, False)
            _subtract(F, low, high, high, end, False)
            for j in range(low, high):
                pivot = F[j, j]
                for k in range(j + 1, size):
                    F[j, k] /= pivot
        m = size - end
        if (end - begin) * m * m >= BLAS_THRESHOLD:
            _subtract_by_blocks(F, begin, end, panel, scaled_panel, product)
        else:
            for low in range(begin, end, COLUMNS_PER_PASS):
                _subtract(F, low, min(low + COLUMNS_PER_PASS, end), end, size, True)
    return -1


@innermost_kernel
def _subtract(F: Array, low: int, high: int, begin: int, end: int, scaled: bool) -> None:
    """Subtract the contribution of the columns `low` to ``high - 1`` of L from the rows `begin` to ``end - 1`` of a front.

    `scaled` is true if these columns have been divided by their pivots. One pass subtracts COLUMNS_PER_PASS columns.
    """
    size = len(F)
    for i in range(begin, end):
        if high - low == COLUMNS_PER_PASS:
            a, b = _factor(F, low, i, scaled), _factor(F, low + 1, i, scaled)
            c, d = _factor(F, low + 2, i, scaled), _factor(F, low + 3, i, scaled)
            for k in range(i, size):
                F[i, k] = F[i, k] - a * F[low, k] - b * F[low + 1, k] - c * F[low + 2, k] - d * F[low + 3, k]
        else:
            for j in range(low, high):
                factor = _factor(F, j, i, scaled)
                for k in range(i, size):
                    F[i, k] -= factor * F[j, k]


@innermost_kernel
def _factor(F: Array, j: int, i: int, scaled: bool) -> float:
    """Return the factor of row j in the elimination of row i."""
    return F[j, i] * F[j, j] if scaled else F[j, i] / F[j, j]


@kernel
def _subtract_by_blocks(F: Array, begin: int, end: int, panel: Array, scaled_panel: Array, product: Array) -> None:
    """Subtract the contribution of the columns `begin` to ``end - 1`` of L from the rows below by matrix products."""
    size, width = len(F), end - begin
    m = size - end
    unscaled, scaled = panel[: m * width].reshape(m, width), scaled_panel[: m * width].reshape(m, width)
    for j in range(width):
        row, pivot = F[begin + j], F[begin + j, begin + j]
        for i in range(m):
            unscaled[i, j] = row[end + i]
            scaled[i, j] = pivot * row[end + i]
    for low in range(0, m, 2 * PANEL):
        high = min(low + 2 * PANEL, m)
        change = product[: (high - low) * (m - low)].reshape(high - low, m - low)
        np.dot(scaled[low:high], unscaled[low:].T, change)
        for i in range(low, high):
            target, source = F[end + i], change[i - low]
            for k in range(i, m):
                target[end + k] -= source[k - low]
