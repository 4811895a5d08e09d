"""The base of all contact formulations: from the configuration of a pair to its constraints."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.neighbours import nearest
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.cohesive_layer import bonded
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.constraints import Compliance, Constraints
from fastcontact.contact.held_motions import TOGETHER, HeldMotions, alike, spanned, without
from fastcontact.contact.linearised_geometry import (
    Closing,
    Geometry,
    InterpolatedNormals,
    NodalNormals,
    PointForces,
    Slips,
    faced,
)
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.overclosure import OverclosureLaw
from fastcontact.contact.pair_options import PairOptions
from fastcontact.contact.pairing import Candidates, Pairing, gap_rows, normals, pair, rows_along, tangents
from fastcontact.contact.prescribed_normals import Normals, checked_normals, opposed
from fastcontact.contact.projection import at_nodes_of_facets, interpolated, nodal_normals, places, smooth_normals
from fastcontact.contact.search.closest import BESIDE
from fastcontact.contact.surface import Surface
from fastcontact.contact.surface_smoothing import Smoothing, frames
from fastcontact.contact.tied import TiedPair, moments_of, reduction, tied, with_arms
from fastcontact.errors import ContactError, unknown
from fastcontact.round_off import LENGTH_ROUND_OFF, TINY

SLIPS = ("symmetric", "primary")
# In 3D a body that slides leaves edges and planes of symmetry node by node, each at this overhang in facet lengths;
# nodes that are dropped earlier alternate between in and out.
LEAVING = 0.5
# Sine of the angle to a plane of symmetry above which a surface has a corner there.
LEANING = 0.38


@dataclass(eq=False)
class Formulation(ABC):
    """A contact formulation bound to one pair of surfaces; instances are immutable.

    Subclasses are dataclasses; their further fields are options of the formulation.

    Parameters
    ----------
    secondary : Surface
    primary : Surface or RigidSide
    points : ndarray (n_points, dim)
        Reference coordinates [length].
    axisymmetric : bool
        Integrals run over the full circle.
    modulus : float
        Typical stiffness of the bodies, E / (1 - nu^2) [pressure].
    friction : float
        Coefficient of Coulomb friction, zero for none [-].
    projection_tolerance : float, optional
        Largest distance beyond the end of the primary side at which a point is still paired, in facet lengths. Small by
        default, so that points at the very end do not alternate as the bodies strain; half a facet in 3D, where sliding
        bodies leave edges and planes of symmetry point by point.
    normals : str or sequence of float, optional
        Normals along which the gap is measured. ``"facet"``: normal of the primary facet at the projection; ``"averaged"``:
        interpolated between nodal means. By default the former in 2D without `surface_smoothing`, and the latter in 3D,
        where the pairing of a point opposite an edge may not converge. ``"secondary"``: opposite to the mean normal
        of the secondary side at the point. A vector (dim,) of any length: one normal for the whole primary side, out of its
        body; points are projected along it.
    slip : str
        ``"symmetric"``: closing a gap along the mean of both sides' normals is no slip. ``"primary"``: slip is all relative
        displacement along the tangents to the primary side, also while a gap closes obliquely, as in code_aster.
    surface_smoothing : bool
        Whether to measure the gap between the smooth surfaces that straight facets of curved sides approximate, see
        `surface_smoothing`; the default for mortar.
    options : PairOptions
        Options of the pair that do not depend on its formulation, e.g. its clearance.
    held : HeldMotions, optional
        Directions in which supports and multi-point constraints hold single nodes, where they are known.
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
    held: HeldMotions | None = field(default=None, repr=False)

    name: ClassVar[str]
    # Pair again after every active-set iteration (True), or after the active set has settled (False).
    geometry_in_loop: ClassVar[bool]
    against_obstacles: ClassVar[bool] = True

    def __post_init__(self) -> None:
        if self.normals is None:
            self.normals = "facet" if self.points.shape[1] == 2 and not self.surface_smoothing else "averaged"
        self.normals = checked_normals(self.normals, self.points, self.primary)
        if self.slip not in SLIPS:
            raise ContactError(unknown("kind of slip", self.slip, SLIPS))
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise ContactError(f"the coefficient of friction {self.friction} must be a number >= 0")
        if self.projection_tolerance is None:
            self.projection_tolerance = BESIDE if self.points.shape[1] == 2 else LEAVING
        if not self.projection_tolerance >= 0:
            raise ContactError(f"projection_tolerance = {self.projection_tolerance} must not be negative")
        if self.surface_smoothing and not isinstance(self.primary, Surface):
            raise ContactError(
                "surface_smoothing corrects two meshed sides against each other: leave it out at an obstacle"
            )
        if self.friction:
            self.secondary = self._mirrored(self.secondary)
            self.primary = self._mirrored(self.primary) if isinstance(self.primary, Surface) else self.primary

    @cached_property
    def smoothing(self) -> Smoothing | None:
        """The smooth surfaces of both sides; None without smoothing, on flat sides, and with one normal for all points."""
        if not self.surface_smoothing or self.options.tied or not isinstance(self.primary, Surface):
            return None
        if not isinstance(self.normals, str):
            return None
        return Smoothing.of(self.secondary, self.primary, self.points)

    @property
    def slides(self) -> bool:
        """Whether tangential motion matters: friction, tying or cohesion."""
        cohesion = self.options.cohesion
        return bool(self.friction) or self.options.tied or not (cohesion is None or cohesion.reversible)

    @property
    def eliminable(self) -> bool:
        """Whether iterative solvers can eliminate closed constraints; penalties do not prevent it, since they are springs."""
        return True

    @property
    def faceted(self) -> bool:
        """Whether normals are those of single facets, so that the pairing of points may alternate between two."""
        return isinstance(self.primary, Surface) and self.normals == "facet" and not self.options.tied

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Return the class that implements this formulation in 2 or 3 dimensions with the options of a user."""
        return cls

    @abstractmethod
    def unilateral(self, at: Configuration) -> Constraints:
        """Pair the two sides and return constraints that may open and close, without penalty."""

    def constraints(self, at: Configuration) -> Constraints:
        """Pair the two sides and return the constraints of the pair's kind of contact.

        Raises
        ------
        ContactError
            If the pair has a penalty, and the constraints of its formulation have no areas.
        """
        if self.tied is not None:
            return self.tied.constraints()
        constraints = self.unilateral(at)
        if self.options.cohesion is None:
            constraints = self._softened(constraints, at)
        if at.elastic_slip is not None and constraints.tangents:
            before = _at_places(at.elastic_slip, constraints.positions)
            given = np.stack([-np.einsum("md,md->m", t, before) for t in constraints.directions])
            constraints = replace(constraints, elastic_slip=given)
        if constraints.friction is not None and at.friction_factor != 1.0:
            constraints = replace(constraints, friction=at.friction_factor * constraints.friction)
        if self.options.gap_only:
            return constraints.without(np.ones(len(constraints), bool))
        if self.options.search_distance is not None:
            # Also at the beginning of the step: a penetration that only this iterate produces must not be ignored.
            away = np.minimum(np.abs(constraints.gaps(at.displacement)), np.abs(constraints.gaps(at.start)))
            constraints = constraints.without(away > self.options.search_distance)
        if self.options.cohesion is not None:
            return bonded(
                self.options.cohesion, constraints, at, _at_places(self._gaps_as_they_lie, constraints.positions)
            )
        constraints = replace(constraints, equality=self.never_opening(constraints.positions, at))
        if self.options.source is None:
            return constraints
        from fastcontact.contact.fluid_pressure import AreaVectors, wetted

        areas = AreaVectors(self.secondary, self.points, self.axisymmetric)
        return wetted(constraints, at, areas, self.options.source[self.secondary.points])

    def _softened(self, constraints: Constraints, at: Configuration) -> Constraints:
        """Return constraints with the compliance of normal and tangential penalties, if any."""
        normal, tangential, areas = self.options.penalty, self.options.tangential_penalty, constraints.areas
        if normal is None and tangential is None:
            return constraints
        if areas is None:
            raise ContactError(f"formulation '{self.name}' supports no penalty: leave out the option")
        if isinstance(normal, OverclosureLaw):
            slope, without = normal.line(-constraints.gaps(at.displacement))
            constraints = replace(
                constraints, gap0=constraints.gap0 + without, softness=1.0 / (slope * areas), law=normal
            )
        elif normal is not None:
            constraints = replace(constraints, softness=np.asarray(1.0 / (normal * areas)))
        if tangential is None or not constraints.tangents:
            return constraints
        return replace(constraints, tangential_softness=1.0 / (tangential(constraints.positions) * areas))

    @cached_property
    def _gaps_as_they_lie(self) -> tuple[Array, Array]:
        """Positions (m, dim) of constraints on the undeformed bodies, and their gaps (m,) [length]."""
        constraints = self.unilateral(Configuration.undeformed(self.points))
        return constraints.positions, constraints.gap0

    @cached_property
    def tied(self) -> TiedPair | None:
        """The equations of a tied pair, on the undeformed bodies."""
        if not self.options.tied:
            return None
        constraints = self.unilateral(Configuration.undeformed(self.points))
        if isinstance(self.primary, Surface) and constraints.tangents:
            smooth = self.normals if self.normals != "secondary" and self.normals is not None else "facet"
            pairing = pair(constraints.positions, self.primary, self.points, np.inf, smooth)
            constraints = with_arms(constraints, pairing, self.primary, self.points)
        moments, areas = moments_of(constraints)
        return tied(constraints, moments, areas, self._tied_at_supports(constraints, moments, areas))

    def _tied_at_supports(self, constraints: Constraints, moments: csr_array, areas: Array | None) -> csr_array | None:
        """Return the `reduction` of the multipliers of a tied pair; None where supports hold no node on both sides."""
        held = self._held_on_both_sides(Configuration.undeformed(self.points))
        if held is None or not constraints.tangents:
            return None
        nodes = self.nodes_of(constraints, moments)
        frames = [moments @ direction for direction in (normals(constraints.directions), *constraints.directions)]
        axes = np.stack(frames, axis=1)
        axes /= np.maximum(np.linalg.norm(axes, axis=2, keepdims=True), TINY)
        sizes = np.ones(len(nodes)) if areas is None else np.where(np.isfinite(areas), areas, 0.0)
        return reduction(
            axes, np.where(sizes[:, None, None] > 0.0, held[nodes], 0.0), nodes, sizes, self.secondary.beside
        )

    def nodes_of(self, constraints: Constraints, moments: csr_array) -> Indices:
        """Return the secondary node (q,), as an index on its side, of each row of the `moments_of` constraints (q, m)."""
        points = self.secondary.points
        if constraints.nodes is None:
            return np.arange(len(points))
        order = np.argsort(points)
        return np.asarray(order[np.searchsorted(points, constraints.nodes[: moments.shape[0]], sorter=order)])

    def never_opening(self, positions: Array, at: Configuration) -> Mask | None:
        """Return which constraints, by reference position (m, dim) [length], do not separate (m,); None if all may."""
        if self.options.always_closed:
            return np.ones(len(positions), bool)
        if at.never_opening is None:
            return None
        return np.asarray(_at_places(at.never_opening, positions))

    def facing(self, candidates: Candidates, at: Configuration, tolerance: float | None = None) -> Pairing:
        """Return the pairing of candidates on the deformed configuration, by the options of the pair.

        `tolerance` replaces `projection_tolerance` where given.
        """
        deformed = self.points + at.displacement
        beyond = self.projection_tolerance if tolerance is None else tolerance
        assert self.normals is not None
        assert beyond is not None
        positions = candidates.positions(deformed)
        pairing = pair(positions, self.primary, deformed, beyond, self.normals, at.pose, at.rounded)
        if self.normals != "secondary":
            return pairing
        return opposed(pairing, self._secondary_normals(candidates, deformed))

    def _secondary_normals(self, candidates: Candidates, deformed: Array) -> Array:
        """Return unit means (n, dim) of the secondary facets' normals at candidates."""
        local = np.zeros(len(deformed), np.intp)
        local[self.secondary.points] = np.arange(len(self.secondary.points))
        normal = np.einsum(
            "nk,nkd->nd", candidates.shape, nodal_normals(self.secondary, deformed)[local[candidates.nodes]]
        )
        return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), TINY))

    def assembled(
        self, candidates: Candidates, pairing: Pairing, compliance: Compliance | None, at: Configuration
    ) -> Constraints:
        """Return the constraints of paired candidates, with tangential rows where there is friction."""
        B, gap0 = gap_rows(candidates, pairing, self.primary, self.points)
        gap0 += self.added_gap(candidates, pairing, at) - self.overlap_of_smooth(candidates, pairing, at)
        positions = candidates.positions(self.points)
        if not self.slides:
            geometry = self._geometry(candidates, pairing, at)
            return Constraints(B, gap0, positions, compliance, geometry=geometry)
        directions, rubbing = self.options.rubbing(tangents(pairing.normal, self._held_at(candidates)), candidates)
        along, slip0 = self.slips(candidates, pairing, rubbing, at)
        friction = self.options.coefficients(self.friction, candidates)
        geometry = self._geometry(candidates, pairing, at, directions)
        return Constraints(B, gap0, positions, compliance, along, directions, friction, slip0, geometry=geometry)

    def _held_at(self, candidates: Candidates) -> Array | None:
        """Return projectors (n, dim, dim) on the directions in which all nodes of candidates are held; None without any."""
        if self.held is None or not len(self.held.nodes) or not self.friction:
            return None
        return spanned(
            np.einsum("nk,nkde->nde", candidates.shape, self.held.at(candidates.nodes)), 1.0 - LENGTH_ROUND_OFF
        )

    def _geometry(
        self, candidates: Candidates, pairing: Pairing, at: Configuration, directions: Sequence[Array] = ()
    ) -> Geometry | None:
        """Return how gaps of paired candidates, and slips along tangents (n, dim), vary; None for secondary normals."""
        if self.normals == "secondary":
            return None
        coordinates = self.points + at.displacement

        def linearised(multiplier: Array, tangential: Array, displacement: Array) -> PointForces:
            rows = np.flatnonzero(pairing.paired & (multiplier != 0.0))
            points = faced(candidates, pairing, rows, self.primary, coordinates, self.normals, at.pose)
            forces = PointForces(points, rows, len(multiplier), multiplier[rows])
            if not directions:
                return forces
            moved = replace(at, displacement=displacement)
            slips = self._sliding(points.motion, np.stack(directions)[:, rows], tangential[rows], moved)
            if not isinstance(self.primary, Surface) or self.slip != "symmetric":
                return replace(forces, slips=slips)
            averaged, smooth = points.averaged, None
            if averaged is None:
                place = pairing.places(self.primary, rows)
                averaged = InterpolatedNormals.smooth(self.primary, coordinates, pairing.facet[rows], place)
                smooth = averaged, averaged.bend(place.gradient)
            local = np.zeros(len(coordinates), np.intp)
            local[self.secondary.points] = np.arange(len(self.secondary.points))
            nodal = NodalNormals(self.secondary, coordinates)
            opposite = InterpolatedNormals(nodal, local[candidates.nodes[rows]], candidates.shape[rows])
            closing = Closing.of(averaged.normal, opposite, points.motion @ slips.start)
            slips = replace(slips, total=slips.total + closing.vector, closing=closing)
            return replace(forces, slips=slips, smooth=smooth)

        return linearised

    def _sliding(self, mean: csr_array, directions: Array, tangential: Array, at: Configuration) -> Slips:
        """Return the slips due to the relative motion `mean` (m, n_points) and an obstacle's, along tangents (k, m, dim)."""
        moved, turning = at.displacement - at.start, None
        total = mean @ moved
        if isinstance(self.primary, RigidSide):
            total -= at.obstacle - at.obstacle_start
            now, before = (mean @ (self.points + u) for u in (at.displacement, at.start))
            turned = self.primary.turning(now, before, at.pose, at.pose_start)
            if turned is not None:  # it is affine in the positions
                ends = np.vstack([np.zeros(now.shape[1]), np.eye(now.shape[1])])
                varied = self.primary.turning(ends, ends[:1], at.pose, at.pose_start)
                assert varied is not None
                total, turning = total - turned, varied[1:] - varied[0]
        return Slips(directions, tangential, total, moved, self.points + at.start, turning=turning)

    def slips(
        self, candidates: Candidates, pairing: Pairing, directions: Sequence[Array], at: Configuration
    ) -> tuple[tuple[csr_array, ...], Array | None]:
        """Return rows (n, n_dofs) of the slip of candidates along k tangents (n, dim), and its constant part (k, n).

        The latter is the motion of a rigid primary side in the step, or minus the part that closes a gap [length]; None
        for zero.
        """
        along = tuple(rows_along(t, candidates, pairing, self.primary, self.points.size) for t in directions)
        slip0: Array | None = None
        if isinstance(self.primary, RigidSide):
            slip0 = -np.stack([t @ (at.obstacle - at.obstacle_start) for t in directions])
            turning = self.turning(candidates, at)
            if turning is not None:
                slip0 -= np.stack([np.einsum("nd,nd->n", t, turning) for t in directions])
        elif self.slip == "symmetric":
            slip0 = self._closing_slip(candidates, pairing, directions, at)
        return along, slip0

    def added_gap(self, candidates: Candidates, pairing: Pairing, at: Configuration) -> Array:
        """Return the contribution of clearances and wear to the gaps (n,) of candidates, zero if unpaired [length]."""
        added = self.options.added_gap(candidates, pairing, self.primary, self.points, at.clearance_factor)
        if at.worn is None:
            return added
        return added + np.where(pairing.paired, np.einsum("nk,nk->n", candidates.shape, at.worn[candidates.nodes]), 0.0)

    def overlap_of_smooth(self, candidates: Candidates, pairing: Pairing, at: Configuration) -> Array:
        """Return the reduction of the gaps (n,) of candidates by the smooth surfaces above their facets [length]."""
        closer, rows = np.zeros(len(pairing.paired)), np.flatnonzero(pairing.paired)
        if (
            self.smoothing is None
            or candidates.facet is None
            or candidates.xi is None
            or not isinstance(self.primary, Surface)
        ):
            return closer
        deformed = self.points + at.displacement
        axes = [frames(side, self.points, deformed) for side in (self.secondary, self.primary)]
        on_secondary, on_primary = (
            (candidates.facet[rows], candidates.xi[rows]),
            (pairing.facet[rows], pairing.xi[rows]),
        )
        closer[rows] = self.smoothing.overlap(on_secondary, on_primary, axes)
        return closer

    def turning(self, candidates: Candidates, at: Configuration) -> Array | None:
        """Return the displacement (n, dim) due to obstacle rotation of the points faced by candidates [length], or None."""
        assert isinstance(self.primary, RigidSide)
        now, before = (candidates.positions(self.points + u) for u in (at.displacement, at.start))
        return self.primary.turning(now, before, at.pose, at.pose_start)

    @cached_property
    def _held_nodes(self) -> Indices:
        """The secondary nodes that supports hold, as indices on the side."""
        return np.flatnonzero(np.isin(self.secondary.points, () if self.held is None else self.held.nodes))

    def _opposite_held(self, nodes: Indices, at: Configuration) -> tuple[Pairing, Array]:
        """Return what secondary `nodes` (n,) face, and the mean projectors (n, dim, dim) on what is held there."""
        assert self.held is not None
        candidates = Candidates(self.secondary.points[nodes][:, None], np.ones((len(nodes), 1)))
        pairing = self.facing(candidates, at, max(self.projection_tolerance or 0.0, BESIDE))
        theirs = np.zeros((len(nodes), *2 * self.points.shape[1:]))
        if isinstance(self.primary, Surface):
            rows = np.flatnonzero(pairing.paired)
            facing = places(self.primary, pairing.facet[rows], pairing.xi[rows])
            theirs[rows] = np.einsum("nk,nkde->nde", facing.shape, self.held.at(facing.nodes))
        return pairing, theirs

    def _held_on_both_sides(self, at: Configuration) -> Array | None:
        """Return projectors (n_nodes, dim, dim) on directions in which both sides are held; None without any.

        Facets all of whose nodes are held are left out.
        """
        nodes = self._held_nodes
        if not len(nodes) or self.held is None:
            return None
        ours, (_, theirs) = self.held.at(self.secondary.points[nodes]), self._opposite_held(nodes, at)
        held = np.zeros((len(self.secondary.points), *ours.shape[1:]))
        held[nodes] = spanned(ours @ theirs @ ours, 0.5)
        held = _without_whole_facets(held, self.secondary)
        return held if held.any() else None

    def without_slip(self, at: Configuration) -> list[tuple[Array, Mask]]:
        """Return directions (n_nodes, dim) in which both sides are held without relative motion, with the nodes (n_nodes,).

        This is the case in a plane of symmetry and on an axis: slip is zero there for every traction, so that the traction is
        undetermined. Where one side is free, or driven past the other, friction acts. Facets with all nodes held are
        left out.
        """
        nodes = self._held_nodes
        if not len(nodes) or self.held is None:
            return []
        pairing, held_opposite = self._opposite_held(nodes, at)
        points = self.secondary.points[nodes]
        both, moved = self.held.at(points), (at.displacement - at.start)[points]
        if isinstance(self.primary, RigidSide):
            moved = moved - (at.obstacle - at.obstacle_start)
            turning = self.turning(Candidates(points[:, None], np.ones((len(nodes), 1))), at)
            moved = moved if turning is None else moved - turning
        else:
            rows = np.flatnonzero(pairing.paired)
            facing = places(self.primary, pairing.facet[rows], pairing.xi[rows])
            held, motion = self.held.at(facing.nodes), (at.displacement - at.start)[facing.nodes]
            mean = np.einsum("nk,nkd->nd", facing.shape, motion)
            # Where an inclined normal leads slightly past a held node, the motion of the other nodes there is ignored.
            beside = np.einsum("nk,nkde,nkd->ne", facing.shape, held, motion - mean[:, None])
            moved[rows] -= mean + np.einsum("nde,ne->nd", np.linalg.pinv(held_opposite[rows], hermitian=True), beside)
            both = spanned(both @ held_opposite @ both, 0.5)
        along = np.einsum("nde,ne->nd", both, pairing.normal)
        both = without(both, pairing.normal, np.sqrt(0.5))
        # Closing is no slip where the normal is held, too. Elsewhere it may be inclined, as at the edge of a plane of
        # symmetry.
        closing = np.where(
            np.linalg.norm(along, axis=1) > np.sqrt(0.5), np.einsum("nd,nd->n", moved, pairing.normal), 0.0
        )
        moved -= closing[:, None] * pairing.normal
        both = without(both, moved, LENGTH_ROUND_OFF * max(np.abs(at.displacement).max(), np.abs(at.start).max()))
        held = np.zeros((len(self.secondary.points), *both.shape[1:]))
        held[nodes] = both
        return alike(_without_whole_facets(held, self.secondary), self.points[self.secondary.points])

    def _mirrored(self, side: Surface) -> Surface:
        """Return a side whose averaged normals are those of the full model where its edge is held in a plane of symmetry."""
        if self.held is None or not np.isin(side.points, self.held.nodes).any():
            return side
        held = _without_whole_facets(self.held.at(side.points), side)
        normal = nodal_normals(side, self.points)
        across = np.linalg.norm(np.einsum("nde,ne->nd", held, normal), axis=1)
        nodes = np.flatnonzero(held.any(axis=(1, 2)) & (across < LEANING))
        reflections = np.eye(self.points.shape[1]) - 2.0 * held[nodes]
        return replace(side, periodic_ends=(*side.periodic_ends, (nodes, nodes, reflections)))

    def _closing_slip(
        self, candidates: Candidates, pairing: Pairing, directions: Sequence[Array], at: Configuration
    ) -> Array:
        """Return the slip (k, n) to add so that closing a gap causes none where the normal is inclined.

        On curved surfaces, above all at the edge of the contact, the normal of one side is inclined to the direction in which
        the gap closes, and a component of the closing motion would count as slip. Along the mean of both sides' normals,
        mirrored bodies close their gaps without slip.
        """
        assert isinstance(self.primary, Surface)
        deformed, start = self.points + at.displacement, self.points + at.start
        slip0 = np.zeros((len(directions), len(pairing.paired)))
        rows = np.flatnonzero(pairing.paired)
        facing = places(self.primary, pairing.facet[rows], pairing.xi[rows])
        nodes, shape = candidates.nodes[rows], candidates.shape[rows]
        primary_normals = at_nodes_of_facets(smooth_normals(self.primary, deformed))[pairing.facet[rows]]
        primary_normals = interpolated(primary_normals, facing)
        mean = primary_normals - self._secondary_normals(Candidates(nodes, shape), deformed)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > LENGTH_ROUND_OFF)
        offset = np.einsum("nk,nkd->nd", shape, start[nodes])
        offset -= np.einsum("nk,nkd->nd", facing.shape, start[facing.nodes])
        opening = np.einsum("nd,nd->n", mean, offset)
        for k, along in enumerate(directions):
            slip0[k, rows] = np.einsum("nd,nd->n", along[rows], mean) * opening
        return slip0

    def first_contact(self, at: Configuration) -> tuple[Array, Array]:
        """Return the point of first contact [length], and the normal faced there [-], both (dim,).

        The secondary node with the smallest gap before any displacement of the bodies; of equally close ones that nearest to
        the origin.
        """
        positions = self.points[self.secondary.points]
        gap, normal = self.nodal_gap(replace(at, displacement=np.zeros_like(self.points)))
        close = np.flatnonzero(gap <= gap.min() + LENGTH_ROUND_OFF * np.ptp(positions, axis=0).max())
        first = close[np.argmin(np.linalg.norm(positions[close], axis=1))]
        return positions[first], normal[first]

    def nodal_gap(
        self, at: Configuration, with_clearance: bool = True, displacement: Array | None = None
    ) -> tuple[Array, Array]:
        """Return the gaps (n_nodes,) of the secondary nodes [length], and the normals (n_nodes, dim) that they face [-].

        Infinite where a node faces no primary facet. Clearances are included unless `with_clearance` is False. Where
        `displacement` (n_points, dim) is given, the gaps are those at this displacement in the pairing of `at` [length].
        """
        nodes = Candidates.nodes_of(self.secondary)
        pairing = self.facing(nodes, at, max(self.projection_tolerance or 0.0, BESIDE))
        G, gap0 = gap_rows(nodes, pairing, self.primary, self.points)
        gap0 -= self.overlap_of_smooth(nodes, pairing, at)
        if with_clearance:
            gap0 += self.added_gap(nodes, pairing, at)
        u = at.displacement if displacement is None else displacement
        return np.where(pairing.paired, gap0 + G @ u.ravel(), np.inf), pairing.normal


def _without_whole_facets(held: Array, side: Surface) -> Array:
    """Return projectors (n_nodes, dim, dim) without the directions in which all nodes of a facet of a side are held."""
    span = np.zeros_like(held)
    for block in side.blocks:
        around = held[block.local]
        vectors = np.linalg.eigh(around.mean(axis=1))[1]
        least = np.einsum("fdk,fnde,fek->fnk", vectors, around, vectors).min(axis=1) >= TOGETHER**2
        vectors = np.where(least[:, None], vectors, 0.0)
        np.add.at(span, block.local, (vectors @ vectors.transpose(0, 2, 1))[:, None])
    return spanned(held - held @ spanned(span, 0.5) @ held, 0.5)


def _at_places(known: tuple[Array, AnyArray], positions: Array) -> AnyArray:
    """Return `known` values (k, ...) at the point (k, dim) [length] nearest to each of `positions`."""
    places_before, values = known
    return np.asarray(values[nearest(places_before, positions)[1]])
