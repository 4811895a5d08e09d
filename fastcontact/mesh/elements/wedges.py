"""Wedges between the triangles (0, 0), (1, 0), (0, 1) at z = -1 and z = 1.

The nodes are the corners of the lower and of the upper triangle; the mid-side nodes of the edges of the lower and of the
upper triangle, and of the vertical edges; and the centres of the faces 0143, 1254, 2035. Linear elements have six quadrature
points, quadratic elements 21. The order is that of Gmsh, Abaqus and VTK 9.7; older documentation of VTK numbers the triangles
in the opposite direction.
"""

import numpy as np

from fastcontact.mesh.elements._element import AnyArray, Element, product, quadratic, with_midpoints
from fastcontact.mesh.elements.lines import LINE2, LINE3
from fastcontact.mesh.elements.triangles import TRI3, TRI6
from fastcontact.mesh.quadrature import gauss_line, tensor_product, triangle, triangle_3_midpoints

NODES, shape = product(np.column_stack([np.tile(TRI3.nodes, (2, 1)), np.repeat([-1.0, 1.0], 3)]), TRI3, LINE2)
Z = NODES[:, 2]
TRIANGLE_CORNER = np.tile(np.arange(3), 2)  # number of the triangle corner below or above each of the six corners

WEDGE6 = Element(
    "wedge6", NODES, edges=((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    facets=((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)), shape=shape,
    quadrature=tensor_product(triangle_3_midpoints(), gauss_line(2)), meshio="wedge", med="PE6", vtk=13, xdmf=0x8,
    quadratic="wedge15", dilatation=0,
)  # fmt: skip
# Ends of the edges of the two triangles, and the coordinate z = -1 or 1 of each edge.
A, B = np.array(WEDGE6.edges[:6]).T
SIDE = Z[A]


def shape_15(xi: AnyArray) -> AnyArray:
    """Return the shape functions (m, 15) [-] at `xi` (m, 3) [-]."""
    L, z = TRI3.shape(xi[:, :2])[:, TRIANGLE_CORNER], xi[:, 2:]
    corner = shape(xi) * (2 * L - 2 + z * Z)
    horizontal = 2 * L[:, A] * L[:, B] * (1 + z * SIDE)
    return np.column_stack([corner, horizontal, L[:, :3] * (1 - z * z)])


WEDGE15 = quadratic(
    "wedge15", WEDGE6, (with_midpoints(WEDGE6), shape_15), meshio="wedge15", med="P15", vtk=26, xdmf=0x28, dilatation=0,
    quadrature=tensor_product(triangle(5), gauss_line(3)),
)  # fmt: skip
CENTRES = np.column_stack([TRI6.nodes[3:], np.zeros(3)])
WEDGE18 = quadratic(
    "wedge18", WEDGE6, product(np.vstack([WEDGE15.nodes, CENTRES]), TRI6, LINE3), quadrature=WEDGE15.quadrature,
    meshio="wedge18", med="P18", vtk=32, xdmf=0x29, dilatation=0,
)  # fmt: skip
ELEMENTS = WEDGE15, WEDGE18, WEDGE6
