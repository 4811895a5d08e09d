"""Reference elements with shape functions and default quadrature, and shape functions of families of elements.

Reference coordinates are dimensionless.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact.arrays import Array

Function = Callable[[Array], Array]
# Nodes, shape functions and their derivatives.
Functions = tuple[Array, Function, Function]

# Names of facets by the dimension of the cell and the number of nodes of the facet.
_FACETS = {
    (2, 2): "line2", (2, 3): "line3",
    (3, 3): "tri3", (3, 6): "tri6", (3, 4): "quad4", (3, 8): "quad8", (3, 9): "quad9",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Element:
    """A reference element.

    Parameters
    ----------
    name : str
        Name in this package, e.g. ``"tri6"``.
    nodes : ndarray (n_nodes, dim)
        Reference coordinates [-], in the order of VTK; corners first, then mid nodes in the order of `edges`, then
        centre nodes of faces and of the cell.
    edges : tuple of (int, int)
        Corner pairs, one per edge; in 2D counter-clockwise.
    facets : tuple of tuple of int
        Local nodes of each boundary facet, oriented so that its normal points outward.
    shape : callable
        ``shape(xi)`` maps (m, dim) to values (m, n_nodes) [-].
    gradient : callable
        ``gradient(xi)`` maps (m, dim) to derivatives (m, n_nodes, dim) [-].
    quadrature : (ndarray (n_q, dim), ndarray (n_q,))
        Default points and weights [-] for the stiffness: those of code_aster's element of the same shape.
    meshio, med : str
        The name in meshio and the three-letter MED code.
    vtk : int
        The VTK cell type.
    quadratic : str
        Name of the element on the same corners with mid nodes.
    dilatation : int, optional
        Degree, 0 or 1, up to which the dilatation of nearly incompressible materials has the whole bulk modulus; None
        if the gradients are constant, so that the dilatation cannot be reduced.
    corner_element : Element, optional
        The linear element on the same corners, None if it is linear itself.
    """

    name: str
    nodes: Array
    edges: tuple[tuple[int, int], ...]
    facets: tuple[tuple[int, ...], ...]
    shape: Function
    gradient: Function
    quadrature: tuple[Array, Array]
    meshio: str
    med: str
    vtk: int
    quadratic: str
    dilatation: int | None = None
    corner_element: Element | None = None

    @property
    def linear(self) -> str:
        """Name of the element on the same corners without mid nodes."""
        return (self.corner_element or self).name

    @property
    def corner_shape(self) -> Function:
        """Return the shape functions (m, n_corners) [-] of the linear element on the same corners."""
        return (self.corner_element or self).shape

    @cached_property
    def dim(self) -> int:
        """Dimension of the reference cell: 1 for lines, 2 for faces, 3 for solids."""
        return int(self.nodes.shape[1])

    @cached_property
    def order(self) -> int:
        """Polynomial order: 1 for linear, 2 for quadratic elements."""
        return 1 if self.corner_element is None else 2

    @property
    def facet_elements(self) -> tuple[str, ...]:
        """Name of each facet's element; empty for lines."""
        return tuple(_FACETS[self.dim, len(facet)] for facet in self.facets if self.dim > 1)

    @property
    def n_nodes(self) -> int:
        """Number of nodes."""
        return len(self.nodes)

    @property
    def n_corners(self) -> int:
        """Number of corner nodes."""
        return len((self.corner_element or self).nodes)

    @cached_property
    def reversed(self) -> tuple[int, ...]:
        """Node order of the inverted cell: its mirror image with two reference coordinates swapped.

        Two-dimensional cells keep their first node and run the other way round; lines swap their ends.
        """
        mirrored = -self.nodes if self.dim == 1 else self.nodes[:, [1, 0, 2][: self.dim]]
        distance = np.abs(mirrored[:, None] - self.nodes[None]).max(axis=2)
        return tuple(distance.argmin(axis=1).tolist())

    @cached_property
    def tables(self) -> tuple[Array, Array, Array]:
        """Shape values (n_q, n_nodes), derivatives (n_q, n_nodes, dim), weights (n_q,), at the default points [-]."""
        points, weights = self.quadrature
        return (
            np.ascontiguousarray(self.shape(points)),
            np.ascontiguousarray(self.gradient(points)),
            np.ascontiguousarray(weights),
        )

    @cached_property
    def extrapolation(self) -> Array:
        """Matrix (n_nodes, n_q) [-] from values at the default quadrature points to values at the nodes.

        The polynomial of the corners is fitted to the point values by least squares (exactly if there are as many points
        as corners) and evaluated at all nodes; with fewer points than corners, the mean is used. SIEF_ELNO of code_aster
        is computed in the same way.
        """
        points, _ = self.quadrature
        if len(points) < self.n_corners:
            return np.full((self.n_nodes, len(points)), 1.0 / len(points))
        return self.corner_shape(self.nodes) @ np.linalg.pinv(self.corner_shape(points))


