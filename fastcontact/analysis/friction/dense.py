"""Solution of contact problems with Coulomb friction by means of a dense Delassus operator.

The gaps g and the slips s depend on the normal forces n and the tangential forces t as ``(g, s) = free + F (n, t)``,
where F is the Delassus operator, and ``free`` are the gaps and slips without contact forces. Three methods are combined, see
`_Problem.starts`:

1. Newton's method with and without a line search, see `cone_newton`. In 2D it is an active set method, in which the state
   of a constraint is open, stick, or slip in one of two directions.
2. Newton's method from the solution with an additional compliance, which is decreased to round-off (continuation).
3. Newton's method from the solution for a polyhedral friction cone with few edges. With such a cone the problem is a linear
   complementarity problem, which Lemke's method solves for every positive definite F and every coefficient of friction mu
   (Klarbring, 1986; Stewart and Trinkle, 1996; Klarbring and Pang, 1998).

With large coefficients of friction the solution may not be unique. The methods compute one solution.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.linalg.blas import dger
from scipy.sparse import csr_array, eye_array

from fastcontact._tools.records import record, replace
from fastcontact.analysis.criteria import HALVINGS, NOTABLE
from fastcontact.analysis.friction.cone_newton import Law, newton
from fastcontact.analysis.friction.delassus import Delassus
from fastcontact.analysis.solution import FrictionSolution
from fastcontact.arrays import Array, Indices, Mask, largest, numbers_at, scattered
from fastcontact.round_off import LENGTH_ROUND_OFF, ROUND_OFF, SINGLE_PRECISION, SUM_ROUND_OFF

# Numbers of edges of the polyhedral cones that are tried in 3D, and largest size of a linear complementarity problem.
EDGES, LARGEST = (8, 32), 2500
# If slips are linearly dependent, tangential forces are not unique. Examples are nodes that belong to several surfaces, and
# nodes that are supported on one side of the contact. F is regarded as singular if a squared pivot of its scaled Cholesky
# factor is below LENGTH_ROUND_OFF. A compliance, relative to that of the gaps, is then added to the diagonal entries of slips
# and equations: the first value of REGULARISATION and, if it does not suffice, the second. If the elastic slip due to this
# compliance exceeds SINGLE_PRECISION, relative to the gaps and slips without forces, the forces are not in equilibrium: the
# bodies jam.
REGULARISATION = ROUND_OFF, LENGTH_ROUND_OFF


def solve(
    F: Delassus, free: Array, mu: Array, closed: Mask, guess: Array | None = None, equality: Mask | None = None,
    components: Indices | None = None,
) -> FrictionSolution:  # fmt: skip
    """Return the forces that satisfy unilateral contact and Coulomb's law.

    Parameters
    ----------
    F : Delassus (n, n)
        Delassus operator of m constraints, symmetric and positive semidefinite [length / force]. Its rows and columns belong
        to the normal components of all constraints, then to their components along each of k tangents.
    free : ndarray (1 + k, m)
        Gaps, then slips along each tangent, without contact forces [length].
    mu : ndarray (m,)
        Coefficients of friction [-].
    closed : ndarray of bool (m,)
        Constraints that are assumed closed and sticking in an initial guess of Newton's method. If there are none, those
        whose gap without contact forces is negative are assumed closed and sticking.
    guess : ndarray (1 + k, m), optional
        Another initial guess of the forces, which is tried first [force].
    equality : ndarray of bool (m,), optional
        Constraints that are equations, without friction.
    components : ndarray of int (n,), optional
        Positions, in arrays (1 + k, m), of the components that belong to F, by default all; all normal components must belong
        to it. The forces along the other components are zero.

    Returns
    -------
    FrictionSolution
        Contact forces, gaps and slips, and whether the solution has converged.
    """
    m = free.shape[1]
    equality = np.zeros(m, bool) if equality is None else equality
    law = Law(np.where(equality, 0.0, mu), equality)
    if not m:
        return FrictionSolution(free * 0.0, free, closed, closed, True, 0.0, 0)
    force_units = units_of_force(F, m)
    scale = largest(free * force_units) or 1.0
    components = np.arange(free.size) if components is None else components
    F, best, iterations, elastic_slip = F.scaled(force_units[components % m]), None, 0, 0.0
    if guess is not None:
        guess = guess / (scale * force_units)
    for compliance in REGULARISATION if F.is_singular else (0.0,):
        regularised = np.append(np.flatnonzero(equality), np.arange(m, len(F.d)))
        F = replace(F, d=F.d + scattered(np.full(len(regularised), compliance), regularised, F.d.shape))
        scaled_free = free * force_units / scale
        problem = _Problem(F, scaled_free, law, components)
        for start, line_search in problem.starts(closed, guess):
            # At least one iteration: with the forces of an earlier geometry update, the residual may be below the round-off
            # bound, which is common to all constraints, although gaps of constraints with a large compliance are still open.
            last = newton(problem, start, problem.gaps(start), line_search=line_search, min_iterations=1)
            iterations += 1 + last.iterations
            if best is None or last.residual < best.residual:
                best, elastic_slip = last, compliance * largest(last.y.ravel()[components[regularised]])
            if last.settled:
                break
        if best is not None and best.settled and elastic_slip <= SINGLE_PRECISION:
            break
    assert best is not None
    jammed = elastic_slip > SINGLE_PRECISION
    settled = (best.settled or best.residual <= LENGTH_ROUND_OFF) and not jammed
    residual = max(best.residual, elastic_slip) if jammed else best.residual
    y, gaps = best.y * scale * force_units, best.gaps * scale / force_units
    return FrictionSolution(y, gaps, best.closed, best.sticking | equality, settled, residual, iterations)


@dataclass(eq=False, repr=False)
class _Problem:
    """The problem of `solve` in scaled units, for `cone_newton.newton`; see `cone_newton.Linearised`.

    F is scaled such that the compliance of each gap is one.
    """

    F: Delassus
    free: Array
    law: Law
    components: Indices

    def gaps(self, y: Array) -> Array:
        """Return gaps and slips (1 + k, m) for forces y (1 + k, m)."""
        return self.free + scattered(self.F @ y.ravel()[self.components], self.components, self.free.shape)

    def round_off(self, y: Array) -> float:
        """See `cone_newton.Linearised`. It is large if soft springs hold a body: slips are differences of its motions."""
        rounded = self.F.sum_of_magnitudes(y.ravel()[self.components])
        return SUM_ROUND_OFF * (largest(self.free) + largest(rounded))

    def step(self, y: Array, gaps: Array, closed: Mask, sticking: Mask) -> tuple[Array, Array]:
        """See `cone_newton.Linearised`."""
        if not closed.any():
            return np.zeros_like(y), self.free
        equations = linearised_equations(self.law, self.F, y, gaps, closed, sticking, self.components)
        forces = equations.forces(self.free, partial(_dense_solution, equations.A))
        return forces, self.gaps(forces)

    def starts(self, closed: Mask, guess: Array | None) -> Iterator[tuple[Array, bool]]:
        """Yield initial forces (1 + k, m) of Newton's method, and whether to use a line search.

        The same initial forces are tried with and without a line search: at a kink of the residual, Newton's method may
        converge with full steps although no shortened step decreases the residual.

        If soft springs resist the sliding of a body, a small error of its forces reverses the slips of all constraints, so
        that Newton's method cycles and shortened steps do not help. In 2D the polyhedral cone is exact, and precedes.
        """
        guess = None if guess is None or not guess.any() else guess
        slip_compliance = largest(self.F.diagonal()[self.components >= self.free.shape[1]])
        on_soft_springs = len(self.free) == 2 and slip_compliance * NOTABLE > 1.0
        if guess is not None:
            yield guess, not on_soft_springs
        if on_soft_springs:
            yield from self._polyhedral_starts()
        equality = self.law.equality
        sticking = closed & ~equality if (closed & ~equality).any() else (self.free[0] < 0) & ~equality
        sticking_forces = self.step(np.zeros_like(self.free), self.free, sticking | equality, sticking)[0]
        yield sticking_forces, True
        yield self._by_continuation(sticking_forces), True
        if guess is not None:
            yield guess, on_soft_springs
        yield sticking_forces, False
        if not on_soft_springs:
            yield from self._polyhedral_starts()

    def _polyhedral_starts(self) -> Iterator[tuple[Array, bool]]:
        """Yield the `starts` from polyhedral cones."""
        for edges in EDGES if len(self.free) == 3 else (2,):
            edge_forces = _polyhedral_forces(self, edges)
            if edge_forces is not None:
                yield edge_forces, True

    def _by_continuation(self, y: Array) -> Array:
        """Return forces (1 + k, m) near a solution: from `y`, with an additional compliance that decreases to round-off.

        Where constraints are nearly dependent, such as those of two pairs on one facet, Newton's method may alternate between
        contact states. The additional compliance prevents this. Relative to that of the gaps, it starts at NOTABLE. It is
        reduced by the factor NOTABLE after each solution, or by less if the method then fails.
        """
        compliance, last, halvings = NOTABLE, 1.0, 0
        while compliance > ROUND_OFF and halvings <= HALVINGS:
            softened = replace(self, F=replace(self.F, d=self.F.d + compliance))
            iterate = newton(softened, y, softened.gaps(y), min_iterations=1)
            if iterate.settled:
                y, last, compliance, halvings = iterate.y, compliance, NOTABLE * compliance, 0
            else:
                compliance, halvings = float(np.sqrt(compliance * last)), halvings + 1
        return y


@record
class Equations:
    """Linear equations ``A z = -S T free`` for closed constraints, whose q forces are ``x = to_forces z - H free``.

    They are equivalent to ``(E + D F) x = -D free`` with E and D of `Law.linearised`; for H and z (r,) see `delassus`. Here
    `free` (q,) are the gaps and slips without forces, S is the identity if None, and ``T = U.T H``. Without U, z is x. The
    forces x are at the positions `at` (q,) in arrays (1 + k, m).
    """

    A: Array
    S: Array | None
    T: csr_array
    H: csr_array
    to_forces: csr_array
    at: Indices

    def forces(self, free: Array, solve: Callable[[Array], Array]) -> Array:
        """Return the forces (1 + k, m), given gaps and slips without forces `free` (1 + k, m) and a solver for A."""
        values = free.ravel()[self.at]
        right_side = self.T @ values if self.S is None else self.S @ (self.T @ values)
        return scattered(self.to_forces @ solve(-right_side) - self.H @ values, self.at, free.shape)


def linearised_equations(
    law: Law, F: Delassus, y: Array, gaps: Array, closed: Mask, sticking: Mask, components: Indices
) -> Equations:
    """Return the equations of the `closed` constraints, linearised at `y` and `gaps`; for `components` see `solve`."""
    rows, selected = np.flatnonzero(closed), np.flatnonzero(closed[components % len(closed)])
    number, n = numbers_at(components[selected], y.shape)[:, rows], len(selected)
    shape = len(number), *number.shape
    row, column = np.broadcast_to(number[:, None], shape), np.broadcast_to(number, shape)

    def matrix(blocks: Array) -> csr_array:
        nonzero = (blocks != 0.0) & (row >= 0) & (column >= 0)
        return csr_array((blocks[nonzero], (row[nonzero], column[nonzero])), shape=(n, n))

    E, D = law.linearised(y, gaps, rows, sticking)
    F, at = F.submatrix(selected), components[selected]
    if F.U is None:
        F_matrix, D_matrix = F.S, matrix(D)
        F_matrix[np.arange(n), np.arange(n)] += F.d
        A = np.asarray(D_matrix @ F_matrix)
        A += matrix(E)
        return Equations(A, None, D_matrix, csr_array((n, n)), csr_array(eye_array(n)), at)
    blocks, D_blocks = E + D * np.where(number >= 0, F.d[number], 1.0), D.transpose(2, 0, 1)
    H = matrix(np.asarray(np.linalg.solve(blocks.transpose(2, 0, 1), D_blocks)).transpose(1, 2, 0))
    HU, S = csr_array(H @ F.U), F.S
    T = csr_array(F.U.T @ H)
    A = np.asarray(csr_array((F.U.T @ HU).T) @ S).T + np.eye(len(S))
    return Equations(A, S, T, H, -HU, at)


def units_of_force(F: Delassus, m: int) -> Array:
    """Return the units (m,) of force in which the compliance of each gap is one.

    The parameter of the complementarity function, which multiplies gaps and slips, can then be one for all constraints.
    """
    compliance = F.diagonal()[:m]
    return np.asarray(1.0 / np.sqrt(np.maximum(compliance, np.finfo(float).eps * compliance.max())))


def _dense_solution(A: Array, right_side: Array) -> Array:
    """Return the solution of ``A x = right_side``, or the least-squares solution of minimum norm if A is nearly singular."""
    try:
        solution = np.linalg.solve(A, right_side)
        # If A is nearly singular, the solution is so large that its round-off shows in the residual.
        if np.abs(A @ solution - right_side).max() <= 1e-8 * np.abs(right_side).max(initial=0.0):
            return np.asarray(solution)
    except np.linalg.LinAlgError:
        pass
    return np.asarray(np.linalg.lstsq(A, right_side, rcond=None)[0])


def _polyhedral_forces(problem: _Problem, edges: int) -> Array | None:
    """Return the forces (1 + k, m) for a cone with this number of `edges`; None if Lemke's method fails or is too expensive.

    The unknowns of the linear complementarity problem are the normal forces, the tangential forces along each edge, the
    tensile forces of equality constraints, and the largest slip along an edge (Stewart and Trinkle, 1996).
    """
    k, m = len(problem.free) - 1, problem.free.shape[1]
    equations = np.flatnonzero(problem.law.equality)
    edges_end, forces_end = (1 + edges) * m, (1 + edges) * m + len(equations)  # ends of groups of unknowns
    size = forces_end + m
    if size > LARGEST:
        return None
    angle = 2 * np.pi * np.arange(edges) / edges
    edge_directions = np.column_stack([np.cos(angle), np.sin(angle)])[:, :k]
    X = np.kron(np.block([[np.ones((1, 1)), np.zeros((1, edges))], [np.zeros((k, 1)), edge_directions.T]]), np.eye(m))
    X = np.hstack([X, -np.eye(len(X))[:, equations]])
    M = np.zeros((size, size))
    M[:forces_end, :forces_end] = X[problem.components].T @ (problem.F @ X[problem.components])
    M[forces_end:, :m] = np.diag(problem.law.mu)
    M[forces_end:, m:edges_end] = -np.tile(np.eye(m), edges)
    M[m:edges_end, forces_end:] = np.tile(np.eye(m), edges).T
    # The problem of a polyhedral cone is degenerate. Its right-hand side is therefore perturbed by the fractional parts of
    # multiples of the golden ratio, which are distinct.
    q = SINGLE_PRECISION * (0.5 + np.arange(size) * 0.6180339887498949 % 1.0)
    q[:forces_end] += X.T @ problem.free.ravel()
    z, _ = lemke(M, q, 5 * size)
    return None if z is None else (X @ z[:forces_end]).reshape(1 + k, m)


def lemke(M: Array, q: Array, max_pivots: int) -> tuple[Array | None, int]:
    """Return z (n,) by Lemke's pivoting method (Lemke, 1965), with ``w = M z + q``, ``w >= 0``, ``z >= 0`` and ``w.T z = 0``.

    The method finds a solution if M is copositive, if ``q.T v >= 0`` for all solutions v of the homogeneous problem
    (q = 0), and if no basis is degenerate (Cottle, Pang and Stone, 1992, theorem 4.4.13).

    Parameters
    ----------
    M : ndarray (n, n)
    q : ndarray (n,)
    max_pivots : int
        Largest number of pivots.

    Returns
    -------
    z : ndarray (n,) or None
        The solution; None if the method terminates on a secondary ray, or if more than `max_pivots` pivots are needed.
    count : int
        Number of pivots.
    """
    n, z = len(q), np.zeros(len(q))
    if not (q < 0.0).any():
        return z, 0
    # Rows: basic variables as affine functions of the nonbasic ones. The variable w_i has the number i, z_i the number n + i,
    # and the artificial variable the number 2 n.
    table = np.asfortranarray(np.column_stack([M, np.ones(n), q]))
    basic, nonbasic = np.arange(n), np.arange(n, 2 * n + 1)
    row, column = int(q.argmin()), n
    for count in range(1, max_pivots + 1):
        _exchange(table, row, column)
        leaving = int(basic[row])
        basic[row], nonbasic[column] = nonbasic[column], leaving
        if leaving == 2 * n:
            in_basis = basic >= n
            z[basic[in_basis] - n] = np.maximum(table[in_basis, -1], 0.0)
            return z, count
        column = int(np.flatnonzero(nonbasic == (leaving + n if leaving < n else leaving - n))[0])
        blocking = _blocking(table, basic, column)
        if blocking is None:
            return None, count
        row = blocking
    return None, max_pivots


def _exchange(table: Array, row: int, column: int) -> None:
    """Pivot in place: exchange the basic variable of `row` with the nonbasic variable of `column`.

    `table` is in Fortran order, in which BLAS updates it without a copy.
    """
    pivot, factors = table[row, column], table[:, column].copy()
    table[:, column], factors[row] = 0.0, 0.0
    table[row] /= -pivot
    table[row, column] = 1.0 / pivot
    dger(1.0, factors, table[row].copy(), a=table, overwrite_a=True)


def _blocking(table: Array, basic: Indices, column: int) -> int | None:
    """Return the row whose basic variable vanishes first as the nonbasic variable of `column` grows (ratio test).

    None if no basic variable decreases. Among rows with the same ratio, the row of the artificial variable has priority, then
    the row with the largest pivot.
    """
    slope = -table[:, column]
    falling = np.flatnonzero(slope > ROUND_OFF * np.abs(slope).max())
    if not len(falling):
        return None
    ratio = np.maximum(table[falling, -1], 0.0) / slope[falling]
    first = falling[ratio <= ratio.min() * (1.0 + ROUND_OFF)]
    artificial = first[basic[first] == 2 * len(basic)]
    return int(artificial[0] if len(artificial) else first[slope[first].argmax()])
