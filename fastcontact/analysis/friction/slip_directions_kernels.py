# mypy: allow-untyped-defs, allow-incomplete-defs, no-check-untyped-defs
"""Inner products of constraint rows."""

import numpy as np

from fastcontact._jit.decorators import kernel


@kernel
def products_of_rows(indptr, indices, data, weights, out):
    """Fill `out` (parts, parts, m) with ``sum_j w_j R_a[i, j] R_b[i, j]`` for all rows i of matrices R_a and R_b (m, n).

    The matrices come as tuples of compressed rows, `weights` are w (n,).
    """
    weighted = np.zeros(weights.shape[0])
    for a in range(len(indptr)):
        for i in range(out.shape[2]):
            for e in range(indptr[a][i], indptr[a][i + 1]):
                weighted[indices[a][e]] = data[a][e] * weights[indices[a][e]]
            for b in range(a, len(indptr)):
                s = 0.0
                for e in range(indptr[b][i], indptr[b][i + 1]):
                    s += weighted[indices[b][e]] * data[b][e]
                out[a, b, i] = out[b, a, i] = s
            for e in range(indptr[a][i], indptr[a][i + 1]):
                weighted[indices[a][e]] = 0.0
