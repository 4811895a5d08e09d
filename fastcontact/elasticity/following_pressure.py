"""Follower pressure: nodal forces and load stiffness (Bonet and Wood, 2008, section 8.5)."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Numbers
from fastcontact.elasticity.loads import Pressure, evaluated, facets_of, outward
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.mesh import Mesh

# Points of the quadrature along each direction of a facet: exact on quadratic facets of a ring.
POINTS = 4


class FollowingPressure:
    """A pressure on deformed facets, given by its values at reference positions.

    Parameters
    ----------
    mesh : Mesh
    kinematics : str
    load : Pressure
    """

    def __init__(self, mesh: Mesh, kinematics: str, load: Pressure) -> None:
        self._mesh, self._turned = mesh, kinematics == "axisymmetric"
        self._parts = [self._part(load, name, block) for name, block in facets_of(mesh, load.group).items()]

    def _part(self, load: Pressure, name: str, block: Numbers) -> tuple[Numbers, Array, Array, Array]:
        """Return facets (f, n), shape values (q, n), derivatives (q, n, k), pressure times weight (f, q)."""
        facets, element = outward(self._mesh, load.group, name, block), elements.get(name)
        xi, weights = quadrature.product_rule(element.linear, POINTS, POINTS)
        N = element.shape(xi)
        places = np.einsum("qn,fnd->fqd", N, self._mesh.points[facets])
        return facets, N, element.gradient(xi), evaluated(load.value, places, load.name) * weights

    def at(self, displacement: Array) -> tuple[Array, csr_array]:
        """Return nodal forces (n_points, dim) [force] at a `displacement` (n_points, dim) [length], and their derivative.

        Of that minus the symmetric part (n_dofs, n_dofs) [force / length], which is all of it where the facets close a
        volume, or end at supports.
        """
        moved = self._mesh.points + displacement
        forces, size = np.zeros_like(moved), moved.size
        total = csr_array((size, size))
        for facets, N, dN, pressure in self._parts:
            along = np.einsum("qnk,fnd->fqdk", dN, moved[facets])
            normal, by_node = _area(along, dN)
            if self._turned:
                circle = 2.0 * np.pi * np.einsum("qn,fn->fq", N, moved[facets][:, :, 0])
                by_node *= circle[..., None, None, None]
                by_node[..., 0] += 2.0 * np.pi * np.einsum("qb,fqi->fqbi", N, normal)
                normal = normal * circle[..., None]
            np.add.at(forces, facets, -np.einsum("fq,qa,fqi->fai", pressure, N, normal))
            K = np.einsum("fq,qa,fqbij->faibj", pressure, N, by_node)
            dofs = (facets[:, :, None] * moved.shape[1] + np.arange(moved.shape[1])).reshape(len(facets), -1)
            rows, columns = np.broadcast_arrays(dofs[:, :, None], dofs[:, None, :])
            total = total + csr_array((K.ravel(), (rows.ravel(), columns.ravel())), shape=(size, size))
        return forces, csr_array(0.5 * (total + total.T))


def _area(along: Array, dN: Array) -> tuple[Array, Array]:
    """Return area vectors (f, q, dim) of tangents (f, q, dim, k), and their derivatives (f, q, n, dim, dim) by the nodes."""
    n_facets, n_q, dim, _ = along.shape
    by_node = np.zeros((n_facets, n_q, dN.shape[1], dim, dim))
    if dim == 2:
        by_node[..., 0, 1], by_node[..., 1, 0] = dN[:, :, 0], -dN[:, :, 0]
        return np.stack([along[..., 1, 0], -along[..., 0, 0]], axis=-1), by_node
    first, second = along[..., 0], along[..., 1]
    for j, unit in enumerate(np.eye(3)):
        turned = (
            np.cross(unit, second)[:, :, None] * dN[:, :, 0, None]
            + np.cross(first, unit)[:, :, None] * dN[:, :, 1, None]
        )
        by_node[..., j] = turned
    return np.cross(first, second), by_node
