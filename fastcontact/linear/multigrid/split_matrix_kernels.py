# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Numbers split into a high part, the nearest number in single precision, and a low part, what that misses.

Together both parts have 48 of the 53 bits of double precision. Kernels take numbers as a tuple: (high, low) where they are
split, (numbers,) where they are not.
"""

import numpy as np

from fastcontact._jit.decorators import inlined_kernel, kernel


@inlined_kernel
def entry(numbers, k):
    """Return number `k` in double precision, split or not."""
    if len(numbers) == 2:
        return np.float64(numbers[0][k]) + np.float64(numbers[-1][k])
    return np.float64(numbers[0][k])


@kernel
def split(factor, numbers, high, low):
    """Fill the parts (n,) of ``factor numbers``; `low` may be in the place of the beginning of `numbers`."""
    for k in range(numbers.shape[0]):
        number = factor * numbers[k]
        high[k] = number
        low[k] = number - np.float64(high[k])


@kernel
def forces_at(dofs, indptr, indices, K, factor, size, u, f, out):
    """Fill `out` (m,) with ``(factor K u - f)[dofs]``; the numbers of the block matrix K come as a tuple."""
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        s = 0.0
        for k in range(indptr[i], indptr[i + 1]):
            for b in range(size):
                s += entry(K, (k * size + a) * size + b) * u[indices[k] * size + b]
        out[p] = factor * s - f[dofs[p]]


@kernel
def forces_of(dofs, values, indptr, indices, K, factor, size, out):
    """Add ``factor K[:, dofs] values`` for a symmetric K to `out` (n,)."""
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        for k in range(indptr[i], indptr[i + 1]):
            for b in range(size):
                out[indices[k] * size + b] += factor * entry(K, (k * size + a) * size + b) * values[p]
