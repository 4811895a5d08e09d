"""Eight-node quadrangle: corners, then mid nodes of edges 01, 12, 23, 30; 3 x 3 integration points."""

from fastcontact.mesh.elements import quad4
from fastcontact.mesh.elements._element import Element, serendipity
from fastcontact.mesh.quadrature import gauss_square

NODES, shape, gradient = serendipity(quad4)

ELEMENT = Element(
    name="quad8", nodes=NODES, edges=quad4.EDGES, facets=((0, 1, 4), (1, 2, 5), (2, 3, 6), (3, 0, 7)), shape=shape,
    gradient=gradient, quadrature=gauss_square(3), meshio="quad8", med="QU8", vtk=23, linear="quad4",
    quadratic="quad8", corner_shape=quad4.shape, dilatation=1,
)  # fmt: skip
