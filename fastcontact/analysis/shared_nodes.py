"""Merging of the constraints at nodes of several contact pairs, or at both ends of a periodic part or sector.

A node that belongs to several pairs behaves like a node of one pair that contains all their facets. Its constraints are
linearly dependent: they determine only the sum of their forces, and they cannot all be eliminated. They are therefore
replaced by their weighted mean. Their stiffnesses add up if they are compliant, and the coefficient of friction is the mean.
Each pair carries a fraction of the force that is proportional to its area, so that the pressures are equal. If the gaps at
one node differ, only the constraint with the smallest gap can close, unless it is compliant. Constraints with a coupled
normal compliance or with different gaps are not merged.

Two nodes at the ends of a periodic part are also regarded as one node, whose gap is the area-weighted mean of both gaps.
Tangents at the second end are rotated to the first one before they are compared.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from fastcontact._tools.records import record, replace
from fastcontact.analysis.solution import Solution
from fastcontact.arrays import AnyArray, Array, Indices, Mask
from fastcontact.contact.constraints import Constraints, StackedConstraints
from fastcontact.linear.sparse_rows import scaled
from fastcontact.model.periodicity import PeriodicInterface
from fastcontact.round_off import LENGTH_ROUND_OFF


@record
class SharedNodes:
    """Linearly dependent constraints, and the fraction of the force that each carries.

    Attributes
    ----------
    representative : ndarray of int (m,)
        The representative that replaces each constraint in the solution; usually the constraint itself.
    behind : ndarray of int (n_behind,)
        Constraints that cannot close, because others have a smaller gap.
    normal_fraction, tangential_fraction : ndarray (m,)
        Fraction of each constraint in the normal and in the tangential force of its representative [-].
    frame : ndarray (m, k, dim)
        Tangents of the constraints [-]; those at the second end of a periodic part are rotated to the first end.
    """

    representative: Indices
    behind: Indices
    normal_fraction: Array
    tangential_fraction: Array
    frame: Array

    @classmethod
    def of(cls, constraints: StackedConstraints, interfaces: Sequence[PeriodicInterface] = ()) -> SharedNodes | None:
        """Return the shared nodes of all pairs; None if there are no such nodes."""
        first, second, behind = _dependent(constraints)
        ends = _at_periodic_interfaces(constraints, interfaces, behind)
        if not len(second) + len(behind) + ends.shape[1]:
            return None
        representative = _representatives(constraints, np.hstack([np.stack([first, second]), ends]))
        return cls(representative, behind, *_fractions(constraints, representative), _frame(constraints, interfaces))

    @property
    def redundant(self) -> Mask:
        """Constraints (m,) that are not part of the reduced problem."""
        redundant = self.representative != np.arange(len(self.representative))
        redundant[self.behind] = True
        return redundant

    @cached_property
    def _sums(self) -> csr_array:
        """Matrix (m, m) of zeros and ones whose products are sums over the constraints of each representative."""
        m = len(self.representative)
        return csr_array((np.ones(m), (self.representative, np.arange(m))), shape=(m, m))

    def summed(self, values: AnyArray) -> Array:
        """Return the sums (m, ...) of values (m, ...) over the constraints of each representative."""
        return np.asarray(self._sums @ values)

    def merged_constraints(self, constraints: StackedConstraints) -> Constraints:
        """Return constraints of which only the representatives can close.

        Each has the mean gap, the mean slips and the total stiffness of the constraints that it represents.
        """
        merged = {
            "B": csr_array(self._sums @ scaled(constraints.B, self.normal_fraction)),
            "gap0": self.summed(self.normal_fraction * constraints.gap0),
            "tangents": self._tangents(constraints),
            "equality": constraints.equality & ~self.redundant,
            "slip0": self._weighted_sum(constraints.slip0.T, self.tangential_fraction).T,
            "friction": self.summed(self.normal_fraction * constraints.friction),
        }
        stiffness = _stiffness(constraints.softness)
        stiffness[1:, self.tangential_fraction <= 0.0] = 0.0
        total = self.summed(stiffness.T).T
        merged["softness"] = np.divide(1.0, total, out=np.zeros_like(total), where=total > 0.0)
        if constraints.softness[1:].any():
            finite, weight = np.isfinite(stiffness[1]), np.ones(len(constraints))
            np.divide(stiffness[1], total[1, self.representative], out=weight, where=finite)
            merged["elastic_slip"] = self._weighted_sum(constraints.elastic_slip.T, weight).T
        return replace(constraints, **merged).without(self.redundant)  # type: ignore[arg-type]

    def _tangents(self, constraints: Constraints) -> tuple[csr_array, ...]:
        """Return the rows (m, n_dofs) of the mean slip of each representative along its own tangents."""
        products = np.einsum("mjd,mkd->kjm", self.frame, self.frame[self.representative]) * self.tangential_fraction
        weighted = ([scaled(T, factor) for factor, T in zip(row, constraints.tangents)] for row in products)
        return tuple(csr_array(self._sums @ sum(rows[1:], rows[0])) for rows in weighted)

    def _weighted_sum(self, components: Array, weight: Array) -> Array:
        """Return the sums (m, k) of vectors times `weight` (m,) over the constraints of each representative.

        Vectors are given by their `components` (m, k) along the tangents of their constraints, and sums likewise.
        """
        vectors = np.einsum("mk,mkd->md", weight[:, None] * components, self.frame)
        return np.einsum("md,mkd->mk", self.summed(vectors), self.frame)

    def merged_gaps(self, gaps: Array) -> Array:
        """Return the mean gaps and slips (1 + k, m) of representatives, given those of all constraints [length]."""
        slips = self._weighted_sum(gaps[1:].T, self.tangential_fraction).T
        return np.vstack([self.summed(self.normal_fraction * gaps[0]), slips])

    def of_representatives(
        self, constraints: Constraints, gap: Array, normal: Array, tangential: Array, closing: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Return four quantities of representatives, given those of all constraints.

        They are gaps (m,) [length], the `normal` (m,) and `tangential` (m, dim) forces [force], and the tangential part
        `closing` (m, dim) of the relative displacements that close the gaps [length].
        """
        tangents = np.stack(constraints.directions, axis=1)
        weighted = (tangential, np.ones(len(gap))), (closing, self.tangential_fraction)
        sums = (self._weighted_sum(np.einsum("md,mkd->mk", vectors, tangents), weight) for vectors, weight in weighted)
        forces, slips = (np.einsum("mk,mkd->md", along, tangents) for along in sums)
        return self.summed(self.normal_fraction * gap), self.summed(normal), forces, slips

    def with_distributed_forces(self, solution: Solution, constraints: StackedConstraints, u: Array) -> Solution:
        """Return a solution of `merged_constraints` at `u` (n_dofs,) [length] with forces distributed to all constraints."""
        representative = self.representative
        normal, gap = self.normal_fraction * solution.multiplier[representative], solution.gap[representative]
        gap[self.behind] = constraints.gaps(u)[self.behind]
        active = solution.active[representative]
        frame, early_slip, work = self.frame, solution.slip_before_closing, solution.work

        def along_own_tangents(components: Array) -> Array:
            rotated = np.einsum("md,mkd->mk", np.einsum("mk,mkd->md", components, frame)[representative], frame)
            return np.where(self.redundant[:, None], rotated, components)

        return replace(
            solution,
            multiplier=normal,
            gap=gap,
            slip=along_own_tangents(solution.slip),
            active=active,
            next_active=active,
            sticking=solution.sticking[representative],
            work=None if work is None else self.tangential_fraction * work[representative],
            slip_before_closing=None if early_slip is None else along_own_tangents(early_slip),
            tangential=self.tangential_fraction[:, None] * along_own_tangents(solution.tangential),
        )


