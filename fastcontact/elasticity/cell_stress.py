"""Stresses in cells, computed from the displacements at arbitrary points of the reference cell."""

from __future__ import annotations

import numpy as np

from fastcontact._jit import parallel
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.elasticity import dilatation, dilatation_kernels, incompatible_modes, incompatible_modes_kernels
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.stiffness import LOOPS, of_cells
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

# Number of cells processed at a time where moduli vary within cells, which limits the memory for local moduli.
VARYING = 2_000


def interpolation(name: str, xi: Array) -> Array:
    """Return the interpolation weights (n, n_q) [-] from the quadrature points to points `xi` (n, dim) [-]."""
    element = elements.get(name)
    if xi is element.quadrature[0]:
        return np.eye(len(xi))
    return np.asarray(element.shape(xi) @ element.extrapolation)


class CellStress:
    """Stresses in the cells of a mesh with given displacements.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"``, ``"plane_strain"``, ``"plane_stress"`` or ``"3d"``.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    displacement : ndarray (n_points, dim)
        Displacements of all points [length].
    averaged : ndarray of bool or uint8 (n_materials,), optional
        Whether each material has a mean dilatation, see `dilatation`; or the codes of `MaterialField.treatment`, which also
        state whether it has incompatible modes. By default no material has either.
    offset : StressOffset, optional
        Stresses due to temperature and initial states.
    """

    def __init__(
        self, mesh: Mesh, kinematics: str, moduli: Array, displacement: Array, averaged: dilatation.Mask | None = None,
        offset: StressOffset | None = None,
    ) -> None:  # fmt: skip
        self._mesh, self._axisymmetric, self._moduli = mesh, kinematics == "axisymmetric", moduli
        self._displacement = np.ascontiguousarray(displacement)
        self._averaged = averaged if np.any(averaged) else None
        self._offset = offset

    def at(self, name: str, xi: Array, cells: Numbers, material: Numbers, rows: Indices) -> Array:
        """Return the stresses (n_cells, n, n_components) [pressure] at points `xi` (n, dim) [-] of cells of an element.

        The integer arrays are the nodes `cells` (n_cells, n_nodes), the numbers `rows` (n_cells,) of the cells, and the
        material numbers `material` (n_cells,) of cells, or (n_cells, n_q) of quadrature points.
        """
        out = np.empty((len(cells), len(xi), self._moduli.shape[1]))
        self.fill(name, xi, cells, material, out, rows)
        return out

    def fill(self, name: str, xi: Array, cells: Numbers, material: Numbers, out: Array, rows: Indices) -> None:
        """Fill `out` (n_cells, n, n_components) [pressure] with the stresses, in parallel.

        The points `xi` (n, dim) [-] and the integer arrays `cells` (n_cells, n_nodes), `material` (n_cells,) or
        (n_cells, n_q) and `rows` (n_cells,) are described for `at`.
        """
        element, split = elements.get(name), None
        if self._averaged is not None:
            split = dilatation.split(name, self._moduli, self._averaged)
        moduli = self._moduli if split is None else split.moduli
        if xi is element.quadrature[0]:
            N, dN, _ = element.tables
        else:
            N, dN = np.ascontiguousarray(element.shape(xi)), np.ascontiguousarray(element.gradient(xi))
        loops, points, cells = LOOPS[self._mesh.dim], self._mesh.points, parallel.read_only(cells)

        def fill_rows(span: tuple[int, int]) -> None:
            portion = slice(*span)
            nodes, numbers, stress = cells[portion], material[portion], out[portion]
            if numbers.ndim == 1:
                loops.stress(points, nodes, N, dN, moduli, numbers, self._axisymmetric, self._displacement, stress)
            else:
                self._fill_varying((name, xi, N, dN), nodes, numbers, moduli, stress)
            if split is not None:
                shared = of_cells(numbers), self._axisymmetric, self._displacement
                bases = dilatation.basis(name, element.quadrature[0]), dilatation.basis(name, xi)
                element_tables = *element.tables, bases[0], split.bulk
                dilatation_kernels.add_pressure(points, nodes, *element_tables, *shared, bases[1], stress)
            if self._averaged is not None:
                self._add_modes((name, xi, dN), nodes, numbers, stress, rows[portion])

        parallel.shared(fill_rows, parallel.portions(len(out), cells.shape[1]))
        if self._offset is not None:
            self._add_offset(self._offset, (name, xi, rows), cells, material, out)

    def _fill_varying(
        self, at: tuple[str, Array, Array, Array], cells: Numbers, material: Numbers, moduli: Array,
        out: Array,
    ) -> None:  # fmt: skip
        """Fill `out` if moduli vary within cells.

        If the points are the quadrature points, they are processed one after the other, each in all cells. At other points
        the moduli are interpolated from the quadrature points, and the strains are the stresses of unit moduli.
        """
        name, xi, N, dN = at
        loops, shared = LOOPS[self._mesh.dim], (self._axisymmetric, self._displacement)
        if xi is elements.get(name).quadrature[0]:
            at_point = np.empty((len(cells), 1, out.shape[2]))
            for q in range(len(xi)):
                tables, of_moduli = (N[q : q + 1], dN[q : q + 1]), np.ascontiguousarray(material[:, q])
                loops.stress(self._mesh.points, cells, *tables, moduli, of_moduli, *shared, at_point)
                out[:, q] = at_point[:, 0]
            return
        unit_moduli, row_of_moduli = np.eye(self._moduli.shape[1])[None], np.zeros(len(cells), np.int32)
        strain = np.empty_like(out)
        loops.stress(self._mesh.points, cells, N, dN, unit_moduli, row_of_moduli, *shared, strain)
        weights = interpolation(name, xi)
        for first_cell in range(0, len(cells), VARYING):
            portion = slice(first_cell, first_cell + VARYING)
            local = np.einsum("nq,cqij->cnij", weights, moduli[material[portion]], optimize=True)
            out[portion] = np.einsum("cnij,cnj->cni", local, strain[portion])

    def _add_modes(
        self, at: tuple[str, Array, Array], cells: Numbers, material: Numbers, out: Array, rows: Indices
    ) -> None:
        """Add the stresses of incompatible modes."""
        name, xi, dN = at
        with_modes = incompatible_modes.with_modes(name, self._averaged)
        if with_modes is None:
            return
        numbers = material.reshape(len(cells), -1)
        subtracted = np.empty((0, 0, 0))
        if self._offset is not None:
            quadrature_points = name, elements.get(name).quadrature[0], rows
            strain = self._stress_free(self._offset, quadrature_points, cells, material)
            subtracted = (self._moduli[numbers] @ strain[..., None])[..., 0]
            stress = self._offset.initial("stress", name, rows, elements.get(name).tables[0])
            subtracted = subtracted if stress is None else subtracted - stress
        incompatible_modes_kernels.add_stress(
            self._mesh.points, cells, *incompatible_modes.tables(name), self._moduli, with_modes, numbers,
            self._displacement, subtracted, xi, dN, interpolation(name, xi), out,
        )  # fmt: skip

    @staticmethod
    def _stress_free(offset: StressOffset, at: tuple[str, Array, Indices], cells: Numbers, material: Numbers) -> Array:
        """Return the sum of thermal and initial strains (n_cells, n, n_components) [-]."""
        name, xi, rows = at
        N = elements.get(name).shape(xi)
        if material.ndim == 1:
            expansion = offset.expansion[material][:, None, :]
        else:
            expansion = np.einsum("nq,cqi->cni", interpolation(name, xi), offset.expansion[material])
        strain = (offset.rise[cells] @ N.T)[:, :, None] * expansion
        initial = offset.initial("strain", name, rows, N)
        return strain if initial is None else strain + initial

    def _add_offset(
        self, offset: StressOffset, at: tuple[str, Array, Indices], cells: Numbers, material: Numbers, out: Array
    ) -> None:
        """Add initial stresses, and subtract the moduli times the stress-free strains, with their dilatation projected."""
        name, xi, rows = at
        stress = offset.initial("stress", name, rows, elements.get(name).shape(xi))
        if stress is not None:
            out += stress
        strain = self._stress_free(offset, at, cells, material)
        split = dilatation.split(name, self._moduli, self._averaged)
        moduli = self._moduli if split is None else split.moduli
        if material.ndim == 1:
            out -= strain @ moduli[material]  # moduli are symmetric
        else:
            local = np.einsum("nq,cqij->cnij", interpolation(name, xi), moduli[material], optimize=True)
            out -= np.einsum("cnij,cnj->cni", local, strain)
        if split is None:
            return
        bulk = split.bulk[of_cells(material)]
        split_cells = bulk[:, 0] != 0.0
        at_points = name, elements.get(name).quadrature[0], rows[split_cells]
        strain = self._stress_free(offset, at_points, cells[split_cells], material[split_cells])
        corners = self._mesh.points[cells[split_cells]]
        mean_and_rest = dilatation.projected(name, corners, strain[:, :, :3].sum(axis=2), xi, self._axisymmetric)
        out[split_cells, :, :3] -= (bulk[split_cells][:, :, None] * mean_and_rest).sum(axis=1)[:, :, None]
