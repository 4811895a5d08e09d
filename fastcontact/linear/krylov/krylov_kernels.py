# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Vector operations of conjugate gradients: sums in fixed chunks, equal for any number of threads."""

from numba import prange

from fastcontact._jit.decorators import kernel, parallel_kernel

# Length of the chunks.
CHUNK = 4096


@kernel
def stretch_dot(a, b, low, high):
    """Return the dot product of a stretch, in four sums that the processor can add side by side."""
    s0 = s1 = s2 = s3 = 0.0
    unrolled_end = low + (high - low) // 4 * 4
    for i in range(low, unrolled_end, 4):
        s0 += a[i] * b[i]
        s1 += a[i + 1] * b[i + 1]
        s2 += a[i + 2] * b[i + 2]
        s3 += a[i + 3] * b[i + 3]
    for i in range(unrolled_end, high):
        s0 += a[i] * b[i]
    return (s0 + s1) + (s2 + s3)


@kernel
def _total(sums):
    total = 0.0
    for k in range(sums.shape[0]):
        total += sums[k]
    return total


@parallel_kernel
def dot(a, b, sums):
    """Return the dot product of `a` and `b` (n,); `sums` (ceil(n / CHUNK),) is work space."""
    n = a.shape[0]
    for c in prange(sums.shape[0]):
        sums[c] = stretch_dot(a, b, c * CHUNK, min(n, (c + 1) * CHUNK))
    return _total(sums)


@kernel
def _advance_part(alpha, p, q, x, r, low, high):
    for i in range(low, high):
        x[i] += alpha * p[i]
        r[i] -= alpha * q[i]
    return stretch_dot(r, r, low, high)


@parallel_kernel
def advance(alpha, p, q, x, r, sums):
    """Step ``x += alpha p``, ``r -= alpha q`` and return the square of the norm of r."""
    n = x.shape[0]
    for c in prange(sums.shape[0]):
        sums[c] = _advance_part(alpha, p, q, x, r, c * CHUNK, min(n, (c + 1) * CHUNK))
    return _total(sums)


@parallel_kernel
def turn(beta, z, p):
    """Update the search direction: ``p = z + beta p``."""
    for i in prange(p.shape[0]):
        p[i] = z[i] + beta * p[i]


@parallel_kernel
def scaled(factor, a, b):
    """Fill `b` with ``factor a``, in the precision of b."""
    for i in prange(a.shape[0]):
        b[i] = factor * a[i]
