"""Stiffness and mass reduced to the motions that supports, multi-point constraints and closed contact allow."""

from __future__ import annotations

import numpy as np
from scipy.linalg import qr, solve_triangular
from scipy.sparse import bsr_array, csr_array, diags_array

from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.constrained_system import System, diagonal_of, supports_apart
from fastcontact.linear.elimination.coupled_pivots import RepeatedError
from fastcontact.linear.elimination.elimination import eliminate
from fastcontact.round_off import LENGTH_ROUND_OFF


class Reduced:
    """Motions ``u = T v`` of a system under further equations ``rows @ u = 0``.

    Parameters
    ----------
    system : System
        System with supports and multi-point constraints.
    mass : bsr_array (n, n)
        [mass].
    rows : csr_array (m, n)
        Equations, possibly linearly dependent [-].
    nodes : ndarray of int (m,)
        A node of each row, whose unknowns are preferred for elimination.

    Attributes
    ----------
    K, M : bsr_array (n, n)
        Stiffness [force / length] and mass [mass] of v; rows that are not free have only the diagonal in K, and are
        empty in M.
    free : ndarray of bool (n,)
        Components of v that are unknowns.
    """

    def __init__(self, system: System, mass: bsr_array, rows: csr_array, nodes: Indices) -> None:
        n, size = mass.shape[0], mass.blocksize[0]
        unit = diags_array(system.free.astype(float))
        self._T = csr_array(unit if system.T is None else system.T @ unit)
        self.K, self.free = system.matrix, system.free.copy()
        rows_of_unknowns = system.rows(rows, np.zeros(rows.shape[0]), np.zeros(n))[0]
        kept = np.flatnonzero(np.diff(rows_of_unknowns.indptr) > 0)
        if len(kept):
            pivots, weights = _eliminated(csr_array(rows_of_unknowns[kept]), nodes[kept], size)
            self.free[pivots] = False
            at_pivots = csr_array((np.ones(len(pivots)), (pivots, np.arange(len(pivots)))), shape=(n, len(pivots)))
            among = csr_array(diags_array(self.free.astype(float)) + at_pivots @ weights)
            K = csr_array(among.T @ self.K.tocsr() @ among).tobsr((size, size))
            K.sort_indices()
            self.K, self._T = supports_apart(K, ~self.free, diagonal_of(K))[0], csr_array(self._T @ among)
        self.M = csr_array(self._T.T @ mass.tocsr() @ self._T).tobsr((size, size))

    def displacement(self, v: Array) -> Array:
        """Return the displacements (n, k) of motions v (n, k) [unit of v]."""
        return np.asarray(self._T @ v)


def _eliminated(rows: csr_array, nodes: Indices, size: int) -> tuple[Indices, csr_array]:
    """Return the unknowns (p,) that equations (m, n) eliminate, and their weights (p, n) of the others.

    Linearly dependent equations, as at corners where several sides meet, are dropped.
    """
    try:
        elimination = eliminate(rows, np.zeros(rows.shape[0]), None, nodes, size)
    except RepeatedError:
        return _independent(rows)
    return elimination.pivots, elimination.full_weights()


def _independent(rows: csr_array) -> tuple[Indices, csr_array]:
    columns = np.unique(rows.indices)
    _, R, order = qr(rows[:, columns].toarray(), mode="economic", pivoting=True)
    rank = int((np.abs(np.diag(R)) > LENGTH_ROUND_OFF * abs(R[0, 0])).sum())
    weights, others = csr_array(-solve_triangular(R[:rank, :rank], R[:rank, rank:])), columns[order[rank:]]
    of_all = csr_array((weights.data, others[weights.indices], weights.indptr), shape=(rank, rows.shape[1]))
    return columns[order[:rank]].astype(np.intp), of_all
