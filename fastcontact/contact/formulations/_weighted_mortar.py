r"""Mortar contact with one weighted gap per node: :math:`\int \psi_j\, (x_s - x_p) \cdot n_j \ge 0`.

The integrals run over the mortar segments of the two sides (Puso, 2004; Popp, Gitterle, Gee and Wall, 2010). A gap is divided
by the weight of its :math:`\psi_j`, so that it is a length and its multiplier is the nodal force; the normal is the mean of
the normals of the primary side around the node.

``"dual"`` functions are biorthogonal to the displacement of the secondary side, see `_dual_basis`: a gap involves one
node of that side, and for a mid node also the ends of its edge. Constraints can therefore be eliminated one by one, the
corners first, and the matrix stays sparse and positive definite. ``"standard"`` functions are linear between the corners,
also on quadratic facets; only corners have gaps.

Against a rigid obstacle the integrals use Gauss points of whole facets, and :math:`x_p` is the point of the obstacle closest
to each.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, diags_array

from fastcontact.arrays import Array, Mask
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, Linearised, NodalField
from fastcontact.contact.formulations._cut_faces import face_overlap
from fastcontact.contact.formulations._cut_lines import facets_at_ends, line_overlap
from fastcontact.contact.formulations._dual_basis import COVERED, LEAST, dual_functions, positive
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.formulations._overlap import Overlap, obstacle_overlap
from fastcontact.contact.integration import NO_AREA, areas_of_rule, nodal_areas
from fastcontact.contact.linearised_geometry import Closing, Differences, LinearisedPoints, NodalNormals, Points, faced
from fastcontact.contact.obstacles.rigid_side import Pose, RigidSide
from fastcontact.contact.pairing import FACING, Candidates, Normals, filled_up, pair, tangents
from fastcontact.contact.projection import facet_normals, nodal_normals, smooth_normals
from fastcontact.contact.search.limits import BEYOND
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError, unknown
from fastcontact.linear.sparse_rows import Blocks, assembled, rows_of, scaled
from fastcontact.mesh import elements
from fastcontact.round_off import DIFFERENCES, LENGTH_ROUND_OFF, SINGLE_PRECISION, TINY

MULTIPLIERS = ("standard", "dual")


class Coverage(NamedTuple):
    """The overlap of both sides, and the integrals of the test functions over it.

    Attributes
    ----------
    overlap : Overlap
    weights : list of ndarray (n_facets, k)
        Integrals over the overlap of the k test functions of the facets of each block [area].
    kept : ndarray of bool (m,)
        Whether a secondary node has a gap.
    functions : list of (ndarray (n_facets, k, k), ndarray (n_facets, k, k))
        For each block, the coefficients of psi in its shape functions [-], and the integrals of psi with these [area].
    values : csr_array (m, m)
        Map from independent to nodal values of the multiplier field [-].
    """

    overlap: Overlap
    weights: list[Array]
    kept: Mask
    functions: list[tuple[Array, Array]]
    values: csr_array


class Means(NamedTuple):
    """Mean relative motions of the nodes.

    Attributes
    ----------
    coverage : Coverage
    rows, across : csr_array (m, n_points)
        Integrals of psi with secondary and with primary shape functions [area].
    weight : ndarray (m,)
        Integrals of psi; infinite for nodes without gaps [area].
    motion : csr_array (m, n_points)
        Map from displacements to mean displacements relative to the primary side [-].
    closer : ndarray (m, dim)
        Mean vectors by which smooth surfaces are closer than facets [length].
    normal : ndarray (m, dim)
        Unit normals [-].
    """

    coverage: Coverage
    rows: csr_array
    across: csr_array
    weight: Array
    motion: csr_array
    closer: Array
    normal: Array


@dataclass(eq=False)
class WeightedMortar(Formulation):
    """Mortar contact with weighted gaps at nodes. The parameters of `Formulation` apply as well.

    Parameters
    ----------
    normals : str or sequence of float
        Normals whose mean is the normal of a node: ``"facet"`` for those of the opposite primary facets, or ``"averaged"``
        for interpolated nodal averages. ``"secondary"`` and vectors are those of `Formulation`.
    multipliers : str
        ``"dual"``, or in 3D ``"standard"``.
    """

    projection_tolerance: float = SINGLE_PRECISION
    normals: Normals | None = "averaged"
    surface_smoothing: bool = True
    multipliers: str = "standard"

    name: ClassVar[str] = "mortar"
    weighs_gaps: ClassVar[bool] = True
    _whole: list[Array] = field(init=False, repr=False)
    _test: list[Array] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if str(self.multipliers) not in MULTIPLIERS:
            raise ContactError(unknown("kind of multipliers", self.multipliers, MULTIPLIERS))
        self._test, self._whole = [], []
        for block in self.secondary.blocks:
            if self.multipliers == "dual":
                T = positive(block.element)
            else:  # shape functions of the corners, and zero at mid-side nodes
                element = elements.get(block.element)
                linear = elements.get(element.linear).shape(element.nodes).T
                T = np.vstack([linear, np.zeros((element.n_nodes - element.n_corners, element.n_nodes))])
            self._test.append(T)
            N, dA = areas_of_rule(block, self.points, self.axisymmetric)
            self._whole.append(dA @ N @ T.T)

    @property
    def eliminable(self) -> bool:
        """See `Formulation`; standard multipliers couple the corners of quadratic facets through their mid nodes."""
        return self.multipliers == "dual" or self.secondary.order == 1

    def _overlap(self, deformed: Array, pose: Pose) -> Overlap:
        if isinstance(self.primary, RigidSide):
            return obstacle_overlap(self.secondary, self.primary, (self.points, deformed), self.axisymmetric, pose)
        if deformed.shape[1] == 3:
            return face_overlap(self.secondary, self.primary, self.points, deformed, self.smoothing)
        options = self.axisymmetric, self.projection_tolerance, self.smoothing
        return line_overlap(self.secondary, self.primary, self.points, deformed, *options)

    def alternates(self, constraints: Constraints) -> bool:
        """See `Formulation`; a node with dual functions and a small overlap may have a gap in every other pairing."""
        covered = np.zeros(1) if constraints.nodal is None else np.asarray(constraints.nodal.covered)
        small = (
            self.multipliers == "dual" and not self.options.tied and bool(((covered > 0.0) & (covered < LEAST)).any())
        )
        return small or super().alternates(constraints)

    def unilateral(self, at: Configuration) -> Constraints:
        """Intersect the facets on the deformed configuration and return one weighted gap per node."""
        means = self._means(self.points + at.displacement, at)
        # Ties have separate equations in the directions in which both sides are held.
        held = self.without_slip(at) if self.slides and not self.options.tied else []
        constraints, slipping = self._weighted_gaps(at, means, held)
        return replace(constraints, geometry=partial(self._linearised, at, means, held, constraints, slipping))

    def _weighted_gaps(
        self, at: Configuration, means: Means, held: list[tuple[Array, Mask]]
    ) -> tuple[Constraints, tuple[Array, Array] | None]:
        """Return the constraints without their derivatives, the tangents (k, m, dim), and the lengths (m,) of closing gaps.

        `held` are the directions `without_slip`. The second result is None without tangents.
        """
        coverage, rows, across, weight, mean, closer, normal = means
        B = rows_of(mean, normal)
        gap0 = B @ self.points.ravel() + at.clearance_factor * self._clearance(rows, across, weight)
        gap0 -= np.einsum("nd,nd->n", closer, normal)
        dependent = coverage.values.diagonal() == 0.0
        if dependent.any():  # Gaps that supports prescribe neither open nor close those of neighbouring nodes.
            prescribed = np.where(dependent, self.nodal_gap(at)[0], 0.0)
            gap0 -= csr_array(rows[:, self.secondary.points]) @ prescribed / weight
        if at.worn is not None:
            gap0 += rows @ at.worn / weight
        points, nodes = self.secondary.points, self.secondary.points.astype(np.intp)
        of_side = self._whole_side
        constraints = Constraints(
            B,
            gap0,
            self.points[points],
            areas=weight,
            nodes=nodes,
            nodal=WeightedPressures(weight, coverage.values, coverage.values.T @ of_side[0], *of_side[1:]),
        )
        if not self.slides:
            return constraints, None
        candidates = Candidates(points[:, None], np.ones((len(constraints), 1)))
        projectors = np.zeros((*normal.shape, normal.shape[1]))
        for along, nodes_held in held:
            projectors[nodes_held] += along[nodes_held, :, None] * along[nodes_held, None, :]
        friction, directions, rubbing = self.options.rubbing(self.friction, tangents(normal, projectors), candidates)
        slips, additional = self._slips(rubbing, held, coverage, mean, rows, weight)
        length, closing_direction = self._closing(constraints, normal, at)
        closing = length[:, None] * closing_direction
        # Slip is also due to the motion of a rigid obstacle, and is corrected for motions that close gaps.
        if not isinstance(self.primary, RigidSide):
            moved = -closing if self.slip == "symmetric" else np.zeros_like(closing)
        else:
            current, before = (mean @ (self.points + u) for u in (at.displacement, at.start))
            moved = self.primary.carried(current, before, at.pose, at.pose_start)
        slip0 = -np.stack([np.einsum("nd,nd->n", t, moved) for t in rubbing])
        for along, is_held, motion in additional:
            remaining = closing - np.where(is_held, np.einsum("md,md->m", closing, along), 0.0)[:, None] * along
            apparent_slip = np.einsum("md,md->m", motion @ remaining, along)
            slip0 += np.stack([np.einsum("md,md->m", t, along) * apparent_slip for t in rubbing])
        constraints = replace(constraints, tangents=slips, directions=directions, friction=friction, slip0=slip0)
        return constraints, (np.stack(rubbing), length)

    def _means(self, deformed: Array, at: Configuration, like: Coverage | None = None) -> Means:
        """Return the mean relative motions of nodes at the coordinates `deformed` (n_points, dim) [length].

        Nodes with gaps are those of the coverage `like`; by default, they result from the overlap.
        """
        overlap = self._overlap(deformed, at.pose)
        weights = [mass.sum(axis=2) @ T.T for T, mass in zip(self._test, overlap.mass, strict=True)]
        if like is None:
            kept = self._nodes_with_gaps(weights, LEAST if at.rounded else COVERED)
            coverage = self._coverage(overlap, weights, kept, self._values(kept, self.held_across(at)))
        else:
            coverage = self._coverage(overlap, weights, like.kept, like.values)
        rows, across, closer = self._weighted(coverage)
        # Only the gap of an excluded node is omitted. The functions of its neighbours are not extended over its area.
        sums = np.where(self.options.excluded_nodes(self.secondary), 0.0, np.asarray(rows.sum(axis=1)).ravel())
        weight = np.where(sums > 0.0, sums, np.inf)
        mean = scaled(csr_array(rows - across), 1.0 / weight)
        normal = self._mean_normals(overlap, deformed, at.pose)
        return Means(coverage, rows, across, weight, mean, closer / weight[:, None], normal)

    def _linearised(
        self, at: Configuration, means: Means, held: list[tuple[Array, Mask]], constraints: Constraints,
        slipping: tuple[Array, Array] | None, multiplier: Array, tangential: Array, displacement: Array,
    ) -> Linearised:  # fmt: skip
        """Return the linearisation of contact forces, mean gaps and slips; see `linearised_geometry`.

        `constraints` and `slipping` are the results of `_weighted_gaps` for the other arguments.
        """
        if isinstance(self.primary, Surface) and (self.points.shape[1] == 3 or self._ends_within(at, multiplier)):

            def moved(motion: Array) -> Constraints:
                here = replace(at, displacement=at.displacement + motion)
                return self._weighted_gaps(
                    here, self._means(self.points + here.displacement, at, means.coverage), held
                )[0]

            sides = np.concatenate([self.secondary.points, self.primary.points])
            motions = displacement, displacement - at.start, displacement - at.displacement
            step = DIFFERENCES**1.5 * float(np.ptp(self.points[sides], axis=0).max())
            return Differences(constraints, moved, (multiplier, tangential), motions, sides, step)
        at, deformed = replace(at, displacement=displacement), self.points + displacement
        linearised = self._at_points(at, means, multiplier)
        if slipping is None:
            return linearised
        directions, length = slipping
        slips = self._sliding(means.motion, directions, tangential, at)
        if not isinstance(self.primary, RigidSide) and self.slip == "symmetric":
            opening = means.motion @ slips.start - means.closer
            closing = Closing.of(means.normal, NodalNormals(self.secondary, deformed), opening, length)
            slips = replace(slips, total=slips.total + closing.vector, closing=closing)
        return replace(linearised, slips=slips)

    def _ends_within(self, at: Configuration, multiplier: Array) -> bool:
        """Return whether the primary side, or that of one of its bodies, ends within facets that carry forces."""
        assert isinstance(self.primary, Surface)
        deformed, tolerance = self.points + at.displacement, self.projection_tolerance or 0.0
        ends = ((b.local, facets_at_ends(b, self.primary, deformed, tolerance)) for b in self.secondary.blocks)
        return any(multiplier[local[facets]].any() for local, facets in ends)

    def _at_points(self, at: Configuration, means: Means, multiplier: Array) -> LinearisedPoints:
        """Return the linearisation of contact forces and mean gaps by the projections of the integration points.

        Segments are constant, because the variation of the cuts has no effect if the integrand is continuous across them, as
        it is except at ends of the primary side.
        """
        deformed, overlap, values = self.points + at.displacement, means.coverage.overlap, means.coverage.values
        is_loaded = values @ multiplier != 0.0
        functions, tests, first, first_facet = list[Blocks](), list[Blocks](), 0, 0
        nodes, shapes, facets = [], [], []
        of_blocks = zip(self.secondary.blocks, self._test, means.coverage.functions, overlap.points, strict=True)
        for block, T, (psi, _), inside in of_blocks:
            kept = is_loaded[block.local].any(axis=1)[inside.facet]
            facet, shape, area = (values[kept] for values in inside)
            columns = first + np.arange(len(facet))[:, None]
            local, psi_at = block.local[facet], np.einsum("qak,qk,q->qa", psi[facet], shape, area)
            functions.append((local, columns, psi_at[:, :, None]))
            tests.append((local, columns, (area[:, None] * (shape @ T.T))[:, :, None]))
            nodes.append(block.facets[facet])
            shapes.append(shape)
            facets.append(first_facet + facet)
            first, first_facet = first + len(facet), first_facet + len(block.facets)
        candidates = Candidates(filled_up(nodes), filled_up(shapes), np.concatenate(facets))
        pairing = pair(candidates.positions(deformed), self.primary, deformed, BEYOND, "facet", at.pose)
        rows, size = np.flatnonzero(pairing.paired), (len(multiplier), first)
        along = "facet" if self.normals == "secondary" else self.normals
        rise = self.rise(candidates, pairing, rows, deformed)
        points = faced(candidates, pairing, rows, self.primary, deformed, along, at.pose, True, rise)
        weighted = scaled(csr_array(values.T @ assembled(functions, size)[:, rows]), 1.0 / means.weight)
        mean = csr_array(assembled(tests, size)[:, rows])
        separate_normals: NodalNormals | Points | None = None  # if nodal normals are not means of primary normals
        if isinstance(self.primary, RigidSide):
            column = self.secondary.points[:, None]
            at_nodes, all_nodes = Candidates(column, np.ones(column.shape)), np.arange(len(column))
            separate_normals = faced(at_nodes, pairing, all_nodes, self.primary, deformed, self.normals, at.pose)
        elif self.normals == "secondary":
            separate_normals = NodalNormals(self.secondary, deformed)
        return LinearisedPoints(self.secondary, points, weighted, means.normal, multiplier, mean, separate_normals)

    @cached_property
    def _whole_side(self) -> tuple[Array, Array, list[Any], Mask]:
        """The attributes of `WeightedPressures` that are the same in all pairings."""
        full_area, quadratic = nodal_areas(self.secondary, self.points, self.axisymmetric), []
        tested, held = np.zeros_like(full_area), np.zeros(len(full_area), bool)
        for block, T, full in zip(self.secondary.blocks, self._test, self._whole, strict=True):
            np.add.at(tested, block.local, full)
            element = elements.get(block.element)
            if element.order == 2:
                quadratic.append((element.n_corners, T, block.local))
        if self.held is not None and isinstance(self.primary, RigidSide):
            projectors = self.held.at(self.secondary.points)
            held = np.trace(projectors, axis1=1, axis2=2) > self.points.shape[1] - 0.5
        return tested, full_area, quadratic, held

    def _closing(self, constraints: Constraints, normal: Array, at: Configuration) -> tuple[Array, Array]:
        """Return the lengths (m,) by which gaps close in the step [length], and the directions (m, dim) of this motion.

        This motion is not slip. As in `Formulation`, the directions are those of the means of the normals of both sides, or
        the normals of an obstacle.
        """
        direction = normal
        if not isinstance(self.primary, RigidSide):
            direction = normal - nodal_normals(self.secondary, self.points + at.displacement)
            direction /= np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), TINY)  # zero at unpaired nodes
        lean = np.einsum("nd,nd->n", normal, direction)
        gap = np.where(constraints.usable & (lean > 0.0), constraints.gaps(at.start), 0.0)
        return gap / np.where(lean > 0.0, lean, 1.0), direction

    def _slips(
        self, directions: Sequence[Array], without_slip: list[tuple[Array, Mask]], coverage: Coverage, mean: csr_array,
        base: csr_array, weight: Array,
    ) -> tuple[tuple[csr_array, ...], list[tuple[Array, Mask, csr_array]]]:  # fmt: skip
        """Return rows (m, n_dofs) of the slips along tangents (m, dim).

        Usually these are the rows of the `mean` relative motion. In a direction in which both sides are held at a node, as
        in a plane of symmetry, the mean would contain only the motion of the other side near the plane. The functions of
        neighbouring nodes then replace that of the node (`Formulation.without_slip`). For each such direction (m, dim) the
        matrix (m, m) of the additional motion of secondary nodes in these functions is also returned, because on curved
        sides these nodes close their gaps along other normals.
        """
        rows, additional = [rows_of(mean, direction) for direction in directions], []
        held = np.zeros((len(weight), *2 * self.points.shape[1:]))
        for along, nodes in without_slip:
            if not (nodes & coverage.kept).any():
                continue
            replaced, across, _ = self._weighted(self._coverage(*coverage[:2], coverage.kept & ~nodes, coverage.values))
            difference = csr_array(scaled(csr_array(replaced - across), 1.0 / weight) - mean)
            difference.eliminate_zeros()
            for k, direction in enumerate(directions):
                slip = np.einsum("md,md->m", direction, along)
                rows[k] = csr_array(rows[k] + rows_of(difference, slip[:, None] * along))
            additional.append(
                (along, nodes, csr_array(scaled(csr_array(replaced - base), 1.0 / weight)[:, self.secondary.points]))
            )
            held[nodes] += np.einsum("md,me->mde", along[nodes], along[nodes])
        # Slip is computed along tangents whose component that supports do not hold is longer than FACING.
        free = [1.0 - np.einsum("md,mde,me->m", t, held, t) >= FACING**2 for t in directions]
        return tuple(scaled(row, np.where(slips, 1.0, 0.0)) for row, slips in zip(rows, free, strict=True)), additional

    def _weighted(self, coverage: Coverage) -> tuple[csr_array, csr_array, Array]:
        """Return the integrals of psi with secondary and with primary shape functions, both (m, n_points) [area].

        The third result contains the integrals (m, dim) of psi with the vectors by which smooth surfaces are closer than
        facets [volume].
        """
        overlap = coverage.overlap
        size = (len(self.secondary.points), len(self.points))
        rows, across, functions = list[Blocks](), list[Blocks](), {}
        closer = np.zeros((size[0], self.points.shape[1]))
        of_blocks = zip(self.secondary.blocks, coverage.functions, overlap.closer, strict=True)
        for block, (psi, products), depth in of_blocks:
            rows.append((block.local, block.facets, products))
            functions[block.element] = psi
            np.add.at(closer, block.local, psi @ depth)
        for coupling in overlap.couplings:
            secondary_facet, primary_facet = coupling.pairs.T
            values = functions[coupling.secondary.element][secondary_facet] @ coupling.integrals
            across.append((coupling.secondary.local[secondary_facet], coupling.primary.facets[primary_facet], values))
        if (values := coverage.values).diagonal().all():
            return assembled(rows, size), assembled(across, size), closer
        on_independent = csr_array(values.T)
        return on_independent @ assembled(rows, size), on_independent @ assembled(across, size), on_independent @ closer

    def _coverage(self, overlap: Overlap, weights: list[Array], kept: Mask, values: csr_array) -> Coverage:
        """Return the coverage with the functions psi of the nodes `kept` (m,), and a multiplier field with `values`."""
        functions, of_blocks = [], zip(self._test, overlap.mass, weights, self._whole, strict=True)
        for block, (T, mass, covered, full) in zip(self.secondary.blocks, of_blocks, strict=True):
            of_facets = kept[block.local]
            if self.multipliers == "standard":
                psi = np.where(of_facets[:, :, None], T, 0.0)
                functions.append((psi, psi @ mass))
            else:  # depending on the fractions of the weights that face the other side
                fraction = np.divide(covered, full, out=np.zeros_like(covered), where=full > 0.0)
                psi, D = dual_functions(T @ mass @ T.T, of_facets, fraction)
                functions.append((psi @ T, D @ np.linalg.inv(T).T))
        return Coverage(overlap, weights, kept, functions, values)

    def _values(self, kept: Mask, held: Mask) -> csr_array:
        """Return the map (m, m) from independent to nodal values of the multiplier field.

        The value at a node in `held` (m,) is the mean over those nodes in `kept` (m,) of its facets that are not held. If
        there are none, it is independent.
        """
        entries = []
        for block, full in zip(self.secondary.blocks, self._whole, strict=True) if held.any() else ():
            giver = (kept & ~held)[block.local] & (full > 0.0)
            means = giver / np.maximum(giver.sum(axis=1), 1)[:, None]
            of_held = np.where(held[block.local], full, 0.0)
            entries.append((block.local, block.local, of_held[:, :, None] * means[:, None, :]))
        sums = assembled(entries, (len(held), len(held)))
        total = np.asarray(sums.sum(axis=1)).ravel()
        sums = scaled(sums, 1.0 / np.where(total > 0.0, total, 1.0))
        return csr_array(diags_array(np.where(total > 0.0, 0.0, 1.0)) + sums)

    def _nodes_with_gaps(self, covered: list[Array], least: float) -> Mask:
        """Return which nodes (m,) have gaps, given the weights (n_facets, k) of all functions.

        Dual functions have gaps where a larger fraction than `least` of their weights faces the other side.
        """
        m = len(self.secondary.points)
        total, full_total, added = np.zeros(m), np.zeros(m), np.zeros(m, bool)
        for block, weights, full in zip(self.secondary.blocks, covered, self._whole, strict=True):
            np.add.at(total, block.local, weights)
            np.add.at(full_total, block.local, full)
        sufficient = total > (least if self.multipliers == "dual" else NO_AREA) * full_total
        for block, weights, full in zip(self.secondary.blocks, covered, self._whole, strict=True):
            # If no node of a facet has sufficient weight, that with the largest weight has a gap, so that no overlap is
            # omitted.
            without_gap = ~sufficient[block.local].any(axis=1) & (weights.sum(axis=1) > NO_AREA * full.sum(axis=1))
            largest = np.argmax(total[block.local[without_gap]], axis=1)
            added[block.local[without_gap][np.arange(len(largest)), largest]] = True
        return (sufficient | added) & (full_total > 0.0)

    def _mean_normals(self, overlap: Overlap, deformed: Array, pose: Pose) -> Array:
        """Return unit means (m, dim) of the opposite primary normals; at unpaired nodes, the mean over all nodes.

        Against an obstacle these are the normals at the nodes themselves, which lie in planes of symmetry.
        """
        if isinstance(self.primary, RigidSide):
            _, normal, paired, _ = self.primary.facing(deformed[self.secondary.points], pose)
            return np.where(paired[:, None], normal, -nodal_normals(self.secondary, deformed))
        if self.normals == "secondary":
            return -nodal_normals(self.secondary, deformed)
        if not isinstance(self.normals, str):
            return np.tile(np.array(self.normals), (len(self.secondary.points), 1))
        mean = np.zeros((len(self.secondary.points), deformed.shape[1]))
        normals_of = {
            block.element: facet_normals(block, deformed) if self.normals == "facet" else smooth
            for block, smooth in zip(self.primary.blocks, smooth_normals(self.primary, deformed), strict=True)
        }
        tests = dict(zip((block.element for block in self.secondary.blocks), self._test, strict=True))
        for coupling in overlap.couplings:
            secondary_facet, primary_facet = coupling.pairs.T
            faced = coupling.integrals @ normals_of[coupling.primary.element][primary_facet]
            np.add.at(mean, coupling.secondary.local[secondary_facet], tests[coupling.secondary.element] @ faced)
        self.secondary.add_across_ends(mean)
        length, others = np.linalg.norm(mean, axis=1, keepdims=True), mean.sum(axis=0)
        if np.linalg.norm(others) <= LENGTH_ROUND_OFF * length.sum():
            others = np.eye(len(others))[-1]
        mean = np.where(length > 0.0, mean, others)
        return mean / np.linalg.norm(mean, axis=1, keepdims=True)

    def _clearance(self, rows: csr_array, across: csr_array, weight: Array) -> Array:
        """Return the contribution of nodal clearances on both sides to the weighted gaps (m,) [length]."""
        added = np.zeros(rows.shape[0])
        for matrix, side, clearance in (
            (rows, self.secondary, self.options.clearance), (across, self.primary, self.options.clearance_primary)
        ):  # fmt: skip
            if clearance is not None:
                values = np.zeros(len(self.points))
                values[side.points] = clearance(self.points[side.points])
                added += matrix @ values / weight
        return added


@dataclass(frozen=True, eq=False)
class WeightedPressures(NodalField):
    """Pressures of weighted gaps at the nodes; see `constraints.NodalField`.

    Attributes
    ----------
    weight : ndarray (m,)
        Area of each gap, infinite where there is no gap [area].
    values : csr_array (m, m)
        Map from independent to nodal values of the multiplier field [-].
    tested : ndarray (m,)
        Integrals of the functions of the independent values over the whole secondary side [area].
    nodal_areas : ndarray (m,)
        Integrals of the shape functions over the whole secondary side [area].
    quadratic : list of (int, ndarray (n_nodes, n_nodes), ndarray of int (n_facets, n_nodes))
        Kinds of quadratic facets: number of corners, coefficients of positive functions in shape functions, nodes.
    held : ndarray of bool (m,)
        Nodes prescribed in all directions, whose forces act between supports, independently of their neighbours.
    """

    weight: Array
    values: csr_array
    tested: Array
    nodal_areas: Array
    quadratic: list[tuple[int, Array, NDArray[np.signedinteger]]]
    held: Mask

    def pressure(self, force: Array) -> Array:
        """Return the forces divided by the areas of their gaps or, at mid nodes without a gap, the mean of their corners."""
        return self._at_nodes(force / self.weight, only_without_gap=True)

    @property
    def covered(self) -> Array:
        """Covered part of the nodal areas; at mid nodes without a gap, the mean of their corners."""
        usable = np.isfinite(self.weight)
        faced = usable & (self.tested > 0.0)
        fraction = np.divide(self.weight, self.tested, out=np.zeros_like(self.weight), where=faced)
        return self._at_nodes(fraction, only_without_gap=True)

    def over_whole_side(self, force: Array) -> Array:
        """Return the forces divided by the complete areas of the positive functions; see `_at_nodes`.

        The part of the area of a node that faces the other side may be arbitrarily small, and the force vanishes with it. The
        ratio of both is sensitive to round-off, unlike the force divided by the complete area.
        """
        return self._at_nodes(np.divide(force, self.tested, out=np.zeros_like(force), where=self.tested > 0.0))

    def _at_nodes(self, coefficients: Array, only_without_gap: bool = False) -> Array:
        """Return the nodal values (m,) of a field with `coefficients` (m,) of the positive functions.

        They are the coefficients themselves, except at mid nodes of quadratic facets, where the functions of the corners do
        not vanish.
        """
        coefficients = self.values @ coefficients
        values = coefficients.copy()
        for corners, T, local in self.quadratic:
            with_gaps = T[corners:].any()
            if only_without_gap and with_gaps:
                continue
            at_mid_nodes = coefficients[local[:, corners:]]
            values[local[:, corners:]] = coefficients[local] @ T[:, corners:]
            if with_gaps and self.held.any():
                held = self.held[local]
                values[local[:, corners:]] += (held @ T[:, corners:]) * at_mid_nodes - (held * coefficients[local]) @ T[
                    :, corners:
                ]
        return values

    def closed_nodes(self, active: Mask, gap: Array, pressure: Array) -> Mask:
        """Return the active nodes, and mid nodes without a multiplier that have a pressure."""
        return active | (pressure > 0)
