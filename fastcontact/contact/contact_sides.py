"""The two sides of a contact pair, and the pairing, the gaps and the slips of points of the secondary side."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array

from fastcontact.arrays import Array, Indices, Mask, numbers_at
from fastcontact.contact.configuration import Configuration
from fastcontact.contact.held_motions import HeldMotions, reflected, symmetry_planes
from fastcontact.contact.linearised_projections import ObstaclePoints, Points, SurfacePoints
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pair_options import PairOptions
from fastcontact.contact.pairing import (
    FACING,
    OVERHANG,
    Candidates,
    Normals,
    Pairing,
    checked_normals,
    gap_rows,
    pair,
    relative_motion,
    tangents,
)
from fastcontact.contact.projection import SMALL_OVERHANG, interpolate
from fastcontact.contact.surface import Surface
from fastcontact.contact.surface_smoothing import Smoothing
from fastcontact.errors import ContactError, unknown
from fastcontact.linear.sparse_rows import rows_of, shapes_at
from fastcontact.mesh import elements
from fastcontact.mesh.area_vectors import unit_vectors
from fastcontact.round_off import LENGTH_ROUND_OFF

SLIPS = ("symmetric", "primary")


@dataclass(eq=False)
class ContactSides:
    """The two sides of a contact pair, and options of their geometry, which are described in `Formulation`."""

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
            raise ContactError("surface_smoothing needs two meshed sides: omit it for an obstacle")
        if self.friction:
            secondary, primary = self.secondary, self.primary
            self.secondary = reflected(secondary, self.held_motions, self.points, primary.points)
            if isinstance(primary, Surface):
                self.primary = reflected(primary, self.held_motions, self.points, secondary.points)
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

    @cached_property
    def smallest_node_spacing(self) -> float:
        """Smallest diameter of the facets, divided by the order of their shape functions [length]."""
        blocks = self.secondary.blocks
        return float(min(b.diameters(self.points).min() / elements.get(b.element).order for b in blocks))

    @cached_property
    def held_nodes(self) -> Indices:
        """The secondary nodes that supports hold, numbered within the side."""
        held = () if self.held_motions is None else self.held_motions.nodes
        return np.flatnonzero(np.isin(self.secondary.points, held))

    def pair_candidates(self, candidates: Candidates, config: Configuration, tolerance: float | None = None) -> Pairing:
        """Return the pairing of candidates in the deformed configuration, with the options of the formulation.

        If `tolerance` is given, it replaces `projection_tolerance`.
        """
        largest_overhang = (self.projection_tolerance or 0.0) if tolerance is None else tolerance
        assert self.normals is not None
        positions = candidates.positions(self.points + config.displacement)
        primary = self.primary if isinstance(self.primary, RigidSide) else config.deformed(self.primary, self.points)
        pairing = pair(positions, primary, largest_overhang, self.normals, config.pose, config.rounded)
        if self.normals != "secondary":
            return pairing
        normals = self._secondary_normals(candidates, config)
        is_facing = np.einsum("nd,nd->n", pairing.normal, normals) < -FACING
        normal = np.where(is_facing[:, None], -normals, pairing.normal)
        return replace(pairing, normal=normal, paired=pairing.paired & is_facing)

    @cached_property
    def number_on_side(self) -> Indices:
        """Number (n_points,) of each secondary node on its side; -1 for other points."""
        return numbers_at(self.secondary.points, len(self.points))

    def _secondary_normals(self, candidates: Candidates, config: Configuration) -> Array:
        """Return averaged unit normals (n, dim) of the secondary side at candidates."""
        nodal_normals = config.deformed(self.secondary, self.points).nodal_normals
        at_nodes = nodal_normals[self.number_on_side[candidates.nodes]]
        return unit_vectors(np.einsum("nk,nkd->nd", candidates.shape, at_nodes))

    def slip_at_rest(
        self, candidates: Candidates, pairing: Pairing, directions: Sequence[Array], config: Configuration
    ) -> Array:
        """Return the part (k, n) of the slips of candidates in the load step that does not depend on displacements [length].

        It is the negative of the motion of a rigid primary side in the step. Between two bodies, if `slip` is
        ``"symmetric"``, it is the negative of the tangential displacement that closes the gap. On curved surfaces, in
        particular at the edge of the contact, the normal of the primary side is inclined to the direction in which the gap
        closes, so that without this correction a component of the closing motion would count as slip. The gap is assumed to
        close along the mean normal of the two sides, which is exact for two bodies that are mirror images. `directions` are k
        unit tangents (n, dim).
        """
        if isinstance(self.primary, RigidSide):
            obstacle_motion = self.rigid_motion(candidates.positions, config)
            return -np.stack([np.einsum("nd,nd->n", t, obstacle_motion) for t in directions])
        slip0, rows = np.zeros((len(directions), len(pairing.paired))), pairing.rows
        if self.slip != "symmetric":
            return slip0
        start, feet = self.points + config.start, pairing.feet
        nodes, shape = candidates.nodes[rows], candidates.shape[rows]
        primary = config.deformed(self.primary, self.points)
        mean = interpolate(primary.smooth_normals[pairing.facet[rows]], feet)
        mean -= self._secondary_normals(Candidates(nodes, shape), config)
        length = np.linalg.norm(mean, axis=1, keepdims=True)
        mean = np.divide(mean, length, out=np.zeros_like(mean), where=length > LENGTH_ROUND_OFF)
        offset = np.einsum("nk,nkd->nd", shape, start[nodes])
        offset -= np.einsum("nk,nkd->nd", feet.shape, start[feet.nodes])
        initial_gap = np.einsum("nd,nd->n", mean, offset)
        for slip, direction in zip(slip0, directions, strict=True):
            slip[rows] = np.einsum("nd,nd->n", direction[rows], mean) * initial_gap
        return slip0

    def added_gap(self, candidates: Candidates, pairing: Pairing, config: Configuration) -> Array:
        """Return the contribution (n,) of clearances and wear to the gaps of candidates; zero if unpaired [length]."""
        added, rows, options = np.zeros(len(candidates.nodes)), pairing.rows, self.options
        nodes, shape = candidates.nodes[rows], candidates.shape[rows]
        if options.clearance is not None and len(rows):
            added[rows] += options.clearance(np.einsum("nk,nkd->nd", shape, self.points[nodes]))
        if options.clearance_primary is not None and isinstance(self.primary, Surface) and len(rows):
            feet_positions = np.einsum("nk,nkd->nd", pairing.feet.shape, self.points[pairing.feet.nodes])
            added[rows] += options.clearance_primary(feet_positions)
        added *= config.clearance_factor
        if config.wear_depth is not None:
            added[rows] += np.einsum("nk,nk->n", shape, config.wear_depth[nodes])
        return added

    def gaps(
        self, candidates: Candidates, pairing: Pairing, config: Configuration
    ) -> tuple[csr_array, csr_array, Array]:
        """Return the `relative_motion` (n, n_points) of candidates, and G and gap0 of their gaps ``gap0 + G @ u``.

        G (n, n_points * dim) [-] contains the derivatives of the gaps with respect to the displacements, and gap0 (n,)
        [length] includes the correction for smooth surfaces, if these are used. The candidates must then have facets and
        reference coordinates.
        """
        motion = relative_motion(candidates, pairing, len(self.points))
        (G, gap0), added_gap = gap_rows(motion, pairing, self.points), self.added_gap(candidates, pairing, config)
        if self.smoothing is not None:
            rows = pairing.rows
            on_secondary, on_primary = ((side.facet[rows], side.xi[rows]) for side in (candidates, pairing))
            added_gap[rows] -= self.smoothing.overlap(on_secondary, on_primary, self.points + config.displacement)
        return motion, G, gap0 + added_gap

    def linearised_points(
        self, candidates: Candidates, pairing: Pairing, rows: Indices, config: Configuration, normals: object,
        closest: bool = False,
    ) -> Points:  # fmt: skip
        """Return the linearised projections of the candidates with the numbers `rows` (n,) onto the primary side.

        They refer to smooth surfaces, if these are used. `normals` and `closest` apply to meshed primary sides, see
        `SurfacePoints`.
        """
        if isinstance(self.primary, RigidSide):
            shapes = shapes_at(candidates.shape[rows], candidates.nodes[rows], len(self.points))
            return ObstaclePoints(shapes, self.primary, self.points + config.displacement, config.pose)
        slope, smoothing, primary = None, self.smoothing, config.deformed(self.primary, self.points)
        if smoothing is not None:
            axes = smoothing.frames(self.points + config.displacement)
            factor = smoothing.height_factors(candidates.facet[rows], pairing.facet[rows], axes)[:, 1:]
            slope = factor * smoothing.primary.slope(pairing.facet[rows], pairing.xi[rows])
            if pairing.overhang_xi is not None:  # The extensions of facets are straight.
                slope = np.where(pairing.overhang_xi[rows] == 0.0, slope, 0.0)
        return SurfacePoints(candidates, pairing, rows, primary, normals, closest, slope)

    def rigid_motion(self, positions: Callable[[Array], Array], config: Configuration) -> Array:
        """Return the displacements (n, dim) in the step of the obstacle points opposite to n points [length].

        `positions` is the function from the coordinates (n_points, dim) of all nodes to those of the points.
        """
        assert isinstance(self.primary, RigidSide)
        current, initial = (positions(self.points + u) for u in (config.displacement, config.start))
        return self.primary.rigid_motion(current, initial, config.pose, config.pose_start)

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

    def nodal_gap(self, config: Configuration, displacement: Array | None = None) -> tuple[Array, Array]:
        """Return the gaps of the secondary nodes, and the normals of the primary side opposite these nodes.

        Parameters
        ----------
        config : Configuration
            Positions of both sides at which the nodes are paired.
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
        _, G, gap0 = self.gaps(nodes, pairing, config)
        u = config.displacement if displacement is None else displacement
        return np.where(pairing.paired, gap0 + G @ u.ravel(), np.inf), pairing.normal

    def nodal_slip(self, config: Configuration) -> Array:
        """Return the slips (n_nodes, dim) of the secondary nodes in the load step, as vectors [length].

        Nodes beyond the end of the primary side are included, because parts of their facets may carry pressure.
        """
        nodes = self.node_candidates
        pairing = self.pair_candidates(nodes, config, np.inf)
        directions = tangents(pairing.normal)
        motion = relative_motion(nodes, pairing, len(self.points))
        slip0, increment = self.slip_at_rest(nodes, pairing, directions, config), config.displacement - config.start
        slip = np.zeros_like(pairing.normal)
        for constant, direction in zip(slip0, directions, strict=True):
            slip += (rows_of(motion, direction) @ increment.ravel() + constant)[:, None] * direction
        return np.where(pairing.paired[:, None], slip, 0.0)
