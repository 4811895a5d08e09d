"""Four-node quadrangle on [-1, 1]^2; 2 x 2 integration points."""

import numpy as np

from fastcontact.mesh.elements import line2
from fastcontact.mesh.elements._element import Element, product_of_two
from fastcontact.mesh.quadrature import gauss_square

NODES = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))
# Node i is the product of the line2 functions I[i] in s and J[i] in t.
shape, gradient = product_of_two(line2, line2, I=np.array([0, 1, 1, 0]), J=np.array([0, 0, 1, 1]))

ELEMENT = Element(
    name="quad4", nodes=NODES, edges=EDGES, facets=EDGES, shape=shape, gradient=gradient, quadrature=gauss_square(2),
    meshio="quad", med="QU4", vtk=9, linear="quad4", quadratic="quad8", corner_shape=shape, dilatation=0,
)  # fmt: skip
