"""The materials of all solid cells: their moduli, and the assignment of moduli to cells and quadrature points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Array, Mask, Numbers
from fastcontact.elasticity.incompatible_modes import MODES
from fastcontact.elasticity.initial_states import ScaledStates, StressOffset
from fastcontact.elasticity.materials import MODULI, Material
from fastcontact.elasticity.varying_constants import centre_weights, positions
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh


@record
class EvaluationPoints:
    """Points of one element type at which a varying material is evaluated.

    Attributes
    ----------
    material : int
        Number of the material.
    rows : slice
        Rows of these points in `MaterialField.moduli`.
    points : ndarray (n, dim)
        The centres of cells, or their quadrature points [length].
    constants : SimpleNamespace
        Result of `Material.constants_at` at these points.
    """

    material: int
    rows: slice
    points: Array
    constants: Any


@record
class MaterialField:
    """The materials of all solid cells.

    Attributes
    ----------
    materials : sequence of Material
    kinematics : str
    moduli : ndarray (n_moduli, n_components, n_components)
        Moduli of each material, followed by those at the points of `evaluations` [pressure].
    evaluations : sequence of EvaluationPoints
        Points at which varying materials are evaluated.
    owner : ndarray of int (n_moduli,)
        Number of the material to which each matrix in `moduli` belongs.
    material_numbers, rows : dict of str to ndarray of int (n_cells,)
        Number of the material of each cell, and its row in `moduli` (that of the cell centre if the material varies), by
        solid element type.
    rows_at_points : dict of str to ndarray of int (n_cells, n_q)
        Row in `moduli` of each quadrature point, by solid element type. Only element types with materials that vary within
        cells have an entry.
    """

    materials: Sequence[Material]
    kinematics: str
    moduli: Array
    evaluations: Sequence[EvaluationPoints]
    owner: Numbers
    material_numbers: dict[str, Numbers]
    rows: dict[str, Numbers]
    rows_at_points: dict[str, Numbers]

    @cached_property
    def moduli_rows(self) -> dict[str, Numbers]:
        """Rows of moduli that the element loops use, by element type: `rows_at_points` if present, otherwise `rows`."""
        return {**self.rows, **self.rows_at_points}

    @cached_property
    def averaged(self) -> Mask:
        """Mask (n_moduli,) of moduli used with a mean dilatation; none in plane stress, where cells do not lock."""
        averaged = np.array([material.averaged for material in self.materials], bool)
        return np.asarray(averaged[self.owner] & (self.kinematics != "plane_stress"))

    @cached_property
    def treatment(self) -> AnyArray:
        """Codes (n_moduli,) of the treatment of locking: 1 for a mean dilatation, 2 for incompatible modes, 0 for neither.

        The code 3 stands for incompatible modes in the elements that support them, and a mean dilatation in others. In
        axisymmetry, there are no incompatible modes.
        """
        modes = np.array([material.incompatible_modes for material in self.materials], bool)[self.owner]
        treatment = self.averaged.astype(np.uint8)
        if self.kinematics != "axisymmetric":
            treatment[modes] += MODES
        return treatment

    @cached_property
    def contrast(self) -> float:
        """Contrast of volumetric and shear stiffness, at least 1, which is large for nearly incompressible materials [-].

        It is the largest ratio of the extreme eigenvalues of the moduli for normal strains, minus one, divided by three. In
        isotropic materials these eigenvalues are ``3 lambda + 2 mu`` and ``2 mu``, and the contrast is ``nu / (1 - 2 nu)``.
        """
        n_normal = 2 if self.kinematics == "plane_stress" else 3
        is_used = self.moduli[:, 0, 0] > 0.0  # unused rows of varying materials are zero
        eigenvalues = np.linalg.eigvalsh(self.moduli[is_used, :n_normal, :n_normal])
        return max(1.0, float(((eigenvalues[:, -1] / eigenvalues[:, 0]).max() - 1.0) / 3.0))

    @cached_property
    def compliance(self) -> Array:
        """Compliances (n_moduli, n_components, n_components) [1 / pressure]; see `Material.compliance_at`."""
        return self._fill_values(np.zeros_like(self.moduli), "compliance_at")

    @cached_property
    def expansion(self) -> Array:
        """Thermal expansion coefficients (n_moduli, n_components) [1 / temperature]; NaN for materials without expansion."""
        return self._fill_values(np.zeros(self.moduli.shape[:2]), "expansion_at")

    def _fill_values(self, values: Array, method: str) -> Array:
        """Fill `values` (n_moduli, ...) with the results of a method of the materials, and return `values`."""
        arbitrary_point = np.zeros((1, 3 if self.kinematics == "3d" else 2))
        for number, material in enumerate(self.materials):
            if not material.varies:  # rows of varying materials are unused
                values[number] = getattr(material, method)(arbitrary_point, self.kinematics)[0]
        for evaluation in self.evaluations:
            evaluate = getattr(self.materials[evaluation.material], method)
            values[evaluation.rows] = evaluate(evaluation.points, self.kinematics, evaluation.constants)
        return values

    def offset(self, rise: Array | None, states: ScaledStates = (), n_points: int = 0) -> StressOffset | None:
        """Return the stress due to temperatures and initial states; None if there are neither.

        Parameters
        ----------
        rise : ndarray (n_points,), optional
            Temperature rise above the reference temperature [temperature]; zero by default.
        states : sequence of (float, InitialState)
            Initial stresses and strains, each with its multiplier.
        n_points : int
            Number of points of the mesh, which is needed if `rise` is not given.
        """
        if rise is None and not states:
            return None
        at_nodes = np.zeros(n_points) if rise is None else rise
        return StressOffset(at_nodes, np.nan_to_num(self.expansion), tuple(states))

    def n_heated_cells_without_expansion(self, mesh: Mesh, rise: Array) -> int:
        """Return the number of cells of materials without expansion whose `rise` (n_points,) [temperature] is not zero."""
        no_expansion = np.isnan(self.expansion[:, 0])
        heated = {name: (rise[block] != 0.0).any(axis=1) for name, block in mesh.solids.items()}
        return sum(int(np.count_nonzero(no_expansion[self.rows[name]] & heated[name])) for name in heated)

    @cached_property
    def distinct_materials(self) -> dict[str, Numbers]:
        """Material numbers (n_cells,) by element type; equal materials share one number.

        Equal materials have the same moduli, axes and expansion, so that the stress is continuous across their interface.
        """
        first_number: dict[object, int] = {}
        keys = [_law_key(material, moduli) for material, moduli in zip(self.materials, self.moduli, strict=False)]
        representative = np.array([first_number.setdefault(law, number) for number, law in enumerate(keys)], np.int32)
        return {name: representative[values] for name, values in self.material_numbers.items()}


def material_field(
    mesh: Mesh, kinematics: str, materials: Sequence[Material], material_numbers: Mapping[str, Numbers]
) -> MaterialField:
    """Return the materials of all solid cells.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    materials : sequence of Material
    material_numbers : mapping of str to ndarray of int (n_cells,)
        Number of the material of each cell, by solid element type.
    """
    size = 6 if kinematics == "3d" else 4
    moduli = [np.zeros((1, size, size)) if m.varies else m.moduli(kinematics)[None] for m in materials]
    owner = [np.arange(len(materials), dtype=np.int32)]
    rows, rows_at_points = {name: values.copy() for name, values in material_numbers.items()}, dict[str, Numbers]()
    evaluations: list[EvaluationPoints] = []

    def add(index: int, points: Array, constants: Any) -> Numbers:
        """Add the moduli of a material at `points`; return their rows."""
        first = sum(map(len, moduli))
        evaluations.append(EvaluationPoints(index, slice(first, first + len(points)), points, constants))
        moduli.append(materials[index].moduli_at(points, kinematics, constants))
        owner.append(np.full(len(points), index, np.int32))
        return first + np.arange(len(points), dtype=np.int32)

    cells_by_material = [
        (index, material, name, block, np.flatnonzero(material_numbers[name] == index))
        for index, material in enumerate(materials)
        for name, block in mesh.solids.items()
    ]
    for index, material, name, block, cells in cells_by_material:
        if material.varies:
            centres = mesh.points[block[cells]].mean(axis=1)
            rows[name][cells] = add(index, centres, material.constants_at(name, cells, centre_weights(name)))
    for index, material, name, block, cells in cells_by_material:
        if material.varies_inside:
            N = elements.get(name).tables[0]
            rows_at_points.setdefault(name, np.repeat(rows[name][:, None], len(N), axis=1))
            new_rows = add(index, positions(mesh, block[cells], N), material.constants_at(name, cells, N))
            rows_at_points[name][cells] = new_rows.reshape(len(cells), len(N))
    all_moduli, owners = np.concatenate(moduli), np.concatenate(owner)
    numbers = dict(material_numbers)
    return MaterialField(materials, kinematics, all_moduli, evaluations, owners, numbers, rows, rows_at_points)


def _law_key(material: Material, moduli: Array) -> tuple[object, ...]:
    """Return a key that is equal for two materials if the stress is continuous across their interface."""
    constants = tuple(getattr(material, name, None) for name in MODULI) if material.graded else None
    compliance = b"" if material.graded else material.local_compliance.tobytes()
    if not material.varies:
        return moduli.tobytes(), repr(material.expansion)
    return constants, compliance, id(material.axes), repr(material.expansion), material.expansion
