"""Inverse of the pivot columns: small independent blocks, or a factorisation where constraints of many nodes are coupled.

Gaps weighted with standard multipliers are coupled by a mass matrix of the secondary surface, whose inverse is full. Its
factors are sparse: a solution is cheap compared with a product with the stiffness. Preconditioners need sparse weights and
use a sparse inverse instead, with one block per node and the same effect on translations.

Whether a factorised matrix is nearly singular shows in a few solutions (`condition`). The diagonal of triangular factors is
no indicator: for two equal rows among many it may be as large as for the others.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array, csc_array, csr_array
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import LinearOperator, onenormest, splu

from fastcontact.arrays import Array, Indices
from fastcontact.errors import ConvergenceError
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

# Entries are lumped into nodal blocks where at least this fraction of them does not cancel.
LUMPED = 0.3
Apply = Callable[[Array], Array]


class RepeatedError(ConvergenceError):
    """Constraints are linearly dependent."""

    def __init__(self) -> None:
        super().__init__(
            "active contact constraints are linearly dependent, so that an iterative solver cannot eliminate them: leave out "
            "one of two contacts on the same nodes, or use the direct solver"
        )


class CoupledError(RepeatedError):
    """Equations of many nodes share unknowns in a way that cannot be eliminated."""

    def __init__(self) -> None:
        ConvergenceError.__init__(
            self,
            "active contact constraints of many nodes share unknowns, so that an iterative solver cannot eliminate them: use "
            'multipliers="dual" or the direct solver',
        )


@dataclass(frozen=True, eq=False)
class SparseInverse:
    """The inverse of the pivot columns where it is sparse.

    Attributes
    ----------
    matrix : csr_array (m, m)
    """

    matrix: csr_array

    @property
    def sparse(self) -> SparseInverse:
        """The inverse itself."""
        return self

    def solve(self, b: Array) -> Array:
        """Return ``P^-1 b``, shape (m,)."""
        return np.asarray(self.matrix @ b, np.float64)

    def solve_transposed(self, b: Array) -> Array:
        """Return ``P^-T b``, shape (m,)."""
        return np.asarray(self.matrix.T @ b)


class CoupledPivots:
    """The factors of the pivot columns P (m, m) where their inverse is full.

    Parameters
    ----------
    P : csr_array (m, m)
    pivots : ndarray of int (m,)
        The unknowns of its columns.
    size : int
        Unknowns of a node.

    Attributes
    ----------
    sparse : SparseInverse
        Close enough to the inverse for a preconditioner: that of `lumped`.

    Raises
    ------
    CoupledError
        If P is singular or nearly so, or has no such sparse inverse.
    """

    def __init__(self, P: csr_array, pivots: Indices, size: int) -> None:
        L = lumped(P, pivots, size)
        ratio = np.asarray(abs(L).sum(axis=1)) / np.asarray(abs(P).sum(axis=1))
        if not ratio.min() >= LUMPED:
            raise CoupledError()
        self.sparse = SparseInverse(block_inverse(L))
        try:
            self._factors = splu(csc_array(P))
        except RuntimeError:  # exactly singular
            raise CoupledError() from None
        if not condition(P, self.solve, self.solve_transposed) < 1.0 / SINGLE_PRECISION:  # errors would grow
            raise CoupledError()

    def solve(self, b: Array) -> Array:
        """Return ``P^-1 b``, shape (m,)."""
        return np.asarray(self._factors.solve(b))

    def solve_transposed(self, b: Array) -> Array:
        """Return ``P^-T b``, shape (m,)."""
        return np.asarray(self._factors.solve(b, "T"))


Inverse = SparseInverse | CoupledPivots


def lumped(P: csr_array, pivots: Indices, size: int) -> csr_array:
    """Return P (m, m) with the entries of each row lumped into the block of its node, by direction.

    Translations of the pivots, with `size` components per node, then need the same forces. Entries in directions that have no
    pivot at the node of the row are left out.
    """
    node, direction = pivots // size, pivots % size
    column = np.full((node.max() + 1) * size, -1, np.intp)
    column[pivots] = np.arange(len(pivots))
    entries = coo_array(P)
    columns = column[node[entries.row] * size + direction[entries.col]]
    valid = columns >= 0
    return csr_array((entries.data[valid], (entries.row[valid], columns[valid])), shape=P.shape)


def block_inverse(A: csr_array) -> csr_array:
    """Return the inverse of a sparse matrix (m, m) of small independent blocks, all blocks of a size at once.

    Raises
    ------
    RepeatedError
        If a block is singular.
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
        alike = np.flatnonzero(size == k)
        number = np.full(len(size), -1, np.intp)
        number[alike] = np.arange(len(alike))
        selected = number[label[entries.row]] >= 0
        row, col = entries.row[selected], entries.col[selected]
        blocks = np.zeros((len(alike), k, k))
        np.add.at(blocks, (number[label[row]], position[row], position[col]), entries.data[selected])
        members = order[first[alike][:, None] + np.arange(k)]
        rows.append(np.repeat(members, k, axis=1).ravel())
        cols.append(np.tile(members, k).ravel())
        values.append(_inverses(blocks).ravel())
    coo = np.concatenate(values), (np.concatenate(rows), np.concatenate(cols))
    return csr_array(coo, shape=A.shape)


def _inverses(blocks: Array) -> Array:
    """Return the inverses of `blocks` (n, k, k)."""
    try:
        inverses = np.asarray(np.linalg.inv(blocks), np.float64)
    except np.linalg.LinAlgError:
        raise RepeatedError() from None
    if not (np.abs(blocks).max(axis=(1, 2)) * np.abs(inverses).max(axis=(1, 2)) < 1.0 / ROUND_OFF).all():
        raise RepeatedError()
    return inverses


def condition(P: csr_array, solve: Apply, solve_transposed: Apply) -> float:
    """Return an estimate of the condition number ``max(|P^-1| |P| 1)`` of P (m, m) (Skeel, 1979).

    It is independent of the scaling of the rows. The estimate is a lower bound, seldom less than a third of it (Hager, 1984;
    Higham, 1988), and NaN where products overflow.

    Parameters
    ----------
    P : csr_array (m, m)
    solve, solve_transposed : callable
        Return ``P^-1 b`` and ``P^-T b``, shape (m,).
    """
    rows = np.asarray(abs(P).sum(axis=1), np.float64).ravel()
    product = LinearOperator(
        P.shape, lambda x: rows * solve_transposed(x.ravel()), lambda x: solve(rows * x.ravel()), dtype=float
    )
    with np.errstate(all="ignore"):
        return float(onenormest(product, t=1))
