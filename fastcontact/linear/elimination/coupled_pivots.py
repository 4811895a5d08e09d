"""Inverse of the matrix P of the pivot columns, by small independent blocks or, if many nodes are coupled, by LU factors.

With standard multipliers, weighted gaps are coupled by the mass matrix of the secondary surface, whose inverse is a full
matrix. Its factors, however, are sparse, so that forward and back substitution cost little compared with a product with the
stiffness matrix. Preconditioners require a sparse matrix. They use a sparse approximation of the inverse, with one block per
node, that is exact for translations in the directions of the pivots of the node.

A nearly singular matrix is detected by an estimate of its condition number, for which a few systems are solved (see
`condition`). The diagonal of the triangular factors is not sufficient for this purpose: if two of many rows are equal, all
its entries may be large.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, onenormest, splu

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, numbers_at
from fastcontact.errors import ConvergenceError
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

# Smallest admissible ratio of the sum of the absolute values in a row after lumping into nodal blocks to that before
# lumping. Without it, `test_constraints_that_cannot_be_eliminated_go_to_factors_and_not_through_many_columns` fails.
SMALLEST_LUMPED_RATIO = 0.3
Solve = Callable[[Array], Array]


class DependenceError(ConvergenceError):
    """Raised if constraints are linearly dependent."""

    TEXT = (
        "active contact constraints are linearly dependent, so that an iterative solver cannot eliminate them: leave out "
        "one of two contacts on the same nodes, or use the direct solver"
    )

    def __init__(self) -> None:
        super().__init__(self.TEXT)


class CoupledError(DependenceError):
    """Raised if the equations of many nodes involve the same unknowns and cannot be eliminated."""

    TEXT = (
        "active contact constraints of many nodes share unknowns, so that an iterative solver cannot eliminate them: use "
        'multipliers="dual" or the direct solver'
    )


@record
class SparseInverse:
    """Inverse of P as a sparse matrix.

    Attributes
    ----------
    matrix : csr_array (m, m)
        P^-1.
    """

    matrix: csr_array

    @property
    def sparse(self) -> SparseInverse:
        """The inverse itself, whereas `CoupledPivots.sparse` is an approximation."""
        return self

    def solve(self, b: Array) -> Array:
        """Return ``P^-1 b``, shape (m,)."""
        return np.asarray(self.matrix @ b, np.float64)

    def solve_transposed(self, b: Array) -> Array:
        """Return ``P^-T b``, shape (m,)."""
        return np.asarray(self.matrix.T @ b)


class CoupledPivots:
    """LU factors of P (m, m), for a matrix whose inverse is full.

    Parameters
    ----------
    P : csr_array (m, m)
        Columns of the equations that belong to the pivots.
    pivots : ndarray of int (m,)
        The unknown of each column.
    size : int
        Number of unknowns of a node.

    Attributes
    ----------
    sparse : SparseInverse
        Inverse of the `lumped_matrix`, which approximates P^-1 in a preconditioner.

    Raises
    ------
    CoupledError
        If P is singular or nearly singular, or if lumping cancels most of a row.
    DependenceError
        If the lumped matrix is singular.
    """

    def __init__(self, P: csr_array, pivots: Indices, size: int) -> None:
        lumped = lumped_matrix(P, pivots, size)
        ratio = np.asarray(abs(lumped).sum(axis=1)) / np.asarray(abs(P).sum(axis=1))
        if not ratio.min() >= SMALLEST_LUMPED_RATIO:
            raise CoupledError()
        self.sparse = SparseInverse(block_inverse(lumped))
        try:
            self._factors = splu(csc_array(P))
        except RuntimeError:  # exactly singular
            raise CoupledError() from None
        if not condition(P, self.solve, self.solve_transposed) < 1.0 / SINGLE_PRECISION:
            raise CoupledError()

    def solve(self, b: Array) -> Array:
        """Return ``P^-1 b``, shape (m,)."""
        return np.asarray(self._factors.solve(b))

    def solve_transposed(self, b: Array) -> Array:
        """Return ``P^-T b``, shape (m,)."""
        return np.asarray(self._factors.solve(b, "T"))


Inverse: TypeAlias = SparseInverse | CoupledPivots


def lumped_matrix(P: csr_array, pivots: Indices, size: int) -> csr_array:
    """Return P (m, m) with the entries of each row summed, for each direction, into the diagonal block of its node.

    Entries in directions in which the node of the row has no pivot are omitted. In the other directions, the product with a
    translation of all pivots does not change. `pivots` (m,) contains the unknown of each column, and `size` is the number of
    unknowns per node.
    """
    node, direction = pivots // size, pivots % size
    column = numbers_at(pivots, (node.max() + 1) * size)
    entries = coo_array(P)
    columns = column[node[entries.row] * size + direction[entries.col]]
    valid = columns >= 0
    return csr_array((entries.data[valid], (entries.row[valid], columns[valid])), shape=P.shape)


def block_inverse(A: csr_array) -> csr_array:
    """Return the inverse of a sparse matrix (m, m) that is block diagonal with small blocks after a permutation.

    Raises
    ------
    DependenceError
        If a block is singular to machine precision.
    """
    m = A.shape[0]
    label = connected_components(A, directed=False)[1]
    order, size = np.argsort(label, kind="stable"), np.bincount(label)
    first = np.cumsum(size) - size
    position = np.empty(m, np.intp)
    position[order] = np.arange(m) - first[label[order]]
    entries = coo_array(A)
    rows, cols, values = [], [], []
    for k in np.unique(size):
        components = np.flatnonzero(size == k)
        block_number = numbers_at(components, len(size))
        selected = block_number[label[entries.row]] >= 0
        row, col = entries.row[selected], entries.col[selected]
        blocks = np.zeros((len(components), k, k))
        np.add.at(blocks, (block_number[label[row]], position[row], position[col]), entries.data[selected])
        members = order[first[components][:, None] + np.arange(k)]
        rows.append(np.repeat(members, k, axis=1).ravel())
        cols.append(np.tile(members, k).ravel())
        values.append(_inverses(blocks).ravel())
    coo = np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))
    return csr_array(coo, shape=A.shape)


def _inverses(blocks: Array) -> Array:
    """Return the inverses (n, k, k) of `blocks` (n, k, k); raise a DependenceError if one of them is singular."""
    try:
        inverses = np.asarray(np.linalg.inv(blocks), np.float64)
    except np.linalg.LinAlgError:
        raise DependenceError() from None
    if not (np.abs(blocks).max(axis=(1, 2)) * np.abs(inverses).max(axis=(1, 2)) < 1.0 / ROUND_OFF).all():
        raise DependenceError()
    return inverses


def condition(P: csr_array, solve: Solve, solve_transposed: Solve) -> float:
    """Return an estimate of the componentwise condition number of P (m, m) (Skeel, 1979).

    The condition number is the largest component of ``abs(P^-1) @ abs(P) @ ones`` and does not depend on the scaling of the
    rows. The estimate is a lower bound, which is seldom less than a third of the exact value (Hager, 1984; Higham, 1988). It
    is NaN if products overflow.

    Parameters
    ----------
    P : csr_array (m, m)
    solve, solve_transposed : callable
        Functions that return ``P^-1 b`` and ``P^-T b`` (m,) for b (m,).
    """
    row_sums = np.asarray(abs(P).sum(axis=1), np.float64).ravel()
    product = LinearOperator(
        P.shape, lambda x: row_sums * solve_transposed(x.ravel()), lambda x: solve(row_sums * x.ravel()), dtype=float
    )
    with np.errstate(all="ignore"):
        return float(onenormest(product, t=1))
