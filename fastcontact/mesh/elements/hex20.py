"""Twenty-node hexahedron: corners, then mid nodes of the edges below, above, upright; 3 x 3 x 3 integration points."""

import numpy as np

from fastcontact.mesh.elements import hex8
from fastcontact.mesh.elements._element import Array, Element, product_gradients
from fastcontact.mesh.quadrature import gauss_cube

FIRST, SECOND = np.array(hex8.EDGES).T
MIDDLES = (hex8.NODES[FIRST] + hex8.NODES[SECOND]) / 2
NODES = np.vstack([hex8.NODES, MIDDLES])


def _middle_factors(xi: Array) -> tuple[Array, Array]:
    """Factors and their slopes (m, 12, 3) of the mid nodes: 1 - x^2 along the edge, (1 + x X) / 2 across it."""
    x = xi[:, None]
    factors = np.where(MIDDLES == 0, 1 - x * x, (1 + x * MIDDLES) / 2)
    return factors, np.where(MIDDLES == 0, -2 * x, MIDDLES / 2)


def shape(xi: Array) -> Array:
    """Shape functions (m, 20) [-] at `xi` (m, 3) [-]."""
    corner = hex8.shape(xi) * (xi @ hex8.NODES.T - 2)
    return np.column_stack([corner, _middle_factors(xi)[0].prod(axis=2)])


def gradient(xi: Array) -> Array:
    """Derivatives (m, 20, 3) [-] at `xi` (m, 3) [-]."""
    factor = (xi @ hex8.NODES.T - 2)[:, :, None]
    corner = hex8.gradient(xi) * factor + hex8.shape(xi)[:, :, None] * hex8.NODES
    return np.concatenate([corner, product_gradients(*_middle_factors(xi))], axis=1)


ELEMENT = Element(
    name="hex20", nodes=NODES, edges=hex8.EDGES,
    facets=(
        (0, 4, 7, 3, 16, 15, 19, 11), (1, 2, 6, 5, 9, 18, 13, 17), (0, 1, 5, 4, 8, 17, 12, 16),
        (3, 7, 6, 2, 19, 14, 18, 10), (0, 3, 2, 1, 11, 10, 9, 8), (4, 5, 6, 7, 12, 13, 14, 15),
    ),
    shape=shape, gradient=gradient, quadrature=gauss_cube(3), meshio="hexahedron20", med="H20", vtk=25, linear="hex8",
    quadratic="hex20", corner_shape=hex8.shape, dilatation=1,
)  # fmt: skip
