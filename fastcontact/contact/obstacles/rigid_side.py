"""A rigid obstacle as the primary side of a contact pair, and its rotation."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import MASKED_ENTRIES, Array, Mask, Numbers, is_masked
from fastcontact.contact.obstacles._obstacle import Obstacle
from fastcontact.errors import ContactError
from fastcontact.round_off import LENGTH_ROUND_OFF


@record
class Pose:
    """Position and rotation of a rigid obstacle.

    Attributes
    ----------
    displacement : ndarray (dim,)
        Displacement from the initial position [length].
    angle : float
        Rotation angle [radian].
    """

    displacement: Array
    angle: float = 0.0


@record
class RigidSide:
    """A rigid obstacle that may translate and rotate; its position is part of the configuration."""

    obstacle: Obstacle  # in its initial position
    motion: Array  # (dim,): displacement at multiplier 1 of the ramp [length]
    rotation: Rotation | None = None

    @property
    def points(self) -> Numbers:
        """The nodes of the side, an empty array."""
        return np.empty(0, np.int32)

    def project(self, positions: Array, pose: Pose) -> tuple[Array, Array, Mask, Array]:
        """Return gaps (n,), normals (n, dim), a mask (n,) of paired points and offsets (n,) at `positions` (n, dim) [length].

        To first order, the gap at a nearby position x is ``offset + normal . x``.
        """
        local = positions - pose.displacement
        if self.rotation is None or pose.angle == 0.0:
            gap, normal = self._distance(local)
        else:
            rotation, centre = self.rotation.matrix(pose.angle), np.array(self.rotation.centre)
            gap, normal = self._distance((local - centre) @ rotation + centre)
            normal = normal @ rotation.T
        paired = np.isfinite(gap)
        offset = np.where(paired, gap, 0.0) - np.einsum("nd,nd->n", normal, positions)
        return gap, normal, paired, offset

    def _distance(self, points: Array) -> tuple[Array, Array]:
        """Return gaps (n,) [length] and normals (n, dim) [-] at `points` (n, dim) [length] before any motion."""
        distance_and_normal = self.obstacle.distance(points)
        if is_masked(distance_and_normal):
            raise ContactError(f"the distance from a rigid obstacle {MASKED_ENTRIES}; an infinite gap excludes a point")
        if any(np.iscomplexobj(values) for values in distance_and_normal):
            raise ContactError("the distance from a rigid obstacle must be real numbers, not complex ones")
        return distance_and_normal

    def rigid_motion(self, positions: Array, initial_positions: Array, pose: Pose, initial_pose: Pose) -> Array:
        """Return the displacements (n, dim) of points on the surface of the obstacle due to its motion [length].

        The slip of a point that moves from `initial_positions` to `positions` (n, dim) [length], while the pose changes from
        `initial_pose` to `pose`, is its displacement minus this result. The slip is the change of the position relative to
        the obstacle, expressed in the frame that is rotated by half the angle, and multiplied by the ratio of the arc to the
        chord. The slip vanishes where a point sticks, and is tangential to the circle for a point at rest.
        """
        angle = pose.angle - initial_pose.angle
        shift = np.tile(pose.displacement - initial_pose.displacement, (len(positions), 1))
        if self.rotation is None or angle == 0.0:
            return shift
        half_rotation, centre = self.rotation.matrix(0.5 * angle), np.array(self.rotation.centre)
        end, start = positions - centre - pose.displacement, initial_positions - centre - initial_pose.displacement
        slip = (end @ half_rotation - start @ half_rotation.T) * (0.5 * angle / math.sin(0.5 * angle))
        return np.asarray(shift + ((end - start) - slip))

    def torque(self, positions: Array, forces: Array, pose: Pose) -> float | None:
        """Return the moment about the axis of the obstacle of `forces` (n, dim) [force] at `positions` [length]."""
        if self.rotation is None:
            return None
        return self.rotation.torque(positions - pose.displacement - np.array(self.rotation.centre), forces)


@dataclass(frozen=True)
class Rotation:
    """A rotation by any angle about an axis that translates with the obstacle.

    Attributes
    ----------
    centre : tuple of float (dim,)
        A point on the axis before any motion [length].
    axis : tuple of float (3,)
        Direction of the axis, of any length [-]; (0, 0, 1) in 2D.
    angle : float
        Angle at multiplier 1, by the right-hand rule [radian].
    """

    centre: tuple[float, ...]
    axis: tuple[float, float, float]
    angle: float

    @cached_property
    def direction(self) -> Array:
        """Unit vector (3,) along the axis."""
        return np.asarray(np.array(self.axis) / np.linalg.norm(self.axis))

    def matrix(self, angle: float) -> Array:
        """Return the matrix (dim, dim) that rotates vectors by `angle` [radian] (Rodrigues' formula)."""
        of_sine, of_cosine = self.generators
        return np.asarray(np.eye(len(of_sine)) + math.sin(angle) * of_sine + (1.0 - math.cos(angle)) * of_cosine)

    @cached_property
    def generators(self) -> tuple[Array, Array]:
        """Coefficient matrices (dim, dim) of the sine, and of one minus the cosine, of the angle in `matrix` [-]."""
        x, y, z = self.direction
        cross_product, dim = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), len(self.centre)
        return cross_product[:dim, :dim], (cross_product @ cross_product)[:dim, :dim]

    def axes(self, positions: Array) -> Array:
        """Return cylindrical axes (n, dim, dim) at positions (n, dim) [length], in columns: radial, tangential, axial [-].

        On the axis itself, where the radial direction is undefined, the choice is arbitrary.
        """
        dim = positions.shape[1]
        offset, axis = np.zeros((len(positions), 3)), self.direction
        offset[:, :dim] = positions - self.centre
        radial = offset - (offset @ axis)[:, None] * axis
        length = np.linalg.norm(radial, axis=1, keepdims=True)
        arbitrary = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        on_axis = length <= LENGTH_ROUND_OFF * length.max(initial=0.0)
        radial = np.where(on_axis, arbitrary / np.linalg.norm(arbitrary), radial / np.where(on_axis, 1.0, length))
        axes = np.stack([radial, np.cross(axis, radial), np.broadcast_to(axis, radial.shape)], axis=2)
        return axes[:, :dim, :dim]

    def torque(self, arms: Array, forces: Array) -> float:
        """Return the moment about the axis of `forces` (n, dim) [force] at `arms` (n, dim) from a point on it [length]."""
        if arms.shape[1] == 2:
            return float((arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]).sum())
        return float(np.cross(arms, forces).sum(axis=0) @ self.direction)
