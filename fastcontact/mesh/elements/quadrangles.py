"""Quadrangles on [-1, 1]^2.

The nodes are the corners, counter-clockwise, the mid-side nodes of the edges 01, 12, 23, 30, and the centre. Linear elements
have 2 x 2 quadrature points, quadratic elements 3 x 3.
"""

import numpy as np

from fastcontact.mesh.elements._element import Element, product, quadratic, serendipity
from fastcontact.mesh.elements.lines import LINE2, LINE3
from fastcontact.mesh.quadrature import gauss_square

NODES = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
_, shape = product(NODES, LINE2, LINE2)

QUAD4 = Element(
    "quad4", NODES, EDGES, facets=EDGES, shape=shape, quadrature=gauss_square(2), meshio="quad", med="QU4",
    vtk=9, xdmf=0x5, quadratic="quad8", dilatation=0,
)  # fmt: skip
QUAD8 = quadratic(
    "quad8", QUAD4, serendipity(QUAD4), quadrature=gauss_square(3), meshio="quad8", med="QU8", vtk=23, xdmf=0x25,
    dilatation=1,
)  # fmt: skip
QUAD9 = quadratic(
    "quad9", QUAD4, product(np.vstack([QUAD8.nodes, np.zeros(2)]), LINE3, LINE3), quadrature=gauss_square(3),
    meshio="quad9", med="QU9", vtk=28, xdmf=0x23, dilatation=1,
)  # fmt: skip
ELEMENTS = QUAD4, QUAD8, QUAD9
