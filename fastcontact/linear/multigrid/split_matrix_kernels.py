# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Rows of a matrix whose double-precision numbers may be split into two of single precision, a high and a low part.

The sum of both parts has 48 of the 53 bits of double precision. Kernels receive numbers as a tuple: (high, low) if they are
split, otherwise (numbers,).
"""

from fastcontact._jit.decorators import kernel
from fastcontact.linear.multigrid.symmetric_storage_kernels import entry_of, part_of, slot_of


@kernel
def forces_at(dofs, indptr, indices, storage, K, factor, size, u, f, out):
    """Fill `out` (m,) with ``(factor K u - f)[dofs]``; the numbers of the block matrix K are a tuple."""
    for p in range(dofs.shape[0]):
        i, a = dofs[p] // size, dofs[p] % size
        s, part = 0.0, part_of(storage, i)
        for k in range(indptr[i], indptr[i + 1]):
            slot = slot_of(storage, part, i, indices[k], k)
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
            slot = slot_of(storage, part, i, indices[k], k)
            for b in range(size):
                out[at] = entry_of(K, slot, a, b, size)
                at += 1
