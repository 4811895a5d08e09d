# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Pivots of equations in small groups, such as the normal and the tangential equations of a node."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def choose(indptr, indices, data, group, n_groups, n, smallest, pivots):
    """Choose an unknown for every equation among those that no other group has, by complete pivoting in each group.

    Parameters
    ----------
    indptr, indices, data : of the equations (m, n)
    group : (m,)
        Which group an equation belongs to, from 0 on.
    n_groups, n : int
    smallest : float
        A pivot is at least this part of the largest entry that its equation had.
    pivots : (m,)
        Filled.

    Returns
    -------
    int
        0, or 1 where a group has too few unknowns of its own.
    """
    owner = np.full(n, -1, np.int64)
    for i in range(len(group)):
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            owner[j] = group[i] if owner[j] == -1 or owner[j] == group[i] else -2
    start, rows = _by_group(group, n_groups)
    place = np.full(n, -1, np.int64)
    for g in range(n_groups):
        mine = rows[start[g] : start[g + 1]]
        longest = 0
        for i in mine:
            longest += indptr[i + 1] - indptr[i]
        found, table = np.empty(longest, np.int64), np.zeros((len(mine), longest))
        largest = np.zeros(len(mine))
        count = 0
        for r in range(len(mine)):
            for k in range(indptr[mine[r]], indptr[mine[r] + 1]):
                j = indices[k]
                largest[r] = max(largest[r], abs(data[k]))
                if owner[j] != g:
                    continue
                if place[j] < 0:
                    place[j] = count
                    found[count] = j
                    count += 1
                table[r, place[j]] += data[k]
        for c in range(count):
            place[found[c]] = -1
        if not _pivoted(table, found, count, smallest, largest, mine, pivots):
            return 1
    return 0


@kernel
def _by_group(group, n_groups):
    """Return where the equations of each group begin (n_groups + 1,), and all equations in this order (m,)."""
    start = np.zeros(n_groups + 1, np.int64)
    for g in group:
        start[g + 1] += 1
    for g in range(n_groups):
        start[g + 1] += start[g]
    rows, used = np.empty(len(group), np.int64), start[:-1].copy()
    for i in range(len(group)):
        rows[used[group[i]]] = i
        used[group[i]] += 1
    return start, rows


@kernel
def _pivoted(table, found, count, smallest, largest, mine, pivots):
    """Eliminate the rows of `table`, largest entry first; return whether every row has had a pivot."""
    done = np.zeros(len(mine), np.bool_)
    for _ in range(len(mine)):
        best, row, column = 0.0, -1, -1
        for r in range(len(mine)):
            if done[r]:
                continue
            for c in range(count):
                if abs(table[r, c]) > best:
                    best, row, column = abs(table[r, c]), r, c
        if row < 0 or best < smallest * largest[row]:
            return False
        done[row] = True
        pivots[mine[row]] = found[column]
        for r in range(len(mine)):
            if not done[r]:
                factor = table[r, column] / table[row, column]
                for c in range(count):
                    table[r, c] -= factor * table[row, c]
    return True
