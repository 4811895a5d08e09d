"""Multiplier fields: projection of point forces onto the field, and compliance C of the remaining components of the forces.

For the formulas and symbols see `formulations._pressure_field`.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array, diags_array
from scipy.sparse.linalg import SuperLU

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices
from fastcontact.errors import ContactError
from fastcontact.linear.delassus import MAX_ROWS
from fastcontact.linear.field_compliance import FieldCompliance
from fastcontact.linear.sparse_rows import scaled, without_zeros


@record
class Projection:
    """Projection of point forces onto a multiplier field, and compliance C of the remaining forces; see `Compliance`.

    Attributes
    ----------
    P : csr_array (m, k)
        Values at the m integration points of the shape functions of the k independent values of the field [-].
    areas : ndarray (m,)
        Areas W of the points [area]. Points on the axis have no area and no compliance, and may carry concentrated forces.
    rho : float
        The constant of the augmented Lagrangian [pressure / length].
    mass : SuperLU, optional
        Factors of ``P.T W P``; None if no point can carry forces.
    eliminable : bool
        Whether linear solvers may use the values of the field as unknowns instead of the point forces.
    quadratic : bool
        Whether the facets are quadratic.
    """

    P: csr_array
    areas: Array
    rho: float
    mass: SuperLU | None
    eliminable: bool = True
    quadratic: bool = False

    def block(self, rows: Indices) -> Array:
        """Return the submatrix (q, q) of C for the points `rows` (q,) [length / force].

        Raises
        ------
        ContactError
            If the matrix is too large to be factorised.
        """
        if len(rows) > MAX_ROWS:
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

    def split(self, rows: Indices) -> tuple[Array, csr_array, Array]:
        """Return d (q,), P (q, k) and S (k, k) of the submatrix ``diag(d) - P S P.T``; see `Compliance.split`."""
        areas, k = np.where(self.mass is None, 0.0, self.areas[rows]), self.P.shape[1]
        S = np.zeros((k, k)) if self.mass is None else self.mass.solve(np.eye(k)) / self.rho
        d = np.divide(1.0, self.rho * areas, out=np.zeros_like(areas), where=areas > 0)
        return d, scaled(self.P[rows], (areas > 0).astype(float)), S

    def block_operator(self, rows: Indices) -> Array | FieldCompliance:
        """Return the compliance of the points `rows` (q,) for linear solvers; see `Compliance.block_operator`."""
        if not self.eliminable or self.mass is None or not (self.areas[rows] > 0).all():
            return self.block(rows)
        weights = np.where(self.areas > 0, self.areas, 0.0) / self.rho
        weights[rows] = 0.0
        mass_of_other_points = without_zeros(csr_array(self.P.T @ diags_array(weights) @ self.P))
        P, areas, stiffness = csr_array(self.P[rows]), self.areas[rows], self.rho * self.areas[rows]
        return FieldCompliance(P, areas, stiffness, mass_of_other_points, lambda: self.block(rows), self.quadratic)

    def apply(self, multiplier: Array) -> Array:
        """Return ``C @ multiplier`` [length] for point forces (m,) or (m, dim) [force]."""
        forces = multiplier if multiplier.ndim == 2 else multiplier[:, None]
        areas, with_area = self.areas[:, None], self.areas[:, None] > 0
        pressure = np.divide(forces, areas, out=np.zeros_like(forces), where=with_area)
        remainder = np.where(with_area, pressure - self.P @ self.field(np.where(with_area, forces, 0.0)), 0.0)
        return remainder.reshape(multiplier.shape) / self.rho

    def field(self, multiplier: Array) -> Array:
        """Return the independent values (k, ...) of the multiplier field [pressure] for point forces (m, ...) [force]."""
        shape = self.P.shape[1], *multiplier.shape[1:]
        return np.zeros(shape) if self.mass is None else self.mass.solve(np.ascontiguousarray(self.P.T @ multiplier))

    def compliance_factor(self, columns: Indices) -> Array:
        r"""Return the factor Z (m, h) of a compliance that replaces h values of the multiplier field.

        At supported nodes, for example on an axis or in a plane of symmetry, the slip of a facet has one nodal value fewer
        than its multiplier field. A field that alternates from node to node and decays along the surface then does no work
        on any slip, and is undetermined. Such fields are made compliant, like forces that the multiplier field does not
        represent. The shear at the supported node then vanishes, as symmetry requires.

        Let E be the unit vectors of the removed values `columns` (h,), and :math:`M = P^T W P`. The compliance is
        :math:`Z Z^T = P M^{-1} E (E^T M^{-1} E)^{-1} E^T M^{-1} P^T / \rho`.
        """
        if self.mass is None:
            return np.zeros((self.P.shape[0], 0))
        unit = np.zeros((self.P.shape[1], len(columns)))
        unit[columns, np.arange(len(columns))] = 1.0
        inverse = self.mass.solve(unit)
        lower = np.linalg.cholesky(inverse[columns])
        return np.asarray(np.linalg.solve(lower, (self.P @ inverse).T).T) / np.sqrt(self.rho)
