"""Uniform refinement of 2D meshes, with new nodes on exact curves of the boundary, and detection of circles on it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import AnyArray, Array, Indices
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate.forest import RED
from fastcontact.mesh.generate.quadratic import ON_CURVE, Circle, Curve, all_on, facets_of
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells

# Quadratic elements whose nodes are the corners of the children in `RED`. Each child has the orientation of its parent.
_LATTICE = {"line2": "line3", "tri3": "tri6", "quad4": "quad9"}
# Largest angle that a facet of a circle may subtend [radian]. Nodes at larger distances are regarded as those of a polygon.
_TURN = np.pi / 5


@dataclass(frozen=True, eq=False)
class _Pattern:
    """The division of a cell of one element type, described by the points of its children.

    The first n_nodes points are the nodes of the parent. `shape` (m, n_nodes) [-] contains the shape functions of the
    parent at the points, and `children` (n_children, n_nodes) the points of each child. `on_edge` (m,) is the number of the
    edge of the parent on which a new point lies, -1 for other points, and `quarters` (m,) its distance from the start of this
    edge in quarters of the length.
    """

    shape: Array
    children: AnyArray
    on_edge: AnyArray
    quarters: AnyArray


@cache
def _pattern(name: str) -> _Pattern:
    """Return the division of the cells of an element type. Raises MeshError if there is none."""
    element = elements.get(name)
    if element.linear not in _LATTICE:
        raise MeshError(f"cells of {name} cannot be refined: only lines, triangles and quadrangles are divided here")
    points = [tuple(node) for node in element.nodes.tolist()]
    children = []
    for corners in elements.get(_LATTICE[element.linear]).nodes[RED[element.linear]]:
        child_nodes = element.corner_shape(element.nodes) @ corners
        child = []
        for eighths in np.round(child_nodes * 8.0).tolist():  # multiples of 1/8 are exact
            node = tuple(x / 8.0 for x in eighths)
            if node not in points:
                points.append(node)
            child.append(points.index(node))
        children.append(child)
    lattice = np.array(points)
    on_edge, quarters = np.full(len(points), -1), np.zeros(len(points), int)
    for number, (a, b) in enumerate(element.edges):
        start, edge = element.nodes[a], element.nodes[b] - element.nodes[a]
        fraction = (lattice - start) @ edge / (edge @ edge)
        new = np.abs(lattice - start - fraction[:, None] * edge).max(axis=1) < 1e-12
        new[: element.n_nodes] = False
        on_edge[new], quarters[new] = number, np.round(4 * fraction[new]).astype(int)
    return _Pattern(element.shape(lattice), np.array(children), on_edge, quarters)


@typed(MeshError)
def refined(mesh: Mesh, curves: Iterable[Curve] = ()) -> Mesh:
    """Return the mesh with every line divided in two, and every triangle and quadrangle in four.

    New points are interpolated by the shape functions of the parent cell. If all nodes of a facet in the group of a curve
    lie on the curve, the new points of the facet are placed on the curve. Existing points keep their numbers. A cell group
    contains the children of its cells. A new point on an edge belongs to every point group that contains all nodes of the
    edge, a new point inside a cell to every point group that contains all nodes of the cell.

    Parameters
    ----------
    mesh : Mesh
        Two-dimensional mesh with cells of the types tri3, tri6, quad4, quad8, quad9, line2 and line3.
    curves : iterable of Circle
        Exact shapes of the boundary, or other objects with the attribute `group` and the method `project` of `Circle`; see
        also `circles`.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If a cell is of another type, the group of a curve has no facet on the curve, or a child with a curved side has a
        nonpositive Jacobian.

    Examples
    --------
    >>> from fastcontact import generate
    >>> generate.refined(generate.block(divisions=(2, 2))).cells["quad4"].shape
    (16, 4)
    """
    new = _new_points(mesh)
    points = np.concatenate([mesh.points, np.empty((len(new.keys), mesh.dim))])
    for name, point, parents, rows in new.sources:
        points[rows] = np.einsum("n,cnd->cd", _pattern(name).shape[point], mesh.points[mesh.cells[name][parents]])
    for curve in curves:
        rows = _on_curve(mesh, curve, new.keys)
        points[rows] = curve.project(points[rows])
    blocks = {name: lattice[:, _pattern(name).children] for name, lattice in new.lattices.items()}
    cells = {name: block.reshape(-1, block.shape[2]) for name, block in blocks.items()}
    result = Mesh(points, cells, _cell_groups(mesh), _point_groups(mesh, new))
    check_cells(result)
    return result


class _NewPoints(NamedTuple):
    """The new points of a refined mesh, in the order of their keys; points on edges precede points inside cells.

    `keys` (n,) identifies the points: cells that share a point have the same key for it. Each item of `sources` consists of
    an element type, the number of a point in its `_Pattern`, rows of cells, and the numbers of the new points in these
    cells. `lattices` (n_cells, n_lattice) contains all points of every cell, by element type.
    """

    keys: AnyArray
    sources: list[tuple[str, int, AnyArray, AnyArray]]
    lattices: dict[str, AnyArray]


def _new_points(mesh: Mesh) -> _NewPoints:
    """Return the new points of a refined mesh."""
    point_keys, origins, next_key = [np.empty(0, np.int64)], [], 4 * mesh.n_points**2  # keys of edges are smaller
    lattices = {}
    for name, block in mesh.cells.items():
        pattern, ends = _pattern(name), block[:, elements.get(name).edges].astype(np.int64)
        lattices[name] = np.empty((len(block), len(pattern.shape)), np.int64)
        lattices[name][:, : block.shape[1]] = block
        for point in range(block.shape[1], len(pattern.shape)):
            edge = pattern.on_edge[point]
            if edge >= 0:
                start, end = ends[:, edge].T
                point_keys.append(_keys(start, end, int(pattern.quarters[point]), mesh.n_points))
            else:  # a separate point for each cell
                point_keys.append(next_key + np.arange(len(block)))
                next_key += len(block)
            origins.append((name, point))
    keys, first, rank = np.unique(np.concatenate(point_keys), return_index=True, return_inverse=True)
    sources, start = [], 0
    for name, point in origins:
        numbers = mesh.n_points + rank[start : start + len(lattices[name])]
        lattices[name][:, point] = numbers
        cells = np.sort(first[(first >= start) & (first < start + len(numbers))]) - start
        sources.append((name, point, cells, numbers[cells]))
        start += len(numbers)
    return _NewPoints(keys, sources, lattices)


def _keys(a: AnyArray, b: AnyArray, quarters: int, n_points: int) -> AnyArray:
    """Return a key of the point at `quarters` of the edge from a to b, independent of the direction of the edge."""
    from_smaller = np.where(a < b, quarters, 4 - quarters)
    return (np.minimum(a, b) * n_points + np.maximum(a, b)) * 4 + from_smaller


def _facets_on(mesh: Mesh, curve: Curve) -> list[AnyArray]:
    """Return the facets in the group of a curve whose nodes all lie on the curve, as one array for each element type."""
    facets = [block[all_on(mesh, curve, block)] for block in facets_of(mesh, curve).values()]
    if not sum(map(len, facets)):
        kind = "outer facet" if curve.group is None else f"facet of group '{curve.group}'"
        raise MeshError(f"no {kind} has all its nodes on {curve}: check its centre and radius")
    return facets


def _on_curve(mesh: Mesh, curve: Curve, keys: AnyArray) -> AnyArray:
    """Return the numbers of the new points of the facets that lie on a curve."""
    ends = np.concatenate([block[:, :2] for block in _facets_on(mesh, curve)]).astype(np.int64)
    curve_keys = np.unique(np.concatenate([_keys(ends[:, 0], ends[:, 1], q, mesh.n_points) for q in (1, 2, 3)]))
    return mesh.n_points + np.flatnonzero(np.isin(keys, curve_keys))


def _cell_groups(mesh: Mesh) -> dict[str, AnyArray]:
    """Return the cell groups of the refined mesh; the children of a cell have consecutive numbers."""
    n_children = [np.full(len(block), len(_pattern(name).children)) for name, block in mesh.cells.items()]
    parent = np.repeat(np.arange(mesh.n_cells), np.concatenate([np.empty(0, np.intp), *n_children]))
    return {group: np.flatnonzero(np.isin(parent, members)) for group, members in mesh.cell_groups.items()}


def _point_groups(mesh: Mesh, new: _NewPoints) -> dict[str, AnyArray]:
    """Return the point groups of the refined mesh."""
    groups: dict[str, AnyArray] = {}
    for group, members in mesh.point_groups.items():
        in_group = np.zeros(mesh.n_points, bool)
        in_group[members] = True
        parts = [members]
        for name, point, cells, rows in new.sources if len(members) > 1 else ():
            edge, nodes, element = _pattern(name).on_edge[point], mesh.cells[name][cells], elements.get(name)
            if edge >= 0:
                middle = [element.n_corners + edge] if element.order == 2 else []
                nodes = nodes[:, [*element.edges[edge], *middle]]
            parts.append(rows[in_group[nodes].all(axis=1)])
        groups[group] = np.concatenate(parts)
    return groups


@typed(MeshError)
def linearised(mesh: Mesh) -> Mesh:
    """Return the mesh with linear instead of quadratic cells: tri3 for tri6, quad4 for quad8 and quad9, line2 for line3.

    Points that become unused are removed; the other points keep their order.

    Examples
    --------
    >>> from fastcontact import generate
    >>> sorted(generate.linearised(generate.block(element="quad8")).cells)
    ['line2', 'quad4']
    """
    cells = {name: block[:, : elements.get(name).n_corners] for name, block in mesh.cells.items()}
    used = np.ones(mesh.n_points, bool)
    for name, block in mesh.cells.items():
        used[block[:, elements.get(name).n_corners :]] = False
    for block in cells.values():
        used[block] = True
    new_point = np.cumsum(used) - 1
    merged: dict[str, AnyArray] = {}
    order: list[Indices] = []
    for linear in dict.fromkeys(elements.get(name).linear for name in cells):
        names = [name for name in cells if elements.get(name).linear == linear]
        merged[linear] = new_point[np.concatenate([cells[name] for name in names])]
        order += [mesh.offsets[name] + np.arange(len(cells[name])) for name in names]
    new_cell = np.argsort(np.concatenate(order)) if order else np.empty(0, np.int64)
    return Mesh(
        mesh.points[used],
        merged,
        {group: new_cell[members] for group, members in mesh.cell_groups.items()},
        {group: new_point[members[used[members]]] for group, members in mesh.point_groups.items()},
    )


@typed(MeshError)
def circles(mesh: Mesh) -> list[Circle]:
    """Return the circles on which groups of facets lie, at most one for each group, for use in `refined`.

    A circle is fitted to the nodes of a group by least squares. It is accepted if the group has at least four nodes, all of
    them lie on the circle within 1e-6 of the length of the longest facet, and no facet subtends more than 36 degrees. The
    last condition excludes polygons such as a square, whose corners also lie on a circle.

    Examples
    --------
    >>> from fastcontact import generate
    >>> {round(circle.radius, 9) for circle in generate.circles(generate.half_spheres(size=10.0))}
    {50.0}
    """
    curves = []
    for group in mesh.cell_groups:
        blocks = mesh.cells_of(group, dim=1)
        has_solids = any(elements.get(name).dim == 2 for name in mesh.split(mesh.cell_groups[group]))
        if blocks and not has_solids:
            circle = _circle(mesh, group, list(blocks.values()))
            if circle is not None:
                curves.append(circle)
    return curves


def _circle(mesh: Mesh, group: str, blocks: list[AnyArray]) -> Circle | None:
    """Return the circle on which the facets of a group lie, or None; see `circles`."""
    points = mesh.points[np.unique(np.concatenate([block.ravel() for block in blocks]))]
    if len(points) < 4:
        return None
    centroid, size = points.mean(axis=0), np.ptp(points, axis=0).max()
    x = (points - centroid) / size
    # x^2 + y^2 = 2 a x + 2 b y + c is linear in the centre (a, b).
    system = np.column_stack([2 * x, np.ones(len(x))])
    if np.linalg.cond(system) > 1e8:
        return None
    (a, b, c), *_ = np.linalg.lstsq(system, (x**2).sum(axis=1), rcond=None)
    radius = np.sqrt(max(c + a * a + b * b, 0.0))
    longest = max(np.linalg.norm(np.diff(mesh.points[block[:, :2]], axis=1), axis=2).max() for block in blocks) / size
    deviation = np.abs(np.hypot(x[:, 0] - a, x[:, 1] - b) - radius).max()
    if deviation > ON_CURVE * longest or longest > 2 * radius * np.sin(_TURN / 2):
        return None
    return Circle((float(centroid[0] + size * a), float(centroid[1] + size * b)), float(radius * size), group)
