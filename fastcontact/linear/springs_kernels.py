# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Forces of springs along compressed rows."""

from fastcontact._jit.decorators import kernel


@kernel
def subtract(indptr, indices, data, stiffness, factor, u, r):
    """Subtract ``factor R.T (stiffness * (R u))`` from `r` (n,), R in compressed rows."""
    for q in range(stiffness.shape[0]):
        stretch = u[0] * 0
        for k in range(indptr[q], indptr[q + 1]):
            stretch += data[k] * u[indices[k]]
        force = factor * stiffness[q] * stretch
        for k in range(indptr[q], indptr[q + 1]):
            r[indices[k]] -= data[k] * force
