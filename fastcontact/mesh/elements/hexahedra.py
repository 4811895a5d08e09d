"""Hexahedra on [-1, 1]^3.

The nodes are the corners of the face z = -1, counter-clockwise, and of the face z = 1; the mid-side nodes of the edges of the
lower face, of the upper face, and of the vertical edges; the centres of the faces -x, +x, -y, +y, -z, +z; and the centre.
Linear elements have 2 x 2 x 2 quadrature points, quadratic elements 3 x 3 x 3.
"""

import numpy as np

from fastcontact.mesh.elements._element import Element, product, quadratic, serendipity
from fastcontact.mesh.elements.lines import LINE2, LINE3
from fastcontact.mesh.elements.quadrangles import QUAD4, QUAD9
from fastcontact.mesh.quadrature import gauss_cube

NODES = np.column_stack([np.tile(QUAD4.nodes, (2, 1)), np.repeat([-1.0, 1.0], 4)])
CENTRES = np.array([[-1.0, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1], [0, 0, 0]])
_, shape = product(NODES, QUAD4, LINE2)

HEX8 = Element(
    "hex8", NODES,
    edges=((0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)),
    facets=((0, 4, 7, 3), (1, 2, 6, 5), (0, 1, 5, 4), (3, 7, 6, 2), (0, 3, 2, 1), (4, 5, 6, 7)), shape=shape,
    quadrature=gauss_cube(2), meshio="hexahedron", med="HE8", vtk=12, xdmf=0x9, quadratic="hex20", dilatation=0,
)  # fmt: skip
HEX20 = quadratic(
    "hex20", HEX8, serendipity(HEX8), quadrature=gauss_cube(3), meshio="hexahedron20", med="H20", vtk=25, xdmf=0x30,
    dilatation=1,
)  # fmt: skip
HEX27 = quadratic(
    "hex27", HEX8, product(np.vstack([HEX20.nodes, CENTRES]), QUAD9, LINE3), quadrature=gauss_cube(3),
    meshio="hexahedron27", med="H27", vtk=29, xdmf=0x32, dilatation=1,
)  # fmt: skip
ELEMENTS = HEX20, HEX27, HEX8
