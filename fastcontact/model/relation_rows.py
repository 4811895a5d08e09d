"""Rows of multi-point constraints along given directions and surface normals, and the matching of nodes of two groups."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact._tools.argument_types import finite_vector
from fastcontact._tools.neighbours import nearest, pairs_within
from fastcontact.arrays import Array, Indices
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.elasticity.loads import facets_of, outward
from fastcontact.errors import ModelError
from fastcontact.linear.sparse_rows import nodal_rows
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import bodies, outer_facets
from fastcontact.round_off import ROUND_OFF, SINGLE_PRECISION

NORMAL = "normal"
NodeGroup = tuple[str, Indices]  # name, nodes


def normals_of(mesh: Mesh, group: str) -> tuple[Indices, Array]:
    """Return the nodes (m,) of a group of outer facets, and their unit normals (m, dim), averaged over adjacent facets.

    Raises an error under the same conditions as a pressure that acts on the group.
    """
    facets = {name: outward(mesh, group, name, block) for name, block in facets_of(mesh, group).items()}
    points = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    position = np.full(mesh.n_points, -1, np.intp)
    position[points] = np.arange(len(points))
    blocks = tuple(FacetBlock(name, block, position[block]) for name, block in facets.items())
    normal = DeformedSide(Surface(group, blocks, points, np.zeros(len(points))), mesh.points).nodal_normals
    normal[np.abs(normal) < ROUND_OFF] = 0.0
    return points.astype(np.intp), normal / np.linalg.norm(normal, axis=1, keepdims=True)


def directions_of(mesh: Mesh, group: str, component: str) -> list[tuple[Indices, Array]]:
    """Return, for each direction that `component` names, the nodes (m,) of a group and unit vectors (m, dim) at these nodes.

    `component` is ``"normal"``, or some of the letters x, y and z.
    """
    if component == NORMAL:
        return [normals_of(mesh, group)]
    nodes = mesh.points_of(group).astype(np.intp)
    return [(nodes, np.tile(np.eye(mesh.dim)["xyz".index(axis)], (len(nodes), 1))) for axis in component]


def rows_along(nodes: Indices, directions: Array, n_dofs: int) -> csr_array:
    """Return rows (m, n_dofs) for the displacements of `nodes` (m,) along the unit vectors `directions` (m, dim) [-]."""
    return nodal_rows(nodes[:, None], directions[:, None], n_dofs)


def relative_to_first(rows: csr_array) -> csr_array:
    """Return the differences (m - 1, n) between the second and later ones of `rows` (m, n) and the first one."""
    return csr_array(rows[1:] - csr_array(vstack([rows[[0]]] * (rows.shape[0] - 1), format="csr")))


def matching_nodes(mesh: Mesh, first: NodeGroup, second: NodeGroup, translation: Sequence[float] | None) -> Indices:
    """Return, for each node of the first group, the index of the coincident node of the second group after a translation.

    The first group is moved by `translation` (dim,) [length], by default from the centre of its bounding box to that of the
    second group. Each group is given as (name, nodes).

    Raises
    ------
    ModelError
        If the groups have different numbers of nodes, or do not coincide, or if coincident nodes cannot be distinguished.
    """
    (name, nodes), (other, opposite) = first, second
    if len(nodes) != len(opposite):
        raise ModelError(f"groups '{name}' and '{other}' have {len(nodes)} and {len(opposite)} nodes: they must match")
    x, target = mesh.points[nodes], mesh.points[opposite]
    shift: Array | None = 0.5 * (target.min(axis=0) + target.max(axis=0) - x.min(axis=0) - x.max(axis=0))
    if translation is not None:
        shift = finite_vector(translation, mesh.dim)
    if shift is None:
        raise ModelError(f"the translation {translation} of '{name}' must be {mesh.dim} numbers")
    rows, distance, tolerance = coincident_nodes(mesh, first, second, np.eye(mesh.dim), shift)
    worst, requirement = int(np.argmax(distance)), "groups are joined node by node"
    if distance[worst] > tolerance:
        raise ModelError(
            f"point {nodes[worst]} of '{name}', moved by {shift}, lies {distance[worst]:.3g} from the nearest node of "
            f"'{other}': {requirement}; give the translation between them, or use another mesh"
        )
    if len(np.unique(rows)) < len(nodes):
        raise ModelError(f"several nodes of '{name}', moved by {shift}, meet one node of '{other}': {requirement}")
    return rows


class Coincident(NamedTuple):
    """For each of n moved nodes, the coincident node of the other group, or the nearest one if no node coincides."""

    rows: Indices  # (n,): index of this node in the other group
    distance: Array  # (n,): distance to the nearest node [length]
    tolerance: float  # largest distance of coincident nodes [length]


def coincident_nodes(mesh: Mesh, first: NodeGroup, second: NodeGroup, turn: Array, shift: Array) -> Coincident:
    """Return the nodes of the second group that coincide with those of the first, rotated by `turn` and moved by `shift`.

    Each group is given as (name, nodes). Several nodes of a group may have the same position, for example on bodies in
    contact or on the two sides of a crack. They are distinguished by the facets of the group to which they belong, or else
    by their bodies.

    Raises
    ------
    ModelError
        If neither facets nor bodies distinguish them.
    """
    (name, nodes), (other, opposite) = first, second
    x, target = mesh.points[nodes] @ turn.T + shift, mesh.points[opposite]
    # The size of the mesh replaces that of a small group, such as a single node.
    size = max(float(np.ptp(x, axis=0).max()), 1e-3 * float(np.ptp(mesh.points, axis=0).max()))
    tolerance = SINGLE_PRECISION * size
    distance, rows = nearest(target, x)
    candidate, row = pairs_within(target, x, np.full(len(x), tolerance))
    if len(row) > len(np.unique(row)):
        body = bodies(mesh)[1]
        deviation = vectors_to_facets(mesh, nodes)[row] @ turn.T - vectors_to_facets(mesh, opposite)[candidate]
        on_different_bodies = body[nodes[row]] != body[opposite[candidate]]
        # If facets deviate equally, within round-off, a node of the same body is preferred.
        mismatch = np.linalg.norm(deviation, axis=1) + 4.0 * tolerance * on_different_bodies
        order = np.lexsort((mismatch, row))
        candidate, row, mismatch = candidate[order], row[order], mismatch[order]
        is_best = np.insert(np.diff(row) > 0, 0, True)
        rows[row[is_best]] = candidate[is_best]
        ambiguous = np.flatnonzero(~is_best[1:] & is_best[:-1] & (np.diff(mismatch) <= tolerance))
        if len(ambiguous):
            node, pair = nodes[row[ambiguous[0]]], opposite[candidate[ambiguous[0] : ambiguous[0] + 2]]
            raise ModelError(
                f"points {pair[0]} and {pair[1]} of '{other}' coincide, and neither the facets nor the bodies of the groups "
                f"determine which of them belongs to point {node} of '{name}': join groups of one body at a time"
            )
    return Coincident(rows, distance, tolerance)


def vectors_to_facets(mesh: Mesh, nodes: Indices) -> Array:
    """Return the vectors (n, dim) from nodes (n,) to the mean centre of the outer facets around them [length].

    Only facets whose nodes are all among `nodes` are considered. The vectors are zero for nodes without such a facet.
    """
    is_given, total, count = np.zeros(mesh.n_points, bool), np.zeros_like(mesh.points), np.zeros(mesh.n_points)
    is_given[nodes] = True
    for facets in outer_facets(mesh).values():
        facets_of_nodes = facets[is_given[facets].all(axis=1)]
        np.add.at(total, facets_of_nodes, mesh.points[facets_of_nodes].mean(axis=1)[:, None])
        np.add.at(count, facets_of_nodes, 1.0)
    total, count = total[nodes], count[nodes, None]
    return np.where(count > 0.0, total / np.maximum(count, 1.0) - mesh.points[nodes], 0.0)
