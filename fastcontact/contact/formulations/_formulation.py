"""Base class of contact formulations, which compute the constraints of a contact pair from its configuration."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.cohesive_layer import cohesive_rows
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, Linearised
from fastcontact.contact.contact_sides import ContactSides
from fastcontact.contact.held_motions import eigenspaces, without_complete_facets
from fastcontact.contact.linearised_geometry import ClosingMotion, LinearisedPoints, PointCompliance, Slips
from fastcontact.contact.linearised_projections import InterpolatedNormals
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pair_options import ALWAYS_CLOSED
from fastcontact.contact.pairing import Candidates, Pairing, normals, pair, tangents
from fastcontact.contact.projection import DeformedSide
from fastcontact.contact.supported_nodes import held_on_both_sides
from fastcontact.contact.surface import Surface
from fastcontact.contact.tied import moments_of, reduction, tied_constraints, with_rigid_arms
from fastcontact.errors import ContactError
from fastcontact.linear.sparse_rows import rows_of
from fastcontact.round_off import LENGTH_ROUND_OFF


@dataclass(eq=False)
class Formulation(ContactSides, ABC):
    """A contact formulation for one pair of surfaces.

    Instances are immutable. Subclasses are dataclasses, and the fields that they add are options of the formulation.

    Parameters
    ----------
    secondary : Surface
    primary : Surface or RigidSide
    points : ndarray (n_points, dim)
        Reference coordinates [length].
    axisymmetric : bool
        Whether the model is axisymmetric. Integrals then include the circumference.
    modulus : float
        Plane-strain modulus of the bodies, E / (1 - nu^2), for scaling [pressure].
    friction : float
        Coefficient of friction; zero means no friction [-].
    projection_tolerance : float, optional
        Largest distance beyond the end of the primary side at which a point is paired, in facet lengths [-]. In 2D the
        default is small, but large enough that points at the end of the primary side stay paired as the bodies deform. In
        3D it is 0.5, see OVERHANG.
    normals : str or sequence of float, optional
        Normals along which the gap is measured.

        - ``"facet"``: normal of the primary facet at the projection. Default in 2D without `surface_smoothing`.
        - ``"averaged"``: normal interpolated between averaged nodal normals of the primary side. Default in all other cases,
          because the pairing of a point opposite an edge may not converge with discontinuous normals.
        - ``"secondary"``: opposite of the averaged normal of the secondary side at the point.
        - A vector (dim,) of any length: a constant normal, which points out of the primary body. Points are projected along
          this vector.
    slip : str
        With ``"symmetric"``, a relative displacement that closes a gap along the mean of the normals of both sides is not
        slip. With ``"primary"``, every relative displacement along the tangents of the primary side is slip, even if the gap
        closes obliquely, as in code_aster.
    surface_smoothing : bool
        Whether to measure the gap between the smooth surfaces that the facets of curved sides approximate, see
        `surface_smoothing`. Mortar and continuous contact set it by default.
    options : PairOptions
        Options of the pair that do not depend on its formulation, such as its clearance.
    held_motions : HeldMotions, optional
        Directions in which supports and multi-point constraints hold nodes.
    """

    name: ClassVar[str]
    # Whether the primary side may be a rigid obstacle.
    allows_obstacles: ClassVar[bool] = True
    # Whether each node has one gap, which is weighted over the adjacent facets.
    weighs_gaps: ClassVar[bool] = False
    # Whether gaps between bodies are linearised at the mean of the displacements of the pairing and of the solution, which
    # reduces the error of a Newton step, instead of at the displacements of the pairing.
    linearised_at_mean: ClassVar[bool] = False

    @property
    def eliminable(self) -> bool:
        """Whether iterative solvers can eliminate closed constraints.

        A penalty does not prevent this, because it acts as a spring for each constraint.
        """
        return True

    def may_alternate(self, constraints: Constraints) -> bool:
        """Return whether repeated pairings may alternate between two states, given the `constraints` of one of them.

        With facet normals, a point opposite an edge may face one of the adjacent facets in one pairing, and the other in the
        next one.
        """
        return isinstance(self.primary, Surface) and self.normals == "facet" and self.options.kind != "tied"

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Return the class that implements this formulation in `dim` dimensions with the `options` of a user."""
        return cls

    @abstractmethod
    def unilateral(self, config: Configuration) -> Constraints:
        """Pair the two sides, and return the constraints of unilateral contact without penalty or cohesion.

        Parameters
        ----------
        config : Configuration
            Positions of both sides at which they are paired.
        """

    def constraints(self, config: Configuration) -> Constraints:
        """Pair the two sides, and return the constraints of the pair with all its options.

        The options include tied contact, penalties, cohesion, fluid pressure, and constraints that never open.

        Parameters
        ----------
        config : Configuration
            Positions of both sides at which they are paired.

        Raises
        ------
        ContactError
            If the pair has a penalty, and the constraints of its formulation have no areas.
        """
        if self._tied is not None:
            return self._tied
        constraints = self.unilateral(config)
        has_penalty = self.options.penalty is not None or self.options.tangential_penalty is not None
        if has_penalty and self.options.cohesion is None:
            constraints = self._with_penalties(constraints, config)
        if config.elastic_slip is not None and constraints.tangents:
            positions, values = config.elastic_slip
            previous_slip = values[nearest(positions, constraints.positions)[1]]
            elastic_slip = -np.einsum("kmd,md->km", np.stack(constraints.directions), previous_slip)
            constraints = replace(constraints, elastic_slip=elastic_slip)
        if self.options.kind == "gap_only":
            return constraints.without(np.ones(len(constraints), bool))
        if self.options.search_distance is not None:
            # A constraint is ignored only if the sides are also far apart at the beginning of the step. Otherwise,
            # constraints with a large penetration in an intermediate iterate would be ignored.
            distance = np.minimum(np.abs(constraints.gaps(config.displacement)), np.abs(constraints.gaps(config.start)))
            constraints = constraints.without(distance > self.options.search_distance)
        if self.options.cohesion is not None:
            positions, gaps = self._initial_gaps
            initial_gap = gaps[nearest(positions, constraints.positions)[1]]
            body_stiffness = self.modulus / self.smallest_node_spacing
            return cohesive_rows(self.options.cohesion, constraints, config, initial_gap, body_stiffness)
        equality = self.never_opening(constraints.positions, config)
        constraints = replace(constraints, equality=equality, friction=config.friction_factor * constraints.friction)
        if self.options.source is not None:
            from fastcontact.contact.fluid_pressure import AreaVectors, with_fluid_pressure

            areas = AreaVectors(self.secondary, self.points, self.axisymmetric)
            source, primary = self.options.source[self.secondary.points], self.primary
            facets = primary if isinstance(primary, Surface) else None
            constraints = with_fluid_pressure(constraints, config, areas, source, facets)
        return constraints if config.wear is None else config.wear.added_to(constraints)

    def _with_penalties(self, constraints: Constraints, config: Configuration) -> Constraints:
        """Return the constraints with the compliances of normal and tangential penalties."""
        normal, tangential, areas = self.options.penalty, self.options.tangential_penalty, constraints.areas
        if areas is None:
            raise ContactError(f"formulation '{self.name}' supports no penalty: leave out the option")
        softness = np.zeros_like(constraints.softness)
        if isinstance(normal, OverclosureLaw):
            slope, zero = self.tangent_of_law(normal, constraints, config)
            constraints = replace(constraints, gap0=constraints.gap0 + zero, law=normal)
            softness[0] = 1.0 / (slope * areas)
        elif normal is not None:
            softness[0] = 1.0 / (normal * areas)
        if tangential is not None:
            softness[1:] = 1.0 / (tangential(constraints.positions) * areas)
        return replace(constraints, softness=softness)

    def tangent_of_law(
        self, law: OverclosureLaw, constraints: Constraints, config: Configuration
    ) -> tuple[Array, Array]:
        """Return the `OverclosureLaw.tangent` of a law at the overclosures of the constraints (m,)."""
        return law.tangent(-constraints.gaps(config.displacement))

    @cached_property
    def _initial_gaps(self) -> tuple[Array, Array]:
        """Positions (m, dim) and gaps (m,) of the constraints between the undeformed bodies [length]."""
        undeformed = Configuration.undeformed(self.points)
        constraints = self.unilateral(replace(undeformed, clearance_factor=self.options.initial_clearance_factor))
        return constraints.positions, constraints.gap0

    @property
    def has_nodes_at_corners(self) -> bool:
        """Whether the integration points of some facets are the nodes, because the facets end at a corner."""
        return False

    @cached_property
    def _tied(self) -> Constraints | None:
        """The equations of a tied pair, for the undeformed bodies; None for other pairs."""
        if self.options.kind != "tied":
            return None
        constraints = self.unilateral(Configuration.undeformed(self.points))
        if isinstance(self.primary, Surface) and constraints.tangents:
            # Near a concave edge two facets may be equally close. The projection along averaged normals is unique.
            pairing = pair(constraints.positions, DeformedSide(self.primary, self.points), np.inf, "averaged")
            constraints = with_rigid_arms(constraints, pairing, self.primary, self.points)
        moments, areas = moments_of(constraints)
        return tied_constraints(constraints, moments, areas, self._tied_at_supports(constraints, moments, areas))

    def _tied_at_supports(self, constraints: Constraints, moments: csr_array, areas: Array | None) -> csr_array | None:
        """Return the `tied.reduction` of the multipliers of a tied pair; None if supports hold both sides at no node.

        `moments` and `areas` are the results of `tied.moments_of`.
        """
        # Directions in which all nodes of a facet are held are ignored.
        held = held_on_both_sides(self, Configuration.undeformed(self.points))
        held = without_complete_facets(held, self.secondary)
        if not (held.any() and constraints.tangents):
            return None
        nodes = self.nodes_of(constraints, moments)
        means = [moments @ direction for direction in (normals(constraints.directions), *constraints.directions)]
        # The orthonormal axes nearest to the means do not depend on the choice of the tangents.
        left, lengths, right = np.linalg.svd(np.stack(means, axis=1))
        axes = (left * (lengths > 0.0)[:, None]) @ right
        finite_areas = np.ones(len(nodes)) if areas is None else np.where(np.isfinite(areas), areas, 0.0)
        held = np.where(finite_areas[:, None, None] > 0.0, held[nodes], 0.0)
        return reduction(axes, held, nodes, finite_areas, self.secondary.node_adjacency)

    def nodes_of(self, constraints: Constraints, moments: csr_array) -> Indices:
        """Return the secondary node (q,), numbered on its side, of each row of `moments`, see `tied.moments_of`."""
        if constraints.nodes is None:
            return np.arange(len(self.secondary.points))
        return self.number_on_side[constraints.nodes[: moments.shape[0]]]

    def never_opening(self, positions: Array, config: Configuration) -> Mask:
        """Return which constraints (m,) cannot open, given their reference positions (m, dim) [length]."""
        always_closed = self.options.kind in ALWAYS_CLOSED
        if always_closed or config.never_opening is None:
            return np.full(len(positions), always_closed)
        known_positions, values = config.never_opening
        return np.asarray(values[nearest(known_positions, positions)[1]])

    def assembled(
        self, candidates: Candidates, pairing: Pairing, compliance: PointCompliance | None, config: Configuration
    ) -> Constraints:
        """Return the constraints of paired candidates, including tangents if `has_tangents`.

        The `compliance`, if any, is that of the multiplier field of the candidates.
        """
        motion, B, gap0 = self.gaps(candidates, pairing, config)
        directions, options = tuple[Array, ...](), dict[str, Any]()
        if self.has_tangents:
            projectors = None
            if self.friction and self.held_motions is not None and len(self.held_nodes):
                # Projectors onto the directions in which all nodes of a candidate are held.
                held = np.einsum("nk,nkde->nde", candidates.shape, self.held_motions.projectors_at(candidates.nodes))
                projectors = eigenspaces(held, 1.0 - LENGTH_ROUND_OFF)
            axes = tangents(pairing.normal, projectors)
            friction, directions, slip_axes = self.options.friction_axes(self.friction, axes, candidates)
            slip0 = self.slip_at_rest(candidates, pairing, slip_axes, config)
            rows = tuple(map(partial(rows_of, motion), slip_axes))
            options = {"tangents": rows, "directions": directions, "friction": friction, "slip0": slip0}
        if self.normals != "secondary":  # whose derivatives are not implemented
            options["geometry"] = partial(self._linearised_points, candidates, pairing, config, directions, compliance)
        return Constraints(B, gap0, candidates.positions(self.points), compliance and compliance[0], **options)

    def _linearised_points(
        self, candidates: Candidates, pairing: Pairing, config: Configuration, directions: Sequence[Array],
        compliance: PointCompliance | None, multiplier: Array, tangential: Array, displacement: Array,
    ) -> Linearised:  # fmt: skip
        """Return the linearised geometry of paired candidates, including slips along the k tangents `directions` (n, dim).

        With friction, the `compliance` of a multiplier field couples force vectors, whose directions vary.

        The last three arguments are those of `Geometry`.
        """
        rows = np.flatnonzero(pairing.paired & (multiplier != 0.0))
        at_mean = self.linearised_at_mean and isinstance(self.primary, Surface)
        if at_mean:
            config = replace(config, displacement=0.5 * (config.displacement + displacement))
            pairing = self.pair_candidates(candidates, config, np.inf)
        points = self.linearised_points(candidates, pairing, rows, config, self.normals)
        if at_mean:
            points.offset = points.offset + points.motion @ (displacement - config.displacement)
        arguments = self.secondary, points, None, points.normal, multiplier[rows]
        linearised = LinearisedPoints(*arguments, rows_in_pair=(rows, len(multiplier)))
        if not directions:
            return linearised
        linearised = replace(linearised, compliance=compliance)
        moved = replace(config, displacement=displacement)
        slips = self._load_step_slips(points.motion, np.stack(directions)[:, rows], tangential[rows], moved)
        if not isinstance(self.primary, Surface) or self.slip != "symmetric":
            return replace(linearised, slips=slips)
        averaged, slip_normals = points.averaged, None
        if averaged is None:
            feet, primary = pairing.extended_feet(rows), config.deformed(self.primary, self.points)
            averaged = InterpolatedNormals(primary, feet.local, feet.shape, primary.smooth_normals[pairing.facet[rows]])
            slip_normals = averaged, averaged.gradient(feet.gradient)
        local = self.number_on_side[candidates.nodes[rows]]
        secondary = InterpolatedNormals(config.deformed(self.secondary, self.points), local, candidates.shape[rows])
        closing = ClosingMotion(averaged.normal, (secondary.normal, secondary.variation), points.motion @ slips.start)
        slips = replace(slips, total=slips.total + closing.vector, closing=closing)
        return replace(linearised, slips=slips, slip_normals=slip_normals)

    def _load_step_slips(self, motion: csr_array, directions: Array, tangential: Array, config: Configuration) -> Slips:
        """Return the slips of the load step along the tangents `directions` (k, m, dim).

        `motion` (m, n_points) maps nodal displacements to displacements relative to the primary side. The motion of a rigid
        obstacle in the step is subtracted. `tangential` (m, k) are the tangential forces [force].
        """
        increment, rotation_gradient = config.displacement - config.start, None
        total = motion @ increment
        if isinstance(self.primary, RigidSide):
            total -= self.rigid_motion(motion.__matmul__, config)
            if config.pose.angle != config.pose_start.angle:  # The motion is an affine function of the positions.
                ends = np.vstack([np.zeros(total.shape[1]), np.eye(total.shape[1])])
                unit_motions = self.primary.rigid_motion(ends, ends[:1], config.pose, config.pose_start)
                rotation_gradient = unit_motions[1:] - unit_motions[0]
        slip_data = directions, tangential, total, increment, self.points + config.start
        return Slips(*slip_data, rotation_gradient=rotation_gradient)
