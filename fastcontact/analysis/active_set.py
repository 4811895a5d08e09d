"""Frictionless contact by a primal-dual active set: ``K u = f + B.T multiplier``, ``0 <= multiplier _|_ gap >= 0``.

The gap is ``gap0 + B u + C multiplier``; the compliance C of the constraints themselves, symmetric and positive
semidefinite, is absent in most formulations.

The primal-dual active set (Hintermueller, Ito and Kunisch, 2003) changes all wrong constraints at once and usually
converges in a few solutions, but it can cycle. ``B K^-1 B.T + C`` is symmetric positive definite when the constraints are
linearly independent, so the problem is a linear complementarity problem with a P-matrix; when a set recurs, the solver
therefore continues by changing only the wrong constraint with the lowest number, which never repeats a set and so terminates
(Murty, 1974).

Iterative solvers need not finish for a set that will change anyway: they are monitored, and stopped as soon as signs beyond
the error bound of their residual require another set. This terminates too: no iteration is stopped early to undo an earlier
early change, since such contradicting signs are due to errors. Every constraint changes early at most once, and then the
method above follows. Convergence is only accepted from a finished solution.
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
    """Find the displacement and the contact forces that satisfy every inequality.

    Parameters
    ----------
    loaded : Loaded
        Matrix and right-hand side, from a linear solver.
    constraints : Constraints
        Rows for the unknowns of the solver; an empty row is a constraint that cannot become active.
    active : ndarray of bool (m,)
        Initial active set.
    accuracy : Accuracy
    guess : ndarray (n,), optional
        Unknowns to start iterative solvers from [length].

    Returns
    -------
    Equilibrium
    """
    signs = _Signs(constraints, accuracy)
    active = (active & signs.usable) | signs.equations
    seen: set[bytes] = set()
    changed = np.zeros(len(active), bool)  # early
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
    """Return the response of a solution with active constraints `rows` to additional forces and gaps."""
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
    """Return the active set with only the first of the wanted changes."""
    active = active.copy()
    first = np.flatnonzero(active != wanted)[0]
    active[first] = wanted[first]
    return active


class _Signs:
    """The next active set of a solution: by the signs of gaps and multipliers, beyond their tolerances."""

    def __init__(self, constraints: Constraints, accuracy: Accuracy) -> None:
        self._constraints, self._accuracy = constraints, accuracy
        self.usable = constraints.usable
        none = np.zeros(len(constraints), bool)
        self.equations: Mask = none if constraints.equality is None else self.usable & constraints.equality

    def of(self, u: Array, forces: Array, active: Mask, iteration: int, error: float = 0.0) -> Equilibrium:
        """Return the solution with unknowns (n,) and forces of the active constraints, and its next active set.

        Signs within the relative `error` of an unfinished solution are ignored.
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
    """Monitor that stops unfinished solutions when their signs require another active set; see `linear.protocol.Monitor`.

    Attributes
    ----------
    wanted : ndarray of bool (m,) or None
        The next active set by the last monitored solution; None if it equals the current one.
    """

    def __init__(self, signs: _Signs, active: Mask, changed: Mask) -> None:
        self._signs, self._active, self._changed = signs, active, changed
        self.wanted: Mask | None = None

    def __call__(self, u: Array, forces: Array, error: float) -> bool:
        """Return whether signs beyond the relative `error` require another set.

        Sets that would undo changes of constraints `changed` before are ignored.
        """
        signs = self._signs.of(u, forces, self._active, 0, error)
        again = (signs.wanted != self._active) & self._changed
        self.wanted = None if signs.settled or again.any() else signs.wanted
        return self.wanted is not None
