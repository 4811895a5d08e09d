"""Solutions under equations whose multipliers act through other rows than those of the equations: friction.

``K u + S u = f + F.T multiplier`` and ``B u = c``: a sliding contact holds its gap shut, but the force that does so drags
sideways, too. Unknowns are eliminated as they are without friction, forces move along the rows F; what is left is not
symmetric. The hierarchy of the equations alone preconditions it.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.errors import ConvergenceError
from fastcontact.linear.elimination.elimination import Elimination
from fastcontact.linear.krylov.gcr import ConjugateResiduals
from fastcontact.linear.multigrid.matrix import Given
from fastcontact.linear.protocol import Counters

Array = NDArray[np.float64]
MAX_ITERATIONS = 300


class Preconditioned(Protocol):
    """What a multigrid solver lends."""

    K: Given
    counters: Counters

    def tie(self, elimination: Elimination | None) -> None:
        """Change the hierarchy to that of the eliminated matrix."""
        ...

    def precondition(self, r: Array, norm: float, z: Array) -> None:
        """Fill z with an approximate solution for r that obeys the equations."""
        ...


def solve(
    solver: Preconditioned, iteration: ConjugateResiduals, f: Array, elimination: Elimination, springs: csr_array | None,
    guess: Array, enough: float,
) -> Array:  # fmt: skip
    """Return u (n,).

    Parameters
    ----------
    solver : Preconditioned
    iteration : ConjugateResiduals
    f : ndarray (n,)
    elimination : Elimination
    springs : csr_array (n, n), optional
        S, symmetric and positive semidefinite.
    guess : ndarray (n,)
    enough : float
        The 2-norm below which the residual is small enough.

    Raises
    ------
    ConvergenceError
        If it does not become so.
    """
    solver.tie(elimination)
    K, r = solver.K, iteration.r

    def multiply(p: Array, q: Array) -> None:
        K.combine(1.0, p, 0.0, q, q)
        if springs is not None:
            q += springs @ p
        elimination.condense(q)

    iteration.x[:] = guess
    elimination.complete(iteration.x, elimination.t)
    K.combine(-1.0, iteration.x, 1.0, f, r)
    if springs is not None:
        r -= springs @ iteration.x
    elimination.condense(r)
    iteration.start()
    made = 0
    while iteration.norm > enough:
        if made >= MAX_ITERATIONS or not iteration.step(multiply, solver.precondition):
            raise ConvergenceError(f"conjugate residuals stand at {iteration.norm / enough:.1e} times the tolerance")
        made += 1
        solver.counters.iterations += 1
    return iteration.x.copy()
