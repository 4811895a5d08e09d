"""Coulomb friction with eliminated constraints: the Delassus operator is not formed.

In a step of Newton's method closed gaps and sticking slips are equations. A sliding constraint has the friction force
``mu n`` along its direction d: its multiplier acts through the rows ``B + mu d T``, see `linear.protocol`. In three
dimensions t rotates with the slip, which acts as a spring perpendicular to d: ``t = mu n d - stiffness (s - (d s) d)``.
Penalties are a diagonal compliance of these equations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.sparse import csr_array, vstack

from fastcontact.analysis.friction.cone_newton import EXACT, Forces, newton
from fastcontact.analysis.friction.coulomb_law import Law
from fastcontact.analysis.friction.slip_directions import GIVING, aligning, compliance_of_rows, idle
from fastcontact.analysis.solution import Accuracy
from fastcontact.analysis.tolerances import RESIDUAL
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.errors import ConvergenceError
from fastcontact.linear.choice import LOOSEST
from fastcontact.linear.protocol import MILD, FrictionTerms, LoadedNonsymmetric
from fastcontact.linear.sparse_rows import scaled, taken
from fastcontact.linear.springs import Springs
from fastcontact.round_off import TINY

# Bound of the tangential stiffness perpendicular to a slip, which is unbounded as the slip vanishes, over the stiffness
# of the constraint. The solution does not depend on it, because the slip has no perpendicular component there.
STIFFEST = 100.0
# Factor by which constraints are assumed softer than the diagonal of their unknowns, since neighbouring nodes deform as well.
# Nearly incompressible cells resist a single node far more than a surface (`LinearSolver.contrast`): beyond MILD, constraints
# are softer still, by its square root; otherwise Newton's method reverses a few slips repeatedly (nu = 0.4999, 161 442
# unknowns: 588 iterations without convergence; nu = 0.499 was not affected).
SOFTER = 0.2
# Tolerance of the residual of the friction law over that of the linear solutions, and the looser one after PATIENCE
# steps: contact forces that are a small fraction of all forces cannot be more accurate.
ENOUGH, ACCEPTABLE, PATIENCE = 10.0, 300.0, 12


def solve(
    loaded: LoadedNonsymmetric,
    constraints: Constraints,
    closed: Mask,
    accuracy: Accuracy,
    u: Array,
    forces: Array | None,
) -> tuple[Array, Forces] | None:
    """Return displacement and forces, or None where the method fails.

    Parameters
    ----------
    loaded : LoadedNonsymmetric
    constraints : Constraints
        See `friction.solve`; without compliance except `softness` and `tangential_softness`.
    closed : ndarray of bool (m,)
        Constraints that are closed and sticking at first.
    accuracy : Accuracy
        Accuracy, whose residual is that of the linear solutions.
    u : ndarray (n,)
        Initial unknowns [length].
    forces : ndarray (1 + k, m), optional
        Initial forces [force].
    """
    tolerance, steps = accuracy.residual or 0.0, accuracy.max_newton_steps
    problem = Eliminated(loaded, constraints, u, tolerance, inexact=steps is None)
    y, gaps = problem.start(forces)
    try:
        if forces is None or not forces.any():
            sticking = closed if closed.any() else gaps[0] < 0.0
            equality = constraints.equality
            state = sticking if equality is None else sticking | equality, sticking
        else:
            state = problem.law.state(y, gaps)
        # At least once, because initial forces and displacements are not in balance.
        y, gaps = problem.step(y, gaps, *state)
        if not state[0].any():  # no constraint was closed: start from the displacements without contact
            y, gaps = problem.step(y, gaps, gaps[0] < 0.0, gaps[0] < 0.0)
        exact = max(EXACT, ENOUGH * tolerance)
        iterate = newton(problem, y, gaps, exact, PATIENCE if steps is None else steps - 1)
        if problem.finish():
            y, gaps = problem.step(iterate.y, iterate.gaps, iterate.closed, iterate.sticking)
            iterate = newton(problem, y, gaps, exact, PATIENCE)
        if steps is None and not iterate.settled:
            if iterate.residual > ACCEPTABLE * tolerance:
                iterate = newton(problem, iterate.y, iterate.gaps, exact)
            iterate = replace(iterate, settled=iterate.settled or iterate.residual <= ACCEPTABLE * tolerance)
            if not iterate.settled:
                return None
        if iterate.y is not problem.reached:  # between two steps: displacements are only known at their ends
            problem.step(iterate.y, iterate.gaps, iterate.closed, iterate.sticking)
    except ConvergenceError:
        return None
    return problem.u, problem.unscaled(iterate)


class Eliminated:
    """See `cone_newton.Linearised`: forces and gaps in units of each constraint's own stiffness.

    Attributes
    ----------
    u : ndarray (n,)
        Displacement at the end of the last step.
    reached : ndarray (1 + k, m)
        Scaled forces at the end of the last step.
    """

    def __init__(
        self, loaded: LoadedNonsymmetric, constraints: Constraints, u: Array, tolerance: float, inexact: bool
    ) -> None:
        usable, mu = constraints.usable, constraints.coefficients
        rows, free = (constraints.B, *constraints.tangents), constraints.gaps_at_rest()
        self._loaded, self._usable, self._tolerance = loaded, usable, tolerance
        self._inexact, self._last = inexact, tolerance
        self._nodes = np.arange(len(constraints)) if constraints.nodes is None else constraints.nodes
        k, m = len(rows) - 1, len(constraints)
        yielding = np.divide(1.0, diagonal := loaded.diagonal(), out=np.zeros(len(u)), where=diagonal > 0.0)
        self._gives = diagonal_compliance(constraints)
        compliance = self._compliance_of_rows(rows, yielding)
        self._turn = aligning(compliance, constraints.directions) if k == 2 else None
        if self._turn is not None:
            turned = csr_array(self._turn @ vstack(rows, format="csr"))
            rows = tuple(turned[a * m : (a + 1) * m] for a in range(3))
            free = (self._turn @ free.ravel()).reshape(free.shape)
            compliance = self._compliance_of_rows(rows, yielding)
        still = idle(compliance)
        moved = still & constraints.moved_past(np.arange(m), self._turn)
        self._gives[1:][moved] += np.broadcast_to(GIVING * compliance[0, 0], still.shape)[moved]
        slipping = [scaled(T, np.where(off, 0.0, 1.0)) for T, off in zip(rows[1:], still, strict=True)]
        self._rows = (rows[0], *slipping)
        self._free = np.vstack([free[0], np.where(still & ~moved, 0.0, free[1:])])
        self._slips = ~still | moved
        softer = SOFTER / np.sqrt(max(1.0, loaded.contrast / MILD))
        self._unit = np.sqrt(1.0 / (np.where(compliance[0, 0] > 0.0, compliance[0, 0], 1.0) / softer + self._gives[0]))
        equality = constraints.equality
        self.law = Law(np.where(usable, mu, 0.0), None if equality is None else equality & usable)
        self.u = u
        self.round_off = float(
            16 * np.finfo(float).eps * np.abs(self._unit * self._gaps(u))[:, usable].max(initial=0.0)
        )

    def _compliance_of_rows(self, rows: tuple[csr_array, ...], yielding: Array) -> Array:
        """Return `compliance_of_rows` plus the tangential compliance: directions with compliance are not idle."""
        compliance = compliance_of_rows(rows, yielding)
        slips = np.arange(1, len(rows))
        compliance[slips, slips] += self._gives[1:]
        return compliance

    def start(self, forces: Array | None) -> tuple[Array, Array]:
        """Return scaled forces and gaps of the initial displacement."""
        y = np.zeros_like(self._free) if forces is None else np.where(self._usable, forces, 0.0)
        if self._turn is not None:
            y = (self._turn @ y.ravel()).reshape(y.shape)
        y[1:][~self._slips] = 0.0
        self.reached = y / self._unit
        return self.reached, self._scaled(self._gaps(self.u, y))

    def unscaled(self, scaled: Forces) -> Forces:
        """Return unscaled forces and gaps along the original tangents."""
        y = self.reached * self._unit
        gaps = self._gaps(self.u, y)
        if self._turn is not None:
            y, gaps = ((self._turn.T @ values.ravel()).reshape(values.shape) for values in (y, gaps))
        return Forces(y, gaps, scaled.closed, scaled.sticking, scaled.settled, scaled.residual, 1 + scaled.iterations)

    def _gaps(self, u: Array, forces: Array | float = 0.0) -> Array:
        return self._free + np.stack([R @ u for R in self._rows]) + self._gives * forces

    def _scaled(self, gaps: Array) -> Array:
        """Return scaled gaps; constraints that cannot close count as open."""
        gaps = np.where(self._usable, gaps * self._unit, 0.0)
        gaps[0, ~self._usable] = 1.0
        return gaps

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        """See `cone_newton.Linearised.step`."""
        closed = closed & self._usable
        shut = np.flatnonzero(closed)
        equations = (shut, *(np.flatnonzero(closed & sticking & slips) for slips in self._slips))
        B = csr_array(vstack([taken(R, at) for R, at in zip(self._rows, equations, strict=True)], format="csr"))
        c = -np.concatenate([free[at] for free, at in zip(self._free, equations, strict=True)])
        sliding = self._sliding(y, gaps, np.flatnonzero(closed & ~sticking & (self.law.mu > 0.0)))
        drag = self._drag(B, shut, sliding) if len(sliding.at) else None
        nodes = self._nodes[np.concatenate(equations)]
        C = np.concatenate([gives[at] for gives, at in zip(self._gives, equations, strict=True)])
        self._last = self._accuracy(y, gaps)
        u, multiplier = self._loaded.solve_nonsymmetric(B, c, nodes, self.u, self._last, drag, C)
        new, first = np.zeros_like(y), 0
        for increment, at in zip(new, equations, strict=True):
            increment[at] = multiplier[first : first + len(at)]
            first += len(at)
        new[1:, sliding.at] += sliding.force(new[0, sliding.at], u)
        self.u, self.reached = u, new / self._unit
        return self.reached, self._scaled(self._gaps(u, new))

    def _accuracy(self, y: Array, gaps: Array) -> float:
        """Return the relative residual of the linear solution of a step from forces `y` and `gaps`.

        Steps follow the residual of the friction law, as the solutions of pairings do, up to LOOSEST: looser steps change the
        directions of slips that hardly move. The last step is exact.
        """
        if not self._inexact:
            return self._tolerance
        size = float(np.abs(y).max(initial=0.0))
        off = float(np.abs(self.law.residual(y, gaps)).max(initial=0.0))
        return max(self._tolerance, min(RESIDUAL * off / size, LOOSEST) if size else LOOSEST)

    def finish(self) -> bool:
        """Make further steps exact; return whether the last one was inexact."""
        self._inexact = False
        return self._last > self._tolerance

    def _sliding(self, y: Array, gaps: Array, at: Indices) -> _Sliding:
        """Return slip directions and friction rows of the sliding constraints `at` (q,)."""
        d, turning = self.law.slide(y, gaps, at)
        pull = self.law.mu[at] * d
        if len(d) == 1:
            return _Sliding(at, pull)
        across = np.stack([-d[1], d[0]])
        rows = sum(scaled(taken(T, at), factor) for factor, T in zip(across, self._rows[1:], strict=True))
        spring = np.minimum(turning / np.maximum(1.0 - turning, TINY), STIFFEST) * self._unit[at] ** 2
        spring = spring / (1.0 + spring * self._gives[1, at])  # in series with that of the constraint
        return _Sliding(
            at, pull, _Across(across, Springs(csr_array(rows), spring), (across * self._free[1:, at]).sum(axis=0))
        )

    def _drag(self, B: csr_array, shut: Indices, sliding: _Sliding) -> FrictionTerms:
        """Return the frictional terms of equations B whose first rows are the gaps of `shut`."""
        pull = np.zeros((len(self._rows) - 1, len(self._usable)))
        pull[:, sliding.at] = sliding.pull
        through = taken(self._rows[0], shut)
        for T, factor in zip(self._rows[1:], pull, strict=True):
            through = through + scaled(taken(T, shut), factor[shut])
        through = csr_array(vstack([through, B[len(shut) :]], format="csr"))
        if sliding.springs is None:
            return FrictionTerms(through)
        across = sliding.springs
        pushed = across.springs.rows.T @ (across.springs.stiffness * across.free)
        return FrictionTerms(through, across.springs, -pushed)


def diagonal_compliance(constraints: Constraints) -> Array:
    """Return the diagonal compliance of constraints along normals and tangents (1 + k, m) [length / force]."""
    compliance = np.zeros((1 + len(constraints.tangents), len(constraints)))
    if constraints.softness is not None:
        compliance[0] = constraints.softness
    if constraints.tangential_softness is not None:
        compliance[1:] = constraints.tangential_softness
    return compliance


@dataclass(frozen=True, eq=False)
class _Across:
    """Springs perpendicular to slips: directions (k, q), and perpendicular slips (q,) at u = 0."""

    along: Array
    springs: Springs
    free: Array


@dataclass(frozen=True, eq=False)
class _Sliding:
    """Sliding constraints `at` (q,): tangential over normal forces (k, q), and springs in three dimensions."""

    at: Indices
    pull: Array
    springs: _Across | None = None

    def force(self, normal: Array, u: Array) -> Array:
        """Return the tangential forces (k, q)."""
        dragged = self.pull * normal
        if self.springs is None:
            return dragged
        across, springs = self.springs, self.springs.springs
        return np.asarray(dragged - across.along * springs.stiffness * (springs.rows @ u + across.free))
