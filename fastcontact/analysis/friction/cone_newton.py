r"""Semismooth Newton method for contact with Coulomb friction.

The method does not depend on how gaps and slips are computed from the contact forces, see `Linearised`. Let n be the normal
forces, t the tangential forces, g the gaps and s the slips, scaled such that each constraint has a compliance near one. The
solution is the zero of

.. math:: n - [n - g]_+, \qquad t - P(t - s), \qquad P \text{ the projection on the disc of radius } \mu [n - g]_+

(Alart and Curnier, 1991), where :math:`[x]_+ = \max(x, 0)`. These residuals are semismooth functions of n and t. A line
search ensures that their norm decreases.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fastcontact.analysis.friction.coulomb_law import Law
from fastcontact.arrays import Array, Mask
from fastcontact.round_off import ROUND_OFF

# Largest number of Newton iterations, and smallest damping factor.
PATIENCE, SHORTEST = 40, 1e-3


@dataclass(frozen=True, eq=False)
class Forces:
    """Solution of Newton's method, or the best iterate if it has not converged.

    Attributes
    ----------
    y : ndarray (1 + k, m)
        Normal forces, then the tangential forces along each of k tangents.
    gaps : ndarray (1 + k, m)
        Gaps, then the slips along each tangent.
    closed, sticking : ndarray of bool (m,)
        Constraints that are closed, and closed constraints that stick.
    settled : bool
        Whether the iteration has converged.
    residual : float
        Largest residual, relative to the largest force [-].
    iterations : int
        Number of Newton iterations.
    """

    y: Array
    gaps: Array
    closed: Mask
    sticking: Mask
    settled: bool
    residual: float
    iterations: int


class Linearised(Protocol):
    """Contact problem whose Newton step can be computed.

    Attributes
    ----------
    law : Law
    round_off : float
        Bound of the round-off of gaps and slips, in their scaled unit.
    """

    law: Law
    round_off: float

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        """Return forces and gaps (1 + k, m) that solve the equations of a contact state, linearised at `y` and `gaps`.

        The gaps of `closed` constraints (m,) and the slips of `sticking` ones (m,) vanish. Sliding constraints satisfy
        ``t = mu n d`` with the direction d of t - s, which in 3D varies with t - s. Open constraints have no forces.
        """
        ...


def newton(
    problem: Linearised, y: Array, gaps: Array, exact: float = ROUND_OFF, patience: int | None = None,
    line_search: bool = True, least: int = 0,
) -> Forces:  # fmt: skip
    """Return the zero of the residual, or the best iterate.

    Parameters
    ----------
    problem : Linearised
    y, gaps : ndarray (1 + k, m)
        Initial forces, and the gaps and slips that belong to them.
    exact : float
        Tolerance of the residual, relative to the largest force [-].
    patience : int, optional
        Largest number of iterations; PATIENCE by default.
    line_search : bool
        Whether a step is halved until the residual decreases. Otherwise full steps are taken.
    least : int
        Smallest number of iterations.
    """
    patience = PATIENCE if patience is None else patience
    law = problem.law
    residual = law.residual(y, gaps)
    size = float(np.linalg.norm(residual))
    best = y, gaps, np.inf
    for iteration in range(patience + 1):
        largest = float(np.abs(y).max())
        off = float(np.abs(residual).max())
        relative = off / largest if largest else float(off > problem.round_off)
        if relative < best[2]:
            best = y, gaps, relative
        settled = iteration >= least and off <= exact * largest + problem.round_off
        if settled or iteration == patience:
            break
        trial, gaps_there = problem.step(y, gaps, *law.state(y, gaps))
        step, change = trial - y, gaps_there - gaps
        damping = 1.0
        while (
            line_search
            and np.linalg.norm(law.residual(y + damping * step, gaps + damping * change)) > (1 - 1e-4 * damping) * size
        ):
            damping *= 0.5
            if damping < SHORTEST:  # at a kink there may be no step that decreases the residual: take the full step
                damping = 1.0
                break
        y, gaps = (trial, gaps_there) if damping == 1.0 else (y + damping * step, gaps + damping * change)
        residual = law.residual(y, gaps)
        size = float(np.linalg.norm(residual))
    if not settled:
        y, gaps, relative = best
    return Forces(y, gaps, *law.state(y, gaps), settled, relative, iteration)
