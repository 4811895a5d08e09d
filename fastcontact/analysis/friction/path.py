"""Coulomb friction along the load path within a step, in increments with one Delassus operator.

If a load step is solved at once, the slip of a constraint is counted from the beginning of the step, although a constraint
that closes within the step slides only after it has closed. Here the load increment is divided at the instants at which
constraints close, and constraints carry no forces before they close. Several constraints may close in one increment;
each slides from its own instant. These instants are found by linear interpolation of gaps. With the geometry and the Delassus
operator F at the end of the step, gaps vary linearly with the load while no constraint closes or opens, and none changes
between stick and slip. The result hardly depends on whether a force or a motion grows linearly in the step, because the
constraints close in the same order.

Let ``(g, s) = free + F y`` be the gaps and slips at the end of the step for forces y. At its beginning there are gaps g0,
forces y0 and no slips. At a fraction p of the step, gaps and slips for forces y are
``free + (1 - p) * ((g0, 0) - free - F y0) + F y``.

If normals are inclined, a constraint that closes has a tangential relative displacement that is not slip. The correction for
closing the whole gap g0 is part of `free`. An increment that closes a fraction of g0 counts the same fraction of the
correction.

The last increment depends on the earlier ones only through their slips, which stay fixed while the geometry converges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fastcontact.analysis.friction.cone_newton import Forces
from fastcontact.analysis.solution import Slid, Solution
from fastcontact.arrays import Array, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.round_off import SINGLE_PRECISION

# Function that solves an increment, given gaps and slips (1 + k, m) [length] to be added, the constraints (m,) that may
# close, those of them that are closed initially, and initial forces (1 + k, m) [force] or None.
Increment = Callable[[Array, Mask, Mask, Array | None], Forces]
# Number of constraints that may close in one increment, relative to the number of closed ones. In 3D `along` admits more
# while few are closed.
GROWTH = 1 / 32


def along(
    lag: Array, closing: Array, y: Array, waiting: Mask, solve: Increment
) -> tuple[Forces, Array, tuple[Array, Array, Array, Array]]:
    """Return the forces at the end of a load step that is solved in increments, which end where constraints close.

    Parameters
    ----------
    lag : ndarray (1 + k, m)
        Gaps and slips at the beginning of the step, minus those at its end under the forces of its beginning [length].
    closing : ndarray (1 + k, m)
        Gaps at the beginning of the step, and the slips that closing them would add, see `Path.along` [length].
    y : ndarray (1 + k, m)
        Normal and tangential forces at the beginning of the step [force].
    waiting : ndarray of bool (m,)
        Constraints that are open at the beginning of the step.
    solve : Increment

    Returns
    -------
    forces : Forces
        Forces at the end of the step, with the slips of the last increment.
    gaps : ndarray (1 + k, m)
        Gaps at the end of the step, and the slips of the whole step [length].
    before : (ndarray (k, m), ndarray (k, m), ndarray (m,), ndarray (m,))
        Slips along the tangents, and their part before the constraint closed [length], frictional work [energy] and
        normal forces [force] at the beginning of the last increment; see `Slid`.
    """
    closed, slip, work, iterations, settled = y[0] > 0.0, np.zeros_like(lag[1:]), np.zeros(lag.shape[1]), 0, True
    gap = last_gap = closing[0]
    approach = np.zeros_like(slip)
    added = np.where(gap > 0.0, closing[1:], 0.0)
    lag = lag + np.vstack([np.zeros_like(gap), added])

    def increment(end: float) -> Forces:
        remaining = (1.0 - end) * lag
        remaining[1:] -= slip
        return solve(remaining, ~waiting, closed, y if y.any() else None)

    def slip_after(increase: Array, gaps: Array) -> Array:
        """Return the slips (k, m) after an `increase` (k, m), less the closing motion left for the `gaps` (m,)."""
        open_fraction = np.divide(np.maximum(gaps, 0.0), gap, out=np.zeros_like(gap), where=gap > 0.0)
        return np.asarray(slip + increase - open_fraction * added)

    begin = 0.0
    while begin < 1.0:
        end, forces = 1.0, increment(1.0)
        iterations += forces.iterations
        if (waiting & (forces.gaps[0] < 0.0)).any():
            # In 3D about as many constraints close together as lie along the edge of the closed region.
            together = max(int(closed.sum() ** (1.0 - 1.0 / len(slip))), int(GROWTH * closed.sum()), 1)
            instants, touching = _touching(last_gap, forces.gaps[0], waiting, together)
            fraction = min(float(instants[touching].max()), 1.0)
            end = begin + fraction * (1.0 - begin)
            since = np.where(touching, instants, 0.0) * forces.gaps[1:]
            slip = np.where(touching, slip_after(since, np.zeros_like(gap)), slip)
            approach = np.where(touching, slip, approach)
            waiting = waiting & ~touching
            forces = increment(end)
            iterations += forces.iterations
        before = slip, approach, work.copy(), y[0]
        work += friction_work(y[0], forces.y[0], forces.y[1:], np.where(forces.closed, forces.gaps[1:], 0.0))
        total_slip = slip + forces.gaps[1:]
        slip = slip_after(forces.gaps[1:], forces.gaps[0])
        begin, y, closed, last_gap = end, forces.y, forces.closed, forces.gaps[0]
        settled &= forces.settled
    gaps = np.vstack([forces.gaps[:1], total_slip])
    return replace(forces, iterations=iterations, settled=settled), gaps, before


def _touching(begin: Array, end: Array, waiting: Mask, count: int) -> tuple[Array, Mask]:
    """Return the fractions (m,) of the remaining step at which constraints close, and the next `count` of them (m,).

    `begin` and `end` are the gaps (m,) now and at the end of the step, if the `waiting` constraints (m,) carry no forces
    [length]. Fractions of constraints that do not close are infinite.
    """
    closing = waiting & (end < 0.0)
    # Constraints that penetrate more now than at the end close at once.
    instants = np.where(closing, 0.0, np.inf)
    fraction = np.divide(np.maximum(begin, 0.0), begin - end, out=instants, where=closing & (begin > end))
    last = np.sort(fraction[closing])[:count][-1]
    return fraction, closing & (fraction <= last * (1.0 + SINGLE_PRECISION))


def friction_work(before: Array, normal: Array, tangential: Array, slip: Array) -> Array:
    """Return the frictional work (m,) in an increment [energy].

    The tangential force is integrated over the slip by the trapezoidal rule. Since sliding friction is at its limit, the
    tangential force at the beginning is that at the end, scaled by the ratio of the normal forces.

    Parameters
    ----------
    before, normal : ndarray (m,)
        Normal forces at the beginning and at the end of the increment [force].
    tangential : ndarray (k, m)
        Tangential forces at the end of the increment [force].
    slip : ndarray (k, m)
        Slips in the increment [length].
    """
    ratio = np.divide(before, normal, out=np.zeros_like(normal), where=normal > 0.0)
    return np.asarray(-0.5 * (1.0 + ratio) * (tangential * slip).sum(axis=0))


def shifted(constraints: Constraints, slid: Slid) -> Constraints:
    """Return the constraints with slips measured from the beginning of the last increment."""
    before = np.stack([(slid.slip * tangent).sum(axis=1) for tangent in constraints.directions])
    return replace(constraints, slip0=constraints.slip0 - before)


def completed(solution: Solution, slid: Slid) -> Solution:
    """Return the solution with the slips and the frictional work of the step, given the solution of `shifted` constraints."""
    last = np.where(solution.active[:, None], solution.slip, 0.0)
    work = slid.work + friction_work(slid.normal, solution.multiplier, solution.tangential.T, last.T)
    before, approach = (
        np.stack([(vectors * tangent).sum(axis=1) for tangent in solution.directions], axis=1)
        for vectors in (slid.slip, slid.approach)
    )
    return replace(solution, slip=solution.slip + before, work=work, approach=approach)
