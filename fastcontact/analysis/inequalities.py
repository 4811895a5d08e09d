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
from fastcontact.analysis.criteria import LINEAR_ERROR
from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.floating_bodies import FloatingBodies, RigidPosition
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import Accuracy, LastIncrement, LoadPath, Solution
from fastcontact.analysis.state import State
from fastcontact.arrays import AnyArray, Array, Mask, largest
from fastcontact.contact.constraints import Constraints, StackedConstraints, stacked
from fastcontact.contact.obstacles.rigid_side import RigidSide
from fastcontact.errors import ConvergenceError
from fastcontact.linear.protocol import Loaded
from fastcontact.model.checks import tips_over
from fastcontact.model.model import gap_changes
from fastcontact.model.pretension import loose_bolts_remark
from fastcontact.model.rigid_motions import (
    FACTOR_ACCURACY,
    LARGEST_COEFFICIENT,
    cone_rows,
    generalised_forces,
    grouped_by_body,
    needed_friction,
    sliding_friction,
    stopped_at,
    tipping,
)
from fastcontact.round_off import SINGLE_PRECISION, SUM_ROUND_OFF

# A node stays dry after contact has displaced fluid from it this number of times in a load step. At the front of the fluid, a
# node may be neither dry, because its mean pressure is below that of the fluid, nor wet, because its gap would close.
DISPLACEMENTS_UNTIL_DRY = 3


@dataclass(eq=False, repr=False)
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
    u, driven = iterate.u.copy(), slice(problem.model.n_dofs, None)  # a copy, since iterations reuse the array
    u[driven] = np.where(problem.system.fixed[driven], load.lift[driven], u[driven])
    parts = {}
    for name, pair in problem.pairs.items():
        configuration = problem.pairing_configuration(name, state, load, u)
        pressure, fluid = iterate.pressure.get(name), iterate.fluid.get(name)
        impermeable = None if fluid is None else fluid[1] >= DISPLACEMENTS_UNTIL_DRY
        configuration = replace(configuration, pressure=pressure, impermeable=impermeable, rounded=iterate.rounded)
        parts[name] = pair.constraints(configuration)
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
    path : LoadPath or LastIncrement, optional
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
    path: LoadPath | LastIncrement | None = None

    def with_load(self, load: StepLoad) -> StepContext:
        """Return the data of the step with another load; nonlinear bodies are linearised under it in `newton`."""
        if self.problem.bodies is not None:
            return replace(self, load=load)
        return replace(self, load=load, loaded=self.problem.loaded(load))

    @property
    def linearises_contact(self) -> bool:
        """Whether Newton's method applies to the contact geometry: with a direct solver, without fluid pressure."""
        return not (self.problem.solver.iterative or self.load.fluids)

    def imposed_slips(self, constraints: Constraints) -> Array:
        """Return the slips that supports and obstacles impose in the step.

        They are divided by the largest displacement at the beginning of the step or imposed in it, so that round-off can be
        recognised.

        Returns
        -------
        ndarray (k, m)
            Imposed slip along each of k tangents of the m constraints [-].
        """
        system, start, slips = self.problem.system, self.state.u, np.empty_like(constraints.slip0)
        zero = np.zeros_like(start)
        # The change of the displacements if all unknowns keep their values. Without prescribed displacements in this step, it
        # is the round-off of earlier displacements.
        prescribed_motion = self.load.lift - (start - system.displacement(system.unknowns(start), zero))
        for k, T in enumerate(constraints.tangents):
            slips[k] = T @ prescribed_motion
        scale = max(largest(prescribed_motion), largest(start))
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
    problem, lift = step.problem, step.load.lift
    if problem.floating_bodies is not None:
        contact = _FloatingContact(step, constraints, iterate, active, accuracy, problem.floating_bodies, iterate.u)
        return contact.settled()
    solution = _solution(step, constraints, iterate, active, accuracy, lift, iterate.u)
    return solution, lift[problem.dofs.active] + problem.dofs.T @ solution.u


