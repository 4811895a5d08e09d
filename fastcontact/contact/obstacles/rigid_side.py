"""A rigid obstacle as the primary side of a contact pair."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.obstacles import Obstacle

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RigidSide:
    """A rigid obstacle that may move; where it stands is part of the configuration."""

    obstacle: Obstacle  # where it stands at rest
    motion: Array  # (dim,): its displacement where the multiplier of its history is 1 [length]

    @property
    def points(self) -> NDArray[np.int32]:
        """The nodes of the side (0,): none."""
        return np.empty(0, np.int32)

    def facing(self, positions: Array, displacement: Array) -> tuple[Array, Array, NDArray[np.bool_], Array]:
        """Return (gap, normal, paired, offset) of points at `positions` (n, dim), the obstacle displaced (dim,) [length].

        Near there the gap is ``offset + normal . x``.
        """
        gap, normal = self.obstacle.distance(positions - displacement)
        paired = np.isfinite(gap)
        offset = np.where(paired, gap, 0.0) - np.einsum("nd,nd->n", normal, positions)
        return gap, normal, paired, offset
