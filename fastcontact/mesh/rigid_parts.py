"""Parts of bodies connected by a hinge: they share a single node, or nodes on one line.

Cells with a common facet belong to one part, and so do parts with two common nodes in 2D, or with three non-collinear
ones in 3D. The remaining common nodes of parts are hinges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, cells_joined_by_facets, remembered

# Nodes nearer to each other, or to a line, than this fraction of the size of the mesh coincide, or lie on the line.
IN_LINE = 1e-6


@dataclass(frozen=True, eq=False)
class RigidParts:
    """Parts of bodies, and the hinges between them.

    Attributes
    ----------
    count : int
        Number of parts; that of the bodies where there are no hinges.
    part : ndarray of int (n_points,)
        The part of each point, the lowest one of several; -1 for points without a solid cell.
    hinge_node, hinge_part : ndarray of int (k,)
        Nodes at hinges, ascending, each once for every part that it belongs to.
    """

    count: int
    part: Indices
    hinge_node: Indices
    hinge_part: Indices

    def hinges_of(self, number: int) -> Indices:
        """Return the nodes at which a part is attached to others, ascending."""
        return self.hinge_node[self.hinge_part == number]

    def nodes_of(self, number: int) -> Indices:
        """Return the nodes of a part, ascending, with those at hinges."""
        nodes, hinges = np.flatnonzero(self.part == number), self.hinges_of(number)
        return np.union1d(nodes, hinges) if len(hinges) else nodes


@remembered
def rigid_parts(mesh: Mesh) -> RigidParts:
    """Return the parts of the bodies of a mesh."""
    count, body = bodies(mesh)
    joined = cells_joined_by_facets(mesh)
    roots = {name: joined[mesh.offsets[name] :][: len(block)] for name, block in mesh.solids.items()}
    first, label = np.unique(np.concatenate(list(roots.values())), return_inverse=True)
    if len(first) == count:
        none = np.empty(0, np.intp)
        return RigidParts(count, body.astype(np.intp), none, none)
    part, node, several = _shared_nodes(mesh, label.ravel())
    while True:
        first, second, at = _meetings(node, several)
        rigid = _rigid(mesh.points, first, second, at)
        if not rigid.any():
            break
        count = int(max(part.max(), several.max())) + 1
        ends = first[rigid], second[rigid]
        graph = coo_array((np.ones(len(ends[0]), np.int8), ends), shape=(count, count))
        _, merged = connected_components(graph, directed=False)
        part = np.where(part >= 0, merged[part], -1)
        node, several = np.unique(np.stack([node, merged[several]]), axis=1)
    left = np.isin(node, at)
    return RigidParts(int(part.max()) + 1, part, node[left], several[left])


def _shared_nodes(mesh: Mesh, label: Indices) -> tuple[Indices, Indices, Indices]:
    """Return a part (n_points,) of each point, the lowest of several, and nodes (k,) of several parts with each part.

    `label` (n_solids,) is the part of each solid cell; points without one get -1.
    """
    part = np.full(mesh.n_points, -1, np.intp)
    shared = np.zeros(mesh.n_points, bool)
    ends = np.cumsum([len(block) for block in mesh.solids.values()])
    owned = list(zip(mesh.solids.values(), np.split(label, ends[:-1]), strict=True))
    for block, owners in owned:
        part[block] = owners[:, None]
    for block, owners in owned:
        shared[block[part[block] != owners[:, None]]] = True
    rows = [
        (block[shared[block]], np.broadcast_to(owners[:, None], block.shape)[shared[block]]) for block, owners in owned
    ]
    node, several = np.unique(np.concatenate([np.stack(pair) for pair in rows], axis=1), axis=1).astype(np.intp)
    _, lowest = np.unique(node, return_index=True)
    part[node[lowest]] = several[lowest]
    return part, node, several


def _meetings(node: Indices, part: Indices) -> tuple[Indices, Indices, Indices]:
    """Return pairs of parts (m,) and their common nodes, from ascending nodes with each of their parts."""
    meetings = [np.empty((3, 0), np.intp)]
    shift = 1
    while len(same := np.flatnonzero(node[shift:] == node[:-shift])):
        meetings.append(np.stack([part[same], part[same + shift], node[same]]))
        shift += 1
    first, second, at = np.concatenate(meetings, axis=1)
    return first, second, at


def _rigid(points: Array, first: Indices, second: Indices, at: Indices) -> Mask:
    """Return whether two parts cannot rotate relative to each other, for each pair (m,) `first`, `second` at a node."""
    if not len(at):
        return np.empty(0, bool)
    _, pair, count = np.unique(np.stack([first, second]), axis=1, return_inverse=True, return_counts=True)
    pair, dim = pair.ravel(), points.shape[1]
    mean = np.column_stack([np.bincount(pair, points[at, d]) for d in range(dim)]) / count[:, None]
    away = points[at] - mean[pair]
    moment = np.stack([[np.bincount(pair, away[:, i] * away[:, j]) for j in range(dim)] for i in range(dim)])
    # In two dimensions the common nodes must extend in one direction, in three in two.
    spread = np.linalg.eigvalsh(np.moveaxis(moment, 2, 0))[:, 1]
    return np.asarray((spread > (IN_LINE * np.ptp(points, axis=0).max()) ** 2)[pair])
