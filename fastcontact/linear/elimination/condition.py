"""Condition estimate of a factorised matrix from a few solutions.

The diagonal of triangular factors does not tell: that of two equal rows among many may be as large as the others'.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array

Apply = Callable[[Array], Array]
# Steps of the estimate; two or three are the rule.
STEPS = 5


def condition(P: csr_array, solve: Apply, solve_transposed: Apply) -> float:
    """Return an estimate of the condition number ``max(|P^-1| |P| 1)`` of P (m, m) (Skeel, 1979).

    It does not depend on the scale of its rows.

    Parameters
    ----------
    P : csr_array (m, m)
    solve, solve_transposed : callable
        Return ``P^-1 b`` and ``P^-T b``, shape (m,).
    """
    rows = np.asarray(abs(P).sum(axis=1), np.float64).ravel()
    return one_norm(lambda x: rows * solve_transposed(x), lambda x: solve(rows * x), len(rows))


def one_norm(apply: Apply, apply_transposed: Apply, m: int) -> float:
    """Return an estimate of the largest column sum of ``|A|``, A (m, m) known by its products with vectors.

    A lower bound, seldom less than a third of it (Hager, 1984; Higham, 1988). Infinite where products overflow.
    """
    alternating = np.where(np.arange(m) % 2 == 0, 1.0, -1.0) * (1.0 + np.arange(m) / max(m - 1, 1))
    estimate = float(np.abs(apply(alternating)).sum()) * 2.0 / (3.0 * m)
    x = np.full(m, 1.0 / m)
    for _ in range(STEPS):
        y = apply(x)
        estimate = np.maximum(estimate, np.abs(y).sum())
        z = apply_transposed(np.where(y < 0.0, -1.0, 1.0))
        largest = int(np.abs(z).argmax())
        if not np.abs(z[largest]) > z @ x:
            break
        x = np.zeros(m)
        x[largest] = 1.0
    return float(estimate) if np.isfinite(estimate) else np.inf
