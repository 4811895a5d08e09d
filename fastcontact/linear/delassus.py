"""Schur complement of linear constraints, the Delassus operator.

A system ``K u = f + B.T multiplier`` with the constraints ``B u + C multiplier = c`` is reduced to
``(B K^-1 B.T + C) multiplier = c - B K^-1 f``. The symbols are those of `linear.protocol`. The matrix ``B K^-1 B.T`` depends
only on the rows and columns of ``K^-1`` that belong to the degrees of freedom in B. They are computed when they are first
needed, and stored. For a new active set or pairing with the same degrees of freedom, only a small dense system and one
system with the matrix K are solved.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve, lstsq
from scipy.linalg.lapack import dgetrf, dgetrs
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices, scattered
from fastcontact.errors import ContactError, ConvergenceError
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.sparse_rows import without_zeros

# Largest number of constraints whose Delassus operator is formed and factorised. A matrix with 20 000 rows occupies 3.2 GB,
# and its factorisation takes minutes. With friction, Newton's method factorises a nonsymmetric matrix several times for each
# pairing. With 6 000 rows, one factorisation takes ten seconds.
MAX_ROWS, MAX_ROWS_WITH_FRICTION = 20_000, 6_000
# Options of a contact pair whose constraints can be eliminated, so that the Delassus operator is not formed.
ELIMINABLE = 'formulation="mortar" with multipliers="dual"'


class TooManyColumnsError(ConvergenceError):
    """Raised if an iterative solver would have to compute too many columns of the inverse."""

    def __init__(self, count: int) -> None:
        super().__init__(
            f"the contact requires {count} columns of the inverse stiffness matrix, each of which is the solution of a "
            "linear system, since its constraints cannot be eliminated, or friction does not converge with eliminated "
            f"constraints: use the direct solver, or {ELIMINABLE} and pairs that share no node"
        )


def check_rows(count: int, limit: int | None = None) -> None:
    """Check that the number of constraints whose Delassus operator is formed is not too large.

    Raises
    ------
    ContactError
        If `count` exceeds `limit`, by default MAX_ROWS.
    """
    limit = MAX_ROWS if limit is None else limit
    if count > limit:
        raise ContactError(
            f"the contact needs the full compliance of {count} constraints, a matrix of {8e-9 * count**2:.1f} GB that is "
            f"factorised repeatedly (at most {limit} constraints are accepted), since the solver is direct or they cannot be "
            f'eliminated: use {ELIMINABLE}, with linear_solver="amg", or a coarser or smaller secondary side'
        )


class InverseColumns:
    """Submatrix of ``K^-1`` that belongs to the degrees of freedom requested so far.

    Parameters
    ----------
    n : int
        Size of K.
    entries : method
        Method of the solver, or of the factors, that returns the entries (m, k) of ``K^-1`` in given rows (m,) and columns
        (k,) [length / force].
    limit : int, optional
        Largest number of columns; unlimited by default.

    Attributes
    ----------
    requests : list of ndarray of int
        Degrees of freedom of each request. The order of the requests matters, because round-off and the errors of iterative
        solutions depend on it.
    """

    def __init__(self, n: int, entries: Callable[[Indices, Indices], Array], limit: int | None = None) -> None:
        self._limit = n if limit is None else limit
        # The reference is weak, because a reference cycle would keep the factors of the solver, which are large, in memory.
        self._entries = weakref.WeakMethod(entries)
        self._position = np.full(n, -1, np.intp)  # of each degree of freedom in `_dofs`
        self._dofs = np.empty(0, np.intp)
        self._values = np.empty((0, 0))
        self.requests: list[Indices] = []

    def store(self, dofs: Indices, values: Array) -> None:
        """Store the submatrix `values` (k, k) of ``K^-1`` for `dofs` (k,) [length / force], computed by the caller.

        This method must be called before any request.
        """
        self._dofs, self._values = dofs, values
        self._position[dofs] = np.arange(len(dofs))

    def delassus(self, R: csr_array) -> Array:
        """Return ``R K^-1 R.T`` (m, m) [length / force] for a sparse matrix R (m, n)."""
        check_rows(R.shape[0])
        R = without_zeros(R.copy())
        column = self._positions(R.indices)
        rows = csr_array((R.data, column, R.indptr), shape=(R.shape[0], len(self._dofs)))
        return symmetric_part(np.asarray(rows @ (rows @ self._values).T))

    def put_back(self, requests: Sequence[Indices]) -> None:
        """Restore the state after the given `requests`, in this order; solve only for columns that are not stored."""
        pairs = zip(self.requests, requests, strict=False)
        n_equal = next((i for i, pair in enumerate(pairs) if not np.array_equal(*pair)), len(requests))
        if n_discarded := sum(len(dofs) for dofs in self.requests[n_equal:]):
            self._position[self._dofs[-n_discarded:]] = -1
            self._dofs = self._dofs[:-n_discarded]
            self._values = self._values[:-n_discarded, :-n_discarded].copy()
        del self.requests[n_equal:]
        for dofs in requests[len(self.requests) :]:
            self._positions(dofs)

    def _positions(self, dofs: NDArray[np.integer]) -> Indices:
        """Return the positions (k,) of `dofs` (k,) among the stored columns, after computing missing columns.

        A degree of freedom may occur more than once in `dofs`.
        """
        new_dofs = np.unique(dofs[self._position[dofs] < 0]).astype(np.intp)
        if len(new_dofs):
            self._extend(new_dofs)
        return self._position[dofs]

    def _extend(self, new_dofs: Indices) -> None:
        """Compute the columns of the degrees of freedom `new_dofs` (k,), and store them."""
        n_old = len(self._dofs)
        if n_old + len(new_dofs) > self._limit:
            raise TooManyColumnsError(n_old + len(new_dofs))
        self.requests.append(new_dofs)
        self._dofs = np.concatenate([self._dofs, new_dofs])
        self._position[new_dofs] = np.arange(n_old, len(self._dofs))
        entries = self._entries()
        assert entries is not None, "the solver of these columns no longer exists"
        extended = np.empty((len(self._dofs), len(self._dofs)))
        extended[:n_old, :n_old] = self._values
        extended[:, n_old:] = entries(self._dofs, new_dofs)
        extended[n_old:, :n_old] = extended[:n_old, n_old:].T
        self._values = extended


def inverse_entries(n: int, solve: Callable[[Array], Array], rows: Indices, columns: Indices) -> Array:
    """Return the entries (m, k) of ``K^-1`` in `rows` (m,) and `columns` (k,); `solve` is called for each column."""
    entries = np.empty((len(rows), len(columns)))
    for k, column in enumerate(columns):
        entries[:, k] = solve(scattered(1.0, column, n))[rows]
    return entries


def lu_solver(A: Array) -> Callable[[Array], Array]:
    """Return a function that solves systems with a matrix A (m, m), which is factorised once.

    LAPACK is called directly, because the overhead of the functions of `scipy.linalg` exceeds the cost of solving a small
    system.

    Raises
    ------
    LinAlgError
        If A is singular up to round-off.
    """
    lu, pivots, _ = dgetrf(A)  # `scipy.linalg.lu_factor` would warn of a zero pivot, for which an error is raised below
    if not (np.abs(np.diag(lu)) > _round_off(A) * np.abs(A).max(axis=0)).all():
        raise LinAlgError("singular")
    return lambda right_side: dgetrs(lu, pivots, right_side)[0]


def symmetric_part(delassus: Array) -> Array:
    """Return the symmetric part of a matrix (m, m)."""
    return 0.5 * (delassus + delassus.T)


def solve_multipliers(delassus: Array, rhs: Array, C: Array | FieldCompliance | None) -> Array:
    """Return the multipliers with ``(delassus + C) multiplier = rhs``.

    If the matrix is singular up to round-off, the least-squares solution of minimum norm is returned.

    Parameters
    ----------
    delassus : ndarray (m, m)
        Delassus operator; it is overwritten [length / force].
    rhs : ndarray (m,)
        Right-hand side [length].
    C : ndarray (m, m) or (m,) or FieldCompliance, optional
        Compliance of the constraints, or the diagonal of a diagonal compliance matrix [length / force].

    Returns
    -------
    ndarray (m,)
        Multipliers [force].
    """
    C = C.dense() if isinstance(C, FieldCompliance) else C
    if C is not None and C.ndim == 1:
        delassus[np.diag_indices(len(C))] += C
    elif C is not None:
        delassus += C
    try:
        factor = cho_factor(delassus)
    except LinAlgError:
        pass
    else:
        if not (factor[0].diagonal() ** 2 <= _round_off(delassus) * delassus.diagonal()).any():
            return cho_solve(factor, rhs)
    return np.asarray(lstsq(delassus, rhs, cond=_round_off(delassus))[0])


def _round_off(delassus: Array) -> float:
    """Return a bound on the round-off in the pivots of a matrix (m, m), relative to its diagonal [-]."""
    return 10.0 * len(delassus) * float(np.finfo(float).eps)
