"""Eight-node hexahedron on [-1, 1]^3: the face z = -1 counter-clockwise, then z = 1; 2 x 2 x 2 integration points."""

import numpy as np

from fastcontact.mesh.elements import line2, quad4
from fastcontact.mesh.elements._element import Element, product_of_two
from fastcontact.mesh.quadrature import gauss_cube

NODES = np.column_stack([np.tile(quad4.NODES, (2, 1)), np.repeat([-1.0, 1.0], 4)])
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7))
# Node i is the product of the quad4 function I[i] in x, y and the line2 function J[i] in z.
shape, gradient = product_of_two(quad4, line2, I=np.tile(np.arange(4), 2), J=np.repeat([0, 1], 4))

ELEMENT = Element(
    name="hex8", nodes=NODES, edges=EDGES,
    facets=((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)), shape=shape,
    gradient=gradient, quadrature=gauss_cube(2), meshio="hexahedron", med="HE8", vtk=12, linear="hex8",
    quadratic="hex20", corner_shape=shape, dilatation=0,
)  # fmt: skip
