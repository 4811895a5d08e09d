"""Solve unilateral contact with Coulomb friction for fixed contact geometry.

The unknowns are the normal forces n >= 0 and the tangential forces t of all constraints. The gaps g and the slips s of the
load step are ``(g, s) = free + F (n, t)``, where `free` are their values without contact forces. The Delassus operator is
``F = R K^-1 R.T + C``, where K is the stiffness matrix, R contains the derivatives of gaps and slips with respect to the
displacements, and C is the compliance of the constraints themselves. `dense` solves this problem without regularisation,
unless slips are linearly dependent: the slip of a sticking constraint is zero, and the force of a sliding constraint lies on
the friction cone. If the linear solver can eliminate constraints, `eliminated` is tried first. It solves the same problem
without forming F.
"""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
from scipy.linalg import block_diag
from scipy.sparse import csc_array, csr_array, hstack, vstack

from fastcontact.analysis.friction import dense, eliminated
from fastcontact.analysis.friction.cone_newton import (
    SLIP_COMPLIANCE,
    Law,
    aligning_rotation,
    held_tangents,
    rotated,
)
from fastcontact.analysis.friction.delassus import Delassus
from fastcontact.analysis.friction.dense import numbers_at, scattered
from fastcontact.analysis.solution import Accuracy, Forces, Path, SlipSoFar, Solution, in_increments, response
from fastcontact.arrays import Array, Indices, Mask
from fastcontact.contact.constraints import Constraints
from fastcontact.contact.pairing import normals
from fastcontact.errors import ConvergenceError
from fastcontact.linear.delassus import MAX_ROWS_WITH_FRICTION, check_rows
from fastcontact.linear.protocol import Loaded, LoadedNonsymmetric
from fastcontact.linear.sparse_rows import scaled

log = logging.getLogger("fastcontact")


def solve(
    loaded: Loaded, constraints: Constraints, closed: Mask, accuracy: Accuracy, u: Array,
    guess: Solution | None = None, path: Path | None = None,
) -> Solution:  # fmt: skip
    """Return the displacements and the contact forces that satisfy unilateral contact and Coulomb's law.

    Each constraint in F costs columns of the inverse stiffness matrix. The problem therefore begins with the constraints that
    were closed, and adds others if they penetrate. Constraints that are never added are open and free of forces, so that the
    result is that of the complete problem.

    Parameters
    ----------
    loaded : Loaded
        Prepared matrix K (n, n) with a right-hand side.
    constraints : Constraints
        The m constraints in the n unknowns of the solver. `Constraints.slip0` (k, m) is the slip if all unknowns are zero,
        minus the slip at the beginning of the step [length].
    closed : ndarray of bool (m,)
        Constraints that are assumed closed and sticking at the start.
    accuracy : Accuracy
        Tolerances and limits.
    u : ndarray (n,)
        Initial guess of iterative solvers, and values of the unknowns that constraints do not involve, see
        `Loaded.involved_solution` [length].
    guess : Solution, optional
        Solution of a similar problem, from whose forces to start; ignored if its number of constraints is different.
    path : Path, optional
        Data at the beginning of the step, if it is solved in increments along the load path.
    """
    forces = None if guess is None else guess.forces_along(constraints.directions, len(constraints))
    coupled = constraints.coupled
    if isinstance(loaded, LoadedNonsymmetric) and not coupled:
        solution = _eliminated(loaded, constraints, closed, accuracy, u, forces, path)
        if solution is not None:
            return solution
        log.info("friction: the iteration on eliminated constraints did not converge, their compliance is formed")
    usable = constraints.usable
    initial = closed | constraints.equality if path is None else closed | constraints.equality | ~path.waiting
    included = usable & initial
    iterations = 0
    while True:
        solution = _with_included(included, loaded, constraints, closed, u, forces, path)
        solution.gap[~usable], solution.slip[~usable] = np.inf, 0.0
        iterations += solution.iterations
        missing = usable & ~included & (solution.gap < 0.0)
        if not missing.any():
            return replace(solution, iterations=iterations)
        included = included | missing


