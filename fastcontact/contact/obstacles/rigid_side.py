"""A rigid obstacle as the primary side of a contact pair."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.obstacles import Obstacle

Array = NDArray[np.float64]


@dataclass(eq=False)
class RigidSide:
    """A rigid obstacle that may move.

    Attributes
    ----------
    obstacle : Obstacle
        Its shape, where it stands at rest.
    motion : ndarray (dim,)
        Its displacement where the multiplier of its history is 1 [length].
    now, before : ndarray (dim,)
        Its displacement, and that at the end of the step before [length].
    points : ndarray (0,)
        The nodes of the side: none.
    """

    obstacle: Obstacle
    motion: Array
    now: Array = field(init=False)
    before: Array = field(init=False)
    points: NDArray[np.int32] = field(init=False)

    def __post_init__(self) -> None:
        self.now = np.zeros_like(self.motion)
        self.before = np.zeros_like(self.motion)
        self.points = np.empty(0, np.int32)

    def move(self, multiplier: float) -> None:
        """Begin a step in which the obstacle stands at `multiplier` times its motion."""
        self.before = self.now
        self.now = multiplier * self.motion

    def facing(self, positions: Array) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Return (gap, normal, paired, offset) of points at `positions` (n, dim).

        Near there the gap is ``offset + normal . x``.
        """
        gap, normal = self.obstacle.distance(positions - self.now)
        paired = np.isfinite(gap)
        offset = np.where(paired, gap, 0.0) - np.einsum("nd,nd->n", normal, positions)
        return gap, normal, paired, offset
