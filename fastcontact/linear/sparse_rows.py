"""Operations on sparse matrices: assembly from cells or nodal values, sums, and stacking, scaling and selection of rows."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, coo_array, csr_array, diags_array, vstack

from fastcontact.arrays import AnyArray, Array, Indices, mask_at

# Row numbers (n, k), column numbers (n, l) and values (n, k, l) of n dense blocks, such as the matrices of cells.
Blocks = tuple[NDArray[np.integer], NDArray[np.integer], Array]


def assembled(blocks: Sequence[Blocks], shape: tuple[int, int]) -> csr_array:
    """Return the matrix of shape `shape` that is the sum of dense blocks; zeros are not stored."""
    entries = []
    for rows, columns, values in blocks:
        nonzero = np.flatnonzero(values)
        row, column = rows[:, :, None].astype(np.int32), columns[:, None, :].astype(np.int32)
        positions = (np.broadcast_to(index, values.shape).ravel()[nonzero] for index in (row, column))
        entries.append((values.ravel()[nonzero], *positions))
    if not entries:
        return csr_array(shape)
    data, row, column = map(np.concatenate, zip(*entries, strict=True))
    return csr_array(coo_array((data, (row, column)), shape=shape))


def shapes_at(shape: Array, local: NDArray[np.integer], n_nodes: int) -> csr_array:
    """Return the shape functions (m, n_nodes) of all nodes at m points.

    `shape` (m, n) contains the shape functions of the n nodes `local` (m, n) of the cell of each point.
    """
    m, n = shape.shape
    shapes = csr_array((shape.flatten(), local.flatten(), n * np.arange(m + 1)), shape=(m, n_nodes))
    shapes.sum_duplicates()
    return shapes


def sum_of_blocks(K: bsr_array, other: csr_array | bsr_array) -> bsr_array:
    """Return the sum of two matrices (n, n), with the block size of the first one and sorted blocks."""
    total = bsr_array(K + other.tobsr(K.blocksize))
    total.sort_indices()
    return total


def entry_rows(matrix: csr_array | bsr_array) -> Indices:
    """Return the row (nnz,) of each entry, or of each block, of a matrix."""
    return np.repeat(np.arange(len(matrix.indptr) - 1), np.diff(matrix.indptr))


def rows_of(weights: csr_array, direction: Array) -> csr_array:
    """Return the matrix (m, n_dofs) whose product with nodal vectors is their weighted sums, projected on directions.

    `weights` (m, n_points) contains the weights of the nodes, and `direction` (m, dim) the direction of each row.
    """
    dim = direction.shape[1]
    row = entry_rows(weights)
    values = weights.data[:, None] * direction[row]
    columns = weights.indices[:, None] * dim + np.arange(dim)
    size = (weights.shape[0], weights.shape[1] * dim)
    return without_zeros(csr_array((values.ravel(), columns.ravel(), weights.indptr * dim), shape=size))


def nodal_rows(nodes: NDArray[np.integer], values: Array, n_dofs: int) -> csr_array:
    """Return rows (m, n_dofs) with the entries `values` (m, k, dim) in the columns of `nodes` (m, k)."""
    m, k, dim = values.shape
    columns = nodes[:, :, None].astype(np.intp) * dim + np.arange(dim)
    return without_zeros(shapes_at(values.reshape(m, k * dim), columns.reshape(m, k * dim), n_dofs))


def without_zeros(matrix: csr_array) -> csr_array:
    """Remove stored zeros from `matrix`, and return it."""
    matrix.eliminate_zeros()
    return matrix


def stacked_rows(items: Sequence[Any], n_dofs: int) -> csr_array:
    """Return the attributes ``rows`` of multi-point constraints or springs, stacked in one matrix (m, n_dofs)."""
    return csr_array(vstack([csr_array((0, n_dofs)), *(item.rows for item in items)], format="csr"))


def scaled(matrix: csr_array, factor: AnyArray) -> csr_array:
    """Return the matrix (m, n) with its rows multiplied by `factor` (m,); rows with a factor of zero become empty."""
    values = matrix.data * np.repeat(factor, np.diff(matrix.indptr))
    result = csr_array((values, matrix.indices, matrix.indptr), shape=matrix.shape)
    # A copy, because the removal of zeros modifies the index arrays, which `matrix` shares.
    return result if factor.all() else without_zeros(result.copy())


def substituted(rows: csr_array, pivots: Indices, weights: csr_array) -> csr_array:
    """Return `rows` (m, n) after the substitution ``u[pivots] = weights @ u`` with weights (k, n)."""
    others = rows @ diags_array(1.0 - mask_at(pivots, rows.shape[1]))
    return csr_array(others + csr_array(rows[:, pivots]) @ weights)


def taken(matrix: csr_array, rows: Indices) -> csr_array:
    """Return the rows of a matrix with the ascending numbers `rows` (k,); the matrix itself if these are all rows."""
    return matrix if len(rows) == matrix.shape[0] else matrix[rows]


def without_round_off(matrix: csr_array, origin: csr_array, threshold: Array | float) -> csr_array:
    """Return the matrix (m, n) without the entries of rows that consist of round-off.

    The entries of a row are removed if none of them exceeds `threshold`, a number or one for each row, times the largest
    entry of the same row of `origin`, in absolute values.
    """
    significant = _row_maxima(matrix) > threshold * _row_maxima(origin)
    return matrix if significant.all() else scaled(matrix, significant)


def _row_maxima(matrix: csr_array) -> Array:
    """Return the largest absolute value in each row (m,) of a matrix (m, n), in a third of the time of its method `max`.

    Duplicate entries of the matrix are summed in place.
    """
    matrix.sum_duplicates()
    maxima, nonempty = np.zeros(matrix.shape[0]), np.flatnonzero(np.diff(matrix.indptr))
    if len(nonempty):
        maxima[nonempty] = np.maximum.reduceat(np.abs(matrix.data), matrix.indptr[nonempty])
    return maxima
