"""Six-node wedge: the triangle (0,0) (1,0) (0,1) at z = -1, then at z = 1; six integration points.

The order is that of Gmsh, Abaqus and VTK 9.7; documents of older VTK count the triangles the other way round.
"""

import numpy as np

from fastcontact.mesh.elements import line2, tri3
from fastcontact.mesh.elements._element import Array, Element
from fastcontact.mesh.quadrature import gauss_line, prism, triangle_3_sides

NODES = np.column_stack([np.tile(tri3.ELEMENT.nodes, (2, 1)), np.repeat([-1.0, 1.0], 3)])
EDGES = ((0, 1), (1, 2), (2, 0), (3, 4), (4, 5), (5, 3), (0, 3), (1, 4), (2, 5))
# Node i is the product of the tri3 function I[i] in x, y and the line2 function J[i] in z.
I = np.array([0, 1, 2, 0, 1, 2])  # noqa: E741
J = np.array([0, 0, 0, 1, 1, 1])


def shape(xi: Array) -> Array:
    """Shape functions, (m, 3) to (m, 6)."""
    return tri3.shape(xi[:, :2])[:, I] * line2.shape(xi[:, 2:])[:, J]


def gradient(xi: Array) -> Array:
    """Derivatives, (m, 3) to (m, 6, 3)."""
    across = tri3.gradient(xi[:, :2])[:, I] * line2.shape(xi[:, 2:])[:, J, None]
    along = tri3.shape(xi[:, :2])[:, I, None] * line2.gradient(xi[:, 2:])[:, J]
    return np.concatenate([across, along], axis=2)


ELEMENT = Element(
    name="wedge6", dim=3, order=1, nodes=NODES, edges=EDGES,
    facets=((0, 2, 1), (3, 4, 5), (0, 1, 4, 3), (1, 2, 5, 4), (2, 0, 3, 5)),
    facet_elements=("tri3", "tri3", "quad4", "quad4", "quad4"),
    shape=shape, gradient=gradient, quadrature=prism(triangle_3_sides(), gauss_line(2)),
    meshio="wedge", med="PE6", vtk=13, linear="wedge6", quadratic="wedge15", corner_shape=shape,
)  # fmt: skip
