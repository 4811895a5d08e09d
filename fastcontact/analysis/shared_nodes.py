"""Nodes in several contact pairs that face the same place.

Their conditions are one and the same, which fixes the sum of their forces alone: solvers leave it to any one of the pairs, or
split it as they please. Each pair carries the part that its area is of all their areas, so that the pressure is the same.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.analysis.solution import FrictionalEquilibrium, Solution
from fastcontact.contact.constraints import StackedConstraints

Indices = NDArray[np.intp]
# Entries of rows [-], and coefficients of friction, that differ by less are the same.
SAME = 1e-9


def shared(solution: Solution, constraints: StackedConstraints) -> Solution:
    """Return a solution whose forces at nodes of several pairs are shared by area.

    Parameters
    ----------
    solution : Solution
    constraints : StackedConstraints
        Those of all pairs.
    """
    first, second = _repeated(constraints)
    if not len(first):
        return solution
    m, area = len(constraints), _areas(constraints)
    place = np.arange(m)  # of each constraint, the first one that it repeats
    place[second] = first
    together = csr_array((np.ones(m), (place, np.arange(m))), shape=(m, m))
    part = (area / (together @ area)[place])[:, None]
    normal = (part * (together @ solution.multiplier[:, None])[place])[:, 0]
    active = (together @ solution.active)[place] > 0
    if not isinstance(solution, FrictionalEquilibrium):
        return replace(solution, multiplier=normal, active=active, wanted=active)
    sticking = np.where(active, (together @ (solution.active & ~solution.sticking))[place] == 0, solution.sticking)
    return replace(
        solution,
        multiplier=normal,
        active=active,
        sticking=sticking,
        tangential=part * (together @ solution.tangential)[place],
    )


def _areas(constraints: StackedConstraints) -> NDArray[np.float64]:
    """Return the area of each constraint (m,), NaN where it stands for none [area]."""
    return np.concatenate(
        [np.full(len(part), np.nan) if part.areas is None else part.areas for part in constraints.parts.values()]
    )


def _repeated(constraints: StackedConstraints) -> tuple[Indices, Indices]:
    """Return constraints (k,) of a pair, and those of later pairs (k,) that repeat them."""
    none = np.empty(0, np.intp)
    if len(constraints.parts) < 2 or constraints.nodes is None:
        return none, none
    usable = np.flatnonzero(np.isfinite(_areas(constraints)) & constraints.usable)
    _, begin, at = np.unique(constraints.nodes[usable], return_index=True, return_inverse=True)
    first, second = usable[begin[at]], usable
    first, second = first[first != second], second[first != second]
    if not len(first):
        return none, none
    apart = abs(constraints.friction[first] - constraints.friction[second]) if constraints.friction is not None else 0.0
    for rows in (constraints.B, *constraints.tangents):
        apart = np.maximum(apart, abs(rows[first] - rows[second]).max(axis=1).toarray().ravel())
    return first[apart <= SAME], second[apart <= SAME]
