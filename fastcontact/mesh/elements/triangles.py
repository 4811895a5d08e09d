"""Triangles with the corners (0, 0), (1, 0), (0, 1).

The corners are followed by the mid-side nodes of the edges 01, 12, 20. Linear elements have one quadrature point, quadratic
elements six, because three points do not suffice at an axis of symmetry.
"""

import numpy as np

from fastcontact.mesh.elements._element import AnyArray, Element, quadratic, quadratic_simplex
from fastcontact.mesh.quadrature import triangle

EDGES = ((0, 1), (1, 2), (2, 0))


def shape(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 3) [-] at `xi` (m, 2) [-]."""
    return np.stack([1 - xi[:, 0] - xi[:, 1], xi[:, 0], xi[:, 1]], axis=1)


TRI3 = Element(
    "tri3", np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), EDGES, facets=EDGES, shape=shape,
    quadrature=triangle(1), meshio="triangle", med="TR3", vtk=5, xdmf=0x4, quadratic="tri6",
)  # fmt: skip
TRI6 = quadratic(
    "tri6", TRI3, quadratic_simplex(TRI3), quadrature=triangle(4), meshio="triangle6", med="TR6", vtk=22, xdmf=0x24,
    dilatation=0,
)  # fmt: skip
ELEMENTS = TRI3, TRI6
