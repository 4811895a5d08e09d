"""Frictionless contact by a primal-dual active set: ``K u = f + B.T multiplier``, ``0 <= multiplier _|_ gap >= 0``.

The gap is ``gap0 + B u + C multiplier``; the compliance C of the constraints themselves, symmetric and positive
semidefinite, is absent in most formulations.

The primal-dual active set (Hintermueller, Ito and Kunisch, 2003) changes all wrong constraints at once and usually
settles in a few solutions, but it can cycle. ``B K^-1 B.T + C`` is symmetric positive definite when no constraint
repeats others, so the problem is a linear complementarity problem with a P-matrix; when a set comes back, the solver
therefore goes on changing only the wrong constraint with the lowest number, which never repeats a set and so ends
(Murty, 1974).

Solvers that iterate need not finish for a set that changes anyway: they are watched, and left as soon as signs beyond
the error that their residual leaves ask for another set. This ends too: no set is left early to change back what an earlier
one was left for, since signs that contradict each other so are those of errors; every constraint changes early at most
once, and what follows is the method above from some start. A state counts as settled only from a finished solution.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.linalg import lu_solve

from fastcontact.analysis.solution import Accuracy, Equilibrium, Response
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
        Set to start from.
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
    """Return how a solution responds to further forces and gaps, the active constraints being `rows`."""
    R, compliance = constraints.B[rows], constraints.normal_compliance
    at_rest = loaded.involved_solution(np.zeros(R.shape[1]), None)
    F = loaded.delassus(R)[1]
    C = None if compliance is None else compliance.block(rows)
    if C is not None:
        F = F + (np.diag(C) if C.ndim == 1 else C)
    factors = lu_factors(F) if len(rows) else None

    def respond(force: Array, gaps: Array) -> Array:
        u = loaded.involved_solution(force, None) - at_rest
        if factors is None:
            return u
        forces = lu_solve(factors, -(R @ u + gaps[rows]))
        return u + loaded.involved_solution(R.T @ forces, None) - at_rest

    return respond


def _first_changed(active: Mask, wanted: Mask) -> Mask:
    """Return the active set with only the first of the wanted changes."""
    active = active.copy()
    first = np.flatnonzero(active != wanted)[0]
    active[first] = wanted[first]
    return active


class _Signs:
    """Which constraints a solution wants active: by the signs of gaps and multipliers, beyond their tolerances."""

    def __init__(self, constraints: Constraints, accuracy: Accuracy) -> None:
        self._constraints, self._accuracy = constraints, accuracy
        self.usable = constraints.usable
        none = np.zeros(len(constraints), bool)
        self.equations: Mask = none if constraints.equality is None else self.usable & constraints.equality

    def of(self, u: Array, forces: Array, active: Mask, iteration: int, error: float = 0.0) -> Equilibrium:
        """Return the solution with unknowns (n,) and forces of the active constraints, with the set it wants.

        Signs within errors of relative size `error`, those of an unfinished solution, do not count.
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
    """Looks at unfinished solutions, and ends them when their signs ask for another set; see `linear.protocol.Monitor`.

    Attributes
    ----------
    wanted : ndarray of bool (m,) or None
        The set that the last solution looked at asks for; None where that is the present one.
    """

    def __init__(self, signs: _Signs, active: Mask, changed: Mask) -> None:
        self._signs, self._active, self._changed = signs, active, changed
        self.wanted: Mask | None = None

    def __call__(self, u: Array, forces: Array, error: float) -> bool:
        """Return whether the signs ask for another set; errors of relative size `error` do not count.

        A set that changes back constraints that were `changed` before does not count either.
        """
        signs = self._signs.of(u, forces, self._active, 0, error)
        again = (signs.wanted != self._active) & self._changed
        self.wanted = None if signs.settled or again.any() else signs.wanted
        return self.wanted is not None
