"""Direct solver by CHOLMOD's supernodal Cholesky factorisation, from the optional package kvxopt."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_array, csc_array, tril

from fastcontact.kernels import triangular
from fastcontact.linear._factor import FactorSolver
from fastcontact.linear._order import fill_reducing
from fastcontact.linear._singular import singular
from fastcontact.linear._symmetric import SymmetricFactors, by_supernodes

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
# The system of equations whose solution is the right-hand side in the order of elimination.
PERMUTE = 7


class Cholmod(FactorSolver):
    """CHOLMOD, with its own fill-reducing order where no unknowns must be last; see `FactorSolver`."""

    name = "cholmod"

    def _factorise(self, K: csc_array) -> None:
        A, lower = _matrix(K)
        self._factor = _analysed(A)
        _factorised(A, self._factor, lower)

    def _solve(self, F: Array) -> Array:
        return _solved(self._factor, F)

    def _with_last(self, K: bsr_array, last: Indices) -> SymmetricFactors:
        from kvxopt import cholmod, matrix

        A, lower = _matrix(K.tocsc())
        factor = _analysed(A, matrix(fill_reducing(K, last)))
        _factorised(A, factor, lower)
        # CHOLMOD may reorder independent branches of the elimination, which leaves what depends on what as it is.
        place = np.empty(self.n, np.intp)
        place[_order(factor, self.n)] = np.arange(self.n)
        start, rows, values = (np.asarray(part).ravel() for part in cholmod.getfactor(factor).CCS)
        L = csc_array((values, rows.astype(np.intc), start.astype(np.intc)), shape=(self.n, self.n))
        d = np.empty(self.n)
        triangular.unit_diagonal(L.indptr, L.data, d)
        return SymmetricFactors(by_supernodes(L), d, place, last)


def _matrix(K: csc_array) -> tuple[Any, Any]:
    """Return the lower triangle of K as CHOLMOD takes it, and as it is."""
    from kvxopt import matrix, spmatrix

    lower = tril(K, format="coo")
    rows, columns = (matrix(index.astype(np.int64)) for index in (lower.row, lower.col))
    return spmatrix(matrix(lower.data), rows, columns, K.shape), lower


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


def _factorised(A: Any, factor: Any, lower: Any) -> None:
    """Factorise A; small matrices are factorised past a zero pivot, which a solution finds."""
    from kvxopt import cholmod

    try:
        cholmod.numeric(A, factor)
        _solved(factor, np.ones(lower.shape[0]))
    except ArithmeticError as error:
        raise singular() from error


def _solved(factor: Any, F: Array, system: int = 0) -> Array:
    from kvxopt import cholmod, matrix

    X = matrix(np.asfortranarray(F.reshape(len(F), -1)))
    cholmod.solve(factor, X, sys=system)
    return np.array(X, order="C").reshape(F.shape)


def _order(factor: Any, n: int) -> Indices:
    """Return the order of elimination (n,) of a numeric factor."""
    return _solved(factor, np.arange(n, dtype=float), PERMUTE).astype(np.intp)


SOLVER = Cholmod