def _frame(constraints: StackedConstraints, interfaces: Sequence[PeriodicInterface]) -> Array:
    """Return the tangents (m, k, dim) of constraints [-]; those at a second periodic end are rotated to the first one."""
    m, dim = constraints.positions.shape
    frame = np.stack(constraints.directions, axis=1) if constraints.directions else np.zeros((m, 0, dim))
    for interface in interfaces:
        if interface.turn is not None and constraints.nodes is not None:
            at_second = np.isin(constraints.nodes, interface.second)
            frame[at_second] = frame[at_second] @ interface.turn
    return frame


def _at_periodic_interfaces(
    constraints: StackedConstraints, interfaces: Sequence[PeriodicInterface], behind: Indices
) -> Indices:
    """Return pairs (2, k) of constraints at the first and second nodes of interfaces, both of the same contact pair."""
    nodes, usable = _nodes(constraints), np.isfinite(_areas(constraints)) & constraints.usable
    usable[behind] = False
    pairs = [np.empty((2, 0), np.intp)]
    for name, rows in constraints.rows.items() if interfaces else ():
        branches, largest_node = (
            constraints.parts[name].branches,
            max(int(end.max()) for i in interfaces for end in i[:2]),
        )
        # A cohesive layer has one equation for the opening and one for each slip at each node.
        n_equations = 1 if branches is None else (rows.stop - rows.start) // len(branches)
        for block in np.split(np.arange(rows.start, rows.stop), n_equations):
            usable_rows = block[usable[block] & (nodes[block] >= 0)]
            row = np.full(max(largest_node, int(nodes.max())) + 1, -1)
            row[nodes[usable_rows]] = usable_rows
            for interface in interfaces:
                rows_of_ends = row[np.stack([interface.first, interface.second])]
                pairs.append(rows_of_ends[:, (rows_of_ends >= 0).all(axis=0) & (rows_of_ends[0] != rows_of_ends[1])])
    ends = np.hstack(pairs)
    return ends[:, constraints.equality[ends[0]] == constraints.equality[ends[1]]]


