"""Configuration of a contact pair: current, and at the beginning of the load step."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond
from fastcontact.contact.obstacles.rigid_side import Pose


@dataclass(frozen=True, eq=False)
class Configuration:
    """The configuration in which a contact pair is paired.

    Attributes
    ----------
    displacement : ndarray (n_points, dim)
        Displacement of all points of the mesh [length].
    start : ndarray (n_points, dim)
        The same at the beginning of the load step, from where slip is measured [length].
    obstacle, obstacle_start : ndarray (dim,)
        Displacement of a rigid obstacle, now and at the beginning of the load step [length].
    clearance_factor : float
        Factor on the clearances of the pair.
    never_opening : (ndarray (k, dim), ndarray of bool (k,)), optional
        Reference positions of the constraints at the end of the previous load step [length], and which of them cannot
        separate any more; None where all may open.
    elastic_slip : (ndarray (k, dim), ndarray (k, dim)), optional
        Reference positions of the constraints at the end of the previous load step, and their elastic slips there [length];
        None without tangential compliance.
    angle, angle_start : float
        Rotation of a rigid obstacle, now and at the beginning of the load step [radian].
    worn : ndarray (n_points,), optional
        Wear depth at the secondary nodes before the load step [length]; None for no wear.
    bond : Bond, optional
        The cohesive layer at the end of the previous load step; None where there is none, or none yet.
    fluid_pressure : float
        Pressure of the fluid at its source [pressure].
    pressure : ndarray (n_nodes,), optional
        Pressure at the secondary nodes in the last pairing, fluid included [pressure]; None before the first one.
    rounded : bool
        Whether facet normals vary at rounded edges, see `pairing.pair`.
    linearised : ndarray (n_points, dim), optional
        Displacement at which the tangent of bodies is taken in finite strain [length]; None for small strains.
    friction_factor : float
        Factor on the coefficient of friction [-].
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
        """Current position of a rigid obstacle."""
        return Pose(self.obstacle, self.angle)

    @property
    def pose_start(self) -> Pose:
        """Position of a rigid obstacle at the beginning of the load step."""
        return Pose(self.obstacle_start, self.angle_start)

    @classmethod
    def displaced(cls, displacement: Array) -> Configuration:
        """Return the configuration displaced by `displacement` (n_points, dim) [length] in one step from rest."""
        still = np.zeros(displacement.shape[1])
        return cls(displacement, np.zeros_like(displacement), still, still)

    @classmethod
    def undeformed(cls, points: Array) -> Configuration:
        """Return the configuration before any load, of a mesh with `points` (n_points, dim) [length]."""
        return cls.displaced(np.zeros_like(points))
