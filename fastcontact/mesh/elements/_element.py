"""The class of reference elements, and the shape functions of families of elements."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Array

Function = Callable[[AnyArray], AnyArray]
# Nodes and shape functions.
Functions = tuple[Array, Function]
# Length of the complex steps of derivatives, a power of two, so that it causes no round-off.
STEP = 2.0**-100

# Element types of facets by the dimension of the cell and the number of nodes of the facet.
_FACETS = {
    (2, 2): "line2", (2, 3): "line3",
    (3, 3): "tri3", (3, 6): "tri6", (3, 4): "quad4", (3, 8): "quad8", (3, 9): "quad9",
}  # fmt: skip


@record
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
        ``shape(xi)`` maps (m, dim) to values (m, n_nodes) [-]. It must be an analytic function, which is also evaluated
        at complex coordinates; see `gradient`.
    quadrature : (ndarray (n_q, dim), ndarray (n_q,))
        Default quadrature points and weights of the stiffness [-].
    meshio, med : str
        Name in meshio, and three-letter code in MED.
    vtk, xdmf : int
        Cell types in VTK and XDMF; XDMF has no fixed type for lines.
    quadratic : str
        Name of the serendipity element with the same corners; for a quadratic element, its own name.
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
    quadrature: tuple[Array, Array]
    meshio: str
    med: str
    vtk: int
    quadratic: str
    dilatation: int | None = None
    corner_element: Element | None = None
    xdmf: int = 0

    def gradient(self, xi: Array) -> Array:
        """Return the derivatives (m, n_nodes, dim) [-] of the shape functions at `xi` (m, dim) [-].

        They are the imaginary parts of the shape functions after a small imaginary step, divided by the step, which are
        exact to round-off (W. Squire and G. Trapp, SIAM Review 40, 1998).
        """
        derivatives = [self.shape(xi + step).imag for step in 1j * STEP * np.eye(self.dim)]
        return np.ascontiguousarray(np.stack(derivatives, axis=2) / STEP)

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
        return np.ascontiguousarray(self.shape(points)), self.gradient(points), np.ascontiguousarray(weights)

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


def quadratic(name: str, linear: Element, functions: Functions, **arguments: Any) -> Element:
    """Return a quadratic element, whose facets are those of the `linear` element with their mid-side and centre nodes.

    The pair `functions` (n_nodes, dim) [-] consists of its nodes and its shape functions, and `arguments` are further
    arguments of `Element`.
    """
    nodes, shape = functions
    facets = []
    for facet in linear.facets:
        corners = nodes[list(facet)]
        midpoints = (corners + np.roll(corners, -1, axis=0)) / 2
        on_facet = [np.flatnonzero((nodes == node).all(axis=1)) for node in (*midpoints, corners.mean(axis=0))]
        facets.append(tuple(dict.fromkeys((*facet, *np.concatenate(on_facet).tolist()))))
    arguments |= {"quadratic": name, "corner_element": linear}
    return Element(name, nodes, linear.edges, tuple(facets), shape, **arguments)


def with_midpoints(linear: Element) -> Array:
    """Return the nodes of a linear element, followed by the midpoints of its edges, as an array (n_nodes, dim) [-]."""
    return np.vstack([linear.nodes, linear.nodes[np.array(linear.edges)].sum(axis=1) / 2])


def serendipity(box: Element) -> Functions:
    """Return nodes (n_nodes, dim) [-] and shape functions of a serendipity square or cube.

    The function of a mid-side node with the coordinates X is the product of 1 - x^2 for the coordinate x along its edge,
    where X is 0, and of (1 + x X) / 2 for the other coordinates. The function of a corner is its linear function times
    ``s - (dim - 1)``, where s is the sum of x X over all coordinates (Zienkiewicz and Taylor).
    """
    nodes, dim = with_midpoints(box), box.dim
    corners, midpoints = np.split(nodes, [box.n_nodes])

    def shape(xi: AnyArray) -> AnyArray:
        corner, x = box.shape(xi) * (xi @ corners.T - (dim - 1)), xi[:, None]
        factors = np.where(midpoints == 0, 1 - x * x, (1 + x * midpoints) / 2)
        return np.column_stack([corner, factors.prod(axis=2)])

    return nodes, shape


def product(nodes: Array, first: Element, second: Element) -> Functions:
    """Return nodes (n_nodes, dim) [-] and shape functions (m, n_nodes) [-] of the product of two elements.

    The function of each of the `nodes` (n_nodes, dim) [-] is the product of two functions: that of the node of the first
    element with the first coordinates, and that of the node of the second element with the other coordinates.
    """
    split = first.dim
    I = np.abs(nodes[:, None, :split] - first.nodes).sum(axis=2).argmin(axis=1)  # noqa: E741
    J = np.abs(nodes[:, None, split:] - second.nodes).sum(axis=2).argmin(axis=1)

    def shape(xi: AnyArray) -> AnyArray:
        return np.asarray(first.shape(xi[:, :split])[:, I] * second.shape(xi[:, split:])[:, J])

    return nodes, shape


def quadratic_simplex(simplex: Element) -> Functions:
    """Return the nodes (n_nodes, dim) [-] and shape functions of the quadratic simplex with mid-side nodes."""
    first, second = np.array(simplex.edges).T

    def shape(xi: AnyArray) -> AnyArray:
        L = simplex.shape(xi)
        return np.column_stack([L * (2 * L - 1), 4 * L[:, first] * L[:, second]])

    return with_midpoints(simplex), shape
