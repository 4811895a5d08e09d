"""Newton-Raphson iterations of a load step with nonlinear bodies.

Bodies alone are linearised; contact, with its geometry, is solved as for linear bodies (the Newton method of Josephy, 1979,
for generalised equations). So iterations converge quadratically, and few matrices are factorised.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any

import numpy as np
from scipy.sparse import csr_array

from fastcontact._jit.norms_kernels import largest, largest_difference
from fastcontact.analysis.balance import Balance, balance
from fastcontact.analysis.criteria import LOOSEST
from fastcontact.analysis.displacements import solve_displacements, with_loads
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.geometry_loop import SettledContact, settle_geometry
from fastcontact.analysis.inequalities import StepContext
from fastcontact.analysis.iterate import Iterate
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.state import State
from fastcontact.analysis.step_equilibrium import StepEquilibrium
from fastcontact.arrays import Array
from fastcontact.elasticity.nonlinear_bodies import WHOLE, DeformedBodies
from fastcontact.errors import ConvergenceError, ModelError

log = logging.getLogger("fastcontact")
# Newton iterations of a load step, and how often one is halved where it turns cells inside out.
MOST, HALVINGS = 40, 6
# Trials of a line search, what it takes for an overshot of the slope at the beginning, and the least part of the way to go.
SEARCHES, OVERSHOT, LEAST = 3, 0.8, 0.1
# Iterations after which the change of the displacement must have fallen at least once by the factor.
PATIENCE, FALL = 12, 0.5
# Contact geometry of the linearised bodies settles to this part of the last relative change of the displacement.
FORCING = 1e-3
# Relative error of the displacement below which iterations end. Changes below SCATTER that do not fall to the part STAYS of
# the one before are round-off, which is that much in slender bodies.
UNCHANGED, SCATTER, STAYS = 1e-9, 1e-6, 0.3


def newton(
    problem: Problem, start: State, load: StepLoad, expected: float, before: StepEquilibrium | None = None
) -> StepEquilibrium:
    """Return the equilibrium of a load step.

    Parameters
    ----------
    problem : Problem
        With nonlinear bodies.
    start : State
        At the beginning of the step.
    load : StepLoad
    expected : float
        Displacement to expect in the first step, if forces alone act [length].
    before : StepEquilibrium, optional
        Of the same step, under about the same load.

    Raises
    ------
    ConvergenceError
        If the iterations do not end, or a cell turns inside out.
    """
    if before is not None or start.extrapolation.ratio:
        origin = start.extrapolation.displacement(start.u) if before is None else before.u
        try:
            return _iterated(problem, start, load, expected, origin)
        except ConvergenceError as error:
            log.info("the step starts anew, not from an expected displacement: %s", error)
    return _iterated(problem, start, load, expected, start.u)


def _iterated(problem: Problem, start: State, load: StepLoad, expected: float, origin: Array) -> StepEquilibrium:
    """Return the equilibrium of a load step by iterations that begin at displacements `origin` (n_dofs,) [length]."""
    iterate = Iterate.of(start)
    history: list[dict[str, Any]] = []
    u, bodies, changes = origin, problem.deformed(origin, start, load.rise), [1.0]
    settled = None
    for _ in range(MOST):
        scale = expected, changes[-1]
        settled, target, force = _solve(problem, start, load, (bodies, u), iterate, scale, settled)
        before, here = u, bodies
        u, bodies, fraction = _reach(problem, start, load, u, target)
        balanced = _balanced(problem, start, load, (u, bodies), force)
        if history and fraction == 1.0 and balanced.excess > 1.0:
            u, bodies, fraction = _searched(problem, start, load, (before, here), (u, bodies), force)
            balanced = _balanced(problem, start, load, (u, bodies), force) if fraction < 1.0 else balanced
        moved, size = largest_difference(u, before), max(map(largest, (u, load.lift, start.u)))
        changes.append(moved / size if size else 0.0)
        history.append(_told(iterate, changes[-1], balanced, fraction))
        if fraction == 1.0 and balanced.excess <= 1.0 and (_still(problem, changes) or moved <= start.gap_round_off):
            return StepEquilibrium(settled, u, balanced, bodies, history)
        if len(changes) > PATIENCE and min(changes[-PATIENCE:]) > FALL * min(changes[:-PATIENCE]):
            break
    raise ConvergenceError(
        f"Newton's iterations do not converge: after {len(history)} the displacement still changes by {changes[-1]:.1e} of "
        f"its largest component and forces are out of balance by {balanced.relative:.1e}; take smaller load steps",
        history,
    )


def _balanced(
    problem: Problem, start: State, load: StepLoad, at: tuple[Array, DeformedBodies], contact_force: Array
) -> Balance:
    """Return the balance of forces at displacements (n_dofs,) [length]."""
    u, bodies = at
    internal = problem.internal(bodies, u, load)
    return balance(problem, u, contact_force, load.force, start.largest_force, internal)


def _still(problem: Problem, changes: list[float]) -> bool:
    """Return whether the relative `changes` of the displacement leave an error below the criterion, or are round-off."""
    before, last = changes[-2:]
    left = last * min(last / before, 1.0) if before else last
    return left <= max(problem.criteria.geometry, UNCHANGED) or (last <= SCATTER and last > STAYS * before)


def _solve(
    problem: Problem, start: State, load: StepLoad, at: tuple[DeformedBodies, Array], iterate: Iterate,
    scale: tuple[float, float], last: SettledContact | None,
) -> tuple[SettledContact | None, Array, Array]:  # fmt: skip
    """Return contact, displacements (n_dofs,) [length] and contact forces (n_dofs,) [force] of the bodies linearised.

    `at` are the bodies and their displacements (n_dofs,) [length], `scale` the displacement to expect [length] and the last
    relative change: contact geometry settles to a part of that. Where the tangent is not positive definite, the constraints
    that the `last` contact held are stiffened, or the springs of floating bodies, which leaves the iterations quadratic;
    where that does not help, parts of the geometric stiffness are left out.
    """
    bodies, u = at
    stiff = problem.floating_bodies is not None
    held = None if stiff else _held(last)  # there tangents let bodies move freely
    attempts: list[tuple[int, csr_array | None, bool]] = [(WHOLE, None, False)]
    attempts += [(WHOLE, held, stiff)] if stiff or held is not None else []
    attempts += [(less, None, stiff) for less in range(WHOLE)[::-1]]
    for geometric, rows, firm in attempts:
        if geometric < WHOLE:
            bodies = problem.deformed(u, start, load.rise, geometric=geometric)
        try:
            return _linear_contact(problem, start, load, (bodies, u), iterate, scale, rows, firm)
        except (ModelError, ConvergenceError) as error:
            log.info("the tangent with %d parts of the geometric stiffness fails: %s", geometric, error)
            failed = error
    if isinstance(failed, ConvergenceError):
        raise failed
    raise ConvergenceError(
        f"the tangent stiffness of the bodies cannot be factorised ({failed}): they buckle, or the load step is too large"
    )


def _held(last: SettledContact | None) -> csr_array | None:
    """Return the rows (k, n_dofs) of the gaps that are closed in a contact solution; None where there are none.

    Displacements along them hardly change any more as iterations converge, so that a stiffness there changes iterations
    by terms of second order alone (as the augmented Lagrangian does: Alart and Curnier, 1991).
    """
    if last is None or not last.solution.active.any():
        return None
    return csr_array(last.constraints.B[np.flatnonzero(last.solution.active)])


def _linear_contact(
    problem: Problem, start: State, load: StepLoad, at: tuple[DeformedBodies, Array], iterate: Iterate,
    scale: tuple[float, float], held: csr_array | None = None, stiff: bool = False,
) -> tuple[SettledContact | None, Array, Array]:  # fmt: skip
    """Return the result of `_solve` for a tangent, stiffened along the rows `held` (k, n_dofs) and where bodies float."""
    tangent, linear = problem.linearised(*at, load, iterate.rigid, held, stiff)
    iterate.u, iterate.history = at[1].copy(), []
    loaded, settled = with_loads(tangent, linear), None
    if tangent.pairs:
        enough = min(max(tangent.criteria.geometry, FORCING * scale[1]), LOOSEST)
        inner = replace(tangent, criteria=replace(tangent.criteria, geometry=enough))
        dofs = tangent.dofs.for_step(iterate.u, linear.lift)
        step = StepContext(inner, start, linear, dofs.loaded(loaded), dofs)
        settled = settle_geometry(step, Extrapolation(), scale[0], iterate)
    return settled, *solve_displacements(tangent, start, linear, loaded, settled)


def _reach(
    problem: Problem, start: State, load: StepLoad, u: Array, target: Array
) -> tuple[Array, DeformedBodies, float]:
    """Return the displacements to go on from, the bodies there, and the part of the way to the `target` (n_dofs,) [length].

    Half of the way, of that half, and so on, is gone where cells turn inside out farther on.
    """
    fraction = 1.0
    for _ in range(HALVINGS):
        end = target if fraction == 1.0 else u + fraction * (target - u)
        try:
            return end, problem.deformed(end, start, load.rise), fraction
        except ConvergenceError as error:
            failed = error
        fraction *= 0.5
    raise failed


def _searched(
    problem: Problem, start: State, load: StepLoad, begin: tuple[Array, DeformedBodies], end: tuple[Array, DeformedBodies],
    contact_force: Array,
) -> tuple[Array, DeformedBodies, float]:  # fmt: skip
    """Return the result of `_reach` after a line search between two displacements (Crisfield, 1991, section 9.2).

    Under contact forces (n_dofs,) [force] as they are, the potential falls along the way at its beginning; where it rises at
    the end by much of that, the end lies too far.
    """

    def slope(u: Array, bodies: DeformedBodies) -> float:
        out = problem.internal(bodies, u, load)[0] - contact_force - load.force
        return float(problem.system.reduced(out) @ along)

    (u, here), (target, bodies) = begin, end
    along = problem.system.unknowns(target - u)
    first, last, fraction = slope(u, here), slope(target, bodies), 1.0
    for _ in range(SEARCHES):
        if not last > OVERSHOT * abs(first):
            break
        fraction *= max(abs(first) / (abs(first) + last), LEAST)
        target = u + fraction * (end[0] - u)
        bodies = problem.deformed(target, start, load.rise)
        last = slope(target, bodies)
    return target, bodies, fraction


def _told(iterate: Iterate, change: float, balanced: Balance, fraction: float) -> dict[str, Any]:
    """Return the entry of an iteration in the history."""
    inner = iterate.history
    return {
        "displacement_change": change, "residual": balanced.relative, "pairings": len(inner),
        "active": inner[-1]["active"] if inner else 0,
        "active_set_iterations": sum(entry["active_set_iterations"] for entry in inner),
        **({} if fraction == 1.0 else {"damped": fraction}),
    }  # fmt: skip
