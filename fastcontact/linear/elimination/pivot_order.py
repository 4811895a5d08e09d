"""Equations that fall away layer by layer, each with an unknown that none of the rest has.

Such are the weighted gaps of quadratic facets with dual multipliers: those of mid nodes have their node for themselves,
those of corners once the mid nodes are gone. The columns of the pivots then make a triangular matrix, and its inverse is
a short sum of sparse products.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

Indices = NDArray[np.intp]
# More layers than this are no short sum.
MOST = 4


def peeled(B: csr_array, smallest: float) -> tuple[Indices, csr_array] | None:
    """Return the pivot (m,) of every equation and the inverse (m, m) of their columns; None where no such order exists.

    Parameters
    ----------
    B : csr_array (m, n)
        Equations, in canonical format, without stored zeros.
    smallest : float
        A pivot is at least this part of the largest entry of its equation.
    """
    m, n = B.shape
    size, row = np.abs(B.data), np.repeat(np.arange(m), np.diff(B.indptr))
    largest = np.zeros(m)
    np.maximum.at(largest, row, size)
    strong = size >= smallest * largest[row]
    pivots, layer = np.full(m, -1, np.intp), np.full(m, -1)
    left = np.ones(m, bool)
    for number in range(MOST):
        among = left[row]
        count = np.bincount(B.indices[among], minlength=n)
        own = np.flatnonzero(among & strong & (count[B.indices] == 1))
        own = own[np.lexsort((own, -size[own], row[own]))]  # of each row the largest, of equal ones the first
        rows, first = np.unique(row[own], return_index=True)
        if not len(rows):
            return None
        pivots[rows], layer[rows] = B.indices[own[first]], number
        left[rows] = False
        if not left.any():
            return pivots, _inverse(csr_array(B[:, pivots]), int(layer.max()))
    return None


def _inverse(P: csr_array, depth: int) -> csr_array:
    """Return the inverse of a matrix that couples every row to deeper layers only: a finite Neumann series."""
    diagonal = diags_array(1.0 / P.diagonal(), format="csr")
    beyond = csr_array(P - diags_array(P.diagonal(), format="csr"))
    beyond.eliminate_zeros()
    total = term = csr_array(diagonal)
    for _ in range(depth):
        term = csr_array(-(diagonal @ beyond @ term))
        total = csr_array(total + term)
    return total
