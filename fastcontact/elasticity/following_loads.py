"""Loads that depend on the displacements: pressures and centrifugal forces; their nodal forces and load stiffness."""

from __future__ import annotations

import numpy as np
from scipy.sparse import bsr_array, csr_array

from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity.inertia_loads import Centrifugal
from fastcontact.elasticity.loads import DensityField, Pressure, evaluated
from fastcontact.elasticity.mass import mass
from fastcontact.linear.sparse_rows import Blocks, assembled
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.area_vectors import weighted_area_vectors
from fastcontact.mesh.mesh import Mesh

# Number of quadrature points in each direction of a facet. With this number, a constant pressure on quadratic facets is
# integrated exactly, even in axisymmetry.
POINTS = 4


class FollowerPressure:
    """A pressure that acts along the normals of deformed facets, with values evaluated at the undeformed positions.

    See Bonet and Wood (2008, section 8.5).

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    load : Pressure
    """

    def __init__(self, mesh: Mesh, kinematics: str, load: Pressure) -> None:
        self._mesh, self._axisymmetric = mesh, kinematics == "axisymmetric"
        self._by_element = [self._evaluate(load, name, facets) for name, facets in load.cells(mesh).items()]

    def _evaluate(self, load: Pressure, name: str, facets: Numbers) -> tuple[Numbers, Array, Array, Array]:
        """Return facets (f, n), shape functions (q, n), derivatives (q, n, k), and pressure times weight (f, q)."""
        element = elements.get(name)
        xi, weights = quadrature.product_rule(element.linear, POINTS, POINTS)
        N = element.shape(xi)
        x = np.einsum("qn,fnd->fqd", N, self._mesh.points[facets])
        return facets, N, element.gradient(xi), evaluated(load.value, x, load.name) * weights

    def at(self, displacement: Array) -> tuple[Array, csr_array]:
        """Return the nodal forces (n_points, dim) [force] at `displacement` (n_points, dim) [length] and the load stiffness.

        The load stiffness (n_dofs, n_dofs) is minus the symmetric part of the derivative of the forces [force / length].
        The derivative is symmetric if the pressure is uniform and the facets enclose a volume or end at supports.
        """
        x = self._mesh.points + displacement
        forces, blocks, dim = np.zeros_like(x), list[Blocks](), x.shape[1]
        for facets, N, dN, pressure in self._by_element:
            vectors, K = weighted_area_vectors(x[facets], N, dN, pressure, N, self._axisymmetric)
            np.add.at(forces, facets, -vectors)
            dofs = (facets[:, :, None] * dim + np.arange(dim)).reshape(len(facets), -1)
            blocks.append((dofs, dofs, K.reshape(*dofs.shape, -1)))
        total = assembled(blocks, (x.size, x.size))
        return forces, csr_array(0.5 * (total + total.T))


class FollowerCentrifugal:
    """A centrifugal force that acts along the radii of deformed positions.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    load : Centrifugal
    density : DensityField
        Densities of the solid cells.
    """

    def __init__(self, mesh: Mesh, kinematics: str, load: Centrifugal, density: DensityField) -> None:
        self._undeformed = load.vector(mesh, kinematics, density)
        self._K = mass(mesh, kinematics, density, load.groups)
        self._K.data = -self._K.data @ load.gradient(mesh.dim)

    def at(self, displacement: Array) -> tuple[Array, bsr_array]:
        """Return the nodal forces and the load stiffness (spin softening), see `FollowerPressure.at`."""
        return self._undeformed - (self._K @ displacement.ravel()).reshape(displacement.shape), self._K


FollowerLoad = FollowerPressure | FollowerCentrifugal
