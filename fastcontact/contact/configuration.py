"""Configuration of a contact pair: positions of both sides, and data from the beginning of the load step."""

from __future__ import annotations

import numpy as np

from fastcontact._tools.records import field, record
from fastcontact.arrays import Array, Mask
from fastcontact.contact.cohesion import Bond
from fastcontact.contact.obstacles.rigid_side import Pose
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.surface import Surface
from fastcontact.contact.wear_compliance import WearCompliance


@record
class Configuration:
    """The configuration in which the two sides of a contact pair are paired.

    Attributes
    ----------
    displacement : ndarray (n_points, dim)
        Current displacements of all points of the mesh [length].
    start : ndarray (n_points, dim)
        Displacements at the beginning of the load step, from which slip is measured [length].
    pose, pose_start : Pose
        Current displacement and rotation of a rigid obstacle, and those at the beginning of the load step.
    clearance_factor : float
        Factor of the clearances of the pair [-].
    never_opening : (ndarray (k, dim), ndarray of bool (k,)), optional
        Reference positions of the k constraints at the end of the previous load step [length], and which of them can no
        longer open; None if all can open.
    elastic_slip : (ndarray (k, dim), ndarray (k, dim)), optional
        Reference positions of the k constraints at the end of the previous load step, and their elastic slips [length]; None
        without tangential compliance.
    wear_depth : ndarray (n_points,), optional
        Wear depth at the secondary nodes, zero at other points [length]; None without wear.
    wear : WearCompliance, optional
        Dependence of the wear depth on the contact pressure; None before the first solution of a load step.
    bond : Bond, optional
        State of the cohesive layer at the end of the previous load step; None without a layer, and before the first step.
    fluid_pressure : float
        Pressure of the fluid at its source [pressure].
    pressure : ndarray (n_nodes,), optional
        Contact pressure at the secondary nodes in the last solution [pressure]; None before the first one.
    impermeable : ndarray of bool (n_nodes,), optional
        Secondary nodes that fluid cannot pass, whatever the contact pressure; None for no node.
    rounded : bool
        Whether pairings have alternated between two states. Then the normals of facets vary continuously across edges, see
        `pairing.pair`, and nodes of dual mortar with a small overlap have no gap.
    linearisation_point : ndarray (n_points, dim), optional
        Displacements at which the tangent of bodies in finite strain is computed [length]; None for small strains.
    friction_factor : float
        Factor of the coefficient of friction [-].
    """

    displacement: Array
    start: Array
    pose: Pose
    pose_start: Pose
    clearance_factor: float = 1.0
    never_opening: tuple[Array, Mask] | None = None
    elastic_slip: tuple[Array, Array] | None = None
    wear_depth: Array | None = None
    wear: WearCompliance | None = None
    bond: Bond | None = None
    fluid_pressure: float = 0.0
    pressure: Array | None = None
    impermeable: Mask | None = None
    rounded: bool = False
    linearisation_point: Array | None = None
    friction_factor: float = 1.0

    _sides: dict[Surface, DeformedSide] = field(default_factory=dict, init=False)

    def deformed(self, side: Surface, points: Array) -> DeformedSide:
        """Return a side in this configuration, given the undeformed `points` (n_points, dim) of the mesh [length]."""
        if side not in self._sides:
            self._sides[side] = DeformedSide(side, points + self.displacement)
        return self._sides[side]

    @classmethod
    def displaced(cls, displacement: Array) -> Configuration:
        """Return the configuration with a displacement (n_points, dim) [length] in a step that begins undeformed."""
        initial_pose = Pose(np.zeros(displacement.shape[1]))
        return cls(displacement, np.zeros_like(displacement), initial_pose, initial_pose)

    @classmethod
    def undeformed(cls, points: Array) -> Configuration:
        """Return the undeformed configuration of a mesh with `points` (n_points, dim) [length]."""
        return cls.displaced(np.zeros_like(points))
