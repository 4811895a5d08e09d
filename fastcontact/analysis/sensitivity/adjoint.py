"""Adjoint solution of a converged load step.

The adjoint variables y = (w, mu), of the unknowns and of the multipliers, satisfy ``(J0 + E).T y = q``, where q is the
gradient of the quantity. J0 is the symmetric saddle-point matrix of the step, with the stiffness and the active constraints.
E contains the derivatives of the pairing on the deformed configuration, minus the stiffness of the springs of floating
bodies. GMRES solves ``s + E.T J0^-T s = E.T J0^-T q`` for ``s = E.T y``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.linalg import LinearOperator, gmres

from fastcontact._tools.records import record
from fastcontact.analysis.sensitivity.moving_contact import MovingContact
from fastcontact.arrays import Array, largest
from fastcontact.errors import ConvergenceError
from fastcontact.linear.protocol import TOLERANCE

# Largest number of GMRES iterations for s, each with one linear solution.
SOLUTIONS = 200


@record
class Gradient:
    """A quantity at the end of a load step, and its derivatives.

    Attributes
    ----------
    value : float
    displacement : ndarray (n_dofs,)
        Derivative with respect to all displacements, at fixed pairing [unit of the quantity / length].
    multiplier : ndarray (k,)
        Derivative with respect to the multipliers of active constraints [unit of the quantity / force].
    sample : ndarray, optional
        Derivative with respect to `MovingContact.sample_at`, which depends on the pairing; None for zero.
    reaction : ndarray (n_dofs,), optional
        Derivative with respect to the forces of supports [unit of the quantity / force]; None for zero.
    """

    value: float
    displacement: Array
    multiplier: Array
    sample: Array | None = None
    reaction: Array | None = None


@record
class Change:
    """Partial derivatives of the residual with respect to a parameter, at fixed displacements and multipliers.

    Attributes
    ----------
    residual : ndarray (n_dofs,)
        Derivative of internal minus external forces, without contact forces [force / unit of the parameter].
    lift : ndarray (n_dofs,)
        Derivative of the prescribed displacements [length / unit of the parameter].
    sample : ndarray
        Derivative of `MovingContact.sample_at` [its unit / unit of the parameter].
    """

    residual: Array
    lift: Array
    sample: Array


class Adjoint:
    """The adjoint solution for a quantity.

    Parameters
    ----------
    contact : MovingContact
    gradient : Gradient
    moving : csr_array
        Derivative of `MovingContact.sample_at` with respect to the displacements (n_dofs,) at which surfaces are paired, then
        with respect to the lift of each parameter; see `MovingContact.derivatives`.
    """

    def __init__(self, contact: MovingContact, gradient: Gradient, moving: csr_array) -> None:
        self._contact, self._gradient = contact, gradient
        self._system, self._solver = contact.problem.system, contact.problem.solver
        n, k = len(contact.u), len(contact.active)
        self._dsample, self._by_lift, self._k = csr_array(moving[:, :n]), csr_array(moving[:, n:]), k
        self._dforce, self._dgap = csr_array(self._dsample[:n]), csr_array(self._dsample[n : n + k])
        self.solutions = 0
        self._B, self._rows, self._C = csr_array((0, n)), csr_array((0, n)), None
        if k:
            constraints = contact.constraints
            self._B = csr_array(constraints.B[contact.active])
            self._rows = self._system.rows(self._B, np.zeros(k), np.zeros(n))[0]
            self._C = constraints.normal_compliance(contact.active)
        self._w, self._mu = self._solve()

    def derivatives(self, changes: Sequence[Change]) -> Array:
        """Return the derivatives (q,) of the quantity with respect to the parameters whose lifts `moving` contains."""
        gradient, n, values = self._gradient, len(self._contact.u), np.zeros(len(changes))
        for i, (change, by_lift) in enumerate(zip(changes, self._by_lift.toarray().T, strict=True)):
            sample = change.sample + largest(change.lift) * by_lift
            residual = change.residual + self._system.K @ change.lift - sample[:n]
            gap = sample[n : n + self._k] + self._B @ change.lift
            values[i] = gradient.displacement @ change.lift - self._w @ self._system.reduced(residual) - self._mu @ gap
            if gradient.sample is not None:
                values[i] += gradient.sample @ sample
            if gradient.reaction is not None:
                values[i] += gradient.reaction @ residual
        return values

    def _solve(self) -> tuple[Array, Array]:
        gradient = self._gradient
        # Derivatives of the quantity with respect to all unknowns (n,) and the multipliers (k,).
        right_side, multiplier = self._system.reduced(gradient.displacement), gradient.multiplier.copy()
        if gradient.sample is not None:
            right_side += self._dsample.T @ gradient.sample
        if gradient.reaction is not None:
            right_side += self._system.reduced(self._system.K @ gradient.reaction) - self._dforce.T @ gradient.reaction
            multiplier -= self._B @ gradient.reaction
        w, mu = self._saddle_point_solution(right_side, multiplier)
        pairing_terms = self._pairing_product(w, mu)
        if not pairing_terms.any():
            return w, mu
        zero = np.zeros(self._k)

        def product(s: Array) -> Array:
            return s + self._pairing_product(*self._saddle_point_solution(s, zero))

        n = len(right_side)
        operator = LinearOperator((n, n), product)
        s, info = gmres(operator, pairing_terms, rtol=TOLERANCE, atol=0.0, restart=SOLUTIONS, maxiter=1)
        if info:
            raise ConvergenceError(
                f"the adjoint equations of the moving contact geometry do not converge in {self.solutions} solutions: "
                "keep the pairing (Criteria(keep_pairing=True)), or use finite differences of two solutions"
            )
        return self._saddle_point_solution(right_side - s, multiplier)

    def _saddle_point_solution(self, right_side: Array, multiplier: Array) -> tuple[Array, Array]:
        """Return ``J0^-T`` applied to right-hand sides (n,) and (k,), by one solution of the linear solver."""
        self.solutions += 1
        loaded = self._solver.load(np.ascontiguousarray(right_side))
        w, force = loaded.solve(self._rows, -multiplier, self._C)
        return w, -force

    def _pairing_product(self, w: Array, mu: Array) -> Array:
        """Return ``E.T y`` (n,)."""
        system, bodies = self._system, self._contact.problem.floating_bodies
        product = self._dgap.T @ mu - self._dforce.T @ (w if system.T is None else system.T @ w)
        if bodies is not None:
            product[bodies.dofs] -= bodies.stiffness * w[bodies.dofs]
        return product
