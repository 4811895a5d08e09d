"""Newton-Raphson iterations of a load step with nonlinear bodies.

Bodies alone are linearised; contact, with its geometry, is solved as for linear bodies (the Newton method of Josephy, 1979,
for generalised equations). So iterations converge quadratically, and few matrices are factorised.
"""

from __future__ import annotations

import logging
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, diags_array

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
from fastcontact.contact.constraints import Wetted
from fastcontact.elasticity.nonlinear_bodies import WHOLE, DeformedBodies
from fastcontact.errors import ConvergenceError, ModelError

log = logging.getLogger("fastcontact")
# Newton iterations of a load step, and how often one is halved where it turns cells inside out.
MOST, HALVINGS = 40, 6
# Trials of a line search, what it takes for an overshot of the slope at the beginning, and the least part of the way to go.
SEARCHES, OVERSHOT, LEAST = 3, 0.8, 0.1
# Iterations after which the change of the displacement must have fallen at least once by the factor.
PATIENCE, FALL = 12, 0.5
# Stiffness of springs along closed gaps beside the largest of the bodies. What contact does not hold, such as gaps between
# values of a pressure field, creeps with stiff ones: an O-ring takes 5, 7, 11 iterations with 5e-5, 2e-4, 1e-3.
HELD = 5e-5, 1e-3
# Contact geometry of the linearised bodies settles to this part of the last relative change of the displacement.
FORCING = 1e-3
# Relative error of the displacement below which iterations end. Changes below SCATTER that do not fall to the part STAYS of
# the one before are round-off, which is that much in slender bodies.
UNCHANGED, SCATTER, STAYS = 1e-10, 1e-6, 0.3


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
            return _Newton(problem, start, load, expected).iterated(origin)
        except ConvergenceError as error:
            log.info("the step starts anew, not from an expected displacement: %s", error)
    return _Newton(problem, start, load, expected).iterated(start.u)


class _Tangent(NamedTuple):
    """How a tangent is made positive definite.

    `geometric` is how much of the geometric stiffness it has, see `NonlinearBodies.at`; `held` the stiffness of springs along
    closed gaps, beside the body's [-]; `stiff` tells whether those of floating bodies are.
    """

    geometric: int
    held: float
    stiff: bool


