"""Direct solver by the supernodal Cholesky factorisation of CHOLMOD, from the optional package kvxopt.

For 59 000 unknowns in 3D, including the computation of columns of K^-1, it is 10 to 25 % faster than ``"direct"`` and needs
twice the memory.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Indices, mask_at, numbers_at
from fastcontact.linear.cholesky.factorisation import fill_reducing_order, singular_matrix_error
from fastcontact.linear.cholesky.symmetric_factors import LowerTriangle, SymmetricFactors
from fastcontact.linear.factor_solver import FactorSolver


class Cholmod(FactorSolver):
    """Direct solver with the Cholesky factorisation of CHOLMOD; see `FactorSolver`."""

    name = "cholmod"

    def _factorise(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        from kvxopt import cholmod, matrix

        factor = factorise(lower_triangle(K.tocsr()), matrix(fill_reducing_order(K, last)))  # K is symmetric
        # CHOLMOD may reorder independent branches of the elimination tree, which does not affect the factors.
        position = numbers_at(_elimination_order(factor, self.n), self.n)
        start, rows, values = (np.asarray(array).ravel() for array in cholmod.getfactor(factor).CCS)
        diagonal = values[start[:-1]]
        values /= np.repeat(diagonal, np.diff(start))
        return SymmetricFactors(grouped_by_supernodes(start, rows, values), diagonal**2, position, last)


def grouped_by_supernodes(start: NDArray[np.int64], rows: NDArray[np.int64], values: Array) -> LowerTriangle:
    """Return a Cholesky factor with the row indices stored once per supernode, given its columns with ascending rows.

    Column j + 1 belongs to the supernode of column j if j + 1 is the first row of column j below the diagonal, and if column
    j + 1 has one entry fewer. Both columns then have the same rows from j + 2 on. The reason is that the rows of a column
    below the diagonal are contained in those of its parent, the column of its first row below the diagonal.
    """
    entries = np.diff(start)
    in_supernode = np.zeros(len(entries), bool)
    in_supernode[1:] = entries[:-1] == entries[1:] + 1
    previous = np.flatnonzero(in_supernode) - 1
    in_supernode[1 + previous] = rows[start[previous] + 1] == previous + 1
    first = np.append(np.flatnonzero(~in_supernode), len(entries))
    last = mask_at(first[1:] - 1, len(entries))
    shared = np.repeat(last, entries)
    shared[start[:-1]] = False
    row_start = np.concatenate([[0], np.cumsum(entries[last] - 1)])
    return LowerTriangle(start, values, first, row_start, rows[shared].astype(np.intc))


def lower_triangle(K: csr_array) -> Any:
    """Return the lower triangle of the symmetric matrix K (n, n) in the format of CHOLMOD."""
    from kvxopt import matrix, spmatrix

    columns = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    lower = K.indices >= columns
    rows, columns = matrix(K.indices[lower].astype(np.int64)), matrix(columns[lower])
    return spmatrix(matrix(K.data[lower]), rows, columns, K.shape)


def factorise(A: Any, order: Any) -> Any:
    """Return the Cholesky factor of a `lower_triangle` A, with the unknowns eliminated in a given order."""
    from kvxopt import cholmod

    options = dict(cholmod.options)
    cholmod.options["nmethods"] = 1  # otherwise CHOLMOD may choose a different order
    try:
        factor = cholmod.symbolic(A, order)
        cholmod.numeric(A, factor)
    except ArithmeticError as error:
        raise singular_matrix_error() from error
    finally:
        cholmod.options.clear()
        cholmod.options.update(options)
    return factor


def _elimination_order(factor: Any, n: int) -> Indices:
    """Return the n unknowns in the order in which `factor` eliminates them."""
    from kvxopt import cholmod, matrix

    numbers = matrix(np.arange(n, dtype=float))
    try:
        cholmod.solve(factor, numbers, sys=7)  # only permutes `numbers` to the order of elimination
    except ArithmeticError as error:  # For small matrices, CHOLMOD detects a zero pivot only when it solves a system.
        raise singular_matrix_error() from error
    return np.array(numbers).ravel().astype(np.intp)


SOLVER = Cholmod
