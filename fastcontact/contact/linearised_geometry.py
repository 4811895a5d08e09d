r"""Linearised contact geometry: variation of contact forces, gaps and slips with the displacements.

The constraint rows depend on the displacements, because points slide over the opposite facets and normals rotate. A
secondary point :math:`x` with the shape functions :math:`N_s` and the contact force :math:`p = \lambda n + \tau` faces the
primary point :math:`y(\xi) = \sum_k N_k(\xi) y_k` with the normal n. Here :math:`\lambda` is the multiplier,
:math:`\tau` the tangential force, :math:`N` the vector of the shape functions :math:`N_k` of the primary facet, and
:math:`{}_{,\alpha}` the derivative with respect to its reference coordinate :math:`\xi^\alpha`. A variation of the
displacements changes the nodal forces f and the gap g of the point, in addition to their changes with constant rows, by

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
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.linearised_projections import InterpolatedNormals, Points, Variation, transverse
from fastcontact.contact.multiplier_field import Projection
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.surface import Surface
from fastcontact.round_off import TINY

# Multiplier field whose compliance couples the force vectors of integration points, and the `PressureField.axes` in which it
# acts.
PointCompliance = tuple[Projection, tuple[Array, Array] | None]


class ClosingMotion:
    """Part q m of the relative motion that closes the gap, with ``q = a . o / a . m``; see `Slips`.

    The unit vector m lies along the difference of the primary and the secondary normal, which is the mean direction of the
    normals of both sides.

    Parameters
    ----------
    primary : ndarray (n, dim)
        Primary normals [-].
    secondary : (ndarray (n, dim), Callable) or None
        Secondary normals, and the function from a variation of the displacements (n_points, dim) [length] to theirs; None
        if m is the normal of an obstacle.
    opening : ndarray (n, dim)
        Vector o from the primary to the secondary side at the beginning of the step [length].
    length : ndarray (n,), optional
        Length q, zero where no gap closes, if the direction a is the normal of the constraint [length]. By default, a is m.

    Attributes
    ----------
    vector : ndarray (n, dim)
        The vectors q m [length].
    along_mean : bool
        Whether the direction a is m.
    """

    def __init__(
        self, primary: Array, secondary: tuple[Array, Callable[[Array], Array]] | None, opening: Array,
        length: Array | None = None,
    ) -> None:  # fmt: skip
        self._secondary, self._opening, self.along_mean = secondary, opening, length is None
        mean = primary if secondary is None else primary - secondary[0]
        self._mean_length = np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), TINY)
        self._mean = mean / self._mean_length
        self._length = np.einsum("nd,nd->n", self._mean, opening) if length is None else length
        self.vector = self._length[:, None] * self._mean

    def variation(self, du: Array, normal: tuple[Array, Array], d_primary: Array, d_opening: Array) -> Array:
        """Return the variation (n, dim) of q m for a variation `du` (n_points, dim) of the displacements [length].

        `normal` contains the normals of the constraints and their variation; `d_primary` and `d_opening` are the variations
        of the primary normals and of o, all (n, dim).
        """
        mean, length = self._mean, self._length
        d_difference = d_primary if self._secondary is None else d_primary - self._secondary[1](du)
        d_mean = transverse(mean, d_difference) / self._mean_length
        a, d_a = (mean, d_mean) if self.along_mean else normal
        cosine = np.einsum("nd,nd->n", a, mean)
        numerator = np.einsum("nd,nd->n", d_a, self._opening) + np.einsum("nd,nd->n", a, d_opening)
        numerator -= length * (np.einsum("nd,nd->n", d_a, mean) + np.einsum("nd,nd->n", a, d_mean))
        d_q = np.divide(numerator, cosine, out=np.zeros_like(cosine), where=(length != 0.0) & (cosine != 0.0))
        return d_q[:, None] * mean + length[:, None] * d_mean


@record
class Substitution:
    """Additional slip along an axis in which supports hold nodes.

    In this direction, the test functions of the neighbours replace those of the held nodes.

    Attributes
    ----------
    axis : ndarray (m, dim)
        Unit vectors, which are constant [-].
    held : ndarray of bool (m,)
        Held nodes.
    secondary : csr_array (m, m)
        Map from nodal values of a field on the secondary side to its weighted means, minus the map without the replacement
        [-].
    functions : csr_array (m, n)
        Map from the values of a field at n points to its weighted means, minus the map without the replacement [-].
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
        free_motion = motion - np.where(self.held[:, None], self.along_axis(motion), 0.0)
        return self.along_axis(self.secondary @ free_motion)

    def slip(self, closing: Array, motion: Array) -> Array:
        """Return the slip (m, dim) by the relative `motion` (n, dim) of points [length].

        `closing` (m, dim) is the motion of the nodes that closes their gaps [length].
        """
        return self.closing(closing) + self.along_axis(self.functions @ motion)


