"""Hanging nodes: nodes that lie on facets of their own body without belonging to them.

Where a coarse and a fine mesh meet, only common nodes are connected. The other nodes hang, so that gaps or overlaps arise.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.neighbours import pairs_within
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import flat_area_vectors
from fastcontact.mesh.elements import Element
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.model.rigid_motions import node_at

if TYPE_CHECKING:
    from fastcontact.model.model import Model

# Nodes nearer to a facet than this, in facet lengths, lie on it; nodes as near to one of its nodes coincide with that node.
# Fine facets of an arc deviate more from a coarse facet; there the facets at all corners of the coarse one exclude a slit.
NEAR, ON_ARC = 0.02, 0.1


@dataclass(frozen=True, eq=False)
class OuterFacets:
    """Outer facets of all bodies, treated as flat.

    `nodes` (n, k) are -1 where there are none, `corners` (n, 2 or 4) repeat the last corner of triangles. `rise` (n,) is the
    distance of nodes between the corners from the plane, and `size` (n,) the diagonal of the box around the corners [length].
    `kind` (n,) is the index in `elements`.
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
            relevant &= ~_joined(mesh, pair.secondary, pair.primary, node, outer.corners[facet])
            relevant &= ~_joined(mesh, pair.primary, pair.secondary, node, outer.corners[facet])
    if not relevant.any():
        return ""
    node, facet = node[relevant], facet[relevant]
    where = ", ".join(f"{x:.6g}" for x in outer.centre[facet[0]])
    return (
        f"{len(np.unique(node))} nodes lie on facets of their own body that they do not belong to (first: "
        f"{node_at(mesh, node[0])}, on the facet around ({where})): the body is torn there. Let cells share whole facets, or "
        "leave the two meshes apart and tie them by a contact of kind 'tied'; if a slit is meant, define its contact"
    )


def _joined(mesh: Mesh, nodes_of: str, facets_of: str, node: Indices, corners: Numbers) -> Mask:
    """Return whether nodes (m,) belong to one side of a contact, and facets (m, n_corners) to the other side."""
    on_side, on_opposite = np.zeros((2, mesh.n_points), bool)
    on_side[mesh.points_of(nodes_of)] = True
    on_opposite[mesh.points_of(facets_of)] = True
    return np.asarray(on_side[node] & (on_opposite[corners] | (corners < 0)).all(axis=1))


def hanging_nodes(mesh: Mesh) -> tuple[Indices, Indices, OuterFacets]:
    """Return nodes (m,) that lie on facets (m,) of their own body without belonging to them, and all outer facets."""
    outer = _outer(mesh)
    if not len(outer.size):
        return np.empty(0, np.intp), np.empty(0, np.intp), outer
    outward = np.zeros(mesh.points.shape)
    for column in outer.nodes.T:
        used = column >= 0
        np.add.at(outward, column[used], outer.normal[used])
    length = np.linalg.norm(outward, axis=1)
    outward /= np.where(length > 0.0, length, 1.0)[:, None]
    reach = ON_ARC * outer.size + outer.rise
    nodes = np.flatnonzero(length > 0.0)
    spokes = np.linalg.norm(mesh.points[outer.corners] - outer.centre[:, None], axis=2).max(axis=1)
    near, facet = pairs_within(mesh.points[nodes], outer.centre, spokes + 2.0 * reach)
    node = nodes[near]
    height = np.einsum("md,md->m", outer.normal[facet], mesh.points[node] - outer.centre[facet])
    facing = np.einsum("md,md->m", outer.normal[facet], outward[node]) <= -0.5
    facing &= (np.abs(height) <= reach[facet]) & (outer.nodes[facet] != node[:, None]).all(axis=1)
    node, facet = node[facing], facet[facing]
    order = np.lexsort((facet, node))
    node, facet = node[order], facet[order]
    _, body = bodies(mesh)
    same_body = body[node] == body[outer.corners[facet, 0]]
    node, facet = node[same_body], facet[same_body]
    on = _within(mesh.points, node, outer, facet)
    node, facet = node[on], facet[on]
    height = np.abs(_heights(mesh, node, outer, facet)) / outer.size[facet]
    on = height <= NEAR
    loose = ~on & (height <= ON_ARC)
    on[loose] = _closed_at_corners(outer, facet[loose])
    node, facet = node[on], facet[on]
    on = ~_across(mesh, node, outer, facet)
    return node[on], facet[on], outer


def _heights(mesh: Mesh, node: Indices, outer: OuterFacets, facet: Indices) -> Array:
    """Return the heights of nodes (m,) above facets (m,), including the bulge of curved ones [length]."""
    height = np.einsum("md,md->m", outer.normal[facet], mesh.points[node] - outer.centre[facet])
    for kind, name in enumerate(outer.elements):
        element, rows = elements.get(name), np.flatnonzero(outer.kind[facet] == kind)
        if element.order == 1 or not len(rows):
            continue
        # Reference coordinates of the nodes on the flat facets.
        x = mesh.points[outer.nodes[facet[rows]][:, : element.n_nodes]]
        corners, middle = x[:, : element.n_corners], element.nodes[: element.n_corners].mean(axis=0)
        J = np.einsum("nk,mnd->mdk", elements.get(element.linear).gradient(middle[None])[0], corners)
        away = np.einsum("mdk,md->mk", J, mesh.points[node[rows]] - corners.mean(axis=1))
        xi = middle + np.linalg.solve(np.einsum("mdk,mdl->mkl", J, J), away[..., None])[..., 0]
        curved = np.einsum("mn,mnd->md", element.shape(xi), x)
        height[rows] -= np.einsum("md,md->m", outer.normal[facet[rows]], curved - outer.centre[facet[rows]])
    return np.asarray(height)


