"""One iteration of the geometry loop: pair the contact surfaces, and solve the contact problem of this pairing.

The inequalities are solved by the active set method, or by the solver for Coulomb friction. Springs hold floating bodies,
which only contact restrains. The positions at which the springs are anchored are iterated; see `floating_bodies`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from fastcontact._tools.records import record
from fastcontact.analysis import active_set
from fastcontact.analysis.convergence_messages import friction_exceeded, not_restrained
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.floating_bodies import FloatingBodies, RigidPosition
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import Accuracy, Path, SlipSoFar, Solution, in_last_increment, over_whole_step
from fastcontact.analysis.state import State
from fastcontact.arrays import AnyArray, Array, Mask, largest
from fastcontact.contact.constraints import Constraints, StackedConstraints, stacked
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.errors import ConvergenceError
from fastcontact.linear.protocol import Loaded
from fastcontact.model.model import gap_changes
from fastcontact.model.pretension import loose_bolts_remark
from fastcontact.model.rigid_motions import cone_rows, generalised_forces, grouped_by_body, needed_friction, stopped_at
from fastcontact.round_off import SINGLE_PRECISION, SUM_ROUND_OFF

# Number of times that contact displaces fluid from a node in a load step after which the node stays dry. At the front of the
# fluid a node may be neither dry, because its mean pressure is below that of the fluid, nor wet, because its gap would close.
DISPLACED = 3


@dataclass(eq=False)
class Iterate:
    """Iterate of a load step between two pairings of the contact surfaces; `geometry_loop` modifies it.

    Attributes
    ----------
    u : ndarray (n_dofs,)
        Displacements; components that are condensed keep their values from the beginning of the step [length].
    active : dict of str to ndarray of bool (m,)
        For each contact pair, the active set that the last solution predicts for the next one.
    pressure : dict of str to ndarray (n_nodes,)
        Last nodal pressures of each contact pair [pressure].
    frictional : Solution, optional
        The last solution with friction.
    rigid : RigidPosition, optional
        The last position of floating bodies.
    history : list of dict
        Convergence data of each pairing, see `StepResult.iterations`.
    rounded : bool
        Whether edges between facets are rounded, because pairings alternated; see `Configuration`.
    fluid : dict of str to (ndarray of bool (n_nodes,), ndarray of int (n_nodes,))
        For each contact pair with fluid pressure, the nodes that fluid reaches, and how many times contact displaced it.
    """

    u: Array
    active: dict[str, Mask]
    pressure: dict[str, Array]
    frictional: Solution | None = None
    rigid: RigidPosition | None = None
    history: list[dict[str, Any]] = field(default_factory=list)
    rounded: bool = False
    fluid: dict[str, tuple[Mask, AnyArray]] = field(default_factory=dict)

    @classmethod
    def of(cls, state: State) -> Iterate:
        """Return the initial iterate of a load step."""
        return cls(state.u.copy(), dict(state.active), dict(state.pressure))


def pair_surfaces(problem: Problem, state: State, load: StepLoad, iterate: Iterate) -> StackedConstraints:
    """Return the constraints of all pairs, from the deformed or, with `keep_pairing`, from the undeformed configuration."""
    displacement, u = problem.displacement(iterate.u).copy(), iterate.u  # a copy, since iterations reuse the array
    if problem.force_driven.pairs:
        u = np.where(problem.system.fixed, load.lift, u)
    paired_at = np.zeros_like(displacement) if problem.criteria.keep_pairing else displacement
    parts = {}
    for name, pair in problem.pairs.items():
        configuration = problem.configuration(name, state, load, paired_at, u)
        pressure, fluid = iterate.pressure.get(name), iterate.fluid.get(name)
        if pressure is not None and fluid is not None:  # impermeable where the fluid has been displaced too often
            pressure = np.where(fluid[1] < DISPLACED, pressure, np.inf)
        parts[name] = pair.constraints(replace(configuration, pressure=pressure, rounded=iterate.rounded))
        if (wetted := parts[name].wetted) is not None:
            wet = wetted.pressure > 0.0
            was_wet, displaced = fluid or (wet, np.zeros(len(wet), int))
            iterate.fluid[name] = wet, displaced + (was_wet & ~wet)
        if problem.force_driven.pairs:
            rotates = isinstance(pair.primary, RigidSide) and pair.primary.rotation is not None
            motion = configuration.pose.displacement - configuration.pose_start.displacement if rotates else None
            parts[name] = problem.force_driven.constraints(name, parts[name], configuration.pose.displacement, motion)
    return stacked(parts)


def initially_active(constraints: StackedConstraints, iterate: Iterate, extrapolation: Extrapolation | None) -> Mask:
    """Return the initial active set (m,): the one predicted by the last solution, or extrapolated at the first pairing."""
    sets = []
    for name, part in constraints.parts.items():
        if part.equality.all():
            active = part.equality
        elif name not in iterate.active:
            active = np.zeros(len(part), bool)
        elif part.tied is not None:
            active = part.equality | (part.gap0 + part.B @ iterate.u < 0.0)
        else:
            assert part.nodal is not None
            last_active = iterate.active[name]
            last_active = last_active if extrapolation is None else extrapolation.active(name, last_active)
            active = part.nodal.initial_active_set(part.gap0 + part.B @ iterate.u, iterate.pressure[name], last_active)
        sets.append(active)
    return np.concatenate(sets)


@record
class StepContext:
    """Data that all pairings of the contact surfaces in a load step share.

    Attributes
    ----------
    problem : Problem
    state : State
        State at the beginning of the step.
    load : StepLoad
    loaded : Loaded
        The prepared matrix with the right-hand side of the step; in the geometry loop in the unknowns of `Problem.dofs`.
    expected : float
        Scale of the displacements in the first step, if only forces act [length].
    index : int
        Number of the step.
    condensed_size : float
        Largest absolute value of the unknowns that are condensed, at the beginning of the step [length].
    path : Path or SlipSoFar, optional
        Load path of the step, if friction is solved along it in increments; or the data at the beginning of its last
        increment, if only this increment is solved again.
    """

    problem: Problem
    state: State
    load: StepLoad
    loaded: Loaded
    expected: float = 0.0
    index: int = 0
    condensed_size: float = 0.0
    path: Path | SlipSoFar | None = None

    @property
    def linearises_contact(self) -> bool:
        """Whether Newton's method applies to the contact geometry: with a direct solver, without fluid pressure."""
        return not (self.problem.solver.iterative or self.load.fluids)

    @cached_property
    def prescribed_motion(self) -> Array:
        """Increment (n_dofs,) of the displacements in the step that supports and multi-point constraints impose [length].

        It is the change of the displacements if all unknowns keep their values.
        """
        system, start, zero = self.problem.system, self.state.u, np.zeros_like(self.state.u)
        return self.load.lift - (start - system.displacement(system.unknowns(start, zero), zero))

    def driven(self, constraints: Constraints) -> Array:
        """Return the slips imposed by supports and obstacles in the step.

        They are divided by the largest displacement, imposed or present, so that round-off can be recognised.

        Returns
        -------
        ndarray (k, m)
            Imposed slip along each of k tangents of the m constraints [-].
        """
        slips = np.empty_like(constraints.slip0)
        for k, T in enumerate(constraints.tangents):
            slips[k] = T @ self.prescribed_motion
        # Without prescribed displacements in this step, `prescribed_motion` is the round-off of earlier displacements.
        scale = max(largest(self.prescribed_motion), largest(self.state.u))
        if isinstance(constraints, StackedConstraints):
            begin, end = self.state.obstacles, self.load.obstacles
            for name, rows in constraints.rows.items():
                if isinstance(self.problem.pairs[name].primary, RigidSide):
                    slips[:, rows] += constraints.slip0[:, rows]
                    # If the obstacle moves along the normals, its slips are round-off of this motion.
                    motion = end.get(name, np.zeros(1)) - begin.get(name, 0.0)
                    scale = max(scale, largest(constraints.slip0[:, rows]), largest(motion))
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
        Displacement components of `Problem.dofs` [length].
    """
    if step.problem.floating_bodies is not None:
        return _with_floating_bodies(step, step.problem.floating_bodies, constraints, iterate, active, accuracy)
    solution = _solve(step, constraints, iterate, active, accuracy, step.load.lift, iterate.u)
    return solution, step.problem.dofs.displacement(solution.u, step.load.lift)


def _solve(
    step: StepContext, constraints: Constraints, iterate: Iterate, active: Mask, accuracy: Accuracy, lift: Array, guess: Array
) -> Solution:  # fmt: skip
    """Return the contact solution in the unknowns that remain after supports and multi-point constraints are eliminated.

    `lift` (n_dofs,) are the displacements that supports and multi-point constraints prescribe if all unknowns are zero, and
    `guess` (n_dofs,) are initial displacements [length].
    """
    condensed = step.problem.dofs.constraints(constraints, lift, step.state.u)
    u = step.problem.dofs.unknowns(guess, lift)
    if not constraints.tangents:
        return active_set.solve(step.loaded, condensed, active, accuracy, u)
    from fastcontact.analysis.friction import solve as friction

    condensed = replace(condensed, driven=step.driven(constraints))
    slip_so_far = step.path if isinstance(step.path, SlipSoFar) and len(step.path.slip) == len(constraints) else None
    path = step.path if isinstance(step.path, Path) else None
    condensed = condensed if slip_so_far is None else in_last_increment(condensed, slip_so_far)
    solution = friction.solve(step.loaded, condensed, active, accuracy, u, iterate.frictional, path)
    iterate.frictional = solution if slip_so_far is None else over_whole_step(solution, slip_so_far)
    return iterate.frictional


def _with_floating_bodies(
    step: StepContext, bodies: FloatingBodies, constraints: Constraints, iterate: Iterate, active: Mask,
    accuracy: Accuracy,
) -> tuple[Solution, Array]:  # fmt: skip
    """Return the result of `solve_inequalities` if contact alone restrains some bodies.

    Springs that are anchored at a rigid position of these bodies hold them. `FloatingBodies.settle` iterates the position
    until the springs carry no force.
    """
    problem, state, lift, dofs = step.problem, step.state, step.load.lift, step.problem.dofs
    last_active, guess = active, iterate.u

    def solve_at(anchor: Array, loaded: Loaded = step.loaded) -> Solution:
        nonlocal last_active, guess
        shifted_lift = lift + bodies.rigid(anchor)
        solution = _solve(
            replace(step, loaded=loaded), constraints, iterate, last_active, accuracy, shifted_lift, guess
        )
        last_active, guess = solution.wanted, guess.copy()
        guess[dofs.active] = dofs.displacement(solution.u, shifted_lift)
        return solution

    def failure(text: str, **options: bool) -> ConvergenceError:
        needed = needed_friction(constraints, bodies.motions, iterate.u, *loads)
        text = text if needed is None else friction_exceeded(*needed, constraints.friction)
        text += loose_bolts_remark(problem.model.pretensions, modes, step.load.force.reshape(problem.shape))
        return ConvergenceError(text, iterate.history, **options)

    start, modes = iterate.u[bodies.dofs], bodies.motions.displacement
    model_size = float(np.ptp(problem.model.mesh.points, axis=0).max())
    force = step.load.force
    if (u := problem.linearised_at) is not None:  # residual forces, since a loaded tangent resists rigid-body rotations
        force = force - problem.system.K @ bodies.strained(u)
    # Work of the loads in each free rigid-body motion, and the size of the model.
    loads = generalised_forces(bodies.motions, force, state.largest_rigid_force), model_size
    if not iterate.history:
        rows, gap0 = cone_rows(constraints)
        shift = stopped_at(rows @ modes, gap0 + rows @ iterate.u, *loads)
        if shift is None:
            names = grouped_by_body(bodies.names)
            text = f"the loads pull bodies away, and no contact stops them ({names}): reverse the loads or add supports"
            raise failure(text, smaller_steps_help=False)
        if not (active & ~constraints.equality).any():
            start, u = start + shift, iterate.u + bodies.rigid(shift)
            # The linear program of `stopped_at` is solved to a relative accuracy of 1e-7, about that of single precision.
            gap = constraints.gap0 + constraints.B @ u
            last_active = active | constraints.usable & (gap <= SINGLE_PRECISION * model_size)
    relative_accuracy = 10 * max(problem.solver.tolerance, accuracy.residual or 0.0)
    # The response requires many linear solutions, which are cheap only if the matrix is factorised.
    position_response = None if problem.solver.iterative else partial(bodies.position_response, constraints, dofs)
    springs, load = dofs.numbers(bodies.dofs), state.largest_rigid_force
    soft_iterations, slip_so_far, round_off = 0, None, state.gap_round_off
    if position_response is not None:
        # Displacements without contact forces, which are large if bodies are flexible, cancel.
        round_off = max(round_off, SUM_ROUND_OFF * largest(step.loaded.full_solution(np.zeros(dofs.T.shape[1]))))
    in_increments = isinstance(step.path, Path)
    if constraints.tangents and (position_response is not None or in_increments):
        # With stiff springs, a problem with friction may have several solutions, and none near the position of equilibrium.
        slides, last_frictional = in_increments or not iterate.history, iterate.frictional
        softly_held = solve_at(start, bodies.with_soft_springs(step.loaded, dofs, loads[0], slides))
        soft_iterations, slip_so_far = softly_held.iterations, softly_held.slip_so_far
        if softly_held.settled:
            start = start + softly_held.u[springs]
        elif in_increments:
            return softly_held, dofs.displacement(softly_held.u, lift + bodies.rigid(start))
        else:
            iterate.frictional = last_frictional
        if in_increments:  # stiff springs are slack only at the end of the step
            step = replace(step, path=slip_so_far)
    rigid = bodies.settle(solve_at, position_response, springs, start, load, relative_accuracy, round_off)
    if rigid.solution.settled and not rigid.slack:
        gaps = gap_changes(problem.model, bodies.motions)
        raise failure(not_restrained(bodies, rigid, state.largest_rigid_force, bool(constraints.friction.any()), gaps))
    iterate.rigid = rigid
    iterations = rigid.solution.iterations + soft_iterations
    solution = replace(rigid.solution, iterations=iterations, slip_so_far=slip_so_far)
    respond = solution.response
    if position_response is not None and respond is not None:
        solution = replace(solution, response=lambda: position_response(respond()).respond)
    return solution, dofs.displacement(solution.u, lift + bodies.rigid(rigid.anchor))
