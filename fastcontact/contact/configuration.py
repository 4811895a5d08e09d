"""Configuration of a contact pair: positions of both sides, and data from the beginning of the load step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond
from fastcontact.contact.obstacles.rigid_side import Pose


@dataclass(frozen=True, eq=False)
class Configuration:
    """The configuration in which the two sides of a contact pair are paired.

    Attributes
    ----------
    displacement : ndarray (n_points, dim)
        Current displacements of all points of the mesh [length].
    start : ndarray (n_points, dim)
        Displacements at the beginning of the load step, from which slip is measured [length].
    obstacle, obstacle_start : ndarray (dim,)
        Current displacement of a rigid obstacle, and its displacement at the beginning of the load step [length].
    clearance_factor : float
        Factor of the clearances of the pair [-].
    never_opening : (ndarray (k, dim), ndarray of bool (k,)), optional
        Reference positions of the k constraints at the end of the previous load step [length], and which of them can no
        longer open; None if all can open.
    elastic_slip : (ndarray (k, dim), ndarray (k, dim)), optional
        Reference positions of the k constraints at the end of the previous load step, and their elastic slips [length]; None
        without tangential compliance.
    angle, angle_start : float
        Current rotation angle of a rigid obstacle, and its angle at the beginning of the load step [radian].
    worn : ndarray (n_points,), optional
        Wear depth at the secondary nodes at the beginning of the load step [length]; None without wear.
    bond : Bond, optional
        State of the cohesive layer at the end of the previous load step; None without a layer, and before the first step.
    fluid_pressure : float
        Pressure of the fluid at its source [pressure].
    pressure : ndarray (n_nodes,), optional
        Pressure at the secondary nodes in the last pairing, including that of fluid [pressure]; None before the first one.
    rounded : bool
        Whether the normals of facets vary continuously across edges, see `pairing.pair`.
    linearised : ndarray (n_points, dim), optional
        Displacements at which the tangent of bodies in finite strain is computed [length]; None for small strains.
    friction_factor : float
        Factor of the coefficient of friction [-].
    """

    displacement: Array
    start: Array
    obstacle: Array
    obstacle_start: Array
    clearance_factor: float = 1.0
    never_opening: tuple[Array, Mask] | None = None
    elastic_slip: tuple[Array, Array] | None = None
    angle: float = 0.0
    angle_start: float = 0.0
    worn: Array | None = None
    bond: Bond | None = None
    fluid_pressure: float = 0.0
    pressure: Array | None = None
    rounded: bool = False
    linearised: Array | None = None
    friction_factor: float = 1.0

    @property
    def pose(self) -> Pose:
        """Current position and rotation of a rigid obstacle."""
        return Pose(self.obstacle, self.angle)

    @property
    def pose_start(self) -> Pose:
        """Position and rotation of a rigid obstacle at the beginning of the load step."""
        return Pose(self.obstacle_start, self.angle_start)

    @classmethod
    def displaced(cls, displacement: Array) -> Configuration:
        """Return the configuration with displacements (n_points, dim) [length] that begins with the undeformed state."""
        still = np.zeros(displacement.shape[1])
        return cls(displacement, np.zeros_like(displacement), still, still)

    @classmethod
    def undeformed(cls, points: Array) -> Configuration:
        """Return the undeformed configuration of a mesh with `points` (n_points, dim) [length]."""
        return cls.displaced(np.zeros_like(points))
