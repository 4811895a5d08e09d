"""Connectivity of a mesh: outer facets, bodies and their rigid parts, orientation of cells, and nodes along a line.

A body consists of rigid parts if some of its cells are connected only by hinges, that is by a single node or, in 3D, by nodes
on one line, about which they can rotate relative to each other. Cells with a common facet belong to one part, and so do parts
with two common nodes in 2D, or with three common nodes that are not collinear in 3D. Other common nodes of parts are hinges.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import wraps
from types import MappingProxyType
from typing import Concatenate, ParamSpec, TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import breadth_first_order, connected_components

from fastcontact._tools.argument_types import typed
from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.errors import FastcontactError, MeshError
from fastcontact.mesh import elements, quadrature
from fastcontact.mesh.flat_pieces import flat_pieces
from fastcontact.mesh.mesh import Mesh, facets_of_cells, vector_text

Result = TypeVar("Result")
Arguments = ParamSpec("Arguments")
MeshFunction = Callable[Concatenate[Mesh, Arguments], Result]
# Distance, relative to the size of the mesh, below which nodes are regarded as coincident or collinear.
COLLINEAR = 1e-6


def corner_measures(mesh: Mesh, name: str) -> Array:
    """Return the signed area [length^2] or volume [length^3] (n_cells,) of the cells of one type, with straight edges.

    Faces with four corners are bilinear. The quadrature of the linear element is exact for this measure.
    """
    linear = elements.get(elements.get(name).linear)
    _, gradients, weights = linear.tables
    return weights @ quadrature.jacobian_determinants(mesh.points[mesh.cells[name][:, : linear.n_nodes]], gradients)


@typed(MeshError)
def oriented(mesh: Mesh) -> tuple[Mesh, int]:
    """Return the mesh with all solid cells oriented positively, and the number of reoriented cells.

    The nodes of 2D cells are then ordered counter-clockwise, and the normals of the facets of 3D cells point outward. Raises
    MeshError if an inverted cell lies on the same side of a facet as its neighbour, because the mesh is folded there.
    """
    cells, count = dict(mesh.cells), 0
    for name in mesh.solids:
        inverted = corner_measures(mesh, name) < 0
        if inverted.any():
            block = mesh.cells[name].copy()
            block[inverted] = block[inverted][:, elements.get(name).reversed]
            cells[name] = block
            count += int(inverted.sum())
    if not count:
        return mesh, 0
    mesh = mesh.replace(cells=cells)
    _check_folds(mesh)
    return mesh, count


def _check_folds(mesh: Mesh) -> None:
    """Raise MeshError if two oriented solid cells have a common facet with the same orientation."""
    facet_keys, owners = [], []
    for kind, (nodes, numbers) in facets_of_cells(mesh).items():
        facet_keys.append(_oriented_keys(nodes[:, : elements.get(kind).n_corners].astype(np.int64)))
        owners.append(numbers)
    keys, owner = np.concatenate(facet_keys), np.concatenate(owners)
    first_rows, second_rows = equal_rows(keys)
    if len(first_rows):
        first, second = sorted((int(owner[first_rows[0]]), int(owner[second_rows[0]])))
        position = vector_text(mesh.points[keys[first_rows[0]][:2]].mean(axis=0))
        raise MeshError(
            f"cells {first} and {second} lie on the same side of the facet between them, near {position}, one of "
            f"{len(first_rows)} such pairs: the mesh is folded there; move its nodes or remesh"
        )


def _oriented_keys(facets: Indices) -> Indices:
    """Return three numbers (n, 3) that identify each of the facets (n, n_corners) and its orientation.

    They are the lowest of its node numbers, the following node and the preceding node. For a line the third number is the
    local number of the lowest node.
    """
    first = facets.argmin(axis=1)
    rows, count = np.arange(len(facets)), facets.shape[1]
    following, preceding = (facets[rows, (first + k) % count] for k in (1, -1))
    return np.column_stack([facets[rows, first], following, preceding if count > 2 else first])


def cached_by_mesh(function: MeshFunction[Arguments, Result]) -> MeshFunction[Arguments, Result]:
    """Decorate `function` such that its results are cached by mesh, which is immutable, and by the other arguments."""
    results: WeakKeyDictionary[Mesh, dict[tuple[object, ...], Result]] = WeakKeyDictionary()

    @wraps(function)
    def cached_by_mesh(mesh: Mesh, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Result:
        results_of_mesh, key = results.setdefault(mesh, {}), (*args, *kwargs.items())
        if key not in results_of_mesh:
            results_of_mesh[key] = function(mesh, *args, **kwargs)
        return results_of_mesh[key]

    return cached_by_mesh


def points_of_solids(mesh: Mesh) -> Indices:
    """Return the numbers (n,) of the points with a solid cell, in ascending order; reference points have none."""
    return np.unique(np.concatenate([np.empty(0, np.intp), *(block.ravel() for block in mesh.solids.values())]))


@typed(MeshError)
@cached_by_mesh
def bodies(mesh: Mesh) -> tuple[int, Numbers]:
    """Return the number of bodies and the body (n_points,) to which each point belongs, -1 for points without a solid cell.

    A body is a set of solid cells that are connected by common nodes.
    """
    blocks, empty = mesh.solids.values(), np.empty(0, np.int32)
    row = np.concatenate([empty, *(np.repeat(block[:, 0], block.shape[1]) for block in blocks)])
    column = np.concatenate([empty, *(block.ravel() for block in blocks)])
    graph = coo_array((np.ones(len(row), np.int8), (row, column)), shape=(mesh.n_points, mesh.n_points))
    label, body = connected_components(graph, directed=False)[1], np.full(mesh.n_points, -1, np.int32)
    in_solid = np.bincount(column, minlength=mesh.n_points) > 0
    labels, body[in_solid] = np.unique(label[in_solid], return_inverse=True)
    body.setflags(write=False)
    return len(labels), body


@typed(MeshError)
def outer_facets(mesh: Mesh) -> Mapping[str, Numbers]:
    """Return the facets (n_facets, n_nodes) that belong to exactly one solid cell, by element type of the facet.

    Their nodes are ordered such that normals point outward.
    """
    return _facets(mesh)[0]


@typed(MeshError)
def cells_joined_by_facets(mesh: Mesh) -> Numbers:
    """Return for each cell (n_cells,) the lowest number of a cell that is connected with it by a chain of common facets.

    For cells that are not solid cells it is the number of the cell itself.
    """
    return _facets(mesh)[1]


@typed(MeshError)
def cells_of_outer_facets(mesh: Mesh) -> Mapping[str, Numbers]:
    """Return the number (n_facets,) of the solid cell of each of the `outer_facets`, by element type of the facet."""
    return _facets(mesh)[2]


@cached_by_mesh
def _facets(mesh: Mesh) -> tuple[Mapping[str, Numbers], Numbers, Mapping[str, Numbers]]:
    """Return `outer_facets`, `cells_joined_by_facets` and `cells_of_outer_facets`."""
    outer, cell_numbers, pairs = {}, {}, [np.empty((2, 0), np.int32)]
    for name, (facets, owner) in facets_of_cells(mesh).items():
        pair_rows = np.stack(equal_rows(np.sort(facets, axis=1)))
        single = np.ones(len(facets), bool)
        single[pair_rows] = False
        pairs.append(owner[pair_rows])
        if single.any():
            outer[name], cell_numbers[name] = facets[single], owner[single]
            outer[name].setflags(write=False)
    ends, n_cells = np.concatenate(pairs, axis=1), sum(map(len, mesh.cells.values()))
    graph = coo_array((np.ones(ends.shape[1], np.int8), tuple(ends)), shape=(n_cells, n_cells))
    label = connected_components(graph, directed=False)[1]
    lowest = np.unique(label, return_index=True)[1].astype(np.int32)
    return MappingProxyType(outer), lowest[label], MappingProxyType(cell_numbers)


def equal_rows(rows: Indices | Numbers) -> tuple[Indices, Indices]:
    """Return pairs (n_pairs,), (n_pairs,) of equal `rows` (n, k); m equal rows are connected by m - 1 pairs."""
    columns = np.ascontiguousarray(rows.T)  # long columns are compared faster than short rows
    order = np.lexsort(columns)
    columns = columns[:, order]
    is_same = (columns[:, 1:] == columns[:, :-1]).all(axis=0)
    return order[:-1][is_same], order[1:][is_same]


def same_facets(table: Numbers, facets: Numbers) -> Indices:
    """Return the row (n,) in `table` (m, k) of the facet with the same nodes as each of the `facets` (n, k).

    The row is -1 if there is no such facet.
    """
    candidates = np.flatnonzero(np.isin(table, facets).all(axis=1))
    keys = np.sort(np.vstack([table[candidates], facets]), axis=1)
    _, first, index = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return np.append(candidates, -1)[np.minimum(first[index.ravel()[len(candidates) :]], len(candidates))]


def outer_rows(
    mesh: Mesh, group: str, name: str, facets: Numbers, error: type[FastcontactError], remedy: str
) -> Indices:
    """Return the rows (n,) of `facets` (n, k) of one element type, those of a `group`, among the `outer_facets`.

    Raises `error` with a `remedy` if a facet is not an outer facet.
    """
    rows = same_facets(outer_facets(mesh).get(name, facets[:0]), facets)
    missing = np.flatnonzero(rows < 0)
    if len(missing):
        position = mesh.points[facets[missing[0]]].mean(axis=0)
        n_corners = elements.get(name).n_corners
        for kind, outer in outer_facets(mesh).items():
            is_other_order = kind != name and elements.get(kind).n_corners == n_corners
            if is_other_order and (same_facets(outer[:, :n_corners], facets[missing, :n_corners]) >= 0).all():
                raise error(
                    f"facets of '{group}' are of type {name}, but those of the cells there are of type {kind}, first near "
                    f"{position}: export both with the same order, or define the group by Mesh.with_facet_group"
                )
        raise error(
            f"facets of '{group}' do not lie on the outside of a solid (number: {len(missing)} of {len(facets)}, first near "
            f"{position}){remedy}"
        )
    return rows


@dataclass(frozen=True, eq=False)
class OrderedLine:
    """The nodes of a line of facets in their order along the line.

    Attributes
    ----------
    points : ndarray of int (m,)
        Point numbers of the nodes, beginning at the start of the line.
    abscissa : ndarray (m,)
        Distance from the start along the straight segments between consecutive nodes [length].
    """

    points: Numbers
    abscissa: Array


@typed(MeshError)
def ordered_line(mesh: Mesh, group: str, start: str | int | None = None) -> OrderedLine:
    """Return the nodes of a line group in order with their abscissae, like NOEUD_ORDO and ABSC_CURV of code_aster.

    Parameters
    ----------
    mesh : Mesh
    group : str
        Group of line cells that form a single open line.
    start : str or int, optional
        End at which the line starts: the name of a group with one point, or the number of a point; by default the end
        nearest to x = 0.

    Returns
    -------
    OrderedLine

    Raises
    ------
    MeshError
        If the group contains no lines, has branches, is closed or not connected, or `start` is not one of its ends.

    Examples
    --------
    >>> import fastcontact as fc
    >>> mesh = fc.generate.half_spheres(size=2.0)
    >>> line = fc.ordered_line(mesh, "CONT1", start="C1")
    >>> bool(line.points[0] == mesh.point("C1"))
    True
    >>> round(float(line.abscissa[-1]) / 50.0, 3)  # an eighth of a circle, pi / 4
    0.785
    """
    blocks = mesh.cells_of(group, dim=1)
    if not blocks:
        raise MeshError(f"group '{group}' contains no line cells, so its nodes have no order along a line")
    segments = np.concatenate([b[:, flat_pieces(b.shape[1], dim=2)].reshape(-1, 2) for b in blocks.values()])
    nodes, local = np.unique(segments, return_inverse=True)
    local = local.reshape(segments.shape)
    degree = np.bincount(local.ravel(), minlength=len(nodes))
    ends = np.flatnonzero(degree == 1)
    if len(ends) != 2 or degree.max() > 2:
        raise MeshError(f"group '{group}' is not one open line: it has {len(ends)} ends, not 2")
    number = mesh.point(start) if isinstance(start, str) else start
    if number is None:
        number = nodes[ends[np.argmin(np.abs(mesh.points[nodes[ends], 0]))]]
    if number not in nodes[ends]:
        first, last = nodes[ends]
        raise MeshError(f"point {number} is not an end of '{group}': its ends are {first}, {last}")
    first = ends[nodes[ends] == number][0]
    graph = coo_array((np.ones(len(local), np.int8), tuple(local.T)), shape=(len(nodes), len(nodes)))
    order = breadth_first_order(graph, int(first), directed=False, return_predecessors=False)
    if len(order) != len(nodes):
        raise MeshError(f"group '{group}' is in pieces: only {len(order)} of its {len(nodes)} nodes are connected")
    points = nodes[order].astype(np.int32)
    lengths = np.linalg.norm(np.diff(mesh.points[points], axis=0), axis=1)
    return OrderedLine(points, np.concatenate([[0.0], np.cumsum(lengths)]))


@record
class RigidParts:
    """The rigid parts of bodies, and the hinges between them.

    Attributes
    ----------
    count : int
        Number of parts, which is the number of bodies if there are no hinges.
    part : ndarray of int (n_points,)
        Number of the part of each point, the lowest one if it belongs to several; -1 for points without a solid cell.
    hinge_node, hinge_part : ndarray of int (k,)
        Pairs of a node at a hinge and a part to which it belongs, in ascending order of the nodes.
    """

    count: int
    part: Indices
    hinge_node: Indices
    hinge_part: Indices

    def hinges_of(self, number: int) -> Indices:
        """Return the numbers (k,) of int of the nodes at which a part is connected to other parts, in ascending order."""
        return self.hinge_node[self.hinge_part == number]

    def nodes_of(self, number: int) -> Indices:
        """Return the numbers (k,) of int of all nodes of a part, including those at hinges, in ascending order."""
        nodes, hinges = np.flatnonzero(self.part == number), self.hinges_of(number)
        return np.union1d(nodes, hinges) if len(hinges) else nodes


@cached_by_mesh
def rigid_parts(mesh: Mesh) -> RigidParts:
    """Return the rigid parts of the bodies of a mesh."""
    count, body = bodies(mesh)
    lowest_cell = cells_joined_by_facets(mesh)
    roots = {name: lowest_cell[mesh.offsets[name] :][: len(block)] for name, block in mesh.solids.items()}
    first, label = np.unique(np.concatenate(list(roots.values())), return_inverse=True)
    if len(first) == count:
        empty = np.empty(0, np.intp)
        return RigidParts(count, body.astype(np.intp), empty, empty)
    part, node, part_of_node = _shared_nodes(mesh, label.ravel())
    while True:
        first, second, common = _common_nodes(node, part_of_node)
        is_rigid = _rigidly_connected(mesh.points, first, second, common)
        if not is_rigid.any():
            break
        count = int(max(part.max(), part_of_node.max())) + 1
        ends = first[is_rigid], second[is_rigid]
        graph = coo_array((np.ones(len(ends[0]), np.int8), ends), shape=(count, count))
        _, new_part = connected_components(graph, directed=False)
        part = np.where(part >= 0, new_part[part], -1)
        node, part_of_node = np.unique(np.stack([node, new_part[part_of_node]]), axis=1)
    hinges = np.isin(node, common)
    return RigidParts(int(part.max()) + 1, part, node[hinges], part_of_node[hinges])


def _shared_nodes(mesh: Mesh, label: Indices) -> tuple[Indices, Indices, Indices]:
    """Return the lowest part (n_points,) of each point, and the nodes (k,) shared by parts with each of their parts (k,).

    `label` (n_solids,) contains the part of each solid cell. The part of points without a solid cell is -1.
    """
    nodes = np.concatenate([block.ravel() for block in mesh.solids.values()])
    sizes = np.concatenate([np.full(len(block), block.shape[1]) for block in mesh.solids.values()])
    n_parts = int(label.max()) + 1
    node, part_of_node = np.divmod(np.unique(nodes.astype(np.intp) * n_parts + np.repeat(label, sizes)), n_parts)
    first, part = np.unique(node, return_index=True)[1], np.full(mesh.n_points, -1, np.intp)
    part[node[first]] = part_of_node[first]
    shared = np.bincount(node)[node] > 1
    return part, node[shared], part_of_node[shared]


def _common_nodes(node: Indices, part: Indices) -> tuple[Indices, Indices, Indices]:
    """Return the pairs of parts (m,), (m,) that share a node, and this node (m,), once for each shared node.

    `node` and `part` contain a pair for each part of each node, in ascending order of the nodes.
    """
    pairs = [np.empty((3, 0), np.intp)]
    shift = 1
    while len(rows := np.flatnonzero(node[shift:] == node[:-shift])):
        pairs.append(np.stack([part[rows], part[rows + shift], node[rows]]))
        shift += 1
    first, second, common = np.concatenate(pairs, axis=1)
    return first, second, common


def _rigidly_connected(points: Array, first: Indices, second: Indices, common: Indices) -> Mask:
    """Return the mask (m,) of pairs of parts with a common node that their common nodes connect rigidly."""
    if not len(common):
        return np.empty(0, bool)
    _, pair, count = np.unique(np.stack([first, second]), axis=1, return_inverse=True, return_counts=True)
    pair, dim = pair.ravel(), points.shape[1]
    mean = np.column_stack([np.bincount(pair, points[common, d]) for d in range(dim)]) / count[:, None]
    arms = points[common] - mean[pair]
    moments = np.stack([[np.bincount(pair, arms[:, i] * arms[:, j]) for j in range(dim)] for i in range(dim)])
    # To prevent a relative rotation, the common nodes must extend in one direction in 2D, and in two directions in 3D.
    second_moment = np.linalg.eigvalsh(np.moveaxis(moments, 2, 0))[:, 1]
    return np.asarray((second_moment > (COLLINEAR * np.ptp(points, axis=0).max()) ** 2)[pair])
