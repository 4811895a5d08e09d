"""Nine-node quadrangle: the eight of quad8, then the centre; 3 x 3 integration points."""

import numpy as np

from fastcontact.mesh.elements import line3, quad4
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_square

NODES = np.vstack([quad4.NODES, [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, 0.0]]])
# Node i is the product of the line3 functions I[i] in s and J[i] in t.
I = np.array([0, 1, 1, 0, 2, 1, 2, 0, 2])  # noqa: E741
J = np.array([0, 0, 1, 1, 0, 2, 1, 2, 2])


def shape(xi: Array) -> Array:
    """Shape functions, (m, 2) to (m, 9)."""
    return line3.shape(xi[:, :1])[:, I] * line3.shape(xi[:, 1:])[:, J]


def gradient(xi: Array) -> Array:
    """Derivatives, (m, 2) to (m, 9, 2)."""
    s, t = xi[:, :1], xi[:, 1:]
    d_s = line3.gradient(s)[:, I, 0] * line3.shape(t)[:, J]
    d_t = line3.shape(s)[:, I] * line3.gradient(t)[:, J, 0]
    return np.stack([d_s, d_t], axis=2)


ELEMENT = Element(
    name="quad9", dim=2, order=2, nodes=NODES, edges=((0, 1), (1, 2), (2, 3), (3, 0)),
    facets=((0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7)), facet_elements=("line3",) * 4,
    shape=shape, gradient=gradient, quadrature=gauss_square(3), meshio="quad9", med="QU9", vtk=28,
    linear="quad4", quadratic="quad9", corner_shape=quad4.shape,
)  # fmt: skip
