"""Twenty-seven-node hexahedron: the twenty of hex20, centres of faces -x +x -y +y -z +z, centre; 3 x 3 x 3 points."""

import numpy as np

from fastcontact.mesh.elements import hex8, hex20, line3, quad9
from fastcontact.mesh.elements._element import Element, product_of_two
from fastcontact.mesh.quadrature import gauss_cube

FACES = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
NODES = np.vstack([hex20.NODES, FACES, np.zeros(3)])
# Node i is the product of the quad9 function I[i] in x, y and the line3 function J[i] in z.
I = np.abs(NODES[:, None, :2] - quad9.NODES).sum(axis=2).argmin(axis=1)  # noqa: E741
J = np.abs(NODES[:, None, 2:] - line3.ELEMENT.nodes).sum(axis=2).argmin(axis=1)
shape, gradient = product_of_two(quad9, line3, I, J)

ELEMENT = Element(
    name="hex27", nodes=NODES, edges=hex8.EDGES,
    facets=tuple((*facet, 20 + i) for i, facet in enumerate(hex20.ELEMENT.facets)), shape=shape, gradient=gradient,
    quadrature=gauss_cube(3), meshio="hexahedron27", med="H27", vtk=29, linear="hex8", quadratic="hex27",
    corner_shape=hex8.shape, dilatation=1,
)  # fmt: skip
