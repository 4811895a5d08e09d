"""Saddle-point system of constraints ``B u + C multiplier = c`` that are not eliminated.

The matrix of displacements and multipliers, ``[A, -B.T; B, C]``, is bordered and not positive definite. Conjugate residuals
solve it, preconditioned by its lower triangle: multigrid for A, and for the multipliers ``C + B D^-1 B.T``, D the diagonal of
A, softer by the compliance of their neighbours.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.arrays import Array
from fastcontact.linear.krylov.iterations import Multiply, Precondition
from fastcontact.round_off import ROUND_OFF

# Compliance of displacements over the inverse diagonal of their matrix.
SOFTER = 2.0


class Border:
    """The equations of the module.

    Parameters
    ----------
    rows : csr_array (e, n)
    right : ndarray (e,)
    compliance : csr_array (e, e)
    """

    def __init__(self, rows: csr_array, right: Array, compliance: csr_array) -> None:
        self.rows, self.right, self.compliance = rows, right, compliance

    def __len__(self) -> int:
        return len(self.right)

    def prepare(self, diagonal: Array) -> None:
        """Factorise the preconditioner of the multipliers, given the diagonal (n,) of A [force / length]."""
        yielding = np.divide(1.0, diagonal, out=np.zeros(len(diagonal)), where=diagonal > 0.0)
        S = self.compliance + SOFTER * (self.rows @ diags_array(yielding) @ self.rows.T)
        diagonal_of_S = S.diagonal()
        # Residuals of these equations are scaled to forces.
        self.stiffness = 1.0 / diagonal_of_S
        # Some multipliers are linearly dependent.
        self._factors = splu(csc_array(S + diags_array(ROUND_OFF * diagonal_of_S)))

    def multiply(self, multiply: Multiply, move_forces: Callable[[Array], None]) -> Multiply:
        """Return the product with the bordered matrix, from that with A; forces (n,) move from eliminated unknowns."""
        n = self.rows.shape[1]

        def product(p: Array, q: Array) -> None:
            multiply(p[:n], q[:n])
            forces = self.rows.T @ p[n:]
            move_forces(forces)
            q[:n] -= forces
            q[n:] = self.stiffness * (self.rows @ p[:n] + self.compliance @ p[n:])

        return product

    def precondition(self, precondition: Precondition) -> Precondition:
        """Return the preconditioner, from that of A."""
        n = self.rows.shape[1]

        def solve(r: Array, norm: float, z: Array) -> None:
            precondition(r[:n], norm, z[:n])
            z[n:] = self._factors.solve(r[n:] / self.stiffness - self.rows @ z[:n])

        return solve
