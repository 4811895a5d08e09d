"""Row scaling and selection of sparse matrices without matrix products."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import AnyArray, Indices


def scaled(matrix: csr_array, factor: AnyArray) -> csr_array:
    """Return the matrix (m, n) with its rows times `factor` (m,); rows times zero are empty."""
    values = matrix.data * np.repeat(factor, np.diff(matrix.indptr))
    result = csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)
    if not factor.all():
        result = result.copy()  # places are moved
        result.eliminate_zeros()
    return result


def taken(matrix: csr_array, rows: Indices) -> csr_array:
    """Return `rows` (k,) of a matrix, ascending; the matrix itself where they are all."""
    return matrix if len(rows) == matrix.shape[0] else matrix[rows]


def without_remnants(matrix: csr_array, origin: csr_array, least: float) -> csr_array:
    """Return the matrix (m, n), rows empty whose entries are below `least` of the largest in that row of `origin` (m, k)."""
    kept = abs(matrix).max(axis=1).toarray() > least * abs(origin).max(axis=1).toarray()
    return matrix if kept.all() else scaled(matrix, kept)
