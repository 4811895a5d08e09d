"""Pyramids with the base [-1, 1]^2 at z = 0 and the apex (0, 0, 1).

The nodes are the corners of the base, the apex, and the mid-side nodes of the edges of the base and of the edges to the apex.
The shape functions are rational (Bedrosian, Int. J. Numer. Meth. Engng 35, 1992). They are polynomials in z, a = x / (1 - z)
and b = y / (1 - z). At the apex, where their gradient depends on the direction, the limit along the axis is used. The conical
product rule of 27 points integrates the gradients of the quadratic element exactly, also on curved cells, so that the patch
test is passed.
"""

import numpy as np

from fastcontact.mesh.elements._element import AnyArray, Element, quadratic, with_midpoints
from fastcontact.mesh.elements.quadrangles import EDGES, QUAD4
from fastcontact.mesh.quadrature import conical_pyramid, pyramid_5

X, Y = QUAD4.nodes.T
# Distance from the apex at which functions at the apex are evaluated, to avoid a division by zero [-].
BELOW_APEX = 1e-18


def collapsed_coordinates(xi: AnyArray) -> tuple[AnyArray, AnyArray, AnyArray]:
    """Return a = x / (1 - z), b = y / (1 - z) and 1 - z, each (m, 1) [-], at `xi` (m, 3) [-]."""
    x, y, t = xi[:, 0:1], xi[:, 1:2], 1 - xi[:, 2:3]
    t = np.where(np.abs(t) < 1e-14, t + BELOW_APEX, t)
    return x / t, y / t, t


def shape(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 5) [-] at `xi` (m, 3) [-]."""
    a, b, t = collapsed_coordinates(xi)
    return np.column_stack([t * (1 + X * a) * (1 + Y * b) / 4, xi[:, 2]])


PYRAMID5 = Element(
    "pyramid5", np.vstack([np.column_stack([QUAD4.nodes, np.zeros(4)]), [[0.0, 0.0, 1.0]]]),
    edges=(*EDGES, (0, 4), (1, 4), (2, 4), (3, 4)), facets=((0, 3, 2, 1), (0, 1, 4), (1, 2, 4), (2, 3, 4), (3, 0, 4)),
    shape=shape, quadrature=pyramid_5(), meshio="pyramid", med="PY5", vtk=14, xdmf=0x7, quadratic="pyramid13", dilatation=0,
)  # fmt: skip
# For each edge of the base, the coordinate that is constant along it, and whether the edge is parallel to x.
SIDES = np.array([-1.0, 1.0, 1.0, -1.0])
ALONG_X = np.array([True, False, True, False])


def shape_13(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 13) [-] at `xi` (m, 3) [-]."""
    (a, b, t), z = collapsed_coordinates(xi), xi[:, 2:3]
    corner = shape(xi)[:, :4] * (xi[:, 0:1] * X + xi[:, 1:2] * Y - 1)
    base = t * t / 2 * np.where(ALONG_X, (1 - a * a) * (1 + SIDES * b), (1 - b * b) * (1 + SIDES * a))
    return np.column_stack([corner, z * (2 * z - 1), base, 4 * z * shape(xi)[:, :4]])


PYRAMID13 = quadratic(
    "pyramid13", PYRAMID5, (with_midpoints(PYRAMID5), shape_13), quadrature=conical_pyramid(3),
    meshio="pyramid13", med="P13", vtk=27, xdmf=0x27, dilatation=0,
)  # fmt: skip
ELEMENTS = PYRAMID13, PYRAMID5
