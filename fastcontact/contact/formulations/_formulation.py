"""Base class of contact formulations, which compute the constraints of a contact pair from its configuration."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.cohesive_layer import cohesive_rows
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Constraints, Linearised, MultiplierCompliance
from fastcontact.contact.held_motions import (
    SAME_DIRECTION,
    HeldMotions,
    deflate,
    direction_fields,
    eigenspaces,
    symmetry_planes,
)
from fastcontact.contact.linearised_geometry import (
    ClosingMotion,
    InterpolatedNormals,
    LinearisedPoints,
    NodalNormals,
    Slips,
    paired_points,
)
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pair_options import ALWAYS_CLOSED, PairOptions
from fastcontact.contact.pairing import (
    OVERHANG,
    Candidates,
    Normals,
    Pairing,
    checked_normals,
    gap_rows,
    normals,
    pair,
    rows_along,
    tangents,
    with_secondary_normals,
)
from fastcontact.contact.projection import (
    SMALL_OVERHANG,
    facet_points,
    interpolate,
    nodal_normals,
    smooth_normals,
)
from fastcontact.contact.surface import Surface
from fastcontact.contact.surface_smoothing import Smoothing
from fastcontact.contact.tied import moments_of, reduction, tied_constraints, with_rigid_arms
from fastcontact.errors import ContactError, unknown
from fastcontact.mesh import elements
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY

SLIPS = ("symmetric", "primary")


@dataclass(eq=False)
class Formulation(ABC):
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

    secondary: Surface
    primary: Surface | RigidSide
    points: Array
    axisymmetric: bool
    modulus: float

    friction: float = 0.0
    projection_tolerance: float | None = None
    normals: Normals | None = None
    slip: str = "symmetric"
    surface_smoothing: bool = False
    options: PairOptions = field(default_factory=PairOptions, repr=False)
    held_motions: HeldMotions | None = field(default=None, repr=False)
    # Points (n_points,) that are excluded from contact.
    excluded: Mask = field(init=False, repr=False)
    # Whether the constraints need tangents, for friction, tying or a cohesive layer; adhesion needs none.
    has_tangents: bool = field(init=False, repr=False)

    name: ClassVar[str]
    # Whether the primary side may be a rigid obstacle.
    allows_obstacles: ClassVar[bool] = True
    # Whether each node has one gap, which is weighted over the adjacent facets.
    weighs_gaps: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if self.normals is None:
            self.normals = "facet" if self.points.shape[1] == 2 and not self.surface_smoothing else "averaged"
        self.normals = checked_normals(self.normals, self.points, self.primary)
        if self.slip not in SLIPS:
            raise ContactError(unknown("kind of slip", self.slip, SLIPS))
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise ContactError(f"the coefficient of friction {self.friction} must be a number >= 0")
        if self.projection_tolerance is None:
            self.projection_tolerance = SMALL_OVERHANG if self.points.shape[1] == 2 else OVERHANG
        if not self.projection_tolerance >= 0:
            raise ContactError(f"projection_tolerance = {self.projection_tolerance} must not be negative")
        if self.surface_smoothing and not isinstance(self.primary, Surface):
            raise ContactError("surface_smoothing needs two meshed sides: leave it out at an obstacle")
        if self.friction:
            secondary, primary = self.secondary, self.primary
            self.secondary = self._reflected(secondary, primary)
            self.primary = self._reflected(primary, secondary) if isinstance(primary, Surface) else primary
        excluded, cohesion = self.options.excluded, self.options.cohesion
        self.excluded = np.zeros(len(self.points), bool) if excluded is None else excluded
        has_shear_tractions = cohesion is not None and not cohesion.reversible
        self.has_tangents = bool(self.friction) or self.options.kind == "tied" or has_shear_tractions

    @cached_property
    def smoothing(self) -> Smoothing | None:
        """The smooth surfaces of both sides; None without smoothing, for flat sides, and with a constant normal."""
        if not self.surface_smoothing or self.options.kind == "tied" or not isinstance(self.normals, str):
            return None
        assert isinstance(self.primary, Surface)
        return Smoothing.of(self.secondary, self.primary, self.points)

    @cached_property
    def symmetry_planes(self) -> list[tuple[Array, Indices]]:
        """The planes of symmetry at the ends of the secondary surface, see `held_motions.symmetry_planes`."""
        held, opposite = self.held_motions, self.points[self.primary.points]
        return [] if held is None else symmetry_planes(held, self.secondary, self.points, opposite)

    @cached_property
    def node_candidates(self) -> Candidates:
        """The secondary nodes as candidates."""
        return Candidates.from_side(self.secondary)

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
            previous_slip = _values_at(config.elastic_slip, constraints.positions)
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
            initial_gap = _values_at(self._initial_gaps, constraints.positions)
            body_stiffness = self.modulus / self.shortest_edge
            return cohesive_rows(self.options.cohesion, constraints, config, initial_gap, body_stiffness)
        equality = self.never_opening(constraints.positions, config)
        constraints = replace(constraints, equality=equality, friction=config.friction_factor * constraints.friction)
        if self.options.source is not None:
            from fastcontact.contact.fluid_pressure import AreaVectors, with_fluid_pressure

            areas = AreaVectors(self.secondary, self.points, self.axisymmetric)
            constraints = with_fluid_pressure(constraints, config, areas, self.options.source[self.secondary.points])
        return constraints if config.wear is None else config.wear.added_to(constraints)

    def _with_penalties(self, constraints: Constraints, config: Configuration) -> Constraints:
        """Return the constraints with the compliances of normal and tangential penalties."""
        normal, tangential, areas = self.options.penalty, self.options.tangential_penalty, constraints.areas
        if areas is None:
            raise ContactError(f"formulation '{self.name}' supports no penalty: leave out the option")
        if isinstance(normal, OverclosureLaw):
            slope, zero = normal.tangent(-constraints.gaps(config.displacement))
            constraints = replace(constraints, gap0=constraints.gap0 + zero, softness=1.0 / (slope * areas), law=normal)
        elif normal is not None:
            constraints = replace(constraints, softness=np.asarray(1.0 / (normal * areas)))
        if tangential is None or not constraints.tangents:
            return constraints
        return replace(constraints, tangential_softness=1.0 / (tangential(constraints.positions) * areas))

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
    def shortest_edge(self) -> float:
        """Smallest diameter of the facets, divided by the order of their shape functions [length]."""
        blocks = self.secondary.blocks
        return float(min(b.diameters(self.points).min() / elements.get(b.element).order for b in blocks))

    @cached_property
    def _tied(self) -> Constraints | None:
        """The equations of a tied pair, for the undeformed bodies; None for other pairs."""
        if self.options.kind != "tied":
            return None
        constraints = self.unilateral(Configuration.undeformed(self.points))
        if isinstance(self.primary, Surface) and constraints.tangents:
            # Near a concave edge two facets may be equally close. The projection along averaged normals is unique.
            pairing = pair(constraints.positions, self.primary, self.points, np.inf, "averaged")
            constraints = with_rigid_arms(constraints, pairing, self.primary, self.points)
        moments, areas = moments_of(constraints)
        return tied_constraints(constraints, moments, areas, self._tied_at_supports(constraints, moments, areas))

    def _tied_at_supports(self, constraints: Constraints, moments: csr_array, areas: Array | None) -> csr_array | None:
        """Return the `tied.reduction` of the multipliers of a tied pair; None if supports hold both sides at no node."""
        # Directions in which all nodes of a facet are held are ignored.
        held = self._held_on_both_sides(Configuration.undeformed(self.points))
        held = _without_complete_facets(held, self.secondary)
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
        return self._number_on_side[constraints.nodes[: moments.shape[0]]]

    def never_opening(self, positions: Array, config: Configuration) -> Mask:
        """Return which constraints (m,) cannot open, given their reference positions (m, dim) [length]."""
        always_closed = self.options.kind in ALWAYS_CLOSED
        if always_closed or config.never_opening is None:
            return np.full(len(positions), always_closed)
        return np.asarray(_values_at(config.never_opening, positions))

    def pair_candidates(self, candidates: Candidates, config: Configuration, tolerance: float | None = None) -> Pairing:
        """Return the pairing of candidates in the deformed configuration, with the options of the formulation.

        If `tolerance` is given, it replaces `projection_tolerance`.
        """
        deformed = self.points + config.displacement
        largest_overhang = (self.projection_tolerance or 0.0) if tolerance is None else tolerance
        assert self.normals is not None
        positions = candidates.positions(deformed)
        pairing = pair(positions, self.primary, deformed, largest_overhang, self.normals, config.pose, config.rounded)
        if self.normals != "secondary":
            return pairing
        return with_secondary_normals(pairing, self._secondary_normals(candidates, deformed))

    @cached_property
    def _number_on_side(self) -> Indices:
        """Number (n_points,) of each secondary node on its side; zero for other points."""
        numbers = np.zeros(len(self.points), np.intp)
        numbers[self.secondary.points] = np.arange(len(self.secondary.points))
        return numbers

    def _secondary_normals(self, candidates: Candidates, deformed: Array) -> Array:
        """Return averaged unit normals (n, dim) of the secondary side at candidates.

        `deformed` (n_points, dim) are the current coordinates of all points [length].
        """
        at_nodes = nodal_normals(self.secondary, deformed)[self._number_on_side[candidates.nodes]]
        normal = np.einsum("nk,nkd->nd", candidates.shape, at_nodes)
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), TINY))

    def assembled(
        self, candidates: Candidates, pairing: Pairing, compliance: MultiplierCompliance | None, config: Configuration
    ) -> Constraints:
        """Return the constraints of paired candidates, including tangents if `has_tangents`.

        The `compliance`, if any, is `Constraints.compliance`.
        """
        B, gap0 = gap_rows(candidates, pairing, self.primary, self.points)
        gap0 += self.added_gap(candidates, pairing, config) - self.smoothing_overlap(candidates, pairing, config)
        constraints = Constraints(B, gap0, candidates.positions(self.points), compliance)
        directions: tuple[Array, ...] = ()
        if self.has_tangents:
            projectors = None
            if self.friction and self.held_motions is not None and len(self.held_motions.nodes):
                # Projectors onto the directions in which all nodes of a candidate are held.
                held = np.einsum("nk,nkde->nde", candidates.shape, self.held_motions.projectors_at(candidates.nodes))
                projectors = eigenspaces(held, 1.0 - LENGTH_ROUND_OFF)
            axes = tangents(pairing.normal, projectors)
            friction, directions, slip_axes = self.options.friction_axes(self.friction, axes, candidates)
            rows, slip0 = self.slips(candidates, pairing, slip_axes, config)
            constraints = replace(constraints, tangents=rows, directions=directions, friction=friction, slip0=slip0)
        if self.normals == "secondary":  # derivatives are not implemented
            return constraints
        return replace(constraints, geometry=partial(self._linearised_points, candidates, pairing, config, directions))

    @property
    def linearised_at_mean(self) -> bool:
        """Whether gaps are linearised at the mean of the displacements of the pairing and of its solution.

        This reduces the error of a Newton step. Otherwise, they are linearised at the displacements of the pairing.
        """
        return False

    def _linearised_points(
        self, candidates: Candidates, pairing: Pairing, config: Configuration, directions: Sequence[Array],
        multiplier: Array, tangential: Array, displacement: Array,
    ) -> Linearised:  # fmt: skip
        """Return the linearised geometry of paired candidates, including slips along the k tangents `directions` (n, dim).

        The last three arguments are those of `Geometry`.
        """
        rows = np.flatnonzero(pairing.paired & (multiplier != 0.0))
        if self.linearised_at_mean:
            config = replace(config, displacement=0.5 * (config.displacement + displacement))
            pairing = self.pair_candidates(candidates, config, np.inf)
        coordinates = self.points + config.displacement
        slope = self.smoothing_slope(candidates, pairing, rows, coordinates)
        options = self.primary, coordinates, self.normals, config.pose
        points = paired_points(candidates, pairing, rows, *options, slope=slope)
        if self.linearised_at_mean:
            points.offset = points.offset + points.motion @ (displacement - config.displacement)
        arguments = self.secondary, points, None, points.normal, multiplier[rows]
        linearised = LinearisedPoints(*arguments, rows_in_pair=(rows, len(multiplier)))
        if not directions:
            return linearised
        moved = replace(config, displacement=displacement)
        slips = self._load_step_slips(points.motion, np.stack(directions)[:, rows], tangential[rows], moved)
        if not isinstance(self.primary, Surface) or self.slip != "symmetric":
            return replace(linearised, slips=slips)
        averaged, slip_normals = points.averaged, None
        if averaged is None:
            feet = pairing.projections(self.primary, rows)
            averaged = InterpolatedNormals.of_facets(self.primary, coordinates, pairing.facet[rows], feet)
            slip_normals = averaged, averaged.gradient(feet.gradient)
        nodal, local = NodalNormals(self.secondary, coordinates), self._number_on_side[candidates.nodes[rows]]
        secondary = InterpolatedNormals(nodal, local, candidates.shape[rows])
        closing = ClosingMotion.of(averaged.normal, secondary, points.motion @ slips.start)
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

    def slips(
        self, candidates: Candidates, pairing: Pairing, directions: Sequence[Array], config: Configuration
    ) -> tuple[tuple[csr_array, ...], Array]:
        """Return the slips of candidates in the load step, as an affine function of the displacements.

        Parameters
        ----------
        candidates : Candidates
        pairing : Pairing
        directions : sequence of k ndarray (n, dim)
            Unit tangents.
        config : Configuration

        Returns
        -------
        rows : tuple of k csr_array (n, n_dofs)
            Derivatives of the slips along each tangent with respect to the displacements [-].
        slip0 : ndarray (k, n)
            Minus the motion of a rigid primary side in the step; between two bodies, minus the tangential displacement that
            closes the gap, if `slip` is ``"symmetric"`` [length].
        """
        rows = tuple(rows_along(t, candidates, pairing, self.primary, self.points.size) for t in directions)
        slip0 = np.zeros((len(directions), len(pairing.paired)))
        if isinstance(self.primary, RigidSide):
            obstacle_motion = self.rigid_motion(candidates.positions, config)
            slip0 = -np.stack([np.einsum("nd,nd->n", t, obstacle_motion) for t in directions])
        elif self.slip == "symmetric":
            slip0 = self._closing_slip(candidates, pairing, directions, config)
        return rows, slip0

    def added_gap(self, candidates: Candidates, pairing: Pairing, config: Configuration) -> Array:
        """Return the contribution (n,) of clearances and wear to the gaps of candidates; zero if unpaired [length]."""
        added, rows, options = np.zeros(len(candidates.nodes)), np.flatnonzero(pairing.paired), self.options
        nodes, shape = candidates.nodes[rows], candidates.shape[rows]
        if options.clearance is not None and len(rows):
            added[rows] += options.clearance(np.einsum("nk,nkd->nd", shape, self.points[nodes]))
        if options.clearance_primary is not None and isinstance(self.primary, Surface) and len(rows):
            feet = facet_points(self.primary, pairing.facet[rows], pairing.xi[rows])
            added[rows] += options.clearance_primary(np.einsum("nk,nkd->nd", feet.shape, self.points[feet.nodes]))
        added *= config.clearance_factor
        if config.wear_depth is not None:
            added[rows] += np.einsum("nk,nk->n", shape, config.wear_depth[nodes])
        return added

    def smoothing_overlap(self, candidates: Candidates, pairing: Pairing, config: Configuration) -> Array:
        """Return the lengths (n,) by which smooth surfaces reduce the gaps of candidates, compared with facets [length].

        They are zero without `smoothing`.
        """
        overlap, rows = np.zeros(len(pairing.paired)), np.flatnonzero(pairing.paired)
        if self.smoothing is None or candidates.facet is None or candidates.xi is None:
            return overlap
        on_secondary = candidates.facet[rows], candidates.xi[rows]
        on_primary = pairing.facet[rows], pairing.xi[rows]
        overlap[rows] = self.smoothing.overlap(on_secondary, on_primary, self.points + config.displacement)
        return overlap

    def smoothing_slope(self, candidates: Candidates, pairing: Pairing, rows: Indices, deformed: Array) -> Array | None:
        """Return the derivatives (n, dim - 1) of `smoothing_overlap` with respect to primary reference coordinates [length].

        `rows` (n,) are numbers of candidates, and `deformed` (n_points, dim) the current coordinates. The derivatives are
        zero on the straight extensions of facets, and None without `smoothing`.
        """
        if self.smoothing is None or candidates.facet is None:
            return None
        axes = self.smoothing.frames(deformed)
        factor = self.smoothing.height_factors(candidates.facet[rows], pairing.facet[rows], axes)[:, 1:]
        slope = factor * self.smoothing.primary.slope(pairing.facet[rows], pairing.xi[rows])
        return slope if pairing.beyond is None else np.where(pairing.beyond[rows] == 0.0, slope, 0.0)

    def rigid_motion(self, positions: Callable[[Array], Array], config: Configuration) -> Array:
        """Return the displacements (n, dim) in the step of the obstacle points opposite to n points [length].

        `positions` is the function from the coordinates (n_points, dim) of all nodes to those of the points.
        """
        assert isinstance(self.primary, RigidSide)
        current, initial = (positions(self.points + u) for u in (config.displacement, config.start))
        return self.primary.rigid_motion(current, initial, config.pose, config.pose_start)

    @cached_property
    def _held_nodes(self) -> Indices:
        """The secondary nodes that supports hold, numbered on the side."""
        held = () if self.held_motions is None else self.held_motions.nodes
        return np.flatnonzero(np.isin(self.secondary.points, held))

    def _held_projections(self, nodes: Indices, config: Configuration) -> tuple[Pairing, Array]:
        """Return the pairing of secondary `nodes` (n,), and the directions in which their projections are held.

        The directions are given by projectors (n, dim, dim), interpolated between the nodes of the opposite facets.
        """
        assert self.held_motions is not None
        candidates = Candidates.from_nodes(self.secondary.points[nodes])
        pairing = self.pair_candidates(candidates, config, max(self.projection_tolerance or 0.0, SMALL_OVERHANG))
        held_primary = np.zeros((len(nodes), *2 * self.points.shape[1:]))
        if isinstance(self.primary, Surface):
            rows = np.flatnonzero(pairing.paired)
            feet = facet_points(self.primary, pairing.facet[rows], pairing.xi[rows])
            held_primary[rows] = np.einsum("nk,nkde->nde", feet.shape, self.held_motions.projectors_at(feet.nodes))
        return pairing, held_primary

    def _held_on_both_sides(self, config: Configuration) -> Array:
        """Return projectors (n_nodes, dim, dim) onto directions in which both sides are held."""
        held, nodes = np.zeros((len(self.secondary.points), *2 * self.points.shape[1:])), self._held_nodes
        if len(nodes) and self.held_motions is not None:
            P = self.held_motions.projectors_at(self.secondary.points[nodes])
            Q = self._held_projections(nodes, config)[1]
            held[nodes] = eigenspaces(P @ Q @ P, 0.5)
        return held

    def nodes_with_prescribed_gap(self, config: Configuration) -> Mask:
        """Return the nodes (n_nodes,) at which supports and multi-point constraints prescribe the gap.

        The contact forces of such nodes act between supports. On non-matching meshes, their gaps may depend on displacements
        of other primary nodes, but not on those of secondary nodes, and the constraints are nearly redundant.
        """
        prescribed = np.zeros(len(self.secondary.points), bool)
        if self.held_motions is None or self.options.kind == "tied" or not isinstance(self.primary, Surface):
            return prescribed
        nodes = np.flatnonzero(np.isin(self.secondary.points, self.held_motions.restrained))
        if len(nodes):
            candidates = Candidates.from_nodes(self.secondary.points[nodes])
            pairing = self.pair_candidates(candidates, config, max(self.projection_tolerance or 0.0, SMALL_OVERHANG))
            rows = rows_along(pairing.normal, candidates, pairing, self.primary, self.points.size)
            # The gap is prescribed if the free unknowns carry less than half of the length of its row.
            square, free_square = ((matrix**2).sum(axis=1) for matrix in (rows, rows @ self.held_motions.motion))
            prescribed[nodes] = pairing.paired & (free_square < 0.25 * square)
        return prescribed & ~self.excluded[self.secondary.points]

    def nodes_with_undetermined_traction(self, config: Configuration) -> Mask:
        """Return which nodes (n_nodes,) belong to facets whose traction is undetermined.

        This is the case if supports hold all nodes of a facet, and the other side, in one direction. If supports hold the
        complete side in a tangential direction, as in a slice in plane strain, the traction in this direction vanishes and is
        not undetermined. The gap determines the pressure of a penalty, and the traction of a cohesive layer.
        """
        held_both = self._held_on_both_sides(config)
        if not held_both.any() or self.options.cohesion is not None:
            return np.zeros(len(held_both), bool)
        tangential = deflate(held_both, nodal_normals(self.secondary, self.points + config.displacement), np.sqrt(0.5))
        normal = held_both - tangential
        if self.options.penalty is not None:
            normal = np.zeros_like(normal)
        if self.options.kind != "tied":
            since_begin = replace(config, start=np.zeros_like(config.displacement))
            tangential = self._held_without_motion(since_begin) if self.friction else np.zeros_like(held_both)
        # Projector that removes the tangential directions in which the complete side is held.
        remaining = np.eye(held_both.shape[1]) - eigenspaces(tangential.mean(axis=0)[None], 1.0 - LENGTH_ROUND_OFF)[0]
        normal, tangential = (held - _without_complete_facets(held, self.secondary) for held in (normal, tangential))
        return np.asarray(np.trace(normal + remaining @ tangential @ remaining, axis1=1, axis2=2) > 0.5)

    def directions_without_slip(self, config: Configuration) -> list[tuple[Array, Mask]]:
        """Return directions in which supports hold both sides without relative motion.

        In a plane of symmetry or on an axis, slip in these directions is zero for every traction, so that the traction is
        undetermined. If one side is free, or moves relative to the other, friction determines the traction. Directions in
        which all nodes of a facet are held are ignored.

        Returns
        -------
        list of (ndarray (n_nodes, dim), ndarray of bool (n_nodes,))
            Unit vectors, each with the secondary nodes that are held in this direction.
        """
        held = _without_complete_facets(self._held_without_motion(config), self.secondary)
        return direction_fields(held, self.points[self.secondary.points])

    def _held_without_motion(self, config: Configuration) -> Array:
        """Return projectors (n_nodes, dim, dim) onto `directions_without_slip`, including those of complete facets."""
        held, nodes = np.zeros((len(self.secondary.points), *2 * self.points.shape[1:])), self._held_nodes
        if not len(nodes) or self.held_motions is None:
            return held
        pairing, held_opposite = self._held_projections(nodes, config)
        points = self.secondary.points[nodes]
        common, slip = self.held_motions.projectors_at(points), (config.displacement - config.start)[points]
        if isinstance(self.primary, RigidSide):
            slip = slip - self.rigid_motion(lambda coordinates: coordinates[points], config)
        else:
            rows = np.flatnonzero(pairing.paired)
            feet = facet_points(self.primary, pairing.facet[rows], pairing.xi[rows])
            held_primary = self.held_motions.projectors_at(feet.nodes)
            motion = (config.displacement - config.start)[feet.nodes]
            mean = np.einsum("nk,nkd->nd", feet.shape, motion)
            # The point opposite to a held node may lie slightly off the held primary node, if the normal is inclined. The
            # motion of the other nodes of this facet is then ignored.
            excess = np.einsum("nk,nkde,nkd->ne", feet.shape, held_primary, motion - mean[:, None])
            slip[rows] -= mean + np.einsum("nde,ne->nd", np.linalg.pinv(held_opposite[rows], hermitian=True), excess)
            common = eigenspaces(common @ held_opposite @ common, 0.5)
        normal_part = np.einsum("nde,ne->nd", common, pairing.normal)
        common = deflate(common, pairing.normal, np.sqrt(0.5))
        # Where the normal is held, a motion along it closes the gap and is not slip. Elsewhere the normal may be inclined to
        # the held directions, such as at the edge of a plane of symmetry.
        closing = np.einsum("nd,nd->n", slip, pairing.normal)
        closing = np.where(np.linalg.norm(normal_part, axis=1) > np.sqrt(0.5), closing, 0.0)
        slip -= closing[:, None] * pairing.normal
        tolerance = LENGTH_ROUND_OFF * max(np.abs(config.displacement).max(), np.abs(config.start).max())
        held[nodes] = deflate(common, slip, tolerance)
        return held

    def _reflected(self, side: Surface, opposite: Surface | RigidSide) -> Surface:
        """Return a side whose averaged normals at planes of symmetry are those of the full model; see `symmetry_planes`."""
        if self.held_motions is None or not np.isin(side.points, self.held_motions.nodes).any():
            return side
        across = np.zeros((len(side.points), *2 * (self.points.shape[1],)))  # projectors onto the normals of the planes
        for axis, nodes in symmetry_planes(self.held_motions, side, self.points, self.points[opposite.points]):
            held = self.held_motions.projectors_at(side.points[nodes]) @ axis
            across[nodes] += held[:, :, None] * held[:, None]
        across = _without_complete_facets(across, side)
        nodes = np.flatnonzero(across.any(axis=(1, 2)))
        if not len(nodes):
            return side
        reflections = np.eye(self.points.shape[1]) - 2.0 * across[nodes]
        return replace(side, periodic_ends=(*side.periodic_ends, (nodes, nodes, reflections)))

    def _closing_slip(
        self, candidates: Candidates, pairing: Pairing, directions: Sequence[Array], config: Configuration
    ) -> Array:
        """Return the correction (k, n) of slips for the motion that closes gaps [length].

        On curved surfaces, in particular at the edge of the contact, the normal of the primary side is inclined to the
        direction in which the gap closes. A component of this motion would then count as slip. The correction assumes that
        the gap closes along the mean of the normals of both sides, which is exact for two bodies that are mirror images.
        """
        assert isinstance(self.primary, Surface)
        deformed, start = self.points + config.displacement, self.points + config.start
        slip0, rows = np.zeros((len(directions), len(pairing.paired))), np.flatnonzero(pairing.paired)
        feet = facet_points(self.primary, pairing.facet[rows], pairing.xi[rows])
        nodes, shape = candidates.nodes[rows], candidates.shape[rows]
        primary_normals = interpolate(smooth_normals(self.primary, deformed)[pairing.facet[rows]], feet)
        mean = primary_normals - self._secondary_normals(Candidates(nodes, shape), deformed)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > LENGTH_ROUND_OFF)
        offset = np.einsum("nk,nkd->nd", shape, start[nodes])
        offset -= np.einsum("nk,nkd->nd", feet.shape, start[feet.nodes])
        initial_gap = np.einsum("nd,nd->n", mean, offset)
        slip0[:, rows] = [np.einsum("nd,nd->n", tangent[rows], mean) * initial_gap for tangent in directions]
        return slip0

    def first_contact(self, config: Configuration) -> tuple[Array, Array]:
        """Return the point of first contact (dim,) [length], and the unit normal (dim,) of the primary side there [-].

        The point is the secondary node with the smallest gap to the undeformed primary side. If several gaps are equal, it is
        the node nearest to the origin.
        """
        positions = self.points[self.secondary.points]
        gap, normal = self.nodal_gap(replace(config, displacement=np.zeros_like(self.points)))
        closest_nodes = np.flatnonzero(gap <= gap.min() + LENGTH_ROUND_OFF * np.ptp(positions, axis=0).max())
        first = closest_nodes[np.argmin(np.linalg.norm(positions[closest_nodes], axis=1))]
        return positions[first], normal[first]

    def nodal_gap(
        self, config: Configuration, with_clearance: bool = True, displacement: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the gaps of the secondary nodes, and the opposite normals.

        Parameters
        ----------
        config : Configuration
            Positions of both sides at which the nodes are paired.
        with_clearance : bool
            Whether the gaps include clearances and wear.
        displacement : ndarray (n_points, dim), optional
            Displacements for which the gaps are evaluated; by default those of `config` [length].

        Returns
        -------
        gap : ndarray (n_nodes,)
            Gaps, infinite for nodes without an opposite facet [length].
        normal : ndarray (n_nodes, dim)
            Unit normals of the primary side [-].
        """
        nodes = self.node_candidates
        pairing = self.pair_candidates(nodes, config, max(self.projection_tolerance or 0.0, SMALL_OVERHANG))
        G, gap0 = gap_rows(nodes, pairing, self.primary, self.points)
        gap0 -= self.smoothing_overlap(nodes, pairing, config)
        if with_clearance:
            gap0 += self.added_gap(nodes, pairing, config)
        u = config.displacement if displacement is None else displacement
        return np.where(pairing.paired, gap0 + G @ u.ravel(), np.inf), pairing.normal

    def nodal_slip(self, config: Configuration) -> Array:
        """Return the slips (n_nodes, dim) of the secondary nodes in the load step, as vectors [length].

        Nodes beyond the end of the primary side are included, because parts of their facets may carry pressure.
        """
        nodes = self.node_candidates
        pairing = self.pair_candidates(nodes, config, np.inf)
        directions = tangents(pairing.normal)
        rows, slip0 = self.slips(nodes, pairing, directions, config)
        slip, displacement = np.zeros_like(pairing.normal), (config.displacement - config.start).ravel()
        for row, constant, direction in zip(rows, slip0, directions, strict=True):
            slip += (row @ displacement + constant)[:, None] * direction
        return np.where(pairing.paired[:, None], slip, 0.0)


def _without_complete_facets(held: Array, side: Surface) -> Array:
    """Return projectors (n_nodes, dim, dim) without directions in which all nodes of a facet are held.

    `held` (n_nodes, dim, dim) are the projectors onto the directions in which the nodes of `side` are held.
    """
    span = np.zeros_like(held)
    for block in side.blocks:
        projectors = held[block.local]
        vectors = np.linalg.eigh(projectors.mean(axis=1))[1]
        is_common = np.einsum("fdk,fnde,fek->fnk", vectors, projectors, vectors).min(axis=1) >= SAME_DIRECTION**2
        vectors = np.where(is_common[:, None], vectors, 0.0)
        np.add.at(span, block.local, (vectors @ vectors.transpose(0, 2, 1))[:, None])
    return eigenspaces(held - held @ eigenspaces(span, 0.5) @ held, 0.5)


def _values_at(points_and_values: tuple[Array, AnyArray], positions: Array) -> AnyArray:
    """Return the values (m, ...) at the known points nearest to `positions` (m, dim).

    `points_and_values` are the k known points (k, dim) [length], and their values (k, ...).
    """
    points, values = points_and_values
    return np.asarray(values[nearest(points, positions)[1]])
