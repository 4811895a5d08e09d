r"""Compliance of point forces outside a multiplier field, and the equivalent equations for the field.

Forces of points with the weights W belong to a field with the values p, ``P p`` at the points. Components outside the field
are compliant: :math:`C = (W^{-1} - P M^{-1} P^T) / \rho` among the points of some equations, M the mass matrix of the
field over these and all other points. With forces W (P p - rho (B u - c)) the equations ``B u + C force = c`` are
:math:`P^T W (B u - c) + E p = 0` for the field, E the mass matrix of the other points over rho, which vanishes except at
the edge of the contact. Springs of the stiffness rho W act along the rows B, on components outside the field.

Points with an additional compliance S, such as a penalty, have the compliance :math:`C + S`. With
:math:`W' = W / (1 + \rho W S)` in place of W, in the equations of the field as well as in the springs, E becomes
:math:`E + P^T W W' S P`: all values are compliant.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import block_diag, csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.arrays import Array, Indices, Mask


@dataclass(frozen=True, eq=False)
class FieldCompliance:
    """Equations for the values of multiplier fields, and springs of their points, in the notation of the module.

    Exact constraints are represented by fields of one point without springs.

    Attributes
    ----------
    P : csr_array (m, k)
        From field values to the points of the equations [-].
    weights : ndarray (m,)
        W, positive [area].
    stiffness : ndarray (m,)
        rho W [force / length].
    others : csr_array (k, k)
        E: the mass matrix of the points without equations over rho, plus the contribution of compliant points.
    dense : callable
        Returns C (m, m) [length / force].
    bordered : bool
        Whether values without compliance remain unknowns, too: on quadratic facets, whose equations are nearly dependent.
    """

    P: csr_array
    weights: Array
    stiffness: Array
    others: csr_array
    dense: Callable[[], Array]
    bordered: bool = False

    @classmethod
    def stacked(cls, compliances: Sequence[FieldCompliance], dense: Callable[[], Array]) -> FieldCompliance:
        """Return the block-diagonal combination of several compliances."""
        return cls(
            csr_array(block_diag([compliance.P for compliance in compliances], format="csr")),
            np.concatenate([compliance.weights for compliance in compliances]),
            np.concatenate([compliance.stiffness for compliance in compliances]),
            csr_array(block_diag([compliance.others for compliance in compliances], format="csr")),
            dense,
            any(compliance.bordered for compliance in compliances),
        )

    @classmethod
    def none(cls, m: int) -> FieldCompliance:
        """Return the compliance of m exact constraints."""
        identity = csr_array(diags_array(np.ones(m)))
        return cls(identity, np.ones(m), np.zeros(m), csr_array((m, m)), lambda: np.zeros((m, m)))

    def softened(self, softness: Array, dense: Callable[[], Array]) -> FieldCompliance:
        """Return the compliance increased by `softness` (m,) at the points [length / force]."""
        share = 1.0 / (1.0 + self.stiffness * softness)
        weights = self.weights * share
        added = self.P.T @ diags_array(self.weights * weights * softness) @ self.P
        others = csr_array(self.others + added)
        others.eliminate_zeros()
        return FieldCompliance(self.P, weights, self.stiffness * share, others, dense, self.bordered)

    def of_field(self, B: csr_array, c: Array) -> FieldEquations:
        """Return the equivalent equations for the field, from rows B (m, n) and right-hand sides c (m,) [length]."""
        shares = csr_array(self.P.T @ diags_array(self.weights))
        size = np.asarray(abs(shares).sum(axis=1))
        touched = np.flatnonzero(size > 0.0)
        # Each equation is scaled by its area, which is small at the edge of the contact.
        units = 1.0 / size[touched]
        shares = csr_array(diags_array(units) @ shares[touched])
        edge = (self.others.diagonal()[touched] > 0.0) | self.bordered
        P = csr_array(self.P[:, touched] @ diags_array(units))
        compliance = self._at_edge(touched[edge], units[edge])
        return FieldEquations(csr_array(shares @ B), shares @ c, P, edge, compliance, touched[edge], units[edge])

    def _at_edge(self, given: Indices, units: Array) -> csr_array:
        """Return E (e, e) among values `given` (e,), those without any equation being eliminated."""
        rest = np.setdiff1d(np.flatnonzero(self.others.diagonal() > 0.0), given)
        E = csr_array(self.others[given][:, given])
        across = csr_array(self.others[given][:, rest])
        if across.nnz:
            beside = np.flatnonzero(np.diff(across.indptr))
            of_beside = csr_array(across[beside])
            correction = of_beside @ splu(csc_array(self.others[rest][:, rest])).solve(of_beside.T.toarray())
            selection = csr_array((np.ones(len(beside)), (beside, np.arange(len(beside)))), (len(given), len(beside)))
            E = csr_array(E - selection @ csr_array(correction) @ selection.T)
        in_units = diags_array(units)
        return csr_array(in_units @ E @ in_units)


@dataclass(frozen=True, eq=False)
class FieldEquations:
    """``rows u + E p = right``, p the values of the field with any equation; ``P p`` are pressures at the points.

    Attributes
    ----------
    rows : csr_array (l, n)
    right : ndarray (l,)
    P : csr_array (m, l)
    edge : ndarray of bool (l,)
        Values that remain unknowns: the compliant ones at the edge of the contact; with a penalty all, see `bordered`.
    compliance : csr_array (e, e)
        E among these unknowns.
    at, units : ndarray (e,)
        Their positions in the field, and their scaling.
    """

    rows: csr_array
    right: Array
    P: csr_array
    edge: Mask
    compliance: csr_array
    at: Indices
    units: Array
