"""Projection of points onto surfaces: to the closest point (`closest`), and along averaged normals.

On a faceted surface the closest point jumps at concave edges, by a distance that is proportional to the gap. Repeated
pairing may then not converge. Along normals that are interpolated between averaged nodal normals, the projection varies
continuously (Puso and Laursen, 2004, section 3; Popp, Gitterle, Gee and Wall, 2010, section 4.2). `along_normals` projects
onto facets in 3D, and `along_line_normals` onto lines in 2D.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array

from fastcontact._jit.parallel import parallel_map, portions
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, Numbers, largest
from fastcontact.contact.search import search_2d_kernels
from fastcontact.contact.search.box_tree_kernels import build, tree_order
from fastcontact.contact.search.facet_tables import tables
from fastcontact.contact.surface import Surface, by_block, padded
from fastcontact.errors import ContactError
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors, unit_vectors
from fastcontact.mesh.flat_pieces import flat_triangles
from fastcontact.round_off import DIFFERENCE_STEP, LENGTH_ROUND_OFF, SINGLE_PRECISION

# Adjacent facets whose normals enclose a smaller angle [degrees] approximate a smooth surface; others form a corner. The
# value differs from the exterior angles of all regular polygons, so that round-off has no influence on their normals.
CORNER = 48.0
# Points are sorted in space before a search, down to groups of at most this size, within which their order is arbitrary.
POINTS_PER_LEAF = 16
# Overhang up to which a point faces the end of a side [facet lengths]. Nodes on an axis or in a plane of symmetry lie
# slightly beyond inclined facets. Nodes at the end of one side lie beyond the end of the other if both sides strain
# differently.
SMALL_OVERHANG = 0.05


@record
class FacetPoints:
    """Points of a surface, given by their facets and reference coordinates.

    k is the largest number of nodes of a facet.

    Attributes
    ----------
    nodes, local : ndarray of int (n, k)
        Nodes of the facet of each point, as point numbers and as positions in ``Surface.points``. If a facet has fewer than
        k nodes, the last one is repeated.
    shape : ndarray (n, k)
        Shape functions of the nodes, zero for repeated nodes [-].
    gradient : ndarray (n, k, dim - 1)
        Their derivatives with respect to the reference coordinates [-].
    """

    nodes: Numbers
    local: Indices
    shape: Array
    gradient: Array


def facet_points(side: Surface, facet: Indices, xi: Array) -> FacetPoints:
    """Return the points of `side` at the reference coordinates `xi` (n, dim - 1) in the facets numbered `facet` (n,)."""
    nodes = side.all_facets[facet]
    shape, gradient = np.zeros(nodes.shape), np.zeros((*nodes.shape, xi.shape[1]))
    for block, first in zip(side.blocks, side.offsets):
        element, n = elements.get(block.element), block.facets.shape[1]
        rows = np.flatnonzero((facet >= first) & (facet < first + len(block.facets)))
        shape[rows, :n], gradient[rows, :n] = element.shape(xi[rows]), element.gradient(xi[rows])
    return FacetPoints(nodes, side.all_local[facet], shape, gradient)


def facets_containing(side: Surface, facet: Indices, xi: Array) -> tuple[Indices, Indices, Array]:
    """Return all facets that contain given points of a side. Points on an edge or at a corner lie on several facets.

    A projection finds only one of these facets, depending on round-off.

    Parameters
    ----------
    side : Surface
    facet : ndarray of int (n,)
        One facet of each point.
    xi : ndarray (n, dim - 1)
        Reference coordinates of each point in this facet [-].

    Returns
    -------
    point, facet : ndarray of int (p,)
        Numbers of the points and of the facets. Points are in ascending order, and each occurs at least once.
    xi : ndarray (p, dim - 1)
        Reference coordinates of the point in the facet [-].
    """
    points = facet_points(side, facet, xi)
    row, k = np.nonzero(np.abs(points.shape) > LENGTH_ROUND_OFF)
    nodes_of_points = csr_array((np.ones(len(row)), (row, points.local[row, k])), shape=(len(facet), len(side.points)))
    common = coo_array(nodes_of_points @ side.incidence.T)
    contains_all = common.data == np.diff(nodes_of_points.indptr)[common.row]
    point, common_facet = common.row[contains_all].astype(np.intp), common.col[contains_all].astype(np.intp)
    coordinates = np.empty((len(point), xi.shape[1]))
    for block, (rows, number) in zip(side.blocks, by_block(common_facet, side.sizes), strict=True):
        same = block.local[number][:, :, None] == points.local[point[rows]][:, None]
        coordinates[rows] = np.einsum("pkj,pj->pk", same, points.shape[point[rows]]) @ elements.get(block.element).nodes
    return point, common_facet, coordinates


@record
class DeformedSide:
    """A side of a contact pair in one configuration. Its normals are computed when they are first used.

    Attributes
    ----------
    surface : Surface
    coordinates : ndarray (n_points, dim)
        Coordinates of all points of the mesh [length].
    corner : float
        Angle between the normals of two facets beyond which they form a corner [degrees].
    """

    surface: Surface
    coordinates: Array
    corner: float = CORNER

    @cached_property
    def facet_normals(self) -> Array:
        """Unit normals (n_facets, k, dim) of all facets at the nodes `Surface.all_facets`, zero at repeated nodes."""
        normals = []
        for block in self.surface.blocks:
            nodes, slopes = self.coordinates[block.facets], block.slopes_at_nodes
            if nodes.shape[2] == 3:
                normals.append(_face_normals(nodes, slopes))
            else:
                normals.append(unit_vectors(area_vectors(nodes, slopes)))
        return padded(normals)

    @cached_property
    def _weights(self) -> Array:
        """Interior angles (n_facets, k) of faces at corners [radian]; 1 at other nodes and on lines, 0 at repeated nodes."""
        if self.coordinates.shape[1] == 2:
            return self.surface.node_weights
        from fastcontact.contact import projection_kernels

        weights = []
        for block in self.surface.blocks:
            n = elements.get(block.element).n_corners
            weights.append(np.empty(block.facets.shape))
            projection_kernels.angles(self.coordinates[block.facets], n, weights[-1])
        return padded(weights)

    @cached_property
    def nodal_normals(self) -> Array:
        """Averaged unit normals (m, dim) of the nodes of the side.

        The normal of a node is the mean of the unit normals of its facets, weighted by their angles at the node. With these
        weights it does not depend on how the surface is divided into facets (Thuermer and Wuethrich, 1998).
        """
        node, dim = self.surface.all_local.ravel(), self.coordinates.shape[1]
        total = np.empty((len(self.surface.points), dim))
        for axis, component in enumerate((self._weights[..., None] * self.facet_normals).reshape(-1, dim).T):
            total[:, axis] = np.bincount(node, component, len(total))
        self.surface.add_across_ends(total)
        return unit_vectors(total)

    def variation(self, du: Array) -> Array:
        """Return the variation (m, dim) of `nodal_normals`, computed by central differences [-].

        `du` (n_points, dim) is the variation of the displacements [length].
        """
        nodes, coordinates = self.surface.points, self.coordinates
        step = DIFFERENCE_STEP * float(np.ptp(coordinates[nodes], axis=0).max()) / np.sqrt(self.surface.n_facets)
        rate = (largest(du[nodes]) or 1.0) / step
        ahead = DeformedSide(self.surface, coordinates + 0.5 / rate * du).nodal_normals
        behind = DeformedSide(self.surface, coordinates - 0.5 / rate * du).nodal_normals
        return np.asarray(rate * (ahead - behind))

    @cached_property
    def smooth_normals(self) -> Array:
        """Averaged unit normals (n_facets, k, dim) at the nodes of all facets, separately on both sides of corners.

        Except at corners, they are those of `nodal_normals`. At a corner, the mean for a facet includes only those facets
        that continue it smoothly, so that a punch is flat up to its corner although its flanks belong to the surface. Nodes
        are those of `Surface.all_facets`.
        """
        shape, node = self.facet_normals.shape, self.surface.all_local.ravel()
        smooth, normal = self.nodal_normals[node], self.facet_normals.reshape(-1, shape[2])
        weight = self._weights.ravel()
        # A node lies on a corner if the normal of one of its facets deviates from the mean by more than half of the angle.
        entries = np.flatnonzero(self.surface.node_weights)  # without repeated nodes
        deviates = np.einsum("pd,pd->p", normal[entries], smooth[entries]) < np.cos(np.radians(0.5 * self.corner))
        if not deviates.any():
            return smooth.reshape(shape)
        nodes_at_corners = np.unique(node[entries[deviates]])
        by_node = entries[np.argsort(node[entries], kind="stable")]
        start = np.append(0, np.cumsum(np.bincount(node[entries])))
        for node_at_corner in nodes_at_corners:
            at_node = by_node[start[node_at_corner] : start[node_at_corner + 1]]
            is_smooth = normal[at_node] @ normal[at_node].T >= np.cos(np.radians(self.corner)) - LENGTH_ROUND_OFF
            total = (is_smooth * weight[at_node]) @ normal[at_node]
            smooth[at_node] = unit_vectors(total)
        return smooth.reshape(shape)


def _face_normals(nodes: Array, slopes: Array) -> Array:
    """Return unit normals (n, k, 3) of faces with `nodes` (n, k, 3); `slopes` are `FacetBlock.slopes_at_nodes`."""
    from fastcontact.contact import projection_kernels

    out = np.empty(nodes.shape)
    parallel_map(lambda span: projection_kernels.normals(nodes, slopes, *span, out), portions(*nodes.shape[:2]))
    return out


def interpolate(normals: Array, points: FacetPoints) -> Array:
    """Return unit normals (n, dim) at points, interpolated between the normals (n, k, dim) at the nodes of their facets."""
    return unit_vectors(np.einsum("nk,nkd->nd", points.shape, normals))


def distance_from_edges(side: Surface, facet: Indices, xi: Array) -> Array:
    """Return the distances (n,) of points from the edges of their facets, as fractions of the size of the facet [-]."""
    on_triangle = np.column_stack([xi, 1.0 - xi.sum(axis=1)]).min(axis=1)
    return np.where(side.triangular[facet], on_triangle, 0.5 * (1.0 - np.abs(xi).max(axis=1)))


class Closest(NamedTuple):
    """Projections of n points on their closest facets.

    The normal of a line points to its right. Seen from the tip of the normal of a face, the nodes of the face are in
    counter-clockwise order.
    """

    facet: Indices  # (n,): number of the facet, the lowest if several facets are equally close
    xi: Array  # (n, dim - 1): reference coordinates of the projection [-]
    normal: Array  # (n, dim): unit normal of the facet there [-]
    overhang: Array  # (n,): distance of the point beyond the end of its facet, in facet lengths; 0 inside [-]
    position: Array  # (n, dim): position of the projection [length]
    distance: Array  # (n,): distance of the point from its projection [length]


def closest(points: Array, nodes: Array) -> Closest:
    """Project `points` (n, dim) [length] onto the closest of many facets of one element type.

    `nodes` (n_facets, n_nodes, dim) [length] are the positions of the nodes of the facets. These are lines of 2 or 3 nodes in
    2D, and triangles of 3 or 6 nodes or quadrangles of 4, 8 or 9 nodes in 3D. Raises ContactError if the projection of a
    point fails.
    """
    points, nodes = np.ascontiguousarray(points), np.ascontiguousarray(nodes)
    n, dim = points.shape
    numbers, xi = np.empty(n, np.intp), np.empty((n, dim - 1))
    result = Closest(numbers, xi, np.empty((n, dim)), np.empty(n), np.empty((n, dim)), np.empty(n))
    if dim == 2:
        _project_onto_lines(points, nodes, result)
    else:
        _project_onto_faces(points, nodes, result)
    failed = np.flatnonzero(np.isnan(result.distance))
    if len(failed):
        _raise_failure(points[failed], result.facet[failed], nodes)
    return result


def closest_of_types(points: Array, nodes_by_type: Sequence[Array]) -> Closest:
    """Project points onto the closest facet of several element types.

    `nodes_by_type` contains the `nodes` of `closest` for each type. Facets are numbered consecutively through all types.
    """
    if len(nodes_by_type) == 1:
        return closest(points, nodes_by_type[0])
    first = np.cumsum([0] + [len(nodes) for nodes in nodes_by_type])
    by_type = [closest(points, nodes) for nodes in nodes_by_type]
    nearest = np.argmin([candidate.distance for candidate in by_type], axis=0)
    facet, *other_fields = (np.stack(values)[nearest, np.arange(len(points))] for values in zip(*by_type, strict=True))
    return Closest(facet + first[nearest], *other_fields)


def _project_onto_lines(points: Array, nodes: Array, closest: Closest) -> None:
    """Fill `closest` with the projections onto lines; the arguments are those of the function `closest`."""
    numbers, order = tree_order(nodes[:, 0].copy(), 1), tree_order(points, POINTS_PER_LEAF)
    nodes = nodes[numbers]
    hull = nodes
    if nodes.shape[1] == 3:  # a parabola lies in the triangle of its ends and this Bezier point
        hull = nodes.copy()
        hull[:, 2] = 2.0 * nodes[:, 2] - 0.5 * (nodes[:, 0] + nodes[:, 1])
    tree = build(hull.min(axis=1), hull.max(axis=1))
    arguments = nodes, numbers, tree, closest
    parallel_map(lambda span: search_2d_kernels.closest_facets(points, order, *span, *arguments), portions(len(points)))


def _project_onto_faces(points: Array, nodes: Array, closest: Closest) -> None:
    """Fill `closest` with the projections onto faces; the arguments are those of the function `closest`."""
    from fastcontact.contact.search import facets_3d_kernels, search_3d_kernels
    from fastcontact.contact.search.projection_3d_kernels import Domain, Facets

    n, table = len(nodes), tables(nodes.shape[1])
    numbers, order = tree_order(nodes[:, 0].copy(), 1), tree_order(points, POINTS_PER_LEAF)
    centre = 0.5 * (nodes.min(axis=0).min(axis=0) + nodes.max(axis=0).max(axis=0))
    facets = Facets(nodes[numbers], centre, np.empty(nodes.shape), np.empty(n), np.empty(n))
    low, high = np.empty((n, 3)), np.empty((n, 3))
    tables_and_boxes = table.to_terms, table.weights, low, high
    parallel_map(lambda span: facets_3d_kernels.prepare(facets, *span, *tables_and_boxes), portions(n))
    tree, domain = build(low, high), Domain(table.nodes, flat_triangles(len(table.nodes)), table.sides)
    arguments = facets, domain, numbers, tree, closest
    parallel_map(lambda span: search_3d_kernels.closest_facets(points, order, *span, *arguments), portions(len(points)))


def _raise_failure(points: Array, facet: Indices, nodes: Array) -> None:
    """Raise ContactError for points whose projection failed."""
    if facet[0] < 0:
        raise ContactError(f"{len(points)} projected points are not finite (first: {points[0]}): the solution diverged")
    raise ContactError(
        f"the projection of {len(points)} points did not converge (first: {points[0]} on facet {facet[0]} near "
        f"{nodes[facet[0]].mean(axis=0)}): the facet is folded or collapsed, so refine or repair the mesh there"
    )


def along_normals(
    points: Array, side: DeformedSide, normals: Array, start: Closest
) -> tuple[Indices, Array, Array, Array]:
    """Project points onto a surface in 3D along its interpolated normals, starting from their closest points.

    Parameters
    ----------
    points : ndarray (n, 3)
        Positions of the points [length].
    side : DeformedSide
    normals : ndarray (n_facets, k, 3)
        Unit normals at the nodes of all facets, see `DeformedSide.smooth_normals`.
    start : Closest
        Closest points, from which the iteration starts, and which are the result if it fails.

    Returns
    -------
    facet : ndarray of int (n,)
        Number of the facet of each projection.
    xi : ndarray (n, 2)
        Reference coordinates of the projection, within the facet [-].
    overhang : ndarray (n,)
        Distance of the projection beyond the end of its facet, in facet lengths [-].
    normal : ndarray (n, 3)
        Interpolated unit normal at the projection [-].
    """
    from fastcontact.contact import projection_kernels

    projection = start.facet.copy(), start.xi.copy(), start.overhang.copy(), np.empty(points.shape)
    # Coordinates are relative to the centre of the surface. Far from the origin, their round-off would exceed the tolerance.
    surface, coordinates = side.surface, side.coordinates
    x = coordinates[surface.points]
    centre = 0.5 * (x.min(axis=0) + x.max(axis=0))
    heights = np.einsum("nd,nd->n", points - start.position, start.normal)
    relative_points, nodes_of_blocks = points - centre, [coordinates[block.facets] - centre for block in surface.blocks]
    normals_and_nodes = zip(np.split(normals, surface.offsets[1:-1]), nodes_of_blocks, strict=True)
    normals_of_blocks = [np.ascontiguousarray(values[:, : nodes.shape[1]]) for values, nodes in normals_and_nodes]
    terms, directions = _polynomials(nodes_of_blocks), _polynomials(normals_of_blocks)
    arguments = relative_points, heights, terms, directions, surface.triangular, surface.neighbours, projection
    parallel_map(lambda span: projection_kernels.along_normals(*span, *arguments), portions(len(points)))
    return projection


def _polynomials(blocks: Sequence[Array]) -> Array:
    """Return the polynomial coefficients (n_facets, width, 3) of vectors that are interpolated on facets.

    `blocks` are the vectors (n, m, 3) at the nodes of the facets of each block.
    """
    from fastcontact.contact import projection_kernels

    out, first = np.empty((sum(map(len, blocks)), max(vectors.shape[1] for vectors in blocks), 3)), 0
    for vectors in blocks:
        projection_kernels.coefficients(vectors, tables(vectors.shape[1]).to_terms, first, 0, len(vectors), out)
        first += len(vectors)
    return out


def along_line_normals(
    points: Array, side: DeformedSide, normals: Array, start: Closest
) -> tuple[Indices, Array, Array, Array]:
    """Project points (n, 2) onto a line along its interpolated normals.

    The other parameters and the results are those of `along_normals`, in 2D.
    """
    surface, at_nodes = side.surface, normals
    nodes = side.coordinates[surface.all_facets]
    if len(surface.blocks) > 1:  # if some lines are curved, straight lines get a third node in the middle
        curved = surface.node_weights[:, :, None] > 0.0
        nodes, at_nodes = (np.where(curved, x, x[:, :2].mean(axis=1, keepdims=True)) for x in (nodes, at_nodes))
    facet, xi, overhang = start.facet.astype(np.intp), start.xi[:, 0].copy(), start.overhang.copy()
    neighbour = np.where(smooth_ends(surface, normals), surface.line_neighbours, -1)
    arguments = map(np.ascontiguousarray, (points, nodes, at_nodes))
    search_2d_kernels.along_normals(*arguments, neighbour, facet, xi, overhang)
    xi = xi[:, None]
    return facet, xi, overhang, interpolate(normals[facet], facet_points(surface, facet, xi))


def smooth_ends(side: Surface, normals: Array) -> Mask:
    """Return the ends (n_facets, 2) of line facets at which an adjacent facet continues the line without a corner.

    `normals` (n_facets, k, 2) are the normals at the nodes of the facets, see `DeformedSide.smooth_normals`. At such an
    end they are equal for both facets.
    """
    total = np.zeros((len(side.points), 2))
    np.add.at(total, side.ends, normals[:, :2])
    return np.asarray(side.inner_ends & (np.linalg.norm(total, axis=1)[side.ends] > 2.0 - SINGLE_PRECISION))
