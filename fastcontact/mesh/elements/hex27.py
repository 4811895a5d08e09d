"""Twenty-seven-node hexahedron: the twenty of hex20, centres of faces -x +x -y +y -z +z, centre; 3 x 3 x 3 points."""

import numpy as np

from fastcontact.mesh.elements import hex8, hex20, line3
from fastcontact.mesh.elements._element import Array, Element, product_gradients, product_values
from fastcontact.mesh.quadrature import gauss_cube

FACES = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1]])
NODES = np.vstack([hex20.NODES, FACES, np.zeros(3)])
# The line3 function of each node in each coordinate: 0 at -1, 1 at 1, 2 in the middle.
LINE = np.select([NODES < 0, NODES > 0], [0, 1], 2)


def shape(xi: Array) -> Array:
    """Shape functions (m, 27) [-] at `xi` (m, 3) [-]."""
    return product_values(np.stack([line3.shape(xi[:, [k]])[:, LINE[:, k]] for k in range(3)], axis=2))


def gradient(xi: Array) -> Array:
    """Derivatives (m, 27, 3) [-] at `xi` (m, 3) [-]."""
    factors = np.stack([line3.shape(xi[:, [k]])[:, LINE[:, k]] for k in range(3)], axis=2)
    slopes = np.stack([line3.gradient(xi[:, [k]])[:, LINE[:, k], 0] for k in range(3)], axis=2)
    return product_gradients(factors, slopes)


ELEMENT = Element(
    name="hex27", nodes=NODES, edges=hex8.EDGES,
    facets=tuple((*facet, 20 + i) for i, facet in enumerate(hex20.ELEMENT.facets)), shape=shape, gradient=gradient,
    quadrature=gauss_cube(3), meshio="hexahedron27", med="H27", vtk=29, linear="hex8", quadratic="hex27",
    corner_shape=hex8.shape, dilatation=1,
)  # fmt: skip
