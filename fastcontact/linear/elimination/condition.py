"""Condition estimate of a factorised matrix from a few solutions.

The diagonal of triangular factors is no indicator: for two equal rows among many it may be as large as for the others.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, onenormest

from fastcontact.arrays import Array

Apply = Callable[[Array], Array]


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
