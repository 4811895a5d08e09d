"""Solve the contact problem with fixed geometry, by the active set method or by the solver for Coulomb friction.

Floating bodies, which only contact restrains, are held by springs, whose positions are iterated; see `floating_bodies`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from fastcontact._jit.norms_kernels import largest
from fastcontact.analysis import active_set
from fastcontact.analysis.active_dofs import ActiveDofs, constraints_on_unknowns
from fastcontact.analysis.convergence_messages import friction_exceeded, no_contact_stops, not_balanced
from fastcontact.analysis.floating_bodies import FloatingBodies
from fastcontact.analysis.iterate import Iterate
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import Accuracy, Path, Slid, Solution
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Mask
from fastcontact.contact.constraints import Constraints, StackedConstraints
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.errors import ConvergenceError
from fastcontact.linear.protocol import Loaded
from fastcontact.model.model import gaps_at_rest
from fastcontact.model.rigid_motions import generalised, needed_friction, resisting, stopped_at
from fastcontact.round_off import SINGLE_PRECISION


@dataclass(frozen=True, eq=False)
class StepContext:
    """Data that all pairings of the contact surfaces in a load step share.

    Attributes
    ----------
    problem : Problem
    state : State
        State at the beginning of the step.
    load : StepLoad
    loaded : Loaded
        The prepared matrix with the right-hand side of the step, in the unknowns of `dofs`.
    dofs : ActiveDofs
        Unknowns of the contact problem: all of them, or those of the contact surfaces after static condensation.
    path : Path or Slid, optional
        Load path of the step, if friction is solved along it in increments; or the data at the beginning of its last
        increment, if only this increment is solved again.
    """

    problem: Problem
    state: State
    load: StepLoad
    loaded: Loaded
    dofs: ActiveDofs
    path: Path | Slid | None = None

    @cached_property
    def prescribed_motion(self) -> Array:
        """Increment (n_dofs,) of the displacements in the step that supports and multi-point constraints impose [length].

        It is the change of the displacements if all unknowns keep their values.
        """
        system, start, zero = self.problem.system, self.state.u, np.zeros_like(self.state.u)
        return self.load.lift - (start - system.displacement(system.unknowns(start, zero), zero))

    def driven(self, constraints: Constraints) -> Array:
        """Return the slips imposed by supports and obstacles in the step.

        They are divided by the largest imposed displacement, so that round-off can be recognised.

        Returns
        -------
        ndarray (k, m)
            Imposed slip along each of k tangents of the m constraints [-].
        """
        slips = np.stack([T @ self.prescribed_motion for T in constraints.tangents])
        # Without prescribed displacements in this step, `prescribed_motion` is the round-off of earlier displacements.
        scale = max(largest(self.prescribed_motion), largest(self.state.u))
        if constraints.slip0 is not None and isinstance(constraints, StackedConstraints):
            begin, end = self.state.obstacles, self.load.obstacles
            for name, rows in constraints.rows().items():
                if isinstance(self.problem.pairs[name].primary, RigidSide):
                    slips[:, rows] += constraints.slip0[:, rows]
                    # If the obstacle moves along the normals, its slips are round-off of this motion.
                    moved = end.get(name, np.zeros(1)) - begin.get(name, 0.0)
                    scale = max(scale, largest(constraints.slip0[:, rows]), largest(moved))
        return np.asarray(slips / (scale or 1.0))


def solve_inequalities(
    step: StepContext, constraints: Constraints, iterate: Iterate, active: Mask, accuracy: Accuracy
) -> tuple[Solution, Array]:
    """Solve the contact inequalities of one pairing of the surfaces.

    Parameters
    ----------
    step : StepContext
    constraints : Constraints
        The m constraints, in terms of all displacements.
    iterate : Iterate
        Its displacements are the initial guess. It receives the solution if there is friction, and the rigid position of
        floating bodies.
    active : ndarray of bool (m,)
        Initial active set.
    accuracy : Accuracy
        Tolerances and limits of the iteration.

    Returns
    -------
    solution : Solution
    displacement : ndarray (k,)
        Displacements of the components of `step.dofs`; with floating bodies, all displacements (n_dofs,) [length].
    """
    if step.problem.floating_bodies is not None:
        return _with_floating_bodies(step, step.problem.floating_bodies, constraints, iterate, active, accuracy)
    solution = _solve(step, constraints, iterate, active, accuracy, step.load.lift, iterate.u)
    return solution, step.dofs.displacement(solution.u, step.load.lift)


def _solve(
    step: StepContext, constraints: Constraints, iterate: Iterate, active: Mask, accuracy: Accuracy, lift: Array, guess: Array
) -> Solution:  # fmt: skip
    """Solve in the unknowns that remain after supports and multi-point constraints are eliminated.

    `lift` (n_dofs,) are the displacements that supports and multi-point constraints prescribe if all unknowns are zero, and
    `guess` (n_dofs,) are initial displacements [length].
    """
    condensed = constraints_on_unknowns(step.dofs, constraints, lift, step.state.u)
    u = step.dofs.unknowns(guess, lift)
    if not constraints.tangents:
        return active_set.solve(step.loaded, condensed, active, accuracy, u)
    from fastcontact.analysis.friction import solve as friction
    from fastcontact.analysis.friction.path import completed, shifted

    condensed = replace(condensed, driven=step.driven(constraints))
    slid = step.path if isinstance(step.path, Slid) and len(step.path.slip) == len(constraints) else None
    path = step.path if isinstance(step.path, Path) else None
    condensed = condensed if slid is None else shifted(condensed, slid)
    solution = friction.solve(step.loaded, condensed, active, accuracy, u, iterate.frictional, path)
    iterate.frictional = solution if slid is None else completed(solution, slid)
    return iterate.frictional


def _with_floating_bodies(
    step: StepContext,
    bodies: FloatingBodies,
    constraints: Constraints,
    iterate: Iterate,
    active: Mask,
    accuracy: Accuracy,
) -> tuple[Solution, Array]:
    """Solve if contact alone restrains some bodies; return the solution and all displacements (n_dofs,) [length].

    The springs at rigid positions hold these bodies; `FloatingBodies.settle` iterates the positions until the springs are
    free of forces.
    """
    problem, state, lift = step.problem, step.state, step.load.lift
    known, near = active, iterate.u

    def solve_at(position: Array) -> Solution:
        nonlocal known, near
        at = lift + bodies.rigid(position)
        solution = _solve(step, constraints, iterate, known, accuracy, at, near)
        known, near = solution.wanted, problem.system.displacement(solution.u, at)
        return solution

    start = iterate.u[bodies.dofs]
    if not iterate.history:
        moved = _approach(step, bodies, constraints, iterate.u)
        unilateral = active if constraints.equality is None else active & ~constraints.equality
        if not unilateral.any():
            start = start + moved
            known = active | _touching(step, constraints, iterate.u + bodies.rigid(moved))
    noise = 10 * max(problem.solver.tolerance, accuracy.residual or 0.0)
    rigid = bodies.settle(solve_at, start, state.largest_rigid_force, noise, state.gap_round_off)
    if rigid.state.settled and not rigid.slack:
        rubbing = bool(constraints.coefficients.any())
        gaps = gaps_at_rest(problem.model, bodies.motions)
        text = not_balanced(bodies, rigid, state.largest_rigid_force, rubbing, gaps)
        raise ConvergenceError(text, iterate.history)
    iterate.rigid = rigid
    at = lift + bodies.rigid(rigid.position)
    return rigid.state, problem.system.displacement(rigid.state.u, at)


def _touching(step: StepContext, constraints: Constraints, u: Array) -> Mask:
    """Return which constraints (m,) are closed at the displacements u (n_dofs,) [length] that `_approach` computed."""
    size = float(np.ptp(step.problem.model.mesh.points, axis=0).max())
    # The linear program of `stopped_at` is solved to a relative accuracy of 1e-7, about that of single precision.
    return constraints.usable & (constraints.gap0 + constraints.B @ u <= SINGLE_PRECISION * size)


def _approach(step: StepContext, bodies: FloatingBodies, constraints: Constraints, u: Array) -> Array:
    """Return the amplitudes (k,) of the free rigid-body motions at which contact can balance the loads [length].

    u (n_dofs,) are the displacements from which the bodies move [length].

    Raises
    ------
    ConvergenceError
        If no contact stops the bodies.
    """
    work = generalised(bodies.motions, step.load.force, step.state.largest_rigid_force)
    rows, gap0 = resisting(constraints)
    size = float(np.ptp(step.problem.model.mesh.points, axis=0).max())
    stop = stopped_at(rows @ bodies.motions.displacement, gap0 + rows @ u, work, size)
    if stop is None:
        more = needed_friction(constraints, bodies.motions.displacement, u, work, size)
        text = no_contact_stops(bodies, work) if more is None else friction_exceeded(bodies, work, more)
        raise ConvergenceError(text, smaller_steps_help=False)
    return stop
