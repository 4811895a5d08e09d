"""Facets of a rigid surface: orientation, adjacency and averaged normals.

Facets are numbered through blocks of one element type each. A ridge is the common boundary of two facets: the end of a
line in 2D, and the edge of a face in 3D.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import connected_components

from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.projection import facet_angles
from fastcontact.errors import ContactError
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import area_vectors
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.topology import outer_facets, same_facets
from fastcontact.round_off import LENGTH_ROUND_OFF


@dataclass(frozen=True, eq=False)
class Block:
    """Facets of one element type."""

    element: elements.Element
    numbers: Indices  # (n,): cell numbers in the mesh
    nodes: Indices  # (n, k): connectivity, normals pointing out
    corners: Array  # (n, k, dim): positions of the nodes [length]

    def ridges(self) -> tuple[Indices, Indices]:
        """Return the first and the last node (n, r) of each ridge, which are the same node in 2D."""
        if self.element.dim == 1:
            return self.nodes[:, :2], self.nodes[:, :2]
        edges = np.array(self.element.edges)
        return self.nodes[:, edges[:, 0]], self.nodes[:, edges[:, 1]]

    def normals(self) -> tuple[Array, Array]:
        """Return the unit normals (n, k, dim) at the nodes, and the angles (n, k) of `facet_angles` there."""
        normal = area_vectors(self.corners, self.element.gradient(self.element.nodes))
        length = np.linalg.norm(normal, axis=2, keepdims=True)
        unit = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
        return unit, facet_angles(self.element, self.corners)


class SurfaceFacets(NamedTuple):
    """The facets of a rigid surface, their neighbours and their normals.

    The smooth normal of a facet at a node is the mean over the facets at this node whose angle to the facet is at most the
    crease angle. The normal of a point is the mean over all facets at this point, not normalised. It determines on which side
    of the surface positions near the point lie (Baerentzen and Aanaes, 2005). Both means are weighted by the angles of the
    facets (Thuermer and Wuethrich, 1998).
    """

    blocks: list[Block]
    beyond: Indices  # (n_facets, most ridges): the facet beyond each ridge, -1 where the surface ends
    normals: list[Array]  # (n, k, dim) for each block: unit normals at the nodes [-]
    smooth: list[Array]  # the same, of the smooth surface [-]
    at_points: Array  # (n_points, dim): normals of points [-]
    on_border: Mask  # (n_points,): whether the surface ends there


def surface_facets(mesh: Mesh, group: str, flip: bool, crease: float) -> SurfaceFacets:
    """Return the facets of a group, their neighbours and their normals.

    Facets that meet at the angle `crease` [degrees] or less form a smooth surface. Raises ContactError if the facets do not
    form an orientable surface.
    """
    blocks = _oriented_blocks(mesh, group, flip)
    beyond = _neighbours(blocks, group)
    facet_normals_of_blocks = [block.normals() for block in blocks]
    smooth, at_points = _smooth_normals(blocks, facet_normals_of_blocks, crease)
    on_border, last = np.zeros(len(at_points), bool), np.cumsum([len(block.nodes) for block in blocks])
    for block, neighbours in zip(blocks, np.split(beyond, last[:-1]), strict=True):
        ends = np.stack(block.ridges(), axis=2)
        on_border[ends[neighbours[:, : ends.shape[1]] < 0]] = True
    by_block = [normals for normals, _ in facet_normals_of_blocks]
    return SurfaceFacets(blocks, beyond, by_block, smooth, at_points, on_border)


def _oriented_blocks(mesh: Mesh, group: str, flip: bool) -> list[Block]:
    """Return the facets of a group with the orientation of the mesh or, with `flip`, the opposite one.

    Facets on the outside of solid cells point out of these cells, independently of the order of their nodes in the group.
    """
    rows = mesh.split(mesh.cell_groups[group]) if mesh.cells_of(group, dim=mesh.dim - 1) else {}
    rows = {name: block for name, block in rows.items() if elements.get(name).dim == mesh.dim - 1}
    if not rows:
        raise ContactError(
            f"group '{group}' contains no facets (cells of dimension {mesh.dim - 1}), so it is not a rigid surface: "
            "name a group of lines in 2D, of triangles or quadrangles in 3D"
        )
    outer = outer_facets(mesh) if mesh.solids else {}
    blocks = []
    for name, block in rows.items():
        element = elements.get(name)
        nodes = mesh.cells[name][block]
        if name in outer:  # facets of solids are oriented outwards
            outer_rows = same_facets(outer[name], nodes)
            nodes = np.where((outer_rows >= 0)[:, None], outer[name][outer_rows], nodes)
        if flip:
            nodes = nodes[:, list(element.reversed)]
        blocks.append(Block(element, block + mesh.offsets[name], nodes.astype(np.intp), mesh.points[nodes]))
        lengths = np.linalg.norm(blocks[-1].normals()[0], axis=2)
        degenerate = np.flatnonzero(lengths.min(axis=1) == 0.0)
        if len(degenerate):
            raise ContactError(
                f"{_description(blocks[-1:], int(degenerate[0]))} of the rigid surface '{group}' has no area, or none at "
                "one of its nodes: remove it or repair the mesh there"
            )
    return blocks


def _description(blocks: list[Block], facet: int) -> str:
    """Return a description of a facet with its number, element type and position."""
    for block in blocks:
        if facet < len(block.nodes):
            break
        facet -= len(block.nodes)
    middle = block.corners[facet, : block.element.n_corners].mean(axis=0)
    position = ", ".join(f"{x:.6g}" for x in middle)
    return f"facet {block.numbers[facet]} ({block.element.name} near ({position}))"


def _neighbours(blocks: list[Block], group: str) -> Indices:
    """Return the facet beyond each ridge (n_facets, most ridges), -1 where the surface ends.

    Raises ContactError, which names a facet, if the surface branches or neighbours have opposite orientations.
    """
    facet, ridge, key, sign = _ridge_table(blocks)
    order = np.argsort(key, kind="stable")
    facet, ridge, key, sign = facet[order], ridge[order], key[order], sign[order]
    first = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
    count = np.diff(np.r_[first, len(key)])
    if (count > 2).any():
        branch = facet[first[np.argmax(count > 2)]]
        raise ContactError(
            f"{_description(blocks, branch)} of the rigid surface '{group}' shares an edge with more than one other facet: a "
            "surface must not branch, so split it into several groups"
        )
    shared = first[count == 2]
    beyond = np.full((sum(len(block.nodes) for block in blocks), ridge.max() + 1), -1, np.intp)
    beyond[facet[shared], ridge[shared]] = facet[shared + 1]
    beyond[facet[shared + 1], ridge[shared + 1]] = facet[shared]
    _check_orientation(blocks, group, facet[shared], facet[shared + 1], sign[shared] != sign[shared + 1])
    return beyond


def _ridge_table(blocks: list[Block]) -> tuple[Indices, Indices, Indices, Indices]:
    """Return, for all ridges, the facet, the number in the facet, a key of the nodes, and the orientation in the facet."""
    facets, ridges, keys, signs, start = [], [], [], [], 0
    size = 1 + max(int(block.nodes.max()) for block in blocks)
    for block in blocks:
        a, b = block.ridges()
        facets.append(np.repeat(start + np.arange(len(a)), a.shape[1]))
        ridges.append(np.tile(np.arange(a.shape[1]), len(a)))
        keys.append((np.minimum(a, b) * size + np.maximum(a, b)).ravel())
        signs.append((np.broadcast_to([1, -1], a.shape) if block.element.dim == 1 else np.sign(b - a)).ravel())
        start += len(a)
    return np.concatenate(facets), np.concatenate(ridges), np.concatenate(keys), np.concatenate(signs)


def _check_orientation(blocks: list[Block], group: str, first: Indices, second: Indices, consistent: Mask) -> None:
    """Raise ContactError if neighbours have opposite orientations; the message names a facet of the smaller part."""
    if consistent.all():
        return
    n = sum(len(block.nodes) for block in blocks)
    graph = coo_array((np.ones(consistent.sum()), (first[consistent], second[consistent])), shape=(n, n))
    _, component = connected_components(graph, directed=False)
    size = np.bincount(component)
    wrong = int(np.flatnonzero(~consistent)[0])
    pair = sorted((int(first[wrong]), int(second[wrong])), key=lambda facet: (size[component[facet]], facet))
    numbers = np.concatenate([block.numbers for block in blocks])
    raise ContactError(
        f"{_description(blocks, pair[0])} of the rigid surface '{group}' has the opposite orientation to its neighbour facet "
        f"{numbers[pair[1]]}: reverse it, so that all normals point out of the obstacle"
    )


def _smooth_normals(
    blocks: list[Block], by_block: list[tuple[Array, Array]], crease: float
) -> tuple[list[Array], Array]:
    """Return the smooth normals of facets and those of points, from the normals and angles of single facets."""
    dim = by_block[0][0].shape[2]
    node = np.concatenate([block.nodes.ravel() for block in blocks])
    normal = np.concatenate([normals.reshape(-1, dim) for normals, _ in by_block])
    weight = np.concatenate([angle.ravel() for _, angle in by_block])
    at_points = np.zeros((node.max() + 1, dim))
    np.add.at(at_points, node, weight[:, None] * normal)
    incidence = csr_array((np.ones(len(node)), node, np.arange(len(node) + 1)))
    pairs = incidence @ incidence.T  # pairs of facets at a common node
    pairs.sort_indices()
    i, j = pairs.nonzero()
    is_smooth = np.einsum("nd,nd->n", normal[i], normal[j]) >= np.cos(np.radians(crease)) - LENGTH_ROUND_OFF
    is_smooth |= i == j
    mean = np.zeros_like(normal)
    np.add.at(mean, i[is_smooth], weight[j[is_smooth], None] * normal[j[is_smooth]])
    mean /= np.linalg.norm(mean, axis=1, keepdims=True)
    ends = np.cumsum([block.nodes.size for block in blocks])[:-1]
    means = np.split(mean, ends)
    return [values.reshape(*block.nodes.shape, dim) for values, block in zip(means, blocks, strict=True)], at_points
