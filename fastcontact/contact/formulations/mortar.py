r"""Mortar contact: the continuous formulation, integrated exactly over the pieces where two facets face each other.

The gap between facets that do not match has a kink wherever a node of the primary side stands opposite. Here every
secondary facet is cut there, in each pairing, and every piece gets Gauss points of its own (Puso and Laursen, 2004;
Popp, Gee and Wall, 2009). A uniform pressure then passes between meshes that do not match without error, which neither
node-to-segment nor quadrature over whole facets achieves. Pieces that face nothing carry nothing, and the multiplier
field is projected over the rest: where the primary surface ends inside a facet, the pressure ends there too.

The pressure at a point and the complementarity are those of the continuous formulation, see there.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.contact.constraints import Constraints
from fastcontact.contact.formulations._cut_lines import line_points
from fastcontact.contact.formulations._formulation import Formulation
from fastcontact.contact.formulations._held_nodes import compliant
from fastcontact.contact.formulations._projection import Projection
from fastcontact.contact.formulations._weighted import WeightedMortar
from fastcontact.contact.integration import facet_measure
from fastcontact.contact.pair_options import spread
from fastcontact.contact.pairing import Candidates, Pairing, normals, pair
from fastcontact.contact.surface import Surface
from fastcontact.errors import ContactError
from fastcontact.mesh import quadrature

Array = NDArray[np.float64]
# A facet that faces less than this part of its length takes no part: its multipliers would have next to no equation.
COVERED = 1e-3


@dataclass(eq=False)
class Mortar(Formulation):
    """Mortar contact with exact integration over cut facets; further parameters as in `Formulation`.

    Parameters
    ----------
    n_gauss : int, optional
        Gauss points per piece; by default 3 on linear and 4 on quadratic facets.
    augmentation : float
        rho times the length of the shortest facet over the modulus of the bodies [1].
    multipliers : str
        ``"standard"``, this class; ``"dual"``, see `WeightedMortar`.
    """

    projection_tolerance: float = 1e-6
    normals: str = "averaged"
    n_gauss: int | None = None
    augmentation: float = 1.0
    multipliers: str = "standard"

    name: ClassVar[str] = "mortar"
    geometry_in_loop: ClassVar[bool] = True
    _projection: Projection = field(init=False, repr=False)
    _field: csr_array = field(init=False, repr=False)
    _facet: NDArray[np.intp] = field(init=False, repr=False)
    _own: NDArray[np.intp] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.augmentation > 0:
            raise ContactError(f"augmentation = {self.augmentation} must be positive; 1 suits most problems")
        if self.n_gauss is not None and self.n_gauss < 2:
            raise ContactError(f"n_gauss = {self.n_gauss} points per piece do not integrate it exactly: use at least 2")
        facets, element = self.secondary.facets, self.secondary.element
        xi, weights = quadrature.gauss_line(3)
        lengths = facet_measure(facets, element, self.points, xi, False) @ weights
        self._rho = self.augmentation * self.modulus / float(lengths.min())

    @classmethod
    def variant(cls, dim: int, options: Mapping[str, Any]) -> type[Formulation]:
        """Between faces, and with dual multipliers, gaps are weighted means."""
        return WeightedMortar if dim == 3 or options.get("multipliers", "standard") != "standard" else cls

    def constraints(self, displacement: Array) -> Constraints:
        """Cut and pair on the displaced configuration and return the gaps of the integration points."""
        deformed = self.points + displacement
        assert isinstance(self.primary, Surface)
        block, borders = self.secondary.blocks[0], self.terms.borders(self.secondary)
        n_gauss = block.facets.shape[1] + 1 if self.n_gauss is None else self.n_gauss
        points = line_points(block, self.primary, self.points, deformed, self.axisymmetric, n_gauss, borders)
        facet, shape, area = points.facet, points.shape, points.area
        candidates = Candidates(self.secondary.facets[facet], shape)
        found = pair(candidates.positions(deformed), self.primary, deformed, self.projection_tolerance, self.normals)
        total = np.bincount(facet, weights=area)
        covered = np.bincount(facet, weights=np.where(found.paired, area, 0.0))
        kept = found.paired & (covered > COVERED * total)[facet] & (area > 0) & ~self.terms.out(candidates)
        pairing = Pairing(found.facet, found.xi, found.normal, kept)
        self._facet = facet
        self._project(facet, shape, np.where(kept, area, 0.0))
        return self.assembled(candidates, pairing, self._projection, deformed)

    def _project(self, facet: NDArray[np.intp], shape: Array, area: Array) -> None:
        """Set up the multiplier field on the nodes of facets that take part."""
        column = self.secondary.local[facet]
        row = np.broadcast_to(np.arange(len(shape))[:, None], shape.shape)
        size = (len(shape), len(self.secondary.points))
        P = coo_array((shape.ravel(), (row.ravel(), column.ravel())), shape=size).tocsr()
        seen = np.zeros(size[1], bool)
        seen[column[area > 0]] = True
        excluded = self.terms.excluded_nodes(self.secondary)
        self._own = keep = np.flatnonzero(seen & ~excluded)
        self._field = csr_array(spread(self.secondary, excluded, keep)[:, keep])
        P = csr_array(P @ self._field)
        mass = splu((P.T @ diags_array(area) @ P).tocsc()) if len(keep) else None
        self._projection = Projection(P, area, self._rho, mass)

    def initially_active(self, constraints: Constraints, pressure: Array, displacement: Array) -> NDArray[np.bool_]:
        """Return the points where the field of nodal `pressure` exceeds rho times the gap; they have no other past."""
        nodal = pressure[self._own]
        gap = constraints.gap0 + constraints.B @ displacement.ravel()
        return (self._projection.areas > 0) & (self._projection.P @ nodal - self._rho * gap > 0)

    def _loose(self, candidates: Candidates, pairing: Pairing, directions: tuple[Array, ...]) -> Array | None:
        """Return the compliance of fields that do no work on any slip, where supports hold nodes."""
        factors = []
        for axis in range(directions[0].shape[1]):
            columns = np.flatnonzero(self.held_along(axis, candidates, pairing)[self._own])
            if len(columns):
                Z = compliant(self._projection, columns)
                factors.append(np.stack([along[:, axis, None] * Z for along in (normals(directions), *directions)]))
        return np.concatenate(factors, axis=2) if factors else None

    def areas(self) -> Array:
        """Return the areas of the integration points."""
        return np.where(self._projection.areas > 0, self._projection.areas, np.inf)

    def pressure(self, multiplier: Array) -> Array:
        """Return the multiplier field at the nodes, zero on facets that face nothing."""
        return self._field @ self._projection.field(multiplier)

    def closed_nodes(self, active: NDArray[np.bool_], gap: Array, pressure: Array) -> NDArray[np.bool_]:
        """Return the nodes where ``pressure - rho gap`` is positive, on facets with an active point."""
        touched = np.zeros(len(gap), bool)
        touched[self.secondary.local[self._facet[active]]] = True
        return touched & (pressure - self._rho * gap > 0)


FORMULATION = Mortar
