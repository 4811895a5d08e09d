"""The methods that rigid shapes have in common."""

from __future__ import annotations

from typing import Protocol

from fastcontact.arrays import Array


class Obstacle(Protocol):
    """A rigid shape."""

    def distance(self, points: Array) -> tuple[Array, Array]:
        """Return the signed distance (n,) [length] of `points` (n, dim) [length], and the unit outward normals (n, dim) [-].

        The distance is infinite if a point cannot touch the obstacle.
        """
