"""Stresses from displacements in cells and at nodes, internal forces, and equivalent stresses and strains."""

from __future__ import annotations

import itertools

import numpy as np

from fastcontact._jit import parallel
from fastcontact._tools.argument_types import typed, unchecked
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.elasticity import dilatation, incompatible_modes
from fastcontact.elasticity.energy import gradients_at
from fastcontact.elasticity.incompatible_modes import VOIGT
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.material_sides import MaterialSides
from fastcontact.elasticity.stiffness import LOOPS, cell_materials
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

# Public functions, of `fastcontact.recovery`.
__all__ = [
    "NodalAverage", "equivalent_strain", "internal_force", "nodal_average", "nodal_stress", "principal_stress",
    "stress_at_element_nodes", "stress_at_points", "tresca", "von_mises", "von_mises_signed",
]  # fmt: skip

Materials = dict[str, Numbers]
Location = tuple[str, Array, Indices]  # type of the cells, reference coordinates of points, and rows of the cells
# Memory for the stresses of the cells that are processed together [bytes].
BATCH = 16_000_000
# The distribution of node numbers is estimated from one of SAMPLING_INTERVAL cells.
SAMPLING_INTERVAL = 16
# Number of cells processed at a time by NumPy, which limits the memory for the moduli and gradients at their points.
CELLS_AT_ONCE = 2_000


def interpolation(name: str, xi: Array) -> Array:
    """Return the weights (n, n_q) [-] for interpolation from the quadrature points to the points `xi` (n, dim) [-]."""
    element = elements.get(name)
    if xi is element.quadrature[0]:
        return np.eye(len(xi))
    return np.asarray(element.shape(xi) @ element.extrapolation)


