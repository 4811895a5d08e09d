# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Eliminated unknowns in long vectors: ``x[pivots] = W x``, W in compressed rows that may involve pivots."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def complete(pivots, indptr, indices, weights, x):
    """Set ``x[pivots] = W x``."""
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
    """Move the forces at the pivots to the other unknowns: ``r += W.T r[pivots]``, then ``r[pivots] = 0``."""
    forces = np.empty(pivots.shape[0], r.dtype)
    for p in range(pivots.shape[0]):
        forces[p] = r[pivots[p]]
        r[pivots[p]] = 0
    for p in range(pivots.shape[0]):
        for k in range(indptr[p], indptr[p + 1]):
            r[indices[k]] += weights[k] * forces[p]
