# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Kernels for eliminated unknowns, ``x[pivots] = W x`` with a sparse matrix W (m, n) in CSR format.

W is given by `indptr`, `indices` and `weights`; it may have entries in the columns of pivots.
"""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def complete(pivots, indptr, indices, weights, x):
    """Set ``x[pivots]`` (m,) to ``W x`` for x (n,), in place."""
    sums = np.zeros(pivots.shape[0], x.dtype)
    for p in range(pivots.shape[0]):
        s = x[0] * 0
        for k in range(indptr[p], indptr[p + 1]):
            s += weights[k] * x[indices[k]]
        sums[p] = s
    for p in range(pivots.shape[0]):
        x[pivots[p]] = sums[p]


@kernel
def move_forces(pivots, indptr, indices, weights, r):
    """Move forces r (n,) from the pivots to the other unknowns, in place: ``r += W.T r[pivots]``, then ``r[pivots] = 0``."""
    forces = np.empty(pivots.shape[0], r.dtype)
    for p in range(pivots.shape[0]):
        forces[p] = r[pivots[p]]
        r[pivots[p]] = 0
    for p in range(pivots.shape[0]):
        for k in range(indptr[p], indptr[p + 1]):
            r[indices[k]] += weights[k] * forces[p]