def _eliminated(
    loaded: LoadedNonsymmetric, constraints: Constraints, closed: Mask, accuracy: Accuracy, u: Array, forces: Array | None,
    path: Path | None,
) -> Solution | None:  # fmt: skip
    """Return the solution by `eliminated`, without the Delassus operator; None if this fails. Parameters as in `solve`."""
    usable, before = constraints.usable, None

    def solve_eliminated(constraints: Constraints, closed: Mask, accuracy: Accuracy, forces: Array | None) -> Forces:
        nonlocal u
        u, result = eliminated.solve(loaded, constraints, closed & usable, accuracy, u, forces)
        result.gaps[:, ~usable] = 0.0
        return result

    def increment(offset: Array, carrying: Mask, closed: Mask, forces: Array | None) -> Forces:
        gaps = constraints.gaps_at_rest() + offset
        gaps[0, ~carrying] += distance
        shifted_constraints = replace(constraints, gap0=gaps[0], slip0=gaps[1:], elastic_slip=np.empty(0))
        result = solve_eliminated(shifted_constraints, closed, accuracy, forces)
        result.gaps[0, ~carrying] -= distance
        return result

    try:
        if path is None:
            result = solve_eliminated(constraints, closed, accuracy, forces)
        else:
            y, closing = path.along(constraints.directions, np.arange(len(constraints)))
            end = loaded.full_solution(constraints.force(y[0], y[1:].T))
            lag = -constraints.gaps_at_rest() - np.stack([R @ end for R in (constraints.B, *constraints.tangents)])
            lag -= eliminated.diagonal_compliance(constraints) * y
            lag[0] += path.gap
            lag = np.where(usable, lag, 0.0)
            distance = 4.0 * float(np.abs(lag[0]).max())  # further than constraints can close
            result, gaps, before = in_increments(lag, closing, y, path.waiting, increment)
            result = replace(result, gaps=gaps)
    except ConvergenceError:
        return None
    gap, active = np.where(usable, result.gaps[0], np.inf), result.closed & usable
    return Solution(
        u, result.y[0], gap, active, active, result.settled, result.iterations, result.y[1:].T, result.gaps[1:].T,
        result.sticking, result.residual, constraints.directions,
        slip_so_far=None if before is None else _slip_so_far(before, None, np.arange(len(constraints)), constraints),
    )  # fmt: skip


