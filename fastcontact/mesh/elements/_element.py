"""The class of reference elements, and the shape functions of families of elements."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact.arrays import Array

Function = Callable[[Array], Array]
# Nodes, shape functions and their derivatives.
Functions = tuple[Array, Function, Function]

# Element types of facets by the dimension of the cell and the number of nodes of the facet.
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
        Name in this package, for example ``"tri6"``.
    nodes : ndarray (n_nodes, dim)
        Reference coordinates of the nodes in the order of VTK: the corners, the mid-side nodes in the order of `edges`, and
        the centre nodes of faces and of the cell [-].
    edges : tuple of (int, int)
        Corners at the ends of each edge; in 2D the edges are counter-clockwise.
    facets : tuple of tuple of int
        Local nodes of each boundary facet, oriented so that its normal points outward.
    shape : callable
        ``shape(xi)`` maps (m, dim) to values (m, n_nodes) [-].
    gradient : callable
        ``gradient(xi)`` maps (m, dim) to derivatives (m, n_nodes, dim) [-].
    quadrature : (ndarray (n_q, dim), ndarray (n_q,))
        Default quadrature points and weights of the stiffness [-].
    meshio, med : str
        Name in meshio, and three-letter code in MED.
    vtk : int
        Cell type in VTK.
    quadratic : str
        Name of the serendipity element with the same corners; of a quadratic element its own name.
    dilatation : int, optional
        Degree, 0 or 1, of the polynomial onto which the dilatation of nearly incompressible materials is projected; None if
        gradients are constant, so that no projection is needed.
    corner_element : Element, optional
        The linear element with the same corners; None for a linear element.
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
        """Name of the linear element with the same corners."""
        return (self.corner_element or self).name

    @property
    def corner_shape(self) -> Function:
        """Shape functions of the linear element with the same corners, from (m, dim) to values (m, n_corners) [-]."""
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
        """Name of the element of each facet; empty for lines."""
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
        """Order in which the nodes of a cell describe the same cell with the opposite orientation.

        Two reference coordinates are swapped, or the coordinate of a line changes its sign.
        """
        mirrored = -self.nodes if self.dim == 1 else self.nodes[:, [1, 0, 2][: self.dim]]
        distance = np.abs(mirrored[:, None] - self.nodes[None]).max(axis=2)
        return tuple(distance.argmin(axis=1).tolist())

    @cached_property
    def tables(self) -> tuple[Array, Array, Array]:
        """Shape functions (n_q, n_nodes), derivatives (n_q, n_nodes, dim) and weights (n_q,) at quadrature points [-]."""
        points, weights = self.quadrature
        N, dN = self.shape(points), self.gradient(points)
        return np.ascontiguousarray(N), np.ascontiguousarray(dN), np.ascontiguousarray(weights)

    @cached_property
    def extrapolation(self) -> Array:
        """Matrix (n_nodes, n_q) that extrapolates values at the default quadrature points to the nodes [-].

        The shape functions of the corners are fitted to the values by least squares, exactly if there are as many points as
        corners, and evaluated at all nodes. With fewer points than corners the mean is used. SIEF_ELNO of code_aster is
        computed in the same way.
        """
        points, _ = self.quadrature
        if len(points) < self.n_corners:
            return np.full((self.n_nodes, len(points)), 1.0 / len(points))
        return self.corner_shape(self.nodes) @ np.linalg.pinv(self.corner_shape(points))


def quadratic(name: str, linear: Element, functions: Functions, **others: Any) -> Element:
    """Return a quadratic element, whose facets are those of the `linear` element with their mid-side and centre nodes.

    `functions` (n_nodes, dim) [-] are its nodes, followed by its shape functions and their derivatives, and `others` are
    further arguments of `Element`.
    """
    nodes, shape, gradient = functions
    facets = []
    for facet in linear.facets:
        corners = nodes[list(facet)]
        midpoints = (corners + np.roll(corners, -1, axis=0)) / 2
        on_facet = [np.flatnonzero((nodes == node).all(axis=1)) for node in (*midpoints, corners.mean(axis=0))]
        facets.append(tuple(dict.fromkeys((*facet, *np.concatenate(on_facet).tolist()))))
    others |= {"quadratic": name, "corner_element": linear}
    return Element(name, nodes, linear.edges, tuple(facets), shape, gradient, **others)


def with_middles(linear: Element) -> Array:
    """Return the nodes (n_nodes, dim) of a linear element and the midpoints of its edges [-]."""
    return np.vstack([linear.nodes, linear.nodes[np.array(linear.edges)].sum(axis=1) / 2])


def polynomial(nodes: Array, admits: Callable[..., bool]) -> Functions:
    """Return nodes (n_nodes, dim) [-], shape functions and derivatives of an element whose functions are polynomials.

    They are spanned by the products of powers, up to squares, of the coordinates for whose exponents `admits` is true: one
    product for each of the `nodes` (n_nodes, dim) [-]. Their coefficients are multiples of 1/8.
    """
    axes = range(nodes.shape[1])
    exponents = np.array([powers for powers in itertools.product(range(3), repeat=len(axes)) if admits(*powers)])

    def products(xi: Array, derived: int | None = None) -> Array:
        """Return the products (n_nodes, m), or their derivatives with respect to the coordinate `derived`."""
        powers = np.stack([np.ones_like(xi), xi, xi * xi])
        slopes = np.stack([np.zeros_like(xi), np.ones_like(xi), 2.0 * xi])
        return np.prod([(slopes if k == derived else powers)[exponents[:, k], :, k] for k in axes], axis=0)

    coefficients = np.rint(8.0 * np.linalg.inv(products(nodes))) / 8.0

    def shape(xi: Array, derived: int | None = None) -> Array:
        return np.einsum("ap,pm->ma", coefficients, products(np.asarray(xi, float), derived), order="C")

    def gradient(xi: Array) -> Array:
        return np.stack([shape(xi, k) for k in axes], axis=2)

    return nodes, shape, gradient
