# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Vector operations of the conjugate gradient method, with sums that do not depend on the number of threads.

Sums are taken over chunks of fixed length. Kernels process the chunks, or the entries, `low` to ``high - 1``; see
`_jit.parallel.parallel_for`.
"""

from fastcontact._jit.decorators import kernel

# Length of the chunks.
CHUNK = 4096
# Work of kernels per entry, see `_jit.parallel.portions`.
WORK_PER_ENTRY = 0.5


@kernel
def range_dot(a, b, low, high):
    """Return the dot product of the entries `low` to ``high - 1``, computed as four independent partial sums."""
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
def total(sums):
    """Return the total of the `sums` of the chunks, which are added in the order of the chunks."""
    result = 0.0
    for k in range(sums.shape[0]):
        result += sums[k]
    return result


@kernel
def dot(low, high, a, b, sums):
    """Fill `sums` (ceil(n / CHUNK),) with the dot products of the chunks of `a` and `b` (n,)."""
    n = a.shape[0]
    for c in range(low, high):
        sums[c] = range_dot(a, b, c * CHUNK, min(n, (c + 1) * CHUNK))


@kernel
def advance(low, high, alpha, p, q, x, r, sums):
    """Update ``x += alpha p`` and ``r -= alpha q``, and fill `sums` with the squared norms of the chunks of r."""
    n = x.shape[0]
    for c in range(low, high):
        begin, end = c * CHUNK, min(n, (c + 1) * CHUNK)
        for i in range(begin, end):
            x[i] += alpha * p[i]
            r[i] -= alpha * q[i]
        sums[c] = range_dot(r, r, begin, end)


@kernel
def direction(low, high, beta, z, p):
    """Update the search direction, ``p = z + beta p``."""
    for i in range(low, high):
        p[i] = z[i] + beta * p[i]


@kernel
def scaled(low, high, factor, a, b):
    """Fill `b` with ``factor * a``, in the precision of b."""
    for i in range(low, high):
        b[i] = factor * a[i]
