"""Stresses from displacements: at quadrature points, at element nodes, averaged at nodes; equivalent stresses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fastcontact import elements, parallel
from fastcontact.kernels import solid, solid2d
from fastcontact.mesh import Mesh

Array = NDArray[np.float64]
Materials = dict[str, NDArray[np.int32]]


def stress_at_points(
    mesh: Mesh, kinematics: str, moduli: Array, material: Materials, displacement: Array
) -> dict[str, Array]:
    """Return the stress (n_cells, n_q, 4), in 3D (n_cells, n_q, 6), at the default quadrature points [pressure].

    By solid element. Components xx, yy, zz, xy (then yz, xz in 3D); axisymmetric: rr, yy, hoop, ry. Arguments as in
    `assembly.stiffness`, with the displacement (n_points, dim) [length].
    """
    loops, values = solid.loops(mesh.dim), {}
    for name, block in mesh.solids.items():
        N, dN, weights = elements.get(name).tables
        out = np.empty((len(block), len(weights), moduli.shape[1]))

        def fill(rows: tuple[int, int], name: str = name, N: Array = N, dN: Array = dN, out: Array = out) -> None:
            part = slice(*rows)
            loops.stress(
                mesh.points, mesh.cells[name][part], N, dN, moduli, material[name][part], kinematics == "axisymmetric",
                displacement, out[part],
            )  # fmt: skip

        parallel.shared(fill, parallel.portions(*block.shape))
        values[name] = out
    return values


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
    components = next(iter(at_points.values())).shape[2]
    total, count = np.zeros((mesh.n_points, components)), np.zeros(mesh.n_points)
    for name, values in at_points.items():
        # Good for any dimension and number of components.
        solid2d.add_nodal(mesh.cells[name], elements.get(name).extrapolation, values, total, count)
    return total / np.maximum(count, 1.0)[:, None]


def internal_force(mesh: Mesh, kinematics: str, at_points: dict[str, Array]) -> Array:
    """Return the nodal forces (n_points, dim) that balance the stresses at the quadrature points [force]."""
    loops, force = solid.loops(mesh.dim), np.zeros((mesh.n_points, mesh.dim))
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
