"""Hanging nodes, which lie on facets of their own body but are not nodes of these facets.

Where a coarse and a fine mesh meet, only their common nodes are connected. Under load, gaps or overlaps form at the other
nodes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.neighbours import pairs_within
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import flat_area_vectors
from fastcontact.mesh.elements import Element
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.model.rigid_motions import node_at

if TYPE_CHECKING:
    from fastcontact.model.model import Model

# Distances relative to the size of a facet [-]. A node lies on a facet if it is closer to it than NEAR, and it
# coincides with a node of the facet if it is closer to that node than NEAR. On arcs, the distance of nodes of fine
# facets from a coarse facet may be up to ON_ARC. Such nodes are distinguished from slits by the condition that each
# corner of the coarse facet has a facet of opposite normal.
NEAR, ON_ARC = 0.02, 0.1


@record
class OuterFacets:
    """Outer facets of all bodies, treated as flat.

    `nodes` (n, k) are padded with -1, and `corners` (n, 2 or 4) with the last corner of triangles. `centre` (n, dim) is the
    mean of the corners [length], and `normal` (n, dim) the outward unit normal. `rise` (n,) is the largest distance of the
    other nodes from the flat facet, and `size` (n,) the diagonal of the bounding box of the corners [length]. The element
    type is ``elements[kind]``.
    """

    nodes: Numbers
    corners: Numbers
    centre: Array
    normal: Array
    rise: Array
    size: Array
    elements: tuple[str, ...]
    kind: Indices


def hanging_nodes_warning(model: Model) -> str:
    """Return a warning if nodes hang on facets of their own body without a contact or constraint between them."""
    mesh = model.mesh
    node, facet, outer = hanging_nodes(mesh)
    relevant = ~model.related_points()[node]
    for pair in model.contact if len(node) else ():
        if pair.primary:
            relevant &= ~_paired_by_contact(mesh, pair.secondary, pair.primary, node, outer.corners[facet])
            relevant &= ~_paired_by_contact(mesh, pair.primary, pair.secondary, node, outer.corners[facet])
    if not relevant.any():
        return ""
    node, facet = node[relevant], facet[relevant]
    centre = ", ".join(f"{x:.6g}" for x in outer.centre[facet[0]])
    return (
        f"{len(np.unique(node))} nodes lie on facets of their own body that they do not belong to (first: "
        f"{node_at(mesh, node[0])}, on the facet around ({centre})): the body is torn there. Let cells share whole facets, "
        "or leave the two meshes apart and tie them by a contact of kind 'tied'; if a slit is meant, define its contact"
    )


def _paired_by_contact(mesh: Mesh, node_group: str, facet_group: str, node: Indices, corners: Numbers) -> Mask:
    """Return the mask (m,) of nodes of `node_group` on facets of `facet_group`, which have the `corners` (m, n_corners)."""
    in_node_group, in_facet_group = np.zeros((2, mesh.n_points), bool)
    in_node_group[mesh.points_of(node_group)] = True
    in_facet_group[mesh.points_of(facet_group)] = True
    return np.asarray(in_node_group[node] & (in_facet_group[corners] | (corners < 0)).all(axis=1))


def hanging_nodes(mesh: Mesh) -> tuple[Indices, Indices, OuterFacets]:
    """Return hanging nodes (m,), the facets (m,) of their own body on which they lie, and all outer facets."""
    outer = _outer_facets(mesh)
    outward = np.zeros(mesh.points.shape)
    for column in outer.nodes.T:
        is_node = column >= 0
        np.add.at(outward, column[is_node], outer.normal[is_node])
    length = np.linalg.norm(outward, axis=1)
    outward /= np.where(length > 0.0, length, 1.0)[:, None]
    largest_height = ON_ARC * outer.size + outer.rise
    nodes = np.flatnonzero(length > 0.0)
    radius = np.linalg.norm(mesh.points[outer.corners] - outer.centre[:, None], axis=2).max(axis=1)
    index, facet = pairs_within(mesh.points[nodes], outer.centre, radius + 2.0 * largest_height)
    node = nodes[index]
    height = np.einsum("md,md->m", outer.normal[facet], mesh.points[node] - outer.centre[facet])
    is_opposite = np.einsum("md,md->m", outer.normal[facet], outward[node]) <= -0.5
    is_opposite &= (np.abs(height) <= largest_height[facet]) & (outer.nodes[facet] != node[:, None]).all(axis=1)
    node, facet = node[is_opposite], facet[is_opposite]
    order = np.lexsort((facet, node))
    node, facet = node[order], facet[order]
    _, body = bodies(mesh)
    same_body = body[node] == body[outer.corners[facet, 0]]
    node, facet = node[same_body], facet[same_body]
    inside = _project_inside(mesh.points, node, outer, facet)
    node, facet = node[inside], facet[inside]
    height = np.abs(_heights(mesh, node, outer, facet)) / outer.size[facet]
    hanging = height <= NEAR
    on_arc = ~hanging & (height <= ON_ARC)
    hanging[on_arc] = _closed_at_corners(outer, facet[on_arc])
    node, facet = node[hanging], facet[hanging]
    hanging = ~_share_cells(mesh, node, outer, facet)
    return node[hanging], facet[hanging], outer


def _heights(mesh: Mesh, node: Indices, outer: OuterFacets, facet: Indices) -> Array:
    """Return the signed distances (m,) of nodes (m,) from facets (m,), which may be curved, along their normals [length]."""
    height = np.einsum("md,md->m", outer.normal[facet], mesh.points[node] - outer.centre[facet])
    for kind, name in enumerate(outer.elements):
        element, rows = elements.get(name), np.flatnonzero(outer.kind[facet] == kind)
        if element.order == 1 or not len(rows):
            continue
        # xi are the reference coordinates of the projections of the nodes onto the flat facets.
        x = mesh.points[outer.nodes[facet[rows]][:, : element.n_nodes]]
        corners, centre = x[:, : element.n_corners], element.nodes[: element.n_corners].mean(axis=0)
        J = np.einsum("nk,mnd->mdk", elements.get(element.linear).gradient(centre[None])[0], corners)
        offset = np.einsum("mdk,md->mk", J, mesh.points[node[rows]] - corners.mean(axis=1))
        xi = centre + np.linalg.solve(np.einsum("mdk,mdl->mkl", J, J), offset[..., None])[..., 0]
        curved = np.einsum("mn,mnd->md", element.shape(xi), x)
        height[rows] -= np.einsum("md,md->m", outer.normal[facet[rows]], curved - outer.centre[facet[rows]])
    return np.asarray(height)


def _share_cells(mesh: Mesh, node: Indices, outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether nodes (m,) belong to the cells behind facets (m,), or to their neighbours.

    A node on the opposite side of a thin sheet belongs to such a cell. A node where two meshes meet does not, because the
    cells of the two meshes share no facet, or only the corners of the given facet.
    """
    corners = outer.corners[facet]
    is_involved = np.zeros(mesh.n_points, bool)
    is_involved[node], is_involved[corners] = True, True
    cells: dict[int, list[tuple[frozenset[int], str]]] = {}
    for name, block in mesh.solids.items() if len(node) else ():
        for nodes in block[is_involved[block].any(axis=1)].tolist():
            key = frozenset(nodes[: elements.get(name).n_corners]), name
            for number in nodes:
                cells.setdefault(number, []).append(key)
    connected = np.zeros(len(node), bool)
    for k, (number, ends) in enumerate(zip(node.tolist(), corners.tolist(), strict=True)):
        kind = outer.elements[outer.kind[facet[k]]]
        hosts = [c for c, name in cells[ends[0]] if c.issuperset(ends) and kind in elements.get(name).facet_elements]
        shared = [cell & neighbour for cell in hosts for neighbour, _ in cells[number]]
        connected[k] = any(len(common) >= mesh.dim and not common.issubset(ends) for common in shared)
    return connected


