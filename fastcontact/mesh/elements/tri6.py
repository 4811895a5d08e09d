"""Six-node triangle: corners, then mid nodes of edges 01, 12, 20; six points, since three fail at the axis of a ring."""

import numpy as np

from fastcontact.mesh.elements import tri3
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import triangle_6


def shape(xi: Array) -> Array:
    """Shape functions (m, 6) [-] at `xi` (m, 2) [-]."""
    b, c = xi[:, 0], xi[:, 1]
    a = 1 - b - c
    return np.stack([a * (2 * a - 1), b * (2 * b - 1), c * (2 * c - 1), 4 * a * b, 4 * b * c, 4 * c * a], axis=1)


def gradient(xi: Array) -> Array:
    """Derivatives (m, 6, 2) [-] at `xi` (m, 2) [-]."""
    b, c = xi[:, 0], xi[:, 1]
    a = 1 - b - c
    zero = np.zeros_like(a)
    d_b = [1 - 4 * a, 4 * b - 1, zero, 4 * (a - b), 4 * c, -4 * c]
    d_c = [1 - 4 * a, zero, 4 * c - 1, -4 * b, 4 * b, 4 * (a - c)]
    return np.stack([np.stack(d_b, axis=1), np.stack(d_c, axis=1)], axis=2)


ELEMENT = Element(
    name="tri6", nodes=np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]]),
    edges=((0, 1), (1, 2), (2, 0)), facets=((0, 1, 3), (1, 2, 4), (2, 0, 5)), shape=shape, gradient=gradient,
    quadrature=triangle_6(), meshio="triangle6", med="TR6", vtk=22, linear="tri3", quadratic="tri6",
    corner_shape=tri3.shape, dilatation=0,
)  # fmt: skip
