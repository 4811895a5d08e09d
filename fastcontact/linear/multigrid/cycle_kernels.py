# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Kernels of the multigrid cycle: products with block matrices, smoothing steps, and inverses of blocks.

A block matrix is passed as ``indptr`` (n_rows + 1,), ``indices`` (n_blocks,) and ``data`` (n_blocks * m * n,), see
`matrix.BlockMatrix`. The block size (m, n) is passed as two tuples of zeros, ``rows`` of length m and ``cols`` of length n,
because the compiler knows the lengths of tuples. Array views of blocks within the loops would cost four times as much.

Kernels with the arguments `low` and `high` compute the block rows from `low` to `high`, see `_jit.parallel.parallel_for`.
Each row is summed by one thread in a fixed order, so that results do not depend on the number of threads.
"""

import numpy as np

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.block_products import row_times


@kernel
def multiply(low, high, indptr, indices, entries, x, factor, z_factor, z, y, rows, cols):
    """Fill `y` (n_rows * m,) with ``z_factor * z + factor * A @ x``; z and y may be the same array.

    If `z_factor` is zero, z need not be initialised.

    `entries` contains the entries of A, as a tuple of one or two arrays, see `symmetric_storage_kernels`.
    """
    m = len(rows)
    for i in range(low, high):
        sums = row_times(indices, entries, x, indptr[i], indptr[i + 1], rows, cols)
        for r in range(m):
            y[m * i + r] = (z_factor * z[m * i + r] if z_factor != 0.0 else z_factor) + factor * sums[r]


@kernel
def relax(low, high, inverse, r, first, second, d, x, rows, from_zero):
    """Perform a step of the Chebyshev iteration, ``d = first * d + second * D^-1 r`` and ``x = x + d``, with the residual r.

    `inverse` (n_rows * m * m,) contains the inverses of the diagonal blocks D. If `first` is zero, d need not be initialised.
    If `from_zero` is true, the iteration starts at x = 0, and x need not be initialised (Saad, Iterative Methods for Sparse
    Linear Systems, 2003, algorithm 12.1).
    """
    m = len(rows)
    for i in range(low, high):
        for a in range(m):
            correction = inverse[(m * i + a) * m] * r[m * i]
            for c in range(1, m):
                correction += inverse[(m * i + a) * m + c] * r[m * i + c]
            step = second * correction
            if first != 0.0:
                step += first * d[m * i + a]
            d[m * i + a] = step
            if from_zero:
                x[m * i + a] = step
            else:
                x[m * i + a] += step


@kernel
def subtract_rows(low, high, row_numbers, indptr, indices, data, x, y, rows):
    """Subtract ``A x`` from the block rows `row_numbers` of `y`, in place, for a matrix A of square blocks.

    The `row_numbers` (n_rows,) must be distinct. `indices` contains the numbers of the blocks of x, and `data` the entries of
    A, as `entries` in `multiply`.
    """
    m = len(rows)
    for i in range(low, high):
        sums = row_times(indices, data, x, indptr[i], indptr[i + 1], rows, rows)
        for r in range(m):
            y[m * row_numbers[i] + r] -= sums[r]


@kernel
def invert_blocks(blocks, size, out):
    """Fill `out` (n * size * size,) with the inverses of symmetric positive semidefinite `blocks` (n * size * size,).

    Gauss-Jordan elimination skips unknowns without stiffness. Their rows and columns of the inverse are set to zero.
    """
    a = np.empty((size, 2 * size))
    for i in range(blocks.shape[0] // (size * size)):
        base = i * size * size
        largest = 0.0
        for r in range(size):
            largest = max(largest, blocks[base + r * size + r])
            for c in range(size):
                a[r, c] = blocks[base + r * size + c]
                a[r, size + c] = 1.0 if r == c else 0.0
        for p in range(size):
            pivot_before = blocks[base + p * size + p]
            idle = not (a[p, p] > 1e-10 * pivot_before and pivot_before > 1e-12 * largest)
            if idle:
                for k in range(size):
                    a[k, p] = a[k, size + p] = 0.0
                for k in range(2 * size):
                    a[p, k] = 0.0
                continue
            pivot = 1.0 / a[p, p]
            for k in range(2 * size):
                a[p, k] *= pivot
            for r in range(size):
                if r != p:
                    factor = a[r, p]
                    if factor != 0.0:
                        for k in range(2 * size):
                            a[r, k] -= factor * a[p, k]
        for r in range(size):
            for c in range(size):
                out[base + r * size + c] = a[r, size + c]
