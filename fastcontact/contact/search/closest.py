"""The closest facet to each of many points, in two and in three dimensions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from fastcontact._jit.parallel import portions, shared
from fastcontact.contact.search import facets_3d_kernels, packed_tree_kernels, search_2d_kernels, search_3d_kernels
from fastcontact.contact.search.nearest_first_kernels import RUN, queue
from fastcontact.contact.search.projection_3d_kernels import Domain, Facets
from fastcontact.contact.search.search_3d_kernels import Answer
from fastcontact.errors import ContactError

Array = NDArray[np.float64]

# Reference coordinates of the facets in 3D, corners first: triangles of 3 or 6 nodes, quadrangles of 4, 8 or 9.
_TRIANGLE = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.5, 0.0], [0.5, 0.5], [0.0, 0.5]])
_SQUARE = np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1], [0, -1], [1, 0], [0, 1], [-1, 0], [0, 0]])
_TRIANGLE_SIDES = np.array([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [1.0, 1.0, 1.0]])
_SQUARE_SIDES = np.array([[-1.0, 0.0, 1.0], [1.0, 0.0, 1.0], [0.0, -1.0, 1.0], [0.0, 1.0, 1.0]])
# Powers of s and t, in the order of `kernels.projection3d`.
_POWERS = np.array([[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [0, 2], [2, 1], [1, 2], [2, 2]])
# The largest change of the gradient of each power from that at (0, 0), and the largest second derivative (its spectral
# norm), for s and t up to 1.
_TURN = np.sqrt([0, 0, 0, 2, 4, 4, 5, 5, 8])
_SECOND = np.array([0, 0, 0, 1, 2, 2, 1 + 5**0.5, 1 + 5**0.5, 6])
# Flat triangles between the nodes, by number of nodes.
_FLAT = {
    3: [[0, 1, 2]],
    4: [[0, 1, 2], [0, 2, 3]],
    6: [[0, 3, 5], [3, 1, 4], [5, 4, 2], [3, 4, 5]],
    8: [[0, 4, 7], [4, 1, 5], [5, 2, 6], [6, 3, 7], [4, 5, 7], [5, 6, 7]],
    9: [[0, 4, 8], [0, 8, 7], [4, 1, 8], [1, 5, 8], [5, 2, 8], [2, 6, 8], [6, 3, 8], [3, 7, 8]],
}
# Nodal values (end, end, middle) of a parabola to the corners of the polygon that holds it (Bezier).
_PARABOLA = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.5, -0.5, 2.0]])


@dataclass(frozen=True, eq=False)
class Closest:
    """Projections of points on their closest facets.

    Attributes
    ----------
    facet : ndarray of int (n,)
        Row of the facet; of equally close ones the first.
    xi : ndarray (n, dim - 1)
        Reference coordinates of the projection.
    normal : ndarray (n, dim)
        Unit normal of the facet there: to the right of a line's direction, towards the side from which a face's nodes
        run counter-clockwise.
    overhang : ndarray (n,)
        How far a point stands out beyond the end of its facet, in facet lengths; 0 within.
    position : ndarray (n, dim)
        The projection [length].
    distance : ndarray (n,)
        Distance to it [length].
    """

    facet: NDArray[np.intp]
    xi: Array
    normal: Array
    overhang: Array
    position: Array
    distance: Array


def closest(points: Array, corners: Array) -> Closest:
    """Project points on the closest of many facets of one kind.

    Parameters
    ----------
    points : ndarray (n, dim)
        [length].
    corners : ndarray (n_facets, n_nodes, dim)
        Nodes of the facets: lines of 2 or 3 nodes in 2D; triangles of 3 or 6 and quadrangles of 4, 8 or 9 in 3D.

    Raises
    ------
    ContactError
        If a point is not finite, or the projection on a folded or collapsed facet does not converge (3D).
    """
    points, corners = np.ascontiguousarray(points), np.ascontiguousarray(corners)
    return _on_lines(points, corners) if corners.shape[2] == 2 else _on_faces(points, corners)


def closest_of_kinds(points: Array, kinds: Sequence[Array]) -> Closest:
    """Project points on the closest facet of several arrays of corners, one a kind; rows count through all of them."""
    if len(kinds) == 1:
        return closest(points, kinds[0])
    first = np.cumsum([0] + [len(corners) for corners in kinds])
    found = [closest(points, corners) for corners in kinds]
    nearest = np.argmin([one.distance for one in found], axis=0)

    def chosen(name: str) -> NDArray[np.float64]:
        values = np.stack([getattr(one, name) for one in found])
        return values[nearest, np.arange(len(points))]

    facet = chosen("facet").astype(np.intp) + first[nearest]
    return Closest(facet, *(chosen(name) for name in ("xi", "normal", "overhang", "position", "distance")))


def flat_triangles(n_nodes: int) -> NDArray[np.intp]:
    """Return the flat triangles (n, 3) between the nodes of a facet in 3D, normals as those of the facet."""
    return np.array(_FLAT[n_nodes])


def _on_lines(points: Array, corners: Array) -> Closest:
    n, bounds = len(points), facets_3d_kernels.bounds(corners)
    numbers = packed_tree_kernels.curve_order(np.ascontiguousarray(corners[:, 0]), *bounds)
    lines, low, high = np.empty(corners.shape), np.empty((len(corners), 2)), np.empty((len(corners), 2))
    search_2d_kernels.prepare(corners, numbers, lines, low, high)
    tree, order = packed_tree_kernels.pack(low, high), packed_tree_kernels.curve_order(points, *bounds)
    answer = search_2d_kernels.Answer(
        np.empty(n, np.intp), np.empty((n, 1)), np.empty((n, 2)), np.empty(n), np.empty((n, 2)), np.empty(n)
    )
    shared(
        lambda part: search_2d_kernels.closest_facets(points, order, *part, lines, tree, numbers, answer, queue(2)),
        _runs(n),
    )
    if answer.facet.min(initial=0) < 0:
        _refuse(points[answer.facet < 0], answer.facet[answer.facet < 0], corners)
    return Closest(*answer)


def _on_faces(points: Array, corners: Array) -> Closest:
    nodes, sides, to_terms, to_hull, weights = _tables(corners.shape[1])
    n, size = len(points), len(corners)
    bounds = facets_3d_kernels.bounds(corners)
    midst = 0.5 * (bounds[0] + bounds[1])
    numbers = packed_tree_kernels.curve_order(np.ascontiguousarray(corners[:, 0]), *bounds)
    facets = Facets(np.empty(corners.shape), midst, np.empty(size), np.empty(size), numbers, corners)
    low, high = np.empty((size, 3)), np.empty((size, 3))
    shared(
        lambda part: facets_3d_kernels.prepare(facets, *part, to_terms, to_hull, weights, low, high),
        portions(size),
    )
    tree, domain = packed_tree_kernels.pack(low, high), Domain(nodes, flat_triangles(len(nodes)), sides)
    order = packed_tree_kernels.curve_order(points, *bounds)
    answer = Answer(
        np.empty(n, np.intp), np.empty((n, 2)), np.empty((n, 3)), np.empty(n), np.empty((n, 3)), np.empty(n),
        np.empty(n, np.int8),
    )  # fmt: skip
    shared(
        lambda part: search_3d_kernels.closest_facets(points, order, *part, facets, domain, tree, answer, queue(3)),
        _runs(n),
    )
    wrong = np.flatnonzero(answer.status != search_3d_kernels.CONVERGED)
    if len(wrong):
        _refuse(points[wrong], answer.facet[wrong], corners)
    return Closest(*answer[:-1])


def _runs(n: int) -> list[tuple[int, int]]:
    """Return the portions of `n` points, cut between runs: a point's own depends on no thread."""
    return [(begin - begin % RUN, end - end % RUN if end < n else n) for begin, end in portions(n)]


