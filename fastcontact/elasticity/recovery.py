"""Stresses from displacements: at quadrature points, at element nodes, averaged at nodes; equivalent stresses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit import parallel
from fastcontact.elasticity import element_2d_kernels, element_kernels
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

Array = NDArray[np.float64]
Materials = dict[str, NDArray[np.int32]]
# Stresses at the points of so many cells are there at a time while nodal ones are formed [bytes].
BATCH = 16_000_000


def stress_at_points(
    mesh: Mesh, kinematics: str, moduli: Array, material: Materials, displacement: Array
) -> dict[str, Array]:
    """Return the stress (n_cells, n_q, 4), in 3D (n_cells, n_q, 6), at the default quadrature points [pressure].

    By solid element. Components xx, yy, zz, xy (then yz, xz in 3D); axisymmetric: rr, yy, hoop, ry. Arguments as in
    `assembly.stiffness`, with the displacement (n_points, dim) [length].
    """
    loops, values = _Loops(mesh, kinematics, moduli, material, displacement), {}
    for name, block in mesh.solids.items():
        values[name] = loops.room(name, len(block))
        loops.fill(name, 0, values[name])
    return values


def nodal_stress(mesh: Mesh, kinematics: str, moduli: Array, material: Materials, displacement: Array) -> Array:
    """Return the stress (n_points, n_components) at the nodes, `nodal_average` of `stress_at_points`, in little memory."""
    loops, average = _Loops(mesh, kinematics, moduli, material, displacement), _Average(mesh, moduli.shape[1])
    for name, block in mesh.solids.items():
        room = loops.room(name, 1)
        room = loops.room(name, min(len(block), BATCH // room.nbytes + 1))
        for first in range(0, len(block), len(room)):
            values = room[: len(block) - first]
            loops.fill(name, first, values)
            average.add(name, first, values)
    return average.result()


class _Loops:
    """Stresses at the points of some cells: parameters of `stress_at_points`."""

    def __init__(self, mesh: Mesh, kinematics: str, moduli: Array, material: Materials, displacement: Array) -> None:
        self._mesh, self._axisymmetric = mesh, kinematics == "axisymmetric"
        self._moduli, self._material, self._displacement = moduli, material, displacement

    def room(self, name: str, count: int) -> Array:
        """Return an array for the stresses of `count` cells of an element."""
        return np.empty((count, len(elements.get(name).tables[2]), self._moduli.shape[1]))

    def fill(self, name: str, first: int, out: Array) -> None:
        """Fill `out` (n_cells, n_q, n_components) with the stresses of the cells from `first` on, shared by threads."""
        mesh, cells = self._mesh, self._mesh.cells[name]
        N, dN, _ = elements.get(name).tables

        def part(rows: tuple[int, int]) -> None:
            own = slice(first + rows[0], first + rows[1])
            element_kernels.loops(mesh.dim).stress(
                mesh.points, cells[own], N, dN, self._moduli, self._material[name][own], self._axisymmetric,
                self._displacement, out[slice(*rows)],
            )  # fmt: skip

        parallel.shared(part, parallel.portions(len(out), cells.shape[1]))


class _Average:
    """The plain average, at each node, of the stresses that its cells have there."""

    def __init__(self, mesh: Mesh, components: int) -> None:
        self._mesh, self._total, self._count = mesh, np.zeros((mesh.n_points, components)), np.zeros(mesh.n_points)

    def add(self, name: str, first: int, values: Array) -> None:
        """Add those of the cells from `first` on, given at points (n_cells, n_q, n_components)."""
        cells = self._mesh.cells[name][first : first + len(values)]
        # Good for any dimension and number of components.
        element_2d_kernels.add_nodal(cells, elements.get(name).extrapolation, values, self._total, self._count)

    def result(self) -> Array:
        """Return it (n_points, n_components), once; zero where there is no cell."""
        self._total /= np.maximum(self._count, 1.0)[:, None]
        return self._total


def stress_at_element_nodes(at_points: dict[str, Array]) -> dict[str, Array]:
    """Extrapolate stresses at quadrature points to the nodes of each cell (n_cells, n_nodes, n_components).

    By solid element, as SIEF_ELNO of code_aster: see `Element.extrapolation`.
    """
    return {
        name: np.einsum("aq,cqi->cai", elements.get(name).extrapolation, values) for name, values in at_points.items()
    }


def nodal_average(mesh: Mesh, at_points: dict[str, Array]) -> Array:
    """Return nodal stresses (n_points, n_components): the plain average over the cells at each node.

    As SIEF_NOEU of code_aster. Points without a solid cell get zero.
    """
    average = _Average(mesh, next(iter(at_points.values())).shape[2])
    for name, values in at_points.items():
        average.add(name, 0, values)
    return average.result()


def internal_force(mesh: Mesh, kinematics: str, at_points: dict[str, Array]) -> Array:
    """Return the nodal forces (n_points, dim) that balance the stresses at the quadrature points [force]."""
    loops, force = element_kernels.loops(mesh.dim), np.zeros((mesh.n_points, mesh.dim))
    for name, values in at_points.items():
        N, dN, weights = elements.get(name).tables
        axisymmetric = kinematics == "axisymmetric"
        loops.add_internal_force(mesh.points, mesh.cells[name], N, dN, weights, axisymmetric, values, force)
    return force


def von_mises(stress: Array) -> Array:
    """Return the von Mises stress of components xx, yy, zz, xy[, yz, xz] in the last axis (von Mises, 1913)."""
    xx, yy, zz = stress[..., 0], stress[..., 1], stress[..., 2]
    shear = (stress[..., 3:] ** 2).sum(axis=-1)
    return np.sqrt(0.5 * ((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) + 3.0 * shear)


def von_mises_signed(stress: Array, equivalent: Array | None = None) -> Array:
    """Return the von Mises stress (`equivalent`, where it is known) with the sign of the trace, as VMIS_SG of code_aster."""
    trace = stress[..., 0] + stress[..., 1] + stress[..., 2]
    return np.where(trace < 0, -1.0, 1.0) * (von_mises(stress) if equivalent is None else equivalent)
