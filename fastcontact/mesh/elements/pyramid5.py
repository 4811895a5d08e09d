"""Five-node pyramid: the base [-1, 1]^2 at z = 0, then the apex (0, 0, 1); five integration points.

The shape functions are rational (Bedrosian, Int. J. Numer. Meth. Engng 35, 1992): polynomials in z, a = x / (1 - z)
and b = y / (1 - z). At the apex their gradient depends on the direction; there the limit along the axis is used.
"""

import numpy as np

from fastcontact.mesh.elements import quad4
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import pyramid_5

NODES = np.vstack([np.column_stack([quad4.NODES, np.zeros(4)]), [[0.0, 0.0, 1.0]]])
EDGES = ((0, 1), (1, 2), (2, 3), (3, 0), (0, 4), (1, 4), (2, 4), (3, 4))
X, Y = quad4.NODES.T


def collapsed(xi: Array) -> tuple[Array, Array, Array]:
    """Return a = x / (1 - z), b = y / (1 - z) and 1 - z, each (m, 1) [-], at `xi` (m, 3) [-]; a = b = 0 at the apex."""
    x, y, t = xi[:, 0:1], xi[:, 1:2], 1 - xi[:, 2:3]
    apex = np.abs(t) < 1e-14
    below = np.where(apex, 1.0, t)
    return np.where(apex, 0.0, x / below), np.where(apex, 0.0, y / below), t


def shape(xi: Array) -> Array:
    """Shape functions (m, 5) [-] at `xi` (m, 3) [-]."""
    a, b, t = collapsed(xi)
    return np.column_stack([t * (1 + X * a) * (1 + Y * b) / 4, xi[:, 2]])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 5, 3) [-] at `xi` (m, 3) [-]."""
    a, b, _ = collapsed(xi)
    base = np.stack([X * (1 + Y * b), Y * (1 + X * a), X * Y * a * b - 1], axis=2) / 4
    apex = np.tile([0.0, 0.0, 1.0], (len(xi), 1, 1))
    return np.concatenate([base, apex], axis=1)


ELEMENT = Element(
    name="pyramid5", nodes=NODES, edges=EDGES, facets=((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    shape=shape, gradient=gradient, quadrature=pyramid_5(), meshio="pyramid", med="PY5", vtk=14, linear="pyramid5",
    quadratic="pyramid13", corner_shape=shape, dilatation=0,
)  # fmt: skip
