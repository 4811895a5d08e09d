# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Lemke's pivoting method for linear complementarity problems: slow, but finite where Newton's method does not converge."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def pivot(M, q, z, most):
    """Solve ``w = M z + q, w >= 0, z >= 0, w.T z = 0`` by complementary pivots from a ray (Lemke, 1965).

    They end with a solution if M is copositive, q not negative along the solutions of the problem without it, and no
    basis degenerate (Cottle, Pang and Stone, 1992, theorem 4.4.13).

    Parameters
    ----------
    M : (n, n)
    q : (n,)
    z : (n,)
        Filled with the solution, or with zeros.
    most : int
        Pivots allowed.

    Returns
    -------
    int
        Pivots made; negative if they ended on a ray or did not end.
    """
    n = len(q)
    z[:] = 0.0
    row = 0
    for i in range(n):
        if q[i] < q[row]:
            row = i
    if n == 0 or q[row] >= 0.0:
        return 0
    # Basic variables as functions of the others: w_i has the number i, z_i n + i, the artificial variable 2 n.
    table = np.empty((n, n + 2))
    table[:, :n] = M
    table[:, n] = 1.0
    table[:, n + 1] = q
    basic, others = np.arange(n), np.arange(n, 2 * n + 1)
    column = n
    for count in range(1, most + 1):
        _exchange(table, row, column)
        leaving = basic[row]
        basic[row], others[column] = others[column], leaving
        if leaving == 2 * n:
            for i in range(n):
                if basic[i] >= n:
                    z[basic[i] - n] = max(table[i, n + 1], 0.0)
            return count
        entering = leaving + n if leaving < n else leaving - n
        for j in range(n + 1):
            if others[j] == entering:
                column = j
        row = _blocking(table, basic, column)
        if row < 0:
            return -count
    return -most


@kernel
def _exchange(table, row, column):
    """Exchange a basic variable with another one."""
    n, width = table.shape
    at = table[row, column]
    for j in range(width):
        table[row, j] /= -at
    table[row, column] = 1.0 / at
    for i in range(n):
        factor = table[i, column]
        if i != row and factor != 0.0:
            table[i, column] = 0.0
            for j in range(width):
                table[i, j] += factor * table[row, j]


@kernel
def _blocking(table, basic, column):
    """Return the row whose variable vanishes first as that of the column grows, -1 if none does.

    Of equal ones that of the artificial variable, then that with the largest pivot.
    """
    n = len(basic)
    constant = table.shape[1] - 1
    size = 0.0
    for i in range(n):
        size = max(size, abs(table[i, column]))
    row, least = -1, np.inf
    for i in range(n):
        slope = -table[i, column]
        if slope <= 1e-12 * size:
            continue
        ratio = max(table[i, constant], 0.0) / slope
        nearer = ratio < least * (1.0 - 1e-12)
        if not nearer and ratio <= least * (1.0 + 1e-12) and basic[row] != 2 * n:
            nearer = basic[i] == 2 * n or slope > -table[row, column]
        if nearer:
            row, least = i, min(ratio, least)
    return row
