"""Direct solver by CHOLMOD's supernodal Cholesky factorisation, from the optional package kvxopt."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, csr_array

from fastcontact.linear.cholesky import triangular_kernels
from fastcontact.linear.cholesky.ordering import fill_reducing
from fastcontact.linear.cholesky.singular import singular
from fastcontact.linear.cholesky.symmetric import Shape, SymmetricFactors
from fastcontact.linear.factors.factored import FactorSolver

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# The system of equations whose solution is the right-hand side in the order of elimination.
PERMUTE = 7


class Cholmod(FactorSolver):
    """CHOLMOD, with its own fill-reducing order where no unknowns must be last; see `FactorSolver`."""

    name = "cholmod"

    def _factorise(self, K: csc_array) -> None:
        A = _matrix(K)
        self._factor = _analysed(A)
        _factorised(A, self._factor)
        _solved(self._factor, np.ones(self.n))

    def _solve(self, F: Array) -> Array:
        return _solved(self._factor, F)

    def _with_last(self, K: bsr_array, last: Indices) -> SymmetricFactors | None:
        from kvxopt import cholmod, matrix

        if not len(last):
            return None
        A = _matrix(K.tocsr())  # its rows are its columns
        factor = _analysed(A, matrix(fill_reducing(K, last)))
        _factorised(A, factor)
        # CHOLMOD may reorder independent branches of the elimination, which leaves what depends on what as it is.
        place = np.empty(self.n, np.intp)
        place[_order(factor, self.n)] = np.arange(self.n)
        start, rows, values = (np.asarray(part).ravel() for part in cholmod.getfactor(factor).CCS)
        d = np.empty(self.n)
        triangular_kernels.unit_diagonal(start, values, d)
        return SymmetricFactors(_by_supernodes(start, rows, values), d, place, last)


def _by_supernodes(start: NDArray[np.int64], rows: NDArray[np.int64], values: Array) -> Shape:
    """Return L given by columns, row numbers sorted, with those of columns of equal structure once; `rows` is overwritten."""
    first, begin = np.empty(len(start), np.int64), np.empty(len(start), np.int64)
    count = triangular_kernels.supernodes(start, rows, first, begin)
    return Shape(
        start, values, first[: count + 1].copy(), begin[: count + 1].copy(), rows[: begin[count]].astype(np.intc)
    )


def _matrix(K: csc_array | csr_array) -> Any:
    """Return the lower triangle of the symmetric matrix K as CHOLMOD takes it."""
    from kvxopt import matrix, spmatrix

    columns = np.repeat(np.arange(K.shape[0]), np.diff(K.indptr))
    lower = K.indices >= columns
    rows, columns = matrix(K.indices[lower].astype(np.int64)), matrix(columns[lower])
    return spmatrix(matrix(K.data[lower]), rows, columns, K.shape)


def _analysed(A: Any, order: Any = None) -> Any:
    """Return the symbolic factor, in a given order or CHOLMOD's own."""
    from kvxopt import cholmod

    if order is None:
        return cholmod.symbolic(A)
    before = dict(cholmod.options)
    cholmod.options["nmethods"] = 1  # otherwise it takes an order of its own where that leaves less to do
    try:
        return cholmod.symbolic(A, order)
    finally:
        cholmod.options.clear()
        cholmod.options.update(before)


def _factorised(A: Any, factor: Any) -> None:
    from kvxopt import cholmod

    try:
        cholmod.numeric(A, factor)
    except ArithmeticError as error:
        raise singular() from error


def _solved(factor: Any, F: Array, system: int = 0) -> Array:
    from kvxopt import cholmod, matrix

    X = matrix(np.asfortranarray(F.reshape(len(F), -1)))
    try:
        cholmod.solve(factor, X, sys=system)
    except ArithmeticError as error:  # small matrices are factorised past a zero pivot, which a solution finds
        raise singular() from error
    return np.array(X, order="C").reshape(F.shape)


def _order(factor: Any, n: int) -> Indices:
    """Return the order of elimination (n,) of a numeric factor."""
    return _solved(factor, np.arange(n, dtype=float), PERMUTE).astype(np.intp)


SOLVER = Cholmod
