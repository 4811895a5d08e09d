"""The inequality solver: ``K u = f + B.T multiplier``, ``multiplier >= 0``, ``gap >= 0``, product zero.

The gap is ``gap0 + B u + C multiplier``; the compliance C of the constraints themselves, symmetric and positive
semidefinite, is absent in most formulations.

The primal-dual active set (Hintermueller, Ito and Kunisch, 2003) changes all wrong constraints at once and usually
settles in a few solutions, but it can cycle. ``B K^-1 B.T + C`` is symmetric positive definite when no constraint
repeats others, so the problem is a linear complementarity problem with a P-matrix; when a set comes back, the solver
therefore goes on changing only the wrong constraint with the lowest number, which never repeats a set and so ends
(Murty, 1974).

Solvers that iterate need not finish for a set that changes anyway: they are watched, and left as soon as signs beyond
the error that their residual leaves ask for another set. This ends too: a set that is left early is never left early
again, and after EARLY sets altogether nothing is left early any more; there are finitely many sets, and what follows
is the method above from some start. A state counts as settled only from a finished solution.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.contact.constraints import Compliance
from fastcontact.linear.protocol import Loaded

Array = NDArray[np.float64]
Active = NDArray[np.bool_]
# Unfinished solutions that may be left in all.
EARLY = 40


class State(Protocol):
    """What every inequality solver returns; see `Equilibrium`."""

    @property
    def u(self) -> Array:
        """See `Equilibrium`."""
        ...

    @property
    def multiplier(self) -> Array:
        """See `Equilibrium`."""
        ...

    @property
    def gap(self) -> Array:
        """See `Equilibrium`."""
        ...

    @property
    def active(self) -> Active:
        """See `Equilibrium`."""
        ...

    @property
    def wanted(self) -> Active:
        """See `Equilibrium`."""
        ...

    @property
    def settled(self) -> bool:
        """See `Equilibrium`."""
        ...

    @property
    def iterations(self) -> int:
        """See `Equilibrium`."""
        ...


@dataclass(frozen=True, eq=False)
class Equilibrium:
    """A solution under a set of active constraints.

    Attributes
    ----------
    u : ndarray (n,)
    multiplier, gap : ndarray (m,)
        Of all constraints; the multiplier of inactive ones is zero.
    active : ndarray of bool (m,)
        The set this is the solution of.
    wanted : ndarray of bool (m,)
        The set its signs ask for; equal to `active` when every inequality holds.
    iterations : int
        Linear solutions made.
    """

    u: Array
    multiplier: Array
    gap: Array
    active: Active
    wanted: Active
    iterations: int
    sizes: list[int] = field(default_factory=list)

    @property
    def settled(self) -> bool:
        """Whether all inequalities hold."""
        return bool(np.array_equal(self.active, self.wanted))


def solve(
    loaded: Loaded,
    B: csr_array,
    gap0: Array,
    usable: Active,
    *,
    compliance: Compliance | None = None,
    held: Active | None = None,
    active: Active,
    gap_tolerance: float,
    multiplier_tolerance: float = 1e-12,
    max_iterations: int = 200,
    guess: Array | None = None,
    tolerance: float | None = None,
) -> Equilibrium:
    """Find the displacement and the contact forces that satisfy every inequality.

    Parameters
    ----------
    loaded : Loaded
        Matrix and right-hand side, from a linear solver.
    B : csr_array (m, n)
    gap0 : ndarray (m,)
    usable : ndarray of bool (m,)
        Constraints that may become active at all.
    compliance : Compliance, optional
        C above.
    held : ndarray of bool (m,), optional
        Constraints that are equations: always active, with multipliers of either sign.
    active : ndarray of bool (m,)
        Set to start from.
    gap_tolerance : float
        A gap above minus this counts as open or closed, not as penetration.
    multiplier_tolerance : float
        A multiplier above minus this fraction of the largest one counts as compression.
    max_iterations : int
        Linear solutions allowed; the result may then not be settled.
    guess : ndarray (n,), optional
        Displacement to start iterative solvers from.
    tolerance : float, optional
        Relative residual for iterative solvers where less than their own tolerance will do.

    Returns
    -------
    Equilibrium
    """
    equations = usable & held if held is not None else np.zeros(len(gap0), bool)
    active = (active & usable) | equations
    seen: set[bytes] = set()
    single = False
    sizes: list[int] = []
    left: set[bytes] = set()
    iteration = 1
    while True:
        rows = np.flatnonzero(active)
        C = compliance.block(rows) if compliance is not None else None
        watch = None
        if C is None and len(left) < EARLY and active.tobytes() not in left:
            watch = _Watch(B, gap0, active, usable, equations, gap_tolerance, multiplier_tolerance)
        u, forces = loaded.solve(B[rows], -gap0[rows], C, guess, watch, tolerance)
        if watch is not None and watch.wanted is not None:
            left.add(active.tobytes())
            active, guess = watch.wanted, u
            continue
        multiplier = np.zeros(len(gap0))
        multiplier[rows] = forces
        gap = gap0 + B @ u
        if compliance is not None:
            gap += compliance.apply(multiplier)
        largest = np.abs(forces).max(initial=0.0)
        wanted = np.where(active, multiplier > -multiplier_tolerance * largest, gap < -gap_tolerance) & usable
        wanted |= equations
        sizes.append(len(rows))
        state = Equilibrium(u, multiplier, gap, active, wanted, iteration, sizes)
        if state.settled or iteration == max_iterations:
            return state
        seen.add(active.tobytes())
        single = single or wanted.tobytes() in seen
        if single:
            active = active.copy()
            first = np.flatnonzero(active != wanted)[0]
            active[first] = wanted[first]
        else:
            active = wanted
        guess = u
        iteration += 1


class _Watch:
    """Looks at unfinished solutions for a set of active constraints, and says when to leave; see `linear.Monitor`.

    Attributes
    ----------
    wanted : ndarray of bool (m,) or None
        The set that the last solution looked at asks for; None where that is the present one.
    """

    def __init__(
        self, B: csr_array, gap0: Array, active: Active, usable: Active, equations: Active, gap_tolerance: float,
        multiplier_tolerance: float,
    ) -> None:  # fmt: skip
        self.B, self.gap0, self.active, self.usable, self.equations = B, gap0, active, usable, equations
        self.gap_tolerance, self.multiplier_tolerance = gap_tolerance, multiplier_tolerance
        self.wanted: Active | None = None

    def __call__(self, u: Array, forces: Array, error: float) -> bool:
        """Return whether the signs ask for another set; errors of relative size `error` do not count."""
        gap = self.gap0 + self.B @ u
        open_gap = max(self.gap_tolerance, error * float(np.abs(u).max(initial=0.0)))
        pull = max(self.multiplier_tolerance, error) * float(np.abs(forces).max(initial=0.0))
        multiplier = np.zeros(len(gap))
        multiplier[self.active] = forces
        wanted = np.where(self.active, multiplier > -pull, gap < -open_gap) & self.usable | self.equations
        self.wanted = None if np.array_equal(wanted, self.active) else wanted
        return self.wanted is not None
