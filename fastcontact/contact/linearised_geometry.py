r"""Linearised contact geometry: variation of contact forces and gaps with the displacements.

The rows of constraints depend on the displacements: points slide over the facets they face, and normals rotate. A
secondary point :math:`x`, with shape functions :math:`N_s` and contact force :math:`p = \lambda n`, faces the primary
point :math:`y(\xi) = \sum_k N_k(\xi) y_k`, with the normal n. For a variation of the displacements its nodal forces and
its gap vary, in addition to the rows themselves, by

.. math:: \delta f = N_s^T \delta p - N^T \delta p - N_{,\alpha}^T p \, \delta \xi^\alpha, \qquad
          \delta p = \lambda \, \delta n, \qquad
          \delta g = - n \cdot y_{,\alpha} \delta \xi^\alpha + (x - y) \cdot \delta n

(Laursen, Computational Contact and Impact Mechanics, 2002, section 5.3; Wriggers, Computational Contact Mechanics, 2006,
chapter 9; for mortar Popp, Gee and Wall, 2009), without friction.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Protocol

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.pairing import Candidates, Pairing, tangents
from fastcontact.contact.projection import (
    Places,
    at_nodes_of_facets,
    facet_angles,
    facet_normals,
    places,
    smooth_normals,
)
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import shapes_at
from fastcontact.mesh import elements
from fastcontact.round_off import DIFFERENCES


class Linearised(Protocol):
    """Contact forces and gaps of one pair, linearised at its pairing and multipliers."""

    def along(self, du: Array) -> tuple[Array, Array]:
        """Return how nodal forces (n_points, dim) [force] and gaps (m,) [length] vary with displacements (n_points, dim)."""
        ...


# A function of the multipliers (m,) [force].
Geometry = Callable[[Array], Linearised]


class NodalNormals:
    """Variation of the `nodal_normals` of a side at `coordinates` (n_points, dim) [length], with fixed facet angles."""

    def __init__(self, side: Surface, coordinates: Array) -> None:
        self._side, self._parts = side, []
        total = np.zeros((len(side.points), coordinates.shape[1]))
        for block in side.blocks:
            element, corners = elements.get(block.element), coordinates[block.facets]
            slope = element.gradient(element.nodes)
            axes = np.einsum("qka,fkd->fqad", slope, corners)
            normal, angle = facet_normals(block, coordinates), facet_angles(element, corners)
            up = np.linalg.solve(np.einsum("fqad,fqbd->fqab", axes, axes), axes)
            np.add.at(total, block.local, angle[:, :, None] * normal)
            self._parts.append((block, slope, normal, angle[:, :, None, None] * up))
        side.add_across_ends(total)
        self._length = np.linalg.norm(total, axis=1, keepdims=True)
        self._mean = total / self._length

    def along(self, du: Array) -> Array:
        """Return how the normals (m, dim) vary with displacements (n_points, dim) [length]."""
        total = np.zeros_like(self._mean)
        for block, slope, normal, up in self._parts:
            leans = np.einsum("fqk,qka->fqa", normal @ np.swapaxes(du[block.facets], 1, 2), slope)
            np.add.at(total, block.local, -np.einsum("fqad,fqa->fqd", up, leans))
        self._side.add_across_ends(total)
        return across(self._mean, total) / self._length


def across(normal: Array, vector: Array) -> Array:
    """Return the components of vectors (n, dim) perpendicular to unit vectors (n, dim)."""
    return np.asarray(vector - np.einsum("nd,nd->n", normal, vector)[:, None] * normal)


class Variation(NamedTuple):
    """Variation of projections: reference coordinates (n, dim - 1), the point faced at fixed facet, normals (n, dim)."""

    xi: Array
    foot: Array
    normal: Array


class _SurfacePoints:
    """Points that face a meshed side, and the variation of their projections and normals.

    Parameters
    ----------
    candidates : Candidates
    pairing : Pairing
    rows : ndarray of int (n,)
        Rows of the points in `candidates`.
    primary : Surface
    coordinates : ndarray (n_points, dim)
        [length]
    normals : str or tuple of float
        Normals of the primary side: ``"facet"``, ``"averaged"``, or a fixed vector.
    along : ndarray (n, dim), optional
        Fixed directions of the projection; None for the normals themselves, and closest points for facet normals.
    """

    def __init__(
        self, candidates: Candidates, pairing: Pairing, rows: Indices, primary: Surface, coordinates: Array,
        normals: object, along: Array | None,
    ) -> None:  # fmt: skip
        at, n_points, facet = pairing.places(primary, rows), len(coordinates), pairing.facet[rows]
        nodes, shape = np.hstack([candidates.nodes[rows], at.nodes]), np.hstack([candidates.shape[rows], -at.shape])
        self._motion = shapes_at(shape, nodes, n_points)  # motion of points relative to the facing points
        self._slopes = [shapes_at(slope, at.nodes, n_points) for slope in np.moveaxis(at.gradient, 2, 0)]
        self._spreading = [csr_array(matrix.T) for matrix in (self._motion, *self._slopes)]
        self.axes = np.stack([slope @ coordinates for slope in self._slopes], axis=1)
        self.apart = self._motion @ coordinates
        self.normal = pairing.normal[rows]
        self._nodal: NodalNormals | None = None
        if normals == "facet":
            self._bend = self._facet_normals(primary, coordinates, facet, pairing.xi[rows], at)
        elif isinstance(normals, str):
            self._bend = self._averaged(primary, coordinates, facet, at)
        else:
            self._bend = np.zeros_like(self.axes)
        self._varies = isinstance(normals, str)
        # The component along the direction d of the projection is left out of ``a_i dxi_i + g dn = dv``.
        frame = np.stack(tangents(self.normal if along is None else along), axis=1)
        self._gap = (
            np.einsum("nd,nd->n", self.apart, self.normal)[:, None] if along is None else np.zeros((len(rows), 1))
        )
        inverse = np.linalg.inv(np.einsum("ntd,nid->nti", frame, self.axes + self._gap[:, :, None] * self._bend))
        self._inverse = inverse @ frame

    def _facet_normals(self, primary: Surface, coordinates: Array, facet: Indices, xi: Array, at: Places) -> Array:
        """Prepare the variation of facet normals; return their derivatives (n, dim - 1, dim) along the facet."""
        self._up = np.linalg.solve(np.einsum("nid,njd->nij", self.axes, self.axes), self.axes)
        second = _second_derivatives(primary, facet, xi)
        curvature = np.einsum("nkij,nkd,nd->nij", second, coordinates[at.nodes], self.normal)
        return -np.einsum("njd,nij->nid", self._up, curvature)

    def _averaged(self, primary: Surface, coordinates: Array, facet: Indices, at: Places) -> Array:
        """Prepare the variation of interpolated normals; return their derivatives (n, dim - 1, dim) along the facet."""
        at_nodes = at_nodes_of_facets(smooth_normals(primary, coordinates))[facet]
        self._length = np.linalg.norm(np.einsum("nk,nkd->nd", at.shape, at_nodes), axis=1, keepdims=True)
        self._nodal = NodalNormals(primary, coordinates)
        self._local = shapes_at(at.shape, at.local, len(primary.points))
        self.normal = np.einsum("nk,nkd->nd", at.shape, at_nodes) / self._length
        bend = np.einsum("nki,nkd->nid", at.gradient, at_nodes) / self._length[:, None]
        return np.asarray(bend - np.einsum("nid,nd->ni", bend, self.normal)[:, :, None] * self.normal[:, None])

    def _turned_in_place(self, du: Array) -> Array:
        """Return the variation of normals (n, dim) at fixed reference coordinates of the projections."""
        if not self._varies:
            return np.zeros_like(self.normal)
        if self._nodal is not None:
            return across(self.normal, self._local @ self._nodal.along(du)) / self._length
        leans = np.stack([np.einsum("nd,nd->n", slope @ du, self.normal) for slope in self._slopes], axis=1)
        return -np.einsum("nid,ni->nd", self._up, leans)

    def along(self, du: Array) -> Variation:
        """Return how projections and normals vary with displacements (n_points, dim) [length]."""
        still, moved = self._turned_in_place(du), self._motion @ du
        xi = np.einsum("nid,nd->ni", self._inverse, moved - self._gap * still)
        foot = np.einsum("nid,ni->nd", self.axes, xi)
        return Variation(xi, foot, still + np.einsum("nid,ni->nd", self._bend, xi))

    def spread(self, force: Array, varied: Array, xi: Array) -> Array:
        """Return the variation (n_points, dim) of nodal forces: points have a `force` that is `varied`, both (n, dim)."""
        motion, *slopes = self._spreading
        total: Array = motion @ varied
        for slope, step in zip(slopes, xi.T, strict=True):
            total -= slope @ (step[:, None] * force)
        return total


def _second_derivatives(primary: Surface, facet: Indices, xi: Array) -> Array:
    """Return the second derivatives (n, k, dim - 1, dim - 1) of shape functions in facets (n,), k as in `Places`.

    They are at most quadratic along each axis, so that central differences of gradients are exact.
    """
    step, columns = 0.5 * np.eye(xi.shape[1]), []
    for axis in step:
        ahead, behind = places(primary, facet, xi + axis).gradient, places(primary, facet, xi - axis).gradient
        columns.append(ahead - behind)
    return np.stack(columns, axis=3)


class _ObstaclePoints:
    """Points that face a rigid obstacle, whose normals vary with their positions and which has no nodes.

    Parameters
    ----------
    secondary : csr_array (n, n_points)
        Weights of the nodes.
    obstacle : RigidSide
    coordinates : ndarray (n_points, dim)
        [length]
    pose : Pose
    """

    def __init__(self, secondary: csr_array, obstacle: RigidSide, coordinates: Array, pose: Pose) -> None:
        self.secondary, x = secondary, secondary @ coordinates
        gap, self.normal, paired, _ = obstacle.facing(x, pose)
        self._gap = np.where(paired, gap, 0.0)[:, None]
        self.apart = self._gap * self.normal
        step = DIFFERENCES * float(np.ptp(coordinates, axis=0).max())
        sides = [[obstacle.facing(x + sign * step * axis, pose)[1] for sign in (1, -1)] for axis in np.eye(x.shape[1])]
        self._gradient = np.stack([ahead - behind for ahead, behind in sides], axis=2) / (2.0 * step)
        self._gradient[~np.isfinite(self._gradient)] = 0.0

    def along(self, du: Array) -> Variation:
        """See `_SurfacePoints.along`; there are no reference coordinates."""
        moved = self.secondary @ du
        normal = np.einsum("nde,ne->nd", self._gradient, moved)
        return Variation(np.zeros((len(normal), 0)), across(self.normal, moved) - self._gap * normal, normal)

    def spread(self, force: Array, varied: Array, xi: Array) -> Array:
        """See `_SurfacePoints.spread`."""
        return np.asarray(self.secondary.T @ varied)


Points = _SurfacePoints | _ObstaclePoints


@dataclass(frozen=True, eq=False)
class PointForces:
    """`Linearised` for forces (n,) at paired points, whose constraints are the `rows` (n,) of m."""

    points: Points
    rows: Indices
    m: int
    multiplier: Array

    def along(self, du: Array) -> tuple[Array, Array]:
        """See `Linearised`."""
        points, normal = self.points, self.points.normal
        varied, gap = points.along(du), np.zeros(self.m)
        gap[self.rows] = np.einsum("nd,nd->n", points.apart, varied.normal) - np.einsum("nd,nd->n", normal, varied.foot)
        force = self.multiplier[:, None]
        return points.spread(force * normal, force * varied.normal, varied.xi), gap


@dataclass(frozen=True, eq=False)
class WeightedForces:
    """`Linearised` for forces (m,) of gaps that are weighted over n points.

    Attributes
    ----------
    points : Points
    functions, tests : csr_array (m, n)
        Weights of the points in the gaps, divided by the weight of each constraint, and in the mean normals.
    normal : ndarray (m, dim)
        Normals of the constraints.
    multiplier : ndarray (m,)
    nodal : NodalNormals or Points, optional
        Source of the normals of the constraints, where they are no means over the points.
    """

    points: Points
    functions: csr_array
    tests: csr_array
    normal: Array
    multiplier: Array
    nodal: NodalNormals | Points | None = None

    def along(self, du: Array) -> tuple[Array, Array]:
        """See `Linearised`."""
        varied = self.points.along(du)
        normal = self._normals(du, varied.normal)
        gap = np.einsum("md,md->m", self.functions @ self.points.apart, normal)
        gap -= np.einsum("md,md->m", self.normal, self.functions @ varied.foot)
        force = self.functions.T @ (self.multiplier[:, None] * normal)
        return self.points.spread(self._force, force, varied.xi), gap

    @cached_property
    def _force(self) -> Array:
        """Forces at the points (n, dim) [force]."""
        return np.asarray(self.functions.T @ (self.multiplier[:, None] * self.normal))

    @cached_property
    def _length(self) -> Array:
        """Lengths (m, 1) of the means that normals are parallel to."""
        length = np.linalg.norm(self.tests @ self.points.normal, axis=1, keepdims=True)
        return np.where(length > 0.0, length, 1.0)

    def _normals(self, du: Array, at_points: Array) -> Array:
        """Return how the normals (m, dim) of the constraints vary, from the variation of those at the points (n, dim)."""
        if isinstance(self.nodal, NodalNormals):
            return -self.nodal.along(du)
        if self.nodal is not None:
            return self.nodal.along(du).normal
        return across(self.normal, self.tests @ at_points) / self._length


def faced(
    candidates: Candidates, pairing: Pairing, rows: Indices, primary: Surface | RigidSide, coordinates: Array,
    normals: object, pose: Pose, along: Array | None = None,
) -> Points:  # fmt: skip
    """Return the points `rows` (n,) of a `pairing` computed at `coordinates` (n_points, dim) [length].

    The primary side is an obstacle in its `pose`, or has `normals` as in `pairing.pair`. Where points are projected along
    other, fixed directions, these are `along` (n, dim).
    """
    if not isinstance(primary, RigidSide):
        return _SurfacePoints(candidates, pairing, rows, primary, coordinates, normals, along)
    return _ObstaclePoints(
        shapes_at(candidates.shape[rows], candidates.nodes[rows], len(coordinates)), primary, coordinates, pose
    )
