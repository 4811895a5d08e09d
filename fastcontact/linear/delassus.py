"""Schur complement of linear constraints: ``(B K^-1 B.T + C) multiplier = c - B K^-1 f``.

Only the degrees of freedom in B matter. Their rows and columns of ``K^-1`` are computed at their first appearance and cached,
so further active sets and pairings cost a small dense solution and one solution with K each.
"""

from __future__ import annotations

import warnings
import weakref
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve, lstsq, lu_factor
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.errors import ContactError, ConvergenceError
from fastcontact.linear.field_compliance import FieldCompliance

# Number of right-hand sides at a time: full columns of K^-1 are long, and only short parts of them are stored.
CHUNK = 32
# Largest number of constraints whose full compliance is formed and factorised: 3.2 GB per copy, and minutes; with friction,
# where Newton's method factorises a nonsymmetric matrix several times for each pairing, ten seconds each.
MOST_ROWS, MOST_ROWS_WITH_FRICTION = 20_000, 6_000
# Formulation whose constraints never need columns of the inverse.
CHEAP = 'formulation="mortar" with multipliers="dual"'


class TooManyColumnsError(ConvergenceError):
    """Columns of the inverse would cost an iterative solver more than a factorisation."""

    def __init__(self, count: int) -> None:
        super().__init__(
            f"the contact needs {count} columns of the inverse stiffness, a solution each, since its constraints cannot be "
            f"eliminated: use {CHEAP} and pairs that share no nodes, or the direct solver"
        )


def check_rows(count: int, most: int | None = None) -> None:
    """Refuse a full compliance of too many constraints.

    Raises
    ------
    ContactError
        If it would take hours.
    """
    most = MOST_ROWS if most is None else most
    if count > most:
        raise ContactError(
            f"the contact needs the full compliance of {count} constraints, a matrix of {8e-9 * count**2:.1f} GB that is "
            f"factorised repeatedly (at most {most} constraints are accepted), since the solver is direct or since they "
            f'cannot be eliminated: use {CHEAP}, with linear_solver="amg", or a coarser or smaller secondary side'
        )


class InverseColumns:
    """Rows and columns of ``K^-1`` for the degrees of freedom requested so far.

    Parameters
    ----------
    n : int
        Size of K.
    solve_many : method
        Method of the solver that owns these columns; maps right-hand sides (n, k) [force] to solutions (n, k) [length].
    most : int, optional
        Largest number of columns; unlimited by default.

    Attributes
    ----------
    asked : list of ndarray of int
        Degrees of freedom in the order in which they were solved for, on which round-off and errors of iterative solutions
        depend.
    """

    def __init__(self, n: int, solve_many: Callable[[Array], Array], most: int | None = None) -> None:
        self._most = n if most is None else most
        # A weak reference: a cycle of solver and columns would keep the factors, the largest objects, alive.
        self._solve_many = weakref.WeakMethod(solve_many)
        self._place = np.full(n, -1, np.intp)
        self._dofs = np.empty(0, np.intp)
        self._values = np.empty((0, 0))
        self.asked: list[Indices] = []

    def give(self, dofs: Indices, values: Array) -> None:
        """Store rows and columns `dofs` (k,) of ``K^-1`` computed otherwise; only while nothing is stored."""
        self._dofs, self._values = dofs, values
        self._place[dofs] = np.arange(len(dofs))

    def of_rows(self, R: csr_array) -> Array:
        """Return ``R K^-1 R.T`` (m, m) [length / force] for sparse rows R (m, n)."""
        check_rows(R.shape[0])
        used = R.data != 0.0
        column = self._places(R.indices[used])
        starts = np.concatenate([[0], np.cumsum(used)])[R.indptr]
        rows = csr_array((R.data[used], column, starts), shape=(R.shape[0], len(self._dofs)))
        return symmetric(np.asarray(rows @ (rows @ self._values).T))

    def put_back(self, requests: Sequence[Indices]) -> None:
        """Restore exactly the columns of `requests`, in that order; solve only for missing ones."""
        pairs = zip(self.asked, requests, strict=False)
        same = next((i for i, (old, new) in enumerate(pairs) if not np.array_equal(old, new)), len(requests))
        if later := sum(len(dofs) for dofs in self.asked[same:]):
            self._place[self._dofs[-later:]] = -1
            self._dofs, self._values = self._dofs[:-later], self._values[:-later, :-later].copy()
        del self.asked[same:]
        for dofs in requests[len(self.asked) :]:
            self._places(dofs)

    def _places(self, dofs: NDArray[np.integer]) -> Indices:
        """Return the positions of `dofs` (k,), which may repeat, among stored columns; solve for new ones."""
        new = np.unique(dofs[self._place[dofs] < 0]).astype(np.intp)
        if len(new):
            self._extend(new)
        return self._place[dofs]

    def _extend(self, new: Indices) -> None:
        old = len(self._dofs)
        if old + len(new) > self._most:
            raise TooManyColumnsError(old + len(new))
        self.asked.append(new)
        self._dofs = np.concatenate([self._dofs, new])
        self._place[new] = np.arange(old, len(self._dofs))
        solve_many = self._solve_many()
        assert solve_many is not None, "the columns outlived their solver"
        grown = np.empty((len(self._dofs), len(self._dofs)))
        grown[:old, :old] = self._values
        for first in range(0, len(new), CHUNK):
            chunk = new[first : first + CHUNK]
            unit = np.zeros((len(self._place), len(chunk)))
            unit[chunk, np.arange(len(chunk))] = 1.0
            grown[:, old + first : old + first + len(chunk)] = solve_many(unit)[self._dofs]
        grown[old:, :old] = grown[:old, old:].T
        self._values = grown


def lu_factors(A: Array) -> tuple[Array, Array]:
    """Return the factors of a matrix (m, m) by SciPy's `lu_factor`.

    Raises
    ------
    LinAlgError
        If it is singular up to round-off.
    """
    with warnings.catch_warnings(action="ignore"):  # warning of an exactly zero pivot
        lu, pivots = lu_factor(A)
    if not (np.abs(np.diag(lu)) > _round_off(A) * np.abs(A).max(axis=0)).all():
        raise LinAlgError("singular")
    return lu, pivots


def symmetric(delassus: Array) -> Array:
    """Return the symmetric part of a matrix (m, m)."""
    return 0.5 * (delassus + delassus.T)


def solve_multipliers(delassus: Array, wanted: Array, C: Array | FieldCompliance | None) -> Array:
    """Return the multipliers (m,) [force] with ``(delassus + C) multiplier = wanted`` (m,) [length].

    C is a matrix (m, m), the diagonal (m,) of a diagonal one, or None; `delassus` (m, m) is overwritten.
    """
    C = C.dense() if isinstance(C, FieldCompliance) else C
    if C is not None and C.ndim == 1:
        delassus[np.diag_indices(len(C))] += C
    elif C is not None:
        delassus += C
    try:
        factor = cho_factor(delassus)
    except LinAlgError:
        return _smallest(delassus, wanted)
    repeated = factor[0].diagonal() ** 2 <= _round_off(delassus) * delassus.diagonal()
    return _smallest(delassus, wanted) if repeated.any() else cho_solve(factor, wanted)


def _smallest(delassus: Array, wanted: Array) -> Array:
    """Return the minimum-norm multipliers (m,) of linearly dependent rows."""
    return np.asarray(lstsq(delassus, wanted, cond=_round_off(delassus))[0])


def _round_off(delassus: Array) -> float:
    """Return the rounding error of a factorisation (m, m) over its diagonal."""
    return 10.0 * len(delassus) * float(np.finfo(float).eps)
