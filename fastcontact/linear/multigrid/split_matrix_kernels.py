# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Numbers in two halves: the nearest number in single precision, and in single precision what it misses.

Together both have 48 bits. They take the room of numbers in double precision, and the first half can be used alone where
single precision is enough. Kernels take them as a tuple (first, second), or (numbers,) where they are whole.
"""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, kernel


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


@kernel
def join(factor, numbers, out):
    """Fill `out` with ``factor numbers``."""
    for k in range(out.shape[0]):
        out[k] = factor * entry(numbers, k)
