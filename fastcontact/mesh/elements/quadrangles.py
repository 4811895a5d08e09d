"""Quadrangles on [-1, 1]^2.

The nodes are the corners, counter-clockwise, the mid-side nodes of the edges 01, 12, 23, 30, and the centre. Linear elements
have 2 x 2 quadrature points, quadratic elements 3 x 3.
"""

import numpy as np

from fastcontact.mesh.elements._element import Element, polynomial, quadratic, with_middles
from fastcontact.mesh.quadrature import gauss_square

EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
NODES, shape, gradient = polynomial(CORNERS, lambda i, j: max(i, j) <= 1)

QUAD4 = Element(
    "quad4", NODES, EDGES, facets=EDGES, shape=shape, gradient=gradient, quadrature=gauss_square(2), meshio="quad",
    med="QU4", vtk=9, quadratic="quad8", dilatation=0,
)  # fmt: skip
QUAD8 = quadratic(
    "quad8", QUAD4, polynomial(with_middles(QUAD4), lambda *powers: powers.count(2) <= 1), quadrature=gauss_square(3),
    meshio="quad8", med="QU8", vtk=23, dilatation=1,
)  # fmt: skip
QUAD9 = quadratic(
    "quad9", QUAD4, polynomial(np.vstack([QUAD8.nodes, np.zeros(2)]), lambda *powers: True), quadrature=gauss_square(3),
    meshio="quad9", med="QU9", vtk=28, dilatation=1,
)  # fmt: skip
ELEMENTS = QUAD4, QUAD8, QUAD9