@record
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
    closing : ClosingMotion, optional
        Part q m; None if neither the slip nor that of `substitutions` contains it.
    symmetric : bool
        Whether q m is part of the slip at all points.
    rotation_gradient : ndarray (dim, dim), optional
        Derivative of the motion that points share with a rotating obstacle with respect to their displacements, transposed
        [-].
    substitutions : list of Substitution
        Additional slips.
    """

    tangents: Array
    forces: Array
    total: Array
    motion: Array
    start: Array
    closing: ClosingMotion | None = None
    symmetric: bool = True
    rotation_gradient: Array | None = None
    substitutions: Sequence[Substitution] = ()

    def variation(
        self, du: Array, d_points: Variation, points: Points, weights: csr_array | None,
        normals: tuple[Array, Array, Array],
    ) -> Array:  # fmt: skip
        """Return the variation (k, n) of slips for a variation of the displacements [length].

        Parameters
        ----------
        du : ndarray (n_points, dim)
            Variation of the displacements [length].
        d_points : Variation
            Variation of `points`.
        points : Points
        weights : csr_array (n, q) or None
            Weights of the q `points` in the slips; None if each slip is that of one point.
        normals : (ndarray (n, dim), ndarray (n, dim), ndarray (n, dim))
            Normals of the constraints, their variation, and the variation of the primary normals of `closing` [-].
        """
        motion, (normal, d_normal, d_primary) = d_points.motion(self.motion), normals
        d_slip, d_closing = _weighted(weights, motion), np.zeros_like(normal)
        if self.closing is not None:
            if self.closing.along_mean:
                d_opening = _weighted(weights, d_points.motion(self.start))
            else:  # The openings that weighted gaps close are those of smooth surfaces, whose variation `foot` contains.
                d_opening = -d_slip - _weighted(weights, d_points.foot)
            d_closing = self.closing.variation(du, (normal, d_normal), d_primary, d_opening)
            d_slip = d_slip + d_closing if self.symmetric else d_slip
        if self.rotation_gradient is not None:
            d_slip -= _weighted(weights, points.motion @ du @ self.rotation_gradient)
        for substitution in self.substitutions:
            d_slip = d_slip + substitution.slip(d_closing, motion)
        normal_part = np.einsum("nd,nd->n", normal, self.total)
        T = self.tangents
        return np.einsum("knd,nd->kn", T, d_slip) - np.einsum("knd,nd,n->kn", T, d_normal, normal_part)


def _weighted(weights: csr_array | None, values: Array) -> Array:
    """Return the products of weights (m, n) and values (n, dim) at points; without weights, the values themselves."""
    return values if weights is None else np.asarray(weights @ values)


@record
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
    separate_normals : DeformedSide or Points, optional
        The secondary side, or points whose normals are those of the constraints, if the latter are neither
        means over the integration points nor the normals of these points.
    slips : Slips, optional
        Slips of the constraints; None without tangential constraints.
    rows_in_pair : (ndarray of int (m,), int), optional
        Numbers of the m constraints among all constraints of the pair, and the number of all constraints.
    slip_normals : (InterpolatedNormals, ndarray (n, dim - 1, dim)), optional
        Primary normals of the slips, and their derivatives with respect to reference coordinates, if they differ from the
        normals of the points [-].
    compliance : PointCompliance, optional
        Compliance that couples the force vectors of the constraints of the pair, and its axes, see `PressureField.axes`. The
        components of elastic displacements along normals and tangents change as these rotate.
    """

    side: Surface
    points: Points
    functions: csr_array | None
    normal: Array
    multiplier: Array
    tests: csr_array | None = None
    separate_normals: DeformedSide | Points | None = None
    slips: Slips | None = None
    rows_in_pair: tuple[Indices, int] | None = None
    slip_normals: tuple[InterpolatedNormals, Array] | None = None
    compliance: PointCompliance | None = None

    def derivatives_along(self, du: Array) -> tuple[Array, Array]:
        """See `constraints.Linearised`."""
        (tangential, force, elastic), d_points = self._solution, self.points.variation(du)
        d_normal = d_points.normal if self.tests is None else self._normal_variation(du, d_points.normal)
        d_gaps = np.einsum("md,md->m", _weighted(self.functions, self.points.offset), d_normal)[None]
        d_gaps -= np.einsum("md,md->m", self.normal, _weighted(self.functions, d_points.foot))
        d_force, d_tangential = self.multiplier[:, None] * d_normal, np.zeros_like(d_normal)
        if self.slips is not None:
            d_primary = d_normal
            if self.slip_normals is not None:
                averaged, gradient = self.slip_normals
                d_averaged = averaged.variation(du) + np.einsum("nid,ni->nd", gradient, d_points.xi)
                d_primary = _weighted(self.functions, d_averaged)
            normals = self.normal, d_normal, d_primary
            d_slips = self.slips.variation(du, d_points, self.points, self.functions, normals)
            d_tangential = -np.einsum("md,md->m", tangential, d_normal)[:, None] * self.normal
            if self.compliance is not None:
                d_elastic, T = self._elastic_displacements(d_force + d_tangential), self.slips.tangents
                d_gaps += np.einsum("md,md->m", d_normal, elastic) + np.einsum("md,md->m", self.normal, d_elastic)
                normal_part = np.einsum("md,md->m", self.normal, elastic)
                d_slips += np.einsum("kmd,md->km", T, d_elastic) - np.einsum("kmd,md->km", T, d_normal) * normal_part
            d_gaps = np.vstack([d_gaps, d_slips])
        if self.rows_in_pair is not None:
            (rows, count), d_paired_gaps = self.rows_in_pair, d_gaps
            d_gaps = np.zeros((len(d_gaps), count))
            d_gaps[:, rows] = d_paired_gaps
        nodal_forces = self.points.motion.T @ self._at_points(d_force, d_tangential)
        return nodal_forces + d_points.nodal_forces(force, len(nodal_forces)), d_gaps

    @cached_property
    def _solution(self) -> tuple[Array, Array, Array]:
        """Tangential forces (m, dim) [force], forces at the points (n, dim) [force], and elastic displacements (m, dim).

        The elastic displacements [length] are zero without `compliance`.
        """
        normal, tangential = self.multiplier[:, None] * self.normal, np.zeros_like(self.normal)
        if self.slips is not None:
            tangential = np.einsum("nk,knd->nd", self.slips.forces, self.slips.tangents)
        elastic = np.zeros_like(normal) if self.compliance is None else self._elastic_displacements(normal + tangential)
        return tangential, self._at_points(normal, tangential), elastic

    def _elastic_displacements(self, force: Array) -> Array:
        """Return the elastic displacements (m, dim) of the constraints [length] under forces (m, dim) [force]."""
        assert self.compliance is not None
        assert self.rows_in_pair is not None
        (projection, axes), (rows, count) = self.compliance, self.rows_in_pair
        forces = np.zeros((count, force.shape[1]))
        forces[rows] = force if axes is None else np.einsum("mde,md->me", axes[0][rows], force)
        displacements = projection.apply(forces)[rows]
        return displacements if axes is None else np.einsum("mde,me->md", axes[0][rows], displacements)

    def _at_points(self, normal: Array, tangential: Array) -> Array:
        """Return the forces (n, dim) at the points for normal and tangential forces (m, dim) of the constraints [force]."""
        if self.functions is None:
            return normal + tangential
        force = np.asarray(self.functions.T @ (normal + tangential))
        substitutions = () if self.slips is None else self.slips.substitutions
        return sum((s.functions.T @ s.along_axis(tangential) for s in substitutions), force)

    @cached_property
    def _length(self) -> Array:
        """Lengths (m, 1) of the weighted sums of the normals at the points; 1 where the sum vanishes."""
        length = np.linalg.norm(self._mean(self.points.normal), axis=1, keepdims=True)
        return np.where(length > 0.0, length, 1.0)

    def _normal_variation(self, du: Array, at_points: Array) -> Array:
        """Return the variation (m, dim) of mean or separate normals, given the variation (n, dim) of those of the points."""
        if isinstance(self.separate_normals, DeformedSide):
            return -self.separate_normals.variation(du)
        if self.separate_normals is not None:
            return self.separate_normals.variation(du).normal
        return transverse(self.normal, self._mean(at_points)) / self._length

    def _mean(self, vectors: Array) -> Array:
        """Return the sums (m, dim) of vectors at the points (n, dim), weighted with `tests`."""
        assert self.tests is not None
        total = np.asarray(self.tests @ vectors)
        self.side.add_across_ends(total)
        return total
