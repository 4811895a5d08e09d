"""Rows of sparse matrices: from nodal values, scaled, and selected, without matrix products."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.arrays import AnyArray, Array, Indices


def nodal_rows(nodes: NDArray[np.integer], values: Array, n_dofs: int) -> csr_array:
    """Return rows (m, n_dofs) with the `values` (m, k, dim) at the components of `nodes` (m, k)."""
    m, k, dim = values.shape
    columns = nodes[:, :, None].astype(np.intp) * dim + np.arange(dim)
    rows = csr_array((values.flatten(), columns.ravel(), k * dim * np.arange(m + 1)), shape=(m, n_dofs))
    rows.sum_duplicates()
    rows.eliminate_zeros()
    return rows


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
