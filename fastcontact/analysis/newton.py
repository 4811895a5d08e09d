"""Newton's method for a load step: bodies and loads are linearised, and contact is solved with its inequalities.

This is the Newton method of Josephy (1979) for generalised equations: each iteration solves the contact problem of the
linearised bodies, including its geometry, so that iterations converge quadratically and few matrices are factorised. Where
all tangents are constant, for linear bodies under small strains, the first iteration gives the solution.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.sparse import bsr_array, csr_array, diags_array, vstack

from fastcontact.analysis import equilibrium
from fastcontact.analysis.anderson import DEPTH, Anderson
from fastcontact.analysis.criteria import HALVINGS, MAX_NEWTON_ITERATIONS, NOTABLE
from fastcontact.analysis.equilibrium import Balance, FollowingForce, StepEquilibrium, Terms, balance
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.geometry_loop import SettledContact, settle_geometry
from fastcontact.analysis.inequalities import Iterate, StepContext
from fastcontact.analysis.problem import Problem, StepLoad, linearised
from fastcontact.analysis.tolerances import DECLINE, WINDOW
from fastcontact.arrays import Array, largest
from fastcontact.elasticity.nonlinear_bodies import COMPLETE
from fastcontact.errors import ConvergenceError, ModelError
from fastcontact.linear.choice import MAX_TOLERANCE
from fastcontact.linear.protocol import TOLERANCE
from fastcontact.round_off import SINGLE_PRECISION

log = logging.getLogger("fastcontact")
# Stiffness of springs along closed gaps, over the largest stiffness of the bodies. Stiff springs slow down motions that
# contact does not constrain, such as gaps between the nodes of a pressure field. An O-ring takes 5 iterations with 5e-5 and
# 7 with 2e-4. An O-ring under fluid pressure takes 13 with 2e-4, and 5e-5 is too soft for it.
GAP_STIFFNESS = 2e-4


def newton(begin: StepContext, before: StepEquilibrium | None = None) -> StepEquilibrium:
    """Return the equilibrium of a load step.

    Parameters
    ----------
    begin : StepContext
        Data at the beginning of the step, with the linear solver prepared for zero displacements.
    before : StepEquilibrium, optional
        Equilibrium of the same step under nearly the same load, from which the iterations start.

    Raises
    ------
    ConvergenceError
        If the iterations do not converge, a cell is inverted, or forces stay out of balance.
    """
    if begin.problem.bodies is not None:
        return _nonlinear_equilibrium(begin, before)
    problem, start, load, u = begin.problem, begin.state, begin.load, begin.state.u
    iterate = Iterate.of(start) if before is None or before.settled is None else before.settled.iterate
    while True:  # until the forces balance, with more accurate linear solutions
        settled = settle_geometry(begin, iterate)
        u, contact_force = equilibrium.solve_displacements(begin, settled, u)
        force = problem.system.K @ u
        internal = force, (0.5 * float(u @ force), 0.0)
        force_balance = balance(problem, u, contact_force, load.force, start.largest_force, internal)
        if iterate.history:
            iterate.history[-1]["residual"] = force_balance.relative
        if force_balance.residual <= force_balance.bound:
            return StepEquilibrium(settled, u, force_balance)
        if not problem.solver.improve(force_balance.accuracy_factor):
            raise force_balance.failure(begin.index, problem, iterate.history)
        begin = begin.with_load(load)


def _nonlinear_equilibrium(begin: StepContext, before: StepEquilibrium | None) -> StepEquilibrium:
    """Return the result of `newton` for nonlinear bodies, from a predicted displacement if there is one."""
    start = begin.state
    if before is not None or start.extrapolation.ratio:
        origin = start.extrapolation.predicted(start.u) if before is None else before.u
        try:
            return _Newton(begin).equilibrium_from(origin)
        except ConvergenceError as error:
            log.info("the step restarts from the previous displacement instead of a predicted one: %s", error)
            before = None
    return _Newton(begin, before).equilibrium_from(start.u)


@dataclass(frozen=True)
class Regularisation:
    """Regularisation that makes a tangent positive definite.

    Attributes
    ----------
    geometric : int
        Which part of the geometric stiffness is included, see `NonlinearBodies.at`.
    gap_stiffness : float
        Stiffness of springs along closed gaps, over the largest stiffness of the bodies [-].
    stiff : bool
        Whether the springs of floating bodies are as stiff as these bodies.
    replaces_springs : bool
        Whether the springs along closed gaps replace those of floating bodies, provided that they resist all free motions.
    """

    geometric: int = COMPLETE
    gap_stiffness: float = 0.0
    stiff: bool = False
    replaces_springs: bool = False

    @property
    def converges_linearly(self) -> bool:
        """Whether iterations with this tangent converge only linearly, not quadratically."""
        return self.geometric < COMPLETE or self.gap_stiffness > 0.0


class _Newton:
    """The iterations of a load step with nonlinear bodies; see `newton` for the parameters."""

    def __init__(self, begin: StepContext, before: StepEquilibrium | None = None) -> None:
        self._problem, self._begin, self._start, self._load = begin.problem, begin, begin.state, begin.load
        self._terms = Terms(begin.problem, begin.state, begin.load)
        self._tolerance = max(begin.problem.criteria.geometry, TOLERANCE)  # of the relative error of the displacements
        settled = None if before is None else before.settled
        self._iterate = Iterate.of(begin.state) if settled is None else settled.iterate
        self._settled: SettledContact | None = None
        self._reusable: Problem | None = None  # problem with the last tangent, if another iteration may use it
        self._reused = False  # whether the last iteration used the tangent of an earlier one
        self._linear_tolerance: float | None = None  # of the last linear solution, if larger than that of the solver
        self._has_full_step = False  # whether displacements are those of the last contact solution
        self._regularisation = Regularisation()  # of the last tangent
        self._replaces_springs = bool(begin.problem.force_driven.pairs)  # see `Regularisation`
        self._mixing = Anderson(DEPTH, np.arange(len(begin.state.u)))

    def equilibrium_from(self, origin: Array) -> StepEquilibrium:
        """Return the equilibrium, by iterations that begin at the displacements `origin` (n_dofs,) [length]."""
        history: list[dict[str, Any]] = []
        u, changes = origin, [1.0]
        for _ in range(MAX_NEWTON_ITERATIONS):
            before = u
            try:
                target, contact_force = self._solve(before, changes)
            except ConvergenceError as error:
                if not history or error.smaller_steps_help:
                    raise
                log.info("an iterate is rejected: %s", error)  # an equilibrium may exist nevertheless
                break
            u, fraction = self._damped_step(before, target, changes)
            force_balance = self._force_balance(u, contact_force, before)
            if history and fraction == 1.0 and force_balance.residual > force_balance.bound:
                u, fraction = self._line_search(before, u, contact_force)
                force_balance = self._force_balance(u, contact_force, before) if fraction < 1.0 else force_balance
            change = largest(u - before)
            changes.append(self._relative(change, u))
            pairings = self._iterate.history
            history.append({
                "displacement_change": changes[-1], "residual": force_balance.relative, "pairings": len(pairings),
                "active": pairings[-1]["active"] if pairings else 0,
                "active_set_iterations": sum(entry["active_set_iterations"] for entry in pairings),
                **({} if fraction == 1.0 else {"damped": fraction}),
            })  # fmt: skip
            small = self._has_converged(changes) or change <= self._start.gap_round_off
            if fraction == 1.0 and force_balance.residual <= force_balance.bound and small:
                return StepEquilibrium(self._settled, u, force_balance, self._terms, history)
            self._has_full_step = fraction == 1.0 and not self._regularisation.converges_linearly
            u = self._accelerated(before, u, changes) if fraction == 1.0 else u
            if len(changes) > WINDOW and min(changes[-WINDOW:]) > DECLINE * min(changes[:-WINDOW]):
                break
        raise ConvergenceError(
            f"Newton's method does not converge: after {len(history)} iterations displacements change by {changes[-1]:.1e} "
            f"of the largest one, and forces are out of balance by {force_balance.relative:.1e}; use smaller load steps",
            history,
        )

    def _relative(self, change: float, u: Array) -> float:
        """Return the ratio of the largest change of the displacements [length] to the largest displacement in u (n_dofs,)."""
        size = max(map(largest, (u, self._load.lift, self._start.u)))
        return change / size if size else 0.0

    def _has_converged(self, changes: list[float]) -> bool:
        """Return whether the relative `changes` show an error below the criterion; never after an inexact solution.

        A change that is small enough to be round-off (SINGLE_PRECISION, reached in slender bodies) is regarded as round-off
        if it exceeds the fraction DECLINE of the previous one.
        """
        if self._linear_tolerance is not None:
            return False
        rate, last = self._rate(changes), changes[-1]
        if self._regularisation.converges_linearly:
            return last * rate <= self._tolerance * (1.0 - rate) or (last <= SINGLE_PRECISION and rate == 1.0)
        return last * rate <= self._tolerance or (last <= SINGLE_PRECISION and rate > DECLINE)

    def _rate(self, changes: list[float]) -> float:
        """Return the rate of convergence [-], the ratio of the last two `changes`.

        With the tangent of an earlier iteration, this ratio ignores points whose plastic flow has begun or ended since. The
        larger of this ratio and the preceding one is then returned.
        """
        before, last = changes[-2:]
        rate = last / before if before else 1.0
        if self._reused and changes[-3]:
            rate = max(rate, before / changes[-3])
        return min(rate, 1.0)

    def _accelerated(self, before: Array, u: Array, changes: list[float]) -> Array:
        """Return the next iterate (n_dofs,) [length], after an iteration from `before` (n_dofs,) to u (n_dofs,).

        Anderson acceleration is used where a regularised tangent makes the iterations converge linearly. The springs of
        floating bodies have the same effect if the load turns a body, such as a roller without friction: changes of its
        rotation then have a constant ratio, which exceeds 1 if the equilibrium is unstable.
        """
        is_linear = self._regularisation.converges_linearly
        if self._problem.floating_bodies is not None and len(changes) > 2 and changes[-1] <= NOTABLE:
            is_linear |= changes[-1] > DECLINE * changes[-2] > DECLINE**2 * changes[-3]
        if not is_linear or DECLINE * changes[-1] > changes[-2]:
            self._mixing.restart()
            return u
        return self._mixing.mixed(before, u)

    def _tangent_suffices(self, changes: list[float]) -> bool:
        """Return whether one further iteration with the last tangent, if it is reusable, is expected to be the last one.

        The next change of Newton's method is C times the square of the last one. The error after a second iteration with
        the same tangent is C^2 times the cube of the last change. Further iterations reduce it at a constant rate.
        """
        if self._reusable is None:
            return False
        if self._reused:
            return self._rate(changes) ** 2 * changes[-1] <= self._tolerance
        before, last = changes[-2:] if len(changes) > 2 else (0.0, changes[-1])
        C = last / before**2 if before else 1.0
        return len(changes) > 1 and C**2 * last**3 <= self._tolerance

    def _force_balance(self, u: Array, contact_force: Array, linearised_at: Array) -> Balance:
        """Return the force balance at u (n_dofs,) under the contact forces of a problem linearised at `linearised_at`."""
        internal = self._terms.residual(u, self._fluid(linearised_at))
        return balance(self._problem, u, contact_force, self._load.force, self._start.largest_force, internal)

    def _solve(self, u: Array, changes: list[float]) -> tuple[Array, Array]:
        """Return displacements (n_dofs,) [length] and contact forces (n_dofs,) [force] of the step linearised at u (n_dofs,).

        The contact geometry is iterated to a fraction of the last relative change of the displacements in `changes`. If the
        tangent is not positive definite, the springs of floating bodies are stiffened. If this does not suffice, springs are
        added along closed gaps, with which convergence remains quadratic except for motions that contact does not restrain.
        Finally, parts of the geometric stiffness are omitted. Once springs along gaps have sufficed, they are tried first.
        """
        # The changes increase if a floating body moves in directions that springs along gaps do not resist.
        if self._regularisation.gap_stiffness and changes[-1] > changes[-2] > min(changes):
            self._replaces_springs = True
        failure: Exception | None = None
        for regularisation in self._regularisations():
            try:
                solution = self._solve_linearised(u, changes, regularisation)
            except (ModelError, ConvergenceError) as error:
                log.info("the tangent fails with %s: %s", regularisation, error)
                failure = error
            else:
                if regularisation != self._regularisation:
                    self._mixing.restart()
                self._regularisation = regularisation
                return solution
        if isinstance(failure, ConvergenceError):
            raise failure
        raise ConvergenceError(
            f"the tangent stiffness cannot be factorised ({failure}): the bodies buckle, or the load step is too large"
        )

    def _regularisations(self) -> list[Regularisation]:
        """Return the regularisations to try, in order."""
        stiff, settled = self._problem.floating_bodies is not None, self._settled
        tangents = [Regularisation()]
        if stiff and self._problem.solver.iterative:  # with a direct solver, springs are always stiff
            tangents.append(Regularisation(stiff=True))
        if settled is not None and settled.solution.active.any():
            replaces_springs = self._replaces_springs or settled.constraints.tangents != ()
            along_gaps = Regularisation(COMPLETE, GAP_STIFFNESS, stiff, replaces_springs)
            # If springs were needed in the last iteration, the unmodified tangent has failed before.
            tangents = [along_gaps] if self._regularisation == along_gaps else [*tangents, along_gaps]
        fewer_parts = range(min(self._regularisation.geometric + 1, COMPLETE))[::-1]
        return [*tangents, *(Regularisation(part, stiff=stiff) for part in fewer_parts)]

    def _solve_linearised(self, u: Array, changes: list[float], regularisation: Regularisation) -> tuple[Array, Array]:
        """Return the result of `_solve` for one regularisation."""
        terms, iterate = self._terms, self._iterate
        problem = self._reusable if self._tangent_suffices(changes) else None
        self._reusable = None
        self._reused = problem is not None
        if problem is not None:
            problem = replace(problem, linearised_at=None if problem.linearised_at is None else u)
        elif regularisation == Regularisation() and self._is_at_rest(u):
            bodies = self._problem.bodies
            problem = replace(self._problem, linearised_at=u if bodies and bodies.finite else None)
        else:
            K = terms.tangent(u, regularisation.geometric)
            contact = self._stiffness_of_contact(K, u, regularisation) if regularisation.geometric == COMPLETE else None
            problem = linearised(self._problem, K, u, contact, regularisation.stiff, regularisation.replaces_springs)
        unbalanced, floating = self._load.force - terms.residual(u)[0], problem.floating_bodies
        # Under load, the tangent resists rigid-body rotations, which the unknowns of floating bodies do not include.
        force = unbalanced + problem.system.K @ (u if floating is None else floating.strained(u))
        load = replace(self._load, force=force)
        iterate.u, iterate.history = u.copy(), []
        self._linear_tolerance = self._forcing(problem, load, u, unbalanced)
        # The contact geometry is iterated no further than the linearisation of the bodies is accurate.
        tolerance = min(max(problem.criteria.geometry, MAX_TOLERANCE * changes[-1]), NOTABLE)
        step = replace(
            self._begin, problem=replace(problem, criteria=replace(problem.criteria, geometry=tolerance)), load=load,
            state=replace(self._start, extrapolation=Extrapolation()),
            loaded=problem.loaded(load),
        )  # fmt: skip
        paired = self._settled if self._has_full_step and problem.linearised_at is None else None
        settled = settle_geometry(step, iterate, paired)
        solution = equilibrium.solve_displacements(step, settled, u, self._linear_tolerance)
        self._settled = settled
        self._reusable = problem if regularisation.geometric == COMPLETE else None
        return solution

    def _is_at_rest(self, u: Array) -> bool:
        """Return whether the tangent at u (n_dofs,) is the stiffness of the problem, whose linear solver is prepared."""
        loaded = self._load.rise is not None or self._problem.following or self._settled is not None
        return not (loaded or self._start.history or u.any())

    def _forcing(self, problem: Problem, load: StepLoad, u: Array, unbalanced: Array) -> float | None:
        """Return the tolerance of the linear solution from u (n_dofs,), None for that of the solver (inexact Newton method).

        `unbalanced` (n_dofs,) are the residual forces of the terms at u. The ratio of the largest of them to the largest
        force is about squared in each iteration. If the next iteration will be the last one, the tolerance is that of the
        solver.
        """
        system, lift = problem.system, load.lift
        scale = max(largest(system.right_side(load.force, lift)), self._start.largest_force)
        if problem.pairs or not problem.solver.iterative or scale == 0.0:
            return None
        # Largest prescribed displacement that u does not satisfy yet.
        violation = largest(system.displacement(system.unknowns(u, lift), lift) - u)
        ratio = largest(system.reduced(unbalanced)) / scale
        ratio = max(ratio, violation and violation / max(largest(u), largest(lift)))
        return MAX_TOLERANCE * ratio if ratio**2 > self._tolerance else None

    def _stiffness_of_contact(self, K: bsr_array, u: Array, regularisation: Regularisation) -> csr_array | None:
        """Return the stiffness that the last contact adds to a tangent at displacements u (n_dofs,) [force / length].

        It consists of the symmetric part of the load stiffness of fluid pressure, and of springs along closed gaps and along
        the slips of sticking constraints. The springs are slack at u. As iterations converge, these gaps and
        slips hardly change, so that the springs affect iterations only to second order (as in the augmented Lagrangian
        method: Alart and Curnier, 1991).
        """
        matrices = [fluid.tangent(u) for fluid in self._fluid(u)]
        if regularisation.gap_stiffness and self._settled is not None:
            constraints, solution = self._settled.constraints, self._settled.solution
            dry = np.concatenate([part.contact_forces(np.ones(len(part))) for part in constraints.parts.values()])
            closed = solution.active & (dry > 0.0)
            sticking_rows = [tangent[np.flatnonzero(closed & solution.sticking)] for tangent in constraints.tangents]
            rows = csr_array(vstack([constraints.B[np.flatnonzero(closed)], *sticking_rows]))
            squares = np.asarray(rows.multiply(rows).sum(axis=1)).ravel()  # zero for tangents of pairs without friction
            diagonal_blocks = K.data[K.indices == np.repeat(np.arange(len(K.indptr) - 1), np.diff(K.indptr))]
            stiffest = float(np.linalg.eigvalsh(diagonal_blocks).max())  # the largest entry would depend on the axes
            stiffness = regularisation.gap_stiffness * stiffest / np.where(squares > 0.0, squares, np.inf)
            matrices.append(csr_array(rows.T @ diags_array(stiffness) @ rows))
        for matrix in matrices:
            matrix.resize((len(u), len(u)))
        return sum(matrices[1:], matrices[0]) if matrices else None

    def _fluid(self, at: Array) -> list[FollowingForce]:
        """Return the fluid pressures of the last contact that follow bodies, linearised `at` displacements (n_dofs,)."""
        bodies = self._problem.bodies
        if self._settled is None or bodies is None or not bodies.finite:
            return []
        wetted = [part.wetted for part in self._settled.constraints.parts.values()]
        return [FollowingForce(self._problem, w.force, w.stiffness, at) for w in wetted if w is not None]

    def _damped_step(self, u: Array, target: Array, changes: list[float]) -> tuple[Array, float]:
        """Return the next displacements (n_dofs,), and the step length from u to the `target` (n_dofs,).

        The step is halved until no cells are inverted. After a full step, `changes` decide whether another tangent is needed.
        """
        fraction = 1.0
        changes = [*changes, self._relative(largest(target - u), target)]
        needs_tangent = not (self._has_converged(changes) or self._tangent_suffices(changes))
        for _ in range(HALVINGS):
            trial = target if fraction == 1.0 else u + fraction * (target - u)
            try:
                self._terms.bodies_at(trial, tangent=needs_tangent)
            except ConvergenceError as error:
                failure = error
            else:
                return trial, fraction
            fraction *= 0.5
        raise failure

    def _line_search(self, u: Array, target: Array, contact_force: Array) -> tuple[Array, float]:
        """Return the result of `_damped_step` after a line search (Crisfield, 1991, section 9.2).

        With fixed contact forces (n_dofs,) [force] the potential decreases at the beginning of the step; if its slope at
        the end is positive and larger than the initial one, the step is shortened.
        """
        system, fluid = self._problem.system, self._fluid(u)
        change, direction = target - u, system.unknowns(target - u)

        def slope(at: Array) -> float:
            unbalanced = self._terms.residual(at, fluid)[0] - contact_force - self._load.force
            return float(system.reduced(unbalanced) @ direction)

        initial_slope, slope_at_end, fraction = slope(u), slope(target), 1.0
        for _ in range(HALVINGS):
            if not slope_at_end > abs(initial_slope):
                break
            fraction *= abs(initial_slope) / (abs(initial_slope) + slope_at_end)
            target = u + fraction * change
            slope_at_end = slope(target)
        return target, fraction
