"""Displacements of a load step for known contact forces."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array

from fastcontact.analysis.geometry_loop import SettledContact
from fastcontact.analysis.problem import Problem, StepLoad
from fastcontact.arrays import Array
from fastcontact.linear.protocol import Loaded


def with_loads(problem: Problem, load: StepLoad) -> Loaded:
    """Return the equations of the step: the prepared matrix with the right-hand side of its loads."""
    return problem.solver.load(problem.system.right(load.force, load.lift))


def solve_displacements(
    problem: Problem, load: StepLoad, loaded: Loaded, settled: SettledContact | None, guess: Array
) -> tuple[Array, Array]:
    """Return all displacements [length] and the contact forces [force], both (n_dofs,).

    Without contact, iterative solvers begin at the displacements `guess` (n_dofs,) [length].
    """
    system, lift = problem.system, load.lift
    if settled is None:
        none = csr_array((0, len(lift))), np.empty(0)
        v = loaded.solve(*none, guess=system.unknowns(guess, lift))[0]
        return system.displacement(v, lift), np.zeros(len(lift))
    contact_force, rigid = settled.force, settled.iterate.rigid
    if problem.floating_bodies is not None and rigid is not None:
        lift = lift + problem.floating_bodies.rigid(rigid.position)
    v = loaded.full_solution(system.reduced(contact_force), settled.solution.u)
    return system.displacement(v, lift), contact_force
