r"""The compliance of forces at points that a field of fewer values cannot represent, and the same equations for that field.

Forces of points with the weights W belong to a field with the values p, ``P p`` at the points. What the field does not represent
gives way: :math:`C = (W^{-1} - P M^{-1} P^T) / \rho` among the points of some equations, M the mass matrix of the field over
these and all other points. With forces W (P p - rho (B u - c)) the equations ``B u + C force = c`` are
:math:`P^T W (B u - c) + E p = 0` for the field, E the mass matrix of the other points over rho: it holds at the edge of the
contact alone. Springs of the stiffness rho W along the rows B act beside them, which vanish as far as the field represents them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]
# Smaller eigenvalues of a compliance, relative to its diagonal, are none.
ROUND_OFF = 1e-12


@dataclass(frozen=True, eq=False)
class FieldCompliance:
    """See the module.

    Attributes
    ----------
    P : csr_array (m, k)
        Field values to the points of the equations [-].
    weights : ndarray (m,)
        W, positive [area].
    rho : float
        [pressure / length]
    others : csr_array (k, k)
        Mass matrix of the points without equations [area].
    dense : callable
        Returns C (m, m) [length / force].
    """

    P: csr_array
    weights: Array
    rho: float
    others: csr_array
    dense: Callable[[], Array]

    def of_field(self, B: csr_array, c: Array) -> FieldEquations:
        """Return the same equations for the field, of rows B (m, n) and right-hand sides c (m,) [length]."""
        W = diags_array(self.weights)
        shares = csr_array(self.P.T @ W)
        size = np.asarray(abs(shares).sum(axis=1))
        touched = np.flatnonzero(size > 0.0)
        # Each in units of its own area: equations at the edge of the contact are small ones.
        shares = csr_array(diags_array(1.0 / size[touched]) @ shares[touched])
        compliance = EdgeCompliance(self.others, touched, 1.0 / size[touched], self.rho)
        P = csr_array(self.P[:, touched] @ diags_array(1.0 / size[touched]))
        return FieldEquations(csr_array(shares @ B), shares @ c, compliance, P)


@dataclass(frozen=True, eq=False)
class FieldEquations:
    """``rows u + compliance p = right``, p what of the field's values is left; ``P p`` are pressures at the points."""

    rows: csr_array
    right: Array
    compliance: EdgeCompliance
    P: csr_array


class EdgeCompliance:
    """The matrix E (l, l) of a field's values that some equation touches, those that none does being eliminated.

    It vanishes but for values at the edge of the contact, and is singular where few points without equations are near.

    Parameters
    ----------
    others : csr_array (k, k)
        Mass matrix of the points without equations.
    touched : ndarray of int (l,)
    units : ndarray (l,)
        What one of each value is.
    rho : float

    Attributes
    ----------
    at : ndarray of int (e,)
        Equations that give way.
    stiffness : float
        Of one over the mean compliance of these [force / length].
    factor : ndarray (e, e)
        A with ``E = A A.T / stiffness`` there; columns without compliance are zero.
    """

    def __init__(self, others: csr_array, touched: NDArray[np.intp], units: Array, rho: float) -> None:
        mass = others.diagonal()
        self.at = np.flatnonzero(mass[touched] > 0.0)
        given = touched[self.at]
        rest = np.setdiff1d(np.flatnonzero(mass > 0.0), given)
        E = others[given][:, given].toarray()
        across = csr_array(others[given][:, rest])
        if across.nnz:
            E -= across @ splu(csc_array(others[rest][:, rest])).solve(across.T.toarray())
        E *= units[self.at][:, None] * units[self.at] / rho
        own = np.diag(E)
        self.stiffness = 1.0 / float(own.mean()) if len(own) else 0.0
        # Values of all sizes: what is singular is found relative to what each has of its own.
        unit = np.sqrt(own)
        values, vectors = np.linalg.eigh(E / (unit[:, None] * unit))
        values = np.where(values > ROUND_OFF, values, 0.0)
        self.factor = np.sqrt(self.stiffness) * unit[:, None] * vectors * np.sqrt(values)
