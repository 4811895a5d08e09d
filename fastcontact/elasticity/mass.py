"""Consistent mass matrix and geometric (initial-stress) stiffness, and assembly of matrices of node pairs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.sparse import bsr_array

from fastcontact.arrays import Array, Indices
from fastcontact.elasticity.energy import cell_volumes, gradients_at, integration_rule
from fastcontact.elasticity.incompatible_modes import VOIGT
from fastcontact.elasticity.loads import DensityField, solid_rows
from fastcontact.elasticity.recovery import CellStress
from fastcontact.elasticity.stiffness import Sparsity, sparsity
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh

# Number of entries of local matrices that are computed at a time. It limits the memory.
ENTRIES_AT_ONCE = 2_000_000


def mass(mesh: Mesh, kinematics: str, density: DensityField, groups: Sequence[str] | None = None) -> bsr_array:
    """Return the consistent mass matrix (n_dofs, n_dofs) [mass] of groups of solid cells, or of all solid cells.

    In axisymmetry, it refers to the full circle. Integrals are exact on straight cells with constant density. Raises
    ModelError if these cells have no density.
    """
    missing, selected = 0, solid_rows(mesh, groups)

    def cell_matrices(name: str, rows: Indices) -> Array:
        nonlocal missing
        element = elements.get(name)
        xi, weights = integration_rule(element)
        N, coordinates = element.shape(xi), mesh.points[mesh.cells[name][rows]]
        rho = density.at(name, rows, N)
        rho[~np.isin(rows, selected.get(name, ()))] = 0.0
        missing += int(np.isnan(rho).any(axis=1).sum())
        volume = cell_volumes(coordinates, N, element.gradient(xi), kinematics == "axisymmetric") * weights
        return np.einsum("cq,qa,qb->cab", rho * volume, N, N, optimize=True)[..., None]

    matrix = _diagonal_blocks(mesh, cell_matrices)
    if missing:
        raise ModelError(
            f"modes need densities, but the materials of {missing} solid cells have none: give them density=..., 0.0 for a "
            "body without mass"
        )
    return matrix


def stress_stiffness(mesh: Mesh, stresses: CellStress, material: Mapping[str, Any], axisymmetric: bool) -> bsr_array:
    """Return the geometric or initial-stress stiffness (n_dofs, n_dofs) [force / length].

    It consists of the integrals of ``grad(N_a) . stress . grad(N_b)`` for every component and, in axisymmetry, of the hoop
    stress terms of the radial components (Bathe, Finite Element Procedures, 2014, section 6.2.3). The quadrature is that of
    the stiffness.

    Parameters
    ----------
    mesh : Mesh
    stresses : CellStress
    material : mapping of str to ndarray of int (n_cells,) or (n_cells, n_q)
        See `stiffness.stiffness`.
    axisymmetric : bool
    """

    def cell_matrices(name: str, rows: Indices) -> Array:
        element, cells = elements.get(name), mesh.cells[name][rows]
        xi, weights = element.quadrature
        N, dN, _ = element.tables
        coordinates = mesh.points[cells]
        stress = stresses.at(name, xi, cells, material[name][rows], rows)
        gradient, _ = gradients_at(coordinates, dN)
        weighted = cell_volumes(coordinates, N, dN, axisymmetric)[..., None] * weights[:, None] * stress
        tensor = weighted[..., VOIGT[mesh.dim]]
        integrals = np.einsum("cqai,cqij,cqbj->cab", gradient, tensor, gradient, optimize=True)
        by_component = np.repeat(integrals[..., None], mesh.dim, axis=3)
        if axisymmetric:
            radius = np.einsum("qa,ca->cq", N, coordinates[:, :, 0])
            by_component[..., 0] += np.einsum("cq,qa,qb->cab", weighted[:, :, 2] / radius**2, N, N, optimize=True)
        return by_component

    return _diagonal_blocks(mesh, cell_matrices)


def _diagonal_blocks(mesh: Mesh, cell_matrices: Callable[[str, Indices], Array]) -> bsr_array:
    """Return the matrix with diagonal nodal blocks, assembled from the diagonals (n_cells, n_nodes, n_nodes, dim or 1)."""
    pattern, diagonals = assembled(mesh, cell_matrices)
    data = np.zeros((len(pattern.indices), mesh.dim, mesh.dim))
    data[:, range(mesh.dim), range(mesh.dim)] = diagonals
    n = mesh.n_points * mesh.dim
    return bsr_array((data, pattern.indices, pattern.indptr), shape=(n, n))


def assembled(mesh: Mesh, cell_matrices: Callable[[str, Indices], Array]) -> tuple[Sparsity, Array]:
    """Return the sparsity of a mesh, and the sums (n_blocks, k) of the matrices of all cells for its blocks.

    The function `cell_matrices` is called with an element type and the numbers (n_cells,) of some cells, and returns the
    matrices of these cells (n_cells, n_nodes, n_nodes, k).
    """
    pattern = sparsity(mesh)
    total = np.zeros((len(pattern.indices), 1))
    for name, rows in cell_portions(mesh):
        blocks, slots = cell_matrices(name, rows), pattern.slots[name][rows].ravel()
        sums = [np.bincount(slots, entries.ravel(), len(total)) for entries in np.moveaxis(blocks, 3, 0)]
        total = total + np.stack(sums, axis=1)
    return pattern, total


def cell_portions(mesh: Mesh) -> Iterator[tuple[str, Indices]]:
    """Yield element types and numbers (n,) of solid cells, in portions that limit the memory."""
    for name, cells in mesh.solids.items():
        n_q = len(integration_rule(elements.get(name))[1])
        size = max(1, ENTRIES_AT_ONCE // (cells.shape[1] * max(n_q, cells.shape[1])))
        for first in range(0, len(cells), size):
            yield name, np.arange(first, min(first + size, len(cells)))