def _with_included(
    included: Mask, loaded: Loaded, constraints: Constraints, closed: Mask, u: Array, forces: Array | None, path: Path | None
) -> Solution:  # fmt: skip
    """Return the solution with only the `included` constraints (m,), by the Delassus operator.

    The gaps and slips of the other constraints follow from the displacements. The other parameters are those of `solve`, with
    initial `forces` (1 + k, m) or None [force].
    """
    rows = np.flatnonzero(included)
    k, m = len(constraints.tangents), len(constraints)
    # In arrays (1 + k, q), F has no rows for the slips of constraints whose pair has no friction.
    frictional = np.stack(constraints.directions)[:, rows].any(axis=(0, 2))
    components = np.flatnonzero(np.vstack([np.ones_like(frictional), *k * [frictional]]))
    all_rows = csr_array(vstack([constraints.B, *constraints.tangents], format="csr"))
    row_numbers = (np.arange(1 + k)[:, None] * m + rows).ravel()[components]
    R = all_rows[row_numbers]
    gaps_at_rest = constraints.gaps_at_rest()
    rigid_compliance = loaded.rigid_compliance(R)
    # The compliance of soft springs is so large that the factored form would not be accurate.
    factored = k == 2 and constraints.compliance is not None and not np.any(rigid_compliance)
    free, F = _delassus(loaded, R, factored)
    number = numbers_at(components, (1 + k, len(rows)))
    slips = np.arange(len(rows), len(F))
    # This compliance is added before held tangents are detected, since compliant tangents are not held.
    F = F.softened(scattered(np.tile(constraints.tangential_softness[rows[frictional]], k), slips, (len(F),)))
    Q = aligning_rotation(F.diagonal_blocks(number)) if k == 2 else None
    Q_F = None if Q is None else csr_array(Q[components][:, components])
    C = (F if Q_F is None else F.rotated(Q_F)).diagonal_blocks(number)
    C[0, 0] += np.where(constraints.prescribed, constraints.softness, 0.0)[rows]
    held_slips = held_tangents(C) & frictional
    held_rows = number[1:][held_slips]
    F = _with_compliance(F, constraints, rows, components)
    if not factored:
        F = replace(F, S=F.S + rigid_compliance)
    free = scattered(free, components, number.shape) + gaps_at_rest[:, rows]
    guess = None if forces is None else forces[:, rows]
    y0, closing = np.zeros_like(free), np.zeros_like(free)
    if path is not None:
        y0, closing = path.along(constraints.directions, rows)
    if Q is not None and Q_F is not None:
        F = F.rotated(Q_F)
        free, y0, closing = (rotated(Q, values) for values in (free, y0, closing))
        guess = None if guess is None else rotated(Q, guess)
    if len(held_rows):
        prescribed = held_slips & constraints.imposes_slip(rows, Q)
        values = np.where(prescribed, SLIP_COMPLIANCE * C[0, 0], F.diagonal().max())[held_slips]
        F = F.scaled(1.0 - scattered(np.ones(len(values)), held_rows, (len(F),)))
        F = F.softened(scattered(values, held_rows, (len(F),)))
        free[1:][held_slips & ~prescribed] = 0.0
        y0[1:][held_slips], closing[1:][held_slips] = 0.0, 0.0
    mu, equations = constraints.friction[rows], constraints.equality[rows]
    if path is None:
        result, before = dense.solve(F, free, mu, closed[rows], guess, equations, components), None
        gaps_of_included = result.gaps
    else:
        lag = -free - scattered(F @ y0.ravel()[components], components, free.shape)
        lag[0] += closing[0]

        def increment(offset: Array, carrying: Mask, closed: Mask, start: Array | None) -> Forces:
            gaps, at = free + offset, np.flatnonzero(carrying)
            given = np.flatnonzero(number[:, at] >= 0)
            n = number[:, at].ravel()[given]
            start = None if start is None else start[:, at]
            result = dense.solve(F.submatrix(n), gaps[:, at], mu[at], closed[at], start, equations[at], given)
            y, (closed, sticking) = np.zeros_like(gaps), np.zeros((2, len(rows)), bool)
            y[:, at], closed[at], sticking[at] = result.y, result.closed, result.sticking
            gaps += scattered(F @ y.ravel()[components], components, gaps.shape)
            return replace(result, y=y, gaps=gaps, closed=closed, sticking=sticking)

        result, gaps_of_included, before = in_increments(lag, closing, y0, path.waiting[rows], increment)
    y = result.y
    if Q is not None:
        y, gaps_of_included = rotated(Q.T, y), rotated(Q.T, gaps_of_included)
    u = loaded.involved_solution(R.T @ y.ravel()[components], u)
    all_forces = np.zeros((1 + k, m))
    gaps = gaps_at_rest + (all_rows @ u).reshape(1 + k, m)
    all_forces[:, rows] = y
    if constraints.compliance is not None:
        axes = np.stack(constraints.coupled_directions or constraints.directions)
        frame = np.concatenate([normals(list(axes))[None], axes])
        vectors = constraints.compliance.apply(np.einsum("km,kmd->md", all_forces, frame))
        gaps += np.einsum("md,kmd->km", vectors, frame)
    Z = constraints.low_rank_compliance
    gaps += Z @ np.einsum("kmh,km->h", Z, all_forces)
    gaps[:, rows] = gaps_of_included
    active, sticking = np.zeros(m, bool), np.zeros(m, bool)
    active[rows], sticking[rows] = result.closed, result.sticking

    # Constraints that are equations have no friction, and slips along held tangents do not vary.
    mu = np.where(equations, 0.0, mu)
    at_end = replace(result, sticking=result.sticking & ~equations)
    return Solution(
        u, all_forces[0], gaps[0], active, active, result.settled, result.iterations, all_forces[1:].T, gaps[1:].T,
        sticking, result.residual, constraints.directions,
        slip_so_far=None if before is None else _slip_so_far(before, Q, rows, constraints),
        response=lambda: response(
            loaded, R, row_numbers, dense.response(F, Law(mu, equations), at_end, held_slips, Q_F, components)
        ),
    )  # fmt: skip


