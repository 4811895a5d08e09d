r"""Compliance of the point forces of a multiplier field, and equivalent equations for the values of the field.

A multiplier field with the values p has the pressures ``P p`` at its integration points, whose areas form the diagonal
matrix W. Let M be the mass matrix of the field, integrated with all points, and :math:`\rho` the parameter of the augmented
Lagrangian, see `contact.formulations._pressure_field`. The closed points satisfy the equations ``B u + C force = c``. Only
forces that the field does not represent have a compliance: :math:`C = (W^{-1} - P M^{-1} P^T) / \rho`.

With the forces :math:`W (P p - \rho (B u - c))`, the equations are equivalent to :math:`P^T W (B u - c) + E p = 0` for the
field, combined with springs of the stiffness :math:`\rho W` and the elongations ``B u - c``. E is the mass matrix, integrated
with the open points only and divided by :math:`\rho`. It vanishes except at the edge of the contact.

If the points have an additional compliance S, such as that of a penalty, their compliance is :math:`C + S`. In the equations
of the field and in the springs, W is then replaced by :math:`W' = W / (1 + \rho W S)`, and E by :math:`E + P^T W W' S P`. In
this case, all values of the field have a compliance.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import block_diag, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact._tools.records import record
from fastcontact.arrays import Array, Indices, Mask


@record
class FieldCompliance:
    """Compliance of m equations at points of multiplier fields. For the symbols, see the docstring of the module.

    Equations without compliance are represented by fields of one point each, without springs.

    Attributes
    ----------
    P : csr_array (m, k)
        Map from the k values of the fields to the points of the equations [-].
    weights : ndarray (m,)
        Areas W of the points, which are positive [area].
    stiffness : ndarray (m,)
        Stiffness rho W of the springs [force / length].
    E : csr_array (k, k)
        The matrix E.
    dense : callable
        Function without arguments that returns C (m, m) [length / force].
    bordered : bool
        Whether values without compliance are not eliminated either. This is the case on quadratic facets, whose equations are
        nearly linearly dependent.
    """

    P: csr_array
    weights: Array
    stiffness: Array
    E: csr_array
    dense: Callable[[], Array]
    bordered: bool = False

    @classmethod
    def stacked(cls, compliances: Sequence[FieldCompliance], dense: Callable[[], Array]) -> FieldCompliance:
        """Return the block-diagonal combination of several compliances, whose matrix the function `dense` returns."""
        return cls(
            csr_array(block_diag([compliance.P for compliance in compliances], format="csr")),
            np.concatenate([compliance.weights for compliance in compliances]),
            np.concatenate([compliance.stiffness for compliance in compliances]),
            csr_array(block_diag([compliance.E for compliance in compliances], format="csr")),
            dense,
            any(compliance.bordered for compliance in compliances),
        )

    @classmethod
    def none(cls, m: int) -> FieldCompliance:
        """Return a compliance of zero for m equations."""
        identity = csr_array(diags_array(np.ones(m)))
        return cls(identity, np.ones(m), np.zeros(m), csr_array((m, m)), lambda: np.zeros((m, m)))

    def softened(self, softness: Array, dense: Callable[[], Array]) -> FieldCompliance:
        """Return the sum of this compliance and the diagonal compliance S, `softness` (m,) [length / force].

        `dense` is the function that returns the sum as a matrix.
        """
        reduction = 1.0 / (1.0 + self.stiffness * softness)
        weights = self.weights * reduction
        E = csr_array(self.E + self.P.T @ diags_array(self.weights * weights * softness) @ self.P)
        E.eliminate_zeros()
        return FieldCompliance(self.P, weights, self.stiffness * reduction, E, dense, self.bordered)

    def field_equations(self, B: csr_array, c: Array) -> FieldEquations:
        """Return the equivalent equations for the values of the field.

        B (m, n) and c (m,) are the matrix [-] and the right-hand sides [length] of the equations at the points.
        """
        PTW = csr_array(self.P.T @ diags_array(self.weights))
        area = np.asarray(abs(PTW).sum(axis=1))
        values = np.flatnonzero(area > 0.0)  # numbers of the values that occur in the equations
        # Each equation is divided by the area of its value, which may be small at the edge of the contact.
        scales = 1.0 / area[values]
        PTW = csr_array(diags_array(scales) @ PTW[values])
        edge = (self.E.diagonal()[values] > 0.0) | self.bordered
        P = csr_array(self.P[:, values] @ diags_array(scales))
        compliance = self._edge_compliance(values[edge], scales[edge])
        return FieldEquations(csr_array(PTW @ B), PTW @ c, P, edge, compliance, values[edge], scales[edge])

    def _edge_compliance(self, values: Indices, scales: Array) -> csr_array:
        """Return E (e, e) for the values of the field with the numbers `values` (e,), scaled by `scales` (e,).

        Values that do not occur in any equation are eliminated from E.
        """
        unused = np.setdiff1d(np.flatnonzero(self.E.diagonal() > 0.0), values)
        E = csr_array(self.E[values][:, values])
        coupling = csr_array(self.E[values][:, unused])
        if coupling.nnz:
            coupled = np.flatnonzero(np.diff(coupling.indptr))
            rows = csr_array(coupling[coupled])
            correction = rows @ splu(csc_array(self.E[unused][:, unused])).solve(rows.T.toarray())
            n = len(coupled)
            selection = csr_array((np.ones(n), (coupled, np.arange(n))), (len(values), n))
            E = csr_array(E - selection @ csr_array(correction) @ selection.T)
        scaling = diags_array(scales)
        return csr_array(scaling @ E @ scaling)


@record
class FieldEquations:
    """Equations ``rows u + E p = rhs`` for those values p (l,) of a field that occur in the equations at points.

    Attributes
    ----------
    rows : csr_array (l, n)
        Matrix of the equations [-].
    rhs : ndarray (l,)
        Right-hand sides [length].
    P : csr_array (m, l)
        Map from the values p to the pressures at the points.
    edge : ndarray of bool (l,)
        Mask of the e values that are not eliminated. These are the values with a compliance, which are those at the edge of
        the contact or with a penalty, or all values, see `FieldCompliance.bordered`.
    compliance : csr_array (e, e)
        The matrix E for the values that are not eliminated.
    edge_values : ndarray of int (e,)
        Numbers of these values in the field.
    scales : ndarray (e,)
        Scaling factors of these values.
    """

    rows: csr_array
    rhs: Array
    P: csr_array
    edge: Mask
    compliance: csr_array
    edge_values: Indices
    scales: Array
