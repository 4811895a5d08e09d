"""Three-node triangle (0,0) (1,0) (0,1); one integration point."""

import numpy as np

from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import triangle_1


def shape(xi: Array) -> Array:
    """Shape functions (m, 3) [-] at `xi` (m, 2) [-]."""
    return np.stack([1 - xi[:, 0] - xi[:, 1], xi[:, 0], xi[:, 1]], axis=1)


def gradient(xi: Array) -> Array:
    """Derivatives (m, 3, 2) [-] at `xi` (m, 2) [-]."""
    return np.broadcast_to(np.array([[-1.0, -1.0], [1.0, 0.0], [0.0, 1.0]]), (len(xi), 3, 2)).copy()


ELEMENT = Element(
    name="tri3", nodes=np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), edges=((0, 1), (1, 2), (2, 0)),
    facets=((0, 1), (1, 2), (2, 0)), shape=shape, gradient=gradient, quadrature=triangle_1(), meshio="triangle",
    med="TR3", vtk=5, linear="tri3", quadratic="tri6", corner_shape=shape,
)  # fmt: skip
