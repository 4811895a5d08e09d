"""Coulomb friction along the path of a load step, in increments on one Delassus operator.

A step that is solved at once counts the slip of a constraint from its beginning, although one that closes within it slides
from where it touches only. Here the forces that the step changes are applied in equal parts, the geometry and the Delassus
operator F being those of its end. With gaps and slips ``(g, s) = free + F y`` at the end, and gaps g0 and forces y0 at the
beginning, where s = 0, those at a part p of the step are ``free + (1 - p) ((g0, 0) - free - F y0) + F y``. In s closing is no
slip, however normals lean: a correction for all of g0 is part of `free`, and each increment has that for the gap it closes.

The last increment depends on the others by the slips before it alone. They stay as they are while the geometry settles.
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
    lag: Array, begin: Array, y: Array, parts: int, solve: Callable[[Array, Mask, Array | None], Forces]
) -> tuple[Forces, tuple[Array, Array, Array]]:
    """Return the forces at the end of a step, and `Slid.slip` along tangents (k, m), `work` and `normal` there.

    Parameters
    ----------
    lag : ndarray (1 + k, m)
        What gaps and slips at the beginning are above those at the end under the forces of the beginning [length].
    begin : ndarray (1 + k, m)
        Gaps at the beginning, and by how much slips are corrected for closing them, see `Path.closed` [length].
    begin : ndarray (1 + k, m)
        Gaps at the beginning, and what slips at the end contain for closing them, see `Path.closed` [length].
    y : ndarray (1 + k, m)
        Forces at the beginning [force].
    parts : int
    solve : callable
        Returns the forces for gaps and slips beside those of the end, closed constraints and forces to start from.
    """
    closed, slip, work, iterations, settled = y[0] > 0.0, np.zeros_like(lag[1:]), np.zeros((2, lag.shape[1])), 0, True
    gap, closing = begin[0], np.where(begin[0] > 0.0, begin[1:], 0.0)
    lag = lag + np.vstack([np.zeros_like(gap), closing])
    for part in range(1, parts + 1):
        beside = (1.0 - part / parts) * lag
        beside[1:] -= slip
        before = slip, work.copy(), y[0]
        forces = solve(beside, closed, y if y.any() else None)
        work += friction_work(y[0], forces.y[0], forces.y[1:], np.where(forces.closed, forces.gaps[1:], 0.0))
        whole = slip + forces.gaps[1:]
        left = np.divide(np.maximum(forces.gaps[0], 0.0), gap, out=np.zeros_like(gap), where=gap > 0.0)
        slip = whole - left * closing
        y, closed = forces.y, forces.closed
        iterations += forces.iterations
        settled &= forces.settled
    gaps = np.vstack([forces.gaps[:1], whole])
    return replace(forces, gaps=gaps, iterations=iterations, settled=settled), before


def friction_work(before: Array, normal: Array, tangential: Array, slip: Array) -> Array:
    """Return the work of friction of constraints (2, m) in an increment, and what of it those do that close in it.

    Under tangential forces (k, m) times the mean of the normal forces (m,) at both ends over those at the end, `before` being
    those at the beginning: friction that slides is at its limit. Slips are (k, m).
    """
    once = -0.5 * (tangential * slip).sum(axis=0)
    ratio = np.divide(before, normal, out=np.zeros_like(normal), where=normal > 0.0)
    return np.stack([(1.0 + ratio) * once, np.where(before == 0.0, once, 0.0)])


def shifted(constraints: Constraints, slid: Slid) -> Constraints:
    """Return constraints whose slips count from the last increment on."""
    before = np.stack([(slid.slip * tangent).sum(axis=1) for tangent in constraints.directions])
    return replace(constraints, slip0=-before if constraints.slip0 is None else constraints.slip0 - before)


def completed(solution: FrictionalEquilibrium, slid: Slid) -> FrictionalEquilibrium:
    """Return the solution of `shifted` constraints with the slip and the work of the whole step."""
    last = np.where(solution.active[:, None], solution.slip, 0.0)
    work = slid.work + friction_work(slid.normal, solution.multiplier, solution.tangential.T, last.T)
    before = np.stack([(slid.slip * tangent).sum(axis=1) for tangent in solution.directions], axis=1)
    return replace(solution, slip=solution.slip + before, work=work)
