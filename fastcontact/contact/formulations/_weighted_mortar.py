r"""Mortar contact with one weighted gap per node: :math:`\int \psi_j\, (x_s - x_p) \cdot n_j \ge 0`.

The integrals extend over the mortar segments of the two sides (Puso, 2004; Popp, Gitterle, Gee and Wall, 2010). A gap is
divided by the integral of :math:`\psi_j`, so that it is a length and its multiplier is the nodal force. The normal is the
mean of the normals of the primary side around the node.

``"dual"`` functions are biorthogonal to the shape functions of the secondary side, see `_dual_basis`. Each gap then involves
only one node of that side, or a mid-side node and the ends of its edge. Constraints can therefore be eliminated one by one,
those of corners first, and the matrix remains sparse and positive definite. ``"standard"`` functions are linear between the
corners, also on quadratic facets, and only corners have gaps.

Against a rigid obstacle the integrals use Gauss points of complete facets, and :math:`x_p` is the point of the obstacle that
is closest to each Gauss point.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, Linearised, NodalField
from fastcontact.contact.formulations._cut_faces import face_overlap
from fastcontact.contact.formulations._cut_lines import line_overlap, opposite_ends
from fastcontact.contact.formulations._dual_basis import SMALL_FRACTION, SMALL_INTEGRAL, dual_functions, positive_basis
from fastcontact.contact.formulations._finite_differences import FiniteDifferences
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.formulations._overlap import Overlap, obstacle_overlap
from fastcontact.contact.integration import NEGLIGIBLE_AREA, areas_of_rule, nodal_areas
from fastcontact.contact.linearised_geometry import ClosingMotion, LinearisedPoints, Substitution
from fastcontact.contact.linearised_projections import Points
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pairing import FACING, Candidates, Normals, pair, tangents
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.search.limits import LARGEST_OVERHANG
from fastcontact.contact.supported_nodes import directions_without_slip, nodes_with_prescribed_gap
from fastcontact.contact.surface import Surface, padded
from fastcontact.errors import ContactError, unknown
from fastcontact.linear.sparse_rows import Blocks, assembled, rows_of, scaled, without_zeros
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.round_off import DIFFERENCE_STEP, LENGTH_ROUND_OFF, SINGLE_PRECISION

MULTIPLIERS = ("standard", "dual")


class Coverage(NamedTuple):
    """The overlap of both sides, and the integrals of the test functions and of the functions psi over it.

    The k test functions of a facet depend on its element type only. With standard multipliers, psi are the test functions of
    the nodes that have a gap; with dual multipliers, they are biorthogonal to these on the overlap.

    Attributes
    ----------
    overlap : Overlap
    weights : list of ndarray (n_facets, k)
        Integrals of the test functions over the overlap, for the facets of each block [area].
    with_gap : ndarray of bool (m,)
        Secondary nodes that have a gap.
    functions : list of (ndarray (n_facets, k, k), ndarray (n_facets, k, k))
        For each block, the coefficients of the functions psi in terms of the shape functions [-], and the integrals of
        products of both [area].
    nodal_map : csr_array (m, m)
        Map from independent to nodal values of the multiplier field [-].
    """

    overlap: Overlap
    weights: list[Array]
    with_gap: Mask
    functions: list[tuple[Array, Array]]
    nodal_map: csr_array


class Means(NamedTuple):
    """Weighted means at the secondary nodes of the motion relative to the primary side.

    Attributes
    ----------
    coverage : Coverage
    D, M : csr_array (m, n_points)
        Mortar matrices: integrals of psi times the secondary and times the primary shape functions [area].
    weight : ndarray (m,)
        Integrals of psi; infinite for nodes without gaps [area].
    motion : csr_array (m, n_points)
        Map ``(D - M) / weight`` from displacements to mean displacements relative to the primary side [-].
    gap_reduction : ndarray (m, dim)
        Mean vectors of `Overlap.gap_reductions` [length].
    normal : ndarray (m, dim)
        Unit normals [-].
    """

    coverage: Coverage
    D: csr_array
    M: csr_array
    weight: Array
    motion: csr_array
    gap_reduction: Array
    normal: Array


class SlipData(NamedTuple):
    """Quantities from which the slips of nodes are linearised.

    Attributes
    ----------
    tangents : ndarray (k, m, dim)
        Unit tangents [-].
    closing_length : ndarray (m,)
        Lengths by which gaps close in the step [length].
    substitutions : list of (Substitution, Coverage)
        Corrections of slips along directions in which supports hold both sides, each with the coverage in which the held
        nodes have no gap.
    """

    tangents: Array
    closing_length: Array
    substitutions: list[tuple[Substitution, Coverage]]


@dataclass(eq=False)
class WeightedMortar(Formulation):
    """Mortar contact with weighted gaps at nodes. The parameters of `Formulation` apply as well.

    Parameters
    ----------
    normals : str or sequence of float
        Normals of the primary side whose weighted mean is the normal of a node: ``"facet"`` for those of the opposite facets,
        or ``"averaged"`` for averages at the primary nodes, interpolated on the facets. ``"secondary"`` and vectors have the
        same meaning as in `Formulation`.
    multipliers : str
        ``"dual"`` or, in 3D only, ``"standard"``; in 2D the latter is the method of another class, see `mortar`.
    """

    projection_tolerance: float = SINGLE_PRECISION
    normals: Normals | None = "averaged"
    surface_smoothing: bool = True
    multipliers: str = "standard"

    name: ClassVar[str] = "mortar"
    weighs_gaps: ClassVar[bool] = True
    # For each block, the coefficients (k, k) of the test functions in terms of the shape functions [-], and the integrals
    # (n_facets, k) of the test functions over complete facets [area].
    _test: list[Array] = field(init=False, repr=False)
    _full_weights: list[Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if str(self.multipliers) not in MULTIPLIERS:
            raise ContactError(unknown("kind of multipliers", self.multipliers, MULTIPLIERS))
        self._test, self._full_weights = [], []
        for block in self.secondary.blocks:
            if self.multipliers == "dual":
                T = positive_basis(block.element)
            else:  # shape functions of the corners, and zero at mid-side nodes
                element = elements.get(block.element)
                linear = elements.get(element.linear).shape(element.nodes).T
                T = np.vstack([linear, np.zeros((element.n_nodes - element.n_corners, element.n_nodes))])
            self._test.append(T)
            N, dA = areas_of_rule(block, self.points, self.axisymmetric)
            self._full_weights.append(dA @ N @ T.T)

    @property
    def eliminable(self) -> bool:
        """See `Formulation`; standard multipliers couple the corners of quadratic facets through the mid-side nodes."""
        return self.multipliers == "dual" or self.secondary.order == 1

    def _overlap(self, config: Configuration) -> Overlap:
        deformed = self.points + config.displacement
        if isinstance(self.primary, RigidSide):
            coordinates = self.points, deformed
            return obstacle_overlap(self.secondary, self.primary, coordinates, self.axisymmetric, config.pose)
        if deformed.shape[1] == 3:
            return face_overlap(self.secondary, self.primary, self.points, deformed, self.smoothing)
        options = self.axisymmetric, self.projection_tolerance, self.smoothing
        return line_overlap(self.secondary, config.deformed(self.primary, self.points), self.points, *options)

    def may_alternate(self, constraints: Constraints) -> bool:
        """See `Formulation`; a node with dual functions and a small overlap may have a gap in every other pairing."""
        if self.multipliers == "dual" and self.options.kind != "tied" and constraints.nodal is not None:
            covered = np.asarray(constraints.nodal.covered)
            if ((covered > 0.0) & (covered < SMALL_INTEGRAL)).any():
                return True
        return super().may_alternate(constraints)

    def unilateral(self, config: Configuration) -> Constraints:
        """Intersect the facets on the deformed configuration and return one weighted gap per node."""
        means = self._means(config)
        # Tied pairs have separate equations for the directions in which both sides are held.
        no_slip = directions_without_slip(self, config) if self.has_tangents and self.options.kind != "tied" else []
        constraints, slip_data = self._weighted_gaps(config, means, no_slip)
        nodal = constraints.nodal
        if self.options.source is not None and self.multipliers == "dual" and isinstance(nodal, WeightedPressures):
            of_blocks = zip(self._test, means.coverage.overlap.mass, strict=True)
            tests = [(np.broadcast_to(T, mass.shape), T @ mass) for T, mass in of_blocks]
            B, gap0 = self._gaps(config, self._means_of(means.coverage._replace(functions=tests), means.normal))
            test_gaps = gap0 + B @ config.displacement.ravel()
            constraints = replace(constraints, nodal=replace(nodal, test_gaps=test_gaps))
        return replace(constraints, geometry=partial(self._linearised, config, means, no_slip, constraints, slip_data))

    def _weighted_gaps(
        self, config: Configuration, means: Means, no_slip: list[tuple[Array, Mask]]
    ) -> tuple[Constraints, SlipData | None]:
        """Return the constraints without their derivatives, and the data of their slips.

        `no_slip` are the `directions_without_slip`. The data are None without tangents.
        """
        coverage, _, _, weight, motion, _, normal = means
        B, gap0 = self._gaps(config, means)
        points, nodes = self.secondary.points, self.secondary.points.astype(np.intp)
        nodal_map, constants = coverage.nodal_map, self._constant_attributes
        pressures = WeightedPressures(weight, nodal_map, nodal_map.T @ constants[0], *constants[1:])
        constraints = Constraints(B, gap0, self.points[points], areas=weight, nodes=nodes, nodal=pressures)
        if not self.has_tangents:
            return constraints, None
        projectors = np.zeros((*normal.shape, normal.shape[1]))
        for axis, nodes_held in no_slip:
            projectors[nodes_held] += axis[nodes_held, :, None] * axis[nodes_held, None, :]
        axes = tangents(normal, projectors)
        mu, directions, slip_axes = self.options.friction_axes(self.friction, axes, self.node_candidates)
        slips, substitutions = self._slips(slip_axes, no_slip, means)
        length, closing_direction = self._closing_motion(constraints, normal, config)
        closing = length[:, None] * closing_direction
        # Motion that does not count as slip, with the sign of the secondary side relative to the primary one at rest: that of
        # the obstacle itself, or that which closes the gap, opposite to `closing_direction`.
        if isinstance(self.primary, RigidSide):
            non_slip = self.rigid_motion(motion.__matmul__, config)
        else:
            non_slip = -closing if self.slip == "symmetric" else np.zeros_like(closing)
        slip0 = -np.stack([np.einsum("nd,nd->n", t, non_slip) for t in slip_axes])
        for substitution, _ in substitutions:
            slip0 += np.stack([np.einsum("nd,nd->n", t, substitution.closing(closing)) for t in slip_axes])
        constraints = replace(constraints, tangents=slips, directions=directions, friction=mu, slip0=slip0)
        return constraints, SlipData(np.stack(slip_axes), length, substitutions)

    def _gaps(self, config: Configuration, means: Means) -> tuple[csr_array, Array]:
        """Return the rows B (m, n_dofs) [-] and the gaps (m,) at u = 0 [length] of weighted means."""
        coverage, D, M, weight, motion, gap_reduction, normal = means
        B = rows_of(motion, normal)
        gap0 = B @ self.points.ravel() - np.einsum("nd,nd->n", gap_reduction, normal)
        if (added := self._added_gap(config, D, M)) is not None:
            gap0 += self._normal_components(config, means) * added / weight
        dependent = coverage.nodal_map.diagonal() == 0.0
        if dependent.any():  # Gaps that supports prescribe must not contribute to the gaps of neighbouring nodes.
            prescribed = np.where(dependent, self.nodal_gap(config)[0], 0.0)
            gap0 -= csr_array(D[:, self.secondary.points]) @ prescribed / weight
        return B, gap0

    def _means(self, config: Configuration, earlier: Coverage | None = None) -> Means:
        """Return the weighted means in a configuration.

        The nodes with gaps are those of an `earlier` coverage if it is given; otherwise the overlap determines them.
        """
        overlap = self._overlap(config)
        weights = [mass.sum(axis=2) @ T.T for T, mass in zip(self._test, overlap.mass, strict=True)]
        if earlier is None:
            with_gap = self._nodes_with_gaps(weights, SMALL_INTEGRAL if config.rounded else SMALL_FRACTION)
            nodal_map = self._nodal_map(with_gap, nodes_with_prescribed_gap(self, config))
            coverage = self._coverage(overlap, weights, with_gap, nodal_map)
        else:
            coverage = self._coverage(overlap, weights, earlier.with_gap, earlier.nodal_map)
        return self._means_of(coverage, self._mean_normals(overlap, config))

    def _means_of(self, coverage: Coverage, normal: Array) -> Means:
        """Return the weighted means of a coverage, with the `normal` (m, dim) of each node [-]."""
        D, M, gap_reduction = self._weighted_integrals(coverage)
        # The gap of an excluded node is omitted, but the functions of its neighbours are not extended over its area.
        sums = np.where(self.excluded[self.secondary.points], 0.0, np.asarray(D.sum(axis=1)).ravel())
        weight = np.where(sums > 0.0, sums, np.inf)
        motion = scaled(csr_array(D - M), 1.0 / weight)
        return Means(coverage, D, M, weight, motion, gap_reduction / weight[:, None], normal)

    def _linearised(
        self, config: Configuration, means: Means, no_slip: list[tuple[Array, Mask]], constraints: Constraints,
        slip_data: SlipData | None, multiplier: Array, tangential: Array, displacement: Array,
    ) -> Linearised:  # fmt: skip
        """Return the linearisation of contact forces, mean gaps and slips; see `linearised_geometry`.

        `constraints` and `slip_data` are the results of `_weighted_gaps` for the other arguments.
        """
        if self._needs_differences(config, multiplier):

            def constraints_after(motion: Array) -> Constraints:
                moved = replace(config, displacement=config.displacement + motion)
                return self._weighted_gaps(moved, self._means(moved, means.coverage), no_slip)[0]

            sides = np.concatenate([self.secondary.points, self.primary.points])
            motions = displacement, displacement - config.start, displacement - config.displacement
            step = DIFFERENCE_STEP**1.5 * float(np.ptp(self.points[sides], axis=0).max())
            return FiniteDifferences(constraints, constraints_after, (multiplier, tangential), motions, sides, step)
        config = replace(config, displacement=displacement)
        coverages = [] if slip_data is None else [coverage for _, coverage in slip_data.substitutions]
        linearised, functions = self._linearised_points_of_overlap(config, means, multiplier, coverages)
        if slip_data is None:
            return linearised
        slips = self._load_step_slips(means.motion, slip_data.tangents, tangential, config)
        is_rigid = isinstance(self.primary, RigidSide)
        symmetric = self.slip == "symmetric" and not is_rigid
        if symmetric or coverages:
            opening = means.motion @ slips.start - means.gap_reduction
            side = config.deformed(self.secondary, self.points)
            secondary = None if is_rigid else (side.nodal_normals, side.variation)
            closing = ClosingMotion(means.normal, secondary, opening, slip_data.closing_length)
            slips = replace(slips, total=slips.total + symmetric * closing.vector, closing=closing, symmetric=symmetric)
            for (substitution, _), weights in zip(slip_data.substitutions, functions, strict=True):
                substitution = replace(substitution, functions=weights)
                total = slips.total + substitution.slip(closing.vector, linearised.points.motion @ slips.motion)
                slips = replace(slips, total=total, substitutions=(*slips.substitutions, substitution))
        return replace(linearised, slips=slips)

    def _needs_differences(self, config: Configuration, multiplier: Array) -> bool:
        """Return whether mean gaps are linearised by finite differences.

        This is the case between two bodies in 3D, and in 2D if an end of the primary side, or of one of its pieces, lies
        opposite the inside of facets that carry forces.
        """
        if isinstance(self.primary, RigidSide) or self.points.shape[1] == 3:
            return isinstance(self.primary, Surface)
        primary, tolerance = config.deformed(self.primary, self.points), self.projection_tolerance or 0.0
        ends = ((block.local, opposite_ends(block, primary, tolerance)[0]) for block in self.secondary.blocks)
        return any(multiplier[local[facets]].any() for local, facets in ends)

    def _linearised_points_of_overlap(
        self, config: Configuration, means: Means, multiplier: Array, substitutes: Sequence[Coverage]
    ) -> tuple[LinearisedPoints, list[csr_array]]:
        """Return the linearisation of contact forces and mean gaps at the integration points of the overlap.

        The second result contains the weights of the points in the coverages `substitutes` minus those in `means`. The
        segments are kept constant. The variation of a cut has no effect if the integrand is continuous across it, which is
        the case except at ends of the primary side.
        """
        deformed, (overlap, *_, nodal_map) = self.points + config.displacement, means.coverage
        is_loaded, coverages = nodal_map @ multiplier != 0.0, (means.coverage, *substitutes)
        functions, tests, n_points = [list[Blocks]() for _ in coverages], list[Blocks](), 0
        nodes, shapes, facets = [], [], []
        of_blocks = zip(self.secondary.blocks, self._test, overlap.points, strict=True)
        for number, (block, T, quadrature_points) in enumerate(of_blocks):
            selected = is_loaded[block.local].any(axis=1)[quadrature_points.facet]
            arrays = quadrature_points.facet, quadrature_points.shape, quadrature_points.area
            facet, shape, area = (array[selected] for array in arrays)
            columns = n_points + np.arange(len(facet))[:, None]
            local, weighted = block.local[facet], (area[:, None] * shape)[:, :, None]
            tests.append((local, columns, T @ weighted))
            for entries, coverage in zip(functions, coverages, strict=True):
                entries.append((local, columns, coverage.functions[number][0][facet] @ weighted))
            nodes.append(block.facets[facet])
            shapes.append(shape)
            facets.append(self.secondary.offsets[number] + facet)
            n_points += len(facet)
        candidates = Candidates(padded(nodes), padded(shapes), np.concatenate(facets))
        primary = self.primary if isinstance(self.primary, RigidSide) else config.deformed(self.primary, self.points)
        pairing = pair(candidates.positions(deformed), primary, LARGEST_OVERHANG, "facet", config.pose)
        rows, size = np.flatnonzero(pairing.paired), (len(multiplier), n_points)
        normals = "facet" if self.normals == "secondary" else self.normals
        points = self.linearised_points(candidates, pairing, rows, config, normals, closest=True)
        integrals = [csr_array(nodal_map.T @ assembled(blocks, size)[:, rows]) for blocks in functions]
        weights, *substitute_weights = (scaled(matrix, 1.0 / means.weight) for matrix in integrals)
        test_weights = csr_array(assembled(tests, size)[:, rows])
        separate_normals: DeformedSide | Points | None = None  # if nodal normals are not means of primary normals
        if isinstance(self.primary, RigidSide):
            all_nodes = np.arange(len(self.secondary.points))
            separate_normals = self.linearised_points(self.node_candidates, pairing, all_nodes, config, self.normals)
        elif self.normals == "secondary":
            separate_normals = config.deformed(self.secondary, self.points)
        linearised = points, weights, means.normal, multiplier, test_weights, separate_normals
        differences = [csr_array(substitute - weights) for substitute in substitute_weights]
        return LinearisedPoints(self.secondary, *linearised), differences

    @cached_property
    def _constant_attributes(self) -> tuple[Array, Array, list[Any], Mask]:
        """The attributes of `WeightedPressures` that are the same in all pairings.

        The first of them is `full_areas` for a multiplier field whose nodal values are all independent.
        """
        areas, quadratic = nodal_areas(self.secondary, self.points, self.axisymmetric), []
        full_areas, held = np.zeros_like(areas), np.zeros(len(areas), bool)
        for block, T, full in zip(self.secondary.blocks, self._test, self._full_weights, strict=True):
            np.add.at(full_areas, block.local, full)
            element = elements.get(block.element)
            if element.order == 2:
                quadratic.append((element.n_corners, T, block.local))
        if self.held_motions is not None and isinstance(self.primary, RigidSide):
            projectors = self.held_motions.projectors_at(self.secondary.points)
            held = np.trace(projectors, axis1=1, axis2=2) > self.points.shape[1] - 0.5
        return full_areas, areas, quadratic, held

    def _closing_motion(self, constraints: Constraints, normal: Array, config: Configuration) -> tuple[Array, Array]:
        """Return the lengths (m,) by which gaps close in the step [length], and the directions (m, dim) of this motion.

        This motion is not slip. As in `Formulation`, the directions are those of the means of the normals of both sides, or
        the normals of an obstacle.
        """
        direction = normal
        if not isinstance(self.primary, RigidSide):
            direction = unit_vectors(normal - config.deformed(self.secondary, self.points).nodal_normals)
        cosine = np.einsum("nd,nd->n", normal, direction)
        gap = np.where(constraints.usable & (cosine > 0.0), constraints.gaps(config.start), 0.0)
        return gap / np.where(cosine > 0.0, cosine, 1.0), direction

    def _slips(
        self, directions: Sequence[Array], no_slip: list[tuple[Array, Mask]], means: Means
    ) -> tuple[tuple[csr_array, ...], list[tuple[Substitution, Coverage]]]:
        """Return the rows (m, n_dofs) of the slips along tangents (m, dim), and the additional slips in held directions.

        Usually the rows are those of the mean relative motion. If both sides are held at a node in a direction, as in a
        plane of symmetry, the mean in this direction would contain only the motion of the other side near the plane. The
        functions of neighbouring nodes then replace that of the node. `no_slip` are the directions and nodes
        `directions_without_slip`. The coverage with these functions follows each `Substitution`.
        """
        coverage, D, _, weight, motion, *_ = means
        rows, substitutions = [rows_of(motion, direction) for direction in directions], []
        dim = self.points.shape[1]
        held_projectors = np.zeros((len(weight), dim, dim))
        for axis, nodes in no_slip:
            if not (nodes & coverage.with_gap).any():
                continue
            substitute = self._coverage(*coverage[:2], coverage.with_gap & ~nodes, coverage.nodal_map)
            D_substitute, M_substitute, _ = self._weighted_integrals(substitute)
            substituted = scaled(csr_array(D_substitute - M_substitute), 1.0 / weight)
            difference = without_zeros(csr_array(substituted - motion))
            for k, direction in enumerate(directions):
                cosine = np.einsum("md,md->m", direction, axis)
                rows[k] = csr_array(rows[k] + rows_of(difference, cosine[:, None] * axis))
            secondary = csr_array(scaled(csr_array(D_substitute - D), 1.0 / weight)[:, self.secondary.points])
            substitutions.append((Substitution(axis, nodes, secondary, difference), substitute))
            held_projectors[nodes] += np.einsum("md,me->mde", axis[nodes], axis[nodes])
        # Slip is computed only along tangents whose component normal to all held directions is at least FACING long.
        is_free = [1.0 - np.einsum("md,mde,me->m", t, held_projectors, t) >= FACING**2 for t in directions]
        rows = [scaled(matrix, np.where(can_slip, 1.0, 0.0)) for matrix, can_slip in zip(rows, is_free, strict=True)]
        return tuple(rows), substitutions

    def _weighted_integrals(self, coverage: Coverage) -> tuple[csr_array, csr_array, Array]:
        """Return the mortar matrices D and M (m, n_points) [area], and the weighted gap reductions (m, dim) [volume].

        The weighted gap reductions are the integrals of psi times the vectors of `Overlap.gap_reductions`.
        """
        overlap = coverage.overlap
        size = (len(self.secondary.points), len(self.points))
        D_blocks, M_blocks, functions = list[Blocks](), list[Blocks](), {}
        gap_reduction = np.zeros((size[0], self.points.shape[1]))
        of_blocks = zip(self.secondary.blocks, coverage.functions, overlap.gap_reductions, strict=True)
        for block, (psi, products), integrals in of_blocks:
            D_blocks.append((block.local, block.facets, products))
            functions[block.element] = psi
            np.add.at(gap_reduction, block.local, psi @ integrals)
        for coupling in overlap.couplings:
            secondary_facet, primary_facet = coupling.pairs.T
            values = functions[coupling.secondary.element][secondary_facet] @ coupling.integrals
            M_blocks.append((coupling.secondary.local[secondary_facet], coupling.primary.facets[primary_facet], values))
        D, M = assembled(D_blocks, size), assembled(M_blocks, size)
        if coverage.nodal_map.diagonal().all():
            return D, M, gap_reduction
        to_independent = csr_array(coverage.nodal_map.T)
        return to_independent @ D, to_independent @ M, to_independent @ gap_reduction

    def _coverage(self, overlap: Overlap, weights: list[Array], with_gap: Mask, nodal_map: csr_array) -> Coverage:
        """Return the coverage with the functions psi of the nodes `with_gap` (m,) and the `nodal_map` of the multipliers."""
        functions, of_blocks = [], zip(self._test, overlap.mass, weights, self._full_weights, strict=True)
        for block, (T, mass, covered, full) in zip(self.secondary.blocks, of_blocks, strict=True):
            with_psi = with_gap[block.local]
            if self.multipliers == "standard":
                psi = np.where(with_psi[:, :, None], T, 0.0)
                functions.append((psi, psi @ mass))
            else:  # dual functions depend on the covered fractions of the weights
                fraction = np.divide(covered, full, out=np.zeros_like(covered), where=full > 0.0)
                psi, D = dual_functions(T @ mass @ T.T, with_psi, fraction)
                functions.append((psi @ T, D @ np.linalg.inv(T).T))
        return Coverage(overlap, weights, with_gap, functions, nodal_map)

    def _nodal_map(self, with_gap: Mask, held: Mask) -> csr_array:
        """Return the map (m, m) from independent to nodal values of the multiplier field.

        The values at nodes outside `held` (m,) are independent. The value at a held node is the mean of those at the nodes of
        its facets that are in `with_gap` (m,) and not held; facets are weighted with the integrals of its test function. If
        there are no such nodes, it is independent.
        """
        entries = []
        for block, full in zip(self.secondary.blocks, self._full_weights, strict=True) if held.any() else ():
            independent = (with_gap & ~held)[block.local] & (full > 0.0)
            means = independent / np.maximum(independent.sum(axis=1), 1)[:, None]
            held_areas = np.where(held[block.local], full, 0.0)
            entries.append((block.local, block.local, held_areas[:, :, None] * means[:, None, :]))
        sums = assembled(entries, (len(held), len(held)))
        total = np.asarray(sums.sum(axis=1)).ravel()
        sums = scaled(sums, 1.0 / np.where(total > 0.0, total, 1.0))
        return csr_array(diags_array(np.where(total > 0.0, 0.0, 1.0)) + sums)

    def _nodes_with_gaps(self, weights: list[Array], smallest_fraction: float) -> Mask:
        """Return which nodes (m,) have gaps, given the `Coverage.weights` of all test functions.

        With dual functions, a node has a gap if its weight is more than `smallest_fraction` of that over complete facets.
        """
        m = len(self.secondary.points)
        total, full_total, additional = np.zeros(m), np.zeros(m), np.zeros(m, bool)
        for block, covered, full in zip(self.secondary.blocks, weights, self._full_weights, strict=True):
            np.add.at(total, block.local, covered)
            np.add.at(full_total, block.local, full)
        sufficient = total > (smallest_fraction if self.multipliers == "dual" else NEGLIGIBLE_AREA) * full_total
        for block, covered, full in zip(self.secondary.blocks, weights, self._full_weights, strict=True):
            # If no node of a facet has a sufficient weight, the node with the largest weight has a gap, so that no overlap
            # is omitted.
            is_covered = covered.sum(axis=1) > NEGLIGIBLE_AREA * full.sum(axis=1)
            without_gap = ~sufficient[block.local].any(axis=1) & is_covered
            largest = np.argmax(total[block.local[without_gap]], axis=1)
            additional[block.local[without_gap][np.arange(len(largest)), largest]] = True
        return (sufficient | additional) & (full_total > 0.0)

    def _mean_normals(self, overlap: Overlap, config: Configuration) -> Array:
        """Return unit means (m, dim) of the opposite primary normals; at unpaired nodes, the mean over all nodes.

        Against an obstacle they are its normals at the projections of the nodes, so that normals at nodes in a plane of
        symmetry lie in this plane.
        """
        if isinstance(self.primary, RigidSide):
            positions = (self.points + config.displacement)[self.secondary.points]
            _, normal, paired, _ = self.primary.project(positions, config.pose)
            return np.where(paired[:, None], normal, -config.deformed(self.secondary, self.points).nodal_normals)
        if self.normals == "secondary":
            return -config.deformed(self.secondary, self.points).nodal_normals
        if not isinstance(self.normals, str):
            return np.tile(np.array(self.normals), (len(self.secondary.points), 1))
        of_blocks = zip(self.secondary.blocks, self._test, strict=True)
        tests = [np.broadcast_to(T, (len(block.facets), *T.shape)) for block, T in of_blocks]
        mean = self._primary_normals(config, overlap, tests)
        self.secondary.add_across_ends(mean)
        length, overall = np.linalg.norm(mean, axis=1, keepdims=True), mean.sum(axis=0)
        if np.linalg.norm(overall) <= LENGTH_ROUND_OFF * length.sum():
            overall = np.eye(len(overall))[-1]
        return unit_vectors(np.where(length > 0.0, mean, overall))

    def _primary_normals(
        self, config: Configuration, overlap: Overlap, functions: Sequence[Array], projected: bool = False
    ) -> Array:
        """Return the integrals (m, dim) of functions times the opposite primary normals [area].

        `functions` are arrays (n_facets, k, k) of coefficients in terms of the shape functions, one for each block. With
        `projected`, normals are replaced by the vectors along which facets are projected, with a component of 1 along the
        normals.
        """
        assert isinstance(self.primary, Surface)
        integrals = np.zeros((len(self.secondary.points), self.points.shape[1]))
        primary = config.deformed(self.primary, self.points)
        normals = primary.facet_normals if self.normals == "facet" else primary.smooth_normals
        of_blocks = np.split(normals, self.primary.offsets[1:-1])
        normals_of = dict(zip((block.element for block in self.primary.blocks), of_blocks, strict=True))
        functions_of = dict(zip((block.element for block in self.secondary.blocks), functions, strict=True))
        for coupling in overlap.couplings:
            secondary_facet, primary_facet = coupling.pairs.T
            at_nodes = normals_of[coupling.primary.element][primary_facet, : coupling.primary.facets.shape[1]]
            if projected and coupling.projection is not None:
                direction = coupling.projection[secondary_facet]
                cosines = np.einsum("pd,pnd->pn", direction, at_nodes)
                at_nodes = (2.0 - cosines)[:, :, None] * direction[:, None]  # 1 / cosine, up to its second order
            values = functions_of[coupling.secondary.element][secondary_facet] @ (coupling.integrals @ at_nodes)
            np.add.at(integrals, coupling.secondary.local[secondary_facet], values)
        return integrals

    def _normal_components(self, config: Configuration, means: Means) -> Array:
        """Return the weighted means (m,) of the components along the normal of a node of unit distances to the primary side.

        Clearance and wear are distances along the normals of the primary side. In 2D and to an obstacle, gaps are projected
        along these normals, so that the component is the cosine of the angle to the normal of the node. In 3D, each secondary
        facet is projected along its own normal. The vector from one side to the other has this direction, and it is longer
        than the distance by the inverse cosine of the angle to the normal of the primary side. Without these factors, nodal
        pressures of a press fit deviate by up to several percent, see
        `test_pressures_of_clearances_are_those_of_overlapping_meshes`.
        """
        if isinstance(self.primary, RigidSide):
            integrals = means.D[:, self.secondary.points] @ means.normal
        elif not isinstance(self.normals, str) or self.normals == "secondary":
            return np.ones(len(means.weight))
        else:
            functions = [psi for psi, _ in means.coverage.functions]
            integrals = self._primary_normals(config, means.coverage.overlap, functions, projected=True)
            integrals = means.coverage.nodal_map.T @ integrals
        return np.einsum("nd,nd->n", integrals, means.normal) / means.weight

    def _added_gap(self, config: Configuration, D: csr_array, M: csr_array) -> Array | None:
        """Return the integrals (m,) of psi times clearances and wear depth [volume]; None without clearance and wear."""
        contributions, factor = [], config.clearance_factor
        for matrix, side, clearance in (
            (D, self.secondary, self.options.clearance), (M, self.primary, self.options.clearance_primary)
        ):  # fmt: skip
            if clearance is not None:
                contributions.append(matrix[:, side.points] @ (factor * clearance(self.points[side.points])))
        if config.wear_depth is not None:
            contributions.append(D @ config.wear_depth)
        return sum(contributions[1:], contributions[0]) if contributions else None


@record
class WeightedPressures(NodalField):
    """Pressures of weighted gaps at the nodes; see `constraints.NodalField`.

    Attributes
    ----------
    weight : ndarray (m,)
        Area of each gap, infinite where there is no gap [area].
    nodal_map : csr_array (m, m)
        Map from independent to nodal values of the multiplier field [-].
    full_areas : ndarray (m,)
        Integrals of the test functions of the independent values over the complete secondary side [area].
    nodal_areas : ndarray (m,)
        Integrals of the shape functions over the complete secondary side [area].
    quadratic : list of (int, ndarray (n_nodes, n_nodes), ndarray of int (n_facets, n_nodes))
        For each block of quadratic facets, the number of corners, the coefficients of the test functions in terms of the
        shape functions [-], and the nodes of the facets, numbered on the side.
    held : ndarray of bool (m,)
        Nodes that are prescribed in all directions. Their forces act between supports, independently of their neighbours.
    test_gaps : ndarray (m,), optional
        Gaps weighted with the test functions, for dual multipliers and contacts that a fluid may enter [length].
    """

    weight: Array
    nodal_map: csr_array
    full_areas: Array
    nodal_areas: Array
    quadratic: list[tuple[int, Array, NDArray[np.signedinteger]]]
    held: Mask
    test_gaps: Array | None = None

    def weighted_gaps(self, gaps: Array) -> tuple[Array, Indices]:
        """Return nodal gaps, see `NodalField`; negative ones are replaced by `test_gaps` if these are larger.

        Dual functions are negative in a part of the facets. Where the gap varies strongly, as opposite the rim of a sphere, a
        gap that is open everywhere may have a negative mean, but not with test functions, which are positive.
        """
        if self.test_gaps is not None:
            gaps = np.where(gaps < 0.0, np.maximum(gaps, self.test_gaps), gaps)
        return super().weighted_gaps(gaps)

    def pressure(self, force: Array) -> Array:
        """Return forces divided by areas; at mid-side nodes without a gap, means of the pressures at the corners."""
        return self.at_nodes(force / self.weight, keep_with_gap=True)

    @property
    def covered(self) -> Array:
        """Covered fraction of the nodal areas; at mid-side nodes without a gap, the mean of the corners."""
        has_area = np.isfinite(self.weight) & (self.full_areas > 0.0)
        fraction = np.divide(self.weight, self.full_areas, out=np.zeros_like(self.weight), where=has_area)
        return self.at_nodes(fraction, keep_with_gap=True)

    def side_pressure(self, force: Array) -> Array:
        """Return the forces divided by the complete areas of the test functions; see `at_nodes`.

        The covered part of the area of a node may be arbitrarily small, and the force vanishes with it. The ratio of the
        force and the covered area is sensitive to round-off, unlike the force divided by the complete area.
        """
        return self.at_nodes(np.divide(force, self.full_areas, out=np.zeros_like(force), where=self.full_areas > 0.0))

    def at_nodes(self, coefficients: Array, keep_with_gap: bool = False) -> Array:
        """Return the nodal values (m,) of a field with `coefficients` (m,) of the test functions.

        They are the coefficients themselves, except at mid-side nodes of quadratic facets, where the functions of the corners
        do not vanish. With `keep_with_gap`, mid-side nodes that have gaps keep their coefficients, too.
        """
        coefficients = self.nodal_map @ coefficients
        values = coefficients.copy()
        for corners, T, local in self.quadratic:
            with_gaps = T[corners:].any()
            if keep_with_gap and with_gaps:
                continue
            middles, T_middles = local[:, corners:], T[:, corners:]
            values[middles] = coefficients[local] @ T_middles
            if with_gaps and self.held.any():
                held = self.held[local]
                values[middles] += (held @ T_middles) * coefficients[middles] - (held * coefficients[local]) @ T_middles
        return values

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the active nodes, and mid-side nodes without a multiplier that have a pressure."""
        return active | (pressure > 0)
