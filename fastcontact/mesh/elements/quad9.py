"""Nine-node quadrangle: the eight of quad8, then the centre; 3 x 3 integration points."""

import numpy as np

from fastcontact.mesh.elements import line3, quad4, quad8
from fastcontact.mesh.elements._element import Element, product_of_two
from fastcontact.mesh.quadrature import gauss_square

NODES = np.vstack([quad8.NODES, np.zeros(2)])
# Node i is the product of the line3 functions I[i] in s and J[i] in t.
I = np.array([0, 1, 1, 0, 2, 1, 2, 0, 2])  # noqa: E741
J = np.array([0, 0, 1, 1, 0, 2, 1, 2, 2])
shape, gradient = product_of_two(line3, line3, I, J)

ELEMENT = Element(
    name="quad9", nodes=NODES, edges=quad4.EDGES, facets=quad8.ELEMENT.facets, shape=shape, gradient=gradient,
    quadrature=gauss_square(3), meshio="quad9", med="QU9", vtk=28, linear="quad4", quadratic="quad9",
    corner_shape=quad4.shape, dilatation=1,
)  # fmt: skip