def _delassus(loaded: Loaded, R: csr_array, factored: bool) -> tuple[Array, Delassus]:
    """Return the gaps and slips (n,) without contact forces, and their Delassus operator, `factored` with U = R or not."""
    if not factored:
        check_rows(R.shape[0], MAX_ROWS_WITH_FRICTION)
        free, F = loaded.delassus(R)
        return free, Delassus(np.zeros(len(F)), F)
    involved = np.unique(R.indices)
    check_rows(len(involved), MAX_ROWS_WITH_FRICTION)
    identity = np.ones(len(involved)), (np.arange(len(involved)), involved)
    u, inverse = loaded.delassus(csr_array(identity, (len(involved), R.shape[1])))
    U = csr_array(R[:, involved])
    return U @ u, Delassus(np.zeros(U.shape[0]), inverse, U)


def _slip_so_far(
    before: tuple[Array, Array, Array, Array, Array, float],
    Q: csr_array | None,
    rows: Indices,
    constraints: Constraints,
) -> SlipSoFar:
    """Return the data at the beginning of the last increment, for all constraints.

    Parameters
    ----------
    before : tuple
        The data that `in_increments` returns, of q constraints.
    Q : csr_array, optional
        Rotation of the tangents, which is undone.
    rows : ndarray of int (q,)
        Numbers of these constraints.
    constraints : Constraints
        All m constraints.
    """
    *components, integrals, normal, begin = before
    if Q is not None:
        no_gaps = np.zeros((1, len(rows)))
        components = [rotated(Q.T, np.vstack([no_gaps, along]))[1:] for along in components]
    m, dim = constraints.positions.shape
    all_vectors, all_integrals, all_normal = np.zeros((3, m, dim)), np.zeros((2, m)), np.zeros(m)
    tangents = np.stack(constraints.directions)[:, rows]
    all_vectors[:, rows] = np.einsum("pkm,kmd->pmd", np.stack(components), tangents)
    all_integrals[:, rows], all_normal[rows] = integrals, normal
    slip, slip_before_closing, traction = all_vectors
    return SlipSoFar(slip, slip_before_closing, traction, all_integrals, all_normal, begin)


def _with_compliance(F: Delassus, constraints: Constraints, rows: Indices, components: Indices) -> Delassus:
    """Return the sum of the Delassus operator F and the compliance of the constraints `rows` (q,).

    `components` (n,) are the positions, in arrays (1 + k, q), of the components that belong to F.
    """
    at, dim = components % len(rows), constraints.positions.shape[1]
    Z = np.concatenate(constraints.low_rank_compliance[:, rows])[components]
    if constraints.compliance is not None:
        # C couples force vectors. Their components along normals and tangents are coupled by the scalar products of these
        # directions, which vary from one constraint to the next.
        along = np.stack(constraints.coupled_directions or constraints.directions)[:, rows]
        normal = normals(list(along))
        normal[~along.any(axis=(0, 2)), 0] = 1.0  # any unit vector, for constraints without friction
        frame = np.concatenate([normal[None], along]).reshape(-1, dim)[components]
    if F.U is not None:
        assert constraints.compliance is not None
        d, P, inverse_mass = constraints.compliance.split(rows)
        added = np.where(d > 0.0, 0.0, F.diagonal()[: len(rows)])  # and subtracted in the next term
        (rigid,) = np.nonzero(added[at])
        columns = [scaled(P[at], along_axis) for along_axis in frame.T]
        columns += [csr_array((np.ones(len(rigid)), (rigid, np.arange(len(rigid)))), (len(F), len(rigid)))]
        S = block_diag(F.S, *dim * [-inverse_mass], -np.diag(added[at[rigid]]), np.eye(Z.shape[1]))
        U = csc_array(hstack([F.U, *columns, csr_array(Z)], format="csc"))
        used = np.flatnonzero(np.diff(U.indptr))
        F = Delassus(F.d + (d + added)[at], S[np.ix_(used, used)], csr_array(U[:, used])).in_accurate_form()
        check_rows(len(F) if F.U is None else len(used), MAX_ROWS_WITH_FRICTION)
    else:
        if constraints.compliance is not None:
            F.S[:] += constraints.compliance.block(rows)[np.ix_(at, at)] * (frame @ frame.T)
        if Z.size:
            F.S[:] += Z @ Z.T
    return F.softened(scattered(constraints.softness[rows], np.arange(len(rows)), (len(F),)))