def _varying_product(moduli: Array, name: str, xi: Array, material: Numbers, strain: Array) -> Array:
    """Return the product of moduli and strains at points `xi`; `material` (n_cells, n_q) refers to quadrature points."""
    moduli_at_xi = np.einsum("nq,cqij->cnij", interpolation(name, xi), moduli[material], optimize=True)
    return np.asarray(np.einsum("cnij,cnj->cni", moduli_at_xi, strain))


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
        state whether it has incompatible modes. By default, no material has either.
    offset : StressOffset, optional
        Stresses due to temperatures and initial states.
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

        The integer arrays contain the nodes of the cells, `cells` (n_cells, n_nodes), their numbers, `rows` (n_cells,), and
        the material numbers of cells, `material` (n_cells,), or of quadrature points, (n_cells, n_q).
        """
        out = np.empty((len(cells), len(xi), self._moduli.shape[1]))
        element, split = elements.get(name), dilatation.split(name, self._moduli, self._averaged)
        moduli = self._moduli if split is None else split.moduli
        N, dN = np.ascontiguousarray(element.shape(xi)), element.gradient(xi)
        loops, points, cells = LOOPS[self._mesh.dim], self._mesh.points, parallel.read_only(cells)

        def fill_rows(span: tuple[int, int]) -> None:
            portion = slice(*span)
            nodes, numbers, stress = cells[portion], material[portion], out[portion]
            if numbers.ndim == 1:
                loops.stress(points, nodes, N, dN, moduli, numbers, self._axisymmetric, self._displacement, stress)
            else:
                self._fill_varying((name, xi, N, dN), nodes, numbers, moduli, stress)
            if split is not None:
                from fastcontact.elasticity import dilatation_kernels

                options = cell_materials(numbers), self._axisymmetric, self._displacement
                bases = dilatation.basis(name, element.quadrature[0]), dilatation.basis(name, xi)
                element_tables = *element.tables, bases[0], split.bulk
                dilatation_kernels.add_pressure(points, nodes, *element_tables, *options, bases[1], stress)
            with_modes = incompatible_modes.with_modes(name, self._averaged)
            if with_modes is not None:
                self._add_modes((name, xi, dN), with_modes, nodes, numbers, stress, rows[portion])

        parallel.parallel_map(fill_rows, parallel.portions(len(out), cells.shape[1]))
        if self._offset is not None:
            self._add_offset(self._offset, (name, xi, rows), cells, material, out)
        return out

    def _fill_varying(
        self, location: tuple[str, Array, Array, Array], cells: Numbers, material: Numbers, moduli: Array,
        out: Array,
    ) -> None:  # fmt: skip
        """Fill `out` with the stresses of cells within which the moduli vary.

        The moduli are interpolated from the quadrature points. The strains are computed as the stresses for unit moduli.
        """
        name, xi, N, dN = location
        unit_moduli, row_of_moduli = np.eye(moduli.shape[1])[None], np.zeros(len(cells), np.int32)
        strain, options = np.empty_like(out), (self._axisymmetric, self._displacement)
        LOOPS[self._mesh.dim].stress(self._mesh.points, cells, N, dN, unit_moduli, row_of_moduli, *options, strain)
        for first in range(0, len(cells), CELLS_AT_ONCE):
            portion = slice(first, first + CELLS_AT_ONCE)
            out[portion] = _varying_product(moduli, name, xi, material[portion], strain[portion])

    def _add_modes(
        self, location: tuple[str, Array, Array], with_modes: Mask, cells: Numbers, material: Numbers, out: Array,
        rows: Indices,
    ) -> None:  # fmt: skip
        """Add the stresses due to incompatible modes, for the moduli that are marked in `with_modes` (n_materials,)."""
        from fastcontact.elasticity import incompatible_modes_kernels

        name, xi, dN = location
        numbers, offset_stress = material.reshape(len(cells), -1), np.empty((0, 0, 0))
        if self._offset is not None:
            quadrature_points = name, elements.get(name).quadrature[0], rows
            strain = self._stress_free_strain(self._offset, quadrature_points, cells, material)
            offset_stress = (self._moduli[numbers] @ strain[..., None])[..., 0]
            stress = self._offset.sum_of_states("stress", name, rows, elements.get(name).tables[0])
            offset_stress = offset_stress if stress is None else offset_stress - stress
        incompatible_modes_kernels.add_stress(
            self._mesh.points, cells, *incompatible_modes.tables(name), self._moduli, with_modes, numbers,
            self._displacement, offset_stress, xi, dN, interpolation(name, xi), out,
        )  # fmt: skip

    @staticmethod
    def _stress_free_strain(offset: StressOffset, location: Location, cells: Numbers, material: Numbers) -> Array:
        """Return the sum of thermal and initial strains (n_cells, n, n_components) [-]."""
        name, xi, rows = location
        N = elements.get(name).shape(xi)
        if material.ndim == 1:
            expansion = offset.expansion[material][:, None, :]
        else:
            expansion = np.einsum("nq,cqi->cni", interpolation(name, xi), offset.expansion[material])
        strain = (offset.rise[cells] @ N.T)[:, :, None] * expansion
        initial = offset.sum_of_states("strain", name, rows, N)
        return strain if initial is None else strain + initial

    def _add_offset(
        self, offset: StressOffset, location: Location, cells: Numbers, material: Numbers, out: Array
    ) -> None:
        """Add initial stresses, and subtract the stresses of the stress-free strains, whose dilatation is projected."""
        name, xi, rows = location
        stress = offset.sum_of_states("stress", name, rows, elements.get(name).shape(xi))
        if stress is not None:
            out += stress
        strain = self._stress_free_strain(offset, location, cells, material)
        split = dilatation.split(name, self._moduli, self._averaged)
        moduli = self._moduli if split is None else split.moduli
        if material.ndim == 1:
            out -= strain @ moduli[material]  # moduli are symmetric
        else:
            out -= _varying_product(moduli, name, xi, material, strain)
        if split is None:
            return
        bulk = split.bulk[cell_materials(material)]
        is_split = bulk[:, 0] != 0.0
        at_points = name, elements.get(name).quadrature[0], rows[is_split]
        strain = self._stress_free_strain(offset, at_points, cells[is_split], material[is_split])
        coordinates = self._mesh.points[cells[is_split]]
        dilatations = dilatation.project_field(name, coordinates, strain[:, :, :3].sum(axis=2), xi, self._axisymmetric)
        out[is_split, :, :3] -= (bulk[is_split][:, :, None] * dilatations).sum(axis=1)[:, :, None]


@typed(ModelError)
def stress_at_points(
    mesh: Mesh,
    kinematics: str,
    moduli: Array,
    material: Materials,
    displacement: Array,
    averaged: dilatation.Mask | None = None,
    offset: StressOffset | None = None,
) -> dict[str, Array]:
    """Return the stress (n_cells, n_q, n_components) [pressure] at the default quadrature points, by solid element type.

    The components are xx, yy, zz, xy, in 3D also yz, xz, and in axisymmetry rr, yy, hoop, ry.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"``, ``"plane_strain"``, ``"plane_stress"`` or ``"3d"``.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    material : dict of str to ndarray of int (n_cells,) or (n_cells, n_q)
        Material number of each cell, or of each quadrature point, by solid element type (`MaterialField.moduli_rows`).
    displacement : ndarray (n_points, dim)
        Displacements of all points [length].
    averaged : ndarray of bool or uint8 (n_materials,), optional
        Whether each material has a mean dilatation, see `dilatation`; or the codes of `MaterialField.treatment`, which also
        state whether it has incompatible modes. By default, no material has either.
    offset : StressOffset, optional
        Stresses due to temperatures and initial states [pressure].
    """
    stress = CellStress(mesh, kinematics, moduli, displacement, averaged, offset)
    return {
        name: stress.at(name, elements.get(name).quadrature[0], block, material[name], np.arange(len(block)))
        for name, block in mesh.solids.items()
    }


@typed(ModelError)
def nodal_stress(
    mesh: Mesh,
    kinematics: str,
    moduli: Array,
    material: Materials,
    displacement: Array,
    averaged: dilatation.Mask | None = None,
    sides: MaterialSides | None = None,
    offset: StressOffset | None = None,
) -> Array:
    """Return the stress (n_points, n_components) [pressure] at the nodes: `nodal_average` of `stress_at_points`.

    To save memory, stresses at quadrature points are computed for a limited number of cells at a time. If `sides` is given,
    the result has one row for each slot of `sides` (n_slots, n_components), the mean at a node over the cells of one
    material. The other arguments are as for `stress_at_points`.
    """
    stress = CellStress(mesh, kinematics, moduli, displacement, averaged, offset)
    slots = mesh.cells if sides is None else sides.cells
    average = NodalAverage(mesh.n_points if sides is None else len(sides.node), moduli.shape[1])
    for name, block in mesh.solids.items():
        element = elements.get(name)
        xi, _ = element.quadrature
        size = BATCH // (8 * len(xi) * moduli.shape[1]) + 1
        for first in range(0, len(block), size):
            rows = slice(first, first + size)
            numbers = np.arange(first, min(first + size, len(block)))
            values = stress.at(name, xi, block[rows], material[name][rows], numbers)
            _add_values(average, slots[name][rows], element.extrapolation, values)
    return average.result()


class NodalAverage:
    """Mean of the stresses of the cells at each node, with the same weight for all cells."""

    def __init__(self, count: int, components: int) -> None:
        self._total, self._count = np.zeros((count, components)), np.zeros(count)

    @typed(ModelError)
    def add(self, cells: Numbers, extrapolation: Array, values: Array) -> None:
        """Add the stresses `values` (n_cells, n_q, n_components) [pressure] at quadrature points of cells.

        The array `cells` (n_cells, n_nodes) contains the nodes of the cells. The matrix `extrapolation` (n_nodes, n_q) [-]
        maps values at quadrature points to values at nodes.
        """
        arguments = parallel.read_only(cells), extrapolation, values
        sums = self._total, self._count
        # The kernel is in the module for 2D, but is independent of the dimension and the number of components.
        parallel.parallel_map(lambda nodes: LOOPS[2].add_nodal(*arguments, *nodes, *sums), self._node_ranges(cells))

    def _node_ranges(self, cells: Numbers) -> list[tuple[int, int]]:
        """Return a range of nodes for each thread, such that about the same number of cells belongs to each range."""
        sampled_nodes = np.sort(cells[::SAMPLING_INTERVAL, 0])
        count = len(parallel.portions(*cells.shape)) if len(sampled_nodes) else 1
        ends = [0, *(int(sampled_nodes[k * len(sampled_nodes) // count]) for k in range(1, count)), len(self._count)]
        return list(itertools.pairwise(ends))

    def result(self) -> Array:
        """Return the mean (n_points, n_components) [pressure], which is zero at points without cells; to be called once."""
        self._total /= np.maximum(self._count, 1.0)[:, None]
        return self._total


_add_values = unchecked(NodalAverage.add)


@typed(ModelError)
def stress_at_element_nodes(at_points: dict[str, Array]) -> dict[str, Array]:
    """Return the stress (n_cells, n_nodes, n_components) [pressure] at the nodes of each cell, by solid element type.

    It is extrapolated by `Element.extrapolation` from `at_points` (n_cells, n_q, n_components) [pressure], like SIEF_ELNO of
    code_aster.
    """
    return {name: np.einsum("aq,cqi->cai", elements.get(name).extrapolation, at_points[name]) for name in at_points}


@typed(ModelError)
def nodal_average(mesh: Mesh, at_points: dict[str, Array], sides: MaterialSides | None = None) -> Array:
    """Return the stress (n_points, n_components) [pressure] at the nodes: the unweighted mean over the cells at each node.

    It is computed from the stresses `at_points` (n_cells, n_q, n_components) [pressure], like SIEF_NOEU of code_aster. The
    stress is zero at points without a solid cell. If `sides` is given, the result has one row for each slot of `sides`
    (n_slots, n_components), the mean at a node over the cells of one material.
    """
    slots, count = (mesh.cells, mesh.n_points) if sides is None else (sides.cells, len(sides.node))
    average = NodalAverage(count, next(iter(at_points.values())).shape[2])
    for name, values in at_points.items():
        average.add(slots[name], elements.get(name).extrapolation, values)
    return average.result()


@typed(ModelError)
def internal_force(mesh: Mesh, kinematics: str, at_points: dict[str, Array]) -> Array:
    """Return the nodal forces (n_points, dim) [force] that are in equilibrium with given stresses.

    `at_points` (n_cells, n_q, n_components) [pressure] contains the stresses at quadrature points, by solid element type.
    """
    force, axisymmetric = np.zeros((mesh.n_points, mesh.dim)), kinematics == "axisymmetric"
    for name, stress in at_points.items():
        N, dN, weights = elements.get(name).tables
        for first in range(0, len(stress), CELLS_AT_ONCE):
            cells = mesh.cells[name][first : first + CELLS_AT_ONCE]
            coordinates, (gradient, volume) = mesh.points[cells], gradients_at(mesh.points[cells], dN)
            weighted = (volume * weights)[..., None] * stress[first : first + CELLS_AT_ONCE]
            if axisymmetric:
                radius = np.einsum("qa,ca->cq", N, coordinates[..., 0])
                weighted *= 2.0 * np.pi * radius[..., None]
            nodal = np.einsum("cqaj,cqij->cai", gradient, weighted[..., VOIGT[mesh.dim]], optimize=True)
            if axisymmetric:
                nodal[..., 0] += weighted[..., 2] / radius @ N
            for i in range(mesh.dim):
                force[:, i] += np.bincount(cells.ravel(), nodal[..., i].ravel(), mesh.n_points)
    return force


@typed(ModelError)
def von_mises(stress: Array) -> Array:
    """Return the equivalent stress (...) [pressure] of `stress` (..., n_components) [pressure] (von Mises, 1913).

    The components are xx, yy, zz, xy, in 3D also yz, xz.
    """
    stress = _checked_components(stress)
    xx, yy, zz = stress[..., 0], stress[..., 1], stress[..., 2]
    shear = (stress[..., 3:] ** 2).sum(axis=-1)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * shear)


@typed(ModelError)
def principal_stress(stress: Array) -> Array:
    """Return the principal stresses (..., 3) [pressure], in ascending order, of `stress` (..., n_components) [pressure].

    The components are xx, yy, zz, xy, in 3D also yz, xz.
    """
    stress = _checked_components(stress)
    six_components = np.concatenate([stress, np.zeros((*stress.shape[:-1], 6 - stress.shape[-1]))], axis=-1)
    return np.asarray(np.linalg.eigvalsh(six_components[..., VOIGT[3]]))


@typed(ModelError)
def tresca(stress: Array) -> Array:
    """Return the Tresca stress (...) [pressure] of `stress` (..., n_components) [pressure].

    It is the difference between the largest and the smallest principal stress, which is twice the largest shear stress.
    """
    return np.asarray(np.ptp(principal_stress(stress), axis=-1))


def _checked_components(stress: Array) -> Array:
    """Return stresses or strains (..., n_components) as an array; ModelError unless they have four or six components."""
    stress = np.asarray(stress, float)
    if stress.shape[-1:] not in ((4,), (6,)):
        raise ModelError(
            f"the last axis must contain the components xx, yy, zz, xy, in 3D also yz, xz, but the shape is {stress.shape}"
        )
    return stress


@typed(ModelError)
def equivalent_strain(strain: Array) -> Array:
    """Return the equivalent strain (...) [-] of `strain` (..., n_components) [-].

    For isotropic linear elastic materials, it is the von Mises stress divided by 3 G. The components are xx, yy, zz and the
    engineering shear strain xy, in 3D also the engineering shear strains yz and xz.
    """
    strain = _checked_components(strain)
    tensor = strain * np.array([1.0] * 3 + [0.5] * (strain.shape[-1] - 3))
    return np.asarray(2.0 / 3.0 * von_mises(tensor))


@typed(ModelError)
def von_mises_signed(stress: Array, equivalent: Array | None = None) -> Array:
    """Return the von Mises stress (...) [pressure] with the sign of the trace, like VMIS_SG of code_aster.

    The argument `equivalent` (...) [pressure] is the von Mises stress of `stress` (..., n_components) [pressure]. It is
    computed if it is not given.
    """
    stress = _checked_components(stress)
    trace = stress[..., 0] + stress[..., 1] + stress[..., 2]
    return np.where(trace < 0, -1.0, 1.0) * (von_mises(stress) if equivalent is None else equivalent)
