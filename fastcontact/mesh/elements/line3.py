"""Three-node line on [-1, 1]: ends, then the middle."""

import numpy as np

from fastcontact.mesh.elements import line2
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_line


def shape(xi: Array) -> Array:
    """Shape functions (m, 3) [-] at `xi` (m, 1) [-]."""
    s = xi[:, 0]
    return np.stack([s * (s - 1) / 2, s * (s + 1) / 2, 1 - s * s], axis=1)


def gradient(xi: Array) -> Array:
    """Derivatives (m, 3, 1) [-] at `xi` (m, 1) [-]."""
    s = xi[:, 0]
    return np.stack([s - 0.5, s + 0.5, -2 * s], axis=1)[:, :, None]


ELEMENT = Element(
    name="line3", nodes=np.array([[-1.0], [1.0], [0.0]]), edges=((0, 1),), facets=((0,), (1,)), shape=shape,
    gradient=gradient, quadrature=gauss_line(3), meshio="line3", med="SE3", vtk=21, linear="line2", quadratic="line3",
    corner_shape=line2.shape,
)  # fmt: skip
