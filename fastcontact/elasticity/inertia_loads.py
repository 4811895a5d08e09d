"""Inertia loads: gravity and centrifugal forces, computed from the densities of the materials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.elasticity.loads import DensityField, Table, VolumeLoad, add_forces, quadrature_points, solid_rows
from fastcontact.elasticity.materials import Material
from fastcontact.elasticity.varying_constants import Varying
from fastcontact.errors import ModelError
from fastcontact.mesh.mesh import Mesh


@record
class Densities:
    """The densities of the materials of all solid cells.

    Attributes
    ----------
    materials : sequence of Material
    number : mapping of str to ndarray of int (n_cells,)
        Number of the material of each cell, by solid element type.
    """

    materials: Sequence[Material]
    number: Mapping[str, Numbers]

    def at(self, name: str, rows: Indices, N: Array) -> Array:
        """Return the densities (n_rows, n) [mass / length^3] at points of cells; see `DensityField.at`."""
        density = np.full((len(rows), len(N)), np.nan)
        number_of_row = self.number[name][rows]
        for number, material in enumerate(self.materials):
            members = np.flatnonzero(number_of_row == number)
            if isinstance(material.density, Varying):
                density[members] = material.density.at(name, rows[members], N).reshape(len(members), len(N))
            elif material.density is not None:
                density[members] = material.density
        return density


class InertiaLoad(VolumeLoad):
    """A load per unit volume that is the product of density and acceleration."""

    CONSTANT = True

    def vector(self, mesh: Mesh, kinematics: str, density: DensityField | None = None) -> Array:
        """Return the nodal forces (n_points, dim) at multiplier 1 [force]; raise ModelError if cells have no density.

        Parameters
        ----------
        mesh : Mesh
        kinematics : str
        density : DensityField, optional
            Densities of the solid cells; if omitted, no cell has a density.
        """
        forces, missing = np.zeros((mesh.n_points, mesh.dim)), 0
        for element, rows in solid_rows(mesh, self.groups).items():
            cells = mesh.cells[element][rows]
            x, N, volume = quadrature_points(mesh, element, cells, kinematics)
            densities = np.full(volume.shape, np.nan) if density is None else density.at(element, rows, N)
            missing += int(np.isnan(densities).any(axis=1).sum())
            add_forces(forces, cells, N, self.acceleration(x, kinematics) * (volume * densities)[:, :, None])
        if missing:
            raise ModelError(
                f"{self.name} needs densities, but the materials of {missing} solid cells have none: give them density=..., "
                "0.0 for a body without weight"
            )
        return forces

    def acceleration(self, x: Array, kinematics: str) -> Array:
        """Return the acceleration (..., dim) [length / time^2] at positions `x` (..., dim) [length]."""
        raise NotImplementedError


@dataclass(frozen=True)
class Gravity(InertiaLoad):
    """Gravity on groups of solid cells, or on all solid cells, given by its components [length / time^2]."""

    KIND = "gravity"
    groups: tuple[str, ...] | None
    components: Mapping[int, float]
    ramp: Table | None = None

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        super()._check_groups(mesh, kinematics)
        if kinematics == "axisymmetric" and 0 in self.components:
            raise ModelError(f"{self.name} has a radial component x: in axisymmetry it can act only along the axis, y")

    def acceleration(self, x: Array, kinematics: str) -> Array:
        """Return the acceleration (..., dim) [length / time^2], the same at all positions `x` (..., dim) [length]."""
        return np.broadcast_to([float(self.components.get(axis, 0.0)) for axis in range(x.shape[-1])], x.shape)


@dataclass(frozen=True)
class Centrifugal(InertiaLoad):
    """Centrifugal force due to a rotation at constant speed.

    Attributes
    ----------
    groups : tuple of str or None
        Groups of solid cells; None means all solid cells.
    speed : float
        Angular speed [radian / time].
    origin, direction : (float, float, float)
        A point on the axis [length], and a vector along the axis [-].
    ramp : tuple, optional
        Points (load factor, multiplier) of the ramp of the force, which is proportional to the square of the speed.
    """

    KIND = "the centrifugal force"
    groups: tuple[str, ...] | None
    speed: float
    origin: tuple[float, float, float]
    direction: tuple[float, float, float]
    ramp: Table | None = None

    @property
    def values(self) -> list[float]:  # type: ignore[override]
        """The speed and the parameters of the axis."""
        return [self.speed, *self.origin, *self.direction]

    def _check_groups(self, mesh: Mesh, kinematics: str) -> None:
        super()._check_groups(mesh, kinematics)
        direction, origin = np.array(self.direction), np.array(self.origin)
        if not direction.any():
            raise ModelError(f"the axis of {self.name} has no length: give a direction such as (0, 0, 1)")
        if kinematics == "axisymmetric" and (direction[[0, 2]].any() or origin[[0, 2]].any()):
            raise ModelError(f"the axis of {self.name} must be the axis of symmetry: its direction is (0, 1, 0)")
        if mesh.dim == 2 and direction[2] and direction[:2].any():
            raise ModelError(f"the axis of {self.name} must lie in the plane or be normal to it")
        if mesh.dim == 2 and origin[2]:
            raise ModelError(f"the axis of {self.name} has the origin z = {origin[2]:g} outside the plane of the mesh")

    def gradient(self, dim: int) -> Array:
        """Return the derivatives (dim, dim) of the acceleration with respect to positions [1 / time^2]."""
        axis = np.array(self.direction) / np.linalg.norm(self.direction)
        return np.asarray(self.speed**2 * (np.eye(3) - np.outer(axis, axis))[:dim, :dim])

    def acceleration(self, x: Array, kinematics: str) -> Array:
        """Return the acceleration (..., dim) [length / time^2] at `x` (..., dim) [length]: speed^2 times the radius."""
        radius = np.zeros((*x.shape[:-1], 3))
        radius[..., : x.shape[-1]] = x
        radius -= self.origin
        axis = np.array(self.direction) / np.linalg.norm(self.direction)
        radius -= (radius @ axis)[..., None] * axis
        return np.asarray(self.speed**2 * radius[..., : x.shape[-1]])
