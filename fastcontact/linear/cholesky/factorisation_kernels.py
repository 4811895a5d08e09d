# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Multifrontal factorisation ``L D L.T`` of a sparse symmetric positive definite matrix (Duff and Reid, 1983).

Every supernode assembles a dense frontal matrix from its own columns of the matrix and the update matrices of its children in
the elimination tree. Its columns are eliminated there, and the update matrix is passed to the parent.
Fronts are symmetric, and only their upper triangles count: row j of a front is column j of L. Subtrees in which the matrix
has not changed since the last factorisation keep their columns of L, and the update matrix that their root passes on.
"""

from __future__ import annotations

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, interpretable_kernel, kernel
from fastcontact.arrays import Array, Numbers
from fastcontact.linear.cholesky.triangular_kernels import PANEL, Offsets

# Smallest number of multiplications for which a product is passed to BLAS.
SMALL = 20_000


@interpretable_kernel
def room(parent: Numbers, first: Offsets, begin: Offsets) -> tuple[int, int]:
    """Return the size of the largest front, and the peak size of the stack of update matrices."""
    count = len(first) - 1
    front = most = used = top = 0
    left = np.empty(count, np.int64)  # supernodes whose update matrix is on the stack
    for s in range(count):
        below = begin[s + 1] - begin[s]
        front = max(front, (first[s + 1] - first[s] + below) ** 2)
        while top > 0 and first[s] <= parent[first[left[top - 1] + 1] - 1] < first[s + 1]:
            top -= 1
            used -= (begin[left[top] + 1] - begin[left[top]]) ** 2
        if below:
            left[top] = s
            top += 1
            used += below**2
            most = max(most, used)
    return front, most


@kernel
def plan(
    start: Numbers, values: Array, before: Array, order: Numbers, above: Offsets, first: Offsets, begin: Offsets,
    kept: Offsets, source: Offsets, target: Offsets,
) -> int:  # fmt: skip
    """Plan the factorisation of a matrix after that of a matrix with the same pattern; return the size of updates to keep.

    Parameters
    ----------
    start, order, first, begin
        See `factorise`.
    values, before : ndarray
        Entries of this matrix and of the previous one.
    above : ndarray of int (n_supernodes,)
        Parents of supernodes, or -1.
    kept : ndarray of int (n_supernodes,)
        Offsets of the update matrices that are kept from the last factorisation, or -1.
    source : ndarray of int (n_supernodes,)
        Filled with -1 for supernodes that are factorised, -2 for those below the root of a subtree that keeps its columns,
        and for the root itself with the offset of its update matrix.
    target : ndarray of int (n_supernodes,)
        Filled with the offsets of the update matrices to keep, those of the largest subtrees without a change, or -1.
    """
    count, size = len(above), 0
    changed = np.zeros(count, np.bool_)
    for s in range(count):
        for j in range(first[s], first[s + 1]):
            for k in range(start[order[j]], start[order[j] + 1]):
                changed[s] |= values[k] != before[k]
        if changed[s] and above[s] >= 0:
            changed[above[s]] = True
    for s in range(count - 1, -1, -1):
        root = above[s] < 0
        source[s], target[s] = -1, -1
        if not root and source[above[s]] != -1:
            source[s] = -2
        elif not changed[s]:
            source[s] = kept[s]
        if not changed[s] and (root or changed[above[s]]):
            target[s] = size
            size += (begin[s + 1] - begin[s]) ** 2
    return size


@kernel
def factorise(
    start: Numbers, rows: Numbers, values: Array, order: Numbers, position: Numbers, parent: Numbers, first: Offsets,
    begin: Offsets, below: Numbers, sizes: tuple[int, int], begins: Offsets,
    source: Offsets, last: tuple[Array, Array, Array], target: Offsets, updates: Array, L: Array, d: Array,
) -> int:  # fmt: skip
    """Fill L and `d` (n,); return the first column whose pivot, then in `d`, is not positive, or -1.

    Parameters
    ----------
    start, rows, values
        The matrix by columns, both triangles, in its original numbering; everything else is numbered as in
        `elimination_tree_kernels.postordered`.
    order, position : ndarray of int (n,)
        Elimination order and its inverse.
    parent : ndarray of int (n,)
        Elimination tree.
    first, begin, below
        Supernodes and the rows below them, as in `triangular_kernels`.
    sizes : (int, int)
        See `room`.
    begins : ndarray of int (n + 1,)
        Offsets of the columns of L.
    source, target : ndarray of int (n_supernodes,)
        See `plan`.
    last : (ndarray, ndarray, ndarray)
        L, `d` and `updates` of the last factorisation.
    updates : ndarray
        Filled with the update matrices to keep.
    L : ndarray
        Filled column by column, the unit diagonal first.
    d : ndarray (n,)
        Filled with the diagonal of D.
    """
    count = len(first) - 1
    front, waiting = np.empty(sizes[0]), np.empty(sizes[1])
    local, left = np.empty(len(order), np.int64), np.empty(count, np.int64)
    # Work space for a panel, its transpose and product.
    widest = 0
    for s in range(count):
        widest = max(widest, first[s + 1] - first[s] + begin[s + 1] - begin[s])
    one, other, product = np.empty(PANEL * widest), np.empty(PANEL * widest), np.empty(2 * PANEL * widest)
    top = used = 0
    for s in range(count):
        low, high, rest = first[s], first[s + 1], below[begin[s] : begin[s + 1]]
        m = len(rest)
        if source[s] == -1:
            size = high - low + m
            F = front[: size * size].reshape(size, size)
            _gather(start, rows, values, order, position, low, high, rest, local, F)
            while top > 0 and low <= parent[first[left[top - 1] + 1] - 1] < high:
                top -= 1
                child = below[begin[left[top]] : begin[left[top] + 1]]
                n = len(child)
                used -= n * n
                _add(waiting[used : used + n * n].reshape(n, n), child, local, F)
            bad = _eliminated(F, high - low, one, other, product)
            if bad >= 0:
                d[low + bad] = F[bad, bad]
                return low + bad
            _store(F, low, high - low, begins, L, d, waiting[used : used + m * m].reshape(m, m))
        else:
            _copy(last[0], begins[low], L, begins[low], begins[high] - begins[low])
            _copy(last[1], low, d, low, high - low)
            if source[s] == -2:
                continue
            _copy(last[2], source[s], waiting, used, m * m)
        if target[s] >= 0:
            _copy(waiting, used, updates, target[s], m * m)
        if m:
            left[top] = s
            top += 1
            used += m * m
    return -1


@kernel
def _copy(source: Array, at: int, target: Array, to: int, count: int) -> None:
    """Copy entries; assigning a slice would compile its error message as well, which takes seconds."""
    for k in range(count):
        target[to + k] = source[at + k]


@kernel
def _gather(
    start: Numbers, rows: Numbers, values: Array, order: Numbers, position: Numbers, low: int, high: int, rest: Numbers,
    local: Offsets, F: Array,
) -> None:  # fmt: skip
    """Fill a front with the columns `low` to ``high - 1`` of the matrix, and `local` with the positions of its rows."""
    width = high - low
    for i in range(len(F)):
        F[i, i:] = 0.0
    for k in range(width):
        local[low + k] = k
    for k in range(len(rest)):
        local[rest[k]] = width + k
    for j in range(low, high):
        for k in range(start[order[j]], start[order[j] + 1]):
            i = position[rows[k]]
            if i >= j:
                F[j - low, local[i]] = values[k]


@kernel
def _store(F: Array, low: int, width: int, begins: Offsets, L: Array, d: Array, rest: Array) -> None:
    """Move the eliminated columns of a front to L and `d`, and the update matrix to `rest` (m, m)."""
    size = len(F)
    for j in range(width):
        d[low + j] = F[j, j]
        at = begins[low + j]
        L[at] = 1.0
        for k in range(j + 1, size):
            L[at + k - j] = F[j, k]
    for i in range(size - width):
        for k in range(i, size - width):
            rest[i, k] = F[width + i, width + k]


@kernel
def _add(rest: Array, rows: Numbers, local: Offsets, F: Array) -> None:
    """Add the update matrix `rest` of a front, with `rows` (m,), to the parent's front (extend-add)."""
    m = len(rows)
    for i in range(m):
        target, source = F[local[rows[i]]], rest[i]
        for k in range(i, m):
            target[local[rows[k]]] += source[k]