def quadratic(name: str, linear: Element, functions: Functions, **others: Any) -> Element:
    """Return the element with the edges of a linear one, and with its facets extended by mid and centre nodes.

    The `functions` (n_nodes, dim) [-] are its nodes, followed by its shape functions and their derivatives; `others` are
    further arguments of `Element`.
    """
    nodes, shape, gradient = functions
    facets = []
    for facet in linear.facets:
        corners = nodes[list(facet)]
        middles = (corners + np.roll(corners, -1, axis=0)) / 2
        on_facet = [np.flatnonzero((nodes == place).all(axis=1)) for place in (*middles, corners.mean(axis=0))]
        facets.append(tuple(dict.fromkeys((*facet, *np.concatenate(on_facet).tolist()))))
    return Element(
        name, nodes, linear.edges, tuple(facets), shape, gradient, quadratic=name, corner_element=linear, **others
    )


def with_middles(linear: Element) -> Array:
    """Return the nodes (n_nodes, dim) [-] of a linear element, and the middles of its edges."""
    return np.vstack([linear.nodes, linear.nodes[np.array(linear.edges)].sum(axis=1) / 2])


def serendipity(box: Element) -> Functions:
    """Return nodes (n_nodes, dim) [-], shape functions and derivatives of a linear square or cube with mid nodes.

    The function of a mid node at X is a product over the coordinates x, with the factor 1 - x^2 along its edge, where X is 0,
    and (1 + x X) / 2 across the edge. The function of a corner is its linear function times the sum of all x X minus dim - 1
    (Zienkiewicz and Taylor).
    """
    nodes, dim = with_middles(box), box.dim
    corners, middles = np.split(nodes, [box.n_nodes])

    def factors(xi: Array) -> Array:
        x = xi[:, None]
        return np.where(middles == 0, 1 - x * x, (1 + x * middles) / 2)

    def shape(xi: Array) -> Array:
        corner = box.shape(xi) * (xi @ corners.T - (dim - 1))
        return np.column_stack([corner, factors(xi).prod(axis=2)])

    def gradient(xi: Array) -> Array:
        beyond = (xi @ corners.T - (dim - 1))[:, :, None]
        corner = box.gradient(xi) * beyond + box.shape(xi)[:, :, None] * corners
        slopes = np.where(middles == 0, -2 * xi[:, None], middles / 2)
        along = [np.where(np.arange(dim) == k, slopes, factors(xi)).prod(axis=2) for k in range(dim)]
        return np.concatenate([corner, np.stack(along, axis=2)], axis=1)

    return nodes, shape, gradient


def product(nodes: Array, first: Element, second: Element) -> Functions:
    """Return the nodes, shape functions (m, n_nodes) [-] and derivatives (m, n_nodes, dim) [-] of a product of two elements.

    The function of each of the `nodes` (n_nodes, dim) [-] is a function of the first element in the first coordinates times
    a function of the second element in the other coordinates, namely those of the nodes with these coordinates.
    """
    split = first.dim
    I = np.abs(nodes[:, None, :split] - first.nodes).sum(axis=2).argmin(axis=1)  # noqa: E741
    J = np.abs(nodes[:, None, split:] - second.nodes).sum(axis=2).argmin(axis=1)

    def shape(xi: Array) -> Array:
        return np.asarray(first.shape(xi[:, :split])[:, I] * second.shape(xi[:, split:])[:, J])

    def gradient(xi: Array) -> Array:
        x, y = xi[:, :split], xi[:, split:]
        along_first = first.gradient(x)[:, I] * second.shape(y)[:, J, None]
        along_second = first.shape(x)[:, I, None] * second.gradient(y)[:, J]
        return np.concatenate([along_first, along_second], axis=2)

    return nodes, shape, gradient


def with_mid_nodes(simplex: Element) -> Functions:
    """Return nodes (n_nodes, dim) [-], shape functions and derivatives of a linear simplex with mid nodes on its edges."""
    first, second = np.array(simplex.edges).T

    def shape(xi: Array) -> Array:
        L = simplex.shape(xi)
        return np.column_stack([L * (2 * L - 1), 4 * L[:, first] * L[:, second]])

    def gradient(xi: Array) -> Array:
        L, dL = simplex.shape(xi)[:, :, None], simplex.gradient(xi)
        along_edges = 4 * (L[:, first] * dL[:, second] + L[:, second] * dL[:, first])
        return np.concatenate([(4 * L - 1) * dL, along_edges], axis=1)

    return with_middles(simplex), shape, gradient
