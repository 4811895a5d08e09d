r"""Linearised contact geometry: variation of contact forces, gaps and slips with the displacements.

The constraint rows depend on the displacements, because points slide over the opposite facets and normals rotate. A
secondary point :math:`x` with the shape functions :math:`N_s` and the contact force :math:`p = \lambda n + \tau` faces the
primary point :math:`y(\xi) = \sum_k N_k(\xi) y_k` with the normal n. A variation of the displacements
changes the nodal forces f and the gap g of the point, in addition to their changes with constant rows, by

.. math:: \delta f = N_s^T \delta p - N^T \delta p - N_{,\alpha}^T p \, \delta \xi^\alpha, \qquad
          \delta p = \lambda \, \delta n - (\tau \cdot \delta n) n, \qquad
          \delta g = - n \cdot y_{,\alpha} \delta \xi^\alpha + (x - y) \cdot \delta n

(Laursen, Computational Contact and Impact Mechanics, 2002, section 5.3; Wriggers, Computational Contact Mechanics, 2006,
chapter 9; for mortar Popp, Gee and Wall, 2009, with friction Gitterle, Popp, Gee and Wall, 2010). Tangents t follow the
normal without spin, :math:`\delta t = - (t \cdot \delta n) n`, because a spin would only rotate the components of tangential
forces and slips. The equations of slips are in `Slips`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array

from fastcontact.arrays import Array, Indices, Mask, largest
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.pairing import Candidates, Pairing, normals, tangents
from fastcontact.contact.projection import (
    Places,
    nodal_normals,
    places,
    smooth_normals,
)
from fastcontact.contact.surface import Surface
from fastcontact.linear.sparse_rows import nodal_rows, rows_of, scaled, shapes_at
from fastcontact.round_off import DIFFERENCE_STEP, TINY


class NodalNormals:
    """Nodal normals of a side, which are those of `nodal_normals`, and their variation.

    Parameters
    ----------
    side : Surface
    coordinates : ndarray (n_points, dim)
        Coordinates of all points, at which the normals are computed [length].

    Attributes
    ----------
    normal : ndarray (m, dim)
        Unit normals at the m nodes of the side [-].
    """

    def __init__(self, side: Surface, coordinates: Array) -> None:
        self._side, self._coordinates, self.normal = side, coordinates, nodal_normals(side, coordinates)
        self._step = DIFFERENCE_STEP * float(np.ptp(coordinates[side.points], axis=0).max()) / np.sqrt(side.n_facets)

    def along(self, du: Array) -> Array:
        """Return the variation (m, dim) [-] of the normals for a variation `du` (n_points, dim) of displacements [length]."""
        rate = (largest(du[self._side.points]) or 1.0) / self._step
        ahead = nodal_normals(self._side, self._coordinates + 0.5 / rate * du)
        behind = nodal_normals(self._side, self._coordinates - 0.5 / rate * du)
        return np.asarray(rate * (ahead - behind))


class InterpolatedNormals:
    """Unit normals at n points, interpolated from nodal normals at fixed reference coordinates, and their variation.

    Parameters
    ----------
    nodal : NodalNormals
        Nodal normals of the side.
    local : ndarray of int (n, k)
        Nodes of the facet of each point, numbered on the side.
    shape : ndarray (n, k)
        Values of their shape functions at the point [-].
    at_nodes : ndarray (n, k, dim), optional
        Normals at these nodes, which differ from those of `nodal` at corners [-].

    Attributes
    ----------
    normal : ndarray (n, dim)
        Unit normals at the points [-].
    """

    def __init__(self, nodal: NodalNormals, local: Indices, shape: Array, at_nodes: Array | None = None) -> None:
        self._at_nodes = nodal.normal[local] if at_nodes is None else at_nodes
        mean = np.einsum("nk,nkd->nd", shape, self._at_nodes)
        self._length = np.linalg.norm(mean, axis=1, keepdims=True)
        self.normal, self._nodal = mean / self._length, nodal
        self._local = shapes_at(shape, local, len(nodal.normal))

    @classmethod
    def smooth(cls, side: Surface, coordinates: Array, facet: Indices, at: Places) -> InterpolatedNormals:
        """Return the interpolated `smooth_normals` of a side at the places `at` of its facets `facet` (n,)."""
        at_nodes = smooth_normals(side, coordinates)[facet]
        return cls(NodalNormals(side, coordinates), at.local, at.shape, at_nodes)

    def bend(self, gradient: Array) -> Array:
        """Return the derivatives (n, dim - 1, dim) of the normals along facets.

        `gradient` (n, k, dim - 1) contains the derivatives of the shape functions.
        """
        bend = np.einsum("nki,nkd->nid", gradient, self._at_nodes) / self._length[:, None]
        return np.asarray(bend - np.einsum("nid,nd->ni", bend, self.normal)[:, :, None] * self.normal[:, None])

    def along(self, du: Array) -> Array:
        """See `NodalNormals.along`."""
        return transverse(self.normal, self._local @ self._nodal.along(du)) / self._length


def transverse(normal: Array, vector: Array) -> Array:
    """Return the components of vectors (n, dim) perpendicular to unit vectors (n, dim)."""
    return np.asarray(vector - np.einsum("nd,nd->n", normal, vector)[:, None] * normal)


class Variation(NamedTuple):
    """Variation of the projections of n points.

    Attributes
    ----------
    xi : ndarray (n, dim - 1)
        Variation of the reference coordinates of the facing points [-].
    motion : csr_array (n, n_points)
        Variation of the matrix `motion` of the points [-].
    foot : ndarray (n, dim)
        Variation of the positions of the facing points, on the smooth surface if there is one, due to that of xi, with fixed
        facets [length].
    normal : ndarray (n, dim)
        Variation of the normals [-].
    """

    xi: Array
    motion: csr_array
    foot: Array
    normal: Array


class _SurfacePoints:
    """Points paired with a meshed side, and the variation of their projections and normals.

    Parameters
    ----------
    candidates : Candidates
    pairing : Pairing
        Pairing of the candidates with the primary side.
    rows : ndarray of int (n,)
        Rows of the points in `candidates`.
    primary : Surface
    coordinates : ndarray (n_points, dim)
        Coordinates of the pairing [length].
    normals : str or tuple of float
        Normals of the primary side: ``"facet"``, ``"averaged"``, or a fixed vector.
    closest : bool
        Whether points face the closest points on the primary side, instead of projections along the normals. Both coincide
        for facet normals.
    rise : ndarray (n, dim - 1), optional
        Derivatives of the heights of a smooth primary surface above its facets with respect to reference coordinates, see
        `surface_smoothing` [length].

    Attributes
    ----------
    motion : csr_array (n, n_points)
        Map from nodal vectors to the differences of their values at the points and at the facing points [-].
    apart : ndarray (n, dim)
        Vectors from the facing points to the points [length].
    axes : ndarray (n, dim - 1, dim)
        Tangent vectors of the primary facets at the facing points [length].
    normal : ndarray (n, dim)
        Normals of the primary side at the facing points [-].
    averaged : InterpolatedNormals or None
        Averaged normals; None with other normals.
    """

    def __init__(
        self, candidates: Candidates, pairing: Pairing, rows: Indices, primary: Surface, coordinates: Array,
        normals: object, closest: bool, rise: Array | None,
    ) -> None:  # fmt: skip
        feet, n_points, facet = pairing.places(primary, rows), len(coordinates), pairing.facet[rows]
        nodes, shape = np.hstack([candidates.nodes[rows], feet.nodes]), np.hstack([candidates.shape[rows], -feet.shape])
        self.motion = shapes_at(shape, nodes, n_points)
        self._at = feet
        self.axes = self._slopes(coordinates)
        self.apart = self.motion @ coordinates
        self.normal, self.averaged = pairing.normal[rows], None
        self._bend = np.zeros_like(self.axes)
        self._facet: Array | None = None  # facet normals, where these vary
        if normals == "facet" or closest:
            self._facet, bend = self.normal, self._facet_bend(primary, coordinates, facet, pairing.xi[rows], feet)
        if normals == "facet":
            self._bend = bend
        elif isinstance(normals, str):
            self.averaged = InterpolatedNormals.smooth(primary, coordinates, facet, feet)
            self.normal, self._bend = self.averaged.normal, self.averaged.bend(feet.gradient)
        else:
            self.normal = np.broadcast_to(np.array(normals, float), self.normal.shape)
        # With the tangent vectors a_i, the distance g along the direction d of the projection, and the motion v of points
        # relative to the facing points, ``a_i dxi_i + g dd = dv``. The component along d is eliminated.
        direction, bend = (pairing.normal[rows], bend) if closest else (self.normal, self._bend)
        frame = np.stack(tangents(direction), axis=1)
        self._closest, self._bent = closest, normals == "facet"
        self._gap = np.einsum("nd,nd->n", self.apart, direction)[:, None]
        inverse = np.linalg.inv(np.einsum("ntd,nid->nti", frame, self.axes + self._gap[:, :, None] * bend))
        self._inverse = inverse @ frame
        self._foot = self.axes if rise is None else self.axes + rise[:, :, None] * self.normal[:, None]

    def _facet_bend(self, primary: Surface, coordinates: Array, facet: Indices, xi: Array, feet: Places) -> Array:
        """Return the derivatives (n, dim - 1, dim) of facet normals along facets."""
        if primary.order == 1 and xi.shape[1] == 1:
            return np.zeros_like(self.axes)  # straight lines
        # Shape functions are at most quadratic along each axis, so that central differences of gradients are exact.
        steps = 0.5 * np.eye(xi.shape[1])
        above, below = ([places(primary, facet, xi + sign * h).gradient for h in steps] for sign in (1.0, -1.0))
        second = np.stack(above, axis=3) - np.stack(below, axis=3)
        curvature = np.einsum("nkij,nkd,nd->nij", second, coordinates[feet.nodes], self.normal)
        return -np.einsum("njd,nij->nid", self._dual_axes, curvature)

    @cached_property
    def _dual_axes(self) -> Array:
        """Dual vectors (n, dim - 1, dim) of the tangent vectors `axes` [1 / length]."""
        return np.asarray(np.linalg.solve(np.einsum("nid,njd->nij", self.axes, self.axes), self.axes))

    def _slopes(self, values: Array) -> Array:
        """Return the derivatives (n, dim - 1, dim) of a nodal field (n_points, dim) along facets at the facing points."""
        return np.asarray(np.swapaxes(self._at.gradient, 1, 2) @ values[self._at.nodes])

    def along(self, du: Array) -> Variation:
        """Return the variation of projections and normals for a variation `du` (n_points, dim) of displacements [length]."""
        relative_motion, tilt_of_facet = self.motion @ du, np.zeros_like(self.normal)
        if self._facet is not None:
            tilt = np.einsum("nid,nd->ni", self._slopes(du), self._facet)
            tilt_of_facet = -np.einsum("nid,ni->nd", self._dual_axes, tilt)
        at_fixed_xi = tilt_of_facet if self._bent else np.zeros_like(tilt_of_facet)
        if self.averaged is not None:
            at_fixed_xi = self.averaged.along(du)
        normal_variation = tilt_of_facet if self._closest else at_fixed_xi
        xi = np.einsum("nid,nd->ni", self._inverse, relative_motion - self._gap * normal_variation)
        foot = np.einsum("nid,ni->nd", self._foot, xi)
        motion = shapes_at(-np.einsum("nki,ni->nk", self._at.gradient, xi), self._at.nodes, len(du))
        return Variation(xi, motion, foot, at_fixed_xi + np.einsum("nid,ni->nd", self._bend, xi))

    def stiffness(self, force: Array) -> csr_array:
        r"""Return the stiffness (n_dofs, n_dofs) of constant normal forces (n,) [force] at the points [force / length].

        It contains minus the second variation of the gaps g,

        .. math:: - \delta^2 g = 2 n \cdot \delta y_{,\alpha} \delta \xi^\alpha
                  - n_{,\alpha} \cdot y_{,\beta} \delta \xi^\alpha \delta \xi^\beta - g |\delta n|^2, \qquad
                  \delta n = - y^{,\alpha} (n \cdot \delta y_{,\alpha})

        with the dual axes :math:`y^{,\alpha}`, up to products of gap and curvature (Laursen, 2002, section 5.3).
        """
        n_dofs, gap, axes = self.motion.shape[1] * self.normal.shape[1], self._gap[:, 0], range(self.axes.shape[1])
        dual = self._dual_axes
        metric, bend = np.einsum("nid,njd->nij", dual, dual), np.einsum("nid,njd->nij", self._bend, self.axes)
        slopes = self._at.gradient[..., None] * self.normal[:, None, None]
        tilts = [nodal_rows(self._at.nodes, slopes[:, :, i], n_dofs) for i in axes]
        xi = [
            rows_of(self.motion, dual[:, i]) + sum(scaled(tilts[j], gap * metric[:, i, j]) for j in axes) for i in axes
        ]
        K = csr_array((n_dofs, n_dofs))
        for i in axes:
            K += 2.0 * tilts[i].T @ scaled(xi[i], force)
            for j in axes:
                K -= xi[i].T @ scaled(xi[j], force * bend[:, i, j])
                K -= tilts[i].T @ scaled(tilts[j], force * gap * metric[:, i, j])
        return csr_array(0.5 * (K + K.T))


class _ObstaclePoints:
    """Points paired with a rigid obstacle, which has no nodes, and the variation of their normals with their positions.

    Parameters
    ----------
    secondary : csr_array (n, n_points)
        Shape functions of the points, by node [-].
    obstacle : RigidSide
    coordinates : ndarray (n_points, dim)
        Coordinates of the pairing [length].
    pose : Pose
    """

    def __init__(self, secondary: csr_array, obstacle: RigidSide, coordinates: Array, pose: Pose) -> None:
        self.averaged = None
        self.motion, x = secondary, secondary @ coordinates
        gap, self.normal, paired, _ = obstacle.facing(x, pose)
        self._gap = np.where(paired, gap, 0.0)[:, None]
        self.apart = self._gap * self.normal
        step = DIFFERENCE_STEP * float(np.ptp(coordinates, axis=0).max())
        sides = [[obstacle.facing(x + sign * step * axis, pose)[1] for sign in (1, -1)] for axis in np.eye(x.shape[1])]
        self._gradient = np.stack([ahead - behind for ahead, behind in sides], axis=2) / (2.0 * step)
        self._gradient[~np.isfinite(self._gradient)] = 0.0

    def along(self, du: Array) -> Variation:
        """See `_SurfacePoints.along`; there are no reference coordinates."""
        motion = self.motion @ du
        normal = np.einsum("nde,ne->nd", self._gradient, motion)
        foot = transverse(self.normal, motion) - self._gap * normal
        return Variation(np.zeros((len(normal), 0)), csr_array(self.motion.shape), foot, normal)

    def stiffness(self, force: Array) -> csr_array:
        """See `_SurfacePoints.stiffness`."""
        rows = [rows_of(self.motion, np.broadcast_to(axis, self.normal.shape)) for axis in np.eye(self.normal.shape[1])]
        turned = [rows_of(self.motion, self._gradient[:, i]) for i in range(len(rows))]
        K = -sum(row.T @ scaled(turn, force) for row, turn in zip(rows, turned, strict=True))
        return csr_array(0.5 * (K + K.T))


Points: TypeAlias = _SurfacePoints | _ObstaclePoints


@dataclass(frozen=True, eq=False)
class Closing:
    """Part q m of the relative motion, with ``q = a . o / a . m``, which closes the gap; see `Slips`.

    Attributes
    ----------
    mean, size : ndarray (n, dim), ndarray (n, 1)
        Mean direction m of the normals of both sides, and the length of the difference of these normals [-].
    secondary : NodalNormals or InterpolatedNormals or None
        Normals of the secondary side; None if m is the normal of an obstacle.
    opening : ndarray (n, dim)
        Vector o from the primary to the secondary side at the beginning of the step [length].
    length : ndarray (n,)
        Length q; zero where no gap closes [length].
    along_mean : bool
        Whether the direction a is m; otherwise it is the normal of the constraint.
    """

    mean: Array
    size: Array
    secondary: NodalNormals | InterpolatedNormals | None
    opening: Array
    length: Array
    along_mean: bool

    @classmethod
    def of(
        cls, primary: Array, secondary: NodalNormals | InterpolatedNormals | None, opening: Array,
        length: Array | None = None,
    ) -> Closing:  # fmt: skip
        """Return the closing motion between sides with the normals `primary` (n, dim) and `secondary`.

        Without a given `length` (n,), the direction a is m.
        """
        mean = primary if secondary is None else primary - secondary.normal
        size = np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), TINY)
        mean = mean / size
        opening_along_mean = np.einsum("nd,nd->n", mean, opening)
        return cls(mean, size, secondary, opening, opening_along_mean if length is None else length, length is None)

    @property
    def vector(self) -> Array:
        """The vectors q m (n, dim) [length]."""
        return self.length[:, None] * self.mean

    def along(self, du: Array, normal: tuple[Array, Array], primary: Array, opening: Array) -> Array:
        """Return the variation (n, dim) of q m [length].

        `normal` contains the normals of the constraints and their variation; `primary` and `opening` are the variations of
        the primary normals and of o, all (n, dim).
        """
        mean = self.mean
        turned = primary if self.secondary is None else primary - self.secondary.along(du)
        d_mean = transverse(mean, turned) / self.size
        a, d_a = (mean, d_mean) if self.along_mean else normal
        cosine = np.einsum("nd,nd->n", a, mean)
        numerator = np.einsum("nd,nd->n", d_a, self.opening) + np.einsum("nd,nd->n", a, opening)
        numerator -= self.length * (np.einsum("nd,nd->n", d_a, mean) + np.einsum("nd,nd->n", a, d_mean))
        q = np.divide(numerator, cosine, out=np.zeros_like(cosine), where=(self.length != 0.0) & (cosine != 0.0))
        return q[:, None] * mean + self.length[:, None] * d_mean


@dataclass(frozen=True, eq=False)
class Substitution:
    """Additional slip along an axis in which supports hold nodes, whose functions those of their neighbours replace.

    Attributes
    ----------
    axis : ndarray (m, dim)
        Unit vectors, which are constant [-].
    held : ndarray of bool (m,)
        Held nodes.
    secondary : csr_array (m, m)
        Mean values of fields on the secondary side, minus those without the replacement.
    functions : csr_array (m, n)
        Mean values of fields at points, minus those without the replacement.
    """

    axis: Array
    held: Mask
    secondary: csr_array
    functions: csr_array

    def along_axis(self, vectors: Array) -> Array:
        """Return the components of vectors (m, dim) along the axis, as vectors."""
        return np.asarray(np.einsum("md,md->m", vectors, self.axis)[:, None] * self.axis)

    def closing(self, motion: Array) -> Array:
        """Return the slip (m, dim) by a motion (m, dim) of nodes that closes their gaps [length].

        On curved sides, the neighbours close their gaps along other normals, and this motion is not slip.
        """
        transverse = motion - np.where(self.held[:, None], self.along_axis(motion), 0.0)
        return self.along_axis(self.secondary @ transverse)

    def slip(self, closing: Array, motion: Array) -> Array:
        """Return the slip (m, dim) by the relative motion (n, dim) of points, of which `closing` closes gaps [length]."""
        return self.closing(closing) + self.along_axis(self.functions @ motion)


@dataclass(frozen=True, eq=False)
class Slips:
    r"""Slips in a step at n points or weighted gaps along k tangents t, and the tangential forces.

    Slips are the components along t of the vector s,

    .. math:: s = r + q m, \qquad q = \frac{a \cdot o}{a \cdot m}, \qquad
              \delta (t \cdot s) = t \cdot \delta s - (t \cdot \delta n) (n \cdot s)

    with the relative motion r of the step. If slip is symmetric, adding q m removes the part of the motion that closes the
    initial distance o along the normal a of the constraint or along m. Both r and o vary as points face other primary
    points: :math:`\delta r = - \sum_k N_{k, \alpha} \Delta u_k \delta \xi^\alpha`, and o in the same way with the initial
    positions instead of the displacement increments.

    Attributes
    ----------
    tangents : ndarray (k, n, dim)
        Unit tangents t [-].
    forces : ndarray (n, k)
        Tangential forces along the tangents [force].
    total : ndarray (n, dim)
        Slip vectors s [length].
    motion, start : ndarray (n_points, dim)
        Increments of displacements in the step and positions at its beginning, of all nodes [length].
    closing : Closing, optional
        Part q m; None if neither the slip nor that of `substitutions` contains it.
    symmetric : bool
        Whether q m is part of the slip at all points.
    turning : ndarray (dim, dim), optional
        Derivative of the motion that points share with a rotating obstacle with respect to their displacements [-].
    substitutions : list of Substitution
        Additional slips.
    """

    tangents: Array
    forces: Array
    total: Array
    motion: Array
    start: Array
    closing: Closing | None = None
    symmetric: bool = True
    turning: Array | None = None
    substitutions: Sequence[Substitution] = ()

    def with_substitution(self, substitution: Substitution, motion: csr_array) -> Slips:
        """Return the slips with an additional one; `motion` (n, n_points) is that of the points."""
        assert self.closing is not None
        total = self.total + substitution.slip(self.closing.vector, motion @ self.motion)
        return replace(self, total=total, substitutions=(*self.substitutions, substitution))

    @property
    def force(self) -> Array:
        """Tangential forces as vectors (n, dim) [force]."""
        return np.einsum("nk,knd->nd", self.forces, self.tangents)

    def along(
        self, du: Array, variation: Variation, points: Points, weights: csr_array | None,
        normals: tuple[Array, Array, Array],
    ) -> Array:  # fmt: skip
        """Return the variation (k, n) of slips for a variation of the displacements [length].

        Parameters
        ----------
        du : ndarray (n_points, dim)
            Variation of the displacements [length].
        variation : Variation
            Variation of `points`.
        points : Points
        weights : csr_array (n, n_points) or None
            Weights of the points in the slips; None if each slip is that of one point.
        normals : (ndarray (n, dim), ndarray (n, dim), ndarray (n, dim))
            Normals of the constraints, their variation, and the variation of the primary normals of `closing` [-].
        """
        motion, (normal, d_normal, primary) = variation.motion @ self.motion, normals
        change, closing = _sums(weights, motion), np.zeros_like(normal)
        if self.closing is not None:
            if self.closing.along_mean:
                d_opening = _sums(weights, variation.motion @ self.start)
            else:  # The openings that weighted gaps close are those of smooth surfaces, whose variation `foot` contains.
                d_opening = -change - _sums(weights, variation.foot)
            closing = self.closing.along(du, (normal, d_normal), primary, d_opening)
            change = change + closing if self.symmetric else change
        if self.turning is not None:
            change -= _sums(weights, points.motion @ du @ self.turning)
        change += sum(substitution.slip(closing, motion) for substitution in self.substitutions)
        normal_part = np.einsum("nd,nd->n", normal, self.total)
        T = self.tangents
        return np.einsum("knd,nd->kn", T, change) - np.einsum("knd,nd,n->kn", T, d_normal, normal_part)


def _sums(weights: csr_array | None, values: Array) -> Array:
    return values if weights is None else np.asarray(weights @ values)


@dataclass(frozen=True, eq=False)
class LinearisedPoints:
    """Contact forces, gaps and slips of one pair, linearised about a pairing and its solution.

    Attributes
    ----------
    side : Surface
        The secondary side.
    points : Points
    functions : csr_array (m, n) or None
        Weights of the n points in the gaps, divided by the weight of each constraint; None if each gap is that of one point.
    normal : ndarray (m, dim)
        Normals of the constraints [-].
    multiplier : ndarray (m,)
        Lagrange multipliers of the constraints [force].
    tests : csr_array (m, n), optional
        Weights of the points in the mean normals, if the normals of the constraints are such means.
    nodal : NodalNormals or Points, optional
        Source of the normals of the constraints if they are neither means over the points nor those of the points.
    slips : Slips, optional
        Slips of the constraints; None without tangential constraints.
    place : (ndarray of int (m,), int), optional
        Rows of the m constraints among all constraints of the pair, and the number of all constraints.
    smooth : (InterpolatedNormals, ndarray (n, dim - 1, dim)), optional
        Primary normals of the slips and their derivatives along facets, if they differ from the normals of the points.
    compliance : Callable, optional
        Function from forces (m, dim) [force] to elastic displacements (m, dim) of the constraints [length], if the compliance
        couples vectors. Their components along normals and tangents change as these rotate.
    """

    side: Surface
    points: Points
    functions: csr_array | None
    normal: Array
    multiplier: Array
    tests: csr_array | None = None
    nodal: NodalNormals | Points | None = None
    slips: Slips | None = None
    place: tuple[Indices, int] | None = None
    smooth: tuple[InterpolatedNormals, Array] | None = None
    compliance: Callable[[Array], Array] | None = None

    def along(self, du: Array) -> tuple[Array, Array]:
        """See `constraints.Linearised`."""
        varied = self.points.along(du)
        normal = self._normals(du, varied.normal)
        gaps = np.einsum("md,md->m", _sums(self.functions, self.points.apart), normal)[None]
        gaps -= np.einsum("md,md->m", self.normal, _sums(self.functions, varied.foot))
        if self.slips is not None:
            primary = normal
            if self.smooth is not None:
                turned = self.smooth[0].along(du) + np.einsum("nid,ni->nd", self.smooth[1], varied.xi)
                primary = _sums(self.functions, turned)
            normals = self.normal, normal, primary
            gaps = np.vstack([gaps, self.slips.along(du, varied, self.points, self.functions, normals)])
        force, tangential = self.multiplier[:, None] * normal, np.zeros_like(normal)
        if self.slips is not None:
            tangential = -np.einsum("md,md->m", self.slips.force, normal)[:, None] * self.normal
        if self.compliance is not None and self.slips is not None:
            gaps += self._elastic(normal, force + tangential)
        if self.place is not None:
            rows, of_rows = self.place[0], gaps
            gaps = np.zeros((len(gaps), self.place[1]))
            gaps[:, rows] = of_rows
        return self._to_nodes @ self._at_points(force, tangential) + varied.motion.T @ self._force, gaps

    @cached_property
    def _to_nodes(self) -> csc_array:
        """Map (n_points, n) from forces at the points to nodal forces."""
        return self.points.motion.T

    def _at_points(self, normal: Array, tangential: Array) -> Array:
        """Return the forces (n, dim) at the points for normal and tangential forces (m, dim) of the constraints [force]."""
        if self.functions is None:
            return normal + tangential
        force = np.asarray(self.functions.T @ (normal + tangential))
        substitutions = () if self.slips is None else self.slips.substitutions
        return sum((s.functions.T @ s.along_axis(tangential) for s in substitutions), force)

    def _elastic(self, normal: Array, force: Array) -> Array:
        """Return the variation (1 + k, m) of elastic gaps and slips [length] due to those of normals and forces (m, dim)."""
        assert self.compliance is not None
        assert self.slips is not None
        elastic, d_elastic = self._elastic_displacements, self.compliance(force)
        gaps = np.einsum("md,md->m", normal, elastic) + np.einsum("md,md->m", self.normal, d_elastic)
        slips = np.einsum("kmd,md->km", self.slips.tangents, d_elastic)
        slips -= np.einsum("kmd,md->km", self.slips.tangents, normal) * np.einsum("md,md->m", self.normal, elastic)
        return np.vstack([gaps, slips])

    @cached_property
    def _elastic_displacements(self) -> Array:
        """Elastic displacements (m, dim) of the constraints [length]."""
        assert self.compliance is not None
        return self.compliance(np.add(*self._forces))

    @cached_property
    def _forces(self) -> tuple[Array, Array]:
        """Normal and tangential forces (m, dim) of the constraints [force]."""
        normal = self.multiplier[:, None] * self.normal
        return normal, np.zeros_like(normal) if self.slips is None else self.slips.force

    @cached_property
    def _force(self) -> Array:
        """Forces at the points (n, dim) [force]."""
        return self._at_points(*self._forces)

    @cached_property
    def _length(self) -> Array:
        """Lengths (m, 1) of the mean vectors whose directions are the normals."""
        length = np.linalg.norm(self._mean(self.points.normal), axis=1, keepdims=True)
        return np.where(length > 0.0, length, 1.0)

    def _normals(self, du: Array, at_points: Array) -> Array:
        """Return the variation (m, dim) of the normals of the constraints, given the variation (n, dim) at the points."""
        if self.tests is None:
            return _sums(self.functions, at_points)
        if isinstance(self.nodal, NodalNormals):
            return -self.nodal.along(du)
        if self.nodal is not None:
            return self.nodal.along(du).normal
        return transverse(self.normal, self._mean(at_points)) / self._length

    def _mean(self, vectors: Array) -> Array:
        """Return the sums (m, dim) of vectors at the points (n, dim), weighted with `tests`."""
        assert self.tests is not None
        total = np.asarray(self.tests @ vectors)
        self.side.add_across_ends(total)
        return total


@dataclass(frozen=True, eq=False)
class Differences:
    """Contact forces, gaps and slips of one pair, linearised by one-sided finite differences.

    The differences are taken at the mean of the displacements of the pairing and of its solution. The error of a Newton step
    is then a tenth of that with differences at either of them.

    Attributes
    ----------
    constraints : Constraints
    moved : Callable
        Function that moves all points by (n_points, dim) [length] after the pairing of `constraints`, and pairs them again.
    forces : (ndarray (m,), ndarray (m, k))
        Multipliers and tangential forces of the solution with `constraints` [force].
    motions : (ndarray (n_points, dim), ndarray (n_points, dim), ndarray (n_points, dim))
        Displacements of the solution, their increments in the load step, and their changes since the pairing [length].
    sides : ndarray of int (q,)
        Points on which the constraints depend.
    step : float
        Largest motion of these points in a difference [length].
    """

    constraints: Constraints
    moved: Callable[[Array], Constraints]
    forces: tuple[Array, Array]
    motions: tuple[Array, Array, Array]
    sides: NDArray[np.integer]
    step: float

    def along(self, du: Array) -> tuple[Array, Array]:
        """See `constraints.Linearised`."""
        rate = (largest(du[self.sides]) or 1.0) / self.step
        force, gaps = (rate * (moved - mean) for moved, mean in zip(self._values(du / rate), self._mean, strict=True))
        return force.reshape(du.shape), gaps

    @cached_property
    def _mean(self) -> tuple[Array, Array]:
        return self._values(np.zeros_like(self.motions[0]))

    def _values(self, motion: Array) -> tuple[Array, Array]:
        """Return nodal forces (n_dofs,) [force], and gaps and slips (1 + k, m) [length], for a motion from the mean.

        Tangents follow the normals.
        """
        (multiplier, tangential), (displacement, increment, change) = self.forces, self.motions
        varied = self.moved(0.5 * change + motion)
        gap = varied.gaps(displacement)[None]
        if not varied.tangents:
            return varied.force(multiplier), gap
        tangents = self.constraints.directions
        normal0, normal = normals(tangents), normals(varied.directions)
        mean = (normal0 + normal) / (1.0 + np.einsum("md,md->m", normal0, normal))[:, None]
        t0 = [t - np.einsum("md,md->m", t, normal)[:, None] * mean for t in tangents]
        rotation = np.einsum("kmd,jmd->mkj", varied.directions, t0)
        slip = np.stack([T @ increment.ravel() for T in varied.tangents]) + varied.slip0
        force = varied.force(multiplier, np.einsum("mkj,mj->mk", rotation, tangential))
        return force, np.vstack([gap, np.einsum("mkj,km->jm", rotation, slip)])


def faced(
    candidates: Candidates, pairing: Pairing, rows: Indices, primary: Surface | RigidSide, coordinates: Array,
    normals: object, pose: Pose, closest: bool = False, rise: Array | None = None,
) -> Points:  # fmt: skip
    """Return the paired points in the rows `rows` (n,) of `pairing`, with the variation of their projections.

    The pairing was computed at `coordinates` (n_points, dim) [length]. `pose` applies to obstacles. `normals`, `closest` and
    `rise` apply to meshed primary sides, see `_SurfacePoints`.
    """
    if not isinstance(primary, RigidSide):
        return _SurfacePoints(candidates, pairing, rows, primary, coordinates, normals, closest, rise)
    shapes = shapes_at(candidates.shape[rows], candidates.nodes[rows], len(coordinates))
    return _ObstaclePoints(shapes, primary, coordinates, pose)
