"""Numbers in two halves: the nearest number in single precision, and in single precision what it misses.

Together both have 48 bits. They take the room of numbers in double precision, and the first half can be used alone where
single precision is enough. Kernels take them as a tuple (first, second), or (numbers,) where they are whole.
"""

import numpy as np
from numba import prange

from fastcontact._jit import inlined_kernel, kernel, parallel_kernel
from fastcontact.kernels.multigrid import ALONE, CHUNK, part


@inlined_kernel
def entry(numbers, k):
    """Return a number in double precision, whole or in halves."""
    if len(numbers) == 2:
        return np.float64(numbers[0][k]) + np.float64(numbers[-1][k])
    return np.float64(numbers[0][k])


@kernel
def split(factor, numbers, first, second):
    """Fill the halves of ``factor numbers``; `second` may be in the place of the beginning of `numbers`."""
    for k in range(numbers.shape[0]):
        number = factor * numbers[k]
        first[k] = number
        second[k] = number - np.float64(first[k])


@parallel_kernel
def join(factor, numbers, out):
    """Fill `out` with ``factor numbers``."""
    n = out.shape[0]
    for c in prange((n + CHUNK - 1) // CHUNK):
        for k in range(c * CHUNK, min(n, (c + 1) * CHUNK)):
            out[k] = factor * entry(numbers, k)


@kernel
def _dot(first, second, at, x, j, length):
    s = (np.float64(first[at]) + np.float64(second[at])) * x[j]
    for c in range(1, len(length)):
        s += (np.float64(first[at + c]) + np.float64(second[at + c])) * x[j + c]
    return s


@kernel
def _multiply(low, high, indptr, indices, first, second, x, factor, share, z, y, rows):
    m = len(rows)
    for i in range(low, high):
        if m == 3:
            s0 = s1 = s2 = 0.0
            for k in range(indptr[i], indptr[i + 1]):
                at, j = k * (m * m), indices[k] * m
                s0 += _dot(first, second, at, x, j, rows)
                s1 += _dot(first, second, at + m, x, j, rows)
                s2 += _dot(first, second, at + 2 * m, x, j, rows)
            y[3 * i] = part(share, z, 3 * i) + factor * s0
            y[3 * i + 1] = part(share, z, 3 * i + 1) + factor * s1
            y[3 * i + 2] = part(share, z, 3 * i + 2) + factor * s2
        else:
            for r in range(m):
                s = 0.0
                for k in range(indptr[i], indptr[i + 1]):
                    s += _dot(first, second, (k * m + r) * m, x, indices[k] * m, rows)
                y[m * i + r] = part(share, z, m * i + r) + factor * s


@parallel_kernel
def multiply(indptr, indices, first, second, x, factor, share, z, y, rows):
    """Fill `y` (n_rows * m,) with ``share z + factor A x``; see `multigrid.multiply`."""
    n = indptr.shape[0] - 1
    if n <= ALONE:
        _multiply(0, n, indptr, indices, first, second, x, factor, share, z, y, rows)
        return
    for c in prange((n + CHUNK - 1) // CHUNK):
        _multiply(c * CHUNK, min(n, (c + 1) * CHUNK), indptr, indices, first, second, x, factor, share, z, y, rows)
