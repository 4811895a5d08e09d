"""What a contact formulation is: constraints from a configuration, nodal pressures from multipliers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from fastcontact.contact.constraints import Compliance, Constraints
from fastcontact.contact.formulations._held_nodes import held_nodes
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.contact.pair_options import Terms
from fastcontact.contact.pairing import Candidates, Pairing, gap_rows, pair, rows_along, tangents
from fastcontact.contact.projection import interpolated, nodal_normals, places
from fastcontact.contact.surface import Surface
from fastcontact.contact.tied import Tie, tie
from fastcontact.errors import ContactError, unknown

Array = NDArray[np.float64]
NORMALS = ("facet", "averaged")
# Nodes on an axis or plane of symmetry stand out a little beyond facets that lean, in facet lengths.
ON_SYMMETRY = 0.05


@dataclass(eq=False)
class Formulation(ABC):
    """A contact formulation bound to one pair of surfaces.

    Sub-classes are dataclasses; their further fields are the options that a user may set by name.

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
        Coefficient of Coulomb friction, zero for none.
    projection_tolerance : float
        How far a point may stand out beyond the end of its facet and still be paired, in facet lengths.
    normals : str, optional
        ``"facet"``: of the primary facet at the projection; ``"averaged"``: interpolated between nodal means. By default
        the former in 2D and the latter in 3D, where a point opposite an edge between facets often flips for ever.
    terms : Terms
        What the pair is asked to do whatever its formulation, e.g. its clearance.

    Attributes
    ----------
    supported : ndarray of bool (n_points, dim), optional
        Components that supports prescribe, where they are known.
    before : ndarray (n_points, dim), optional
        Displacement at the beginning of the step [length]; None stands for zero.
    """

    secondary: Surface
    primary: Surface | RigidSide
    points: Array
    axisymmetric: bool
    modulus: float

    friction: float = 0.0
    projection_tolerance: float = 0.5
    normals: str | None = None
    terms: Terms = field(default_factory=Terms, repr=False)
    supported: NDArray[np.bool_] | None = field(default=None, init=False, repr=False)
    before: Array | None = field(default=None, init=False, repr=False)
    _closed: tuple[Array, NDArray[np.bool_]] | None = field(default=None, init=False, repr=False)

    name: ClassVar[str]
    # Re-pair after every active-set iteration (True), or after the active set has settled (False).
    geometry_in_loop: ClassVar[bool]

    def __post_init__(self) -> None:
        if self.normals is None:
            self.normals = "facet" if self.points.shape[1] == 2 else "averaged"
        if self.normals not in NORMALS:
            raise ContactError(unknown("kind of normals", self.normals, NORMALS))
        if not (np.isfinite(self.friction) and self.friction >= 0):
            raise ContactError(f"the coefficient of friction {self.friction} must be a number >= 0")
        if not self.projection_tolerance >= 0:
            raise ContactError(f"projection_tolerance = {self.projection_tolerance} must not be negative")

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Return the class that does this formulation in 2 or 3 dimensions with the options of a user."""
        return cls

    @abstractmethod
    def constraints(self, displacement: Array) -> Constraints:
        """Pair on the configuration displaced by `displacement` (n_points, dim) and return the constraints."""

    def areas(self) -> Array:
        """Return the area (m,) that each constraint of the last pairing stands for; infinite where it does nothing.

        Raises
        ------
        ContactError
            If constraints of this formulation stand for no areas.
        """
        raise ContactError(f"formulation '{self.name}' knows no penalty: leave out the option")

    def conditions(self, displacement: Array) -> Constraints:
        """Return the constraints as the terms of the pair have them: penalised, held for good, or tied."""
        if self.tie is not None:
            return self.tie.constraints()
        part = self.constraints(displacement)
        softness = None if self.terms.penalty is None else 1.0 / (self.terms.penalty * self.areas())
        return replace(part, held=self.closed_for_good(part.positions), softness=softness)

    @cached_property
    def tie(self) -> Tie | None:
        """The equations of a tied pair, on the bodies as they lie before any load."""
        return tie(self.constraints(np.zeros_like(self.points))) if self.terms.tied else None

    def closed_for_good(self, positions: Array) -> NDArray[np.bool_] | None:
        """Return which places (m,) at reference `positions` (m, dim) never open again; None if all may."""
        if self.terms.always_closed:
            return np.ones(len(positions), bool)
        if self._closed is None:
            return None
        from scipy.spatial import cKDTree

        at, closed = self._closed
        return np.asarray(closed[cKDTree(at).query(positions)[1]])

    def end_step(self, part: Constraints, active: NDArray[np.bool_]) -> None:
        """Take note of the constraints `part` that are closed at the end of a load step."""
        if self.terms.kind == "bilateral_once_closed":
            self._closed = part.positions, active.copy()

    def forces(self, multiplier: Array) -> Array:
        """Return the normal forces (m,) of the formulation's own constraints from the multipliers of `conditions`."""
        return multiplier if self.tie is None else self.tie.forces(multiplier)[0]

    def initially_active(
        self, constraints: Constraints, pressure: Array, displacement: Array
    ) -> NDArray[np.bool_] | None:
        """Return the set to start from, given the last nodal `pressure`; None: constraints are the same as before."""
        return None

    @abstractmethod
    def pressure(self, multiplier: Array) -> Array:
        """Return nodal pressures (n_nodes,) per reference area from the multipliers (m,) [pressure]."""

    @abstractmethod
    def closed_nodes(self, active: NDArray[np.bool_], gap: Array, pressure: Array) -> NDArray[np.bool_]:
        """Return which secondary nodes are in contact, from the active constraints and the nodal gap and pressure."""

    def assembled(
        self, candidates: Candidates, pairing: Pairing, compliance: Compliance | None, deformed: Array
    ) -> Constraints:
        """Return the constraints of candidates paired at `deformed`, with tangential rows where there is friction."""
        B, gap0 = gap_rows(candidates, pairing, self.primary, self.points)
        gap0 += self.terms.added_gap(candidates, pairing, self.primary, self.points)
        positions = candidates.positions(self.points)
        if not (self.friction or self.terms.tied):
            return Constraints(B, gap0, positions, compliance)
        directions = tuple(tangents(pairing.normal))
        along = tuple(rows_along(t, candidates, pairing, self.primary, self.points.size) for t in directions)
        if isinstance(self.primary, RigidSide):
            drift = -np.stack([t @ (self.primary.now - self.primary.before) for t in directions])
        else:
            drift = self._approach(candidates, pairing, directions, deformed)
        friction = self.terms.coefficients(self.friction, candidates)
        loose = self._loose(candidates, pairing, directions) if self.friction else None
        return Constraints(B, gap0, positions, compliance, along, directions, friction, drift, loose=loose)

    def _loose(self, candidates: Candidates, pairing: Pairing, directions: tuple[Array, ...]) -> Array | None:
        """Return what supports leave undetermined of tangential forces, see `Constraints.loose`."""
        return None

    def held_along(self, axis: int, candidates: Candidates, pairing: Pairing) -> NDArray[np.bool_]:
        """Return which secondary nodes (m,) supports keep from slipping along an axis; see `_held_nodes`."""
        m = len(self.secondary.points)
        if self.supported is None or not self.supported[self.secondary.points, axis].any():
            return np.zeros(m, bool)
        supported = self.supported[:, axis]
        opposite = np.ones(m, bool)
        if isinstance(self.primary, Surface):
            rows = np.flatnonzero(pairing.paired)
            facing = places(self.primary, pairing.facet[rows], pairing.xi[rows])
            rows = rows[supported[facing.nodes].any(axis=1)]
            opposite = np.isin(self.secondary.points, candidates.nodes[rows][candidates.shape[rows] != 0.0])
        return held_nodes(self.secondary, supported[self.secondary.points], opposite)

    def _approach(
        self, candidates: Candidates, pairing: Pairing, directions: tuple[Array, ...], deformed: Array
    ) -> Array:
        """Return the slip (k, n) to add so that closing a gap is none, though the normal leans.

        Where the surface bends, at the edge of the contact above all, the normal of one side leans against the direction
        in which the gap closes, and a part of that would count as slip. Along the mean of both sides' normals mirrored
        bodies close their gaps without any.
        """
        assert isinstance(self.primary, Surface)
        drift = np.zeros((len(directions), len(pairing.paired)))
        rows = np.flatnonzero(pairing.paired)
        facing = places(self.primary, pairing.facet[rows], pairing.xi[rows])
        local = np.zeros(len(deformed), np.intp)
        local[self.secondary.points] = np.arange(len(self.secondary.points))
        nodes, shape = candidates.nodes[rows], candidates.shape[rows]
        ours = np.einsum("nk,nkd->nd", shape, nodal_normals(self.secondary, deformed)[local[nodes]])
        theirs = interpolated(nodal_normals(self.primary, deformed), facing)
        mean = theirs - ours / np.linalg.norm(ours, axis=1, keepdims=True)
        mean /= np.linalg.norm(mean, axis=1, keepdims=True)
        start = self.points if self.before is None else self.points + self.before
        apart = np.einsum("nk,nkd->nd", shape, start[nodes])
        apart -= np.einsum("nk,nkd->nd", facing.shape, start[facing.nodes])
        opening = np.einsum("nd,nd->n", mean, apart)
        for k, along in enumerate(directions):
            drift[k, rows] = np.einsum("nd,nd->n", along[rows], mean) * opening
        return drift

    @cached_property
    def first_contact(self) -> tuple[Array, Array]:
        """Where the bodies meet first, and the normal faced there, both (dim,).

        The secondary node with the smallest gap before any load; of equally close ones that nearest to the origin.
        """
        positions = self.points[self.secondary.points]
        gap, normal = self.nodal_gap(np.zeros_like(self.points))
        close = np.flatnonzero(gap <= gap.min() + 1e-9 * np.ptp(positions, axis=0).max())
        first = close[np.argmin(np.linalg.norm(positions[close], axis=1))]
        return positions[first], normal[first]

    def nodal_gap(self, displacement: Array, with_clearance: bool = True) -> tuple[Array, Array]:
        """Return the gap (n_nodes,) of the secondary nodes in the displaced configuration, and the normals faced.

        Infinite where a node faces no primary facet. Clearances count unless they are left out.
        """
        nodes = Candidates(self.secondary.points[:, None], np.ones((len(self.secondary.points), 1)))
        deformed = self.points + displacement
        tolerance = max(self.projection_tolerance, ON_SYMMETRY)
        pairing = pair(nodes.positions(deformed), self.primary, deformed, tolerance, self.normals)
        G, gap0 = gap_rows(nodes, pairing, self.primary, self.points)
        if with_clearance:
            gap0 += self.terms.added_gap(nodes, pairing, self.primary, self.points)
        return np.where(pairing.paired, gap0 + G @ displacement.ravel(), np.inf), pairing.normal
