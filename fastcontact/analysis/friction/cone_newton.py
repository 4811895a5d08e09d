r"""Semismooth Newton method for contact with Coulomb friction, independent of the operator from forces to gaps and slips.

With normal forces n, tangential ones t, gaps g and slips s, scaled such that each constraint has a compliance near one,
the solution is the zero of

.. math:: n - [n - g]_+, \qquad t - P(t - s), \qquad P \text{ the projection on the disc of radius } \mu [n - g]_+

(Alart and Curnier, 1991). These residuals are semismooth; a line search decreases their norm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fastcontact.analysis.friction.coulomb_law import Law
from fastcontact.arrays import Array, Mask

# Residual of a solution over the largest force.
EXACT = 1e-12
# Largest number of Newton iterations, smallest damping factor, and number of undamped steps against the residual after
# which to stop.
PATIENCE, SHORTEST, UPHILL = 40, 1e-3, 3


@dataclass(frozen=True, eq=False)
class Forces:
    """The solution, or the best iterate. Forces and gaps have the shape (1 + k, m), with normal components first.

    Attributes
    ----------
    y, gaps : ndarray (1 + k, m)
        Forces; gaps and slips.
    closed, sticking : ndarray of bool (m,)
    settled : bool
        Whether the iteration has converged.
    residual : float
        Largest residual over the largest force.
    iterations : int
        Newton iterations.
    """

    y: Array
    gaps: Array
    closed: Mask
    sticking: Mask
    settled: bool
    residual: float
    iterations: int


class Linearised(Protocol):
    """Map from forces to gaps and slips, and its Newton step.

    Attributes
    ----------
    law : Law
    round_off : float
        Bound of the round-off of gaps and slips.
    """

    law: Law
    round_off: float

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        """Return forces and gaps (1 + k, m) that solve the equations of a contact state, linearised at `y` and `gaps`.

        Closed gaps and sticking slips vanish; sliding constraints have ``t = mu n d`` with the direction d of t - s, which in
        three dimensions varies with t - s.
        """
        ...


def newton(
    problem: Linearised, y: Array, gaps: Array, exact: float = EXACT, patience: int | None = None,
    line_search: bool = True, least: int = 0,
) -> Forces:  # fmt: skip
    """Find a zero of the residual, starting from forces and gaps (1 + k, m).

    Parameters
    ----------
    problem : Linearised
    y, gaps : ndarray (1 + k, m)
    exact : float
        Tolerance of the residual over the largest force.
    patience : int, optional
        Iterations allowed; PATIENCE by default.
    line_search : bool
        Whether steps are shortened until the residual decreases; otherwise full steps are taken.
    least : int
        Minimum number of iterations.
    """
    patience = PATIENCE if patience is None else patience
    law = problem.law
    residual = law.residual(y, gaps)
    size = float(np.linalg.norm(residual))
    uphill = iteration = 0
    best = y, gaps, np.inf
    for iteration in range(patience + 1):
        largest = float(np.abs(y).max())
        off = float(np.abs(residual).max())
        relative = off / largest if largest else float(off > problem.round_off)
        if relative < best[2]:
            best = y, gaps, relative
        settled = iteration >= least and off <= exact * largest + problem.round_off
        if settled or uphill > UPHILL or iteration == patience:
            break
        trial, gaps_there = problem.step(y, gaps, *law.state(y, gaps))
        step, change = trial - y, gaps_there - gaps
        damping = 1.0
        while (
            line_search
            and np.linalg.norm(law.residual(y + damping * step, gaps + damping * change)) > (1 - 1e-4 * damping) * size
        ):
            damping *= 0.5
            if damping < SHORTEST:  # at a kink there may be no step that decreases the residual: take the full one
                damping, uphill = 1.0, uphill + 1
                break
        y, gaps = (trial, gaps_there) if damping == 1.0 else (y + damping * step, gaps + damping * change)
        residual = law.residual(y, gaps)
        size = float(np.linalg.norm(residual))
    if not settled:
        y, gaps, relative = best
    return Forces(y, gaps, *law.state(y, gaps), settled, relative, iteration)
