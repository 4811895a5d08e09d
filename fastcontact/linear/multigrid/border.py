"""Saddle-point system with equations ``B u + C multiplier = c`` that are not eliminated.

The matrix of the system for displacements and multipliers, ``[A, -B.T; B, C]``, is not symmetric positive definite. It is
solved by the generalised conjugate residual method. The preconditioner is block lower triangular, with multigrid for A and
the factors of ``C + B D^-1 B.T`` for the multipliers, where D is the diagonal of A.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, diags_array
from scipy.sparse.linalg import splu

from fastcontact.arrays import Array
from fastcontact.linear.krylov.iterations import Multiply, Precondition
from fastcontact.round_off import ROUND_OFF


class Border:
    """Equations ``B u + C multiplier = c`` that are not eliminated.

    Parameters
    ----------
    rows : csr_array (e, n)
        Matrix B.
    rhs : ndarray (e,)
        Right-hand sides c.
    compliance : csr_array (e, e)
        Compliance C.
    """

    def __init__(self, rows: csr_array, rhs: Array, compliance: csr_array) -> None:
        self.rows, self.rhs, self.compliance = rows, rhs, compliance

    def __len__(self) -> int:
        return len(self.rhs)

    def prepare(self, diagonal: Array) -> None:
        """Factorise the preconditioner for the multipliers, given the diagonal (n,) of A [force / length]."""
        inverse_diagonal = np.divide(1.0, diagonal, out=np.zeros(len(diagonal)), where=diagonal > 0.0)
        S = self.compliance + self.rows @ diags_array(inverse_diagonal) @ self.rows.T
        diagonal_of_S = S.diagonal()
        # Factors that convert the residuals of the equations to forces.
        self.stiffness = 1.0 / diagonal_of_S
        # A small shift keeps the matrix nonsingular if equations are linearly dependent.
        self._factors = splu(csc_array(S + diags_array(ROUND_OFF * diagonal_of_S)))

    def product(self, multiply: Multiply, move_forces: Callable[[Array], None]) -> Multiply:
        """Return the function that computes products with the bordered matrix.

        `multiply` is the function for A. `move_forces` moves forces (n,) from eliminated unknowns to the others, in place.
        """
        n = self.rows.shape[1]

        def multiply_bordered(p: Array, q: Array) -> None:
            multiply(p[:n], q[:n])
            forces = self.rows.T @ p[n:]
            move_forces(forces)
            q[:n] -= forces
            q[n:] = self.stiffness * (self.rows @ p[:n] + self.compliance @ p[n:])

        return multiply_bordered

    def preconditioner(self, precondition: Precondition) -> Precondition:
        """Return the preconditioner of the bordered matrix, given the preconditioner of A."""
        n = self.rows.shape[1]

        def solve(r: Array, norm: float, z: Array) -> None:
            precondition(r[:n], norm, z[:n])
            z[n:] = self._factors.solve(r[n:] / self.stiffness - self.rows @ z[:n])

        return solve
