"""Multiplier fields: point forces, their projection onto the field, and the compliance between the two.

See `_pressure_field` for the formulas.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import SuperLU

from fastcontact.arrays import Array, Indices
from fastcontact.errors import ContactError
from fastcontact.linear.delassus import MOST_ROWS
from fastcontact.linear.field_compliance import FieldCompliance


@dataclass(frozen=True, eq=False)
class Projection:
    """Projection of point forces on a multiplier field, and the compliance of the complement.

    Attributes
    ----------
    P : csr_array (m, k)
        Functions of the multiplier field at the integration points.
    areas : ndarray (m,)
        W; a point without area, at the axis, has no compliance: C vanishes there. It may carry a force of its own.
    rho : float
        Augmentation [pressure / length].
    mass : SuperLU, optional
        Factors of ``P.T W P``; None where no point takes part.
    eliminable : bool
        Whether linear solvers may use the values of the field as unknowns in place of the forces.
    quadratic : bool
        Whether facets are.
    """

    P: csr_array
    areas: Array
    rho: float
    mass: SuperLU | None
    eliminable: bool = True
    quadratic: bool = False

    def block(self, rows: Indices) -> Array:
        """Return rows and columns `rows` of C, a dense matrix; ContactError where it would be too large to be of use."""
        if len(rows) > MOST_ROWS:
            raise ContactError(
                f"the continuous formulation closes {len(rows)} integration points at once, whose compliance would be a "
                f"dense matrix of {8e-9 * len(rows) ** 2:.1f} GB: use formulation='mortar' with "
                "multipliers='dual'"
            )
        if self.mass is None:
            return np.zeros((len(rows), len(rows)))
        areas = self.areas[rows]
        P = self.P[rows].toarray() * (areas > 0)[:, None]
        inverse = np.divide(1.0, areas, out=np.zeros_like(areas), where=areas > 0)
        return (np.diag(inverse) - P @ self.mass.solve(np.ascontiguousarray(P.T))) / self.rho

    def among(self, rows: Indices) -> Array | FieldCompliance:
        """Return C among `rows`; see `Compliance`."""
        if not self.eliminable or self.mass is None or not (self.areas[rows] > 0).all():
            return self.block(rows)
        others = np.where(self.areas > 0, self.areas, 0.0) / self.rho
        others[rows] = 0.0
        mass, areas = csr_array(self.P.T @ diags_array(others) @ self.P), self.areas[rows]
        mass.eliminate_zeros()
        P, stiffness = csr_array(self.P[rows]), self.rho * areas
        return FieldCompliance(P, areas, stiffness, mass, lambda: self.block(rows), self.quadratic)

    def apply(self, multiplier: Array) -> Array:
        """Return ``C multiplier``."""
        inside = self.areas > 0
        pressure = np.divide(multiplier, self.areas, out=np.zeros_like(multiplier), where=inside)
        return np.where(inside, pressure - self.P @ self.field(np.where(inside, multiplier, 0.0)), 0.0) / self.rho

    def field(self, multiplier: Array) -> Array:
        """Return the independent values (k,) of the multiplier field [pressure] for point forces (m,) [force]."""
        return np.zeros(self.P.shape[1]) if self.mass is None else self.mass.solve(self.P.T @ multiplier)

    def compliant(self, columns: Indices) -> Array:
        r"""Return a factor Z (m, h) of the compliance added by dropping `columns` of the multiplier field.

        At supported nodes, as on an axis or in a plane of symmetry, the slip of a facet has one nodal value fewer than its
        multiplier field: a field that alternates from node to node and decays along the surface does no work on any slip, and
        is undetermined. Such fields are made compliant, like the fields that the multiplier field cannot represent: the shear
        at the supported node then vanishes, as symmetry requires.

        With E the unit vectors of the columns and :math:`M = P^T W P` that is
        :math:`Z Z^T = P M^{-1} E (E^T M^{-1} E)^{-1} E^T M^{-1} P^T / \rho`.
        """
        if self.mass is None:
            return np.zeros((self.P.shape[0], 0))
        unit = np.zeros((self.P.shape[1], len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        inverse = self.mass.solve(unit)
        lower = np.linalg.cholesky(inverse[columns])
        return np.asarray(np.linalg.solve(lower, (self.P @ inverse).T).T) / np.sqrt(self.rho)
