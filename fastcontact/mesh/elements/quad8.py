"""Eight-node quadrangle: corners, then mid nodes of edges 01, 12, 23, 30; 3 x 3 integration points."""

import numpy as np

from fastcontact.mesh.elements import quad4
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_square

NODES = np.vstack([quad4.NODES, [[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]]])


def shape(xi: Array) -> Array:
    """Shape functions (m, 8) [-] at `xi` (m, 2) [-]."""
    s, t = xi[:, 0:1], xi[:, 1:2]
    S, T = NODES[:, 0], NODES[:, 1]
    corner = (1 + s * S[:4]) * (1 + t * T[:4]) * (s * S[:4] + t * T[:4] - 1) / 4
    along_s = (1 - s * s) * (1 + t * T[[4, 6]]) / 2
    along_t = (1 - t * t) * (1 + s * S[[5, 7]]) / 2
    return np.column_stack([corner, along_s[:, 0], along_t[:, 0], along_s[:, 1], along_t[:, 1]])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 8, 2) [-] at `xi` (m, 2) [-]."""
    s, t = xi[:, 0:1], xi[:, 1:2]
    S, T = NODES[:, 0], NODES[:, 1]
    corner_s = S[:4] * (1 + t * T[:4]) * (2 * s * S[:4] + t * T[:4]) / 4
    corner_t = T[:4] * (1 + s * S[:4]) * (2 * t * T[:4] + s * S[:4]) / 4
    bottom_s, right_s, top_s, left_s = -s * (1 - t), (1 - t * t) / 2, -s * (1 + t), -(1 - t * t) / 2
    bottom_t, right_t, top_t, left_t = -(1 - s * s) / 2, -t * (1 + s), (1 - s * s) / 2, -t * (1 - s)
    d_s = np.column_stack([corner_s, bottom_s, right_s, top_s, left_s])
    d_t = np.column_stack([corner_t, bottom_t, right_t, top_t, left_t])
    return np.stack([d_s, d_t], axis=2)


ELEMENT = Element(
    name="quad8", nodes=NODES, edges=quad4.EDGES, facets=((0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7)), shape=shape,
    gradient=gradient, quadrature=gauss_square(3), meshio="quad8", med="QU8", vtk=23, linear="quad4",
    quadratic="quad8", corner_shape=quad4.shape, dilatation=1,
)  # fmt: skip
