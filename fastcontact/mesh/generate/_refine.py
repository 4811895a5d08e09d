"""Uniform refinement of 2D meshes, with new nodes on exact curves of the boundary, and detection of circles on it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cache

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact._tools.records import record
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.generate.forest import RED
from fastcontact.mesh.generate.quadratic import ON_CURVE, Circle, Curve, facets_of, lies_on_curve
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells

# Quadratic elements whose nodes are the corners of the children in `RED`. Each child has the orientation of its parent.
_LATTICE = {"line2": "line3", "tri3": "tri6", "quad4": "quad9"}
# Largest angle that a facet of a circle may subtend [radian]. Nodes at larger distances are regarded as those of a polygon.
_LARGEST_ANGLE = np.pi / 5


@record
class _Pattern:
    """The division of a cell of one element type, described by the points of its children.

    The first n_nodes points are the nodes of the parent, and m new points follow. `children` (n_children, n_nodes) are the
    points of each child. `shape` (m, n_nodes) [-] contains the shape functions of the parent at the new points. `on_edge`
    (m,) states whether a new point lies on an edge of the parent, `ends` (m, 2) are the corners at the ends of this edge, and
    `quarters` (m,) is the distance from the first end in quarters of the length. `parents` (m, n_nodes) is true for the nodes
    of this edge, or for all nodes if the point lies inside the parent.
    """

    children: AnyArray
    shape: Array
    on_edge: Mask
    ends: AnyArray
    quarters: AnyArray
    parents: Mask


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
    new_points = np.array(points)[element.n_nodes :]
    # On an edge, only the functions of its nodes differ from zero.
    weights, shape = element.corner_shape(new_points), element.shape(new_points)
    on_edge = (np.abs(weights) > 1e-12).sum(axis=1) == 2
    ends = np.argsort(np.abs(weights) <= 1e-12, axis=1, kind="stable")[:, :2]
    quarters = np.round(4 * np.take_along_axis(weights, ends[:, 1:], axis=1)[:, 0]).astype(int)
    parents = (np.abs(shape) > 1e-12) | ~on_edge[:, None]
    return _Pattern(np.array(children), shape, on_edge, ends, quarters, parents)


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
    keys, lattices = _lattices(mesh)
    points = np.concatenate([mesh.points, np.empty((len(keys), mesh.dim))])
    for name, block in mesh.cells.items():
        rows = lattices[name][:, block.shape[1] :]
        points[rows] = np.einsum("pn,cnd->cpd", _pattern(name).shape, mesh.points[block])
    for curve in curves:
        rows = _on_curve(mesh, curve, keys)
        points[rows] = curve.project(points[rows])
    blocks = {name: lattice[:, _pattern(name).children] for name, lattice in lattices.items()}
    cells = {name: block.reshape(-1, block.shape[2]) for name, block in blocks.items()}
    result = Mesh(points, cells, _cell_groups(mesh), _point_groups(mesh, lattices))
    check_cells(result)
    return result


def _lattices(mesh: Mesh) -> tuple[AnyArray, dict[str, AnyArray]]:
    """Return the keys (n,) of the new points, and all points (n_cells, n_lattice) of the refined cells, by element type.

    Cells that share a new point have the same key for it. The new points are in the order of their keys; those on edges
    precede those inside cells.
    """
    keys, next_key = [], 4 * mesh.n_points**2  # keys of edges are smaller
    for name, block in mesh.cells.items():
        pattern = _pattern(name)
        start, end = np.moveaxis(block[:, pattern.ends].astype(np.int64), 2, 0)
        keys.append(_keys(start, end, pattern.quarters, mesh.n_points))
        inside = np.flatnonzero(~pattern.on_edge)
        separate = np.arange(len(inside) * len(block)).reshape(len(inside), len(block))
        keys[-1][:, inside] = next_key + separate.T
        next_key += separate.size
    flat = [np.empty(0, np.int64), *(block.ravel() for block in keys)]
    unique, rank = np.unique(np.concatenate(flat), return_inverse=True)
    numbers = np.split(mesh.n_points + rank, np.cumsum([block.size for block in keys]))
    blocks = zip(mesh.cells.items(), numbers, keys, strict=False)
    return unique, {name: np.hstack([block, new.reshape(cell_keys.shape)]) for (name, block), new, cell_keys in blocks}


def _keys(a: AnyArray, b: AnyArray, quarters: AnyArray | int, n_points: int) -> AnyArray:
    """Return a key of the point at `quarters` of the edge from a to b, independent of the direction of the edge."""
    from_smaller = np.where(a < b, quarters, 4 - quarters)
    return (np.minimum(a, b) * n_points + np.maximum(a, b)) * 4 + from_smaller


def _on_curve(mesh: Mesh, curve: Curve, keys: AnyArray) -> AnyArray:
    """Return the numbers of the new points of the facets in the group of a curve whose nodes all lie on the curve."""
    facets = [block[lies_on_curve(mesh, curve, block)] for block in facets_of(mesh, curve).values()]
    if not sum(map(len, facets)):
        kind = "outer facet" if curve.group is None else f"facet of group '{curve.group}'"
        raise MeshError(f"no {kind} has all its nodes on {curve}: check its centre and radius")
    ends = np.concatenate([block[:, :2] for block in facets]).astype(np.int64)
    curve_keys = np.unique(np.concatenate([_keys(ends[:, 0], ends[:, 1], q, mesh.n_points) for q in (1, 2, 3)]))
    return mesh.n_points + np.flatnonzero(np.isin(keys, curve_keys))


def _cell_groups(mesh: Mesh) -> dict[str, AnyArray]:
    """Return the cell groups of the refined mesh; the children of a cell have consecutive numbers."""
    n_children = [np.full(len(block), len(_pattern(name).children)) for name, block in mesh.cells.items()]
    parent = np.repeat(np.arange(mesh.n_cells), np.concatenate([np.empty(0, np.intp), *n_children]))
    return {group: np.flatnonzero(np.isin(parent, members)) for group, members in mesh.cell_groups.items()}


def _point_groups(mesh: Mesh, lattices: Mapping[str, AnyArray]) -> dict[str, AnyArray]:
    """Return the point groups of the refined mesh."""
    groups: dict[str, AnyArray] = {}
    for group, members in mesh.point_groups.items():
        in_group, blocks = np.isin(np.arange(mesh.n_points), members), [members]
        for name, block in mesh.cells.items() if len(members) > 1 else ():
            inside = (in_group[block][:, None] | ~_pattern(name).parents).all(axis=2)
            blocks.append(lattices[name][:, block.shape[1] :][inside])
        groups[group] = np.concatenate(blocks)
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
    is_used = np.ones(mesh.n_points, bool)
    for name, block in mesh.cells.items():
        is_used[block[:, elements.get(name).n_corners :]] = False
    for block in cells.values():
        is_used[block] = True
    new_point = np.cumsum(is_used) - 1
    linear_cells: dict[str, AnyArray] = {}
    order: list[Indices] = []
    for linear in dict.fromkeys(elements.get(name).linear for name in cells):
        names = [name for name in cells if elements.get(name).linear == linear]
        linear_cells[linear] = new_point[np.concatenate([cells[name] for name in names])]
        order += [mesh.offsets[name] + np.arange(len(cells[name])) for name in names]
    new_cell = np.argsort(np.concatenate(order)) if order else np.empty(0, np.int64)
    cell_groups = {group: new_cell[members] for group, members in mesh.cell_groups.items()}
    point_groups = {group: new_point[members[is_used[members]]] for group, members in mesh.point_groups.items()}
    return Mesh(mesh.points[is_used], linear_cells, cell_groups, point_groups)


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
    if deviation > ON_CURVE * longest or longest > 2 * radius * np.sin(_LARGEST_ANGLE / 2):
        return None
    return Circle((float(centroid[0] + size * a), float(centroid[1] + size * b)), float(radius * size), group)
