"""Steady heat conduction in the solid cells: conduction matrix, heat flux, and bodies with undetermined temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Array, Indices, Mask, Numbers
from fastcontact.elasticity.energy import cell_volumes, gradients_at, integration_rule
from fastcontact.elasticity.mass import assembled, cell_portions
from fastcontact.elasticity.materials import Material
from fastcontact.elasticity.varying_constants import positions
from fastcontact.errors import ModelError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh


@record
class Conduction:
    """Solid cells that conduct heat by Fourier's law, in the reference configuration or in a deformed configuration.

    Attributes
    ----------
    mesh : Mesh
        Mesh of the model.
    kinematics : str
        Kinematics of the model. Axisymmetric models are integrated over the full circle, plane models per unit thickness.
    materials : sequence of Material
        Materials of the model.
    number : mapping of str to ndarray of int (n_cells,)
        Material number of each cell, by solid element type.
    displacement : ndarray (n_points, dim), optional
        Displacement of the deformed configuration [length]. Conductivities are evaluated at reference positions.
    """

    mesh: Mesh
    kinematics: str
    materials: Sequence[Material]
    number: Mapping[str, Numbers]
    displacement: Array | None = None

    def check(self) -> None:
        """Raise ModelError if the material of a cell has no conductivity."""
        without_conductivity = np.array([material.conductivity is None for material in self.materials])
        n_cells = sum(int(without_conductivity[numbers].sum()) for numbers in self.number.values())
        if n_cells:
            raise ModelError(
                f"heat conduction is solved, but {n_cells} solid cells have a material without conductivity: define it "
                "with conductivity=..."
            )

    def matrix(self) -> csr_array:
        """Return the conduction matrix (n_points, n_points) [power / temperature]: integrals of ``grad N_a . k . grad N_b``.

        The quadrature is exact for constant conductivities in cells that are affine images of the reference cell.
        """

        def cell_matrices(name: str, rows: Indices) -> Array:
            gradient, k, volume = self._integrands(name, rows)
            return np.einsum("cq,cqai,cqij,cqbj->cab", volume, gradient, k, gradient, optimize=True)[..., None]

        pattern, values = assembled(self.mesh, cell_matrices)
        return csr_array((values[:, 0], pattern.indices, pattern.indptr), shape=(self.mesh.n_points,) * 2)

    def flux(self, temperature: Array) -> Array:
        """Return the mean heat flux (n_solids, dim) [power / area] in cells for a `temperature` (n_points,) [temperature]."""
        flux = []
        for name, rows in cell_portions(self.mesh):
            gradient, k, volume = self._integrands(name, rows)
            temperature_gradient = np.einsum("cqai,ca->cqi", gradient, temperature[self.mesh.cells[name][rows]])
            integral = -np.einsum("cq,cqij,cqj->ci", volume, k, temperature_gradient, optimize=True)
            flux.append(integral / volume.sum(axis=1)[:, None])
        return np.concatenate(flux)

    def _integrands(self, name: str, rows: Indices) -> tuple[Array, Array, Array]:
        """Return the gradients of shape functions, the conductivities and the volumes at the quadrature points of cells.

        Their shapes are (c, q, n, dim) [1 / length], (c, q, dim, dim) [power / (length temperature)] and (c, q) [volume].
        """
        mesh, (xi, weights) = self.mesh, integration_rule(elements.get(name))
        N, dN = elements.get(name).shape(xi), elements.get(name).gradient(xi)
        nodes = mesh.cells[name][rows]
        points = mesh.points if self.displacement is None else mesh.points + self.displacement
        gradient, _ = gradients_at(points[nodes], dN)
        volume = cell_volumes(points[nodes], N, dN, self.kinematics == "axisymmetric") * weights
        k, number = np.zeros((*volume.shape, mesh.dim, mesh.dim)), self.number[name][rows]
        for index in np.unique(number):
            cells = np.flatnonzero(number == index)
            material, x = self.materials[index], positions(mesh, nodes[cells], N)
            k_cells = material.conductivity_at(x, self.kinematics, material.constants_at(name, rows[cells], N))
            k[cells] = k_cells.reshape(len(cells), *k.shape[1:])
        return gradient, k, volume


def undetermined_bodies(body: AnyArray, determined: Mask, connections: AnyArray) -> Indices:
    """Return the numbers (n,) of the bodies whose steady temperature is undetermined, in ascending order.

    These bodies are not connected, directly or through other bodies, to a point with a prescribed temperature or a film.

    Parameters
    ----------
    body : ndarray of int (n_points,)
        Number of the body of each point, or -1 for points without a body.
    determined : ndarray of bool (n_points,)
        Mask of the points with a prescribed temperature or a film.
    connections : ndarray of int (m, 2)
        Pairs of points between which heat flows.
    """
    pairs = body[connections]
    pairs, count = pairs[(pairs >= 0).all(axis=1)], int(body.max()) + 1
    graph = coo_array((np.ones(len(pairs), np.int8), pairs.T), shape=(count, count))
    component = connected_components(graph, directed=False)[1]
    return np.flatnonzero(~np.isin(component, component[np.unique(body[determined & (body >= 0)])]))
