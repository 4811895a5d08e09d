"""Fifteen-node wedge: corners, then mid nodes of the edges below, above, upright; 21 integration points."""

import numpy as np

from fastcontact.mesh.elements import tri3, wedge6
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_line, prism, triangle_7

FIRST, SECOND = np.array(wedge6.EDGES).T
NODES = np.vstack([wedge6.NODES, (wedge6.NODES[FIRST] + wedge6.NODES[SECOND]) / 2])
FACETS = (
    (0, 2, 1, 8, 7, 6), (3, 4, 5, 9, 10, 11),
    (0, 1, 4, 3, 6, 13, 9, 12), (1, 2, 5, 4, 7, 14, 10, 13), (2, 0, 3, 5, 8, 12, 11, 14),
)  # fmt: skip
# Ends of the edges of the two triangles, and the side z = -1 or 1 of each.
A, B, SIDE = FIRST[:6], SECOND[:6], wedge6.NODES[FIRST[:6], 2]


def shape(xi: Array) -> Array:
    """Shape functions (m, 15) [-] at `xi` (m, 3) [-]."""
    L, z = tri3.shape(xi[:, :2])[:, wedge6.I], xi[:, 2:]
    corner = wedge6.shape(xi) * (2 * L - 2 + z * wedge6.NODES[:, 2])
    flat = 2 * L[:, A] * L[:, B] * (1 + z * SIDE)
    return np.column_stack([corner, flat, L[:, :3] * (1 - z * z)])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 15, 3) [-] at `xi` (m, 3) [-]."""
    L, z = tri3.shape(xi[:, :2])[:, wedge6.I], xi[:, 2:]
    dL, Z = tri3.gradient(xi[:, :2])[:, wedge6.I], wedge6.NODES[:, 2]
    slope = np.concatenate([2 * dL, np.broadcast_to(Z[:, None], (*L.shape, 1))], axis=2)
    corner = wedge6.gradient(xi) * (2 * L - 2 + z * Z)[:, :, None] + wedge6.shape(xi)[:, :, None] * slope
    across = 2 * (dL[:, A] * L[:, B, None] + L[:, A, None] * dL[:, B]) * (1 + z * SIDE)[:, :, None]
    flat = np.concatenate([across, (2 * L[:, A] * L[:, B] * SIDE)[:, :, None]], axis=2)
    upright = np.concatenate([dL[:, :3] * (1 - z * z)[:, :, None], (-2 * z * L[:, :3])[:, :, None]], axis=2)
    return np.concatenate([corner, flat, upright], axis=1)


ELEMENT = Element(
    name="wedge15", nodes=NODES, edges=wedge6.EDGES, facets=FACETS, shape=shape, gradient=gradient,
    quadrature=prism(triangle_7(), gauss_line(3)), meshio="wedge15", med="P15", vtk=26, linear="wedge6",
    quadratic="wedge15", corner_shape=wedge6.shape, dilatation=0,
)  # fmt: skip
