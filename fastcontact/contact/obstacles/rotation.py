"""Rotation of a rigid obstacle about an axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from fastcontact.arrays import Array
from fastcontact.round_off import LENGTH_ROUND_OFF


@dataclass(frozen=True)
class Rotation:
    """A rotation by any angle about an axis that moves along with the obstacle.

    Attributes
    ----------
    centre : tuple of float (dim,)
        A point of the axis before any motion [length].
    axis : tuple of float (3,)
        Direction of the axis, of any length [-]; (0, 0, 1) in the plane.
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
        """Return the matrix (dim, dim) that turns vectors by `angle` [radian] (Rodrigues' formula)."""
        first, second = self.generators
        return np.asarray(np.eye(len(first)) + math.sin(angle) * first + (1.0 - math.cos(angle)) * second)

    @cached_property
    def generators(self) -> tuple[Array, Array]:
        """Coefficient matrices (dim, dim) of the sine, and of one minus the cosine, of the angle in `matrix` [-]."""
        x, y, z = self.direction
        across, dim = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), len(self.centre)
        return across[:dim, :dim], (across @ across)[:dim, :dim]

    def axes(self, positions: Array) -> Array:
        """Return cylindrical axes (n, dim, dim) at positions (n, dim) [length], in columns: radial, tangential, axial [-].

        On the axis itself, where the radial direction is undefined, the choice is arbitrary.
        """
        dim = positions.shape[1]
        arm, along = np.zeros((len(positions), 3)), self.direction
        arm[:, :dim] = positions - self.centre
        radial = arm - (arm @ along)[:, None] * along
        length = np.linalg.norm(radial, axis=1, keepdims=True)
        some = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
        on_axis = length <= LENGTH_ROUND_OFF * length.max(initial=0.0)
        radial = np.where(on_axis, some / np.linalg.norm(some), radial / np.where(on_axis, 1.0, length))
        axes = np.stack([radial, np.cross(along, radial), np.broadcast_to(along, radial.shape)], axis=2)
        return axes[:, :dim, :dim]

    def torque(self, arms: Array, forces: Array) -> float:
        """Return the moment about the axis of `forces` (n, dim) [force] at `arms` (n, dim) from its point [length]."""
        if arms.shape[1] == 2:
            return float((arms[:, 0] * forces[:, 1] - arms[:, 1] * forces[:, 0]).sum())
        return float(np.cross(arms, forces).sum(axis=0) @ self.direction)
