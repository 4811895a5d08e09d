"""Coulomb friction along the path of a load step, in increments on one Delassus operator.

A step solved at once counts the slip of a constraint from the beginning of the step, although a constraint that closes within
the step only slides from first touch on. Here the load increment is applied in equal parts, with the geometry and the
Delassus operator F of the end of the step. With gaps and slips ``(g, s) = free + F y`` at the end, and gaps g0 and
forces y0 at the beginning, where s = 0, those at a fraction p of the step are ``free + (1 - p) ((g0, 0) - free - F y0) +
F y``. Closing is no slip where normals are inclined: the correction for closing g0 is part of `free`, and each increment
counts the part that belongs to what it closes of the gap.

The last increment depends on the earlier ones only through their slips, which stay fixed while the geometry converges.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from fastcontact.analysis.friction.cone_newton import Forces
from fastcontact.analysis.solution import FrictionalEquilibrium, Slid
from fastcontact.arrays import Array, Mask
from fastcontact.contact.constraints import Constraints


def along(
    lag: Array, closing: Array, y: Array, parts: int, solve: Callable[[Array, Mask, Array | None], Forces]
) -> tuple[Forces, tuple[Array, Array, Array]]:
    """Return the forces at the end of a step, and `Slid.slip` along tangents (k, m), `work` and `normal` there.

    Parameters
    ----------
    lag : ndarray (1 + k, m)
        Gaps and slips at the beginning minus those at the end under the forces of the beginning [length].
    closing : ndarray (1 + k, m)
        Gaps at the beginning, and the slips that closing them would add, see `Path.closed` [length].
    y : ndarray (1 + k, m)
        Forces at the beginning [force].
    parts : int
    solve : callable
        Function of additional gaps and slips, initially closed constraints and initial forces that returns the forces.
    """
    closed, slip, work, iterations, settled = y[0] > 0.0, np.zeros_like(lag[1:]), np.zeros((2, lag.shape[1])), 0, True
    gap = closing[0]
    added = np.where(gap > 0.0, closing[1:], 0.0)
    lag = lag + np.vstack([np.zeros_like(gap), added])
    for part in range(1, parts + 1):
        beside = (1.0 - part / parts) * lag
        beside[1:] -= slip
        before = slip, work.copy(), y[0]
        forces = solve(beside, closed, y if y.any() else None)
        work += friction_work(y[0], forces.y[0], forces.y[1:], np.where(forces.closed, forces.gaps[1:], 0.0))
        whole = slip + forces.gaps[1:]
        left = np.divide(np.maximum(forces.gaps[0], 0.0), gap, out=np.zeros_like(gap), where=gap > 0.0)
        slip = whole - left * added
        y, closed = forces.y, forces.closed
        iterations += forces.iterations
        settled &= forces.settled
    gaps = np.vstack([forces.gaps[:1], whole])
    return replace(forces, gaps=gaps, iterations=iterations, settled=settled), before


def friction_work(before: Array, normal: Array, tangential: Array, slip: Array) -> Array:
    """Return the frictional work of constraints in an increment, and that of constraints that close in it, both (2, m).

    The mean tangential forces are those at the end (k, m) times the ratio of the mean of the normal forces at both ends
    to that at the end (m,), because sliding friction is at its limit; `before` are the normal forces at the beginning.
    Slips are (k, m).
    """
    once = -0.5 * (tangential * slip).sum(axis=0)
    ratio = np.divide(before, normal, out=np.zeros_like(normal), where=normal > 0.0)
    return np.stack([(1.0 + ratio) * once, np.where(before == 0.0, once, 0.0)])


def shifted(constraints: Constraints, slid: Slid) -> Constraints:
    """Return constraints whose slips are measured from the last increment on."""
    before = np.stack([(slid.slip * tangent).sum(axis=1) for tangent in constraints.directions])
    return replace(constraints, slip0=-before if constraints.slip0 is None else constraints.slip0 - before)


def completed(solution: FrictionalEquilibrium, slid: Slid) -> FrictionalEquilibrium:
    """Return the solution of `shifted` constraints with the slip and the work of the whole step."""
    last = np.where(solution.active[:, None], solution.slip, 0.0)
    work = slid.work + friction_work(slid.normal, solution.multiplier, solution.tangential.T, last.T)
    before = np.stack([(slid.slip * tangent).sum(axis=1) for tangent in solution.directions], axis=1)
    return replace(solution, slip=solution.slip + before, work=work)
