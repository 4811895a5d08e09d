"""Solutions of the contact problem, without and with friction, their accuracy, and the load path within a step.

If a load step with friction is solved at once, the slip of a constraint is measured from the beginning of the step, although
a constraint that closes within the step slides only after it has closed. In `in_increments` the load increment is therefore
divided at the instants at which constraints close, and constraints carry no forces before they close. Several constraints
may close in one increment; each slides from its own instant. These instants are found by linear interpolation of gaps. With
the geometry and the Delassus operator F at the end of the step, gaps vary linearly with the load while no constraint closes
or opens, and none changes between stick and slip. The result hardly depends on whether a force or a motion grows linearly in
the step, because the constraints close in the same order.

Let ``(g, s) = free + F y`` be the gaps and slips at the end of the step for forces y. At the beginning of the
step, the gaps are g0, the forces y0, and the slips zero. At a fraction p of the step, gaps and slips for forces y are
``free + (1 - p) * ((g0, 0) - free - F y0) + F y``.

If the normal is inclined to the direction in which a gap closes, the closing motion has a tangential component that is not
slip. The correction for closing the whole gap g0 is part of `free`. An increment that closes a fraction of g0 includes the
same fraction of the correction.

The last increment depends on the earlier ones only through their slips, which stay fixed while the geometry converges.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.sparse import csr_array

from fastcontact._tools.records import field, record, replace
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.linear.protocol import Loaded
from fastcontact.round_off import SINGLE_PRECISION


@record
class Accuracy:
    """Tolerances and limits of one solution of the contact inequalities.

    Attributes
    ----------
    gap : float
        Tolerance of the gap: only a gap less than ``-gap`` counts as penetration [length].
    multiplier : float
        Tolerance of multipliers: only a multiplier less than ``-multiplier`` times the largest one counts as tension [-].
    residual : float, optional
        Relative residual at which iterative linear solvers stop, if it is larger than their tolerance [-].
    max_iterations : int
        Largest number of linear solutions without friction. The iteration stops at this number even if it has not converged.
    inexact : bool
        Whether linear solutions are inexact. With friction, a single Newton step is then made, because errors may reverse
        slips.
    """

    gap: float
    multiplier: float = 1e-12
    residual: float | None = None
    max_iterations: int = 200
    inexact: bool = False


# Linear map from additional forces (n,) [force] on the unknowns, and additional gaps and slips (1 + k, m) [length] of all
# constraints, to the change of the unknowns (n,) [length].
Response = Callable[[Array, Array], Array]


def response(loaded: Loaded, R: csr_array, positions: Indices, forces_of: Callable[[Array], Array]) -> Response:
    """Return the `Response` of a contact problem with q gaps and slips.

    Parameters
    ----------
    loaded : Loaded
        Prepared matrix (n, n) with any right-hand side.
    R : csr_array (q, n)
        Derivatives of gaps and of slips [-].
    positions : ndarray of int (q,)
        Positions of these gaps and slips in arrays (1 + k, m) for all constraints.
    forces_of : callable
        Function that returns the change (q,) of the corresponding normal and tangential forces [force], given a change (q,)
        of the gaps and slips [length].
    """
    without_force, transpose = loaded.full_solution(np.zeros(R.shape[1])), csr_array(R.T)

    def respond(force: Array, gaps: Array) -> Array:
        u = loaded.full_solution(force) - without_force
        return u + loaded.full_solution(transpose @ forces_of(R @ u + gaps.ravel()[positions])) - without_force

    return respond


@record
class FrictionSolution:
    """Forces of a problem with friction by Newton's method, or those of its best iterate if it has not converged.

    Attributes
    ----------
    y : ndarray (1 + k, m)
        Normal forces, then the tangential forces along each of k tangents.
    gaps : ndarray (1 + k, m)
        Gaps, then the slips along each tangent.
    closed, sticking : ndarray of bool (m,)
        Constraints that are closed, and closed constraints that stick.
    settled : bool
        Whether the iteration has converged.
    residual : float
        Largest residual, relative to the largest force [-].
    iterations : int
        Number of Newton iterations.
    """

    y: Array
    gaps: Array
    closed: Mask
    sticking: Mask
    settled: bool
    residual: float
    iterations: int


# Function that solves an increment, given gaps and slips (1 + k, m) [length] to be added, the constraints (m,) that may
# close, those of them that are closed initially, and initial forces (1 + k, m) [force] or None.
IncrementSolver = Callable[[Array, Mask, Mask, Array | None], FrictionSolution]
# Number of constraints that may close in one increment, relative to the number of closed ones. In 3D `in_increments` admits
# more while few are closed. A contact in 2D that grows to 500 nodes closes in 130 increments, and in 500 if each closed one.
GROWTH = 1 / 32


def _components(vectors: Array, directions: tuple[Array, ...]) -> Array:
    """Return the components (k, m) of vectors (m, dim) along each of k directions (m, dim)."""
    return np.asarray((vectors * np.stack(directions)).sum(axis=2))


@record
class LoadPath:
    """Data of the constraints at the beginning of a load step, for friction along the load path in increments.

    Attributes
    ----------
    gap : ndarray (m,)
        Gaps, zero at constraints with contact forces [length].
    normal : ndarray (m,)
        Normal forces [force].
    traction : ndarray (m, dim)
        Tangential force vectors [force].
    closing : ndarray (m, dim)
        Tangential relative displacement while the whole gap closes, which is not slip [length].
    waiting : ndarray of bool (m,)
        Constraints that are open at the beginning of the step. They carry no force before they close.
    known : ndarray of bool (m,)
        Constraints that face the other side at the beginning of the step.
    positions : ndarray (m, dim)
        Reference positions [length].
    pairs : sequence of slice
        Constraints of each pair.
    """

    gap: Array
    normal: Array
    traction: Array
    closing: Array
    waiting: Mask
    known: Mask
    positions: Array
    pairs: Sequence[slice]

    def along(self, directions: tuple[Array, ...], rows: Indices) -> tuple[Array, Array]:
        """Return the data of the constraints `rows` (q,), with components along each of k tangents (m, dim).

        Returns
        -------
        forces : ndarray (1 + k, q)
            Normal forces, then tangential forces [force].
        closing : ndarray (1 + k, q)
            Gaps, then the components of `closing` [length].
        """
        forces = np.vstack([self.normal, _components(self.traction, directions)])
        return forces[:, rows], np.vstack([self.gap, _components(self.closing, directions)])[:, rows]

    def missing_slip(self, rows: Indices, free: Array, slip: Array, begin: float, end: float) -> Array:
        """Return the slips (k, q) of constraints `rows` (q,) that an increment of a moving contact lacks [length].

        If a contact moves over a surface while it closes, the smallest gap decreases linearly, but not the gap of any
        constraint, since the contact moves towards it on a curved surface. An increment therefore lasts as long as the
        smallest gap takes to decrease by as much as the smallest gap in the increment does.

        Parameters
        ----------
        rows : ndarray of int (q,)
        free : ndarray (1 + k, q)
            Gaps and slips at the end of the step without contact forces [length].
        slip : ndarray (k, q)
            Slips in the increment. Nothing is added where friction takes more than half of the slip without forces, since
            the slip then depends on forces and not on motions [length].
        begin, end : float
            Fractions of the step at which the increment begins and ends.
        """
        missing, travel = np.zeros_like(slip), np.linalg.norm(free[1:], axis=0)
        for pair in self.pairs:
            members = np.flatnonzero((pair.start <= rows) & (rows < pair.stop) & np.isfinite(free[0]))
            if self.normal[pair].any() or not (free[0, members] < 0.0).any():
                continue
            deepest = members[np.argmin(free[0, members])]
            distance = np.linalg.norm(self.positions[pair] - self.positions[rows[deepest]], axis=1)
            passed = distance <= travel[deepest]
            first = float(self.gap[pair][(passed & self.known[pair]) | (distance == 0.0)].min())
            near = members[passed[rows[members] - pair.start]]  # a contact elsewhere closes at another time
            gaps = [((1.0 - p) * self.gap[rows[near]] + p * free[0, near]).min() for p in (begin, end)]
            duration = max(gaps[0] - gaps[1], 0.0) / (first - free[0, deepest])
            missing[:, members] = (duration - (end - begin)) * free[1:, members]
        return np.where((slip * free[1:]).sum(axis=0) > 0.5 * (end - begin) * travel**2, missing, 0.0)


@record
class LastIncrement:
    """Data of the constraints at the beginning of the last increment of a load step.

    Attributes
    ----------
    slip : ndarray (m, dim)
        Slip vectors since the beginning of the step [length].
    slip_before_closing : ndarray (m, dim)
        Part of `slip` before the constraint closed in this step, zero if it was closed at the beginning [length].
    traction : ndarray (m, dim)
        Tangential force vectors [force].
    missing_slip : ndarray (m, dim)
        Slip vectors of `LoadPath.missing_slip` in the last increment [length].
    work : ndarray (m,)
        See `Solution.work`, of the increments before the last one [energy].
    normal : ndarray (m,)
        Normal forces [force].
    """

    slip: Array
    slip_before_closing: Array
    traction: Array
    missing_slip: Array
    work: Array
    normal: Array

    def since_its_beginning(self, constraints: Constraints) -> Constraints:
        """Return the constraints with slips measured from the beginning of the increment."""
        return replace(constraints, slip0=constraints.slip0 - _components(self.slip, constraints.directions))

    def over_whole_step(self, solution: Solution) -> Solution:
        """Return the solution with the slips and the work of the step, given the solution of its last increment."""
        before = np.vstack([self.normal, _components(self.traction, solution.directions)])
        after = np.vstack([solution.multiplier, solution.tangential.T])
        missing = _components(self.missing_slip, solution.directions)
        return replace(
            solution,
            slip=solution.slip + _components(self.slip, solution.directions).T,
            work=self.work + _frictional_work(before, after, solution.slip.T + missing),
            slip_before_closing=_components(self.slip_before_closing, solution.directions).T,
        )


@record
class Solution:
    """Solution of the contact problem of one pairing, with or without friction.

    Attributes
    ----------
    u : ndarray (n,)
        Unknowns [length].
    multiplier : ndarray (m,)
        Lagrange multipliers of all constraints, the normal forces, which are zero for inactive constraints [force].
    gap : ndarray (m,)
        Gaps [length].
    active : ndarray of bool (m,)
        Active set of this solution: constraints that are closed.
    next_active : ndarray of bool (m,)
        Initial active set of the next solution. Without friction it follows from the signs of gaps and multipliers, and
        equals `active` if all inequalities hold.
    settled : bool
        Whether all inequalities hold.
    iterations : int
        Number of linear solutions or, with friction, of Newton iterations.
    tangential : ndarray (m, k)
        Tangential forces on the secondary side, along each of k tangents; k is zero without friction [force].
    slip : ndarray (m, k)
        Slips of the load step along each tangent [length].
    sticking : ndarray of bool (m,)
        Closed constraints that do not slide.
    residual : float
        Residual of the complementarity function, relative to the largest force; zero without friction [-].
    directions : tuple of k ndarray (m, dim)
        Unit tangents.
    response : callable, optional
        Function without arguments that returns the `Response` of this solution, for a constant contact state.
    work : ndarray (m,), optional
        Frictional work in the step [energy]; only if the step is solved in increments.
    slip_before_closing : ndarray (m, k), optional
        Part of `slip` before the constraint closed in this step [length]; only if the step is solved in increments.
    last_increment : LastIncrement, optional
        Data at the beginning of the last increment; only if the step is solved in increments.
    """

    u: Array
    multiplier: Array
    gap: Array
    active: Mask
    next_active: Mask
    settled: bool
    iterations: int
    tangential: Array
    slip: Array
    sticking: Mask
    residual: float = 0.0
    directions: tuple[Array, ...] = ()
    response: Callable[[], Response] | None = field(default=None, repr=False)
    work: Array | None = None
    slip_before_closing: Array | None = None
    last_increment: LastIncrement | None = None

    @classmethod
    def frictionless(cls, u: Array, multiplier: Array, gap: Array, active: Mask, next_active: Mask) -> Solution:
        """Return the solution for one active set without friction."""
        settled, no_tangents = bool(np.array_equal(active, next_active)), np.zeros((len(gap), 0))
        return cls(u, multiplier, gap, active, next_active, settled, 1, no_tangents, no_tangents, active)

    def part(self, rows: slice, constraints: Constraints) -> Solution:
        """Return the solution of one contact pair, given the rows of its `constraints` in the solution of all pairs."""
        along, early_slip = (rows, slice(len(constraints.tangents))), self.slip_before_closing
        return Solution(
            self.u, self.multiplier[rows], self.gap[rows], self.active[rows], self.next_active[rows], self.settled,
            self.iterations, self.tangential[along], self.slip[along], self.sticking[rows], self.residual,
            constraints.directions, work=None if self.work is None else self.work[rows],
            slip_before_closing=None if early_slip is None else early_slip[along],
        )  # fmt: skip

    def forces_along(self, directions: tuple[Array, ...], m: int) -> Array | None:
        """Return the normal and tangential forces (1 + k, m) in components along other tangents (m, dim) [force].

        Tangents of two pairings may differ by any angle in the tangent plane. The result is None if the number of constraints
        of the solution is not `m`.
        """
        if self.tangential.shape != (m, len(directions)):
            return None
        vectors = (self.tangential.T[:, :, None] * np.stack(self.directions)).sum(axis=0)
        return np.vstack([self.multiplier, _components(vectors, directions)])


def in_increments(
    initial_offset: Array, closing: Array, y: Array, path: LoadPath, rows: Indices, solve: IncrementSolver
) -> tuple[FrictionSolution, Array, tuple[Array, Array, Array]]:
    """Return the forces at the end of a load step that is solved in increments, which end where constraints close.

    Parameters
    ----------
    initial_offset : ndarray (1 + k, m)
        Gaps and slips at the beginning of the step, minus those at its end under unchanged contact forces [length].
    closing : ndarray (1 + k, m)
        Gaps at the beginning of the step, and the slips that closing them would add, see `LoadPath.along` [length].
    y : ndarray (1 + k, m)
        Normal and tangential forces at the beginning of the step [force].
    path : LoadPath
    rows : ndarray of int (m,)
        Numbers of these m constraints in `path`.
    solve : IncrementSolver

    Returns
    -------
    forces : FrictionSolution
        Forces at the end of the step, with the slips of the last increment.
    gaps : ndarray (1 + k, m)
        Gaps at the end of the step, and the slips of the whole step [length].
    before : tuple
        Data of `LastIncrement`: the components (4, k, m) of its four vectors along the tangents, and its attributes
        `work` and `normal`.
    """
    closed, slip, iterations, settled = y[0] > 0.0, np.zeros_like(initial_offset[1:]), 0, True
    work = np.zeros(initial_offset.shape[1])
    gap = last_gap = closing[0]
    waiting, free = path.waiting[rows], np.vstack([gap - initial_offset[0], -initial_offset[1:]])
    slip_before_closing = np.zeros_like(slip)
    closing_slips = np.where(gap > 0.0, closing[1:], 0.0)
    initial_offset = initial_offset + np.vstack([np.zeros_like(gap), closing_slips])

    def increment(end: float) -> FrictionSolution:
        remaining = (1.0 - end) * initial_offset
        remaining[1:] -= slip
        return solve(remaining, ~waiting, closed, y if y.any() else None)

    def slip_after(increase: Array, gaps: Array) -> Array:
        """Return the slips (k, m) after an `increase` (k, m), without the closing motion of the remaining `gaps` (m,)."""
        open_fraction = np.divide(np.maximum(gaps, 0.0), gap, out=np.zeros_like(gap), where=gap > 0.0)
        return np.asarray(slip + increase - open_fraction * closing_slips)

    begin = 0.0
    while begin < 1.0:
        end, forces = 1.0, increment(1.0)
        iterations += forces.iterations
        if (waiting & (forces.gaps[0] < 0.0)).any():
            # In 3D, about as many constraints close together as lie along the edge of the closed region.
            group_size = max(int(closed.sum() ** (1.0 - 1.0 / len(slip))), int(GROWTH * closed.sum()), 1)
            instants, touching = _next_to_close(last_gap, forces.gaps[0], waiting, group_size)
            fraction = min(float(instants[touching].max()), 1.0)
            end = begin + fraction * (1.0 - begin)
            slip_since = np.where(touching, instants, 0.0) * forces.gaps[1:]
            slip = np.where(touching, slip_after(slip_since, np.zeros_like(gap)), slip)
            slip_before_closing = np.where(touching, slip, slip_before_closing)
            waiting = waiting & ~touching
            forces = increment(end)
            iterations += forces.iterations
        missing_slip = path.missing_slip(rows, free, forces.gaps[1:], begin, end)
        before = np.stack([slip, slip_before_closing, y[1:], missing_slip]), work, y[0]
        work = work + _frictional_work(y, forces.y, forces.gaps[1:] + missing_slip)
        total_slip = slip + forces.gaps[1:]
        slip = slip_after(forces.gaps[1:], forces.gaps[0])
        begin, y, closed, last_gap = end, forces.y, forces.closed, forces.gaps[0]
        settled &= forces.settled
    gaps = np.vstack([forces.gaps[:1], total_slip])
    return replace(forces, iterations=iterations, settled=settled), gaps, before


def _next_to_close(begin: Array, end: Array, waiting: Mask, count: int) -> tuple[Array, Mask]:
    """Return the fractions (m,) of the remaining step at which constraints close, and the next `count` of them (m,).

    `begin` and `end` are the gaps (m,) now and at the end of the step, if the `waiting` constraints (m,) carry no forces
    [length]. Fractions of constraints that do not close are infinite.
    """
    closing = waiting & (end < 0.0)
    # Constraints whose penetration decreases in the remaining step close at once.
    instants = np.where(closing, 0.0, np.inf)
    fraction = np.divide(np.maximum(begin, 0.0), begin - end, out=instants, where=closing & (begin > end))
    last = np.sort(fraction[closing])[:count][-1]
    return fraction, closing & (fraction <= last * (1.0 + SINGLE_PRECISION))


def _frictional_work(before: Array, after: Array, slip: Array) -> Array:
    """Return the frictional work (m,) of an increment [energy].

    The tangential force is integrated over the slip by the trapezoidal rule. Since sliding friction is at its limit, the
    tangential force at the beginning is that at the end, scaled by the ratio of the normal forces. The slip of a constraint
    that opens is that of the whole increment, because other constraints take over its force.

    Parameters
    ----------
    before, after : ndarray (1 + k, m)
        Normal and tangential forces at the beginning and at the end of the increment [force].
    slip : ndarray (k, m)
        Slips in the increment [length].
    """
    ratio = np.divide(before[0], after[0], out=np.zeros_like(after[0]), where=after[0] > 0.0)
    at_begin, at_end = (-0.5 * (forces[1:] * slip).sum(axis=0) for forces in (before, after))
    return np.where(after[0] > 0.0, (1.0 + ratio) * at_end, np.maximum(at_begin, 0.0))
