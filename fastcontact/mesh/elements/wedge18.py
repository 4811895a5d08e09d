"""Eighteen-node wedge: the fifteen of wedge15, then centres of the faces 0143, 1254, 2035; 21 integration points."""

import numpy as np

from fastcontact.mesh.elements import line3, tri6, wedge6, wedge15
from fastcontact.mesh.elements._element import Element, product_of_two
from fastcontact.mesh.quadrature import gauss_line, prism, triangle_7

NODES = np.vstack([wedge15.NODES, np.column_stack([tri6.ELEMENT.nodes[3:], np.zeros(3)])])
# Node i is the product of the tri6 function I[i] in x, y and the line3 function J[i] in z.
I = np.array([0, 1, 2, 0, 1, 2, 3, 4, 5, 3, 4, 5, 0, 1, 2, 3, 4, 5])  # noqa: E741
J = np.array([0, 0, 0, 1, 1, 1, 0, 0, 0, 1, 1, 1, 2, 2, 2, 2, 2, 2])
shape, gradient = product_of_two(tri6, line3, I, J)

ELEMENT = Element(
    name="wedge18", nodes=NODES, edges=wedge6.EDGES,
    facets=(*wedge15.FACETS[:2], *((*facet, 15 + i) for i, facet in enumerate(wedge15.FACETS[2:]))), shape=shape,
    gradient=gradient, quadrature=prism(triangle_7(), gauss_line(3)), meshio="wedge18", med="P18", vtk=32,
    linear="wedge6", quadratic="wedge18", corner_shape=wedge6.shape, dilatation=0,
)  # fmt: skip
