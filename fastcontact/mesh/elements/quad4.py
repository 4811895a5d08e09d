"""Four-node quadrangle on [-1, 1]^2; 2 x 2 integration points."""

import numpy as np

from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_square

NODES = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0))


def shape(xi: Array) -> Array:
    """Shape functions (m, 4) [-] at `xi` (m, 2) [-]."""
    s, t = xi[:, 0:1], xi[:, 1:2]
    return (1 + s * NODES[:, 0]) * (1 + t * NODES[:, 1]) / 4


def gradient(xi: Array) -> Array:
    """Derivatives (m, 4, 2) [-] at `xi` (m, 2) [-]."""
    s, t = xi[:, 0:1], xi[:, 1:2]
    return np.stack([NODES[:, 0] * (1 + t * NODES[:, 1]), NODES[:, 1] * (1 + s * NODES[:, 0])], axis=2) / 4


ELEMENT = Element(
    name="quad4", nodes=NODES, edges=EDGES, facets=EDGES, shape=shape, gradient=gradient, quadrature=gauss_square(2),
    meshio="quad", med="QU4", vtk=9, linear="quad4", quadratic="quad8", corner_shape=shape, dilatation=0,
)  # fmt: skip
