"""Linearised projections: variation of the points that secondary points face, and of the normals there.

See `linearised_geometry` for the equations and symbols.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.pairing import Candidates, Pairing, tangents
from fastcontact.contact.projection import DeformedSide, facet_points
from fastcontact.linear.sparse_rows import nodal_rows, rows_of, scaled, shapes_at
from fastcontact.round_off import DIFFERENCE_STEP


class InterpolatedNormals:
    """Unit normals at n points, interpolated from nodal normals at fixed reference coordinates, and their variation.

    Parameters
    ----------
    side : DeformedSide
    local : ndarray of int (n, k)
        Nodes of the facet of each point, numbered within the side.
    shape : ndarray (n, k)
        Values of their shape functions at the point [-].
    at_nodes : ndarray (n, k, dim), optional
        Normals at these nodes, which differ from `DeformedSide.nodal_normals` at corners of the surface [-].

    Attributes
    ----------
    normal : ndarray (n, dim)
        Unit normals at the points [-].
    """

    def __init__(self, side: DeformedSide, local: Indices, shape: Array, at_nodes: Array | None = None) -> None:
        self._at_nodes = side.nodal_normals[local] if at_nodes is None else at_nodes
        mean = np.einsum("nk,nkd->nd", shape, self._at_nodes)
        self._length = np.linalg.norm(mean, axis=1, keepdims=True)
        self.normal, self._side = mean / self._length, side
        self._to_points = shapes_at(shape, local, len(side.surface.points))

    def gradient(self, shape_gradient: Array) -> Array:
        """Return the derivatives (n, dim - 1, dim) of the normals with respect to the reference coordinates of facets [-].

        `shape_gradient` (n, k, dim - 1) contains the derivatives of the shape functions [-].
        """
        slope = np.einsum("nki,nkd->nid", shape_gradient, self._at_nodes) / self._length[:, None]
        return np.asarray(slope - np.einsum("nid,nd->ni", slope, self.normal)[:, :, None] * self.normal[:, None])

    def variation(self, du: Array) -> Array:
        """Return the variation (n, dim) of the normals [-] for a variation `du` (n_points, dim) of displacements [length]."""
        return transverse(self.normal, self._to_points @ self._side.variation(du)) / self._length


def transverse(normal: Array, vector: Array) -> Array:
    """Return the components of vectors (n, dim) perpendicular to unit vectors (n, dim)."""
    return np.asarray(vector - np.einsum("nd,nd->n", normal, vector)[:, None] * normal)


class Variation(NamedTuple):
    """Variation of the projections of n points.

    Attributes
    ----------
    xi : ndarray (n, dim - 1)
        Variation of the reference coordinates of the primary points that the points face [-].
    weights, nodes : ndarray (n, k), ndarray of int (n, k)
        Variation of the matrix `motion` (n, n_points) of the points, given by the weights of k nodes in each row [-]. The
        nodes are in ascending order. Products with these arrays take less time than the construction of a `csr_array`.
    foot : ndarray (n, dim)
        Variation of the positions of these primary points, on the smooth surface if there is one, that is caused by the
        variation of xi alone, with the facets fixed [length].
    normal : ndarray (n, dim)
        Variation of the normals [-].
    """

    xi: Array
    weights: Array
    nodes: NDArray[np.integer]
    foot: Array
    normal: Array

    def motion(self, nodal: Array) -> Array:
        """Return the products (n, dim) of the variation of `motion` with a nodal field (n_points, dim)."""
        return np.einsum("nk,nkd->nd", self.weights, nodal[self.nodes])

    def nodal_forces(self, forces: Array, n_points: int) -> Array:
        """Return the products (n_points, dim) of the transposed variation with forces (n, dim) at the points [force]."""
        dim = forces.shape[1]
        columns = self.nodes[:, :, None] * dim + np.arange(dim)
        weighted = self.weights[:, :, None] * forces[:, None]
        total = np.bincount(columns.ravel(), weighted.ravel(), n_points * dim)
        return np.asarray(total, float).reshape(n_points, dim)


class SurfacePoints:
    """Secondary points paired with a meshed side, and the variation of their projections and normals.

    The foot of a secondary point is the primary point that it faces.

    Parameters
    ----------
    candidates : Candidates
    pairing : Pairing
        Pairing of the candidates with the primary side.
    rows : ndarray of int (n,)
        Numbers of the points in `candidates`.
    primary : DeformedSide
        The primary side in the configuration of the pairing.
    normals : str or tuple of float
        Normals of the primary side: ``"facet"``, ``"averaged"``, or a fixed vector.
    closest : bool
        Whether points face the closest points on the primary side, instead of projections along the normals. Both coincide
        for facet normals.
    slope : ndarray (n, dim - 1), optional
        Derivatives of the heights of a smooth primary surface above its facets with respect to reference coordinates, see
        `surface_smoothing` [length].

    Attributes
    ----------
    motion : csr_array (n, n_points)
        Map from nodal vectors to the differences of their values at the points and at their feet [-].
    offset : ndarray (n, dim)
        Vectors from the feet to the points [length].
    axes : ndarray (n, dim - 1, dim)
        Tangent vectors of the primary facets at the feet [length].
    normal : ndarray (n, dim)
        Normals of the primary side at the feet [-].
    averaged : InterpolatedNormals or None
        Averaged normals; None with other normals.
    overhangs : bool
        Whether points lie beyond the end of the primary side. Their normals are those at the end, but the variation of the
        normals is that of the extended facets.
    """

    def __init__(
        self, candidates: Candidates, pairing: Pairing, rows: Indices, primary: DeformedSide, normals: object,
        closest: bool, slope: Array | None,
    ) -> None:  # fmt: skip
        feet, coordinates, facet = pairing.extended_feet(rows), primary.coordinates, pairing.facet[rows]
        nodes, shape = np.hstack([candidates.nodes[rows], feet.nodes]), np.hstack([candidates.shape[rows], -feet.shape])
        self.motion = shapes_at(shape, nodes, len(coordinates))
        self.overhangs = pairing.overhang_xi is not None and bool(pairing.overhang_xi[rows].any())
        self._feet, ascending = feet, np.argsort(feet.nodes, axis=1)
        self._foot_nodes = np.take_along_axis(feet.nodes, ascending, axis=1)
        self._weight_gradient = -np.take_along_axis(feet.gradient, ascending[:, :, None], axis=1)
        self.axes = np.swapaxes(feet.gradient, 1, 2) @ coordinates[feet.nodes]
        self.offset = self.motion @ coordinates
        self.normal, self.averaged = pairing.normal[rows], None
        self._normal_gradient = np.zeros_like(self.axes)
        self._facet_normal: Array | None = None  # None if neither the normals nor the projections depend on it
        if normals == "facet" or closest:
            self._facet_normal = self.normal
            facet_gradient = self._facet_normal_gradient(primary, facet, pairing.xi[rows])
        if normals == "facet":
            self._normal_gradient = facet_gradient
        elif isinstance(normals, str):
            self.averaged = InterpolatedNormals(primary, feet.local, feet.shape, primary.smooth_normals[facet])
            self.normal, self._normal_gradient = self.averaged.normal, self.averaged.gradient(feet.gradient)
        else:
            self.normal = np.broadcast_to(np.array(normals, float), self.normal.shape)
        # Let a_i be the tangent vectors, n the direction of the projection, g the distance along n, and dv the variation of
        # the displacements of the points relative to their feet. Then ``a_i dxi_i + g dn = dv`` up to a multiple of n.
        # The products with the tangents perpendicular to n eliminate this multiple.
        direction, gradient = self.normal, self._normal_gradient
        if closest:
            direction, gradient = pairing.normal[rows], facet_gradient
        frame = np.stack(tangents(direction), axis=1)
        self._closest, self._has_facet_normals = closest, normals == "facet"
        self._gap = np.einsum("nd,nd->n", self.offset, direction)[:, None]
        inverse = np.linalg.inv(np.einsum("ntd,nid->nti", frame, self.axes + self._gap[:, :, None] * gradient))
        self._inverse = inverse @ frame
        self._foot_gradient = self.axes if slope is None else self.axes + slope[:, :, None] * self.normal[:, None]

    def _facet_normal_gradient(self, primary: DeformedSide, facet: Indices, xi: Array) -> Array:
        """Return the derivatives (n, dim - 1, dim) of facet normals with respect to reference coordinates [-]."""
        if primary.surface.order == 1 and xi.shape[1] == 1:
            return np.zeros_like(self.axes)  # straight lines
        # Shape functions are at most quadratic along each axis, so that central differences of gradients are exact.
        steps = 0.5 * np.eye(xi.shape[1])
        gradients = [[facet_points(primary.surface, facet, xi + h).gradient for h in (step, -step)] for step in steps]
        second = np.stack([above - below for above, below in gradients], axis=3)
        curvature = np.einsum("nkij,nkd,nd->nij", second, primary.coordinates[self._feet.nodes], self.normal)
        return -np.einsum("njd,nij->nid", self._dual_axes, curvature)

    @cached_property
    def _dual_axes(self) -> Array:
        """Dual vectors (n, dim - 1, dim) of the tangent vectors `axes` [1 / length]."""
        return np.asarray(np.linalg.solve(np.einsum("nid,njd->nij", self.axes, self.axes), self.axes))

    def variation(self, du: Array) -> Variation:
        """Return the variation of projections and normals for a variation `du` (n_points, dim) of displacements [length]."""
        relative_motion, d_facet_normal = self.motion @ du, np.zeros_like(self.normal)
        if self._facet_normal is not None:
            slopes = np.swapaxes(self._feet.gradient, 1, 2) @ du[self._feet.nodes]
            tilt = np.einsum("nid,nd->ni", slopes, self._facet_normal)
            d_facet_normal = -np.einsum("nid,ni->nd", self._dual_axes, tilt)
        at_fixed_xi = d_facet_normal if self._has_facet_normals else np.zeros_like(d_facet_normal)
        if self.averaged is not None:
            at_fixed_xi = self.averaged.variation(du)
        d_direction = d_facet_normal if self._closest else at_fixed_xi
        xi = np.einsum("nid,nd->ni", self._inverse, relative_motion - self._gap * d_direction)
        foot = np.einsum("nid,ni->nd", self._foot_gradient, xi)
        weights = np.einsum("nki,ni->nk", self._weight_gradient, xi)
        normal = at_fixed_xi + np.einsum("nid,ni->nd", self._normal_gradient, xi)
        return Variation(xi, weights, self._foot_nodes, foot, normal)

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
        metric = np.einsum("nid,njd->nij", dual, dual)
        curvature = np.einsum("nid,njd->nij", self._normal_gradient, self.axes)
        slopes = self._feet.gradient[..., None] * self.normal[:, None, None]
        tilts = [nodal_rows(self._feet.nodes, slopes[:, :, i], n_dofs) for i in axes]
        tilt_sums = [sum(scaled(tilts[j], gap * metric[:, i, j]) for j in axes) for i in axes]
        d_xi = [rows_of(self.motion, dual[:, i]) + tilt_sums[i] for i in axes]
        K = csr_array((n_dofs, n_dofs))
        for i in axes:
            K += 2.0 * tilts[i].T @ scaled(d_xi[i], force)
            for j in axes:
                K -= d_xi[i].T @ scaled(d_xi[j], force * curvature[:, i, j])
                K -= tilts[i].T @ scaled(tilts[j], force * gap * metric[:, i, j])
        return csr_array(0.5 * (K + K.T))


class ObstaclePoints:
    """Secondary points paired with a rigid obstacle, which has no nodes, and the variation of their normals.

    Parameters
    ----------
    secondary : csr_array (n, n_points)
        Values of the shape functions at the points, by node [-].
    obstacle : RigidSide
    coordinates : ndarray (n_points, dim)
        Nodal coordinates in the configuration of the pairing [length].
    pose : Pose
    """

    def __init__(self, secondary: csr_array, obstacle: RigidSide, coordinates: Array, pose: Pose) -> None:
        self.averaged, self.overhangs = None, False
        self.motion, x = secondary, secondary @ coordinates
        gap, self.normal, paired, _ = obstacle.project(x, pose)
        self._gap = np.where(paired, gap, 0.0)[:, None]
        self.offset = self._gap * self.normal
        step = DIFFERENCE_STEP * float(np.ptp(coordinates, axis=0).max())
        pairs = [[obstacle.project(x + sign * step * axis, pose)[1] for sign in (1, -1)] for axis in np.eye(x.shape[1])]
        self._gradient = np.stack([ahead - behind for ahead, behind in pairs], axis=2) / (2.0 * step)
        self._gradient[~np.isfinite(self._gradient)] = 0.0

    def variation(self, du: Array) -> Variation:
        """See `SurfacePoints.variation`; there are no reference coordinates."""
        motion = self.motion @ du
        normal = np.einsum("nde,ne->nd", self._gradient, motion)
        foot = transverse(self.normal, motion) - self._gap * normal
        no_weights, no_nodes = np.zeros((len(normal), 0)), np.zeros((len(normal), 0), int)
        return Variation(no_weights, no_weights, no_nodes, foot, normal)

    def stiffness(self, force: Array) -> csr_array:
        """See `SurfacePoints.stiffness`."""
        rows = [rows_of(self.motion, np.broadcast_to(axis, self.normal.shape)) for axis in np.eye(self.normal.shape[1])]
        normal_rows = [rows_of(self.motion, self._gradient[:, i]) for i in range(len(rows))]
        K = -sum(row.T @ scaled(normal_row, force) for row, normal_row in zip(rows, normal_rows, strict=True))
        return csr_array(0.5 * (K + K.T))


Points: TypeAlias = SurfacePoints | ObstaclePoints
