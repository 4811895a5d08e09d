"""Hanging nodes, which lie on facets of their own body but are not nodes of these facets.

Where a coarse and a fine mesh meet, only their common nodes are connected. Under load, gaps or overlaps form at the other
nodes.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.neighbours import pairs_within
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import flat_area_vectors
from fastcontact.mesh.flat_pieces import flat_pieces
from fastcontact.mesh.mesh import Mesh, node_at, vector_text
from fastcontact.mesh.topology import bodies, cells_of_outer_facets, outer_facets

# Distances relative to the size of a facet [-]. A node lies on a facet if it is closer to it than NEAR, and it
# coincides with a node of the facet if it is closer to that node than NEAR. On arcs, the distance of nodes of fine
# facets from a coarse facet may be up to ON_ARC. Such nodes are distinguished from slits by the condition that each
# corner of the coarse facet has a facet of opposite normal.
NEAR, ON_ARC = 0.02, 0.1


@record
class OuterFacets:
    """Outer facets of all bodies, and the flat lines or triangles between their nodes.

    `nodes` (n, k) are padded with -1, and `corners` (n, 2 or 4) with the last corner of triangles. `normal` (n, dim) is the
    outward unit normal between the corners, `size` (n,) the diagonal of the bounding box of the corners [length], and `cell`
    (n,) the solid cell of a facet. `pieces` (n, p, dim) are the nodes of the lines or triangles, some of which are repeated.
    """

    nodes: Numbers
    corners: Numbers
    normal: Array
    size: Array
    cell: Numbers
    pieces: Numbers


def hanging_nodes_text(mesh: Mesh, node: Indices, facet: Indices, outer: OuterFacets) -> str:
    """Return a warning about hanging nodes (m,) on the `outer` facets (m,), or an empty string if there are none."""
    if not len(node):
        return ""
    centre = vector_text(mesh.points[outer.corners[facet[0]]].mean(axis=0))
    return (
        f"{len(np.unique(node))} nodes lie on facets of their own body that they do not belong to (first: "
        f"{node_at(mesh, node[0])}, on the facet around {centre}): the body is torn there. Let cells share whole facets, "
        "or leave the two meshes apart and tie them by a contact of kind 'tied'; if a slit is meant, define its contact"
    )


def hanging_nodes(mesh: Mesh) -> tuple[Indices, Indices, OuterFacets]:
    """Return hanging nodes (m,), the facets (m,) of their own body on which they lie, and all outer facets."""
    outer, body = _outer_facets(mesh), bodies(mesh)[1]
    outward = np.zeros(mesh.points.shape)
    for column in outer.nodes.T:
        np.add.at(outward, column[column >= 0], outer.normal[column >= 0])
    length = np.linalg.norm(outward, axis=1)
    nodes, corners = np.flatnonzero(length > 0.0), mesh.points[outer.corners]
    centre = corners.mean(axis=1)
    radius = np.linalg.norm(corners - centre[:, None], axis=2).max(axis=1) + 2.0 * ON_ARC * outer.size
    index, facet = pairs_within(mesh.points[nodes], centre, radius)
    node = nodes[index]
    is_candidate = np.einsum("md,md->m", outer.normal[facet], outward[node]) <= -0.5 * length[node]
    is_candidate &= (body[node] == body[outer.corners[facet, 0]]) & (outer.nodes[facet] != node[:, None]).all(axis=1)
    node, facet = node[is_candidate], facet[is_candidate]
    height = _distances(mesh.points[node], mesh.points[outer.pieces[facet]]) / outer.size[facet]
    rows = np.flatnonzero((height <= ON_ARC) & _apart_from_nodes(mesh, node, outer, facet))
    rows = rows[np.lexsort((facet[rows], node[rows]))]
    node, facet, hanging = node[rows], facet[rows], height[rows] <= NEAR
    hanging[~hanging] = _closed_at_corners(outer, facet[~hanging])
    hanging &= ~_share_cells(mesh, node, outer, facet)
    return node[hanging], facet[hanging], outer


def _distances(points: Array, x: Array) -> Array:
    """Return the distance (m,) [length] of `points` (m, dim) from the nearest of p lines or triangles `x` (m, p, dim, dim).

    Only lines and triangles into which a point projects, within NEAR, are considered; without any the distance is infinite.
    """
    sides, arm = x[:, :, 1:] - x[:, :, :1], points[:, None] - x[:, :, 0]
    metric = np.einsum("mpid,mpjd->mpij", sides, sides)
    degenerate = np.linalg.det(metric) <= 0.0
    metric[degenerate] = np.eye(metric.shape[2])
    coordinate = np.linalg.solve(metric, np.einsum("mpid,mpd->mpi", sides, arm)[..., None])[..., 0]
    inside = (coordinate >= -NEAR).all(axis=2) & (coordinate.sum(axis=2) <= 1.0 + NEAR) & ~degenerate
    distance = np.linalg.norm(arm - np.einsum("mpi,mpid->mpd", coordinate, sides), axis=2)
    return np.asarray(np.where(inside, distance, np.inf).min(axis=1))


def _apart_from_nodes(mesh: Mesh, node: Indices, outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether nodes (m,) coincide with none of the nodes of facets (m,)."""
    distance = np.linalg.norm(mesh.points[outer.nodes[facet]] - mesh.points[node][:, None], axis=2)
    return np.asarray(((distance > NEAR * outer.size[facet, None]) | (outer.nodes[facet] < 0)).all(axis=1))


