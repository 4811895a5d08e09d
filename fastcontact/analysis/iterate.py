"""Iterate of the geometry loop: the data that one pairing of the contact surfaces passes to the next."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from fastcontact.analysis.extrapolation import Extrapolation
from fastcontact.analysis.floating_bodies import RigidPosition
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.analysis.solution import FrictionalEquilibrium, Solution
from fastcontact.analysis.state import State
from fastcontact.arrays import Array, Mask
from fastcontact.contact.constraints import Constraints, StackedConstraints, stacked
from fastcontact.contact.obstacles.rigid_side import RigidSide


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
    frictional : FrictionalEquilibrium, optional
        The last solution with friction.
    rigid : RigidPosition, optional
        The last position of floating bodies.
    history : list of dict
        Convergence data of each pairing, see `StepResult.iterations`.
    rounded : bool
        Whether edges between facets are rounded, because nodes alternated between facets.
    """

    u: Array
    active: dict[str, Mask]
    pressure: dict[str, Array]
    frictional: FrictionalEquilibrium | None = None
    rigid: RigidPosition | None = None
    history: list[dict[str, Any]] = field(default_factory=list)
    rounded: bool = False

    @classmethod
    def of(cls, state: State) -> Iterate:
        """Return the initial iterate of a load step."""
        return cls(state.u.copy(), dict(state.active), dict(state.pressure))

    def begin_again(self, state: State) -> None:
        """Reset the iterate to the state at the beginning of the load step; the history is kept."""
        self.u, self.active, self.pressure = state.u.copy(), dict(state.active), dict(state.pressure)
        self.frictional = self.rigid = None

    def remember(self, constraints: StackedConstraints, solution: Solution) -> None:
        """Store, for each pair, the active set that the solution predicts, and its nodal pressures without those of fluid."""
        for name, rows in constraints.rows().items():
            self.active[name] = solution.wanted[rows]
            forces = constraints.parts[name].contact_forces(solution.multiplier[rows])
            self.pressure[name] = constraints.parts[name].pressure(forces)


def pair_surfaces(problem: Problem, state: State, load: StepLoad, iterate: Iterate) -> StackedConstraints:
    """Pair both sides of every contact pair on the deformed configuration, with `keep_pairing` on the undeformed one."""
    displacement, u = problem.displacement(iterate.u).copy(), iterate.u  # which later iterations overwrite
    if len(problem.force_driven):
        u = np.where(problem.system.fixed, load.lift, u)
    paired_at = np.zeros_like(displacement) if problem.criteria.keep_pairing else displacement
    positions, parts = problem.force_driven.positions(u), {}
    no_motion = np.zeros(problem.model.mesh.dim)
    for name, pair in problem.pairs.items():
        at = replace(problem.configuration(name, state, load, paired_at, u), pressure=iterate.pressure.get(name))
        rotates = isinstance(pair.primary, RigidSide) and pair.primary.rotation is not None
        moved = at.obstacle - at.obstacle_start if rotates else None
        constraints_of_pair = pair.constraints(replace(at, rounded=True) if iterate.rounded else at)
        parts[name] = problem.force_driven.constraints(name, constraints_of_pair, positions.get(name, no_motion), moved)
    return stacked(parts)


def initially_active(constraints: StackedConstraints, iterate: Iterate, extrapolation: Extrapolation | None) -> Mask:
    """Return the initial active set (m,): the one predicted by the last solution, or extrapolated at the first pairing."""
    sets = [_start_of(name, part, iterate, extrapolation) for name, part in constraints.parts.items()]
    return np.concatenate(sets)


def _start_of(name: str, constraints: Constraints, iterate: Iterate, extrapolation: Extrapolation | None) -> Mask:
    """Return the initial active set of the contact pair `name`; see `initially_active`."""
    if constraints.equality is not None and constraints.equality.all():
        return constraints.equality
    if name not in iterate.active:
        return np.zeros(len(constraints), bool)
    active = constraints.initially_active(iterate.u, iterate.pressure[name])
    if active is not None:
        return active
    last = iterate.active[name]
    return last if extrapolation is None else extrapolation.active(name, last)
