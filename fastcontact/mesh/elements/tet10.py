"""Ten-node tetrahedron: corners, then mid nodes of edges 01, 12, 20, 03, 13, 23; five integration points."""

from fastcontact.mesh.elements import tet4
from fastcontact.mesh.elements._element import Element, with_mid_nodes
from fastcontact.mesh.quadrature import tetrahedron_5

nodes, shape, gradient = with_mid_nodes(tet4)

ELEMENT = Element(
    name="tet10", nodes=nodes, edges=tet4.ELEMENT.edges,
    facets=((0, 1, 3, 4, 8, 7), (1, 2, 3, 5, 9, 8), (2, 0, 3, 6, 7, 9), (0, 2, 1, 6, 5, 4)), shape=shape,
    gradient=gradient, quadrature=tetrahedron_5(), meshio="tetra10", med="T10", vtk=24, linear="tet4",
    quadratic="tet10", corner_shape=tet4.shape, dilatation=0,
)  # fmt: skip
