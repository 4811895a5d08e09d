"""Stresses from displacements at quadrature points and nodes, internal forces, and equivalent stresses and strains."""

from __future__ import annotations

import itertools

import numpy as np

from fastcontact._jit import parallel
from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity import dilatation, element_2d_kernels
from fastcontact.elasticity.cell_stress import CellStress
from fastcontact.elasticity.incompatible_modes import PAIRS
from fastcontact.elasticity.initial_states import StressOffset
from fastcontact.elasticity.material_sides import MaterialSides
from fastcontact.elasticity.stiffness import LOOPS
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

Materials = dict[str, Numbers]
# Memory for the stresses of cells that are processed together [bytes].
BATCH = 16_000_000
# Every SAMPLED-th cell is used to estimate the distribution of node numbers.
SAMPLED = 16


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

    Components are xx, yy, zz, xy, in 3D also yz, xz, and in axisymmetry rr, yy, hoop, ry.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
        ``"axisymmetric"``, ``"plane_strain"``, ``"plane_stress"`` or ``"3d"``.
    moduli : ndarray (n_materials, 4, 4), in 3D (n_materials, 6, 6)
        From `LinearElastic.moduli` [pressure].
    material : dict of str to ndarray of int (n_cells,) or (n_cells, n_q)
        Material number of each cell, or of each quadrature point, by solid element type (`MaterialField.loops`).
    displacement : ndarray (n_points, dim)
        Displacements of all points [length].
    averaged : ndarray of bool or uint8 (n_materials,), optional
        Whether each material has a mean dilatation, see `dilatation`; or the codes of `MaterialField.treatment`, which also
        state whether it has incompatible modes. By default no material has either.
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

    Other arguments are as for `stress_at_points`. Stresses at points are computed for a limited number of cells at a time,
    which takes less memory. With `sides` the result has a row for each of its slots (n_slots, n_components): the mean at a
    node over the cells of one material.
    """
    stress = CellStress(mesh, kinematics, moduli, displacement, averaged, offset)
    slots = mesh.cells if sides is None else sides.cells
    average = NodalAverage(mesh.n_points if sides is None else len(sides.node), moduli.shape[1])
    for name, block in mesh.solids.items():
        element = elements.get(name)
        xi, _ = element.quadrature
        bytes_of_cell = 8 * len(xi) * moduli.shape[1]
        buffer = np.empty((min(len(block), BATCH // bytes_of_cell + 1), len(xi), moduli.shape[1]))
        for first in range(0, len(block), len(buffer)):
            rows = slice(first, first + len(buffer))
            values = buffer[: len(block) - first]
            stress.fill(name, xi, block[rows], material[name][rows], values, np.arange(first, first + len(values)))
            average.add(slots[name][rows], element.extrapolation, values)
    return average.result()


class NodalAverage:
    """Mean of the stresses of the adjacent cells at each node, all cells with the same weight."""

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
        parallel.shared(lambda nodes: element_2d_kernels.add_nodal(*arguments, *nodes, *sums), self._node_ranges(cells))

    def _node_ranges(self, cells: Numbers) -> list[tuple[int, int]]:
        """Return a range of nodes for each thread, such that all ranges have about the same number of cells."""
        sampled_nodes = np.sort(cells[::SAMPLED, 0])
        count = len(parallel.portions(*cells.shape)) if len(sampled_nodes) else 1
        ends = [0, *(int(sampled_nodes[k * len(sampled_nodes) // count]) for k in range(1, count)), len(self._count)]
        return list(itertools.pairwise(ends))

    def result(self) -> Array:
        """Return the mean (n_points, n_components) [pressure], zero at points without cells; call this method only once."""
        self._total /= np.maximum(self._count, 1.0)[:, None]
        return self._total


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

    It is computed from the stresses `at_points` (n_cells, n_q, n_components) [pressure], like SIEF_NOEU of code_aster. Points
    without a solid cell have zero stress. With `sides` the result has a row for each of its slots (n_slots, n_components):
    the mean at a node over the cells of one material.
    """
    slots, count = (mesh.cells, mesh.n_points) if sides is None else (sides.cells, len(sides.node))
    average = NodalAverage(count, next(iter(at_points.values())).shape[2])
    for name, values in at_points.items():
        average.add(slots[name], elements.get(name).extrapolation, values)
    return average.result()


@typed(ModelError)
def internal_force(mesh: Mesh, kinematics: str, at_points: dict[str, Array]) -> Array:
    """Return the nodal forces (n_points, dim) [force] in equilibrium with the stresses at quadrature points.

    The stresses are `at_points` (n_cells, n_q, n_components) [pressure], by solid element type.
    """
    force, axisymmetric = np.zeros((mesh.n_points, mesh.dim)), kinematics == "axisymmetric"
    for name, values in at_points.items():
        tables = elements.get(name).tables
        LOOPS[mesh.dim].add_internal_force(mesh.points, mesh.cells[name], *tables, axisymmetric, values, force)
    return force


@typed(ModelError)
def von_mises(stress: Array) -> Array:
    """Return the equivalent stress (...) [pressure] of `stress` (..., n_components) [pressure] (von Mises, 1913).

    Components are xx, yy, zz, xy, in 3D also yz, xz.
    """
    stress = _with_components(stress)
    xx, yy, zz = stress[..., 0], stress[..., 1], stress[..., 2]
    shear = (stress[..., 3:] ** 2).sum(axis=-1)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * shear)


@typed(ModelError)
def principal_stress(stress: Array) -> Array:
    """Return the principal stresses (..., 3) [pressure], in ascending order, of `stress` (..., n_components) [pressure].

    Components are xx, yy, zz, xy, in 3D also yz, xz.
    """
    stress = _with_components(stress)
    six_components = np.concatenate([stress, np.zeros((*stress.shape[:-1], 6 - stress.shape[-1]))], axis=-1)
    return np.asarray(np.linalg.eigvalsh(six_components[..., PAIRS[3]]))


@typed(ModelError)
def tresca(stress: Array) -> Array:
    """Return the Tresca stress (...) [pressure] of `stress` (..., n_components) [pressure].

    It is the largest minus the smallest principal stress, twice the largest shear stress.
    """
    return np.asarray(np.ptp(principal_stress(stress), axis=-1))


def _with_components(stress: Array) -> Array:
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

    For linear elastic isotropic materials it is the von Mises stress divided by 3 G. Components are xx, yy, zz and the
    engineering shear strain xy, in 3D also those of yz and xz.
    """
    strain = _with_components(strain)
    tensor = strain * np.array([1.0] * 3 + [0.5] * (strain.shape[-1] - 3))
    return np.asarray(2.0 / 3.0 * von_mises(tensor))


@typed(ModelError)
def von_mises_signed(stress: Array, equivalent: Array | None = None) -> Array:
    """Return the von Mises stress (...) [pressure] with the sign of the trace, as VMIS_SG of code_aster.

    The argument `equivalent` (...) [pressure] is the von Mises stress of `stress` (..., n_components) [pressure]; it is
    computed if it is not given.
    """
    stress = _with_components(stress)
    trace = stress[..., 0] + stress[..., 1] + stress[..., 2]
    return np.where(trace < 0, -1.0, 1.0) * (von_mises(stress) if equivalent is None else equivalent)
