"""The materials of all solid cells: moduli, and their assignment to cells."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact.arrays import AnyArray, Array, Mask, Numbers
from fastcontact.elasticity.incompatible_modes import MODES
from fastcontact.elasticity.initial_states import InitialState, StressOffset
from fastcontact.elasticity.materials import MODULI, Material
from fastcontact.elasticity.varying_constants import middle, positions
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Places:
    """Points at which the moduli of a varying material are stored.

    Attributes
    ----------
    material : int
        Number of the material.
    first : int
        Row of the first of these points in `MaterialField.moduli`.
    points : ndarray (n, dim)
        Points at which axes are evaluated: the middles of cells, or their quadrature points [length].
    constants : SimpleNamespace
        Result of `Material.constants_at`.
    """

    material: int
    first: int
    points: Array
    constants: Any

    @property
    def rows(self) -> slice:
        """Rows of these points in `MaterialField.moduli`."""
        return slice(self.first, self.first + len(self.points))


@dataclass(frozen=True, eq=False)
class MaterialField:
    """The materials of all solid cells.

    Attributes
    ----------
    materials : sequence of Material
    kinematics : str
    moduli : ndarray (n_moduli, n_components, n_components)
        Moduli of each material, then those at the `places` of varying materials [pressure].
    places : sequence of Places
    owner : ndarray of int (n_moduli,)
        Material of each of the moduli.
    number, rows : dict of str to ndarray of int (n_cells,)
        Material of each cell, and its row in `moduli` (at the cell centre if the material varies), by solid element type.
    inside : dict of str to ndarray of int (n_cells, n_q)
        Row in `moduli` of each quadrature point, by solid element type, where materials vary inside cells.
    """

    materials: Sequence[Material]
    kinematics: str
    moduli: Array
    places: Sequence[Places]
    owner: Numbers
    number: dict[str, Numbers]
    rows: dict[str, Numbers]
    inside: dict[str, Numbers]

    @cached_property
    def loops(self) -> dict[str, Numbers]:
        """Rows of moduli for the element loops, by element type: `inside` if materials vary in cells, otherwise `rows`."""
        return {**self.rows, **self.inside}

    @property
    def n_materials(self) -> int:
        """Number of materials."""
        return len(self.materials)

    @cached_property
    def averaged(self) -> Mask:
        """Which moduli (n_moduli,) have a mean dilatation; none in plane stress, where elements do not lock."""
        averaged = np.array([material.averaged for material in self.materials], bool)
        return np.asarray(averaged[self.owner] & (self.kinematics != "plane_stress"))

    @cached_property
    def treatment(self) -> AnyArray:
        """Strain treatment of elements, by moduli (n_moduli,): 1 mean dilatation, 2 incompatible modes, 0 none.

        Their sum means incompatible modes in the elements that have them, and a mean dilatation in others. Axisymmetric cells
        have no incompatible modes.
        """
        modes = np.array([material.incompatible_modes for material in self.materials], bool)[self.owner]
        treatment = self.averaged.astype(np.uint8)
        if self.kinematics != "axisymmetric":
            treatment[modes] += MODES
        return treatment

    @cached_property
    def contrast(self) -> float:
        """A third of the largest relative excess of a material's stiffest over its softest normal modulus, at least 1 [-].

        For isotropic materials it is ``nu / (1 - 2 nu)``, which grows towards incompressibility, since the eigenvalues of the
        moduli for normal strains are ``3 lambda + 2 mu`` and ``2 mu``.
        """
        normal = 2 if self.kinematics == "plane_stress" else 3
        used = self.moduli[:, 0, 0] > 0.0  # unused rows of varying materials are zero
        values = np.linalg.eigvalsh(self.moduli[used, :normal, :normal])
        return max(1.0, float(((values[:, -1] / values[:, 0]).max() - 1.0) / 3.0))

    @cached_property
    def compliance(self) -> Array:
        """Compliances (n_moduli, n_components, n_components) [1 / pressure], see `Material.compliance_at`."""
        return self._of_materials(np.zeros_like(self.moduli), "compliance_at")

    @cached_property
    def expansion(self) -> Array:
        """Thermal strains (n_moduli, n_components) [1 / temperature]; NaN for materials without expansion."""
        return self._of_materials(np.zeros(self.moduli.shape[:2]), "expansion_at")

    def _of_materials(self, values: Array, method: str) -> Array:
        """Fill `values` (n_moduli, ...) with the results of a method of the materials."""
        for number, material in enumerate(self.materials):
            if not material.varies:  # rows of varying materials are unused
                values[number] = getattr(material, method)(self._anywhere, self.kinematics)[0]
        for place in self.places:
            at = getattr(self.materials[place.material], method)
            values[place.rows] = at(place.points, self.kinematics, place.constants)
        return values

    @property
    def _anywhere(self) -> Array:
        return np.zeros((1, 3 if self.kinematics == "3d" else 2))

    def offset(
        self, rise: Array | None, states: Sequence[tuple[float, InitialState]] = (), n_points: int = 0
    ) -> StressOffset | None:
        """Return the stress due to temperatures and initial states; None if there are none.

        Parameters
        ----------
        rise : ndarray (n_points,), optional
            Temperature rise [temperature].
        states : sequence of (float, InitialState)
            Factors, and initial stresses and strains.
        n_points : int
            Number of points of the mesh, for initial states without temperatures.
        """
        if rise is None and not states:
            return None
        at_nodes = np.zeros(n_points) if rise is None else rise
        return StressOffset(at_nodes, np.nan_to_num(self.expansion), tuple(states))

    def without_expansion(self, mesh: Mesh, rise: Array) -> int:
        """Return the number of cells with a temperature rise (n_points,) [temperature] and a material without expansion."""
        unknown = np.isnan(self.expansion[:, 0])
        count = 0
        for name, block in mesh.solids.items():
            heated = np.asarray(rise[block] != 0.0).any(axis=1)
            count += int(np.count_nonzero(unknown[self.rows[name]] & heated))
        return count

    @cached_property
    def distinct(self) -> dict[str, Numbers]:
        """Material (n_cells,) of every cell by element type; materials between which stress is continuous share a number.

        Such materials have the same moduli, axes and expansion.
        """
        first: dict[object, int] = {}
        same = np.empty(self.n_materials, np.int32)
        for number, material in enumerate(self.materials):
            same[number] = first.setdefault(_law(material, self.moduli[number]), number)
        return {name: same[values] for name, values in self.number.items()}


def material_field(
    mesh: Mesh, kinematics: str, materials: Sequence[Material], number: Mapping[str, Numbers]
) -> MaterialField:
    """Return the materials of all solid cells.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    materials : sequence of Material
    number : mapping of str to ndarray of int (n_cells,)
        Material of each cell, by solid element type.
    """
    size = 6 if kinematics == "3d" else 4
    moduli = [np.zeros((1, size, size)) if m.varies else m.moduli(kinematics)[None] for m in materials]
    owner = [np.arange(len(materials), dtype=np.int32)]
    rows, inside = {name: values.copy() for name, values in number.items()}, {}
    places: list[Places] = []

    def added(index: int, points: Array, constants: Any) -> Numbers:
        """Add the moduli of a material at `points`; return their numbers."""
        places.append(Places(index, sum(map(len, moduli)), points, constants))
        moduli.append(materials[index].moduli_at(points, kinematics, constants))
        owner.append(np.full(len(points), index, np.int32))
        return places[-1].first + np.arange(len(points), dtype=np.int32)

    for index, material in enumerate(materials):
        for name, block in mesh.solids.items() if material.varies else ():
            cells = np.flatnonzero(number[name] == index)
            middles = mesh.points[block[cells]].mean(axis=1)
            rows[name][cells] = added(index, middles, material.constants_at(name, cells, middle(name)))
    for index, material in enumerate(materials):
        for name, block in mesh.solids.items() if material.varies_inside else ():
            cells = np.flatnonzero(number[name] == index)
            N = elements.get(name).tables[0]
            if name not in inside:
                inside[name] = np.repeat(rows[name][:, None], len(N), axis=1)
            index_at = added(index, positions(mesh, block[cells], N), material.constants_at(name, cells, N))
            inside[name][cells] = index_at.reshape(len(cells), len(N))
    return MaterialField(
        materials, kinematics, np.concatenate(moduli), places, np.concatenate(owner), dict(number), rows, inside
    )


def _law(material: Material, moduli: Array) -> tuple[object, ...]:
    """Return a key that is equal for materials between which stress is continuous."""
    constants = tuple(getattr(material, name, None) for name in MODULI) if material.graded else None
    compliance = b"" if material.graded else material.local_compliance.tobytes()
    own_axes = material.axes if material.varies else None
    law = (constants, compliance) if material.varies else moduli.tobytes()
    return law, id(own_axes), repr(material.expansion), material.expansion if material.varies else None
