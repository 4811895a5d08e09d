# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Eliminated unknowns in long vectors. Pivots follow ``x[pivots] = W x``, W in compressed rows that involve no pivots."""

from fastcontact._jit.decorators import kernel


@kernel
def complete(pivots, indptr, indices, weights, x):
    """Set ``x[pivots] = W x``."""
    for p in range(pivots.shape[0]):
        s = x[0] * 0
        for k in range(indptr[p], indptr[p + 1]):
            s += weights[k] * x[indices[k]]
        x[pivots[p]] = s


@kernel
def move_forces(pivots, indptr, indices, weights, r):
    """Move the forces at the pivots to the other unknowns: ``r += W.T r[pivots]``, ``r[pivots] = 0``."""
    for p in range(pivots.shape[0]):
        force = r[pivots[p]]
        r[pivots[p]] = 0
        for k in range(indptr[p], indptr[p + 1]):
            r[indices[k]] += weights[k] * force


@kernel
def restore_forces(pivots, indptr, indices, weights, forces, r):
    """Undo `move_forces`, given the `forces` (m,) that were at the pivots."""
    for p in range(pivots.shape[0]):
        r[pivots[p]] = forces[p]
        for k in range(indptr[p], indptr[p + 1]):
            r[indices[k]] -= weights[k] * forces[p]
