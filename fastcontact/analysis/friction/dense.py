"""Contact with Coulomb friction on a dense Delassus operator.

Gaps and slips are ``(g, s) = free + F (n, t)`` with the normal forces n and the tangential ones t. Two methods are tried in
turn:

1. Newton's method, see `cone_newton`; in two dimensions it is an active-set method with open, stick, and slip in either
   direction. It nearly always suffices.
2. The same from the solution for a polyhedral cone with few edges, a linear complementarity problem that Lemke's method
solves
   for every positive definite F and every mu (Klarbring, 1986; Stewart and Trinkle, 1996; Klarbring and Pang, 1998).

With large mu there may be several solutions; one of them is found.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from scipy.linalg import lu_solve

from fastcontact.analysis.friction import lemke
from fastcontact.analysis.friction.cone_newton import Forces, newton
from fastcontact.analysis.friction.coulomb_law import Law
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.linear.delassus import lu_factors

# Accepted residual over the largest force where round-off prevents a smaller one.
ACCEPTABLE = 1e-9
# Edges of the cones in three dimensions, and the largest complementarity problem.
EDGES, LARGEST = (8, 16, 32), 2500
# Linearly dependent slips get this compliance, relative to that of the gaps: at nodes of several sides, or held by
# supports on one side, tangential forces are undetermined. If a pivot is below DEPENDENT, all slips get it. If slips
# yield to it by more than the fraction JAMMED of the gaps, forces are not balanced: the bodies jam.
JAMMED = 1e-6
YIELDING, DEPENDENT = (1e-11, 1e-9), 1e-8
# Edges are degenerate for pivoting: their problem is shifted by this fraction.
SHIFT = 1e-6


def solve(F: Array, free: Array, mu: Array, closed: Mask, guess: Array | None = None) -> Forces:
    """Return forces that satisfy unilateral contact and Coulomb's law.

    Parameters
    ----------
    F : ndarray ((1 + k) m, (1 + k) m)
        Compliance, symmetric and positive semidefinite; normal parts first, then those along each of k tangents.
    free : ndarray (1 + k, m)
        Gaps and slips without forces.
    mu : ndarray (m,)
    closed : ndarray of bool (m,)
        Constraints that are closed and sticking in the second start.
    guess : ndarray (1 + k, m), optional
        Forces of the first start.
    """
    parts, m = free.shape
    if not m:
        return Forces(free * 0.0, free, closed, closed, True, 0.0, 0)
    unit = _units(F, m)
    length = float(np.abs(free * unit).max()) or 1.0
    everywhere = np.tile(unit, parts)
    F, best, iterations, yielded = everywhere[:, None] * F * everywhere, None, 0, 0.0
    if guess is not None:
        guess = guess / (length * unit)
    for yielding in YIELDING if _dependent(F) else (0.0,):
        slips = np.arange(m, len(F))
        F[slips, slips] += yielding
        problem = _Problem(F, free * unit / length, mu)
        for start, line_search in _starts(problem, closed, guess):
            # With forces of an earlier pairing, gaps of soft constraints are not closed to the round-off of the others.
            forces = newton(problem, start, problem.gaps(start), line_search=line_search, least=1)
            iterations += 1 + forces.iterations
            if best is None or forces.residual < best.residual:
                best, yielded = forces, yielding * float(np.abs(forces.y[1:]).max(initial=0.0))
            if forces.settled:
                break
        if best is not None and best.settled and yielded <= JAMMED:
            break
    assert best is not None
    settled = (best.settled or best.residual <= ACCEPTABLE) and yielded <= JAMMED
    residual = best.residual if yielded <= JAMMED else max(best.residual, yielded)
    gaps = best.gaps * length / unit
    return Forces(best.y * length * unit, gaps, best.closed, best.sticking, settled, residual, iterations)


def _dependent(F: Array) -> bool:
    """Return whether rows of a scaled compliance F are linearly dependent up to round-off."""
    try:
        return bool(np.diag(np.linalg.cholesky(F)).min() ** 2 < DEPENDENT)
    except np.linalg.LinAlgError:
        return True


class _Problem:
    """See `cone_newton.Linearised`; F is scaled to compliances of one."""

    def __init__(self, F: Array, free: Array, mu: Array) -> None:
        self.F, self.free, self.mu, self.law = F, free, mu, Law(mu)
        self.round_off = float(16 * np.finfo(float).eps * np.abs(free).max())

    def gaps(self, y: Array) -> Array:
        return self.free + (self.F @ y.ravel()).reshape(self.free.shape)

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        there = _step(self, y, gaps, closed, sticking)
        return there, self.gaps(there)


def _starts(problem: _Problem, closed: Mask, guess: Array | None) -> Iterator[tuple[Array, bool]]:
    """Yield initial forces of Newton's method, the cheapest first, and whether to use a line search.

    At kinks of the residual full steps often succeed where no shortened step decreases it.
    """
    if guess is not None and guess.any():
        yield guess, True
    sticking = closed | (problem.free[0] < 0) if not closed.any() else closed
    stuck = _step(problem, np.zeros_like(problem.free), problem.free, sticking, sticking)
    yield stuck, True
    if guess is not None and guess.any():
        yield guess, False
    yield stuck, False
    for edges in EDGES if len(problem.free) == 3 else (2,):
        edge_forces = _on_edges(problem, edges)
        if edge_forces is not None:
            yield edge_forces, True


def _step(problem: _Problem, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> Array:
    """Return the forces of `cone_newton.Linearised.step`."""
    new, rows = np.zeros_like(y), np.flatnonzero(closed)
    if len(rows):
        A, D = _equations(problem.law, problem.F, y, gaps, rows, sticking)
        right = -np.einsum("abq,bq->aq", D, problem.free[:, rows])
        new[:, rows] = _solved(A, right.ravel()).reshape(right.shape)
    return new


def _equations(law: Law, F: Array, y: Array, gaps: Array, rows: Indices, sticking: Mask) -> tuple[Array, Array]:
    """Return A and D of the equations ``A y + D free = 0`` of closed constraints `rows` (q,), see `Law.linearised`."""
    parts, among = np.arange(len(y)), np.arange(len(rows))
    E, D = law.linearised(y, gaps, rows, sticking)
    unknown = (parts[:, None] * y.shape[1] + rows).ravel()
    A = np.einsum("abq,bqn->aqn", D, F[np.ix_(unknown, unknown)].reshape(len(y), len(rows), -1))
    for b in parts:
        A[:, among, b * len(rows) + among] += E[:, b]
    return A.reshape(unknown.size, -1), D


def response(F: Array, mu: Array, forces: Forces) -> Callable[[Array], Array]:
    """Return a function that returns how `forces` vary with gaps and slips, both (1 + k, m); F and mu as in `solve`."""
    rows, unit = np.flatnonzero(forces.closed), _units(F, len(mu))
    everywhere = np.tile(unit, len(forces.y))
    A, D = _equations(
        Law(mu), everywhere[:, None] * F * everywhere, forces.y / unit, forces.gaps * unit, rows, forces.sticking
    )
    factors = lu_factors(A) if len(rows) else None

    def varied(gaps: Array) -> Array:
        change = np.zeros_like(gaps)
        if factors is not None:
            right = -np.einsum("abq,bq->aq", D, (gaps * unit)[:, rows])
            change[:, rows] = lu_solve(factors, right.ravel()).reshape(right.shape)
        return change * unit

    return varied


def _units(F: Array, m: int) -> Array:
    """Return the scale (m,) of forces by which each constraint has a compliance of one, so that c = 1 suits all."""
    compliance = np.diag(F)[:m]
    return np.asarray(1.0 / np.sqrt(np.maximum(compliance, np.finfo(float).eps * compliance.max())))


def _solved(A: Array, right: Array) -> Array:
    """Solve a linear system; of minimum norm where constraints are linearly dependent."""
    try:
        solution = np.linalg.solve(A, right)
        if np.abs(A @ solution - right).max() <= 1e-8 * np.abs(right).max(initial=0.0):
            return np.asarray(solution)
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(A, right, rcond=None)[0])


def _on_edges(problem: _Problem, edges: int) -> Array | None:
    """Return the forces for a polyhedral cone with a few edges, None if Lemke's method fails.

    Unknowns are the normal forces, the tangential forces along each edge, and the largest slip along an edge.
    """
    k, m = len(problem.free) - 1, problem.free.shape[1]
    size, last = (2 + edges) * m, (1 + edges) * m
    if size > LARGEST:
        return None
    angle = 2 * np.pi * np.arange(edges) / edges
    along = np.column_stack([np.cos(angle), np.sin(angle)])[:, :k]
    X = np.kron(np.block([[np.ones((1, 1)), np.zeros((1, edges))], [np.zeros((k, 1)), along.T]]), np.eye(m))
    M = np.zeros((size, size))
    M[:last, :last] = X.T @ problem.F @ X
    M[last:, :m] = np.diag(problem.mu)
    M[last:, m:last] = -np.tile(np.eye(m), edges)
    M[m:last, last:] = np.tile(np.eye(m), edges).T
    q = SHIFT * (0.5 + np.arange(size) * 0.6180339887498949 % 1.0)  # all different
    q[:last] += X.T @ problem.free.ravel()
    z, _ = lemke.solved(M, q, 5 * size)
    return None if z is None else (X @ z[:last]).reshape(1 + k, m)
