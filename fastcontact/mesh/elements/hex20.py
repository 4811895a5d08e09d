"""Twenty-node hexahedron: corners, then mid nodes of the edges below, above, upright; 3 x 3 x 3 integration points."""

from fastcontact.mesh.elements import hex8
from fastcontact.mesh.elements._element import Element, serendipity
from fastcontact.mesh.quadrature import gauss_cube

NODES, shape, gradient = serendipity(hex8)

ELEMENT = Element(
    name="hex20", nodes=NODES, edges=hex8.EDGES,
    facets=(
        (0, 4, 7, 3, 16, 15, 19, 11), (1, 2, 6, 5, 9, 18, 13, 17), (0, 1, 5, 4, 8, 17, 12, 16),
        (3, 7, 6, 2, 19, 14, 18, 10), (0, 3, 2, 1, 11, 10, 9, 8), (4, 5, 6, 7, 12, 13, 14, 15),
    ),
    shape=shape, gradient=gradient, quadrature=gauss_cube(3), meshio="hexahedron20", med="H20", vtk=25, linear="hex8",
    quadratic="hex20", corner_shape=hex8.shape, dilatation=1,
)  # fmt: skip
