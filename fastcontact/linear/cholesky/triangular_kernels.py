# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Triangular solutions with the factors of a symmetric matrix, supernode by supernode.

L (n, n) is lower triangular with a unit diagonal, column by column: `start` (n + 1,) and `values`, the diagonal first.
The columns ``first[s]`` to ``first[s + 1] - 1`` of supernode s share the rows ``rows[begin[s] : begin[s + 1]]`` below
them; their diagonal block is full.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.decorators import interpretable_kernel, summing_kernel
from fastcontact.arrays import Array, Mask, Numbers

Offsets = NDArray[np.int64]


@interpretable_kernel
def block(
    start: Offsets, values: Array, first: Offsets, begin: Offsets, rows: Numbers, wanted: Offsets, out: Array
) -> None:
    """Fill `out` (m, m), initially zero, with the rows and columns of L numbered by `wanted` (n,), which is -1 for others."""
    for s in range(len(first) - 1):
        high = first[s + 1]
        for j in range(first[s], high):
            if wanted[j] < 0:
                continue
            for i in range(j, high):
                if wanted[i] >= 0:
                    out[wanted[i], wanted[j]] = values[start[j] + i - j]
            for k in range(begin[s], begin[s + 1]):
                if wanted[rows[k]] >= 0:
                    out[wanted[rows[k]], wanted[j]] = values[start[j] + high - j + k - begin[s]]


@interpretable_kernel
def forward(start: Offsets, values: Array, first: Offsets, begin: Offsets, rows: Numbers, x: Array) -> None:
    """Replace x (n,) by ``L^-1 x``."""
    moved = np.empty(len(x))
    for s in range(len(first) - 1):
        low, high = first[s], first[s + 1]
        below = begin[s + 1] - begin[s]
        j = low
        while j < high and x[j] == 0.0:  # loads are often few
            j += 1
        if j == high:
            continue
        moved[:below] = 0.0
        for j in range(low, high):
            xj = x[j]
            at = start[j] + 1
            for k in range(j + 1, high):
                x[k] -= values[at] * xj
                at += 1
            for k in range(below):
                moved[k] += values[at + k] * xj
        for k in range(below):
            x[rows[begin[s] + k]] -= moved[k]


@summing_kernel
def backward(
    start: Offsets, values: Array, first: Offsets, begin: Offsets, rows: Numbers, given: Mask, x: Array
) -> None:
    """Replace x (n,) by the solution of ``L.T y = x`` in which the entries `given` (n,) keep their values.

    The given unknowns must be closed under dependence: with j given, so are all rows of column j.
    """
    gathered = np.empty(len(x))
    for s in range(len(first) - 2, -1, -1):
        low, high = first[s], first[s + 1]
        j = high - 1
        while j >= low and given[j]:
            j -= 1
        if j < low:
            continue
        below = begin[s + 1] - begin[s]
        for k in range(below):
            gathered[k] = x[rows[begin[s] + k]]
        # Two columns are processed at a time, which share the loads of the vector; the last column may be single.
        while j >= low:
            single = j == low
            one = start[j] + 1
            other = one if single else start[j - 1] + 2
            first_sum, second_sum = 0.0, 0.0
            # Slices show the compiler that entries are contiguous.
            n = high - 1 - j
            a, b, beside = values[one : one + n], values[other : other + n], x[j + 1 : high]
            for k in range(n):
                first_sum += a[k] * beside[k]
                second_sum += b[k] * beside[k]
            a, b = values[one + n : one + n + below], values[other + n : other + n + below]
            for k in range(below):
                first_sum += a[k] * gathered[k]
                second_sum += b[k] * gathered[k]
            x[j] -= first_sum
            if not single:
                x[j - 1] -= second_sum + values[other - 1] * x[j]
            j -= 2