def _closed_at_corners(outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether every corner of facets (m,) also has a facet of opposite normal, as at the ends of a closed tear."""
    if not len(facet):
        return np.empty(0, bool)
    n, width = outer.corners.shape
    facets_at = csr_array((np.ones(n * width), (outer.corners.ravel(), np.repeat(np.arange(n), width))))
    unique, inverse = np.unique(facet, return_inverse=True)
    closed = np.ones(len(unique), bool)
    for corner in outer.corners[unique].T:
        neighbours = facets_at[corner]
        row = np.repeat(np.arange(len(unique)), np.diff(neighbours.indptr))
        cosine = np.einsum("kd,kd->k", outer.normal[unique[row]], outer.normal[neighbours.indices])
        opposite = np.zeros(len(unique), bool)
        opposite[row[cosine < -0.5]] = True
        closed &= opposite
    return np.asarray(closed[inverse.ravel()])


def _outer_facets(mesh: Mesh) -> OuterFacets:
    """Return the outer facets of all bodies."""
    facets, n_corners = outer_facets(mesh), 2 if mesh.dim == 2 else 4
    width = max(block.shape[1] for block in facets.values())
    nodes, corners, centres, rises = [], [], [], []
    for name, block in facets.items():
        element, x = elements.get(name), mesh.points[block]
        nodes.append(np.pad(block, ((0, 0), (0, width - block.shape[1])), constant_values=-1))
        corners.append(block[:, np.minimum(np.arange(n_corners), element.n_corners - 1)])
        centres.append(x[:, : element.n_corners].mean(axis=1))
        rises.append(_rise(element, x))
    corner = np.concatenate(corners)
    x = mesh.points[corner]
    normal = flat_area_vectors(x)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    size = np.linalg.norm(np.ptp(x, axis=1), axis=1)
    kind = np.repeat(np.arange(len(facets)), [len(block) for block in facets.values()])
    centre, rise = np.concatenate(centres), np.concatenate(rises)
    return OuterFacets(np.concatenate(nodes), corner, centre, normal, rise, size, tuple(facets), kind)


def _rise(element: Element, x: Array) -> Array:
    """Return the largest distances (n,) of the nodes of facets `x` (n, n_nodes, dim) from those of flat facets [length]."""
    if element.order == 1:
        return np.zeros(len(x))
    flat = elements.get(element.linear).shape(element.nodes) @ x[:, : element.n_corners]
    return np.asarray(np.linalg.norm(x - flat, axis=2).max(axis=1))


def _project_inside(points: Array, node: Indices, outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether nodes (m,) project onto facets (m,) and coincide with none of their nodes."""
    members, size = outer.nodes[facet], outer.size[facet]
    distance = np.linalg.norm(points[members] - points[node][:, None], axis=2)
    distinct = (np.where(members >= 0, distance, np.inf) > NEAR * size[:, None]).all(axis=1)
    x, point = points[outer.corners[facet]], points[node]
    if points.shape[1] == 2:
        return np.asarray(distinct & _in_simplex(point, x))
    return np.asarray(distinct & (_in_simplex(point, x[:, [0, 1, 2]]) | _in_simplex(point, x[:, [0, 2, 3]])))


def _in_simplex(point: Array, x: Array) -> Mask:
    """Return whether the projections of points (m, dim) lie in lines (m, 2, dim) or triangles (m, 3, dim), within NEAR."""
    sides = x[:, 1:] - x[:, :1]
    metric = np.einsum("mid,mjd->mij", sides, sides)
    degenerate = np.linalg.det(metric) <= 0.0
    metric[degenerate] = np.eye(metric.shape[1])
    coordinate = np.linalg.solve(metric, np.einsum("mid,md->mi", sides, point - x[:, 0])[..., None])[..., 0]
    inside = (coordinate >= -NEAR).all(axis=1) & (coordinate.sum(axis=1) <= 1.0 + NEAR)
    return np.asarray(inside & ~degenerate)
