"""Nodes in several contact pairs that face the same place: one condition, whose forces the pairs share.

A node of several pairs behaves as that of one pair over all their facets. Its conditions are one and the same, which fixes
the sum of their forces alone, and equations that repeat each other cannot be eliminated: one is solved for. It stands for
the area of all, so that penalties add up, and has the mean of their coefficients of friction. Each pair then carries the
part that its area is of all their areas, so that the pressure is the same. Of several clearances at one place the smallest
alone can close. What gives way along the normal by penalties and different clearances repeats nothing.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from fastcontact.analysis.solution import FrictionalEquilibrium, Solution
from fastcontact.contact.constraints import Constraints, StackedConstraints

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Indices = NDArray[np.intp]
# Entries of rows [-] that differ by less are the same.
SAME = 1e-9
# Gaps that differ by less than this part of the coordinates are the same.
SAME_GAP = 64 * float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class SharedNodes:
    """Which constraints repeat others, and what part of their forces each carries.

    Attributes
    ----------
    place : ndarray of int (m,)
        Of each constraint, the one that is solved for in its place; itself for most.
    behind : ndarray of int (k,)
        Constraints that cannot close, for others are in front of them.
    part, along : ndarray (m,)
        Of the normal and of the tangential forces of a place, the part of each constraint [-].
    """

    place: Indices
    behind: Indices
    part: Array
    along: Array

    @classmethod
    def of(cls, constraints: StackedConstraints) -> SharedNodes | None:
        """Return those of the constraints of all pairs; None where no node is in several."""
        if len(constraints.parts) < 2:
            return None
        first, second, behind = _alike(constraints)
        if not len(second) + len(behind):
            return None
        place = np.arange(len(constraints))
        place[second] = first
        part, along = _parts(constraints, place)
        return cls(place, behind, part, along)

    @property
    def idle(self) -> Mask:
        """Constraints (m,) that are not solved for."""
        found = self.place != np.arange(len(self.place))
        found[self.behind] = True
        return found

    def closed(self, active: Mask) -> Mask:
        """Return the places (m,) at which some of the constraints (m,) are active."""
        return np.asarray(self.summed(active) > 0)

    def summed(self, values: NDArray[np.generic]) -> Array:
        """Return the sums (m, ...) of values (m, ...) at each place."""
        total = np.zeros(values.shape)
        np.add.at(total, self.place, values.astype(float))
        return total

    def once(self, constraints: StackedConstraints) -> Constraints:
        """Return constraints of which each place has one, for the area of all of its constraints."""
        merged: dict[str, Array] = {}
        if constraints.softness is not None:
            total = self.summed(_stiffness(constraints.softness))
            merged["softness"] = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0.0)
        slides = self.along > 0.0
        if constraints.tangential_softness is not None:
            stiffness = np.where(slides, _stiffness(constraints.tangential_softness), 0.0)
            total = self.summed(stiffness)
            merged["tangential_softness"] = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0.0)
            if constraints.elastic_slip is not None:
                weight = np.divide(stiffness, total[self.place], out=np.zeros_like(total), where=np.isfinite(stiffness))
                merged["elastic_slip"] = self._mean(constraints, constraints.elastic_slip.T, weight).T
        if constraints.drift is not None:
            merged["drift"] = self._mean(constraints, constraints.drift.T, self.along).T
        if constraints.friction is not None:
            merged["friction"] = self.summed(self.part * constraints.friction)
        return replace(constraints, **merged).without(self.idle)  # type: ignore[arg-type]

    def _mean(self, constraints: Constraints, along: Array, weight: Array) -> Array:
        """Return the mean with weights (m,) of components along the tangents (m, k) at each place, along its own tangents."""
        frame = _frame(constraints)
        vectors = np.einsum("mk,mkd->md", weight[:, None] * along, frame)
        return np.einsum("md,mkd->mk", self.summed(vectors), frame)

    def shared(self, solution: Solution, constraints: StackedConstraints, u: Array) -> Solution:
        """Return a solution of `once` at displacements `u` (n_dofs,) [length] with forces that all constraints share."""
        place = self.place
        normal, gap = self.part * solution.multiplier[place], solution.gap[place]
        gap[self.behind] = constraints.gaps(u)[self.behind]
        active = solution.active[place]
        if not isinstance(solution, FrictionalEquilibrium):
            return replace(solution, multiplier=normal, gap=gap, active=active, wanted=active)
        frame = _frame(constraints)

        def turned(along: Array) -> Array:
            return np.einsum("md,mkd->mk", np.einsum("mk,mkd->md", along, frame)[place], frame)

        return replace(
            solution,
            multiplier=normal,
            gap=gap,
            slip=np.where(self.idle[:, None], turned(solution.slip), solution.slip),
            active=active,
            sticking=solution.sticking[place],
            tangential=self.along[:, None]
            * np.where(self.idle[:, None], turned(solution.tangential), solution.tangential),
        )


def _frame(constraints: Constraints) -> Array:
    """Return the tangents (m, k, dim) of constraints [-]."""
    return np.stack(constraints.directions, axis=1)


def _stiffness(softness: Array) -> Array:
    """Return the inverse (m,) of what constraints give way, infinite where they do not [force / length]."""
    return np.divide(1.0, softness, out=np.full_like(softness, np.inf), where=softness > 0.0)


def _parts(constraints: StackedConstraints, place: Indices) -> tuple[Array, Array]:
    """Return the parts (m,) of normal and tangential forces of places (m,) that constraints carry [-].

    Normal forces by stiffness where all give way, by area among those that do not. Tangential forces as far as friction
    can carry them: what slides then slides in each pair.
    """
    m = len(place)
    several = np.bincount(place, minlength=m)[place] > 1  # others need not stand for an area
    weight = np.where(several, _areas(constraints), 1.0)
    if constraints.softness is not None:
        hard = constraints.softness == 0.0
        held = np.bincount(place, hard, minlength=m)[place] > 0
        weight = np.where(several & ~held, _stiffness(constraints.softness), np.where(hard | ~several, weight, 0.0))
    part = weight / np.bincount(place, weight, minlength=m)[place]
    if constraints.friction is None:
        return part, part
    rubbing = part * constraints.friction
    total = np.bincount(place, rubbing, minlength=m)[place]
    return part, np.where(several, np.divide(rubbing, total, out=part.copy(), where=total > 0.0), 1.0)


def _areas(constraints: StackedConstraints) -> Array:
    """Return the area of each constraint (m,), NaN where it stands for none [area]."""
    return np.concatenate(
        [np.full(len(part), np.nan) if part.areas is None else part.areas for part in constraints.parts.values()]
    )


def _nodes(constraints: StackedConstraints) -> Indices:
    """Return the node of each constraint (m,), -1 where it has none, or gives way together with others."""
    found = []
    for part in constraints.parts.values():
        coupled = part.compliance is not None or part.low_rank_compliance is not None
        found.append(np.full(len(part), -1) if part.nodes is None or coupled else part.nodes)
    return np.concatenate(found).astype(np.intp)


def _alike(constraints: StackedConstraints) -> tuple[Indices, Indices, Indices]:
    """Return constraints (k,) of a pair, those of other pairs (k,) that repeat them, and others that lie behind some.

    The latter face the same place along the same normal, with a larger clearance: what is in front of them holds their node,
    unless it gives way. Of those that repeat each other the first one with friction is solved for.
    """
    first, second = _of_one_node(constraints)
    if not len(first):
        return first, first, first
    alike = _apart(constraints.B, first, second) <= SAME
    if constraints.equality is not None:
        alike &= ~(constraints.equality[first] | constraints.equality[second])
    first, second = first[alike], second[alike]
    level = constraints.gap0[second] - constraints.gap0[first] <= SAME_GAP * np.abs(constraints.positions).max()
    yields = np.zeros(len(constraints), bool) if constraints.softness is None else constraints.softness > 0.0
    behind = np.setdiff1d(second[~level & ~yields[first]], [])
    first, second = first[level], second[level]
    kept = ~(np.isin(first, behind) | np.isin(second, behind))
    first, second = _ordered(constraints, first[kept], second[kept])
    second, at = np.unique(second, return_index=True)
    first = first[at]
    none_before = ~np.isin(first, second)
    return first[none_before], second[none_before], behind


def _ordered(constraints: Constraints, first: Indices, second: Indices) -> tuple[Indices, Indices]:
    """Return pairs (k,) of constraints, the one to solve for first, sorted by these: one with friction, of a low number."""
    rank = np.arange(len(constraints))
    rank[constraints.coefficients == 0.0] += len(constraints)
    swap = rank[first] > rank[second]
    first, second = np.where(swap, second, first), np.where(swap, first, second)
    order = np.argsort(rank[first], kind="stable")
    return first[order], second[order]


def _of_one_node(constraints: StackedConstraints) -> tuple[Indices, Indices]:
    """Return constraints (k,) at nodes of several, and for each another one there with a gap as large or larger.

    Those that another one is paired with are in order of their gaps.
    """
    nodes = _nodes(constraints)
    usable = np.isfinite(_areas(constraints)) & constraints.usable & (nodes >= 0)
    order = np.flatnonzero(usable)
    order = order[np.lexsort((constraints.gap0[order], nodes[order]))]
    node, found = nodes[order], [np.empty((2, 0), np.intp)]
    apart = 1
    while len(same := np.flatnonzero(node[apart:] == node[:-apart])):
        found.append(np.stack([order[same], order[same + apart]]))
        apart += 1
    first, second = np.concatenate(found[::-1], axis=1)
    return first, second


def _apart(rows: csr_array, first: Indices, second: Indices) -> Array:
    """Return the largest difference (k,) between entries of rows."""
    if not len(first):
        return np.empty(0)
    return np.asarray(abs(rows[first] - rows[second]).max(axis=1).toarray().ravel())
