"""Rigid surfaces of facets: lines in 2D, triangles and quadrangles in 3D, straight or curved."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fastcontact._tools.argument_types import typed
from fastcontact.arrays import Array, Mask
from fastcontact.contact.obstacles._facets import rigid_facets
from fastcontact.contact.projection import (
    SMALL_OVERHANG,
    Closest,
    DeformedSide,
    closest_of_types,
    distance_from_edges,
    facet_points,
    facets_containing,
    interpolate,
)
from fastcontact.elasticity.loads import solid_points
from fastcontact.errors import ContactError
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.mesh.mesh import Mesh
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SINGLE_PRECISION


@typed(ContactError)
@dataclass(frozen=True, eq=False)
class MeshedSurface:
    """A rigid surface given by a group of facets of a mesh.

    Normals must point out of the obstacle, towards the body. In 2D the normal of a line points to the right of the direction
    from its first to its second node. In 3D the nodes of a face are in counter-clockwise order, seen from the tip of its
    normal. Facets on the outside of solid cells are an exception: their normals point out of these cells. Distances from
    curved facets are exact. Beyond the border of an open surface there is no contact.

    Parameters
    ----------
    mesh : Mesh
        A mesh that contains the surface. It may be the mesh of the model if no point of the group belongs to solid cells.
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
    # The facets, and whether each node lies on the border of the surface.
    _facets: tuple[DeformedSide, Mask] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if not 0.0 <= self.crease <= 180.0:
            raise ContactError(f"crease = {self.crease} of the rigid surface '{self.group}' must be 0 to 180 degrees")
        object.__setattr__(self, "_facets", rigid_facets(self.mesh, self.group, self.flip, self.crease))

    def __repr__(self) -> str:
        return f"MeshedSurface('{self.group}', {self._facets[0].surface.n_facets} facets)"

    def check_apart(self, mesh: Mesh) -> None:
        """Raise ContactError if the surface is part of `mesh` and belongs to solid cells there."""
        if mesh.points is not self.mesh.points and not np.array_equal(mesh.points, self.mesh.points):
            return
        shared = np.intersect1d(self.mesh.points_of(self.group), solid_points(mesh, None))
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
        side = self._facets[0].surface
        closest = closest_of_types(points, side.node_positions(self.mesh.points))
        pseudonormal, averaged, on_edge, on_border = self._closest_normals(closest)
        offset = points - closest.position
        size = np.concatenate([block.diameters(self.mesh.points) for block in side.blocks])[closest.facet]
        # At touching points, the direction from the closest point is dominated by round-off, and the facet normal is used.
        is_touching = closest.distance <= SINGLE_PRECISION * size
        outside = np.einsum("nd,nd->n", offset, pseudonormal) >= 0
        distance = np.where(outside, closest.distance, -closest.distance)
        normal = averaged if self.crease else np.where(on_edge[:, None], averaged, closest.normal)
        pseudonormal = unit_vectors(pseudonormal)
        # Next to a sharp edge the normal has the direction from the closest point to the point, not that of a facet normal.
        sharp = np.einsum("nd,nd->n", pseudonormal, averaged) < np.cos(np.radians(0.5 * self.crease)) - LENGTH_ROUND_OFF
        is_corrected = on_edge & sharp & ~is_touching
        normal[is_corrected] = offset[is_corrected] / distance[is_corrected, None]
        height = np.abs(np.einsum("nd,nd->n", offset, pseudonormal))
        overhang = np.sqrt(np.maximum(closest.distance**2 - height**2, 0.0))
        # At a plane of symmetry, the last facet may be inclined to the smooth surface of the full model by up to half the
        # crease angle. Points slightly beyond its border must therefore remain in contact.
        slope = np.tan(np.radians(0.5 * MeshedSurface.crease))
        beyond_border = on_border & (overhang > SMALL_OVERHANG * size) & (overhang > slope * height)
        return np.where(beyond_border, np.inf, distance), normal

    def _closest_normals(self, closest: Closest) -> tuple[Array, Array, Mask, Mask]:
        """Return pseudonormals (n, dim), smooth normals (n, dim), and which projections lie on edges and on the border.

        The pseudonormal always gives the correct sign of the distance. It is the facet normal inside a facet, the mean normal
        of the adjacent facets on an edge, and the angle-weighted mean normal of all facets at a corner (Baerentzen and
        Aanaes, 2005).
        """
        (facets, border), (facet, xi) = self._facets, closest[:2]
        side = facets.surface
        feet, on_edge = facet_points(side, facet, xi), distance_from_edges(side, facet, xi) <= ROUND_OFF
        node = feet.local[np.arange(len(facet)), feet.shape.argmax(axis=1)]
        at_node = on_edge & (feet.shape.max(axis=1) >= 1.0 - ROUND_OFF)
        pseudonormal = np.where(at_node[:, None], facets.nodal_normals[node], closest.normal)
        on_border = at_node & border[node]
        rows = np.flatnonzero(on_edge & ~at_node)
        if len(rows):
            point, adjacent, adjacent_xi = facets_containing(side, facet[rows], xi[rows])
            is_other = adjacent != facet[rows][point]
            adjacent_feet = facet_points(side, adjacent[is_other], adjacent_xi[is_other])
            other_normals = interpolate(facets.facet_normals[adjacent[is_other]], adjacent_feet)
            np.add.at(pseudonormal, rows[point[is_other]], other_normals)
            on_border[rows] = np.bincount(point) == 1
        return pseudonormal, interpolate(facets.smooth_normals[facet], feet), on_edge, on_border
