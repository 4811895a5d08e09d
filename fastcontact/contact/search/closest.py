"""The closest facet to each of many points, in 2D and 3D."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from fastcontact._jit.parallel import portions, shared
from fastcontact.arrays import Array, Indices
from fastcontact.contact.search import search_2d_kernels
from fastcontact.contact.search.box_tree_kernels import build, tree_order
from fastcontact.contact.search.facet_tables import flat_triangles, tables
from fastcontact.errors import ContactError

# Number of consecutive points that need not be sorted for the search.
TOGETHER = 16
# Overhang up to which a point faces the end of a side. Nodes on an axis or in a plane of symmetry lie slightly beyond
# inclined facets, and nodes at the end of one side beyond that of the other if both sides strain differently.
BESIDE = 0.05


class Closest(NamedTuple):
    """Projections of n points on their closest facets.

    Normals point to the right of the direction of a line, and to the side from which the nodes of a face run
    counter-clockwise.
    """

    facet: Indices  # (n,): row of the facet, the first one of several at equal distance
    xi: Array  # (n, dim - 1): reference coordinates of the projection [-]
    normal: Array  # (n, dim): unit normal of the facet there [-]
    overhang: Array  # (n,): distance of the point beyond the end of its facet, in facet lengths; 0 within [-]
    position: Array  # (n, dim): the projection [length]
    distance: Array  # (n,): distance to it [length]


def closest(points: Array, corners: Array) -> Closest:
    """Project `points` (n, dim) [length] on the closest of many facets of one kind, or raise ContactError if that fails.

    `corners` (n_facets, n_nodes, dim) [length] are the nodes of the facets. In 2D they are lines of 2 or 3 nodes, in 3D
    triangles of 3 or 6 nodes and quadrangles of 4, 8 or 9 nodes.
    """
    points, corners = np.ascontiguousarray(points), np.ascontiguousarray(corners)
    n, dim = points.shape
    result = Closest(
        np.empty(n, np.intp), np.empty((n, dim - 1)), np.empty((n, dim)), np.empty(n), np.empty((n, dim)), np.empty(n)
    )
    if dim == 2:
        _on_lines(points, corners, result)
    else:
        _on_faces(points, corners, result)
    wrong = np.flatnonzero(np.isnan(result.distance))
    if len(wrong):
        _refuse(points[wrong], result.facet[wrong], corners)
    return result


def closest_of_kinds(points: Array, kinds: Sequence[Array]) -> Closest:
    """Project points on the closest facet of several arrays of corners, one per kind; facets are numbered through all."""
    if len(kinds) == 1:
        return closest(points, kinds[0])
    first = np.cumsum([0] + [len(corners) for corners in kinds])
    by_kind = [closest(points, corners) for corners in kinds]
    nearest = np.argmin([candidate.distance for candidate in by_kind], axis=0)
    facet, *others = (np.stack(values)[nearest, np.arange(len(points))] for values in zip(*by_kind, strict=True))
    return Closest(facet + first[nearest], *others)


def _on_lines(points: Array, corners: Array, closest: Closest) -> None:
    numbers, order = tree_order(corners[:, 0].copy(), 1), tree_order(points, TOGETHER)
    corners = corners[numbers]
    hull = corners
    if corners.shape[1] == 3:  # a parabola lies in the polygon of its ends and this point (Bezier)
        hull = corners.copy()
        hull[:, 2] = 2.0 * corners[:, 2] - 0.5 * (corners[:, 0] + corners[:, 1])
    tree = build(hull.min(axis=1), hull.max(axis=1))
    shared(
        lambda portion: search_2d_kernels.closest_facets(points, order, *portion, corners, numbers, tree, closest),
        portions(len(points)),
    )


def _on_faces(points: Array, corners: Array, closest: Closest) -> None:
    from fastcontact.contact.search import facets_3d_kernels, search_3d_kernels
    from fastcontact.contact.search.projection_3d_kernels import Domain, Facets

    n, table = len(corners), tables(corners.shape[1])
    numbers, order = tree_order(corners[:, 0].copy(), 1), tree_order(points, TOGETHER)
    centre = 0.5 * (corners.min(axis=0).min(axis=0) + corners.max(axis=0).max(axis=0))
    facets = Facets(corners[numbers], centre, np.empty(corners.shape), np.empty(n), np.empty(n))
    low, high = np.empty((n, 3)), np.empty((n, 3))
    shared(
        lambda portion: facets_3d_kernels.prepare(facets, *portion, table.to_terms, table.weights, low, high),
        portions(n),
    )
    tree, domain = build(low, high), Domain(table.nodes, flat_triangles(len(table.nodes)), table.sides)
    shared(
        lambda portion: search_3d_kernels.closest_facets(
            points, order, *portion, facets, domain, numbers, tree, closest
        ),
        portions(len(points)),
    )


def _refuse(points: Array, facet: Indices, corners: Array) -> None:
    """Raise ContactError for points whose projection failed."""
    if facet[0] < 0:
        raise ContactError(f"{len(points)} projected points are not finite (first: {points[0]}): the solution diverged")
    raise ContactError(
        f"the projection of {len(points)} points did not converge (first: {points[0]} on facet {facet[0]} near "
        f"{corners[facet[0]].mean(axis=0)}): the facet is folded or collapsed, so refine or repair the mesh there"
    )
