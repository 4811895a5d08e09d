"""Triangles with the corners (0, 0), (1, 0), (0, 1).

The corners are followed by the mid-side nodes of the edges 01, 12, 20. Linear elements have one quadrature point, quadratic
elements six, because three points do not suffice at an axis of symmetry.
"""

import numpy as np

from fastcontact.mesh.elements._element import Element, polynomial, quadratic, with_middles
from fastcontact.mesh.quadrature import triangle_1, triangle_6

EDGES = ((0, 1), (1, 2), (2, 0))
NODES, shape, gradient = polynomial(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), lambda i, j: i + j <= 1)

TRI3 = Element(
    "tri3", NODES, EDGES, facets=EDGES, shape=shape, gradient=gradient, quadrature=triangle_1(), meshio="triangle",
    med="TR3", vtk=5, quadratic="tri6",
)  # fmt: skip
TRI6 = quadratic(
    "tri6", TRI3, polynomial(with_middles(TRI3), lambda i, j: i + j <= 2), quadrature=triangle_6(), meshio="triangle6",
    med="TR6", vtk=22, dilatation=0,
)  # fmt: skip
ELEMENTS = TRI3, TRI6
