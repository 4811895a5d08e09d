"""Wedges between the triangles (0, 0), (1, 0), (0, 1) at z = -1 and z = 1.

The nodes are the corners of the lower and of the upper triangle; the mid-side nodes of the edges of the lower and of the
upper triangle, and of the vertical edges; and the centres of the faces 0143, 1254, 2035. Linear elements have six quadrature
points, quadratic elements 21. The order is that of Gmsh, Abaqus and VTK 9.7; older documentation of VTK numbers the triangles
in the opposite direction.
"""

import numpy as np

from fastcontact.mesh.elements._element import Element, polynomial, quadratic, with_middles
from fastcontact.mesh.elements.triangles import TRI3, TRI6
from fastcontact.mesh.quadrature import gauss_line, prism, triangle_3_sides, triangle_7

CORNERS = np.column_stack([np.tile(TRI3.nodes, (2, 1)), np.repeat([-1.0, 1.0], 3)])
NODES, shape, gradient = polynomial(CORNERS, lambda i, j, k: i + j <= 1 and k <= 1)

WEDGE6 = Element(
    "wedge6", NODES, edges=((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5)),
    facets=((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)), shape=shape, gradient=gradient,
    quadrature=prism(triangle_3_sides(), gauss_line(2)), meshio="wedge", med="PE6", vtk=13, quadratic="wedge15",
    dilatation=0,
)  # fmt: skip
WEDGE15 = quadratic(
    "wedge15", WEDGE6, polynomial(with_middles(WEDGE6), lambda i, j, k: i + j <= 2 and i + j + k <= 3),
    quadrature=prism(triangle_7(), gauss_line(3)), meshio="wedge15", med="P15", vtk=26, dilatation=0,
)  # fmt: skip
CENTRES = np.column_stack([TRI6.nodes[3:], np.zeros(3)])
WEDGE18 = quadratic(
    "wedge18", WEDGE6, polynomial(np.vstack([WEDGE15.nodes, CENTRES]), lambda i, j, k: i + j <= 2),
    quadrature=WEDGE15.quadrature, meshio="wedge18", med="P18", vtk=32, dilatation=0,
)  # fmt: skip
ELEMENTS = WEDGE15, WEDGE18, WEDGE6
