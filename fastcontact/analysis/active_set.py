"""Primal-dual active set method for frictionless contact.

With the stiffness matrix K, displacements u, external forces f, and the matrix B of the constraints, the problem is
``K u = f + B.T multiplier`` with ``multiplier >= 0``, ``gap >= 0`` and ``multiplier * gap = 0`` for each constraint. The
gap is ``gap0 + B u + C multiplier``. C is the compliance of the constraints themselves, symmetric and positive
semidefinite; it is zero in most formulations.

The primal-dual active set method (Hintermueller, Ito and Kunisch, 2003) changes all constraints whose signs are wrong at
once. It usually converges in a few solutions, but it can cycle. If the constraints are linearly independent,
``B K^-1 B.T + C`` is symmetric positive definite, so that the problem is a linear complementarity problem with a P-matrix.
When a set recurs, the solver therefore continues with the least-index rule: it only changes the wrong constraint with the
lowest number. No set is then repeated, and the method terminates (Murty, 1974).

An iterative linear solver need not converge for a set that will change anyway. It is monitored, and stopped as soon as signs
beyond the error bound of its residual require a different set. The method still terminates: such an early change is never
undone by a second one, because contradicting signs are due to errors, so that each constraint changes early at most once.
Convergence is only accepted if the linear solution has converged.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import lu_solve

from fastcontact.analysis.solution import Accuracy, Equilibrium, Response, response
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.linear.delassus import lu_factors
from fastcontact.linear.protocol import Loaded


def solve(
    loaded: Loaded, constraints: Constraints, active: Mask, accuracy: Accuracy, guess: Array | None = None
) -> Equilibrium:
    """Return the displacements and the contact forces that satisfy all inequalities.

    Parameters
    ----------
    loaded : Loaded
        Prepared matrix K (n, n) with the right-hand side f (n,).
    constraints : Constraints
        The m constraints in the n unknowns of the solver. A constraint whose row of B is empty cannot become active.
    active : ndarray of bool (m,)
        Initial active set.
    accuracy : Accuracy
        Tolerances of the signs, and the largest number of iterations.
    guess : ndarray (n,), optional
        Initial guess of the unknowns, for iterative solvers [length].

    Returns
    -------
    Equilibrium
        The solution. Its `settled` is False if the iteration has reached ``accuracy.max_iterations``.
    """
    signs = _Signs(constraints, accuracy)
    active = (active & signs.usable) | signs.equations
    seen: set[bytes] = set()
    changed = np.zeros(len(active), bool)  # constraints that a monitored, unconverged solution has changed
    one_by_one = False
    iteration = 1
    while True:
        watch = _Watch(signs, active, changed)
        rows, compliance = np.flatnonzero(active), constraints.normal_compliance
        C = None if compliance is None else compliance.among(rows)
        nodes = None if constraints.nodes is None else constraints.nodes[rows]
        u, forces = loaded.solve(
            constraints.B[rows], -constraints.gap0[rows], C, guess, watch, accuracy.residual, nodes
        )
        guess = u
        if watch.wanted is not None:
            changed |= active != watch.wanted
            active = watch.wanted
            continue
        sets = signs.of(u, forces, active, iteration)
        if sets.settled or iteration == accuracy.max_iterations:
            return replace(sets, response=partial(_response, loaded, constraints, rows))
        seen.add(active.tobytes())
        one_by_one = one_by_one or sets.wanted.tobytes() in seen
        active = _first_changed(active, sets.wanted) if one_by_one else sets.wanted
        iteration += 1


def _response(loaded: Loaded, constraints: Constraints, rows: Indices) -> Response:
    """Return the linear response to additional forces and gaps, while the constraints `rows` (q,) stay active."""
    R, compliance = constraints.B[rows], constraints.normal_compliance
    F = loaded.delassus(R)[1]
    C = None if compliance is None else compliance.block(rows)
    if C is not None:
        F = F + (np.diag(C) if C.ndim == 1 else C)
    if not len(rows):
        return response(loaded, R, rows, np.negative)
    factors = lu_factors(F)
    return response(loaded, R, rows, lambda gaps: -lu_solve(factors, gaps))


def _first_changed(active: Mask, wanted: Mask) -> Mask:
    """Return the active set (m,), changed only at the first constraint at which it differs from `wanted` (m,)."""
    active = active.copy()
    first = np.flatnonzero(active != wanted)[0]
    active[first] = wanted[first]
    return active


class _Signs:
    """Rule for the next active set, by the signs of gaps and multipliers.

    Attributes
    ----------
    usable : ndarray of bool (m,)
        Constraints that can become active.
    equations : ndarray of bool (m,)
        Constraints that are equations, which are always active.
    """

    def __init__(self, constraints: Constraints, accuracy: Accuracy) -> None:
        self._constraints, self._accuracy = constraints, accuracy
        self.usable = constraints.usable
        none = np.zeros(len(constraints), bool)
        self.equations: Mask = none if constraints.equality is None else self.usable & constraints.equality

    def of(self, u: Array, forces: Array, active: Mask, iteration: int, error: float = 0.0) -> Equilibrium:
        """Return the solution with its next active set.

        Parameters
        ----------
        u : ndarray (n,)
            Unknowns [length].
        forces : ndarray (q,)
            Multipliers of the q active constraints [force].
        active : ndarray of bool (m,)
            Active set of the solution.
        iteration : int
            Number of linear solutions so far.
        error : float
            Relative error of an unconverged solution; signs of values within this error are ignored [-].
        """
        multiplier = np.zeros(len(active))
        multiplier[active] = forces
        gap = self._constraints.gap0 + self._constraints.B @ u
        compliance = self._constraints.normal_compliance
        if compliance is not None:
            gap += compliance.apply(multiplier)
        pull = max(self._accuracy.multiplier, error) * np.abs(forces).max(initial=0.0)
        penetration = max(self._accuracy.gap, error * np.abs(u).max(initial=0.0)) if error else self._accuracy.gap
        wanted = np.where(active, multiplier > -pull, gap < -penetration) & self.usable | self.equations
        return Equilibrium(u, multiplier, gap, active, wanted, iteration)


class _Watch:
    """Monitor that stops an iterative linear solver when signs require a different active set.

    See `linear.protocol.Monitor`. `active` (m,) is the current active set, and `changed` (m,) are the constraints that an
    unconverged solution has changed before.

    Attributes
    ----------
    wanted : ndarray of bool (m,) or None
        The next active set that the last monitored solution requires; None if the solver should continue.
    """

    def __init__(self, signs: _Signs, active: Mask, changed: Mask) -> None:
        self._signs, self._active, self._changed = signs, active, changed
        self.wanted: Mask | None = None

    def __call__(self, u: Array, forces: Array, error: float) -> bool:
        """Return whether signs beyond the relative `error` of the unconverged solution require a different set.

        A set that would undo an earlier change of one of the constraints `changed` is ignored.
        """
        signs = self._signs.of(u, forces, self._active, 0, error)
        again = (signs.wanted != self._active) & self._changed
        self.wanted = None if signs.settled or again.any() else signs.wanted
        return self.wanted is not None
