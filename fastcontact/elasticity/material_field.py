"""The materials of all solid cells: moduli, and which of them each cell has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from fastcontact.elasticity.incompatible_modes import MODES
from fastcontact.elasticity.materials import Material
from fastcontact.elasticity.temperature import ThermalStress
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]
Indices = NDArray[np.int32]


@dataclass(frozen=True, eq=False)
class MaterialField:
    """The materials of all solid cells.

    Attributes
    ----------
    materials : sequence of Material
    kinematics : str
    moduli : ndarray (n_moduli, n_components, n_components)
        Of each material, then of each cell of materials with axes that depend on the position [pressure].
    places : ndarray (n_moduli, dim)
        Where the axes of the moduli are taken: the middle of a cell; of materials that do not depend on it, zero [length].
    owner : ndarray of int (n_moduli,)
        Material of each of the moduli.
    number, rows : dict of str to ndarray of int (n_cells,)
        By solid element: every cell's material, and its place in `moduli`.
    """

    materials: Sequence[Material]
    kinematics: str
    moduli: Array
    places: Array
    owner: Indices
    number: dict[str, Indices]
    rows: dict[str, Indices]

    @property
    def n_materials(self) -> int:
        """Number of materials."""
        return len(self.materials)

    @cached_property
    def averaged(self) -> NDArray[np.bool_]:
        """Which moduli (n_moduli,) have a mean dilatation; none in plane stress, where none locks."""
        averaged = np.array([material.averaged for material in self.materials], bool)
        return np.asarray(averaged[self.owner] & (self.kinematics != "plane_stress"))

    @cached_property
    def treatment(self) -> NDArray[np.uint8]:
        """What elements make of the strain, by moduli (n_moduli,): 1 a mean dilatation, 2 incompatible modes, 0 nothing.

        Axisymmetric cells have no incompatible modes.
        """
        modes = np.array([material.incompatible_modes for material in self.materials], bool)[self.owner]
        found = self.averaged.astype(np.uint8)
        if self.kinematics != "axisymmetric":
            found[modes] = MODES
        return found

    @cached_property
    def compliance(self) -> Array:
        """Compliances (n_moduli, n_components, n_components) [1 / pressure], see `Material.compliance_at`."""
        found = np.zeros_like(self.moduli)
        for number, material in enumerate(self.materials):
            rows = np.flatnonzero(self.owner == number)
            if material.varies:
                rows = rows[rows != number]  # the first is that of no cell
            found[rows] = material.compliance_at(self.places[rows], self.kinematics)
        return found

    @cached_property
    def expansion(self) -> Array:
        """Thermal strains (n_moduli, n_components) [1 / temperature]; NaN of materials that have no expansion."""
        found = np.empty(self.moduli.shape[:2])
        for number, material in enumerate(self.materials):
            rows = np.flatnonzero(self.owner == number)
            if material.varies:
                rows, found[number] = rows[rows != number], 0.0  # the first is that of no cell
            found[rows] = material.expansion_at(self.places[rows], self.kinematics)
        return found

    def thermal(self, rise: Array | None) -> ThermalStress | None:
        """Return what stresses lose by a rise of the temperature (n_points,) [temperature]; None where there is none."""
        if rise is None:
            return None
        strain = np.nan_to_num(self.expansion)
        averaged = self.averaged
        per_degree = np.einsum("mij,mj->mi", self.moduli, strain)
        return ThermalStress(rise, per_degree, np.where(averaged, strain[:, 0], 0.0))

    def without_expansion(self, mesh: Mesh, rise: Array) -> int:
        """Return how many cells have a rise of the temperature (n_points,) [temperature] and a material without expansion."""
        unknown = np.isnan(self.expansion[:, 0])
        count = 0
        for name, block in mesh.solids.items():
            heated = np.asarray(rise[block] != 0.0).any(axis=1)
            count += int(np.count_nonzero(unknown[self.rows[name]] & heated))
        return count

    @cached_property
    def distinct(self) -> dict[str, Indices]:
        """By solid element the material (n_cells,) of every cell, those between which stress does not jump under one number.

        These have the same moduli, axes and expansion.
        """
        first: dict[object, int] = {}
        same = np.empty(self.n_materials, np.int32)
        for number, material in enumerate(self.materials):
            law = self.moduli[number].tobytes() if not material.varies else material.local_compliance.tobytes()
            own_axes = material.axes if material.varies else None
            same[number] = first.setdefault((law, id(own_axes), repr(material.expansion)), number)
        return {name: same[values] for name, values in self.number.items()}


def material_field(
    mesh: Mesh, kinematics: str, materials: Sequence[Material], number: Mapping[str, Indices]
) -> MaterialField:
    """Return the materials of all solid cells.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    materials : sequence of Material
    number : mapping of str to ndarray of int (n_cells,)
        By solid element: material of each cell.
    """
    size = 6 if kinematics == "3d" else 4
    moduli = [np.zeros((1, size, size)) if m.varies else m.moduli(kinematics)[None] for m in materials]
    places = [np.zeros((len(materials), mesh.dim))]
    owner = [np.arange(len(materials), dtype=np.int32)]
    rows, count = {name: values.copy() for name, values in number.items()}, len(materials)
    for index, material in enumerate(materials):
        for name, block in mesh.solids.items() if material.varies else ():
            cells = np.flatnonzero(number[name] == index)
            middle = mesh.points[block[cells]].mean(axis=1)
            rows[name][cells] = count + np.arange(len(cells))
            count += len(cells)
            moduli.append(material.moduli_at(middle, kinematics))
            places.append(middle)
            owner.append(np.full(len(cells), index, np.int32))
    return MaterialField(
        materials, kinematics, np.concatenate(moduli), np.concatenate(places), np.concatenate(owner), dict(number), rows
    )
