"""Stresses in cells from displacements, at any points of the reference cell."""

from __future__ import annotations

import numpy as np

from fastcontact._jit import parallel
from fastcontact.arrays import Array, Indices, Numbers
from fastcontact.elasticity import (
    dilatation,
    dilatation_kernels,
    element_kernels,
    incompatible_modes,
    incompatible_modes_kernels,
)
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.stiffness import of_cells
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

# Number of cells processed at a time if moduli vary inside them.
VARYING = 2_000


def beside(name: str, xi: Array) -> Array:
    """Return the interpolation weights (n, n_q) [-] from the quadrature points to points `xi` (n, dim) [-]."""
    element = elements.get(name)
    if xi is element.quadrature[0]:
        return np.eye(len(xi))
    return np.asarray(element.shape(xi) @ element.extrapolation)


class CellStress:
    """Stresses from the displacements of a mesh.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"``, ``"plane_strain"``, ``"plane_stress"`` or ``"3d"``.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    displacement : ndarray (n_points, dim)
        Displacements of all points [length].
    averaged : ndarray of bool (n_materials,), optional
        Materials with a mean dilatation, see `dilatation`, or incompatible modes (`MaterialField.treatment`); none by
        default.
    offset : StressOffset, optional
        Stresses due to temperature and initial states.
    """

    def __init__(
        self,
        mesh: Mesh,
        kinematics: str,
        moduli: Array,
        displacement: Array,
        averaged: dilatation.Mask | None = None,
        offset: StressOffset | None = None,
    ) -> None:
        self._mesh, self._axisymmetric, self._moduli = mesh, kinematics == "axisymmetric", moduli
        self._displacement = np.ascontiguousarray(displacement)
        self._averaged = averaged if np.any(averaged) else None
        self._offset = offset

    def at(self, name: str, xi: Array, cells: Numbers, material: Numbers, rows: Indices) -> Array:
        """Return the stresses (n_cells, n, n_components) [pressure] at points `xi` (n, dim) [-] of cells of an element.

        `cells` (n_cells, n_nodes) of int; `material` (n_cells,) or (n_cells, n_q) of int, the material number of each cell or
        of each quadrature point; `rows` (n_cells,) of int, the numbers of the cells.
        """
        out = np.empty((len(cells), len(xi), self._moduli.shape[1]))
        self.fill(name, xi, cells, material, out, rows)
        return out

    def fill(self, name: str, xi: Array, cells: Numbers, material: Numbers, out: Array, rows: Indices) -> None:
        """Fill `out` (n_cells, n, n_components) [pressure] in place, in parallel.

        The points `xi` (n, dim) [-], the `cells` (n_cells, n_nodes) of int, `material` (n_cells,) of int or (n_cells, n_q),
        and the numbers `rows` (n_cells,) of int of the cells are as for `at`.
        """
        element, split = elements.get(name), None
        if self._averaged is not None:
            split = dilatation.split(name, self._moduli, self._averaged)
        moduli = self._moduli if split is None else split.moduli
        if xi is element.quadrature[0]:
            N, dN, _ = element.tables
        else:
            N, dN = np.ascontiguousarray(element.shape(xi)), np.ascontiguousarray(element.gradient(xi))
        loops, points, cells = element_kernels.loops(self._mesh.dim), self._mesh.points, parallel.read_only(cells)

        def fill_rows(span: tuple[int, int]) -> None:
            portion = slice(*span)
            nodes, numbers, stress = cells[portion], material[portion], out[portion]
            if numbers.ndim == 1:
                loops.stress(points, nodes, N, dN, moduli, numbers, self._axisymmetric, self._displacement, stress)
            else:
                self._fill_varying((name, xi, N, dN), nodes, numbers, moduli, stress)
            if split is not None:
                shared = of_cells(numbers), self._axisymmetric, self._displacement
                polynomials, basis = dilatation.basis(name, element.quadrature[0]), dilatation.basis(name, xi)
                dilatation_kernels.add_pressure(
                    points, nodes, *element.tables, polynomials, split.bulk, *shared, basis, stress
                )
            if self._averaged is not None:
                self._add_modes((name, xi, dN), nodes, numbers, stress, rows[portion])

        parallel.shared(fill_rows, parallel.portions(len(out), cells.shape[1]))
        if self._offset is not None:
            self._add_offset(self._offset, (name, xi, rows), cells, material, out)

    def _fill_varying(
        self, at: tuple[str, Array, Array, Array], cells: Numbers, material: Numbers, moduli: Array,
        out: Array,
    ) -> None:  # fmt: skip
        """Fill `out` if moduli vary from point to point.

        At the quadrature points, the points of all cells are processed one after the other. Elsewhere strains are computed
        first, as stresses of unit moduli; moduli are interpolated from the quadrature points.
        """
        name, xi, N, dN = at
        loops, shared = element_kernels.loops(self._mesh.dim), (self._axisymmetric, self._displacement)
        if xi is elements.get(name).quadrature[0]:
            at_point = np.empty((len(cells), 1, out.shape[2]))
            for q in range(len(xi)):
                moduli_at_point = np.ascontiguousarray(material[:, q])
                loops.stress(
                    self._mesh.points, cells, N[q : q + 1], dN[q : q + 1], moduli, moduli_at_point, *shared, at_point
                )
                out[:, q] = at_point[:, 0]
            return
        unit, first = np.eye(self._moduli.shape[1])[None], np.zeros(len(cells), np.int32)
        strain = np.empty_like(out)
        loops.stress(self._mesh.points, cells, N, dN, unit, first, *shared, strain)
        weights = beside(name, xi)
        for rows in range(0, len(cells), VARYING):
            portion = slice(rows, rows + VARYING)
            local = np.einsum("nq,cqij->cnij", weights, moduli[material[portion]], optimize=True)
            out[portion] = np.einsum("cnij,cnj->cni", local, strain[portion])

    def _add_modes(
        self, at: tuple[str, Array, Array], cells: Numbers, material: Numbers, out: Array, rows: Indices
    ) -> None:
        """Add the stresses of incompatible modes."""
        name, xi, dN = at
        bends = incompatible_modes.asked(name, self._averaged)
        if bends is None:
            return
        numbers = material.reshape(len(cells), -1)
        lost = np.empty((0, 0, 0))
        if self._offset is not None:
            here = name, elements.get(name).quadrature[0], rows
            strain = self._stress_free(self._offset, here, cells, material)
            lost = (self._moduli[numbers] @ strain[..., None])[..., 0]
            stress = self._offset.initial("stress", name, rows, elements.get(name).tables[0])
            lost = lost if stress is None else lost - stress
        incompatible_modes_kernels.add_stress(
            self._mesh.points, cells, *incompatible_modes.tables(name), self._moduli, bends, numbers, self._displacement,
            lost, xi, dN, beside(name, xi), out,
        )  # fmt: skip

    @staticmethod
    def _stress_free(offset: StressOffset, at: tuple[str, Array, Indices], cells: Numbers, material: Numbers) -> Array:
        """Return thermal and initial strains (n_cells, n, n_components) [-]."""
        name, xi, rows = at
        N = elements.get(name).shape(xi)
        if material.ndim == 1:
            expansion = offset.expansion[material][:, None, :]
        else:
            expansion = np.einsum("nq,cqi->cni", beside(name, xi), offset.expansion[material])
        strain = (offset.rise[cells] @ N.T)[:, :, None] * expansion
        initial = offset.initial("strain", name, rows, N)
        return strain if initial is None else strain + initial

    def _add_offset(
        self, offset: StressOffset, at: tuple[str, Array, Indices], cells: Numbers, material: Numbers, out: Array
    ) -> None:
        """Add initial stresses and subtract those of stress-free strains, whose dilatation is projected as well."""
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
            local = np.einsum("nq,cqij->cnij", beside(name, xi), moduli[material], optimize=True)
            out -= np.einsum("cnij,cnj->cni", local, strain)
        if split is None:
            return
        bulk = split.bulk[of_cells(material)]
        of_bulk = bulk[:, 0] != 0.0
        at_points = name, elements.get(name).quadrature[0], rows[of_bulk]
        dilatations = self._stress_free(offset, at_points, cells[of_bulk], material[of_bulk])[:, :, :3].sum(axis=2)
        parts = dilatation.projected(name, self._mesh.points[cells[of_bulk]], dilatations, xi, self._axisymmetric)
        out[of_bulk, :, :3] -= (bulk[of_bulk][:, :, None] * parts).sum(axis=1)[:, :, None]
