"""Nodes in several contact pairs that face the same place.

Their conditions are one and the same, which fixes the sum of their forces alone. One of them is solved for, since equations
that repeat each other cannot be eliminated. Each pair then carries the part that its area is of all their areas, so that the
pressure is the same. Of several clearances at one place the smallest alone can close. What gives way by a penalty repeats
nothing: its force follows from its own penetration.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.analysis.solution import FrictionalEquilibrium, Solution
from fastcontact.contact.constraints import Constraints, StackedConstraints

Indices = NDArray[np.intp]
# Entries of rows [-], and coefficients of friction, that differ by less are the same.
SAME = 1e-9
# Gaps that differ by less than this part of the coordinates are the same.
SAME_GAP = 64 * float(np.finfo(float).eps)


def once(constraints: StackedConstraints) -> Constraints:
    """Return constraints of which those cannot close that repeat others, or that lie behind them."""
    _, second, behind = _alike(constraints)
    if constraints.tangential_softness is not None:  # these add up
        second = second[constraints.tangential_softness[second] == 0.0]
    idle = np.zeros(len(constraints), bool)
    idle[second] = idle[behind] = True
    return constraints.without(idle)


def shared(solution: Solution, constraints: StackedConstraints, u: NDArray[np.float64]) -> Solution:
    """Return a solution whose forces at nodes of several pairs are shared by area.

    Parameters
    ----------
    solution : Solution
    constraints : StackedConstraints
        Those of all pairs.
    u : ndarray (n_dofs,)
        Displacements of the bodies [length].
    """
    first, second, behind = _alike(constraints)
    if not len(second) + len(behind):
        return solution
    m, area = len(constraints), _areas(constraints)
    place = np.arange(m)  # of each constraint, the first one that it repeats
    place[second] = first
    together = csr_array((np.ones(m), (place, np.arange(m))), shape=(m, m))
    # Constraints that are no others' keep their forces: they need not stand for an area.
    of_several = np.bincount(place, minlength=m)[place] > 1
    area = np.where(of_several, area, 1.0)
    part = (area / (together @ area)[place])[:, None]
    normal, gap = (part * (together @ solution.multiplier[:, None])[place])[:, 0], solution.gap[place]
    gap[behind] = constraints.gaps(u)[behind]
    active = (together @ solution.active)[place] > 0
    if not isinstance(solution, FrictionalEquilibrium):
        return replace(solution, multiplier=normal, gap=gap, active=active, wanted=active)
    sticking = np.where(active, (together @ (solution.active & ~solution.sticking))[place] == 0, solution.sticking)
    return replace(
        solution,
        multiplier=normal,
        gap=gap,
        slip=solution.slip[place],
        active=active,
        sticking=sticking,
        tangential=part * (together @ solution.tangential)[place],
    )


def _areas(constraints: StackedConstraints) -> NDArray[np.float64]:
    """Return the area of each constraint (m,), NaN where it stands for none [area]."""
    return np.concatenate(
        [np.full(len(part), np.nan) if part.areas is None else part.areas for part in constraints.parts.values()]
    )


def _alike(constraints: StackedConstraints) -> tuple[Indices, Indices, Indices]:
    """Return constraints (k,) of a pair, those of other pairs (k,) that repeat them, and others that lie behind some.

    The latter face the same place along the same normal, with a larger clearance: what is in front of them holds their node.
    """
    none = np.empty(0, np.intp)
    if len(constraints.parts) < 2 or constraints.nodes is None:
        return none, none, none
    first, second = _of_one_node(constraints)
    if not len(first):
        return none, none, none
    alike = _apart(constraints.B, first, second) <= SAME
    if constraints.equality is not None:
        alike &= ~(constraints.equality[first] | constraints.equality[second])
    second, at = np.unique(second[alike], return_index=True)  # the first of these has the smallest gap
    first = first[alike][at]
    between = constraints.gap0[second] - constraints.gap0[first]
    level = between <= SAME_GAP * np.abs(constraints.positions).max()
    same = level.copy()
    if constraints.friction is not None:
        same &= abs(constraints.friction[first] - constraints.friction[second]) <= SAME
    for rows in constraints.tangents:
        same &= _apart(rows, first, second) <= SAME
    return first[same], second[same], second[~level]


def _of_one_node(constraints: StackedConstraints) -> tuple[Indices, Indices]:
    """Return constraints (k,) at nodes of several, and for each another one there with a gap as large or larger.

    Without penalty. Those that another one is paired with are in order of their gaps.
    """
    assert constraints.nodes is not None
    usable = np.isfinite(_areas(constraints)) & constraints.usable
    if constraints.softness is not None:
        usable &= constraints.softness == 0.0
    order = np.flatnonzero(usable)
    order = order[np.lexsort((constraints.gap0[order], constraints.nodes[order]))]
    node, found = constraints.nodes[order], [np.empty((2, 0), np.intp)]
    apart = 1
    while len(same := np.flatnonzero(node[apart:] == node[:-apart])):
        found.append(np.stack([order[same], order[same + apart]]))
        apart += 1
    first, second = np.concatenate(found[::-1], axis=1)
    return first, second


def _apart(rows: csr_array, first: Indices, second: Indices) -> NDArray[np.float64]:
    """Return the largest difference (k,) between entries of rows."""
    if not len(first):
        return np.empty(0)
    return np.asarray(abs(rows[first] - rows[second]).max(axis=1).toarray().ravel())
