"""Six-node triangle: corners, then mid nodes of edges 01, 12, 20; six points, because three fail at an axis of symmetry."""

from fastcontact.mesh.elements import tri3
from fastcontact.mesh.elements._element import Element, with_mid_nodes
from fastcontact.mesh.quadrature import triangle_6

nodes, shape, gradient = with_mid_nodes(tri3)

ELEMENT = Element(
    name="tri6", nodes=nodes, edges=tri3.ELEMENT.edges, facets=((0, 1, 3), (1, 2, 4), (2, 0, 5)), shape=shape,
    gradient=gradient, quadrature=triangle_6(), meshio="triangle6", med="TR6", vtk=22, linear="tri3", quadratic="tri6",
    corner_shape=tri3.shape, dilatation=0,
)  # fmt: skip