def _solution(
    step: StepContext, constraints: Constraints, iterate: Iterate, active: Mask, accuracy: Accuracy, lift: Array,
    guess: Array,
) -> Solution:  # fmt: skip
    """Return the solution in the unknowns that remain after supports and multi-point constraints are eliminated.

    `lift` (n_dofs,) are the displacements that supports and multi-point constraints prescribe if all unknowns are zero, and
    `guess` (n_dofs,) are initial displacements [length]. For the other parameters see `solve_inequalities`.
    """
    problem, path, dofs = step.problem, step.path, step.problem.dofs
    reduced = dofs.constraints(constraints, lift, step.state.u)
    u = problem.system.unknowns(guess, lift)[dofs.unknowns]
    if not reduced.tangents:
        return active_set.solve(step.loaded, reduced, active, accuracy, u)
    from fastcontact.analysis.friction import solve as friction

    reduced = replace(reduced, driven=step.imposed_slips(constraints))
    if isinstance(path, LastIncrement) and len(path.slip) == len(reduced):
        reduced = path.since_its_beginning(reduced)
        solution = friction.solve(step.loaded, reduced, active, accuracy, u, iterate.frictional)
        iterate.frictional = path.over_whole_step(solution)
    else:
        path = path if isinstance(path, LoadPath) else None
        iterate.frictional = friction.solve(step.loaded, reduced, active, accuracy, u, iterate.frictional, path)
    return iterate.frictional


