"""Where a load step starts: displacements and contact forces of the last two steps, extended along the load."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# Loads that grow by more than so many last increments at once are not extrapolated to.
FARTHEST = 2.0


class Extrapolation:
    """Remembers the last two converged steps and extends them linearly.

    Attributes
    ----------
    ratio : float
        The present load increment in units of the last one; zero where there is nothing to extend.
    """

    def __init__(self) -> None:
        self.ratio = 0.0
        self._loads: list[Array] = []
        self._states: list[tuple[Array, dict[str, tuple[Array, Array]]]] = []

    def load(self, *parts: Array) -> None:
        """Take the loads of the step that begins: prescribed displacements and forces, each its own array."""
        moved = next((part for part in parts if part.any()), parts[0])
        self._loads = [*self._loads[-2:], moved.copy()]
        self.ratio = 0.0
        if len(self._states) == 2 and len(self._loads) == 3 and len({len(load) for load in self._loads}) == 1:
            now, last = self._loads[2] - self._loads[1], self._loads[1] - self._loads[0]
            size = float(np.sum(last * last))
            ratio = float(np.sum(now * last)) / size if size else 0.0
            self.ratio = ratio if 0.0 < ratio <= FARTHEST else 0.0

    def converged(self, u: Array, contact: dict[str, tuple[Array, Array]]) -> None:
        """Take the solution of the step: displacements (n,) and, by pair, gaps and multipliers (m,)."""
        self._states = [*self._states[-1:], (u.copy(), contact)]

    def displacement(self, u: Array) -> Array:
        """Return the displacements (n,) to start from; `u` are the last ones."""
        if not self.ratio:
            return u
        (before, _), (last, _) = self._states
        return last + self.ratio * (last - before)

    def active(self, name: str, last_active: Mask) -> Mask:
        """Return the active set to start a pair from; `last_active` (m,) is the last one."""
        if not self.ratio:
            return last_active
        (_, first), (_, second) = self._states
        if name not in first or name not in second:
            return last_active
        (gap0, force0), (gap1, force1) = first[name], second[name]
        if not len(gap0) == len(gap1) == len(last_active):
            return last_active
        with np.errstate(invalid="ignore"):  # gaps of nodes that face nothing are infinite
            gap, force = gap1 + self.ratio * (gap1 - gap0), force1 + self.ratio * (force1 - force0)
        return np.where(last_active, force > 0.0, gap < 0.0)