def _share_cells(mesh: Mesh, node: Indices, outer: OuterFacets, facet: Indices) -> Mask:
    """Return whether nodes (m,) belong to the cells behind facets (m,), or to their neighbours.

    A node on the opposite side of a thin sheet belongs to such a cell. A node where two meshes meet does not, because the
    cells of the two meshes share no facet, or only the corners of the given facet.
    """
    if not len(node):
        return np.empty(0, bool)
    corners, cells, connected = np.full((mesh.n_cells, 8), -1), [], np.zeros(len(node), bool)
    for name, block in mesh.solids.items():
        numbers, n_corners = mesh.offsets[name] + np.arange(len(block)), elements.get(name).n_corners
        corners[numbers, :n_corners] = block[:, :n_corners]
        cells.append(np.stack([block.ravel(), np.repeat(numbers, block.shape[1])]))
    ends = np.concatenate(cells, axis=1)
    around = csr_array((np.ones(ends.shape[1], bool), tuple(ends)), shape=(mesh.n_points, mesh.n_cells))[node]
    pair = np.repeat(np.arange(len(node)), np.diff(around.indptr))
    behind = corners[outer.cell[facet[pair]]]
    common = (behind[:, :, None] == corners[around.indices][:, None]).any(axis=2) & (behind >= 0)
    on_facet = (behind[:, :, None] == outer.corners[facet[pair]][:, None]).any(axis=2)
    connected[pair[(common.sum(axis=1) >= mesh.dim) & (common & ~on_facet).any(axis=1)]] = True
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
    n_pieces = max(len(flat_pieces(block.shape[1], mesh.dim)) for block in facets.values())
    nodes, corners, pieces = [], [], []
    for name, block in facets.items():
        nodes.append(np.pad(block, ((0, 0), (0, width - block.shape[1])), constant_values=-1))
        corners.append(block[:, np.minimum(np.arange(n_corners), elements.get(name).n_corners - 1)])
        local = flat_pieces(block.shape[1], mesh.dim)
        pieces.append(block[:, local[np.minimum(np.arange(n_pieces), len(local) - 1)]])
    corner = np.concatenate(corners)
    x = mesh.points[corner]
    normal = flat_area_vectors(x)
    length = np.linalg.norm(normal, axis=1)
    normal /= np.where(length > 0.0, length, 1.0)[:, None]
    size, cell = np.linalg.norm(np.ptp(x, axis=1), axis=1), np.concatenate([*cells_of_outer_facets(mesh).values()])
    return OuterFacets(np.concatenate(nodes), corner, normal, size, cell, np.concatenate(pieces))
