"""Six-node wedge: the triangle (0,0) (1,0) (0,1) at z = -1, then at z = 1; six integration points.

The order is that of Gmsh, Abaqus and VTK 9.7; older documentation of VTK numbers the triangles in the opposite direction.
"""

import numpy as np

from fastcontact.mesh.elements import line2, tri3
from fastcontact.mesh.elements._element import Element, product_of_two
from fastcontact.mesh.quadrature import gauss_line, prism, triangle_3_sides

NODES = np.column_stack([np.tile(tri3.ELEMENT.nodes, (2, 1)), np.repeat([-1.0, 1.0], 3)])
EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
# Node i is the product of the tri3 function I[i] in x, y and the line2 function J[i] in z.
I = np.array([0, 1, 2, 0, 1, 2])  # noqa: E741
J = np.array([0, 0, 0, 1, 1, 1])
shape, gradient = product_of_two(tri3, line2, I, J)

ELEMENT = Element(
    name="wedge6", nodes=NODES, edges=EDGES, facets=((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    shape=shape, gradient=gradient, quadrature=prism(triangle_3_sides(), gauss_line(2)), meshio="wedge", med="PE6",
    vtk=13, linear="wedge6", quadratic="wedge15", corner_shape=shape, dilatation=0,
)  # fmt: skip
