"""Pairing: projection of secondary points onto primary facets, and rows of the gap function.

Mortar in three dimensions pairs facets with facets instead, in `formulations._cut_faces`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import AnyArray, Array, Indices, Mask, Numbers
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.projection import (
    Places,
    along_line_normals,
    along_normals,
    at_nodes_of_facets,
    facet_normals,
    interpolated,
    places,
    smooth_ends,
    smooth_normals,
)
from fastcontact.contact.search.closest import Closest, closest_of_kinds
from fastcontact.contact.surface import Surface
from fastcontact.mesh import elements
from fastcontact.round_off import LENGTH_ROUND_OFF

# Largest distance beyond both facets at a node at which a point still faces it, in facet lengths.
FOLDED = 0.5
# Fraction of either facet at an edge over which the normals of rounded edges vary.
ROUNDED = 0.1


@dataclass(frozen=True, eq=False)
class Candidates:
    """Points of the secondary side where the gap is measured: combinations of its nodes.

    Attributes
    ----------
    nodes : ndarray of int (n, k)
        Point numbers.
    shape : ndarray (n, k)
        Weight of each node.
    facet : ndarray of int (n,), optional
        The secondary facet they lie on, counted through the blocks.
    xi : ndarray (n, dim - 1), optional
        Their reference coordinates in it.
    """

    nodes: Numbers
    shape: Array
    facet: Indices | None = None
    xi: Array | None = None

    @classmethod
    def inside(cls, side: Surface, xi: Sequence[Array]) -> Candidates:
        """Return points at the same reference coordinates (n, dim - 1) in all facets of a block, `xi` for each block."""
        nodes, shapes, facets, coordinates, first = [], [], [], [], 0
        for block, xi_of_block in zip(side.blocks, xi, strict=True):
            nodes.append(np.repeat(block.facets, len(xi_of_block), axis=0))
            shapes.append(np.tile(elements.get(block.element).shape(xi_of_block), (len(block.facets), 1)))
            facets.append(np.repeat(first + np.arange(len(block.facets)), len(xi_of_block)))
            coordinates.append(np.tile(xi_of_block, (len(block.facets), 1)))
            first += len(block.facets)
        return cls(filled_up(nodes), filled_up(shapes), np.concatenate(facets), np.concatenate(coordinates))

    @classmethod
    def nodes_of(cls, side: Surface) -> Candidates:
        """Return the nodes of a side, each on one of its facets."""
        facet, xi, first = np.zeros(len(side.points), np.intp), np.zeros((len(side.points), 1)), 0
        for block in side.blocks:
            xi_of_nodes = elements.get(block.element).nodes
            xi = np.broadcast_to(xi, (len(xi), xi_of_nodes.shape[1])).copy()
            facet[block.local] = first + np.arange(len(block.local))[:, None]
            xi[block.local] = xi_of_nodes
            first += len(block.local)
        return cls(side.points[:, None], np.ones((len(side.points), 1)), facet, xi)

    def positions(self, coordinates: Array) -> Array:
        """Return the positions (n, dim) for nodal `coordinates` (n_points, dim)."""
        return np.einsum("nk,nkd->nd", self.shape, coordinates[self.nodes])

    def belonging_to(self, mask: Mask) -> Mask:
        """Return which candidates (n,) lie nearer to nodes of `mask` (n_points,) than to all others."""
        inside = mask[self.nodes]
        largest = np.where(inside, self.shape, -np.inf).max(axis=1)
        return largest > np.where(inside, -np.inf, self.shape).max(axis=1) + LENGTH_ROUND_OFF


@dataclass(frozen=True, eq=False)
class Pairing:
    """The primary facet that each candidate faces.

    Attributes
    ----------
    facet : ndarray of int (n,)
        Row in the primary facets, counted through their blocks.
    xi : ndarray (n, dim - 1)
        Reference coordinates of the projection.
    normal : ndarray (n, dim)
        Unit outward normal there: of the primary facet, or interpolated between the nodal means of the facets.
    paired : ndarray of bool (n,)
        False where a candidate stands out beyond the end of the primary surface.
    offset : ndarray (n,), optional
        Gap minus ``normal . x`` where the primary side is a rigid obstacle [length]; None for facets.
    beyond : ndarray (n, dim - 1), optional
        Distance of candidates beyond the end of the primary surface, in reference coordinates of the facet, which is extended
        straight there; None if all are within.
    """

    facet: Indices
    xi: Array
    normal: Array
    paired: Mask
    offset: Array | None = None
    beyond: Array | None = None

    def places(self, primary: Surface, rows: Indices) -> Places:
        """Return the points of `primary` that candidates `rows` (n,) face, on facets extended straight beyond their ends."""
        points = places(primary, self.facet[rows], self.xi[rows])
        if self.beyond is None:
            return points
        return replace(points, shape=points.shape + np.einsum("nkj,nj->nk", points.gradient, self.beyond[rows]))


def pair(
    candidates: Array,
    primary: Surface | RigidSide,
    coordinates: Array,
    projection_tolerance: float,
    normals: str | Sequence[float] = "facet",
    obstacle: Pose | None = None,
    rounded: bool = False,
) -> Pairing:
    """Project candidate positions (n, dim) on the closest facet of `primary` at nodal `coordinates` [length].

    A candidate farther out than `projection_tolerance` facet lengths beyond the end of its facet is not paired
    (TOLE_PROJ_EXT of code_aster). A candidate paired there faces the straight extension of the facet, so that the forces
    on both sides have one line of action and balance in moment. Unless `normals` is ``"facet"``, the normal is
    interpolated between nodal means of the facets' normals, so that it is continuous across facets except at corners,
    and the candidates are projected along it; a unit vector (dim,) is the normal everywhere. A rigid obstacle has the
    pose `obstacle`. With `rounded`, facet normals vary continuously across edges.

    Raises
    ------
    ContactError
        If a projection does not converge; see `search.closest`.
    """
    if isinstance(primary, RigidSide):
        at = Pose(np.zeros(candidates.shape[1])) if obstacle is None else obstacle
        _, normal, paired, offset = primary.facing(candidates, at)
        nowhere = np.zeros(len(candidates), np.intp)
        return Pairing(nowhere, np.zeros((len(candidates), candidates.shape[1] - 1)), normal, paired, offset)
    closest = closest_of_kinds(candidates, primary.corners(coordinates))
    if normals == "facet" and not rounded:
        inner = _at_smooth_ends(primary, coordinates, closest)
        paired = closest.overhang <= np.where(inner, max(projection_tolerance, FOLDED), projection_tolerance)
        outside = paired & ~inner & (closest.overhang > LENGTH_ROUND_OFF)
        return _straight_on(
            Pairing(closest.facet, closest.xi, closest.normal, paired), candidates, primary, coordinates, outside
        )
    at_nodes = at_nodes_of_facets(smooth_normals(primary, coordinates))
    if not isinstance(normals, str):
        at_nodes = np.broadcast_to(np.array(normals), at_nodes.shape).copy()
    project = along_normals if coordinates.shape[1] == 3 else along_line_normals
    facet, xi, overhang, normal = project(candidates, primary, coordinates, at_nodes, closest)
    if normals == "facet":
        normal = _round_edges(primary, coordinates, facet, xi, normal)
    paired = overhang <= projection_tolerance
    return _straight_on(
        Pairing(facet, xi, normal, paired), candidates, primary, coordinates, paired & (overhang > LENGTH_ROUND_OFF)
    )


def _round_edges(primary: Surface, coordinates: Array, facet: Indices, xi: Array, mean: Array) -> Array:
    """Return facet normals (n, dim) that pass to the `mean` (n, dim) at their edges, over `ROUNDED` of each facet.

    Where facets meet in an edge, the contact force of a node may have any direction between their normals, and
    equilibrium may place the node at the edge: with the normal of either facet the pairing alternates between them. Here
    the direction follows from the position on the rounded edge.
    """
    normals = at_nodes_of_facets([facet_normals(block, coordinates) for block in primary.blocks])[facet]
    normals = interpolated(normals, places(primary, facet, xi))
    on_triangle = np.column_stack([xi, 1.0 - xi.sum(axis=1)]).min(axis=1)
    inside = np.where(primary.triangular[facet], on_triangle, 0.5 * (1.0 - np.abs(xi).max(axis=1)))
    share = np.clip(1.0 - inside / ROUNDED, 0.0, 1.0)[:, None]
    normal = share * mean + (1.0 - share) * normals
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _straight_on(pairing: Pairing, candidates: Array, primary: Surface, coordinates: Array, outside: Mask) -> Pairing:
    """Return the pairing with the overhang of candidates `outside` (n,) beyond the ends of their facets."""
    rows = np.flatnonzero(outside)
    if not len(rows):
        return pairing
    at = places(primary, pairing.facet[rows], pairing.xi[rows])
    corners = coordinates[at.nodes]
    offset = candidates[rows] - np.einsum("nk,nkd->nd", at.shape, corners)
    axes = np.concatenate([np.einsum("nkj,nkd->ndj", at.gradient, corners), pairing.normal[rows][:, :, None]], axis=2)
    beyond = np.zeros_like(pairing.xi)
    beyond[rows] = np.linalg.solve(axes, offset[:, :, None])[:, :-1, 0]
    return replace(pairing, beyond=beyond)


def _at_smooth_ends(primary: Surface, coordinates: Array, closest: Closest) -> Mask:
    """Return which candidates (n,) overhang an end at which another line continues smoothly.

    On lines that fold inward, points at a distance lie beyond the ends of both facets at a node, but not beyond the end
    of the surface. At a corner they lie beside it.
    """
    out = closest.overhang > 0.0
    if closest.position.shape[1] == 3 or not out.any():
        return np.zeros(len(out), bool)
    smooth = smooth_ends(primary, at_nodes_of_facets(smooth_normals(primary, coordinates)))
    return np.asarray(out & smooth[closest.facet, (closest.xi[:, 0] > 0.0).astype(np.intp)])


def filled_up(arrays: Sequence[AnyArray]) -> AnyArray:
    """Return arrays (n_i, k_i) as one, as wide as the widest: integers are repeated, floating-point numbers zero."""
    width = max(values.shape[1] for values in arrays)
    missing = [((0, 0), (0, width - values.shape[1])) for values in arrays]
    integer = np.issubdtype(arrays[0].dtype, np.integer)
    return np.concatenate(
        [
            np.pad(values, pad, mode="edge" if integer else "constant")
            for values, pad in zip(arrays, missing, strict=True)
        ]
    )


def gap_rows(
    candidates: Candidates, pairing: Pairing, primary: Surface | RigidSide, reference: Array
) -> tuple[csr_array, Array]:
    """Return (G, gap0): gap of the candidates = gap0 + G u; rows of unpaired candidates are empty.

    ``gap = n . (x_secondary - x_primary(xi))`` with the facet, xi and normal of `pairing` held fixed; `reference`
    (n_points, dim) are undeformed coordinates, u the displacements of all points, point by point.
    """
    G = rows_along(pairing.normal, candidates, pairing, primary, reference.size)
    gap0 = G @ reference.ravel()
    if pairing.offset is not None:
        gap0 += np.where(pairing.paired, pairing.offset, 0.0)
    return G, gap0


def tangents(normal: Array, held: Array | None = None) -> list[Array]:
    """Return unit tangents (n, dim) that complete `normal` (n, dim): one in 2D, two in 3D.

    In 3D one pair of axes perpendicular to the mean normal is rotated to every point by the smallest rotation. Tangents then
    vary no faster than normals, so that components of tractions along them can be interpolated as fields, and the choice
    of the first axis does not matter. Where displacements are held, by projectors `held` (n, 3, 3), the tangents are
    rotated so that one of them is held as far as any tangent is.
    """
    if normal.shape[1] == 2:
        return [np.column_stack([normal[:, 1], -normal[:, 0]])]
    mean = normal[np.isfinite(normal).all(axis=1)].sum(axis=0)
    length = np.linalg.norm(mean)
    mean = mean / length if length > LENGTH_ROUND_OFF * len(normal) else np.array([0.0, 0.0, 1.0])
    axis = np.cross(np.eye(3)[np.argmin(np.abs(mean))], mean)
    axis /= np.linalg.norm(axis)
    # Rotation of the axis by the rotation of the mean normal to the normal; a half turn about it where they are opposite.
    both = 1.0 + normal @ mean
    slope = np.divide(normal @ axis, both, out=np.zeros(len(normal)), where=both > LENGTH_ROUND_OFF)
    first = axis - slope[:, None] * (mean + normal)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    if held is not None:
        ff, fs, ss = (
            np.einsum("nd,nde,ne->n", a, held, b) for a, b in ((first, first), (first, second), (second, second))
        )
        angle = 0.5 * np.arctan2(2 * fs, ff - ss)[:, None]
        first = np.cos(angle) * first + np.sin(angle) * second
        second = np.cross(normal, first)
    return [first, second]


def normals(directions: Sequence[Array]) -> Array:
    """Return the unit normals (n, dim) that `tangents` complete."""
    if len(directions) == 1:
        return np.column_stack([-directions[0][:, 1], directions[0][:, 0]])
    return np.cross(directions[0], directions[1])


def rows_along(
    direction: Array, candidates: Candidates, pairing: Pairing, primary: Surface | RigidSide, n_dofs: int
) -> csr_array:
    """Return rows (n, n_dofs) of the relative motion of paired points along `direction` (n, dim).

    Rows of unpaired candidates are empty.
    """
    dim = direction.shape[1]
    rows = np.flatnonzero(pairing.paired)
    nodes, weights = candidates.nodes[rows], candidates.shape[rows]
    if not isinstance(primary, RigidSide):
        facing = pairing.places(primary, rows)
        nodes, weights = np.hstack([nodes, facing.nodes]), np.hstack([weights, -facing.shape])
    values = weights[:, :, None] * direction[rows][:, None, :]
    columns = nodes[:, :, None] * dim + np.arange(dim)
    start = np.concatenate([[0], np.cumsum(pairing.paired) * (nodes.shape[1] * dim)])
    matrix = csr_array((values.ravel(), columns.ravel(), start), shape=(len(candidates.nodes), n_dofs))
    matrix.sum_duplicates()
    return matrix
