"""Rigid surfaces of facets: lines in 2D, triangles and quadrangles in 3D, straight or curved."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.obstacles._facets import Block, SurfaceFacets, surface_facets
from fastcontact.contact.projection import BESIDE, Closest, closest_of_kinds
from fastcontact.contact.surface import by_block
from fastcontact.errors import ContactError
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SINGLE_PRECISION


@typed(ContactError)
@dataclass(frozen=True, eq=False)
class MeshedSurface:
    """A rigid surface given by a group of facets of a mesh.

    Normals point out of the obstacle, towards the body. In 2D they point to the right of the direction of a line, in 3D
    to the side from which the nodes of a face run counter-clockwise. Normals of facets on the outside
    of solid cells of their mesh point out of these cells. Distances to the closest point of the curved facets are exact.
    Beyond the border of an open surface there is no contact.

    Parameters
    ----------
    mesh : Mesh
        The mesh of the surface, or that of the model, in which the points of the group must not belong to solid cells.
    group : str
        A group of facets.
    flip : bool
        Whether to reverse all normals.
    crease : float
        Facets that meet at this angle or less form a smooth surface with continuous normals; at larger angles the edge
        is sharp [degrees]. With 0 each facet has its own normals.

    Raises
    ------
    MeshError
        If there is no such group.
    ContactError
        If the group contains no facets, a facet has no area, an edge is shared by facets of opposite orientation or by more
        than two facets, or `crease` is out of range.

    Examples
    --------
    >>> mesh = Mesh([[-1.0, 0.0], [1.0, 0.0]], {"line2": [[1, 0]]}, cell_groups={"FLOOR": [0]})
    >>> distance, normal = MeshedSurface(mesh, "FLOOR").distance(np.array([[0.2, 0.5]]))
    >>> distance.tolist(), normal.tolist()
    ([0.5], [[0.0, 1.0]])
    """

    mesh: Mesh
    group: str
    flip: bool = False
    crease: float = 30.0
    _facets: SurfaceFacets = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.crease <= 180.0:
            raise ContactError(f"crease = {self.crease} of the rigid surface '{self.group}' must be 0 to 180 degrees")
        object.__setattr__(self, "_facets", surface_facets(self.mesh, self.group, self.flip, self.crease))

    def __repr__(self) -> str:
        return f"MeshedSurface('{self.group}', {len(self._facets.beyond)} facets)"

    def check_apart(self, mesh: Mesh) -> None:
        """Raise ContactError if the surface is part of `mesh` and belongs to solid cells there."""
        if mesh.points is not self.mesh.points and not np.array_equal(mesh.points, self.mesh.points):
            return
        solid = np.zeros(mesh.n_points, bool)
        for cells in mesh.solids.values():
            solid[cells] = True
        shared = self.mesh.points_of(self.group)
        shared = shared[solid[shared]]
        if len(shared):
            raise ContactError(
                f"points of the rigid surface '{self.group}' belong to solid cells of the model (number: {len(shared)}, "
                f"first: point {shared[0]}): a rigid surface must be separate, so give it separate points or a separate mesh"
            )

    def distance(self, points: Array) -> tuple[Array, Array]:
        """See `Obstacle.distance`. The distance is infinite beyond the border of an open surface."""
        dim = self.mesh.dim
        if points.shape[1] != dim:
            raise ContactError(
                f"the rigid surface '{self.group}' has {dim} dimensions, but the model {points.shape[1]}"
            )
        closest = closest_of_kinds(points, [block.corners for block in self._facets.blocks])
        pseudonormal, smooth, on_edge, on_border = self._closest_normals(closest)
        offset = points - closest.position
        extents = [np.linalg.norm(np.ptp(block.corners, axis=1), axis=1) for block in self._facets.blocks]
        size = np.concatenate(extents)[closest.facet]
        # At touching points, the direction from the closest point is dominated by round-off, and the facet normal is used.
        is_touching = closest.distance <= SINGLE_PRECISION * size
        outside = np.einsum("nd,nd->n", offset, pseudonormal) >= 0
        distance = np.where(outside, closest.distance, -closest.distance)
        normal = smooth if self.crease else np.where(on_edge[:, None], smooth, closest.normal)
        pseudonormal /= np.linalg.norm(pseudonormal, axis=1, keepdims=True)
        # Next to a sharp edge the normal has the direction from the closest point to the point, not that of a facet normal.
        sharp = np.einsum("nd,nd->n", pseudonormal, smooth) < np.cos(np.radians(0.5 * self.crease)) - LENGTH_ROUND_OFF
        is_corrected = on_edge & sharp & ~is_touching
        normal[is_corrected] = offset[is_corrected] / distance[is_corrected, None]
        height = np.abs(np.einsum("nd,nd->n", offset, pseudonormal))
        overhang = np.sqrt(np.maximum(closest.distance**2 - height**2, 0.0))
        # At a plane of symmetry, the last facet may be inclined to the smooth surface of the full model by up to half the
        # crease angle. Points slightly beyond its border must therefore remain in contact.
        slope = np.tan(np.radians(0.5 * MeshedSurface.crease))
        beyond_border = on_border & (overhang > BESIDE * size) & (overhang > slope * height)
        return np.where(beyond_border, np.inf, distance), normal

    def _closest_normals(self, closest: Closest) -> tuple[Array, Array, Mask, Mask]:
        """Return pseudonormals (n, dim), smooth normals (n, dim), and which projections lie on edges and on the border.

        The pseudonormal always gives the correct sign of the distance. It is the facet normal inside a facet, the mean normal
        of the adjacent facets on an edge, and the angle-weighted mean normal of all facets at a corner (Baerentzen and
        Aanaes, 2005).
        """
        pseudonormal, smooth = closest.normal.copy(), np.empty_like(closest.normal)
        on_edge, on_border = np.zeros(len(pseudonormal), bool), np.zeros(len(pseudonormal), bool)
        facets = self._facets
        of_blocks = by_block(closest.facet, [len(block.nodes) for block in facets.blocks])
        for block, normals, (in_block, rows) in zip(facets.blocks, facets.smooth, of_blocks, strict=True):
            xi = closest.xi[in_block]
            mean = np.einsum("nk,nkd->nd", block.element.shape(xi), normals[rows])
            smooth[in_block] = mean / np.linalg.norm(mean, axis=1, keepdims=True)
            corner, edge = _corners_and_edges(block, xi)
            at_corner, at_edge = np.flatnonzero(corner >= 0), np.flatnonzero(edge >= 0)
            node = block.nodes[rows[at_corner], corner[at_corner]]
            pseudonormal[in_block[at_corner]] = facets.at_points[node]
            on_border[in_block[at_corner]] = facets.on_border[node]
            projections, edges = in_block[at_edge], edge[at_edge]
            beyond = facets.beyond[closest.facet[projections], edges]
            pseudonormal[projections] += self._normals_beyond_edges(block, rows[at_edge], edges, beyond, xi[at_edge])
            on_border[projections] = beyond < 0
            on_edge[in_block] = (corner >= 0) | (edge >= 0)
        return pseudonormal, smooth, on_edge, on_border

    def _normals_beyond_edges(self, block: Block, rows: Indices, edge: Indices, beyond: Indices, xi: Array) -> Array:
        """Return the normals (n, 3) of the facets `beyond` edges, at the same points; zero where there is none."""
        ends = np.array(block.element.edges)[edge]
        a, b = block.element.nodes[ends[:, 0]], block.element.nodes[ends[:, 1]]
        fraction = np.linalg.norm(xi - a, axis=1) / np.linalg.norm(b - a, axis=1)
        directions = np.zeros((len(rows), self.mesh.dim))
        facets, of_blocks = self._facets, by_block(beyond, [len(block.nodes) for block in self._facets.blocks])
        for block_beyond, normals, (in_block, facet) in zip(facets.blocks, facets.normals, of_blocks, strict=True):
            for weight, end in ((1.0 - fraction, ends[:, 0]), (fraction, ends[:, 1])):
                node = block.nodes[rows[in_block], end[in_block]]
                local = np.argmax(block_beyond.nodes[facet] == node[:, None], axis=1)
                directions[in_block] += weight[in_block, None] * normals[facet, local]
        return directions


def _corners_and_edges(block: Block, xi: Array) -> tuple[Indices, Indices]:
    """Return the corners (n,) and edges (n,) of facets on which points with reference coordinates `xi` lie, -1 for none."""
    element = block.element
    none = np.full(len(xi), -1, np.intp)
    if element.dim == 1:
        s = xi[:, 0]
        return np.where(s <= -1.0 + ROUND_OFF, 0, np.where(s >= 1.0 - ROUND_OFF, 1, none)), none
    edges = np.array(element.edges)
    a, b = element.nodes[edges[:, 0]], element.nodes[edges[:, 1]]
    across = np.column_stack([a[:, 1] - b[:, 1], b[:, 0] - a[:, 0]])
    is_on = np.einsum("nej,ej->ne", xi[:, None] - a[None], across) <= ROUND_OFF * np.einsum("ej,ej->e", across, across)
    corner = none.copy()
    for k in range(element.n_corners):
        edges_of_corner = np.flatnonzero((edges == k).any(axis=1))
        corner[is_on[:, edges_of_corner].all(axis=1)] = k
    return corner, np.where((corner < 0) & is_on.any(axis=1), np.argmax(is_on, axis=1), -1)