@dataclass(eq=False, repr=False)
class _FloatingContact:
    """Contact problem of one pairing if contact alone restrains some bodies, which springs hold.

    The springs are anchored at a rigid position of these bodies. `FloatingBodies.settle` iterates the position until the
    springs carry no force.

    Attributes
    ----------
    step, constraints, iterate, accuracy
        See `solve_inequalities`.
    active : ndarray of bool (m,)
        Initial active set of the next solution.
    bodies : FloatingBodies
    guess : ndarray (n_dofs,)
        Displacements of the last solution, the initial guess of the next one [length].
    """

    step: StepContext
    constraints: Constraints
    iterate: Iterate
    active: Mask
    accuracy: Accuracy
    bodies: FloatingBodies
    guess: Array

    def settled(self) -> tuple[Solution, Array]:
        """Return the result of `solve_inequalities`."""
        step, bodies, constraints, iterate = self.step, self.bodies, self.constraints, self.iterate
        problem, dofs, largest_load = step.problem, step.problem.dofs, step.state.largest_rigid_force
        start = iterate.u[bodies.dofs] if iterate.history else self.first_position()
        relative_accuracy = LINEAR_ERROR * max(problem.solver.tolerance, self.accuracy.residual or 0.0)
        position_response, round_off = None, step.state.gap_round_off
        if not problem.solver.iterative:  # the response requires many solutions, which are cheap if K is factorised
            position_response = partial(bodies.position_response, constraints, dofs)
            # Displacements without contact forces, which are large if bodies are flexible, cancel.
            round_off = max(round_off, SUM_ROUND_OFF * largest(step.loaded.full_solution(np.zeros(dofs.T.shape[1]))))
        in_increments, on_soft_springs = isinstance(step.path, LoadPath), None
        if constraints.tangents and (position_response is not None or in_increments):
            on_soft_springs = self.solve_on_soft_springs(start, in_increments)
            if on_soft_springs.settled:
                if (sliding := self.sliding(on_soft_springs)) is not None:
                    # The normal forces depend on the geometry, which has not converged yet.
                    before = sum(float(forces.pressing.sum()) for forces in step.state.forces.values())
                    change = abs(float(on_soft_springs.multiplier.sum()) - before)
                    raise self.failure("", change > (sliding[0] - 1.0) * before, sliding)
                start = start + on_soft_springs.u[dofs.springs]
            elif in_increments:
                return on_soft_springs, self.guess[dofs.active]
            if in_increments:  # stiff springs are slack only at the end of the step
                self.step = replace(step, path=on_soft_springs.last_increment)
        accuracy = largest_load, relative_accuracy, round_off
        rigid = bodies.settle(self.solve_at, position_response, dofs.springs, start, *accuracy)
        if rigid.solution.settled and not rigid.slack:
            gaps, has_friction = gap_changes(problem.model, bodies.motions), bool(constraints.friction.any())
            raise self.failure(not_restrained(bodies, rigid, largest_load, has_friction, gaps))
        iterate.rigid, solution = rigid, rigid.solution
        if on_soft_springs is not None:
            iterations = solution.iterations + on_soft_springs.iterations
            solution = replace(solution, iterations=iterations, last_increment=on_soft_springs.last_increment)
        if position_response is not None and (respond := solution.response) is not None:
            solution = replace(solution, response=lambda: position_response(respond()).respond)
        return solution, self.guess[dofs.active]

    @cached_property
    def loads(self) -> tuple[Array, float]:
        """Generalised forces (k,) of the loads in the free rigid-body modes [force], and the size of the model [length]."""
        problem, force = self.step.problem, self.step.load.force
        if problem.linearised_at is not None:  # residual forces, since a loaded tangent resists rigid-body rotations
            force = force - problem.system.K @ self.bodies.strained(problem.linearised_at)
        model_size = float(np.ptp(problem.model.mesh.points, axis=0).max())
        return generalised_forces(self.bodies.motions, force, self.step.state.largest_rigid_force), model_size

    def solve_at(self, anchor: Array, loaded: Loaded | None = None) -> Solution:
        """Return the solution with springs anchored at a rigid position (k,) [length]; `loaded` may contain other springs."""
        lift, dofs = self.step.load.lift + self.bodies.rigid(anchor), self.step.problem.dofs
        step = self.step if loaded is None else replace(self.step, loaded=loaded)
        solution = _solution(step, self.constraints, self.iterate, self.active, self.accuracy, lift, self.guess)
        self.active, self.guess = solution.next_active, self.guess.copy()
        self.guess[dofs.active] = lift[dofs.active] + dofs.T @ solution.u
        return solution

    def solve_on_soft_springs(self, anchor: Array, in_increments: bool) -> Solution:
        """Return the solution with soft springs that are anchored at a rigid position (k,) [length].

        With stiff springs, a problem with friction may have several solutions, none of them near the position of equilibrium.
        If the iteration does not converge, its forces are discarded as an initial guess, except in increments.
        """
        step, iterate, last_frictional = self.step, self.iterate, self.iterate.frictional
        slides = in_increments or not iterate.history
        loaded = self.bodies.with_soft_springs(step.loaded, step.problem.dofs, self.loads[0], slides)
        solution = self.solve_at(anchor, loaded)
        if not (solution.settled or in_increments):
            iterate.frictional = last_frictional
        return solution

    def sliding(self, solution: Solution) -> tuple[float, list[str]] | None:
        """Return the result of `sliding_friction` for a solution on soft springs, or None if friction holds the bodies.

        Bodies that friction cannot hold slide until the springs carry the rest of the load. The residual forces of nonlinear
        bodies are not those of the loads before Newton's method has converged.
        """
        if self.step.problem.bodies is not None or not solution.settled:
            return None
        sliding = sliding_friction(self.constraints, self.bodies.motions, solution.multiplier, self.loads[0])
        return None if sliding is None or sliding[0] <= 1.0 + FACTOR_ACCURACY else sliding

    def first_position(self) -> Array:
        """Return the first position (k,) of the springs in a load step [length].

        If no constraint is active, it is the position at which contact stops the rigid bodies under the loads, and the
        constraints that are closed there become active.
        """
        bodies, constraints, u = self.bodies, self.constraints, self.guess
        rows, gap0 = cone_rows(constraints)
        shift = stopped_at(rows @ bodies.motions.displacement, gap0 + rows @ u, *self.loads)
        if shift is None:
            names = grouped_by_body(bodies.names)
            text = f"the loads pull bodies away, and no contact stops them ({names}): reverse the loads or add supports"
            raise self.failure(text, smaller_steps_help=False)
        if (self.active & ~constraints.equality).any():
            return u[bodies.dofs]
        # The linear program of `stopped_at` is solved to a relative accuracy of 1e-7, about that of single precision.
        gap = constraints.gap0 + constraints.B @ (u + bodies.rigid(shift))
        self.active = self.active | constraints.usable & (gap <= SINGLE_PRECISION * self.loads[1])
        return u[bodies.dofs] + shift

    def failure(
        self, text: str, smaller_steps_help: bool = True, sliding: tuple[float, list[str]] | None = None
    ) -> ConvergenceError:
        """Return the error with a `text`, with bodies that tip over, or with the coefficient of friction needed."""
        problem, motions, constraints = self.step.problem, self.bodies.motions, self.constraints
        needed = sliding or needed_friction(constraints, motions, self.iterate.u, *self.loads)
        tipping_bodies = ""
        if needed is not None or not smaller_steps_help:  # loads move the bodies without limit
            factor = LARGEST_COEFFICIENT / (largest(constraints.friction) or LARGEST_COEFFICIENT)
            rows, _ = cone_rows(constraints, factor)
            tipping_bodies = tipping(motions, rows @ motions.displacement, self.loads[0])
        if tipping_bodies:
            text, smaller_steps_help = tips_over(tipping_bodies), False
        elif needed is not None:
            if sliding is None and not problem.solver.iterative:
                position = self.iterate.u[self.bodies.dofs]
                sliding = self.sliding(self.solve_on_soft_springs(position, in_increments=False))
            text = friction_exceeded(*(sliding or needed), constraints.friction, at_least=sliding is None)
        forces = self.step.load.force.reshape(problem.shape)
        text += loose_bolts_remark(problem.model.pretensions, motions.displacement, forces)
        return ConvergenceError(text, self.iterate.history, smaller_steps_help=smaller_steps_help)
