"""Two-node line on [-1, 1]."""

import numpy as np

from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_line


def shape(xi: Array) -> Array:
    """Shape functions (m, 2) [-] at `xi` (m, 1) [-]."""
    s = xi[:, 0]
    return np.stack([(1 - s) / 2, (1 + s) / 2], axis=1)


def gradient(xi: Array) -> Array:
    """Derivatives (m, 2, 1) [-] at `xi` (m, 1) [-]."""
    return np.broadcast_to(np.array([[-0.5], [0.5]]), (len(xi), 2, 1)).copy()


ELEMENT = Element(
    name="line2", nodes=np.array([[-1.0], [1.0]]), edges=((0, 1),), facets=((0,), (1,)), shape=shape,
    gradient=gradient, quadrature=gauss_line(2), meshio="line", med="SE2", vtk=3, linear="line2", quadratic="line3",
    corner_shape=shape,
)  # fmt: skip