def _across(mesh: Mesh, node: Indices, outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether nodes (m,) belong to the cells behind facets (m,), or to their neighbours.

    This is the case on the far side of a thin sheet, but not where meshes meet, whose cells have no common facet except one
    whose middle nodes belong to only one cell.
    """
    corners = outer.corners[facet]
    involved = np.zeros(mesh.n_points, bool)
    involved[node], involved[corners] = True, True
    cells: dict[int, list[tuple[frozenset[int], str]]] = {}
    for name, block in mesh.solids.items() if len(node) else ():
        for nodes in block[involved[block].any(axis=1)].tolist():
            key = frozenset(nodes[: elements.get(name).n_corners]), name
            for number in nodes:
                cells.setdefault(number, []).append(key)
    across = np.zeros(len(node), bool)
    for k, (number, ends) in enumerate(zip(node.tolist(), corners.tolist(), strict=True)):
        kind = outer.elements[outer.kind[facet[k]]]
        behind = [c for c, name in cells[ends[0]] if c.issuperset(ends) and kind in elements.get(name).facet_elements]
        shared = [cell & other for cell in behind for other, _ in cells[number]]
        across[k] = any(len(common) >= mesh.dim and not common.issubset(ends) for common in shared)
    return across


def _closed_at_corners(outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether every corner of facets (m,) has another facet of opposite normal, as at both ends of a closed tear."""
    if not len(facet):
        return np.empty(0, bool)
    n, width = outer.corners.shape
    at = csr_array((np.ones(n * width), (outer.corners.ravel(), np.repeat(np.arange(n), width))))
    # For each pair of a corner and a facet there, whether its normal is opposite to that of the given facet.
    kinds, which = np.unique(facet, return_inverse=True)
    closed = np.ones(len(kinds), bool)
    for corner in outer.corners[kinds].T:
        rows = at[corner]
        row = np.repeat(np.arange(len(kinds)), np.diff(rows.indptr))
        along = np.einsum("kd,kd->k", outer.normal[kinds[row]], outer.normal[rows.indices])
        opposite = np.zeros(len(kinds), bool)
        opposite[row[along < -0.5]] = True
        closed &= opposite
    return np.asarray(closed[which.ravel()])


def _outer(mesh: Mesh) -> OuterFacets:
    facets = outer_facets(mesh)
    most = max((block.shape[1] for block in facets.values()), default=1)
    n_corners = 2 if mesh.dim == 2 else 4
    nodes, corners, centres, rises = [], [], [], []
    for name, block in facets.items():
        element, x = elements.get(name), mesh.points[block]
        nodes.append(np.pad(block, ((0, 0), (0, most - block.shape[1])), constant_values=-1))
        # A triangle repeats its last corner.
        corners.append(block[:, np.minimum(np.arange(n_corners), element.n_corners - 1)])
        centres.append(x[:, : element.n_corners].mean(axis=1))
        rises.append(_rise(element, x))
    corner = np.concatenate([np.full((0, n_corners), -1, np.int32), *corners])
    x = mesh.points[corner]
    normal = flat_area_vectors(x)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    return OuterFacets(
        np.concatenate([np.full((0, most), -1, np.int32), *nodes]), corner, np.concatenate([x[:, 0][:0], *centres]),
        normal, np.concatenate([np.zeros(0), *rises]), np.linalg.norm(np.ptp(x, axis=1), axis=1), tuple(facets),
        np.repeat(np.arange(len(facets)), [len(block) for block in facets.values()]),
    )  # fmt: skip


def _rise(element: Element, x: Array) -> Array:
    """Return the largest distances (n,) of the nodes of facets (n, n_nodes, dim) from their flat shapes [length]."""
    if element.order == 1:
        return np.zeros(len(x))
    straight = elements.get(element.linear).shape(element.nodes) @ x[:, : element.n_corners]
    return np.asarray(np.linalg.norm(x - straight, axis=2).max(axis=1))


def _within(points: Array, node: Indices, outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether nodes (m,) project on the inside or an edge of facets (m,), away from all of their nodes."""
    members, size = outer.nodes[facet], outer.size[facet]
    distance = np.linalg.norm(points[members] - points[node][:, None], axis=2)
    away = (np.where(members >= 0, distance, np.inf) > NEAR * size[:, None]).all(axis=1)
    x, point = points[outer.corners[facet]], points[node]
    if points.shape[1] == 2:
        return np.asarray(away & _in_simplex(point, x))
    return np.asarray(away & (_in_simplex(point, x[:, [0, 1, 2]]) | _in_simplex(point, x[:, [0, 2, 3]])))


def _in_simplex(point: Array, x: Array) -> Mask:
    """Return whether the projections of points (m, dim) lie in lines (m, 2, dim) or triangles (m, 3, dim)."""
    sides = x[:, 1:] - x[:, :1]
    metric = np.einsum("mid,mjd->mij", sides, sides)
    flat = np.linalg.det(metric) <= 0.0
    metric[flat] = np.eye(metric.shape[1])
    coordinate = np.linalg.solve(metric, np.einsum("mid,md->mi", sides, point - x[:, 0])[..., None])[..., 0]
    inside = (coordinate >= -NEAR).all(axis=1) & (coordinate.sum(axis=1) <= 1.0 + NEAR)
    return np.asarray(inside & ~flat)
