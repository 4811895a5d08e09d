"""Lemke's pivoting method for linear complementarity problems (Lemke, 1965).

It is slow, but it terminates after a finite number of pivots also if Newton's method does not converge.
"""

from __future__ import annotations

import numpy as np

from fastcontact.arrays import Array, Indices
from fastcontact.round_off import ROUND_OFF


def solved(M: Array, q: Array, most: int) -> tuple[Array | None, int]:
    """Return z (n,) with ``w = M z + q``, ``w >= 0``, ``z >= 0`` and ``w.T z = 0``.

    The pivots end with a solution if M is copositive, if ``q.T v >= 0`` for all solutions v of the homogeneous problem
    (q = 0), and if no basis is degenerate (Cottle, Pang and Stone, 1992, theorem 4.4.13).

    Parameters
    ----------
    M : ndarray (n, n)
    q : ndarray (n,)
    most : int
        Largest number of pivots.

    Returns
    -------
    z : ndarray (n,) or None
        The solution; None if the pivots end on a ray, or if their number exceeds `most`.
    count : int
        Number of pivots.
    """
    n, z = len(q), np.zeros(len(q))
    if not (q < 0.0).any():
        return z, 0
    # Rows: basic variables as affine functions of the nonbasic ones. The variable w_i has the number i, z_i the number n + i,
    # and the artificial variable the number 2 n.
    table = np.column_stack([M, np.ones(n), q])
    basic, others = np.arange(n), np.arange(n, 2 * n + 1)
    row, column = int(q.argmin()), n
    for count in range(1, most + 1):
        _exchange(table, row, column)
        leaving = int(basic[row])
        basic[row], others[column] = others[column], leaving
        if leaving == 2 * n:
            in_basis = basic >= n
            z[basic[in_basis] - n] = np.maximum(table[in_basis, -1], 0.0)
            return z, count
        column = int(np.flatnonzero(others == (leaving + n if leaving < n else leaving - n))[0])
        blocking = _blocking(table, basic, column)
        if blocking is None:
            return None, count
        row = blocking
    return None, most


def _exchange(table: Array, row: int, column: int) -> None:
    """Pivot in place: exchange the basic variable of `row` with the nonbasic variable of `column`."""
    at, factors = table[row, column], table[:, column].copy()
    table[:, column], factors[row] = 0.0, 0.0
    table[row] /= -at
    table[row, column] = 1.0 / at
    table += factors[:, None] * table[row]


def _blocking(table: Array, basic: Indices, column: int) -> int | None:
    """Return the row whose basic variable vanishes first as the nonbasic variable of `column` grows (ratio test).

    None if no basic variable decreases. Among rows with the same ratio, the row of the artificial variable has priority, then
    the row with the largest pivot.
    """
    slope = -table[:, column]
    falling = np.flatnonzero(slope > ROUND_OFF * np.abs(slope).max())
    if not len(falling):
        return None
    ratio = np.maximum(table[falling, -1], 0.0) / slope[falling]
    first = falling[ratio <= ratio.min() * (1.0 + ROUND_OFF)]
    artificial = first[basic[first] == 2 * len(basic)]
    return int(artificial[0] if len(artificial) else first[slope[first].argmax()])
