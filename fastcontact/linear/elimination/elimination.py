"""Elimination of linear equations ``B u = c``: one unknown of each is tied to others, ``u[pivots] = tie u + t``."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import qr
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.csgraph import connected_components, min_weight_full_bipartite_matching

from fastcontact.errors import ConvergenceError
from fastcontact.linear.elimination import elimination_kernels
from fastcontact.linear.elimination.pivot_order import peeled
from fastcontact.linear.multigrid import cycle_kernels

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# An unknown of its own is taken as pivot where its entry is at least this part of the largest one of the equation.
SMALLEST = 0.25
# Equations whose inverse is larger, in units of their entries, repeat each other but for round-off.
SINGULAR = 1e12
# Beyond so many equations without unknowns of their own a dense factorisation costs more than it gains.
DENSE_UP_TO = 400


class RepeatedError(ConvergenceError):
    """Equations repeat each other."""

    def __init__(self) -> None:
        super().__init__(
            "active contact constraints repeat each other, so that an iterative solver cannot eliminate them: leave out one "
            "of two contacts on the same nodes, or use the direct solver"
        )


@dataclass(frozen=True, eq=False)
class Elimination:
    """``u[pivots] = tie u + t``.

    Attributes
    ----------
    pivots : ndarray of int (m,)
        The eliminated unknown of each equation.
    tie : csr_array (m, n)
        What the pivots follow; no pivot is among it.
    t : ndarray (m,)
    push : csr_array (m, n)
        What forces at the pivots are moved to: `tie`, unless multipliers act through other rows than B.
    """

    pivots: Indices
    tie: csr_array
    t: Array
    push: csr_array
    _inverse: csr_array  # of the pivots' columns of the rows that multipliers act through

    @property
    def nonsymmetric(self) -> bool:
        """Whether multipliers act through other rows than those of the equations."""
        return self.push is not self.tie

    def multiplier(self, forces: Array) -> Array:
        """Return the multiplier (m,) with ``B.T multiplier = forces`` at the pivots; forces = (K u - f)[pivots]."""
        return np.asarray(self._inverse.T @ forces)

    def complete(self, x: Array, t: Array | None = None) -> None:
        """Set the pivots of `x` (n,) to what they follow, plus `t`."""
        cycle_kernels.complete(self.pivots, self.tie.indptr, self.tie.indices, self.tie.data, x)
        if t is not None:
            x[self.pivots] += t

    def condense(self, r: Array) -> None:
        """Move the forces `r` (n,) at the pivots to what they follow."""
        cycle_kernels.condense(self.pivots, self.push.indptr, self.push.indices, self.push.data, r)

    def release(self, r: Array, forces: Array) -> None:
        """Undo `condense`, given the `forces` (m,) that were at the pivots."""
        cycle_kernels.release(self.pivots, self.push.indptr, self.push.indices, self.push.data, forces, r)


def eliminate(B: csr_array, c: Array, through: csr_array | None = None, groups: Indices | None = None) -> Elimination:
    """Choose the unknowns to eliminate from ``B u = c`` and express them by the others.

    Where every equation has unknowns of its own, as for node-to-segment contact and dual multipliers, its largest one
    is taken, and nothing is inverted; where equations fall away layer by layer, see `_peeling`. Otherwise the pivots
    are the assignment of unknowns to equations with the largest product of entries (Duff and Koster, 2001), so that the
    matrix to invert is as well conditioned as a permutation allows; groups of equations that share pivots are inverted
    group by group.

    Parameters
    ----------
    B : csr_array (m, n)
    c : ndarray (m,)
    through : csr_array (m, n), optional
        Rows that multipliers act through, ``K u = f + through.T multiplier``; B by default.
    groups : ndarray of int (m,), optional
        Number of the group of each equation, such as a node: those of a group may share unknowns of their own.

    Raises
    ------
    RepeatedError
        If equations repeat each other, so that there is no unknown to eliminate for each.
    """
    B = csr_array(B, copy=True)
    if not B.has_canonical_format:
        B.sum_duplicates()
    B.eliminate_zeros()
    m = B.shape[0]
    entries = _own(B)
    if entries is not None:
        pivots = B.indices[entries].astype(np.intp)
        inverse = csr_array(diags_array(1.0 / B.data[entries], format="csr")) if m else csr_array((0, 0))
    elif groups is not None and (shared := _in_groups(B, groups)) is not None:
        pivots, inverse = shared, _block_inverse(csr_array(B[:, shared]))
    elif (layered := peeled(B, SMALLEST)) is not None:
        pivots, inverse = layered
    else:
        pivots = _matched(B)
        inverse = _block_inverse(csr_array(B[:, pivots]))
    tie = _followed(B, pivots, inverse)
    push, t = tie, np.asarray(inverse @ c, float)
    if through is not None:
        inverse = _block_inverse(csr_array(through[:, pivots]))
        push = _followed(through, pivots, inverse)
    return Elimination(pivots, tie, t, push, inverse)


def _followed(B: csr_array, pivots: Indices, inverse: csr_array) -> csr_array:
    """Return what the `pivots` (m,) of the rows B (m, n) follow, given the `inverse` of their columns."""
    is_pivot = np.zeros(B.shape[1], bool)
    is_pivot[pivots] = True
    rest = csr_array((np.where(is_pivot[B.indices], 0.0, -B.data), B.indices, B.indptr), shape=B.shape, copy=True)
    rest.eliminate_zeros()
    tie = csr_array(inverse @ rest)
    tie.sort_indices()
    return tie


def _own(B: csr_array) -> Indices | None:
    """Return, for each row, the entry of its largest unknown that no other row has; None where a row has none."""
    m = B.shape[0]
    if not m:
        return np.empty(0, np.intp)
    if not np.diff(B.indptr).all():
        return None
    size = np.abs(B.data)
    count = np.bincount(B.indices, minlength=B.shape[1])
    row = np.repeat(np.arange(m), np.diff(B.indptr))
    own = np.where(count[B.indices] == 1, size, 0.0)
    order = np.lexsort((-np.arange(len(own)), own, row))
    best = order[B.indptr[1:] - 1]
    largest = np.maximum.reduceat(size, B.indptr[:-1])
    return best if (own[best] >= SMALLEST * largest).all() else None


def _in_groups(B: csr_array, groups: Indices) -> Indices | None:
    """Return the unknown of each row among those of its group alone; None where there are too few."""
    pivots, (present, group) = np.empty(B.shape[0], np.intp), np.unique(groups, return_inverse=True)
    failed = elimination_kernels.choose(B.indptr, B.indices, B.data, group, len(present), B.shape[1], SMALLEST, pivots)
    return None if failed else pivots


def _matched(B: csr_array) -> Indices:
    """Return the unknown assigned to each row."""
    if B.shape[0] <= DENSE_UP_TO:
        columns = np.unique(B.indices)
        if len(columns) < B.shape[0]:
            raise RepeatedError()
        *_, order = qr(B[:, columns].toarray(), mode="r", pivoting=True)
        return np.asarray(columns[order[: B.shape[0]]], np.intp)
    largest = np.abs(B.data).max()
    cost = csr_array((1.0 + np.log(largest) - np.log(np.abs(B.data)), B.indices, B.indptr), shape=B.shape)
    try:
        row, pivots = min_weight_full_bipartite_matching(cost)
    except ValueError:
        raise RepeatedError() from None
    return np.asarray(pivots[np.argsort(row)], np.intp)


def _block_inverse(A: csr_array) -> csr_array:
    """Return the inverse of a sparse matrix that falls into small independent blocks, one block after the other."""
    count, label = connected_components(A, directed=False)
    order = np.argsort(label, kind="stable")
    ends = np.cumsum(np.bincount(label, minlength=count))
    columns = csc_array(A)
    rows, cols, values = [], [], []
    for first, end in zip(np.r_[0, ends[:-1]], ends, strict=True):
        members = order[first:end]
        block = columns[:, members].tocsr()[members].toarray()
        try:
            inverse = np.linalg.inv(block)
        except np.linalg.LinAlgError:
            raise RepeatedError() from None
        if not np.abs(block).max() * np.abs(inverse).max() < SINGULAR:
            raise RepeatedError()
        rows.append(np.repeat(members, len(members)))
        cols.append(np.tile(members, len(members)))
        values.append(inverse.ravel())
    entries = (np.concatenate(values), (np.concatenate(rows), np.concatenate(cols)))
    return csr_array(entries, shape=A.shape)
