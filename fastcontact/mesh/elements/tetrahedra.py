"""Tetrahedra with the corners (0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1).

The corners are followed by the mid-side nodes of the edges 01, 12, 20, 03, 13, 23. Linear elements have one quadrature point,
quadratic elements five.
"""

import numpy as np

from fastcontact.mesh.elements._element import AnyArray, Element, quadratic, quadratic_simplex
from fastcontact.mesh.quadrature import tetrahedron_1, tetrahedron_5


def shape(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 4) [-] at `xi` (m, 3) [-], which are the barycentric coordinates."""
    return np.column_stack([1 - xi.sum(axis=1), xi])


TET4 = Element(
    "tet4", np.vstack([np.zeros(3), np.eye(3)]), edges=((0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)),
    facets=((0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1)), shape=shape, quadrature=tetrahedron_1(),
    meshio="tetra", med="TE4", vtk=10, xdmf=0x6, quadratic="tet10",
)  # fmt: skip
TET10 = quadratic(
    "tet10", TET4, quadratic_simplex(TET4), quadrature=tetrahedron_5(), meshio="tetra10", med="T10", vtk=24, xdmf=0x26,
    dilatation=0,
)  # fmt: skip
ELEMENTS = TET10, TET4