def _representatives(constraints: Constraints, pairs: Indices) -> Indices:
    """Return the representative (m,) of each constraint, given linearly dependent `pairs` (2, k).

    The representative of dependent constraints is the first one with friction, or the first one if none has friction.
    """
    m = len(constraints)
    label = connected_components(csr_array((np.ones(pairs.shape[1]), tuple(pairs)), shape=(m, m)), directed=False)[1]
    last_to_first = np.lexsort((np.arange(m), constraints.friction == 0.0))[::-1]
    first = np.empty(m, np.intp)
    first[label[last_to_first]] = last_to_first
    return first[label]


def _stiffness(softness: Array) -> Array:
    """Return the stiffness (..., m) of constraints, infinite without compliance [force / length]."""
    return np.divide(1.0, softness, out=np.full_like(softness, np.inf), where=softness > 0.0)


def _fractions(constraints: StackedConstraints, representative: Indices) -> tuple[Array, Array]:
    """Return the fractions (m,) of normal and tangential forces that constraints carry [-].

    Normal forces are distributed by stiffness if all constraints of a node are compliant, otherwise by area among those
    without compliance. Tangential forces are distributed by friction limit, so that a sliding node slides in each pair.
    """
    m = len(representative)
    is_shared = np.bincount(representative, minlength=m)[representative] > 1  # others may lack an area
    weight = np.where(is_shared, _areas(constraints), 1.0)
    exact = constraints.softness[0] == 0.0
    has_exact = np.bincount(representative, exact, minlength=m)[representative] > 0
    by_area = np.where(exact | ~is_shared, weight, 0.0)
    weight = np.where(is_shared & ~has_exact, _stiffness(constraints.softness[0]), by_area)
    fraction = weight / np.bincount(representative, weight, minlength=m)[representative]
    if not constraints.tangents:
        return fraction, fraction
    friction_limit = fraction * constraints.friction
    total = np.bincount(representative, friction_limit, minlength=m)[representative]
    return fraction, np.where(is_shared, np.divide(friction_limit, total, out=fraction.copy(), where=total > 0.0), 1.0)


def _areas(constraints: StackedConstraints) -> Array:
    """Return the area of each constraint (m,), NaN without one [area]."""
    parts = constraints.parts.values()
    return np.concatenate([np.full(len(part), np.nan) if part.areas is None else part.areas for part in parts])


def _nodes(constraints: StackedConstraints) -> Indices:
    """Return the node of each constraint (m,), -1 without one or where a compliance couples it with others."""
    parts = constraints.parts.values()
    nodes = [np.full(len(part), -1) if part.nodes is None or part.coupled else part.nodes for part in parts]
    return np.concatenate(nodes).astype(np.intp)


def _dependent(constraints: StackedConstraints) -> tuple[Indices, Indices, Indices]:
    """Return pairs (k,), (k,) of linearly dependent constraints, and the constraints behind others.

    Constraints behind others face the same point along the same normal with a larger clearance. The constraint in front,
    unless it is compliant, prevents them from closing.
    """
    first, second = _pairs_at_nodes(constraints)
    if not len(first):
        return first, first, first
    difference = abs(constraints.B[first] - constraints.B[second]).max(axis=1).toarray().ravel()
    dependent = difference <= LENGTH_ROUND_OFF
    dependent &= ~(constraints.equality[first] | constraints.equality[second])
    first, second = first[dependent], second[dependent]
    difference = constraints.gap0[second] - constraints.gap0[first]
    equal_gap = difference <= LENGTH_ROUND_OFF * np.abs(constraints.positions).max()
    behind = np.setdiff1d(second[~equal_gap & (constraints.softness[0, first] == 0.0)], [])
    first, second = first[equal_gap], second[equal_gap]
    free = ~(np.isin(first, behind) | np.isin(second, behind))
    return first[free], second[free], behind


def _pairs_at_nodes(constraints: StackedConstraints) -> tuple[Indices, Indices]:
    """Return the pairs (k,), (k,) of constraints at one node, the second with an equal or larger gap."""
    nodes = _nodes(constraints)
    usable = np.isfinite(_areas(constraints)) & constraints.usable & (nodes >= 0)
    order = np.flatnonzero(usable)
    order = order[np.lexsort((constraints.gap0[order], nodes[order]))]
    node, pairs = nodes[order], [np.empty((2, 0), np.intp)]
    shift = 1
    while len(coincident := np.flatnonzero(node[shift:] == node[:-shift])):
        pairs.append(np.stack([order[coincident], order[coincident + shift]]))
        shift += 1
    first, second = np.concatenate(pairs[::-1], axis=1)
    return first, second
