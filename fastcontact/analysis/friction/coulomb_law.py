"""Unilateral contact and Coulomb's law, expressed as a nonsmooth complementarity function (Alart and Curnier, 1991).

The unknowns of a constraint are its normal force n and its k tangential forces t. Its gap g and its slips s along the k
tangents belong to these forces. All values are scaled such that the compliance of each constraint is near one: forces, gaps
and slips then have the same unit, and ``n - g`` is meaningful.

To implement another law, begin here. The tangential force of the law is also used in `dense._step` and
`eliminated.Eliminated`, which linearise sliding constraints, and in the fallback `dense._on_edges`. Parameters of the law
come from `PairOptions` through `Constraints`; parameters that are forces must be scaled by the caller that creates the
`Law`. `Law.state` and the formulations assume that a constraint without friction needs no tangents.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.round_off import TINY


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
    equality : ndarray of bool (m,), optional
        Constraints that are equations: they are closed whatever the sign of the normal force.
    """

    mu: Array
    equality: Mask | None = None

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
        inside = np.divide(radius, reach, out=np.ones_like(reach), where=reach > radius)
        pushed = np.maximum(n, 0.0) if self.equality is None else np.where(self.equality, n, np.maximum(n, 0.0))
        return np.vstack([y[0] - pushed, y[1:] - t * inside])

    def state(self, y: Array, gaps: Array) -> tuple[Mask, Mask]:
        """Return which constraints (m,) are closed, and which (m,) of the closed ones stick."""
        n, _, reach, radius = self.trial(y, gaps)
        closed = n > 0 if self.equality is None else (n > 0) | self.equality
        return closed, (n > 0) & (reach <= radius) & (self.mu > 0)

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
        along = np.maximum(reach[sliding], TINY)
        return t[:, sliding] / along, np.minimum(radius[sliding] / along, 1.0)

    def linearised(self, y: Array, gaps: Array, rows: Indices, sticking: Mask) -> tuple[Array, Array]:
        """Return E and D (1 + k, 1 + k, q) of the equations ``E y + D gaps = 0`` of the closed constraints `rows` (q,).

        They are the equations of the semismooth Newton method. If a constraint is `sticking` (m,), its gap and its slips
        vanish. If it slides, its gap vanishes and ``t = mu n d``, where the direction d of t - s is linearised.
        """
        parts, slipping = np.arange(len(y)), np.flatnonzero(~sticking[rows])
        E, D = np.zeros((2, len(y), len(y), len(rows)))
        D[parts, parts] = 1.0
        d, turning = self.slide(y, gaps, rows[slipping])
        turn = turning * (np.eye(len(d))[:, :, None] - d[:, None] * d)
        D[1:, 1:, slipping] = turn
        E[1:, 1:, slipping] = np.eye(len(d))[:, :, None] - turn
        E[1:, 0, slipping] = -self.mu[rows[slipping]] * d
        return E, D
