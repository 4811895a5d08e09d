"""Conversion of linear to quadratic meshes, with mid-side nodes on the exact curves of the boundary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import AnyArray, Array, Mask
from fastcontact.errors import MeshError
from fastcontact.mesh import elements
from fastcontact.mesh.mesh import Mesh
from fastcontact.mesh.quality import check_cells
from fastcontact.mesh.topology import outer_facets

# Nodes whose distance from a curve is smaller than this fraction of the edge length are regarded as nodes on the curve.
ON_CURVE = 1e-6
_WITH_CENTRE = {"quad8": "quad9"}


class Curve(Protocol):
    """The exact shape of a group of facets."""

    @property
    def group(self) -> str | None:
        """Name of the group of facets on the curve; None means all outer facets whose ends lie on it."""
        ...

    def project(self, points: Array) -> Array:
        """Return the points (n, dim) [length] of the curve nearest to `points` (n, dim) [length]."""
        ...


@typed(MeshError)
@dataclass(frozen=True)
class Circle:
    """A circle on which facets of the boundary of a 2D mesh lie.

    Parameters
    ----------
    centre : (float, float)
        Coordinates of the centre [length].
    radius : float
        Radius, greater than 0 [length].
    group : str, optional
        Group of facets on the circle; by default all outer facets whose ends lie on the circle.

    Examples
    --------
    >>> import numpy as np
    >>> from fastcontact import generate
    >>> generate.Circle(centre=(0.0, 0.0), radius=2.0).project(np.array([[3.0, 0.0], [0.0, 1.0]]))
    array([[2., 0.],
           [0., 2.]])
    """

    centre: tuple[float, float]
    radius: float
    group: str | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise MeshError(f"radius = {self.radius} is out of range: it must be greater than 0")
        if not np.isfinite(self.centre).all():
            raise MeshError(f"centre = {self.centre} is out of range: it must be two finite numbers")

    def project(self, points: Array) -> Array:
        """Return the points (n, 2) [length] of the circle nearest to `points` (n, 2) [length]."""
        arms = points - np.asarray(self.centre)
        length = np.hypot(arms[:, 0], arms[:, 1])
        # The centre has no unique nearest point and is not moved.
        return np.asarray(self.centre) + arms * (self.radius / np.where(length > 0.0, length, 1.0))[:, None]


@typed(MeshError)
def to_quadratic(mesh: Mesh, curves: Iterable[Curve] = (), *, centre_nodes: bool = False) -> Mesh:
    """Convert a linear mesh to a quadratic mesh with a mid-side node on every edge.

    For example tri3 cells become tri6, quad4 quad8 or quad9, and hex8 hex20 cells. A mid-side node lies half-way between the
    ends of its edge. If the edge belongs to a facet in the group of a curve and both ends lie on the curve, the mid-side
    node is placed on the curve. Existing points keep their numbers, followed by mid-side nodes and centre nodes.

    Parameters
    ----------
    mesh : Mesh
        Mesh with cells of linear elements.
    curves : iterable of Circle
        Exact shapes of the boundary, or other objects with the attribute `group` and the method `project` of `Circle`.
    centre_nodes : bool
        Whether quadrangles get a centre node (quad9); only for 2D meshes.

    Returns
    -------
    Mesh

    Raises
    ------
    MeshError
        If a cell is already quadratic, `centre_nodes` is given for a 3D mesh, the group of a curve has no edge on the
        curve, or a curved side makes the Jacobian of a cell nonpositive at a quadrature point.

    Examples
    --------
    Place mid-side nodes on the circles on which the sides of two half-spheres lie, as in mesh B of FORMA04:

    >>> from fastcontact import generate
    >>> mesh = generate.half_spheres("tri3", size=10.0)
    >>> generate.to_quadratic(mesh, generate.circles(mesh)).cells["tri6"].shape
    (140, 6)
    """
    names = _quadratic_names(mesh, centre_nodes)
    edges = unique_edges(mesh.cells)
    midpoints = mesh.points[ends_of(edges)].mean(axis=1)
    for curve in curves:
        rows = np.searchsorted(edges, edges_on(mesh, curve))
        midpoints[rows] = curve.project(midpoints[rows])
    points = [mesh.points, midpoints]
    cells, n_points = {}, mesh.n_points + len(midpoints)
    for name, block in mesh.cells.items():
        rows = np.searchsorted(edges, edges_of(name, block))
        columns = [block, mesh.n_points + rows]
        if names[name] in _WITH_CENTRE.values():
            points.append(centres(mesh.points[block], midpoints[rows]))
            columns.append(n_points + np.arange(len(block))[:, None])
            n_points += len(block)
        cells[names[name]] = np.column_stack(columns)
    result = mesh.replace(points=np.concatenate(points), cells=cells)
    check_cells(result)
    return result


def converted_to(mesh: Mesh, element: str, curves: Iterable[Curve] = ()) -> Mesh:
    """Check the cells of a linear mesh and return it, converted by `to_quadratic` if `element` is quadratic."""
    if elements.get(element).order == 1:
        check_cells(mesh)
        return mesh
    return to_quadratic(mesh, curves, centre_nodes=element in _WITH_CENTRE.values())


def _quadratic_names(mesh: Mesh, centre_nodes: bool) -> dict[str, str]:
    """Return the quadratic element type for each element type of the mesh."""
    if centre_nodes and mesh.dim != 2:
        raise MeshError("centre_nodes is for 2D meshes: leave it out, and cells get mid-side nodes only")
    names = {}
    for name in mesh.cells:
        element = elements.get(name)
        if element.order != 1:
            raise MeshError(f"to_quadratic needs linear cells, but the mesh has {len(mesh.cells[name])} {name}")
        names[name] = _WITH_CENTRE.get(element.quadratic, element.quadratic) if centre_nodes else element.quadratic
    return names


def edge_keys(ends: AnyArray) -> AnyArray:
    """Return a key (...) of int for each edge, independent of its direction, from the points `ends` (..., 2) of int."""
    return (ends.min(axis=-1).astype(np.int64) << 32) | ends.max(axis=-1)


def ends_of(keys: AnyArray) -> AnyArray:
    """Return the point numbers (n, 2) at the ends of the edges with the `keys` (n,) of int."""
    return np.column_stack([keys >> 32, keys & 0xFFFFFFFF])


def edges_of(name: str, cells: AnyArray) -> AnyArray:
    """Return the keys (n_cells, n_edges) of the edges of `cells` (n_cells, n_nodes) of element `name`."""
    return edge_keys(cells[:, elements.get(name).edges])


def unique_edges(cells: Mapping[str, AnyArray]) -> AnyArray:
    """Return the keys (n,) of int of the edges of all `cells` (n_cells, n_nodes) of int, each once, in ascending order."""
    keys = [edges_of(name, block).ravel() for name, block in cells.items()]
    return np.unique(np.concatenate(keys)) if keys else np.empty(0, np.int64)


def edges_on(mesh: Mesh, curve: Curve) -> AnyArray:
    """Return the keys (n,) of the edges in the group of a curve whose ends both lie on it.

    Raises MeshError if there is no such edge.
    """
    edges = unique_edges(facets_of(mesh, curve))
    on_curve = lies_on_curve(mesh, curve, ends_of(edges))
    if not on_curve.any():
        facets = "outer facets" if curve.group is None else f"group '{curve.group}'"
        raise MeshError(f"no edge of {facets} has both ends on {curve}: check its centre and radius")
    return edges[on_curve]


def facets_of(mesh: Mesh, curve: Curve) -> Mapping[str, AnyArray]:
    """Return the facets (n, n_nodes) in the group of a curve, by element type; without a group all outer facets."""
    return outer_facets(mesh) if curve.group is None else mesh.cells_of(curve.group, dim=mesh.dim - 1)


def lies_on_curve(mesh: Mesh, curve: Curve, nodes: AnyArray) -> Mask:
    """Return for each facet or edge (n,) whether all its nodes lie on a curve.

    `nodes` (n, n_nodes) contains the nodes of each facet or edge, its two ends first.
    """
    x = mesh.points[nodes]
    length = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    points = x.reshape(-1, mesh.dim)
    distance = np.linalg.norm(curve.project(points) - points, axis=1).reshape(nodes.shape).max(axis=1)
    return np.asarray(distance <= ON_CURVE * length)


def centres(corners: Array, middles: Array) -> Array:
    """Return the centres (n, dim) [length] of curved quadrangles, interpolated by the eight-node shape functions.

    `corners` (n, 4, dim) [length] contains the corners and `middles` (n, 4, dim) [length] the mid-side nodes.
    """
    return 0.5 * middles.sum(axis=1) - 0.25 * corners.sum(axis=1)
