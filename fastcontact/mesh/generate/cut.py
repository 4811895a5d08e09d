"""Cuts of meshes along groups of internal facets, for example at the pretension section of a bolt."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import OPPOSITE, Mesh

Facet = frozenset[int]


@typed(MeshError)
def cut(mesh: Mesh, group: str, normal: Sequence[float] | None = None) -> Mesh:
    """Return the mesh cut along a group of facets, with separate nodes at the same positions on the two sides.

    Parameters
    ----------
    mesh : Mesh
    group : str
        Group of facets between solid cells. They must divide a body completely, so that the edge of the cut lies on the
        surface of the body.
    normal : sequence of float (dim,), optional
        Direction from the cut to the side whose cells get the new nodes [-]; by default the normal of the plane fitted to
        the facets, oriented such that its largest component is positive.

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
    section = _as_sets(facets)
    points = np.unique(np.concatenate([block.ravel() for block in facets.values()]))
    direction = _direction(mesh, group, points, normal)
    beyond = _cells_beyond(mesh, group, section, points, direction)
    new_node = np.full(mesh.n_points, -1, np.int32)
    new_node[points] = mesh.n_points + np.arange(len(points), dtype=np.int32)
    return _opened(mesh, group, facets, beyond, new_node)


def _direction(mesh: Mesh, group: str, points: Numbers, normal: Sequence[float] | None) -> Array:
    """Return the unit normal (dim,) of a section, by default that of the plane fitted to its points."""
    if normal is None:
        positions = mesh.points[points] - mesh.points[points].mean(axis=0)
        fitted = np.linalg.svd(positions, full_matrices=True)[2][-1]
        return np.asarray(fitted * np.sign(fitted[np.argmax(np.abs(fitted))]))
    vector = np.asarray(normal, float)
    length = np.linalg.norm(vector)
    if vector.shape != (mesh.dim,) or not (np.isfinite(length) and length > 0):
        raise MeshError(f"the normal {normal} of section '{group}' must be {mesh.dim} numbers, not all zero")
    return np.asarray(vector / length)


def _as_sets(facets: dict[str, Numbers]) -> set[Facet]:
    """Return the sets of nodes of all facets."""
    return {frozenset(facet) for block in facets.values() for facet in block.tolist()}


def _facets_at(mesh: Mesh, touched: Mask) -> Iterator[tuple[str, int, Facet]]:
    """Yield the element type, the row of the cell and the nodes of all facets of solid cells with a marked point."""
    for name, block in mesh.solids.items():
        rows = np.flatnonzero(touched[block].any(axis=1))
        for facet in elements.get(name).facets:
            for row, nodes in zip(rows.tolist(), block[rows][:, list(facet)].tolist(), strict=True):
                yield name, row, frozenset(nodes)


def _cells_beyond(
    mesh: Mesh, group: str, section: set[Facet], points: Numbers, direction: Array
) -> dict[str, list[int]]:
    """Return the rows of the solid cells at a section on the side to which `direction` points, by element type."""
    touched = np.zeros(mesh.n_points, bool)
    touched[points] = True
    number: dict[tuple[str, int], int] = {}
    owners: dict[Facet, list[int]] = {}
    for name, row, facet in _facets_at(mesh, touched):
        owners.setdefault(facet, []).append(number.setdefault((name, row), len(number)))
    n_invalid = sum(len(owners.get(facet, ())) != 2 for facet in section)
    if n_invalid:
        raise MeshError(
            f"{n_invalid} of {len(section)} facets of '{group}' do not lie between two solids that share their nodes: a cut "
            "needs facets inside a body"
        )
    pairs = np.array([pair for facet, pair in owners.items() if len(pair) == 2 and facet not in section], int)
    pairs = pairs.reshape(-1, 2)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(number), len(number)))
    component = connected_components(graph, directed=False)[1]
    centres = np.array([mesh.points[mesh.cells[name][row]].mean(axis=0) for name, row in number])
    beyond = _parts_beyond(mesh, group, {facet: owners[facet] for facet in section}, component, centres, direction)
    cells: dict[str, list[int]] = {}
    for (name, row), part, centre in zip(number, component, centres, strict=True):
        nodes = mesh.cells[name][row]
        # A part without a facet in the section touches it only at edges or nodes.
        touching = mesh.points[nodes[touched[nodes]]].mean(axis=0)
        if beyond.get(int(part), bool((centre - touching) @ direction > 0)):
            cells.setdefault(name, []).append(row)
    return cells


def _parts_beyond(
    mesh: Mesh, group: str, owners: dict[Facet, list[int]], component: Numbers, centres: Array, direction: Array
) -> dict[int, bool]:
    """Return for each connected part of the cells with facets in a section whether it lies on the side of `direction`.

    `owners` are the two cells of each facet of the section. Raises MeshError if a part lies on both sides.
    """
    is_beyond: dict[int, bool] = {}
    for facet, pair in owners.items():
        lower, upper = sorted(pair, key=lambda cell: float(centres[cell] @ direction))
        for part, beyond in ((int(component[lower]), False), (int(component[upper]), True)):
            if is_beyond.setdefault(part, beyond) != beyond:
                position = mesh.points[list(facet)].mean(axis=0)
                raise MeshError(
                    f"the facets of '{group}' do not divide the body: the cells on both sides are still connected (near "
                    f"{position}); extend the group to the surface of the body, with a normal across it (now {direction})"
                )
    return is_beyond


def _opened(
    mesh: Mesh, group: str, facets: dict[str, Numbers], beyond: dict[str, list[int]], new_node: Numbers
) -> Mesh:
    """Return the mesh in which the cells `beyond` the section, given by their rows, have new nodes.

    `new_node` (n_points,) is the number of the new node of each point, and -1 for points that do not lie in the section.
    """
    cells = {name: np.array(block) for name, block in mesh.cells.items()}
    moved = [_with_nodes(cells, name, np.array(rows), new_node) for name, rows in beyond.items()]
    outer = {facet for sides in moved for facet in sides} - _as_sets(facets)
    for name, block in mesh.facets.items():
        rows = np.flatnonzero((new_node[block] >= 0).any(axis=1))
        of_moved = [row for row in rows.tolist() if frozenset(block[row].tolist()) in outer]
        _with_nodes(cells, name, np.array(of_moved, int), new_node)
    old = np.flatnonzero(new_node >= 0)
    point_groups = {
        name: np.concatenate([members, new_node[members[new_node[members] >= 0]]])
        for name, members in mesh.point_groups.items()
    }
    points = np.concatenate([mesh.points, mesh.points[old]])
    opened = mesh.replace(points=points, cells=cells, point_groups=point_groups)
    return opened.with_facets({group + OPPOSITE: {name: new_node[block] for name, block in facets.items()}})


def _with_nodes(cells: dict[str, Numbers], name: str, rows: Indices, new_node: Numbers) -> list[Facet]:
    """Replace the nodes of some cells by new nodes, in place, and return the facets that the cells had before."""
    if not len(rows):
        return []
    block = cells[name][rows]
    sides = [frozenset(block[i, list(f)].tolist()) for f in elements.get(name).facets for i in range(len(rows))]
    cells[name][rows] = np.where(new_node[block] >= 0, new_node[block], block)
    return sides
