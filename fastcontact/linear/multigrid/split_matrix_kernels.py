# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Numbers split into a high part, the nearest number in single precision, and a low part, what that misses.

Together both parts have 48 of the 53 bits of double precision. Kernels take numbers as a tuple: (high, low) where they are
split, (numbers,) where they are not.
"""

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.symmetric_storage_kernels import entry_of, part_of, place_of


@kernel
def forces_at(dofs, indptr, indices, storage, K, factor, size, u, f, out):
    """Fill `out` (m,) with ``(factor K u - f)[dofs]``; the numbers of the block matrix K come as a tuple."""
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        s, part = 0.0, part_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):
            place = place_of(storage, part, i, indices[k], k)
            for b in range(size):
                s += entry_of(K, place, a, b, size) * u[indices[k] * size + b]
        out[p] = factor * s - f[dofs[p]]


@kernel
def forces_of(dofs, values, indptr, indices, storage, K, factor, size, out):
    """Add ``factor K[:, dofs] values`` for a symmetric K to `out` (n,)."""
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        part = part_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):
            place = place_of(storage, part, i, indices[k], k)
            for b in range(size):
                out[indices[k] * size + b] += factor * entry_of(K, place, a, b, size) * values[p]
