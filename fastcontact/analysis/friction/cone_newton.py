r"""Unilateral contact and Coulomb's law as a nonsmooth complementarity function, and Newton's method for it.

The unknowns of a constraint are its normal force n and its k tangential forces t. Its gap g and its slips s along the k
tangents belong to these forces. All values are scaled such that the compliance of each constraint is near one. Forces, gaps
and slips then have the same unit, and ``n - g`` is meaningful. The solution is the zero of

.. math:: n - [n - g]_+, \qquad t - P(t - s), \qquad P \text{ the projection onto the disc of radius } \mu [n - g]_+

(Alart and Curnier, 1991), where :math:`[x]_+ = \max(x, 0)`. These residuals are semismooth functions of n and t. A line
search ensures that their norm decreases. Newton's method does not depend on how gaps and slips are computed from the contact
forces, see `Linearised`.

To implement another law, begin with `Law`. The tangential force of the law is also used in `eliminated.Eliminated`,
which linearises sliding constraints, and in the fallback `dense._on_edges`. Parameters of the law
come from `PairOptions` through `Constraints`; parameters that are forces must be scaled by the caller that creates the
`Law`. `Law.state` and the formulations assume that a constraint without friction needs no tangents.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fastcontact.analysis.criteria import DECREASE, HALVINGS, MAX_NEWTON_ITERATIONS
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.round_off import ROUND_OFF, TINY


@dataclass(frozen=True, eq=False)
class Law:
    """Unilateral contact with Coulomb friction of m constraints.

    The methods take forces `y` and `gaps`, both scaled, with the shape (1 + k, m): the first row of `y` contains the normal
    forces n and its other rows the tangential forces t; the first row of `gaps` contains the gaps g, its other rows the
    slips s.

    Attributes
    ----------
    mu : ndarray (m,)
        Coefficients of friction [-].
    equality : ndarray of bool (m,)
        Constraints that are equations, which are closed for either sign of the normal force.
    """

    mu: Array
    equality: Mask

    def trial(self, y: Array, gaps: Array) -> tuple[Array, Array, Array, Array]:
        """Return ``n - g`` (m,), ``t - s`` (k, m), the norm (m,) of t - s, and the radius (m,) of the friction disc.

        The radius is ``mu * max(n - g, 0)``.
        """
        n, t = y[0] - gaps[0], y[1:] - gaps[1:]
        return n, t, np.sqrt((t * t).sum(axis=0)), self.mu * np.maximum(n, 0.0)

    def residual(self, y: Array, gaps: Array) -> Array:
        """Return the complementarity function (1 + k, m), which vanishes at the solution.

        Its rows are ``n - max(n - g, 0)`` and ``t - P(t - s)``, where P is the projection onto the friction disc.
        """
        n, t, reach, radius = self.trial(y, gaps)
        scale = np.divide(radius, reach, out=np.ones_like(reach), where=reach > radius)
        normal = np.where(self.equality, n, np.maximum(n, 0.0))
        return np.vstack([y[0] - normal, y[1:] - t * scale])

    def state(self, y: Array, gaps: Array) -> tuple[Mask, Mask]:
        """Return which constraints (m,) are closed, and which (m,) of the closed ones stick."""
        n, _, reach, radius = self.trial(y, gaps)
        return (n > 0) | self.equality, (n > 0) & (reach <= radius) & (self.mu > 0)

    def slide(self, y: Array, gaps: Array, sliding: Indices) -> tuple[Array, Array]:
        """Return the directions d of t - s and their influence on t, at the constraints numbered `sliding` (q,).

        Returns
        -------
        d : ndarray (k, q)
            Unit vectors.
        turning : ndarray (q,)
            Derivative of t with respect to the component of t - s perpendicular to d: the radius of the friction disc over
            the norm of t - s, at most 1.
        """
        _, t, reach, radius = self.trial(y, gaps)
        length = np.maximum(reach[sliding], TINY)
        return t[:, sliding] / length, np.minimum(radius[sliding] / length, 1.0)

    def linearised(self, y: Array, gaps: Array, rows: Indices, sticking: Mask) -> tuple[Array, Array]:
        """Return E and D (1 + k, 1 + k, q) of the equations ``E y + D gaps = 0`` of the closed constraints `rows` (q,).

        They are the equations of the semismooth Newton method. If a constraint is `sticking` (m,), its gap and its slips
        vanish. If it slides, its gap vanishes and ``t = mu n d``, where the direction d of t - s is linearised.
        """
        components, slipping = np.arange(len(y)), np.flatnonzero(~sticking[rows])
        E, D = np.zeros((2, len(y), len(y), len(rows)))
        D[components, components] = 1.0
        d, turning = self.slide(y, gaps, rows[slipping])
        projection = turning * (np.eye(len(d))[:, :, None] - d[:, None] * d)
        D[1:, 1:, slipping] = projection
        E[1:, 1:, slipping] = np.eye(len(d))[:, :, None] - projection
        E[1:, 0, slipping] = -self.mu[rows[slipping]] * d
        return E, D


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
    problem: Linearised, y: Array, gaps: Array, tolerance: float = ROUND_OFF, max_iterations: int | None = None,
    line_search: bool = True, min_iterations: int = 0,
) -> Forces:  # fmt: skip
    """Return the zero of the residual, or the best iterate.

    Parameters
    ----------
    problem : Linearised
    y, gaps : ndarray (1 + k, m)
        Initial forces, and the gaps and slips that belong to them.
    tolerance : float
        Tolerance of the residual, relative to the largest force [-].
    max_iterations : int, optional
        Largest number of iterations; MAX_NEWTON_ITERATIONS by default.
    line_search : bool
        Whether a step is halved until the residual decreases. Otherwise full steps are taken.
    min_iterations : int
        Smallest number of iterations.
    """
    max_iterations = MAX_NEWTON_ITERATIONS if max_iterations is None else max_iterations
    law = problem.law
    residual = law.residual(y, gaps)
    norm = float(np.linalg.norm(residual))
    best = y, gaps, np.inf
    for iteration in range(max_iterations + 1):
        largest = float(np.abs(y).max())
        largest_residual = float(np.abs(residual).max())
        relative = largest_residual / largest if largest else float(largest_residual > problem.round_off)
        if relative < best[2]:
            best = y, gaps, relative
        settled = iteration >= min_iterations and largest_residual <= tolerance * largest + problem.round_off
        if settled or iteration == max_iterations:
            break
        trial, trial_gaps = problem.step(y, gaps, *law.state(y, gaps))
        step, change = trial - y, trial_gaps - gaps
        damping = 1.0
        while (
            line_search
            and np.linalg.norm(law.residual(y + damping * step, gaps + damping * change))
            > (1 - DECREASE * damping) * norm
        ):
            damping *= 0.5
            if damping < 0.5**HALVINGS:  # at a kink no step may decrease the residual: take the full step
                damping = 1.0
                break
        y, gaps = (trial, trial_gaps) if damping == 1.0 else (y + damping * step, gaps + damping * change)
        residual = law.residual(y, gaps)
        norm = float(np.linalg.norm(residual))
    if not settled:
        y, gaps, relative = best
    return Forces(y, gaps, *law.state(y, gaps), settled, relative, iteration)