@kernel
def _eliminated(F: Array, width: int, one: Array, other: Array, product: Array) -> int:
    """Eliminate the first `width` columns of a front; return the first without a positive pivot, or -1.

    The pivots remain on the diagonal, the columns of L to the right of it.
    """
    size = len(F)
    for begin in range(0, width, PANEL):
        end = min(begin + PANEL, width)
        for j in range(begin, end):
            pivot = F[j, j]
            if not pivot > 0.0:
                return j
            row = F[j]
            for i in range(j + 1, end):
                factor, target = row[i] / pivot, F[i]
                for k in range(i, size):
                    target[k] -= factor * row[k]
            for k in range(j + 1, size):
                row[k] /= pivot
        m = size - end
        if m:
            if (end - begin) * m * m < SMALL:
                _reduced_by_rows(F, begin, end)
            else:
                _reduced_by_blocks(F, begin, end, one, other, product)
    return -1


@inlined_kernel
def _reduced_by_rows(F: Array, begin: int, end: int) -> None:
    """Subtract the contribution of the columns `begin` to `end` of L from the rest of a front."""
    size = len(F)
    for j in range(begin, end):
        row, pivot = F[j], F[j, j]
        for i in range(end, size):
            factor, target = row[i] * pivot, F[i]
            for k in range(i, size):
                target[k] -= factor * row[k]


@kernel
def _reduced_by_blocks(F: Array, begin: int, end: int, one: Array, other: Array, product: Array) -> None:
    """Do the same as `_reduced_by_rows` by matrix products."""
    size, width = len(F), end - begin
    m = size - end
    plain, scaled = one[: m * width].reshape(m, width), other[: m * width].reshape(m, width)
    for j in range(width):
        row, pivot = F[begin + j], F[begin + j, begin + j]
        for i in range(m):
            plain[i, j] = row[end + i]
            scaled[i, j] = pivot * row[end + i]
    for low in range(0, m, 2 * PANEL):
        high = min(low + 2 * PANEL, m)
        change = product[: (high - low) * (m - low)].reshape(high - low, m - low)
        np.dot(scaled[low:high], plain[low:].T, change)
        for i in range(low, high):
            target, source = F[end + i], change[i - low]
            for k in range(i, m):
                target[end + k] -= source[k - low]
