"""A rigid obstacle as the primary side of a contact pair."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import REFUSAL, Array, Mask, Numbers, is_masked
from fastcontact.contact.obstacles import Obstacle
from fastcontact.contact.obstacles.rotation import Rotation
from fastcontact.errors import ContactError


@dataclass(frozen=True, eq=False)
class Pose:
    """Position and rotation of a rigid obstacle.

    Attributes
    ----------
    displacement : ndarray (dim,)
        [length].
    angle : float
        Rotation angle [radian].
    """

    displacement: Array
    angle: float = 0.0


@dataclass(frozen=True, eq=False)
class RigidSide:
    """A rigid obstacle that may translate and rotate; its position is part of the configuration."""

    obstacle: Obstacle  # in its initial position
    motion: Array  # (dim,): its displacement where the multiplier of its history is 1 [length]
    rotation: Rotation | None = None

    @property
    def points(self) -> Numbers:
        """The nodes of the side (0,): none."""
        return np.empty(0, np.int32)

    def facing(self, positions: Array, at: Pose) -> tuple[Array, Array, Mask, Array]:
        """Return (gap, normal, paired, offset) of points at `positions` (n, dim) [length].

        Near a position x the gap is ``offset + normal . x``.
        """
        local = positions - at.displacement
        if self.rotation is None or at.angle == 0.0:
            gap, normal = self._distance(local)
        else:
            turned, centre = self.rotation.matrix(at.angle), np.array(self.rotation.centre)
            gap, normal = self._distance((local - centre) @ turned + centre)
            normal = normal @ turned.T
        paired = np.isfinite(gap)
        offset = np.where(paired, gap, 0.0) - np.einsum("nd,nd->n", normal, positions)
        return gap, normal, paired, offset

    def _distance(self, points: Array) -> tuple[Array, Array]:
        """Return gap (n,) [length] and normals (n, dim) [-] of `points` (n, dim) [length] from the obstacle at rest."""
        distance_and_normal = self.obstacle.distance(points)
        if is_masked(distance_and_normal):
            raise ContactError(
                f"the distance from a rigid obstacle {REFUSAL}; a gap that is infinite leaves a point out"
            )
        if any(np.iscomplexobj(values) for values in distance_and_normal):
            raise ContactError("the distance from a rigid obstacle must be real numbers, not complex ones")
        return distance_and_normal

    def turning(self, positions: Array, before: Array, now: Pose, then: Pose) -> Array | None:
        """Return the displacement of points of the obstacle's surface by rotation alone (n, dim) [length]; None without any.

        A point now at `positions` (n, dim) [length] and before at `before` has slid over the surface by its own displacement
        minus that of the obstacle and minus this result. The slip is the change of position on the obstacle, in the frame of
        half the rotation and of the length of the arc: zero where a point sticks, along the circle where it is at rest
        in 3D.
        """
        angle = now.angle - then.angle
        if self.rotation is None or angle == 0.0:
            return None
        half, centre = self.rotation.matrix(0.5 * angle), np.array(self.rotation.centre)
        end, start = positions - centre - now.displacement, before - centre - then.displacement
        slip = (end @ half - start @ half.T) * (0.5 * angle / math.sin(0.5 * angle))
        return np.asarray((end - start) - slip)

    def torque(self, positions: Array, forces: Array, at: Pose) -> float | None:
        """Return the moment about the axis of the obstacle of `forces` (n, dim) [force] at `positions` [length]."""
        if self.rotation is None:
            return None
        return self.rotation.torque(positions - at.displacement - np.array(self.rotation.centre), forces)
