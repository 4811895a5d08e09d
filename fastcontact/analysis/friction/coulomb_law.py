"""Unilateral contact and Coulomb's law as a complementarity function, scaled by the stiffness of each constraint.

To implement another law, begin here. Its tangential force is also used where a sliding constraint is linearised: in
`dense._step`, `eliminated.Eliminated` and the fallback `dense._on_edges`. Its parameters come from `PairOptions` through
`Constraints`; parameters that are forces are scaled where `Law` is created. `Law.state` and the formulations assume that a
constraint without friction needs no tangents.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.round_off import TINY


@dataclass(frozen=True, eq=False)
class Law:
    """Unilateral contact with Coulomb friction, as equations.

    Attributes
    ----------
    mu : ndarray (m,)
    equality : ndarray of bool (m,), optional
        Constraints that are equations: closed under any force.
    """

    mu: Array
    equality: Mask | None = None

    def trial(self, y: Array, gaps: Array) -> tuple[Array, Array, Array, Array]:
        """Return n - g, t - s, the norm of t - s and the radius of the disc."""
        n, t = y[0] - gaps[0], y[1:] - gaps[1:]
        return n, t, np.sqrt((t * t).sum(axis=0)), self.mu * np.maximum(n, 0.0)

    def residual(self, y: Array, gaps: Array) -> Array:
        """Return the residual (1 + k, m) of the complementarity function."""
        n, t, reach, radius = self.trial(y, gaps)
        inside = np.divide(radius, reach, out=np.ones_like(reach), where=reach > radius)
        pushed = np.maximum(n, 0.0) if self.equality is None else np.where(self.equality, n, np.maximum(n, 0.0))
        return np.vstack([y[0] - pushed, y[1:] - t * inside])

    def state(self, y: Array, gaps: Array) -> tuple[Mask, Mask]:
        """Return which constraints are closed, and which of those stick."""
        n, _, reach, radius = self.trial(y, gaps)
        closed = n > 0 if self.equality is None else (n > 0) | self.equality
        return closed, (n > 0) & (reach <= radius) & (self.mu > 0)

    def slide(self, y: Array, gaps: Array, sliding: Indices) -> tuple[Array, Array]:
        """Return the slip directions (k, q) of constraints `sliding` (q,), and by which factor (q,) t rotates with them."""
        _, t, reach, radius = self.trial(y, gaps)
        along = np.maximum(reach[sliding], TINY)
        return t[:, sliding] / along, np.minimum(radius[sliding] / along, 1.0)

    def linearised(self, y: Array, gaps: Array, rows: Indices, sticking: Mask) -> tuple[Array, Array]:
        """Return E and D (1 + k, 1 + k, q) of the equations ``E y + D gaps = 0`` of closed constraints `rows` (q,).

        Gaps and slips of those that stick, of m, vanish; others have ``t = mu n d``, where d, the direction of t - s, varies.
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
