# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Double-precision numbers split into two of single precision, high and low.

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
            slot = place_of(storage, part, i, indices[k], k)
            for b in range(size):
                s += entry_of(K, slot, a, b, size) * u[indices[k] * size + b]
        out[p] = factor * s - f[dofs[p]]


@kernel
def rows_of(dofs, indptr, indices, storage, K, size, out):
    """Fill `out` with rows `dofs` (m,) of the block matrix K, one row after the other."""
    at = 0
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        part = part_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):
            slot = place_of(storage, part, i, indices[k], k)
            for b in range(size):
                out[at] = entry_of(K, slot, a, b, size)
                at += 1
