"""Four-node tetrahedron (0,0,0) (1,0,0) (0,1,0) (0,0,1); one integration point."""

import numpy as np

from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import tetrahedron_1

NODES = np.vstack([np.zeros(3), np.eye(3)])
EDGES = ((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3))


def shape(xi: Array) -> Array:
    """Shape functions (m, 4) [-] at `xi` (m, 3) [-]: the barycentric coordinates."""
    return np.column_stack([1 - xi.sum(axis=1), xi])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 4, 3) [-] at `xi` (m, 3) [-]."""
    return np.tile(np.vstack([-np.ones(3), np.eye(3)]), (len(xi), 1, 1))


ELEMENT = Element(
    name="tet4", nodes=NODES, edges=EDGES, facets=((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1)), shape=shape,
    gradient=gradient, quadrature=tetrahedron_1(), meshio="tetra", med="TE4", vtk=10, linear="tet4",
    quadratic="tet10", corner_shape=shape,
)  # fmt: skip