class _Newton:
    """The iterations of a load step; see `newton` for the parameters."""

    def __init__(self, problem: Problem, start: State, load: StepLoad, expected: float) -> None:
        self._problem, self._start, self._load, self._expected = problem, start, load, expected
        self._iterate = Iterate.of(start)
        self._settled: SettledContact | None = None
        self._kept: Problem | None = None  # the last tangent, where another iteration may use it
        self._held = False  # whether the last tangent needed springs along closed gaps

    def iterated(self, origin: Array) -> StepEquilibrium:
        """Return the equilibrium by iterations that begin at displacements `origin` (n_dofs,) [length]."""
        problem, start = self._problem, self._start
        history: list[dict[str, Any]] = []
        u, bodies, changes = origin, problem.deformed(origin, start, self._load.rise), [1.0]
        for _ in range(MOST):
            before, here = u, bodies
            target, force = self._solve(here, before, changes)
            u, bodies, fraction = self._reach(before, target, changes)
            balanced = self._balanced(u, bodies, force, before)
            if history and fraction == 1.0 and balanced.excess > 1.0:
                u, bodies, fraction = self._searched((before, here), (u, bodies), force)
                balanced = self._balanced(u, bodies, force, before) if fraction < 1.0 else balanced
            moved = largest_difference(u, before)
            changes.append(self._relative(moved, u))
            history.append(_told(self._iterate, changes[-1], balanced, fraction))
            if (
                fraction == 1.0
                and balanced.excess <= 1.0
                and (_still(problem, changes) or moved <= start.gap_round_off)
            ):
                return StepEquilibrium(self._settled, u, balanced, bodies, history)
            if len(changes) > PATIENCE and min(changes[-PATIENCE:]) > FALL * min(changes[:-PATIENCE]):
                break
        raise ConvergenceError(
            f"Newton's iterations do not converge: after {len(history)} the displacement still changes by {changes[-1]:.1e} "
            f"of its largest component and forces are out of balance by {balanced.relative:.1e}; take smaller load steps",
            history,
        )

    def _relative(self, moved: float, u: Array) -> float:
        """Return the largest change of displacements to u (n_dofs,), `moved` [length], relative to their size."""
        size = max(map(largest, (u, self._load.lift, self._start.u)))
        return moved / size if size else 0.0

    def _balanced(self, u: Array, bodies: DeformedBodies, contact_force: Array, linearised_at: Array) -> Balance:
        """Return the balance of forces at displacements u, fluid's those of a linearisation elsewhere (n_dofs,) [length]."""
        contact_force = contact_force + self._fluid_change(linearised_at, u)
        internal = self._problem.internal(bodies, u, self._load)
        return balance(self._problem, u, contact_force, self._load.force, self._start.largest_force, internal)

    def _solve(self, bodies: DeformedBodies, u: Array, changes: list[float]) -> tuple[Array, Array]:
        """Return displacements (n_dofs,) [length] and contact forces (n_dofs,) [force] of the bodies linearised at u.

        Contact geometry settles to a part of the last of the relative `changes` of the displacement. Where the tangent is not
        positive definite, the springs of floating bodies are stiffened, then the constraints that the last contact held, by
        soft springs first: this leaves the iterations quadratic but for what contact does not hold. Where that does not help,
        parts of the geometric stiffness are left out. Once springs have helped, they are tried first.
        """
        failed: Exception | None = None
        for tangent in self._tangents():
            if self._held and tangent.geometric == WHOLE and not tangent.held:
                continue  # it failed an iteration ago
            if failed or tangent.geometric < WHOLE:  # the stiffness of the bodies is taken apart by now
                bodies = self._problem.deformed(u, self._start, self._load.rise, geometric=tangent.geometric)
            try:
                solution = self._linear_contact(bodies, u, changes, tangent)
            except (ModelError, ConvergenceError) as error:
                log.info("the tangent fails with %s: %s", tangent, error)
                failed = error
            else:
                self._held = tangent.held > 0.0
                return solution
        if isinstance(failed, ConvergenceError):
            raise failed
        raise ConvergenceError(
            f"the tangent stiffness of the bodies cannot be factorised ({failed}): they buckle, or the load step is too large"
        )

    def _tangents(self) -> list[_Tangent]:
        """Return the tangents to try, one after the other."""
        floats = self._problem.floating_bodies is not None
        closed = self._settled is not None and self._settled.solution.active.any()
        whole = [_Tangent(WHOLE, 0.0, stiff) for stiff in (False, True)[: 1 + floats]]
        held = [_Tangent(WHOLE, stiffness, floats) for stiffness in HELD] if closed else []
        return whole + held + [_Tangent(less, 0.0, floats) for less in range(WHOLE)[::-1]]

    def _linear_contact(
        self, bodies: DeformedBodies, u: Array, changes: list[float], tangent: _Tangent
    ) -> tuple[Array, Array]:
        """Return the result of `_solve` for a tangent, and keep the contact."""
        start, iterate = self._start, self._iterate
        problem, self._kept = (self._kept, None) if self._serves_again(changes) else (None, None)
        if problem is not None:
            problem = replace(problem, linearised_at=None if problem.linearised_at is None else u)
        else:
            scale = tangent.held and tangent.held * float(bodies.K.diagonal().max())
            added = self._added(scale, u) if tangent.geometric == WHOLE else None
            problem = self._problem.linearised(bodies, u, self._load, iterate.rigid, added, tangent.stiff)
            if tangent.geometric == WHOLE:
                self._kept = problem
        load = problem.about(bodies, u, self._load, iterate.rigid)
        iterate.u, iterate.history = u.copy(), []
        loaded, settled = with_loads(problem, load), None
        if problem.pairs:
            enough = min(max(problem.criteria.geometry, FORCING * changes[-1]), LOOSEST)
            inner = replace(problem, criteria=replace(problem.criteria, geometry=enough))
            dofs = problem.dofs.for_step(iterate.u, load.lift)
            step = StepContext(inner, start, load, dofs.loaded(loaded), dofs)
            settled = settle_geometry(step, Extrapolation(), self._expected, iterate)
        solution = solve_displacements(problem, load, loaded, settled, u)
        self._settled = settled
        return solution

    def _added(self, stiffness: float, u: Array) -> csr_array | None:
        """Return what the last contact adds to a tangent (n_dofs, n_dofs), at displacements u (n_dofs,) [force / length].

        The symmetric part of how forces of fluid follow the surface; and springs of a `stiffness`, slack at u, along the gaps
        that are closed. Displacements along these hardly change any more as iterations converge, so that springs change
        iterations by terms of second order alone (as the augmented Lagrangian does: Alart and Curnier, 1991).
        """
        total = csr_array((len(u), len(u)))
        for wetted in self._wetted:
            K = wetted.stiffness(self._problem.displacement(u))
            K.resize(total.shape)
            total = csr_array(total + K)
        if stiffness and self._settled is not None:
            constraints = self._settled.constraints
            dry = np.concatenate([part.contact_forces(np.ones(len(part))) for part in constraints.parts.values()])
            rows = csr_array(constraints.B[np.flatnonzero(self._settled.solution.active & (dry > 0.0))])
            springs = stiffness / np.asarray(rows.multiply(rows).sum(axis=1)).ravel()
            total = csr_array(total + rows.T @ diags_array(springs) @ rows)
        return total if total.nnz else None

    @property
    def _wetted(self) -> list[Wetted]:
        """Where fluid has come in the last contact, whose forces follow bodies in finite strain."""
        bodies = self._problem.bodies
        if self._settled is None or bodies is None or not bodies.finite:
            return []
        return [part.wetted for part in self._settled.constraints.parts.values() if part.wetted is not None]

    def _fluid_change(self, before: Array, u: Array) -> Array:
        """Return by how much forces (n_dofs,) of fluid change between displacements `before` and u (n_dofs,) [force]."""
        change, n = np.zeros_like(u), self._problem.model.n_dofs
        for wetted in self._wetted:
            now, then = (wetted.force(self._problem.displacement(each)) for each in (u, before))
            change[:n] += (now - then).ravel()
        return change

    def _serves_again(self, changes: list[float]) -> bool:
        """Return whether a second iteration with the last tangent is expected to be the last iteration.

        Newton's next change is C times the square of the last one. It leaves C^2 times the cube, if the tangent is old.
        """
        before, last = changes[-2:] if len(changes) > 2 else (0.0, changes[-1])
        C = last / before**2 if before else 1.0
        return len(changes) > 1 and C**2 * last**3 <= self._enough

    @property
    def _enough(self) -> float:
        return max(self._problem.criteria.geometry, UNCHANGED)

    def _reach(self, u: Array, target: Array, changes: list[float]) -> tuple[Array, DeformedBodies, float]:
        """Return the displacements to go on from, the bodies there, and the part of the way to the `target` (n_dofs,).

        Half of the way, of that half, and so on, is gone where cells turn inside out farther on. After `changes` and the
        whole way, a tangent may not be needed any more.
        """
        changes = [*changes, self._relative(largest_difference(target, u), target)]
        tangent = not (_still(self._problem, changes) or (self._kept is not None and self._serves_again(changes)))
        fraction = 1.0
        for _ in range(HALVINGS):
            end = target if fraction == 1.0 else u + fraction * (target - u)
            try:
                return end, self._problem.deformed(end, self._start, self._load.rise, tangent=tangent), fraction
            except ConvergenceError as error:
                failed = error
            fraction *= 0.5
        raise failed

    def _searched(
        self, begin: tuple[Array, DeformedBodies], end: tuple[Array, DeformedBodies], contact_force: Array
    ) -> tuple[Array, DeformedBodies, float]:
        """Return the result of `_reach` after a line search between two displacements (Crisfield, 1991, section 9.2).

        Under contact forces (n_dofs,) [force] as they are, the potential falls along the way at its beginning; where it rises
        at the end by much of that, the end lies too far.
        """
        (u, here), (target, bodies) = begin, end
        problem = self._problem
        along = problem.system.unknowns(target - u)

        def slope(at: Array, deformed: DeformedBodies) -> float:
            out = problem.internal(deformed, at, self._load)[0] - contact_force - self._fluid_change(u, at)
            return float(problem.system.reduced(out - self._load.force) @ along)

        first, last, fraction = slope(u, here), slope(target, bodies), 1.0
        for _ in range(SEARCHES):
            if not last > OVERSHOT * abs(first):
                break
            fraction *= max(abs(first) / (abs(first) + last), LEAST)
            target = u + fraction * (end[0] - u)
            bodies = problem.deformed(target, self._start, self._load.rise)
            last = slope(target, bodies)
        return target, bodies, fraction


def _still(problem: Problem, changes: list[float]) -> bool:
    """Return whether the relative `changes` of the displacement leave an error below the criterion, or are round-off."""
    before, last = changes[-2:]
    left = last * min(last / before, 1.0) if before else last
    return left <= max(problem.criteria.geometry, UNCHANGED) or (last <= SCATTER and last > STAYS * before)


def _told(iterate: Iterate, change: float, balanced: Balance, fraction: float) -> dict[str, Any]:
    """Return the entry of an iteration in the history."""
    inner = iterate.history
    return {
        "displacement_change": change, "residual": balanced.relative, "pairings": len(inner),
        "active": inner[-1]["active"] if inner else 0,
        "active_set_iterations": sum(entry["active_set_iterations"] for entry in inner),
        **({} if fraction == 1.0 else {"damped": fraction}),
    }  # fmt: skip
