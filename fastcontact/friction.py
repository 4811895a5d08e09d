r"""Coulomb friction: the inequalities of contact and the friction cone, solved together on their compliance.

With normal forces n >= 0 and tangential forces t of all constraints as unknowns, gaps and slips of the step are

.. math:: (g, s) = (g, s)_{free} + F (n, t), \qquad F = R K^{-1} R^T + C

with R the normal and tangential rows and C the compliance of the constraints themselves. Contact and friction are

.. math:: n = [n - c_n g]_+, \qquad t = P_{|t| \le \mu n}(t - c_t s)

with P the projection on the disc, for any positive c (Alart and Curnier, 1991): stick holds the slip of the step at
zero
exactly, slip returns to the cone exactly. A semismooth Newton method solves both. In two dimensions it is an active
set of open, stick and slip forwards or backwards. Where its sets come back, block Gauss-Seidel sweeps give it a better
start.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array, vstack

from fastcontact.active_set import Compliance
from fastcontact.kernels import cone
from fastcontact.linear import Loaded

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
# Newton iterations before a new start is looked for, and the sweeps that one may take.
PATIENCE = 25
MOST_SWEEPS = 20_000


@dataclass(frozen=True, eq=False)
class FrictionalEquilibrium:
    """A solution with friction; the normal part as in `active_set.Equilibrium`.

    Attributes
    ----------
    u : ndarray (n,)
    multiplier, gap : ndarray (m,)
        Normal forces and gaps.
    tangential, slip : ndarray (m, k)
        Tangential forces on the secondary side and slip of the step, along the k tangents.
    active, sticking : ndarray of bool (m,)
    settled : bool
        Whether all inequalities hold.
    iterations : int
        Newton iterations.
    """

    u: Array
    multiplier: Array
    gap: Array
    tangential: Array
    slip: Array
    active: Mask
    sticking: Mask
    settled: bool
    iterations: int

    @property
    def wanted(self) -> Mask:
        """The set to start the next solution from."""
        return self.active


@dataclass(frozen=True, eq=False)
class _Problem:
    """The dense problem on the usable constraints: unknowns (1 + k, m), normal first."""

    F: Array
    free: Array
    mu: Array
    c: Array

    @property
    def shape(self) -> tuple[int, int]:
        return self.free.shape  # type: ignore[return-value]

    def gaps(self, y: Array) -> Array:
        return self.free + (self.F @ y.ravel()).reshape(self.shape)


@dataclass(frozen=True, eq=False)
class _State:
    """Which constraints are closed and stick, and the directions in which the others slip, (k, m)."""

    closed: Mask
    sticking: Mask
    direction: Array
    reach: Array  # length of t - c s, which a slip direction turns with

    def key(self) -> bytes:
        """The discrete part; in three dimensions slip directions turn continuously and do not belong to it."""
        signs = self.direction.astype(np.int8).tobytes() if len(self.direction) == 1 else b""
        return self.closed.tobytes() + self.sticking.tobytes() + signs


def solve(
    loaded: Loaded,
    B: csr_array,
    tangents: tuple[csr_array, ...],
    gap0: Array,
    slip0: Array,
    friction: Array,
    usable: Mask,
    *,
    compliance: Compliance | None,
    closed: Mask,
    gap_tolerance: float,
    multiplier_tolerance: float = 1e-12,
    max_iterations: int = 200,
) -> FrictionalEquilibrium:
    """Find displacement and contact forces under contact and friction.

    Parameters
    ----------
    loaded : Loaded
    B : csr_array (m, n)
        Normal rows.
    tangents : tuple of csr_array (m, n)
        Tangential rows, one matrix a tangent: one in 2D, two in 3D.
    gap0 : ndarray (m,)
    slip0 : ndarray (k, m)
        Slip at u = 0, minus that at the beginning of the step.
    friction : ndarray (m,)
        Coefficients mu.
    usable : ndarray of bool (m,)
    compliance : Compliance, optional
        Of the constraints themselves, the same in every direction.
    closed : ndarray of bool (m,)
        Constraints to start from as closed and sticking.
    gap_tolerance, multiplier_tolerance, max_iterations
        As in `active_set.solve`.
    """
    rows = np.flatnonzero(usable)
    k, m = len(tangents), len(gap0)
    R = csr_array(vstack([matrix[rows] for matrix in (B, *tangents)], format="csr"))
    free, F = loaded.reduce(R)
    idle = _idle(F, k)
    if compliance is not None and len(rows):
        C = compliance.block(rows)
        for j in range(1 + k):
            part = slice(j * len(rows), (j + 1) * len(rows))
            F[part, part] += C
    free = free.reshape(1 + k, -1) + np.vstack([gap0[rows], *(slip0[:, rows])])
    if len(idle):
        F[idle], F[:, idle], free.ravel()[idle] = 0.0, 0.0, 0.0
        F[idle, idle] = np.diag(F).max()
    c = 1.0 / np.maximum(np.diag(F), 1e-300).reshape(1 + k, -1)
    c[1:] = c[1:].min(axis=0)
    problem = _Problem(F, free, friction[rows], c)
    start = _State(closed[rows], np.ones(len(rows), bool), np.zeros((k, len(rows))), np.zeros(len(rows)))
    y, state, settled, iterations = _newton(problem, start, gap_tolerance, multiplier_tolerance, max_iterations)
    full, gaps = np.zeros((1 + k, m)), np.full((1 + k, m), np.inf)
    full[:, rows], gaps[:, rows] = y, problem.gaps(y)
    gaps[1:, ~usable] = 0.0
    active, sticking = np.zeros(m, bool), np.zeros(m, bool)
    active[rows], sticking[rows] = state.closed, state.sticking & state.closed
    u = loaded.displacement(R.T @ y.ravel())
    return FrictionalEquilibrium(u, full[0], gaps[0], full[1:].T, gaps[1:].T, active, sticking, settled, iterations)


def _idle(F: Array, k: int) -> NDArray[np.intp]:
    """Return the rows of tangents along which supports leave no motion, or none but that of the gap.

    At an axis and in a plane of symmetry friction has nothing to do there, and its equation would be no equation.
    """
    m = len(F) // (1 + k)
    tangent, normal = np.arange(m, (1 + k) * m), np.tile(np.arange(m), k)
    own, gap, both = F[tangent, tangent], F[normal, normal], F[tangent, normal]
    return tangent[own * gap - both * both <= 1e-10 * gap * np.maximum(own, gap)]


def _newton(
    problem: _Problem, state: _State, gap_tolerance: float, force_tolerance: float, limit: int
) -> tuple[Array, _State, bool, int]:
    """Iterate until the state stands still and the slip directions have turned into the forces.

    Where states come back, block Gauss-Seidel sweeps, which are slow but sure, lead to a better state to start from;
    each time they are made ten times more exact.
    """
    seen: set[bytes] = set()
    y = np.zeros(problem.shape)
    exactness, since = 1e-2, 0
    for iteration in range(1, limit + 1):
        new = _linear_solution(problem, y, state)
        changed = np.abs(new - y).max(initial=0.0)
        y = new
        old, state = state, _state(problem, y, gap_tolerance, force_tolerance, state)
        same = old.key() == state.key()
        if same and (problem.shape[0] == 2 or changed <= 1e-10 * np.abs(y[0]).max(initial=0.0)):
            return y, state, True, iteration
        since += 1
        key = state.key()
        if (not same and key in seen) or since > PATIENCE:
            exactness, since = max(0.1 * exactness, 1e-12), 0
            y = _swept(problem, exactness)
            state = _admissible_state(problem, y)
            seen.clear()
        elif not same:
            seen.add(key)
    return y, state, False, limit


def _swept(problem: _Problem, exactness: float) -> Array:
    """Return forces from block Gauss-Seidel sweeps, to a relative change of `exactness` a sweep."""
    y, gaps = np.zeros(problem.shape), np.empty(problem.shape)
    cone.sweep(np.ascontiguousarray(problem.F), problem.free, problem.mu, y, gaps, exactness, MOST_SWEEPS)
    return y


def _admissible_state(problem: _Problem, y: Array) -> _State:
    """Return the state of forces that lie on or inside the cone."""
    closed = y[0] > 0
    size = np.linalg.norm(y[1:], axis=0)
    sliding = closed & (size >= problem.mu * y[0] * (1 - 1e-9))
    direction = np.divide(y[1:], size, out=np.zeros_like(y[1:]), where=size > 0)
    direction[:, ~sliding] = 0.0
    reach = np.linalg.norm(y[1:] - problem.c[1:] * problem.gaps(y)[1:], axis=0)
    return _State(closed, ~sliding & (problem.mu > 0), direction, reach)


def _state(problem: _Problem, y: Array, gap_tolerance: float, force_tolerance: float, old: _State) -> _State:
    """Return the state that the signs of the solution of state `old` ask for."""
    gaps = problem.gaps(y)
    slack = force_tolerance * np.abs(y[0]).max(initial=0.0)
    closed = np.where(old.closed, y[0] > -slack, gaps[0] < -gap_tolerance)
    limit = problem.mu * np.maximum(y[0], 0.0)
    # Forces of sticking constraints against the cone; slip of sliding ones against their force.
    held = np.linalg.norm(y[1:], axis=0) <= limit + slack
    turned_back = (old.direction * gaps[1:]).sum(axis=0) > gap_tolerance
    sticking = np.where(old.sticking, held, turned_back) | ~old.closed
    sticking &= problem.mu > 0
    trial = y[1:] - problem.c[1:] * gaps[1:]
    reach = np.linalg.norm(trial, axis=0)
    direction = np.divide(trial, reach, out=np.zeros_like(trial), where=reach > 0)
    if len(direction) == 1:  # only sticking can turn the direction of slip in two dimensions
        sliding_on = ~old.sticking & old.closed
        direction[:, sliding_on] = old.direction[:, sliding_on]
        direction = np.sign(direction)
    direction[:, sticking | ~closed] = 0.0
    return _State(closed, sticking, direction, reach)


def _linear_solution(problem: _Problem, y: Array, state: _State) -> Array:
    """Solve the equations of one state: closed gaps and sticking slips vanish, sliding forces lie on the cone."""
    parts, m = problem.shape
    A, right = np.zeros((parts * m, parts * m)), np.zeros((parts, m))
    index = np.arange(parts * m).reshape(parts, m)
    held = np.zeros((parts, m), bool)
    held[0] = state.closed
    held[1:] = state.closed & state.sticking
    rows = index[held]
    A[rows] = problem.F[rows]
    right[held] = -problem.free[held]
    zero = index[~held]
    A[zero, zero] = 1.0
    sliding = np.flatnonzero(state.closed & ~state.sticking)
    if len(sliding):
        _sliding_rows(problem, y, state, sliding, index, A, right)
    return np.asarray(np.linalg.solve(A, right.ravel()), float).reshape(parts, m)


def _sliding_rows(
    problem: _Problem,
    y: Array,
    state: _State,
    sliding: NDArray[np.intp],
    index: NDArray[np.intp],
    A: Array,
    right: Array,
) -> None:
    """Fill the rows ``t - mu n d = 0`` of sliding constraints, d turning with t - c s in three dimensions."""
    d = state.direction[:, sliding]
    limit = problem.mu[sliding] * np.maximum(y[0, sliding], 0.0)
    for a in range(problem.shape[0] - 1):
        A[index[1 + a, sliding], index[0, sliding]] -= problem.mu[sliding] * d[a]
    if problem.shape[0] == 2:
        return
    stretch = np.minimum(limit / np.maximum(state.reach[sliding], 1e-300), 1.0)
    for a in range(2):
        rows = index[1 + a, sliding]
        for b in range(2):
            turn = stretch * ((a == b) - d[a] * d[b])
            columns = index[1 + b, sliding]
            A[rows, columns] -= turn
            scaled = (turn * problem.c[1 + b, sliding])[:, None]
            A[rows] += scaled * problem.F[columns]
            right[1 + a, sliding] -= (turn * problem.c[1 + b, sliding]) * problem.free[1 + b, sliding]
