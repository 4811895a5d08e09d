"""Cuts of meshes along groups of internal facets, for example at the pretension section of a bolt."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.argument_types import typed, unit_vector
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import OPPOSITE, Mesh

# Largest number of nodes of a facet.
MAX_NODES = 9


@typed(MeshError)
def cut(mesh: Mesh, group: str, normal: Sequence[float] | None = None) -> Mesh:
    """Return the mesh cut along a group of facets, with separate nodes at the same positions on the two sides.

    Parameters
    ----------
    mesh : Mesh
    group : str
        Group of facets between solid cells. The facets must divide a body completely, so that the edge of the cut lies on
        the surface of the body.
    normal : sequence of float (dim,), optional
        Direction from the cut to the side whose cells receive the new nodes [-]; by default the normal of the plane
        fitted to the facets, oriented such that its largest component is positive.

    Returns
    -------
    Mesh
        `group` contains the facets with the existing nodes, ``"<group> opposite"`` those with the new nodes, in the same
        order. New nodes belong to the point groups of the existing nodes at the same positions. Other facets have the
        nodes of their solid cells.

    Raises
    ------
    MeshError
        If the group of facets does not exist, a facet does not lie between two solid cells, or the cut ends inside a body.

    Examples
    --------
    >>> from fastcontact.mesh.generate import box
    >>> bar = box((1.0, 1.0, 2.0), (1, 1, 2))
    >>> bar = bar.with_facet_group("CUT", lambda x: abs(x[:, 2] - 1.0) < 1e-9, between=True)
    >>> cut(bar, "CUT").n_points - bar.n_points
    4
    """
    facets = {name: block for name, block in mesh.cells_of(group).items() if elements.get(name).dim == mesh.dim - 1}
    if not facets:
        raise MeshError(f"group '{group}' contains no facets, so nothing can be cut along it")
    points = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    new_node = np.full(mesh.n_points, -1, np.int32)
    new_node[points] = mesh.n_points + np.arange(len(points), dtype=np.int32)
    sides = _sides_at(mesh, new_node >= 0)
    beyond_cut = _cells_beyond(mesh, group, sides, new_node >= 0, _direction(mesh, group, points, normal))
    cells = {}
    for name, start in mesh.offsets.items():
        block = mesh.cells[name]
        is_new = beyond_cut[start : start + len(block), None] & (new_node[block] >= 0)
        cells[name] = np.where(is_new, new_node[block], block)
    on_cut = {name: members[new_node[members] >= 0] for name, members in mesh.point_groups.items()}
    point_groups = {name: np.append(members, new_node[on_cut[name]]) for name, members in mesh.point_groups.items()}
    positions = np.concatenate([mesh.points, mesh.points[points]])
    cut_mesh = mesh.replace(points=positions, cells=cells, point_groups=point_groups)
    return cut_mesh.with_facets({group + OPPOSITE: {name: new_node[block] for name, block in facets.items()}})


def _direction(mesh: Mesh, group: str, points: Numbers, normal: Sequence[float] | None) -> Array:
    """Return the unit normal (dim,) of a section, by default that of the plane fitted to its points."""
    if normal is not None:
        return unit_vector("normal", normal, f"section '{group}'", mesh.dim, MeshError)
    positions = mesh.points[points] - mesh.points[points].mean(axis=0)
    fitted = np.linalg.svd(positions, full_matrices=True)[2][-1]
    return np.asarray(fitted * np.sign(fitted[np.argmax(np.abs(fitted))]))


class _Sides(NamedTuple):
    """Facets of the mesh and sides of its solid cells, each with the number of its cell and the row of its nodes."""

    cell: Indices
    is_facet: Mask
    row: Indices
    nodes: Indices  # distinct sets of nodes in ascending order, filled with -1 (n_rows, MAX_NODES)


def _sides_at(mesh: Mesh, marked: Mask) -> _Sides:
    """Return the facets with a marked point, and all sides of the solid cells with a marked point."""
    nodes, cell, is_facet = [], [], []
    for name, block in {**mesh.solids, **mesh.facets}.items():
        element, rows = elements.get(name), np.flatnonzero(marked[block].any(axis=1))
        for side in element.facets if element.dim == mesh.dim else [range(element.n_nodes)]:
            sets = np.sort(block[rows][:, list(side)], axis=1)
            nodes.append(np.pad(sets, ((0, 0), (0, MAX_NODES - len(side))), constant_values=-1))
            cell.append(mesh.offsets[name] + rows)
            is_facet.append(np.full(len(rows), element.dim < mesh.dim))
    distinct, row = np.unique(np.concatenate(nodes), axis=0, return_inverse=True)
    return _Sides(np.concatenate(cell), np.concatenate(is_facet), row.ravel(), distinct.astype(np.intp))


def _cells_beyond(mesh: Mesh, group: str, sides: _Sides, marked: Mask, direction: Array) -> Mask:
    """Return the mask (n_cells,) of cells that get new nodes: solids beyond the section, and their facets outside it."""
    solid, row = sides.cell[~sides.is_facet], sides.row[~sides.is_facet]
    section = np.unique(sides.row[sides.is_facet & np.isin(sides.cell, mesh.cell_groups[group])])
    order, count = np.argsort(row, kind="stable"), np.bincount(row, minlength=len(sides.nodes))
    n_invalid = int((count[section] != 2).sum())
    if n_invalid:
        raise MeshError(
            f"facets of '{group}' do not lie between two solids that share their nodes (number: {n_invalid} of "
            f"{len(section)}): a cut needs facets inside a body"
        )
    pairs = solid[order[(np.cumsum(count) - count)[count == 2][:, None] + [0, 1]]]
    divided = np.isin(np.flatnonzero(count == 2), section)
    graph = coo_array((np.ones((~divided).sum()), tuple(pairs[~divided].T)), shape=(mesh.n_cells, mesh.n_cells))
    part = connected_components(graph, directed=False)[1]
    height, above = _heights(mesh, marked, direction)
    ends = np.take_along_axis(pairs[divided], np.argsort(height[pairs[divided]], axis=1, kind="stable"), axis=1)
    below, beyond = part[ends].T
    mixed = np.flatnonzero(np.isin(below, beyond) | np.isin(beyond, below))
    if len(mixed):
        nodes = sides.nodes[section[mixed[0]]]
        raise MeshError(
            f"the facets of '{group}' do not divide the body: the cells on both sides are still connected (near "
            f"{mesh.points[nodes[nodes >= 0]].mean(axis=0)}); extend the group to the surface of the body, with a normal "
            f"across it (now {direction})"
        )
    # A part that has no facet in the section touches the section only at edges or nodes.
    beyond_cut = np.isin(part, beyond) | (~np.isin(part, below) & (above > 0.0))
    outer = sides.is_facet & np.isin(sides.row, row[beyond_cut[solid]]) & ~np.isin(sides.row, section)
    beyond_cut[sides.cell[outer]] = True
    return beyond_cut


def _heights(mesh: Mesh, marked: Mask, direction: Array) -> Array:
    """Return the positions of the centres of solid cells along `direction` (2, n_cells) [length].

    The first row contains the positions, the second row their differences from the mean position of the marked points of the
    cell. Values are zero for other cells and, in the second row, for cells without a marked point.
    """
    heights = np.zeros((2, mesh.n_cells))
    for name, block in mesh.solids.items():
        positions, is_marked = mesh.points[block] @ direction, marked[block]
        cells = slice(mesh.offsets[name], mesh.offsets[name] + len(block))
        heights[0, cells] = positions.mean(axis=1)
        marked_mean = (positions * is_marked).sum(axis=1) / np.maximum(is_marked.sum(axis=1), 1)
        heights[1, cells] = np.where(is_marked.any(axis=1), heights[0, cells] - marked_mean, 0.0)
    return heights
