"""Ten-node tetrahedron: corners, then mid nodes of edges 01, 12, 20, 03, 13, 23; five integration points."""

import numpy as np

from fastcontact.mesh.elements import tet4
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import tetrahedron_5

FIRST, SECOND = np.array(tet4.EDGES).T
NODES = np.vstack([tet4.NODES, (tet4.NODES[FIRST] + tet4.NODES[SECOND]) / 2])


def shape(xi: Array) -> Array:
    """Shape functions (m, 10) [-] at `xi` (m, 3) [-]."""
    L = tet4.shape(xi)
    return np.column_stack([L * (2 * L - 1), 4 * L[:, FIRST] * L[:, SECOND]])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 10, 3) [-] at `xi` (m, 3) [-]."""
    L, dL = tet4.shape(xi)[:, :, None], tet4.SLOPES
    return np.concatenate([(4 * L - 1) * dL, 4 * (L[:, FIRST] * dL[SECOND] + L[:, SECOND] * dL[FIRST])], axis=1)


ELEMENT = Element(
    name="tet10", nodes=NODES, edges=tet4.EDGES,
    facets=((0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9), (0, 2, 1, 6, 5, 4)), shape=shape,
    gradient=gradient, quadrature=tetrahedron_5(), meshio="tetra10", med="T10", vtk=24, linear="tet4",
    quadratic="tet10", corner_shape=tet4.shape, dilatation=0,
)  # fmt: skip
