"""Pairing: project secondary points onto primary facets, and compute the derivatives of their gaps and slips.

Mortar contact in 3D pairs facets with facets instead, see `formulations._cut_faces`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TypeAlias

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import field, record, replace
from fastcontact.arrays import Array, Indices, Mask, Numbers
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.projection import (
    Closest,
    DeformedSide,
    FacetPoints,
    along_line_normals,
    along_normals,
    closest_of_types,
    distance_from_edges,
    facet_points,
    interpolate,
    smooth_ends,
)
from fastcontact.contact.surface import Surface, padded
from fastcontact.errors import ContactError, unknown
from fastcontact.linear.sparse_rows import rows_of
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.round_off import LENGTH_ROUND_OFF

# Largest overhang, in facet lengths, at which a point is still paired with a facet end where the surface continues smoothly,
# and with any edge in 3D by default. When a body slides beyond an edge or a plane of symmetry, its nodes lose contact one
# after the other. With a smaller tolerance, nodes near the edge alternate between paired and unpaired.
OVERHANG = 0.5
# Fraction of each facet over which its normals vary towards an edge if edges are rounded.
ROUNDED_FRACTION = 0.1
# Cosine of the angle, about 84 degrees, between a normal and the opposite of the other normal beyond which two sides do not
# face each other. It is also the length of the mean unit normal below which a surface, because it is closed, has no mean
# direction.
FACING = 0.1
Normals: TypeAlias = str | Sequence[float]
KINDS = ("facet", "averaged", "secondary")


@record
class Candidates:
    """Points of the secondary side at which the gap is measured, as weighted combinations of nodes.

    Attributes
    ----------
    nodes : ndarray of int (n, k)
        Point numbers of the k nodes of each candidate.
    shape : ndarray (n, k)
        Weight of each node, the value of its shape function [-].
    facet : ndarray of int (n,)
        Number of the secondary facet on which each candidate lies; facets are numbered consecutively through all blocks.
        Empty if it is not needed.
    xi : ndarray (n, dim - 1)
        Reference coordinates of each candidate in its facet [-]; empty if they are not needed.
    """

    nodes: Numbers
    shape: Array
    facet: Indices = field(default_factory=np.empty(0, np.intp).copy)
    xi: Array = field(default_factory=np.empty(0).copy)

    @classmethod
    def in_facets(cls, side: Surface, xi: Sequence[Array]) -> Candidates:
        """Return candidates at the same reference coordinates `xi` in all facets of a block.

        `xi` contains an array (n_q, dim - 1) for each block of `side` [-].
        """
        facet = np.repeat(np.arange(side.n_facets), np.repeat([len(of_block) for of_block in xi], side.sizes))
        blocks = list(zip(side.blocks, side.sizes, xi, strict=True))
        nodes = [np.repeat(block.facets, len(of_block), axis=0) for block, _, of_block in blocks]
        shapes = [np.tile(elements.get(block.element).shape(of_block), (n, 1)) for block, n, of_block in blocks]
        coordinates = [np.tile(of_block, (n, 1)) for _, n, of_block in blocks]
        return cls(padded(nodes), padded(shapes), facet, np.concatenate(coordinates))

    @classmethod
    def from_nodes(cls, nodes: Numbers) -> Candidates:
        """Return the `nodes` (n,), given by their point numbers, as candidates."""
        return cls(nodes[:, None], np.ones((len(nodes), 1)))

    @classmethod
    def from_side(cls, side: Surface) -> Candidates:
        """Return the nodes of a side as candidates; each is located on one of its facets."""
        facet, xi = np.zeros(len(side.points), np.intp), np.zeros((len(side.points), 1))
        for block, first in zip(side.blocks, side.offsets):
            xi_of_nodes = elements.get(block.element).nodes
            xi = np.broadcast_to(xi, (len(xi), xi_of_nodes.shape[1])).copy()
            facet[block.local] = first + np.arange(len(block.local))[:, None]
            xi[block.local] = xi_of_nodes
        return cls(side.points[:, None], np.ones((len(side.points), 1)), facet, xi)

    def positions(self, coordinates: Array) -> Array:
        """Return the positions (n, dim) for nodal `coordinates` (n_points, dim) [length]."""
        return np.einsum("nk,nkd->nd", self.shape, coordinates[self.nodes])

    def belonging_to(self, mask: Mask) -> Mask:
        """Return for which candidates (n,) the node with the largest weight is in `mask` (n_points,)."""
        inside = mask[self.nodes]
        largest = np.where(inside, self.shape, -np.inf).max(axis=1)
        return largest > np.where(inside, -np.inf, self.shape).max(axis=1) + LENGTH_ROUND_OFF


@record
class Pairing:
    """Projection of each candidate onto the primary side.

    Attributes
    ----------
    facet : ndarray of int (n,)
        Number of the opposite primary facet; facets are numbered consecutively through all blocks.
    xi : ndarray (n, dim - 1)
        Reference coordinates of the projection in this facet [-].
    normal : ndarray (n, dim)
        Unit outward normal of the primary side at the projection, as selected by the option `normals` [-].
    paired : ndarray of bool (n,)
        Whether the candidate is paired; False beyond the end of the primary surface.
    offset : ndarray (n,), optional
        Gap minus ``normal . x``, where x is the position of the candidate, for a rigid obstacle [length]; None for facets.
    beyond : ndarray (n, dim - 1), optional
        Overhang of the candidate beyond the end of the primary surface, in reference coordinates of the facet whose straight
        extension the candidate faces [-]; zero for other candidates, and None if no candidate overhangs.
    primary : Surface, optional
        The primary side; None for a rigid obstacle.
    """

    facet: Indices
    xi: Array
    normal: Array
    paired: Mask
    offset: Array | None = None
    beyond: Array | None = None
    primary: Surface | None = None

    @cached_property
    def rows(self) -> Indices:
        """Numbers (q,) of the paired candidates."""
        return np.flatnonzero(self.paired)

    @cached_property
    def feet(self) -> FacetPoints:
        """The projections of the q paired candidates onto the facets of a meshed primary side."""
        assert self.primary is not None
        return facet_points(self.primary, self.facet[self.rows], self.xi[self.rows])

    def extended_feet(self, rows: Indices) -> FacetPoints:
        """Return the projections of the candidates `rows` (n,) onto facets and their straight extensions.

        Candidates beyond the end of the primary surface are projected onto the extension of their facet.
        """
        assert self.primary is not None
        of_rows = np.array_equal(rows, self.rows)
        feet = self.feet if of_rows else facet_points(self.primary, self.facet[rows], self.xi[rows])
        if self.beyond is None:
            return feet
        return replace(feet, shape=feet.shape + np.einsum("nkj,nj->nk", feet.gradient, self.beyond[rows]))


def pair(
    candidates: Array, primary: DeformedSide | RigidSide, projection_tolerance: float,
    normals: str | Sequence[float] = "facet", obstacle: Pose | None = None, rounded: bool = False,
) -> Pairing:  # fmt: skip
    """Project candidates onto the closest facets of the primary side, or onto a rigid obstacle.

    Parameters
    ----------
    candidates : ndarray (n, dim)
        Positions of the candidates [length].
    primary : DeformedSide or RigidSide
    projection_tolerance : float
        Largest overhang beyond the end of the primary surface at which a candidate is paired, in facet lengths [-]
        (TOLE_PROJ_EXT of code_aster). It then faces the straight extension of the facet, so that the forces on both
        sides have the same line of action, and their moments are in equilibrium.
    normals : str or sequence of float
        ``"facet"`` for the normals of facets, a unit vector (dim,) for this normal everywhere, or any other string for
        normals interpolated between averaged nodal normals, which are continuous except at corners. Unless they are
        ``"facet"`` normals, candidates are projected along them.
    obstacle : Pose, optional
        Position and rotation of a rigid obstacle.
    rounded : bool
        Whether the normals of facets vary continuously across edges.

    Returns
    -------
    Pairing

    Raises
    ------
    ContactError
        If a projection does not converge; see `projection.closest`.
    """
    if isinstance(primary, RigidSide):
        pose = Pose(np.zeros(candidates.shape[1])) if obstacle is None else obstacle
        _, normal, paired, offset = primary.project(candidates, pose)
        no_facet = np.zeros(len(candidates), np.intp)
        return Pairing(no_facet, np.zeros((len(candidates), candidates.shape[1] - 1)), normal, paired, offset)
    closest = closest_of_types(candidates, primary.surface.node_positions(primary.coordinates))
    if normals == "facet" and not rounded:
        at_smooth_end = _at_smooth_ends(primary, closest)
        paired = closest.overhang <= np.where(at_smooth_end, max(projection_tolerance, OVERHANG), projection_tolerance)
        overhangs = paired & ~at_smooth_end & (closest.overhang > LENGTH_ROUND_OFF)
        pairing = Pairing(closest.facet, closest.xi, closest.normal, paired, primary=primary.surface)
        return _with_overhang(pairing, candidates, primary, overhangs) if overhangs.any() else pairing
    at_nodes = primary.smooth_normals
    if not isinstance(normals, str):
        at_nodes = np.broadcast_to(np.array(normals), at_nodes.shape).copy()
    project = along_normals if candidates.shape[1] == 3 else along_line_normals
    facet, xi, overhang, normal = project(candidates, primary, at_nodes, closest)
    if normals == "facet":
        normal = _round_edges(primary, facet, xi, normal)
    paired = overhang <= projection_tolerance
    overhangs = paired & (overhang > LENGTH_ROUND_OFF)
    pairing = Pairing(facet, xi, normal, paired, primary=primary.surface)
    return _with_overhang(pairing, candidates, primary, overhangs) if overhangs.any() else pairing


def _round_edges(primary: DeformedSide, facet: Indices, xi: Array, mean: Array) -> Array:
    """Return normals (n, dim) of facets that vary continuously across edges.

    In equilibrium a node may lie on the edge between two facets, with a contact force in a direction between their normals.
    With the normal of a single facet, the pairing would then alternate between the two facets. On a rounded edge the
    direction of the force follows from the position of the node.

    Parameters
    ----------
    primary : DeformedSide
    facet : ndarray of int (n,)
        Number of the facet of each point.
    xi : ndarray (n, dim - 1)
        Reference coordinates in the facet [-].
    mean : ndarray (n, dim)
        Averaged normals at the points, which are the result at edges [-]. Over ROUNDED_FRACTION of the facet, the result
        changes to the normal of the facet.
    """
    normals = interpolate(primary.facet_normals[facet], facet_points(primary.surface, facet, xi))
    weight = np.clip(1.0 - distance_from_edges(primary.surface, facet, xi) / ROUNDED_FRACTION, 0.0, 1.0)[:, None]
    normal = weight * mean + (1.0 - weight) * normals
    return unit_vectors(normal)


def _with_overhang(pairing: Pairing, candidates: Array, primary: DeformedSide, overhangs: Mask) -> Pairing:
    """Return the pairing with the overhang, `Pairing.beyond`, of the candidates that the mask `overhangs` (n,) marks."""
    rows = np.flatnonzero(overhangs)
    feet = facet_points(primary.surface, pairing.facet[rows], pairing.xi[rows])
    nodes = primary.coordinates[feet.nodes]
    offset = candidates[rows] - np.einsum("nk,nkd->nd", feet.shape, nodes)
    basis = np.concatenate([np.einsum("nkj,nkd->ndj", feet.gradient, nodes), pairing.normal[rows][:, :, None]], axis=2)
    beyond = np.zeros_like(pairing.xi)
    beyond[rows] = np.linalg.solve(basis, offset[:, :, None])[:, :-1, 0]
    return replace(pairing, beyond=beyond)


def _at_smooth_ends(primary: DeformedSide, closest: Closest) -> Mask:
    """Return which candidates (n,) overhang the end of a line facet where an adjacent facet continues it smoothly.

    Near a node between two facets, points outside a convex or inside a concave line lie beyond the ends of both facets, but
    not beyond the end of the surface. In 3D the result is False for all candidates.
    """
    overhangs = closest.overhang > 0.0
    if closest.position.shape[1] == 3 or not overhangs.any():
        return np.zeros(len(overhangs), bool)
    smooth = smooth_ends(primary.surface, primary.smooth_normals)
    return np.asarray(overhangs & smooth[closest.facet, (closest.xi[:, 0] > 0.0).astype(np.intp)])


def gap_rows(motion: csr_array, pairing: Pairing, reference: Array) -> tuple[csr_array, Array]:
    """Return G and gap0 of the gaps ``gap0 + G u`` of candidates.

    The gap of a candidate is ``n . (x_secondary - x_primary)`` with the normal n, the position x_secondary of the candidate
    and the position x_primary of its projection. The facet, the reference coordinates and the normal of `pairing` are
    constant, so that the gap is a linear function of the displacements u (n_dofs,) of all points.

    Parameters
    ----------
    motion : csr_array (n, n_points)
        The `relative_motion` of the candidates [-].
    pairing : Pairing
    reference : ndarray (n_points, dim)
        Undeformed coordinates of all points [length].

    Returns
    -------
    G : csr_array (n, n_dofs)
        Derivatives of the gaps [-]; rows of unpaired candidates are empty.
    gap0 : ndarray (n,)
        Gaps at u = 0 [length].
    """
    G = rows_of(motion, pairing.normal)
    gap0 = G @ reference.ravel()
    if pairing.offset is not None:
        gap0 += np.where(pairing.paired, pairing.offset, 0.0)
    return G, gap0


def tangents(normal: Array, held: Array | None = None) -> list[Array]:
    """Return unit tangents (n, dim) that form an orthonormal basis with the unit normals `normal` (n, dim).

    There is one tangent in 2D, and there are two in 3D. In 3D an axis perpendicular to the mean normal is rotated at each
    point by the smallest rotation from the mean normal to the normal, and the second tangent completes the basis. Tangents
    then vary as smoothly as normals, so that components of tractions along them can be interpolated. The choice of the first
    axis does not matter.

    `held` (n, 3, 3) are projectors onto the directions in which supports hold displacements. If they are given, the tangents
    are rotated about the normal so that the first one lies as far as possible in these directions.
    """
    if normal.shape[1] == 2:
        return [np.column_stack([normal[:, 1], -normal[:, 0]])]
    mean = normal[np.isfinite(normal).all(axis=1)].sum(axis=0)
    length = np.linalg.norm(mean)
    mean = mean / length if length > LENGTH_ROUND_OFF * len(normal) else np.array([0.0, 0.0, 1.0])
    axis = np.cross(np.eye(3)[np.argmin(np.abs(mean))], mean)
    axis /= np.linalg.norm(axis)
    if held is not None:  # otherwise the sign of the principal axes below could be round-off
        in_plane = np.eye(3) - np.outer(mean, mean)
        size, vectors = np.linalg.eigh(in_plane @ held.sum(axis=0) @ in_plane)
        axis = vectors[:, -1] if size[-1] > LENGTH_ROUND_OFF * len(held) else axis
    # Rotate the axis by the rotation from the mean normal to the normal. If these are opposite, the axis stays unchanged.
    scale = 1.0 + normal @ mean
    slope = np.divide(normal @ axis, scale, out=np.zeros(len(normal)), where=scale > LENGTH_ROUND_OFF)
    first = axis - slope[:, None] * (mean + normal)
    # Where the normal and the mean normal are opposite up to round-off, the tangent is not yet perpendicular to the normal.
    first = unit_vectors(first - np.einsum("nd,nd->n", first, normal)[:, None] * normal)
    second = np.cross(normal, first)
    if held is not None:  # the principal axis of the projector in the tangent plane
        pairs = (first, first), (first, second), (second, second)
        ff, fs, ss = (np.einsum("nd,nde,ne->n", a, held, b) for a, b in pairs)
        angle = 0.5 * np.arctan2(2 * fs, ff - ss)[:, None]
        first = np.cos(angle) * first + np.sin(angle) * second
        second = np.cross(normal, first)
    return [first, second]


def normals(directions: Sequence[Array]) -> Array:
    """Return the unit normals (n, dim), given the unit tangents `directions` that `tangents` returns for them."""
    if len(directions) == 1:
        return np.column_stack([-directions[0][:, 1], directions[0][:, 0]])
    return np.cross(directions[0], directions[1])


def relative_motion(candidates: Candidates, pairing: Pairing, n_points: int) -> csr_array:
    """Return the map (n, n_points) from nodal vectors to the differences between candidates and their projections [-].

    Rows of unpaired candidates are empty.
    """
    nodes, weights = candidates.nodes[pairing.rows], candidates.shape[pairing.rows]
    if pairing.primary is not None:
        feet = pairing.extended_feet(pairing.rows)
        nodes, weights = np.hstack([nodes, feet.nodes]), np.hstack([weights, -feet.shape])
    start = np.concatenate([[0], np.cumsum(pairing.paired) * nodes.shape[1]])
    motion = csr_array((weights.ravel(), nodes.ravel(), start), shape=(len(candidates.nodes), n_points))
    motion.sum_duplicates()
    return motion


def checked_normals(normals: Normals, points: Array, primary: Surface | RigidSide) -> str | tuple[float, ...]:
    """Return a key of `KINDS`, or a unit vector (dim,); `points` (n_points, dim) are reference coordinates [length].

    Raises
    ------
    ContactError
        If `normals` is neither, if the vector points into the body behind `primary`, or if `primary` is a rigid obstacle,
        which has its own normals.
    """
    dim = points.shape[1]
    if isinstance(normals, str):
        if normals not in KINDS:
            raise ContactError(unknown("kind of normals", normals, [*KINDS, "a vector"]))
        result: str | tuple[float, ...] = normals
    else:
        vector = np.asarray(normals, float)
        length = np.linalg.norm(vector)
        if vector.shape != (dim,) or not (np.isfinite(length) and length > 0):
            raise ContactError(f"normals = {normals!r} must be one of {', '.join(KINDS)}, or a vector of {dim} numbers")
        result = tuple((vector / length).tolist())
        if (
            isinstance(primary, Surface)
            and (DeformedSide(primary, points).nodal_normals @ vector).mean() <= FACING * length
        ):
            raise ContactError(
                f"normals = {normals!r} must point out of the body of '{primary.group}', the primary side: reverse the vector"
            )
    if isinstance(primary, RigidSide) and result not in ("facet", "averaged"):
        raise ContactError(f"normals = {normals!r} are for contact between bodies: a rigid obstacle has its own")
    return result
