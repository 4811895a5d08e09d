# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Jacobians of cells in space, and the tables of slopes that they are computed from."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def transposed(dN):
    """Return derivatives (n_q, n_nodes, dim) as (n_q, dim, n_nodes), so that loops over nodes run along memory."""
    n_q, n_nodes, dim = dN.shape
    out = np.empty((n_q, dim, n_nodes))
    for q in range(n_q):
        for a in range(n_nodes):
            for i in range(dim):
                out[q, i, a] = dN[q, a, i]
    return out


@kernel
def jacobian_3d(x, slopes, q):
    """Return the nine entries of J, row by row, of the nodes x (3, n_nodes) at point q of the slopes (n_q, 3, n_nodes)."""
    j00 = j01 = j02 = j10 = j11 = j12 = j20 = j21 = j22 = 0.0
    for a in range(x.shape[1]):
        r, s, t = slopes[q, 0, a], slopes[q, 1, a], slopes[q, 2, a]
        j00 += r * x[0, a]
        j01 += r * x[1, a]
        j02 += r * x[2, a]
        j10 += s * x[0, a]
        j11 += s * x[1, a]
        j12 += s * x[2, a]
        j20 += t * x[0, a]
        j21 += t * x[1, a]
        j22 += t * x[2, a]
    return j00, j01, j02, j10, j11, j12, j20, j21, j22
