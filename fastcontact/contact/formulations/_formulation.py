"""What a contact formulation is: constraints from a configuration, nodal pressures from multipliers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from fastcontact.active_set import Compliance
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.pairing import Candidates, Pairing, gap_rows, pair, rows_along, tangents
from fastcontact.contact.rigid import RigidSide
from fastcontact.contact.surface import Surface
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
    """

    secondary: Surface
    primary: Surface | RigidSide
    points: Array
    axisymmetric: bool
    modulus: float

    friction: float = 0.0
    projection_tolerance: float = 0.5
    normals: str | None = None

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
    def in_dimension(cls, dim: int) -> type[Formulation]:
        """Return the class that does this formulation in 2 or 3 dimensions."""
        return cls

    @abstractmethod
    def constraints(self, displacement: Array) -> Constraints:
        """Pair on the configuration displaced by `displacement` (n_points, dim) and return the constraints."""

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

    def assembled(self, candidates: Candidates, pairing: Pairing, compliance: Compliance | None) -> Constraints:
        """Return the constraints of paired candidates, with tangential rows where there is friction."""
        B, gap0 = gap_rows(candidates, pairing, self.primary, self.points)
        positions = candidates.positions(self.points)
        if not self.friction:
            return Constraints(B, gap0, positions, compliance)
        directions = tuple(tangents(pairing.normal))
        along = tuple(rows_along(t, candidates, pairing, self.primary, self.points.size) for t in directions)
        drift = None
        if isinstance(self.primary, RigidSide):
            drift = -np.stack([t @ (self.primary.now - self.primary.before) for t in directions])
        return Constraints(B, gap0, positions, compliance, along, directions, np.full(len(gap0), self.friction), drift)

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

    def nodal_gap(self, displacement: Array) -> tuple[Array, Array]:
        """Return the gap (n_nodes,) of the secondary nodes in the displaced configuration, and the normals faced.

        Infinite where a node faces no primary facet.
        """
        nodes = Candidates(self.secondary.points[:, None], np.ones((len(self.secondary.points), 1)))
        deformed = self.points + displacement
        tolerance = max(self.projection_tolerance, ON_SYMMETRY)
        pairing = pair(nodes.positions(deformed), self.primary, deformed, tolerance, self.normals)
        G, gap0 = gap_rows(nodes, pairing, self.primary, self.points)
        return np.where(pairing.paired, gap0 + G @ displacement.ravel(), np.inf), pairing.normal
