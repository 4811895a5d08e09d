r"""Geometric correction of contact surfaces: gaps between the smooth surfaces that facets approximate.

Non-matching facets of curved sides leave gaps and overlaps of the size of their sag :math:`s`, and thus pressure errors of
the order of :math:`E s / L` for facets of length L, independently of the interference. A surface of constant curvature plus a
polynomial of twice the order of the facet is fitted to the nodes of the facet and of those around it (local surface fitting:
Jiao and Zha, 2008). Let P be the height of this smooth surface above the plane of the facet. Its height h above the facet
itself is the interpolation error of P with the shape functions :math:`N_a` of the nodes :math:`x_a`,
:math:`h = P - \sum_a N_a P(x_a)`. It vanishes at nodes, on flat sides, and where facets follow the surface.

Only the curvature that both sides share is corrected: a sphere that is pressed on a plane is flat within the contact, like
its facets. With the curvature tensors :math:`K_s` and :math:`K_p` of facets that face each other, heights of one side are
multiplied by :math:`\min(\max(-(K_s : K_p) / (K : K), 0), 1)`, with the tensor K of that side. Fits do not extend across
corners. Where the curvature changes from K in one facet to K' in the next, heights are multiplied by the limiter of van
Albada, van Leer and Roberts (1982), :math:`2 K : K' / (K : K + K' : K')`, so that a plane next to a fillet remains plane.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.polynomial.polynomial import polyvander
from scipy.sparse import csr_array

from fastcontact._tools.records import record, replace
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.projection import CORNER, closest_of_types
from fastcontact.contact.surface import FacetBlock, Surface
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import flat_area_vectors, unit_vectors
from fastcontact.round_off import LENGTH_ROUND_OFF, SINGLE_PRECISION

# Factor by which the columns of a least-squares fit decrease with each degree of the polynomial. As the fit is regularised,
# it prefers terms of low degree if the nodes do not determine all terms, such as on a strip of a single row of facets. With
# 1, `test_cylinders_and_spheres_are_met` fails.
DEGREE_FACTOR = 0.1
# Number of passes of a fit. The relative error for circles, spheres and cylinders of radius R is of the order (L / R)^(2
# PASSES). With 2, `test_circles_are_met_from_both_sides_and_up_to_their_ends` fails on linear facets.
PASSES = 3


@record
class SmoothSide:
    """Heights and curvatures of the smooth surface above the facets of one side.

    Attributes
    ----------
    heights : ndarray (n_facets, k, k), on lines (n_facets, k, 1)
        Coefficients of the powers of the reference coordinates, positive outward [length].
    curvature : ndarray (n_facets, dim - 1, dim - 1)
        Tensors along the `frames` of the facets, positive where the side is convex [1 / length].
    side : Surface
    points : ndarray (n_points, dim)
        Reference coordinates of all points of the mesh [length].
    """

    heights: Array
    curvature: Array
    side: Surface
    points: Array

    def height(self, facet: Indices, xi: Array) -> Array:
        """Return the heights (n,) at the reference coordinates `xi` (n, dim - 1) of facets (n,) [length]."""
        k, m = self.heights.shape[1:]
        powers = np.vander(xi[:, 0], k, True), np.vander(xi[:, -1], m, True)
        return np.asarray(np.einsum("nij,ni,nj->n", self.heights[facet], *powers))

    def slope(self, facet: Indices, xi: Array) -> Array:
        """Return the derivatives (n, dim - 1) of the heights with respect to the reference coordinates [length]."""
        k, m = self.heights.shape[1:]
        first, second = np.arange(1.0, k)[:, None] * self.heights[:, 1:], np.arange(1.0, m) * self.heights[:, :, 1:]
        derivatives = [replace(self, heights=heights) for heights in (first, second)[: xi.shape[1]]]
        return np.stack([derivative.height(facet, xi) for derivative in derivatives], axis=1)


@record
class Smoothing:
    """The smooth surfaces of both sides of a contact pair."""

    secondary: SmoothSide
    primary: SmoothSide

    @classmethod
    def of(cls, secondary: Surface, primary: Surface, points: Array) -> Smoothing | None:
        """Return the smooth surfaces of two sides at reference `points` (n_points, dim); None if no curvature is shared."""
        smooth_primary = smooth_side(primary, points)
        smooth_secondary = None if smooth_primary is None else smooth_side(secondary, points)
        if smooth_secondary is None or smooth_primary is None:
            return None
        smoothing = cls(smooth_secondary, smooth_primary)
        centres = [points[b.facets[:, : elements.get(b.element).n_corners]].mean(axis=1) for b in secondary.blocks]
        opposite = closest_of_types(np.concatenate(centres), primary.node_positions(points)).facet
        factor = smoothing.height_factors(np.arange(len(opposite)), opposite, smoothing.frames(points))
        is_corrected = factor[:, 0] * np.abs(smooth_secondary.heights).max(axis=(1, 2)) > 0.0
        is_corrected |= factor[:, 1] * np.abs(smooth_primary.heights[opposite]).max(axis=(1, 2)) > 0.0
        return smoothing if is_corrected.any() else None

    def frames(self, coordinates: Array) -> list[Array]:
        """Return the frames of all facets of both sides at `coordinates` (n_points, dim); see the function `frames`."""
        return [frames(smooth.side, smooth.points, coordinates) for smooth in (self.secondary, self.primary)]

    def height_factors(self, secondary: Indices, primary: Indices, frames: Sequence[Array]) -> Array:
        """Return the factors (n, 2) of the heights of secondary and primary facets, both (n,), that face each other [-].

        `frames` are the current tangents of all facets of both sides, see the method `frames`.
        """
        K_s = self.secondary.curvature[secondary]
        K_p = _in_plane_of(frames[0][secondary], frames[1][primary], self.primary.curvature[primary])
        product = -np.einsum("nij,nij->n", K_s, K_p)
        squares = np.stack([np.einsum("nij,nij->n", K, K) for K in (K_s, K_p)], axis=1)
        return np.clip(np.divide(product[:, None], squares, out=np.zeros_like(squares), where=squares > 0.0), 0.0, 1.0)

    def overlap(self, secondary: tuple[Indices, Array], primary: tuple[Indices, Array], coordinates: Array) -> Array:
        """Return the distances (n,) by which the smooth surfaces are closer to each other than the facing facets [length].

        `secondary` and `primary` are facets (n,) and reference coordinates (n, dim - 1) in them, and `coordinates`
        (n_points, dim) the current coordinates of all points of the mesh [length].
        """
        factor = self.height_factors(secondary[0], primary[0], self.frames(coordinates))
        return factor[:, 0] * self.secondary.height(*secondary) + factor[:, 1] * self.primary.height(*primary)


def frames(side: Surface, points: Array, coordinates: Array) -> Array:
    """Return convected tangents (n_facets, dim - 1, dim) at the centres of facets.

    In the reference configuration, at `points` (n_points, dim), they are unit vectors, the first of which points to the first
    corner. Tangents follow the mean deformation of a facet to `coordinates` (n_points, dim), so that all corners have the
    same influence.
    """
    frames_of_blocks = []
    for block in side.blocks:
        initial, current = (x[block.facets[:, : elements.get(block.element).n_corners]] for x in (points, coordinates))
        axes = _axes(block, points, _normals(block, points))[:, :-1]
        local = (initial - initial.mean(axis=1, keepdims=True)) @ axes.transpose(0, 2, 1)
        centred = current - current.mean(axis=1, keepdims=True)
        frames_of_blocks.append(np.linalg.solve(local.transpose(0, 2, 1) @ local, local.transpose(0, 2, 1) @ centred))
    return np.concatenate(frames_of_blocks)


def _normals(block: FacetBlock, coordinates: Array) -> Array:
    """Return the unit normals (n_facets, dim) of the planes through the corners of facets."""
    corners = coordinates[block.facets[:, : elements.get(block.element).n_corners]]
    return unit_vectors(flat_area_vectors(corners))


def _axes(block: FacetBlock, coordinates: Array, normal: Array) -> Array:
    """Return the unit tangents and normal (n_facets, dim, dim) at the centres of facets with this `normal` (n_facets, dim).

    The first tangent points to the first corner. `coordinates` (n_points, dim) are those of all points [length].
    """
    corners = coordinates[block.facets[:, : elements.get(block.element).n_corners]]
    first = corners[:, 0] - corners.mean(axis=1)
    first = unit_vectors(first - np.einsum("nd,nd->n", first, normal)[:, None] * normal)
    return np.stack([first, normal] if len(normal.T) == 2 else [first, np.cross(normal, first), normal], axis=1)


def smooth_side(side: Surface, points: Array) -> SmoothSide | None:
    """Return the smooth surface of a side at `points` (n_points, dim); None if its facets have no sag."""
    offset = points[side.points] - points[side.points].mean(axis=0)
    # All nodes are in one plane.
    if np.linalg.svd(offset, compute_uv=False)[-1] <= LENGTH_ROUND_OFF * np.linalg.norm(offset):
        return None
    adjacency, nodes, valid = _neighbours(side, np.concatenate([_normals(block, points) for block in side.blocks]))
    neighbourhood, fits = points[side.points[nodes]], []
    offset, is_valid = np.where(valid[:, :, None], neighbourhood, 0.0), valid[:, :, None]
    offset = np.where(is_valid, offset - (offset.sum(axis=1) / valid.sum(axis=1)[:, None])[:, None], 0.0)
    smallest = np.linalg.eigvalsh(offset.transpose(0, 2, 1) @ offset)[:, 0]
    # The nodes around each facet are in one plane.
    if (smallest <= (LENGTH_ROUND_OFF * np.linalg.norm(offset, axis=(1, 2))) ** 2).all():
        return None
    for block, start in zip(side.blocks, side.offsets):
        rows = slice(start, start + len(block.facets))
        fit = _fit(block, points, neighbourhood[rows], valid[rows], 2 * side.order)
        is_determined = fit.extends_to(neighbourhood[rows], valid[rows])[:, None, None]
        heights, curvature, axes = _heights(block, points, fit, fit.error(neighbourhood[rows], valid[rows]))
        fits.append((heights * is_determined, curvature * is_determined, axes))
    heights, curvature, axes = map(np.concatenate, zip(*fits, strict=True))
    if not heights.any():
        return None
    return SmoothSide(heights * _limiter(adjacency, curvature, axes)[:, None, None], curvature, side, points)


def _neighbours(side: Surface, normal: Array) -> tuple[csr_array, Indices, Mask]:
    """Return the smooth neighbours of each facet, which share a node with it without a corner, and the nodes of these facets.

    The results are an adjacency matrix (n_facets, n_facets) with ones on the diagonal, the nodes (n_facets, k) as positions
    in the points of the side, and a mask of the valid entries of the second array. `normal` (n_facets, dim) are the normals
    of the facets.
    """
    # Without sorting, round-off would depend on the order of the nodes in each facet.
    incidence = side.incidence.sorted_indices()
    i, j = (incidence @ incidence.T).tocoo().coords
    smooth = np.einsum("nd,nd->n", normal[i], normal[j]) > np.cos(np.radians(CORNER))
    adjacency = csr_array((np.ones(smooth.sum()), (i[smooth], j[smooth])), shape=(side.n_facets, side.n_facets))
    neighbour_nodes = csr_array(adjacency @ incidence)
    valid = np.arange(np.diff(neighbour_nodes.indptr).max()) < np.diff(neighbour_nodes.indptr)[:, None]
    nodes = np.zeros(valid.shape, np.intp)
    nodes[valid] = neighbour_nodes.indices
    return adjacency, nodes, valid


@record
class _Fit:
    """Smooth surfaces above the planes of n facets, the sum of a surface of constant `curvature` (n, d, d) and a polynomial.

    The planes contain the mean of the corners, `origin` (n, dim), and have the `axes` (n, dim, dim), the last of which are
    normals. `polynomial` (n, n_terms) are the coefficients of the terms with the exponents `powers`. Lengths are relative to
    the `size` (n,) of the facets; d is dim - 1.
    """

    axes: Array
    origin: Array
    size: Array
    curvature: Array
    powers: tuple[Indices, Indices]
    polynomial: Array

    def in_planes(self, points: Array) -> tuple[Array, Array]:
        """Return the coordinates (n, m, d) of `points` (n, m, dim) in the planes, and their heights (n, m) above them."""
        local = np.einsum("nkd,ned->nke", points - self.origin[:, None], self.axes) / self.size[:, None, None]
        return local[..., :-1], local[..., -1]

    def fitted(self, points: Array, valid: Mask) -> _Fit:
        """Return the surfaces with polynomials fitted to those `points` (n, m, dim) that are `valid` (n, m)."""
        (plane, height), (i, j) = self.in_planes(points), self.powers
        binomials = [math.comb(*pair) for pair in zip(i + j, i)]
        scale = DEGREE_FACTOR ** (i + j) * np.sqrt(binomials)  # Bombieri's norm is invariant under rotation
        columns = np.where(valid[..., None], scale * _terms(plane, i, j), 0.0)
        residual = np.where(valid, height - _conic(self.curvature, plane), 0.0)
        parameter = DEGREE_FACTOR ** (i + j).max() * np.sqrt(SINGLE_PRECISION * (columns**2).sum(axis=(1, 2)))
        regularisation = parameter[:, None, None] * np.eye(len(i), len(i) + 1)
        # With normal equations instead of QR, terms determined by the regularisation would be accurate to only 1e-3.
        rows = np.concatenate([np.concatenate([columns, residual[..., None]], axis=2), regularisation], axis=1)
        R: Array = np.asarray(np.linalg.qr(rows, mode="r"))
        return replace(self, polynomial=scale * np.linalg.solve(R[:, : len(i), :-1], R[:, : len(i), -1:])[..., 0])

    def height(self, plane: Array) -> Array:
        """Return the heights (n, m) above points (n, m, d) of the planes."""
        return _conic(self.curvature, plane) + np.einsum("nqt,nt->nq", _terms(plane, *self.powers), self.polynomial)

    def extends_to(self, points: Array, valid: Mask) -> Mask:
        """Return which surfaces (n,) of constant curvature extend to all `points` (n, m, dim) that are `valid` (n, m).

        If the points lie outside the surface of constant curvature, for example in three coarse facets in a row, they do not
        determine the surface, and the fit amplifies round-off.
        """
        Kx = np.einsum("nqd,nde->nqe", self.in_planes(points)[0], self.curvature)
        return np.asarray((((Kx**2).sum(axis=2) < 1.0) | ~valid).all(axis=1))

    def error(self, points: Array, valid: Mask) -> Array:
        """Return the largest distances (n,) from the surfaces to those `points` (n, m, dim) that are `valid` (n, m)."""
        plane, height = self.in_planes(points)
        return np.asarray(np.where(valid, np.abs(self.height(plane) - height), 0.0).max(axis=1))

    def slope_and_curvature(self) -> tuple[Array, Array]:
        """Return the slopes (n, d) and curvatures (n, d, d) at the centres of the facets."""
        term = {(int(a), int(b)): n for n, (a, b) in enumerate(zip(*self.powers, strict=True))}
        if self.curvature.shape[1] == 1:
            slope, second = [term[1, 0]], np.array([[term[2, 0]]])
        else:
            slope, second = [term[1, 0], term[0, 1]], np.array([[term[2, 0], term[1, 1]], [term[1, 1], term[0, 2]]])
        return self.polynomial[:, slope], self.curvature - self.polynomial[:, second] * (1.0 + np.eye(len(second)))


def _fit(block: FacetBlock, points: Array, neighbourhood: Array, valid: Mask, degree: int) -> _Fit:
    """Fit surfaces to the `valid` (n, m) points of the `neighbourhood` (n, m, dim) of each facet of a block [length].

    In each pass, planes are rotated to the tangents of the surfaces, and the curvatures of the polynomials are moved to
    `curvature`.
    """
    corners = points[block.facets[:, : elements.get(block.element).n_corners]]
    origin, normal = corners.mean(axis=1), _normals(block, points)
    size = np.linalg.norm(corners - origin[:, None], axis=2).max(axis=1)
    n_tangents = points.shape[1] - 1
    powers, curvature = _powers(n_tangents, degree), np.zeros((len(corners), n_tangents, n_tangents))
    fit = _Fit(_axes(block, points, normal), origin, size, curvature, powers, np.empty(0)).fitted(neighbourhood, valid)
    for _ in range(1, PASSES):
        slope, curvature = fit.slope_and_curvature()
        fit = replace(fit, axes=_tilted(fit.axes, slope), curvature=curvature).fitted(neighbourhood, valid)
    return fit


def _tilted(axes: Array, slope: Array) -> Array:
    """Return axes (n, dim, dim), rotated by the smallest angle to the normals of surfaces with the `slope` (n, dim - 1)."""
    normal = unit_vectors(axes[:, -1] - np.einsum("nj,njd->nd", slope, axes[:, :-1]))
    twice_mean = axes[:, -1] + normal
    tilt = np.einsum("njd,nd->nj", axes[:, :-1], normal) / np.einsum("nd,nd->n", twice_mean, normal)[:, None]
    return np.concatenate([axes[:, :-1] - tilt[:, :, None] * twice_mean[:, None], normal[:, None]], axis=1)


def _heights(block: FacetBlock, points: Array, smooth: _Fit, error: Array) -> tuple[Array, Array, Array]:
    """Return the coefficients (n, k, m) of the heights of surfaces above facets, and their curvatures and tangents.

    Curvatures and tangents are those at the centres of the facets. If the `error` (n,) of a fit is larger than the largest
    height, no smooth surface fits the nodes, and the heights are zero.
    """
    element, k = elements.get(block.element), smooth.powers[0].max() + 1
    (xi, powers), (nodes, _) = _lattice(element, k), smooth.in_planes(points[block.facets])
    shape = element.shape(xi)
    height = smooth.height(np.einsum("qk,nke->nqe", shape, nodes)) - smooth.height(nodes) @ shape.T
    threshold = np.where(error > np.abs(height).max(axis=1), np.inf, LENGTH_ROUND_OFF)
    height = smooth.size[:, None] * np.where(np.abs(height) > threshold[:, None], height, 0.0)
    heights = np.zeros((len(nodes), k, k if element.dim == 2 else 1))
    heights[:, powers[0], powers[1]] = np.linalg.solve(_terms(xi, *powers), height.T).T
    curvature = smooth.slope_and_curvature()[1]
    curvature = np.where(np.abs(curvature) > LENGTH_ROUND_OFF, curvature, 0.0) / smooth.size[:, None, None]
    return heights, curvature, smooth.axes[:, :-1]


def _conic(curvature: Array, plane: Array) -> Array:
    r"""Return the heights (n, m) of surfaces of constant `curvature` K (n, d, d) over points x (n, m, d) of their planes.

    They are :math:`-x^T K x / (1 + \sqrt{1 - x^T K^2 x})`, which is exact for spheres and cylinders.
    """
    Kx = np.einsum("nqd,nde->nqe", plane, curvature)
    root = np.sqrt(np.maximum(1.0 - (Kx**2).sum(axis=2), 0.0))
    return np.asarray(-(Kx * plane).sum(axis=2) / (1.0 + root))


def _powers(dim: int, degree: int) -> tuple[Indices, Indices]:
    """Return the exponents of the terms of a polynomial in one or two variables."""
    i, j = (exponents.ravel() for exponents in np.indices((degree + 1, degree + 1 if dim == 2 else 1)))
    in_range = i + j <= degree
    return i[in_range], j[in_range]


def _terms(x: Array, i: Indices, j: Indices) -> Array:
    """Return the terms with exponents `i` and `j` (n_terms,) at coordinates (..., 1 or 2)."""
    table = polyvander(x, int(i.max()))
    return np.asarray(table[..., 0, i] * table[..., -1, j])


def _lattice(element: elements.Element, k: int) -> tuple[Array, tuple[Indices, Indices]]:
    """Return points of a reference facet, and the exponents of the polynomial terms that their values determine."""
    if element.n_corners == 3:
        i, j = _powers(2, k - 1)
        return np.column_stack([i, j]) / (k - 1.0), (i, j)
    i, j = (exponents.ravel() for exponents in np.indices((k, k if element.dim == 2 else 1)))
    abscissa = np.linspace(-1.0, 1.0, k)
    return (abscissa[i][:, None] if element.dim == 1 else np.column_stack([abscissa[i], abscissa[j]])), (i, j)


def _limiter(adjacency: csr_array, curvature: Array, axes: Array) -> Array:
    """Return the factors (n_facets,) that reduce heights where the curvature changes towards adjacent facets [-].

    `adjacency` (n_facets, n_facets) is the first result of `_neighbours`. The tensors `curvature` (n_facets, d, d) have
    components along `axes` (n_facets, d, dim).
    """
    i, j = adjacency.tocoo().coords
    neighbour, square = _in_plane_of(axes[i], axes[j], curvature[j]), np.einsum("nij,nij->n", curvature, curvature)
    product, squares = 2.0 * np.einsum("nij,nij->n", curvature[i], neighbour), square[i] + square[j]
    factor = np.ones(len(curvature))
    np.minimum.at(factor, i, np.divide(product, squares, out=np.ones_like(squares), where=squares > 0.0))
    return np.maximum(factor, 0.0)


def _in_plane_of(axes: Array, other_axes: Array, tensor: Array) -> Array:
    """Return the components along `axes` of tensors (n, d, d) that are given along `other_axes` (n, d, dim).

    The plane of the other axes is first rotated into the plane of `axes`.
    """
    rotation = np.einsum("nid,njd->nij", axes, other_axes)
    if rotation.shape[1] == 2:  # the closest rotation or reflection
        cofactors = rotation[:, ::-1, ::-1] * [[1.0, -1.0], [-1.0, 1.0]]
        rotation = rotation + np.sign(np.linalg.det(rotation))[:, None, None] * cofactors
    rotation = rotation / (np.abs(np.linalg.det(rotation)) ** (1.0 / rotation.shape[1]))[:, None, None]
    return np.asarray(rotation @ tensor @ rotation.transpose(0, 2, 1))
