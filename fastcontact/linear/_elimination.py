"""Elimination of linear equations ``B u = c``: ``u = T v + t``, one unknown removed per equation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array
from scipy.sparse.csgraph import min_weight_full_bipartite_matching
from scipy.sparse.linalg import SuperLU, splu

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Elimination:
    """``u = T v + t``; v has zeros at the eliminated unknowns.

    Attributes
    ----------
    pivots : ndarray of int (m,)
        The eliminated unknown of each equation.
    T : csr_array (n, n)
        Identity but for the rows of the pivots; the columns of the pivots are empty.
    t : ndarray (n,)
    """

    pivots: NDArray[np.intp]
    T: csr_array
    t: Array
    _lu: SuperLU

    def multiplier(self, residual: Array) -> Array:
        """Return the multiplier (m,) with ``B.T multiplier = residual`` at the pivots; residual = K u - f (n,)."""
        return self._lu.solve(np.ascontiguousarray(residual[self.pivots]), trans="T")


def eliminate(B: csr_array, c: Array) -> Elimination:
    """Choose the unknowns to eliminate from ``B u = c`` and express them by the others.

    The pivots are the assignment of unknowns to equations with the largest product of entries (Duff and Koster, 2001),
    so that the matrix to invert is as well conditioned as a permutation allows; where every equation has an unknown of
    its own, as for node-to-segment contact, that matrix is diagonal.
    """
    B = csr_array(B)
    B.eliminate_zeros()
    largest = np.abs(B.data).max()
    cost = csr_array((1.0 + np.log(largest) - np.log(np.abs(B.data)), B.indices, B.indptr), shape=B.shape)
    row, pivots = min_weight_full_bipartite_matching(cost)
    pivots = pivots[np.argsort(row)].astype(np.intp)
    lu = splu(B[:, pivots].tocsc())
    keep = np.ones(B.shape[1])
    keep[pivots] = 0.0
    columns = np.flatnonzero((np.abs(B).sum(axis=0) > 0) & (keep > 0))
    tie = -lu.solve(B[:, columns].toarray())
    n, m = B.shape[1], len(pivots)
    entries = np.flatnonzero(tie.ravel())
    rows, cols = pivots[entries // max(len(columns), 1)], columns[entries % max(len(columns), 1)]
    T = diags_array(keep).tocsr() + csr_array((tie.ravel()[entries], (rows, cols)), shape=(n, n))
    t = np.zeros(n)
    t[pivots] = lu.solve(c) if m else 0.0
    return Elimination(pivots, csr_array(T), t, lu)