def _refuse(points: Array, facet: NDArray[np.intp], corners: Array) -> None:
    """Raise ContactError for points whose projection failed."""
    if facet[0] < 0:
        raise ContactError(
            f"{len(points)} points to project are not finite (first: {points[0]}): the solution diverged"
        )
    raise ContactError(
        f"the projection of {len(points)} points did not converge (first: {points[0]} on facet {facet[0]} near "
        f"{corners[facet[0]].mean(axis=0)}): the facet is folded or collapsed, so refine or repair the mesh there"
    )


@cache
def _tables(n_nodes: int) -> tuple[Array, Array, Array, Array, Array]:
    """Return the reference nodes and sides of a facet in 3D, matrices from nodes to terms and to a hull, and weights.

    The weights (3, n_nodes) of the terms are those of `kernels.facets3d.prepare`.
    """
    if n_nodes not in _FLAT:
        raise ContactError(f"there are no facets of {n_nodes} nodes in three dimensions: known are {sorted(_FLAT)}")
    triangle = n_nodes in (3, 6)
    nodes = (_TRIANGLE if triangle else _SQUARE)[:n_nodes]
    to_terms = np.asarray(np.linalg.inv(_terms(nodes, n_nodes)), float)
    sides = _TRIANGLE_SIDES if triangle else _SQUARE_SIDES
    weights = np.stack([_bend(nodes), _TURN[:n_nodes], _SECOND[:n_nodes]])
    return nodes, sides, to_terms, _hull(n_nodes, to_terms), weights


def _terms(places: Array, n_nodes: int) -> Array:
    """Return the terms (n, n_nodes) of a facet's polynomial at reference coordinates (n, 2)."""
    return np.prod(places[:, None] ** _POWERS[None, :n_nodes], axis=2)


def _bend(nodes: Array) -> Array:
    """Return, for each term of the polynomial, the largest error of its interpolation on the flat triangles."""
    weights = np.array([[i, j, 20 - i - j] for i in range(21) for j in range(21 - i)]) / 20.0
    error = [
        weights @ _terms(nodes[flat], len(nodes)) - _terms(weights @ nodes[flat], len(nodes))
        for flat in np.array(_FLAT[len(nodes)])
    ]
    return np.abs(error).max(axis=(0, 1))


def _hull(n_nodes: int, to_terms: Array) -> Array:
    """Return the matrix (k, n_nodes) from the nodes of a facet to points whose convex hull holds it.

    Flat and bilinear facets lie in the hull of their corners, the others in that of their Bezier control points.
    """
    if n_nodes <= 4:
        return np.eye(n_nodes)
    if n_nodes == 6:
        hull = np.eye(6)
        for middle, ends in ((3, (0, 1)), (4, (1, 2)), (5, (2, 0))):
            hull[middle, list(ends)], hull[middle, middle] = -0.5, 2.0
        return hull
    # The values at all nine places of the product of two parabolas, then control points in one direction after the other.
    places = np.array([[i, j] for i in (-1.0, 1.0, 0.0) for j in (-1.0, 1.0, 0.0)])
    at_places = _terms(places, n_nodes) @ to_terms
    return np.kron(_PARABOLA, _PARABOLA) @ at_places
